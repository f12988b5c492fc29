// The first screen.
#include "eval/report/chapter_verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "calib/base/counted.h"
#include "datasets/io/photo_sets.h"
#include "eval/report/chapters.h"
#include "eval/report/charts.h"
#include "eval/report/verdict.h"

namespace trigpoint {
namespace {

constexpr size_t kTiles = 8;    // runs with a tile of their own
constexpr size_t kAcross = 14;  // stations side by side; with more they stand below each other
constexpr size_t kMatrixRows = 30;
constexpr double kShortMatrix = 320;  // pixels
constexpr size_t kThings = 3;         // that went worst

class VerdictChapter {
 public:
  VerdictChapter(const ChapterContext& c, std::vector<Block>* blocks)
      : c_(c), blocks_(*blocks), verdict_(MakeVerdict(c.input, c.data)), places_(c.data) {}

  void Add(std::optional<Figure> plan) {
    blocks_.push_back(Heading{2, "Verdict", "summary"});
    About();
    Stale();
    Gates();
    blocks_.push_back(Columns::kBegin);
    Numbers();
    Runs();
    Worst();
    blocks_.push_back(Columns::kNext);
    // A short matrix comes first, so that both are on the first screen.
    std::optional<Figure> matrix = Matrix();
    const bool first = matrix && std::get<Drawing>(matrix->content).height < kShortMatrix;
    if (!first) std::swap(matrix, plan);
    for (std::optional<Figure>* figure : {&matrix, &plan}) {
      if (*figure) blocks_.push_back(std::move(**figure));
    }
    blocks_.push_back(Columns::kEnd);
  }

 private:
  const Site& site() const { return c_.input.project->site(); }

  // Shown alone it stands below the one next step, which it must not contradict.
  void WithoutRuns() {
    const Site& s = site();
    if (!s.runs.empty() || !s.broken_runs.empty()) {
      blocks_.push_back(Paragraph{std::string("No run of this project is localized yet, so there are no answers to "
                                              "show.") +
                                      (c_.alone ? ""
                                                : " Provenance lists what was found and what failed. Next: "
                                                  "trigpoint run."),
                                  Tone::kWarning});
      return;
    }
    const bool stitched = !c_.data.stitched.empty(), sets = !PhotoSetFolders(s.dir).empty();
    if (!stitched && !sets && s.references.empty()) {
      blocks_.push_back(Paragraph{"There are neither photos nor runs, so there is nothing to localize."});
      return;
    }
    std::string text = "There are photos but no run, so there is nothing to localize.";
    if (!c_.alone && stitched) text += " Stitched panoramas are shown below.";
    if (c_.alone && sets) text += " Sets of photos are stitched to panoramas.";
    blocks_.push_back(Paragraph{text});
  }

  void About() {
    if (c_.data.runs.empty()) return WithoutRuns();
    std::string text = Counted(verdict_.runs.size(), "run");
    if (verdict_.Images() > 0) text += " (" + Counted(verdict_.Images(), "image") + ")";
    if (verdict_.Asked() == 0) {
      blocks_.push_back(Paragraph{text +
                                  " without panoramas or photos of known position: there is nothing to localize. "
                                  "The poses of the images are in results/localize/<run>/cameras_odom.tum."});
      return;
    }
    text += " localized against " + verdict_.CountedReferences();
    const size_t tags = std::set<std::string>(c_.data.stations.begin(), c_.data.stations.end()).size();
    text += verdict_.Best() != nullptr
                ? fmt::format(
                      ". An answer is the pose of a whole panorama (G2); it is compared with AprilTags at {}{}.",
                      Counted(tags, "station"),
                      site().control_points.empty() ? ""
                                                    : " and " + Counted(site().control_points.size(), "surveyed point"))
                : ". There is no reference to compare the answers with, so their accuracy is not measured here.";
    blocks_.push_back(Paragraph{text});
  }

  // An evaluation that is older than the results it is about.
  void Stale() {
    for (const ResultRecord& s : c_.input.stages) {
      const bool gates = s.stage == "gates";
      if ((s.stage != "evaluate" && !gates) || !s.manifest.is_object() ||
          (s.state != "out of date" && s.state != "failed")) {
        continue;
      }
      blocks_.push_back(Paragraph{
          (gates ? "The table of gates" : "The evaluation") + (s.name.empty() ? "" : " " + s.name) + " is " + s.state +
              (s.reason.empty() ? "" : " (" + s.reason + ")") + ": its numbers belong to earlier results." +
              (c_.alone ? "" : " Next: trigpoint " + s.stage + "."),
          Tone::kWarning});
    }
  }

  void Gates() {
    if (verdict_.gates.empty()) return;
    std::vector<std::string> others;
    for (const auto& [verdict, message] : verdict_.gate_results) {
      if (verdict != "passed" || verdict_.gate_results.size() == 1) others.push_back(message);
    }
    const size_t all = verdict_.gate_results.size();
    std::string text = verdict_.default_gates ? "Default gates (trigpoint.yaml sets none): " : "Quality gates: ";
    const bool repeats = all == 1 && !others.empty() && others.front().starts_with(verdict_.gates);
    if (!repeats) text += verdict_.gates;
    if (all > 1) text += fmt::format(", {} of {} passed", all - others.size(), all);
    // Of the default ones the first, so that the screen has room; all of a project's own.
    const size_t shown = verdict_.default_gates ? std::min(size_t{1}, others.size()) : others.size();
    for (size_t i = 0; i < shown; ++i) text += (i > 0 || !repeats ? "; " : "") + others[i];
    text += ".";
    if (shown < others.size()) text += fmt::format(" And {} more.", others.size() - shown);
    blocks_.push_back(Paragraph{text, GateTone(verdict_.gates), site().runs.empty() ? "" : "accuracy"});
  }

  Fact ErrorFact(const std::string& label, const VerdictErrors& e, const std::string& meaning) const {
    return {
        label, c_.LengthUnit(e.median_m, 2),
        fmt::format("median of {}; worst {}. {}", Counted(e.answers, "answer"), c_.LengthUnit(e.worst_m, 2), meaning),
        Tone::kPlain, "accuracy"};
  }

  void Numbers() {
    Facts facts;
    const int asked = verdict_.Asked();
    if (asked > 0) {
      facts.facts.push_back({"Located", fmt::format("{} of {}", verdict_.Localized(), asked),
                             fmt::format("{} by {}; others: refused or no match", verdict_.CountedReferences(),
                                         Counted(verdict_.runs.size(), "run")),
                             verdict_.Localized() > 0 ? Tone::kPlain : Tone::kBad, "stations"});
    }
    if (verdict_.relative) {
      facts.facts.push_back(ErrorFact("Relative error, 3D", *verdict_.relative,
                                      "In the run's own frame, against " + verdict_.relative->Against()));
    }
    if (verdict_.absolute) {
      facts.facts.push_back(ErrorFact(
          verdict_.absolute->shares_evidence ? "Absolute difference, 3D" : "Absolute error, 3D", *verdict_.absolute,
          std::string("In site coordinates, against ") + verdict_.absolute->Against() +
              (verdict_.absolute->shares_evidence ? ", which shares data with the answers: agreement, not accuracy"
                                                  : "")));
      if (verdict_.absolute->common_shift_m) facts.facts.push_back(ShiftFact(*verdict_.absolute));
    }
    if (verdict_.Best() == nullptr) Unmeasured(&facts);
    SigmaFact(&facts);
    if (!facts.facts.empty()) blocks_.push_back(facts);
  }

  Fact ShiftFact(const VerdictErrors& e) const {
    std::set<std::string> sources;
    for (const VerdictRun& run : verdict_.runs) sources.insert(run.source);
    const std::string cause = sources == std::set<std::string>{"geotags"} ? "the geotags' own error"
                              : sources == std::set<std::string>{"gps"}   ? "the GPS's own error"
                                                                          : "the georeference";
    return {"Common shift", c_.LengthUnit(e.common_shift_m, 2),
            "part of the absolute error that all answers share, by " + cause + " (length of the mean error)",
            Tone::kPlain, "accuracy"};
  }

  // What can be said without tags.
  void Unmeasured(Facts* facts) const {
    if (verdict_.stated_sigma_m) {
      facts->facts.push_back(
          {"Stated uncertainty", c_.LengthUnit(verdict_.stated_sigma_m, 2),
           "1 sigma (standard deviation) of the largest axis, median over the answers; not tested here"});
    }
    if (verdict_.runs_agree_m) {
      facts->facts.push_back({"Agreement of runs", c_.LengthUnit(verdict_.runs_agree_m, 2),
                              fmt::format("median distance between the places that two runs give a panorama, {}",
                                          Counted(verdict_.agreeing_pairs, "pair"))});
    }
    if (verdict_.Asked() > 0) {
      facts->facts.push_back({"Outlying geotags", std::to_string(verdict_.geotags.size()),
                              verdict_.ReferenceWord() + " whose geotag the runs contradict",
                              verdict_.geotags.empty() ? Tone::kGood : Tone::kWarning, "stations"});
    }
  }

  void SigmaFact(Facts* facts) const {
    const VerdictErrors* best = verdict_.Best();
    if (best == nullptr) return;
    const std::optional<SigmaTest> test = best->Sigmas();
    if (!test) return;
    const std::string relative = verdict_.RelativeSigmas();
    facts->facts.push_back(
        {"Stated sigmas", test->Consistent() && !relative.empty() ? "mixed" : test->Words(),
         fmt::format("sigma: standard deviation. ANEES (mean squared error over variance) {:.2f}, right: "
                     "{:.2f} to {:.2f}",
                     test->anees, test->low, test->high) +
             (relative.empty() ? "" : "; " + relative),
         !test->Consistent() || !relative.empty() ? Tone::kWarning : Tone::kGood, "consistency"});
  }

  // A tile a run.
  void Runs() {
    if (verdict_.runs.empty()) return;
    const VerdictErrors* best = verdict_.Best();
    std::vector<const VerdictRun*> runs;
    for (const VerdictRun& run : verdict_.runs) runs.push_back(&run);
    const auto median = [&](const VerdictRun* run) {
      const auto it =
          best == nullptr ? std::map<std::string, double>::const_iterator() : best->run_median_m.find(run->run);
      return best == nullptr || it == best->run_median_m.end() ? std::optional<double>() : it->second;
    };
    if (runs.size() > kTiles) {  // the worst ones
      std::stable_sort(runs.begin(), runs.end(),
                       [&](const auto* a, const auto* b) { return median(a).value_or(0) > median(b).value_or(0); });
    }
    Facts tiles;
    for (size_t i = 0; i < std::min(kTiles, runs.size()); ++i) {
      const VerdictRun& run = *runs[i];
      const auto value = median(&run);
      std::string detail =
          value ? fmt::format("{} of {} located", run.localized, run.Asked()) : verdict_.ReferenceWord() + " located";
      if (run.Asked() == 0) detail = "reconstructed";
      if (best != nullptr && value) detail += ", median " + best->kind + " error";
      if (!run.georeferenced) detail += "; not georeferenced";
      tiles.facts.push_back(
          {run.run,
           value              ? c_.LengthUnit(value, 2)
           : run.Asked() == 0 ? Counted(run.images, "image")
                              : fmt::format("{} of {}", run.localized, run.Asked()),
           detail, (run.Asked() > 0 && run.localized == 0) || !run.georeferenced ? Tone::kWarning : Tone::kPlain,
           "runs"});
    }
    blocks_.push_back(tiles);
    if (runs.size() > kTiles)
      blocks_.push_back(Paragraph{fmt::format("The {} runs with the largest median of {}.", kTiles, runs.size()),
                                  Tone::kPlain, "runs"});
  }

  // Stations and runs, coloured by the error.
  std::optional<Figure> Matrix() const {
    const VerdictErrors* best = verdict_.Best();
    if (best == nullptr) return {};
    std::map<std::pair<std::string, std::string>, MatrixCell> cells;
    std::set<std::string> runs;
    std::map<std::string, double> worst;
    for (const VariantData& v : c_.data.variants) {
      for (const ErrorRecord& e : v.errors) {
        if (!best->Holds(e)) continue;
        runs.insert(e.run);
        MatrixCell& cell = cells[{e.station, e.run}];
        if (e.Answered()) {
          const double value = *e.error_3d_m / c_.unit.metres;
          cell.value = std::max(cell.value.value_or(value), value);
          worst[e.station] = std::max(worst[e.station], value);
        } else if (!cell.value) {
          cell.text = e.status == "unmatched" ? "no m." : e.status == "rejected" ? "ref." : "-";
          worst.try_emplace(e.station, 0);
        }
      }
    }
    std::vector<std::string> stations;
    for (const std::string& s : c_.data.stations) {
      if (worst.count(s) > 0) stations.push_back(s);
    }
    std::string which;
    if (stations.size() > kMatrixRows) {
      std::stable_sort(stations.begin(), stations.end(),
                       [&](const auto& a, const auto& b) { return worst[a] > worst[b]; });
      which = fmt::format("The {} stations with the largest errors of {}. ", kMatrixRows, stations.size());
      stations.resize(kMatrixRows);
    }
    std::vector<std::string> names(runs.begin(), runs.end());
    if (names.size() > kAcross) names.resize(kAcross);
    const bool across = stations.size() <= kAcross;
    const std::vector<std::string>& rows = across ? names : stations;
    const std::vector<std::string>& columns = across ? stations : names;
    std::vector<std::vector<MatrixCell>> matrix;
    for (const std::string& r : rows) {
      matrix.emplace_back();
      for (const std::string& k : columns) matrix.back().push_back(cells[across ? std::pair(k, r) : std::pair(r, k)]);
    }
    return Figure{"matrix",
                  which + "3D error of each run at each station (" + c_.unit.name + "), " + best->kind + ", against " +
                      best->Against() +
                      "; the larger of several panoramas. no m.: no match; ref.: refused; -: no reference.",
                  MatrixChart(rows, columns, matrix, {0.1, 0.25, 0.5, 1.0}, c_.unit.name)};
  }

  // The desktop also gives anchors of panoramas, where a station has several.
  std::string AnchorOf(const std::string& station, const std::string& panorama) const {
    auto it = c_.station_anchor.find(panorama);
    if (it == c_.station_anchor.end()) it = c_.station_anchor.find(station);
    return it == c_.station_anchor.end() ? "" : it->second;
  }

  // Of each kind the worst, in the order in which they matter.
  void Worst() {
    std::vector<Paragraph> things;
    if (const VerdictErrors* best = verdict_.Best()) {
      const ErrorRecord* most = nullptr;
      for (const VariantData& v : c_.data.variants) {
        for (const ErrorRecord& e : v.errors) {
          if (e.Answered() && best->Holds(e) && (most == nullptr || *e.error_3d_m > *most->error_3d_m)) most = &e;
        }
      }
      if (most != nullptr) {
        things.push_back({"Largest error: " + most->run + " at " + places_.Name(most->station, most->panorama) + ", " +
                              c_.LengthUnit(most->error_3d_m, 2) + " " + best->kind,
                          Tone::kPlain, AnchorOf(most->station, most->panorama)});
      }
    }
    if (!verdict_.geotags.empty()) {
      const VerdictGeotag& g = verdict_.geotags.front();
      std::string text = "Outlying geotag: " + std::filesystem::path(g.panorama).filename().string() + ", " +
                         c_.LengthUnit(g.off_m, 2) + " " + g.direction + " from the answer";
      if (g.sigmas) text += fmt::format(" ({:.1f} sigma)", *g.sigmas);
      things.push_back({text, Tone::kPlain, AnchorOf(g.station, g.panorama)});
    }
    for (const VerdictRun& run : verdict_.runs) {
      if (!run.georeferenced && things.size() < kThings)
        things.push_back(
            {run.run + " is not georeferenced" + (run.source.empty() ? "" : ": " + run.source), Tone::kPlain, "runs"});
    }
    // A refusal says more than a panorama that a run did not pass.
    for (const char* status : {"rejected", "unmatched"}) {
      for (const VerdictRefusal& r : verdict_.refused) {
        if (r.status != status || things.size() >= kThings) continue;
        const std::string place = places_.Name(r.station, r.panorama);
        things.push_back({std::string(r.status == "rejected" ? "Refused: " : "Not matched: ") + r.run + " at " + place +
                              (r.reason.empty() ? "" : ", " + r.reason),
                          Tone::kPlain, AnchorOf(r.station, r.panorama)});
      }
    }
    if (things.empty()) return;
    blocks_.push_back(Heading{3, "Look at these first", "worst"});
    for (size_t i = 0; i < std::min(kThings, things.size()); ++i) blocks_.push_back(things[i]);
  }

  const ChapterContext& c_;
  std::vector<Block>& blocks_;
  ProjectVerdict verdict_;
  PlaceNames places_;
};

}  // namespace

PlaceNames::PlaceNames(const ReportData& data) {
  for (const VariantData& variant : data.variants) {
    for (const ErrorRecord& e : variant.errors) panoramas_[e.station].insert(e.panorama);
  }
  for (const RunData& run : data.runs) {
    for (const RunData::Answer& a : run.answers) panoramas_[a.station].insert(a.panorama);
  }
  panoramas_.erase("");
}

bool PlaceNames::HasSeveral(const std::string& station) const {
  const auto it = panoramas_.find(station);
  return it != panoramas_.end() && it->second.size() > 1;
}

std::map<std::string, std::set<std::string>> PlaceNames::Several() const {
  auto several = panoramas_;
  std::erase_if(several, [](const auto& of) { return of.second.size() < 2; });
  return several;
}

std::string PlaceNames::PanoramaName(const std::string& station, const std::string& panorama) const {
  const auto file = [](const std::string& name) { return std::filesystem::path(name).filename().string(); };
  const auto it = panoramas_.find(station);
  if (it == panoramas_.end()) return file(panorama);
  const bool same = std::any_of(it->second.begin(), it->second.end(), [&](const std::string& other) {
    return other != panorama && file(other) == file(panorama);
  });
  return same ? panorama : file(panorama);
}

std::string PlaceNames::Name(const std::string& station, const std::string& panorama) const {
  if (station.empty()) return PanoramaName(station, panorama);
  return HasSeveral(station) ? station + " " + PanoramaName(station, panorama) : station;
}

void AddVerdict(const ChapterContext& context, std::optional<Figure> plan, std::vector<Block>* blocks) {
  VerdictChapter(context, blocks).Add(std::move(plan));
}

}  // namespace trigpoint
