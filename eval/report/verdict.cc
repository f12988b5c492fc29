#include "eval/report/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <tuple>

#include "calib/base/counted.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

constexpr int kLeastForShift = 3;

int Count(const nlohmann::json& json, const char* key) { return static_cast<int>(At(json, {key}).value_or(0)); }

VerdictErrors ErrorsOf(const ReportData& data, const nlohmann::json& group, const std::string& variant) {
  VerdictErrors errors;
  errors.group = group;
  errors.variant = TextAt(group, "variant").empty() ? variant : TextAt(group, "variant");
  errors.method = TextAt(group, "method"), errors.reference = TextAt(group, "reference");
  errors.kind = TextAt(group, "kind"), errors.shares_evidence = FlagAt(group, "shares_evidence");
  errors.answers = Count(group, "answers"), errors.attempts = Count(group, "attempts");
  errors.median_m = At(group, {"error_3d", "over_answers", "median_m"});
  errors.p90_m = At(group, {"error_3d", "over_answers", "p90_m"});
  errors.worst_m = At(group, {"error_3d", "over_answers", "max_m"});
  std::map<std::string, std::vector<double>> of_run;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int vectors = 0, answered = 0;
  for (const VariantData& v : data.variants) {
    for (const ErrorRecord& e : v.errors) {
      if (!e.Answered() || !errors.Holds(e)) continue;
      of_run[e.run].push_back(*e.error_3d_m);
      ++answered;
      if (!e.error_enu_m) continue;
      sum += *e.error_enu_m;
      ++vectors;
    }
  }
  for (const auto& [run, values] : of_run) errors.run_median_m[run] = Quantile(values, 0.5);
  if (vectors >= kLeastForShift && vectors == answered) errors.common_shift_m = (sum / vectors).norm();
  return errors;
}

void ChooseErrors(const ReportData& data, const std::string& variant, ProjectVerdict* verdict) {
  for (const VariantData& v : data.variants) {
    const auto groups = v.summary.find("groups");
    if (groups == v.summary.end() || !groups->is_array()) continue;
    for (const nlohmann::json& group : *groups) {
      if (!group.is_object()) continue;
      VerdictErrors errors = ErrorsOf(data, group, v.variant);
      const bool own = errors.variant == variant, beside = variant.empty() && errors.variant == "paper";
      const bool absolute = errors.kind == "absolute", g1 = errors.method == "g1";
      if (!errors.median_m || (!own && (!beside || g1))) continue;
      std::optional<VerdictErrors>& place = !own ? (absolute ? verdict->paper_absolute : verdict->paper_relative)
                                            : g1 ? (absolute ? verdict->g1_absolute : verdict->g1_relative)
                                                 : (absolute ? verdict->absolute : verdict->relative);
      if (!place || IsBetter(errors, *place)) place = std::move(errors);
    }
  }
}

// Of `geotags` right ones, one or more lies so many sigmas off with a probability of more than 1 %.
bool MayBeChance(bool horizontal, double sigmas, int64_t geotags) {
  constexpr double kUnlikely = 0.01;
  const double beyond = 1 - ChiSquareCdf(sigmas * sigmas, horizontal ? 2 : 1);
  return beyond * static_cast<double>(geotags) > kUnlikely;
}

void FindGeotags(const ReportInput& input, const ReportData& data, const std::string& variant,
                 ProjectVerdict* verdict) {
  std::map<std::string, VerdictGeotag> worst;
  for (const RunData& run : data.runs) {
    if (run.variant != variant) continue;
    const auto compared = std::count_if(run.answers.begin(), run.answers.end(),
                                        [](const RunData::Answer& a) { return a.geotag_off_m.has_value(); });
    for (const RunData::Answer& a : run.answers) {
      if (a.geotag_status != "outlier" || !a.geotag_off_m) continue;
      const auto consider = [&](const char* direction, double off_m, std::optional<double> sigmas) {
        const bool horizontal = std::string_view(direction) == "horizontally";
        if (sigmas && MayBeChance(horizontal, *sigmas, compared)) return;
        VerdictGeotag& g = worst[a.panorama];
        const bool more = g.sigmas && sigmas ? *sigmas > *g.sigmas : off_m > g.off_m;
        if (more) g = {a.panorama, a.station, run.run, off_m, direction, sigmas};
      };
      const Reference* reference = nullptr;
      for (const Reference& its : input.project->site().references) {
        if (its.name == a.panorama) reference = &its;
      }
      const auto in_sigmas = [&](double off_m, const std::optional<double>& own, double GeoTag::*stated) {
        const double sigma = own && reference != nullptr ? std::hypot(reference->geotag.*stated, *own) : 0;
        return sigma > 0 ? std::optional<double>(off_m / sigma) : std::nullopt;
      };
      consider("horizontally", *a.geotag_off_m, in_sigmas(*a.geotag_off_m, a.sigma_h_m, &GeoTag::sigma_h_m));
      if (!a.geotag_up_m || reference == nullptr || !reference->geotag.has_height) continue;
      const double up = std::abs(*a.geotag_up_m);
      consider("vertically", up, in_sigmas(up, a.sigma_v_m, &GeoTag::sigma_v_m));
    }
  }
  for (const auto& [name, geotag] : worst) verdict->geotags.push_back(geotag);
  std::stable_sort(verdict->geotags.begin(), verdict->geotags.end(),
                   [](const auto& a, const auto& b) { return a.sigmas.value_or(0) > b.sigmas.value_or(0); });
}

// Sigmas, and how far apart runs put the same panorama.
void FindAgreement(const ReportData& data, const std::string& variant, ProjectVerdict* verdict) {
  std::vector<double> sigmas, distances;
  std::map<std::string, std::vector<Eigen::Vector3d>> places;
  for (const RunData& run : data.runs) {
    if (run.variant != variant || !FlagAt(ObjectAt(run.manifest, "metrics"), "on_earth")) continue;
    for (const RunData::Answer& a : run.answers) {
      if (a.status != "localized") continue;
      if (a.sigma_m) sigmas.push_back(*a.sigma_m);
      if (!a.place_m) continue;
      for (const Eigen::Vector3d& other : places[a.panorama]) distances.push_back((other - *a.place_m).norm());
      places[a.panorama].push_back(*a.place_m);
    }
  }
  if (!sigmas.empty()) verdict->stated_sigma_m = Quantile(sigmas, 0.5);
  if (!distances.empty()) verdict->runs_agree_m = Quantile(distances, 0.5);
  verdict->agreeing_pairs = static_cast<int>(distances.size());
}

void ReadGates(const ReportInput& input, const ReportData& data, const std::string& wanted, ProjectVerdict* verdict) {
  const auto read = [&](const nlohmann::json& table) {
    verdict->gates = TextAt(table, "verdict");
    const auto rows = table.find("gates");
    if (rows == table.end() || !rows->is_array()) return;
    for (const nlohmann::json& gate : *rows) {
      verdict->gate_results.emplace_back(TextAt(gate, "verdict"), TextAt(gate, "message"));
    }
  };
  for (const auto& [variant, table] : data.gates) {
    if (variant == wanted) read(table);
  }
  verdict->default_gates = verdict->gates.empty() && wanted.empty() && input.default_gates.is_object();
  if (verdict->default_gates) read(input.default_gates);
}

}  // namespace

std::optional<SigmaTest> SigmasOf(const nlohmann::json& group) {
  const nlohmann::json& all = ObjectAt(group, "nees");
  const nlohmann::json& joint = ObjectAt(all, "joint");
  const nlohmann::json& nees = joint.empty() ? all : joint;
  const auto per_dof = At(nees, {"mean_per_dof"});
  const auto bounds = IntervalAt(nees, "bounds");
  if (!per_dof || !bounds) return {};
  return SigmaTest{*per_dof, bounds->low, bounds->high};
}

std::optional<SigmaTest> VerdictErrors::Sigmas() const { return SigmasOf(group); }

std::string ProjectVerdict::ReferenceWord() const {
  return photos == 0 ? "panoramas" : panoramas == 0 ? "photos" : "panoramas and photos";
}

std::string ProjectVerdict::RelativeSigmas() const {
  if (!relative || Best() == &*relative) return "";
  const std::optional<SigmaTest> test = relative->Sigmas();
  if (!test || test->Consistent()) return "";
  return fmt::format("in runs' own frames {:.2f}: {}", test->anees, test->Words());
}

std::string ProjectVerdict::CountedReferences() const {
  const std::string of_panoramas = Counted(panoramas, "panorama"), of_photos = Counted(photos, "photo");
  return photos == 0 ? of_panoramas : panoramas == 0 ? of_photos : of_panoramas + " and " + of_photos;
}

int ProjectVerdict::Images() const {
  int sum = 0;
  for (const VerdictRun& run : runs) sum += run.images;
  return sum;
}

int ProjectVerdict::Localized() const {
  int sum = 0;
  for (const VerdictRun& run : runs) sum += run.localized;
  return sum;
}

int ProjectVerdict::Asked() const {
  int sum = 0;
  for (const VerdictRun& run : runs) sum += run.Asked();
  return sum;
}

Tone GateTone(const std::string& verdict) {
  return verdict == "passed" ? Tone::kGood : verdict == "failed" ? Tone::kBad : Tone::kWarning;
}

ProjectVerdict MakeVerdict(const ReportInput& input, const ReportData& data, const std::string& variant) {
  ProjectVerdict verdict;
  for (const Reference& reference : input.project->site().references) {
    ++(reference.kind == ReferenceKind::kPhoto ? verdict.photos : verdict.panoramas);
  }
  for (const RunData& run : data.runs) {
    if (run.variant != variant) continue;
    VerdictRun& r = verdict.runs.emplace_back();
    r.run = run.run;
    const nlohmann::json& metrics = ObjectAt(run.manifest, "metrics");
    r.images = Count(metrics, "images");
    r.georeferenced = FlagAt(metrics, "on_earth");
    r.source = TextAt(metrics, r.georeferenced ? "earth_source" : "earth_reason");
    for (const RunData::Answer& a : run.answers) {
      if (a.status == "localized") {
        ++r.localized;
        continue;
      }
      ++(a.status == "rejected" ? r.rejected : r.unmatched);
      verdict.refused.push_back({run.run, a.panorama, a.station, a.status, a.reason});
    }
  }
  ChooseErrors(data, variant, &verdict);
  FindGeotags(input, data, variant, &verdict);
  FindAgreement(data, variant, &verdict);
  ReadGates(input, data, variant, &verdict);
  return verdict;
}

}  // namespace trigpoint
