#include "app/cli/project_facts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/pipeline/jobs.h"
#include "eval/report/verdict.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

class VerdictFacts {
 public:
  VerdictFacts(const ProjectVerdict& verdict, const ReportData& data, const DisplayUnit& unit, Ending* ending)
      : verdict_(verdict), data_(data), unit_(unit), ending_(*ending) {}

  void Add(const ProjectFactsOptions& options) {
    Located();
    if (options.errors && verdict_.Best() != nullptr) {
      Measured();
    } else {
      Unmeasured();
    }
    if (options.check_points) CheckPoints();
    for (const VerdictRun& run : verdict_.runs) {
      if (!run.georeferenced && run.Asked() > 0)
        ending_.Problem("Frame", run.run + " is not georeferenced: " + run.source);
    }
    for (const VerdictGeotag& g : verdict_.geotags) {
      ending_.Problem("Warning", fs::path(g.panorama).filename().string() + ": geotag off by " + Length(g.off_m) + " " +
                                     g.direction + (g.sigmas ? fmt::format(" ({:.1f} sigma)", *g.sigmas) : ""));
    }
  }

  // The tag map at surveyed points that did not help to make it.
  void CheckPoints() {
    const nlohmann::json& check = ObjectAt(data_.survey, "check");
    const auto n = At(check, {"n"}), h = At(check, {"rmse_h_m"}), v = At(check, {"rmse_v_m"});
    if (!n || *n < 1 || !h || !v) return;
    std::vector<std::string> names;
    const auto points = data_.survey.find("points");
    if (points != data_.survey.end() && points->is_array()) {
      for (const nlohmann::json& point : *points) {
        const std::string name = TextAt(point, "name");
        if (!FlagAt(point, "checked") || name.empty()) continue;  // not those that moved
        const bool is_tag = name.find_first_not_of("0123456789") == std::string::npos;
        names.push_back((is_tag ? "tag " : "") + name);
      }
    }
    ending_.Fact("Check", fmt::format("{}: {} horizontal, {} vertical ({}{}, tag map)",
                                      names.empty() ? "tag map" : Listed(names, 3), Length(h), Length(v),
                                      Counted(static_cast<int64_t>(*n), "check point"), *n > 1 ? ", RMSE" : ""));
  }

 private:
  std::string Length(std::optional<double> metres) const {
    if (!metres) return "-";
    const double value = *metres / unit_.metres;
    return fmt::format("{:.{}f} {}", value, value < 0.1 ? 3 : 2, unit_.name);
  }

  void Measured() {
    if (verdict_.relative) Errors("Relative", *verdict_.relative);
    if (verdict_.absolute) Errors("Absolute", *verdict_.absolute);
    PerRun();
    Pair("View (G1)", verdict_.g1_relative, verdict_.g1_absolute, "each view by itself");
    Pair("Paper", verdict_.paper_relative, verdict_.paper_absolute, "variant paper: the method as published");
    Sigmas();
  }

  void Located() {
    if (verdict_.Asked() == 0) return;
    std::vector<std::string> refused;
    // A refusal says more than a panorama that a run did not pass.
    for (const char* status : {"rejected", "unmatched"}) {
      for (const VerdictRefusal& r : verdict_.refused) {
        if (r.status != status) continue;
        const fs::path name = fs::path(r.panorama).filename();
        const std::string place = r.station.empty() || !name.has_extension() ? name.string() : r.station;  // or a set
        refused.push_back(r.run + "/" + place + (r.status == "unmatched" ? " (no match)" : " (refused)"));
      }
    }
    ending_.Fact("Located", fmt::format("{} of {}, {} by {}", verdict_.Localized(), verdict_.Asked(),
                                        verdict_.CountedReferences(), Counted(verdict_.runs.size(), "run")) +
                                (refused.empty() ? "" : "; not " + Listed(refused, 3)));
  }

  void Errors(const std::string& label, const VerdictErrors& e) {
    std::string text = fmt::format("median {}, worst {}   ({} against {}", Length(e.median_m), Length(e.worst_m),
                                   Counted(e.answers, "answer"), e.Against());
    if (e.shares_evidence && e.reference != "self") text += ", which shares data with the answers";
    if (e.common_shift_m && e.kind == "absolute")
      text += "; " + Length(e.common_shift_m) + " of it common to all: " + Cause();
    ending_.Fact(label, text + ")");
  }

  // What moves all answers alike.
  std::string Cause() const {
    std::string source;
    for (const VerdictRun& run : verdict_.runs) {
      if (!run.georeferenced) continue;
      if (!source.empty() && run.source != source) return "the georeference's shift";
      source = run.source;
    }
    return source == "geotags" ? "the geotags' shift"
           : source == "gps"   ? "the GPS's shift"
                               : "the georeference's shift";
  }

  void PerRun() {
    const VerdictErrors* best = verdict_.Best();
    if (best == nullptr || best->run_median_m.size() < 2) return;
    std::vector<std::pair<std::string, double>> runs(best->run_median_m.begin(), best->run_median_m.end());
    constexpr size_t kShown = 6;
    std::string which = best->kind;
    if (runs.size() > kShown) {
      std::stable_sort(runs.begin(), runs.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
      which += ", the worst first";
    }
    std::vector<std::string> texts;
    for (const auto& [run, median] : runs) texts.push_back(run + " " + Length(median));
    ending_.Fact("Per run", Listed(texts, kShown) + " (median, " + which + ")");
  }

  void Pair(const std::string& label, const std::optional<VerdictErrors>& relative,
            const std::optional<VerdictErrors>& absolute, const std::string& what) {
    if (!relative && !absolute) return;
    std::string text;
    if (relative) text += Length(relative->median_m) + " relative";
    if (absolute) text += (text.empty() ? "" : ", ") + Length(absolute->median_m) + " absolute";
    ending_.Fact(label, text + " (median; " + what + ")");
  }

  // What can be said without tags.
  void Unmeasured() {
    if (verdict_.stated_sigma_m) {
      ending_.Fact("Sigma", Length(verdict_.stated_sigma_m) +
                                " stated by the answers (1 sigma, largest axis, median); not measured");
    }
    if (verdict_.runs_agree_m) {
      ending_.Fact("Agreement", fmt::format("{} between runs (median of {} of the same panorama)",
                                            Length(verdict_.runs_agree_m), Counted(verdict_.agreeing_pairs, "pair")));
    }
  }

  void Sigmas() {
    const VerdictErrors* best = verdict_.Best();
    if (best == nullptr) return;
    const std::optional<SigmaTest> test = best->Sigmas();
    if (!test) return;
    const std::string relative = verdict_.RelativeSigmas();
    ending_.Fact("Sigmas",
                 fmt::format("{} (ANEES, squared errors over their variances, {:.2f}; right sigmas: {:.2f} to {:.2f})",
                             test->Words(), test->anees, test->low, test->high) +
                     (relative.empty() ? "" : "; " + relative));
  }

  const ProjectVerdict& verdict_;
  const ReportData& data_;
  const DisplayUnit& unit_;
  Ending& ending_;
};

}  // namespace

void AddCheckPoints(const Project& project, const DisplayUnit& unit, Ending* ending) {
  ReportInput input;
  input.project = &project;
  input.points = false;
  ProgressSink silent;
  const ReportData data = ReadReportData(input, silent, CancelToken());
  VerdictFacts(MakeVerdict(input, data), data, unit, ending).CheckPoints();
}

void AddProjectFacts(const Project& project, const DisplayUnit& unit, const ProjectFactsOptions& options,
                     Ending* ending) {
  ReportInput input;
  input.project = &project;
  input.variants = KnownVariants(project);
  input.points = false;
  for (const std::string& variant : input.variants) {
    for (const std::string& run : project.RunNames()) {
      const std::string name = ResultName(StageNamed("localize"), {run, variant});
      if (auto manifest = ReadManifest(project, "localize", name)) {
        input.stages.push_back({"localize", name, "done", "", std::move(*manifest)});
      }
    }
  }
  ProgressSink silent;
  const ReportData data = ReadReportData(input, silent, CancelToken());
  VerdictFacts(MakeVerdict(input, data, options.variant), data, unit, ending).Add(options);
}

}  // namespace trigpoint
