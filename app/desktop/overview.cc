#include "app/desktop/overview.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "calib/base/counted.h"
#include "datasets/io/exif.h"
#include "datasets/io/natural_order.h"
#include "datasets/io/photo_sets.h"
#include "datasets/project/look.h"
#include "datasets/project/stage.h"
#include "eval/report/chapters.h"
#include "eval/report/verdict.h"

namespace trigpoint {

namespace {

constexpr double kPlanScale = 2.5;  // pixels a unit of the drawing

void FillMatrix(const ReportData& data, const VerdictErrors& best, Overview* overview) {
  overview->comparison = best.Words();
  std::set<std::string> stations, runs;
  std::map<std::string, std::set<std::string>> panoramas;
  for (const VariantData& variant : data.variants) {
    for (const ErrorRecord& e : variant.errors) {
      if (!best.Holds(e)) continue;
      overview->matrix.push_back(e);
      stations.insert(e.station);
      panoramas[e.station].insert(e.panorama);
      runs.insert(e.run);
    }
  }
  overview->runs.assign(runs.begin(), runs.end());
  for (const std::string& station : data.stations) {
    if (stations.erase(station) > 0) overview->stations.push_back(station);
  }
  overview->stations.insert(overview->stations.end(), stations.begin(), stations.end());
  const PlaceNames& places = overview->places;
  for (const std::string& station : overview->stations) {
    for (const std::string& panorama : panoramas[station]) {
      overview->rows.push_back({station, panorama, places.Name(station, panorama),
                                places.HasSeveral(station) ? "panorama:" + panorama : "station:" + station});
    }
  }
}

void FillAnswers(const ReportData& data, Overview* overview) {
  std::set<std::string> panoramas, runs;
  for (const RunData& run : data.runs) {
    for (const RunData::Answer& a : run.answers) {
      overview->answers.push_back({run.run, run.variant, a.panorama, a.station, a.status, a.reason, a.sigma_m});
      if (!run.variant.empty()) continue;
      panoramas.insert(a.panorama);
      runs.insert(run.run);
    }
  }
  overview->panoramas.assign(panoramas.begin(), panoramas.end());
  std::sort(overview->panoramas.begin(), overview->panoramas.end(), NaturalLess);
  overview->runs.assign(runs.begin(), runs.end());
}

void FillVerdict(const ReportInput& input, const ReportData& data, const DisplayUnit& unit, Overview* overview) {
  ChapterContext context{input, data, unit, {}, {}};
  context.alone = true;
  for (const std::string& station : data.stations) context.station_anchor[station] = "station:" + station;
  for (const auto& [station, panoramas] : overview->places.Several()) {
    for (const std::string& panorama : panoramas) context.station_anchor[panorama] = "panorama:" + panorama;
  }
  std::vector<Block> blocks;
  AddVerdict(context, std::nullopt, &blocks);
  const auto check = At(data.survey, {"check", "rmse_3d_m"});
  const auto facts = std::find_if(blocks.begin(), blocks.end(),
                                  [](const Block& block) { return std::holds_alternative<Facts>(block); });
  if (check && facts != blocks.end()) {
    const auto count = static_cast<int>(At(data.survey, {"check", "n"}).value_or(0));
    std::get<Facts>(*facts).facts.push_back({"Check points, 3D", context.LengthUnit(check, 2),
                                             "RMSE of the tag map at " + std::to_string(count) +
                                                 (count == 1 ? " surveyed point" : " surveyed points") +
                                                 " it was not fitted to"});
  }
  for (Block& block : blocks) {
    const auto* heading = std::get_if<Heading>(&block);
    const bool title = heading != nullptr && heading->level == 2;
    if (title || std::holds_alternative<Columns>(block) || std::holds_alternative<Figure>(block)) continue;
    overview->verdict.push_back(std::move(block));
  }
}

// What `init` would find. Sets that nothing places in the site are no references of it, but can be stitched.
void FillFound(const Snapshot& snapshot, Overview* overview) {
  InitReport look = LookAt(snapshot.dir);
  overview->found = std::move(look.found);
  overview->missing = std::move(look.missing);
  for (const std::filesystem::path& set : PhotoSetFolders(snapshot.dir)) {
    const std::string name = set.filename().string();
    const bool counted = std::any_of(snapshot.references.begin(), snapshot.references.end(),
                                     [&](const SnapshotReference& r) { return r.name == name; });
    const std::vector<std::filesystem::path> photos = PicturesIn(set);
    if (counted || photos.empty()) continue;
    std::string text = Counted(photos.size(), "photo") + " of the set " + name + ", to be stitched: ";
    text += photos.front().filename().string();
    if (photos.size() > 1) text += " to " + photos.back().filename().string();
    overview->found.push_back(std::move(text));
  }
}

void FillPlan(const Snapshot& snapshot, const DisplayUnit& unit, Overview* overview) {
  SceneOptions options;
  options.max_points = options.max_cameras = options.panorama_width_px = 0;
  const SceneModel scene = LoadScene(*snapshot.project, options);
  if (scene.paths.empty() && scene.panoramas.empty()) return;
  const Plan plan = PlanOf(scene, unit);
  overview->plan = PaintDrawing(plan.drawing, kPlanScale);
  overview->plan_caption = plan.caption;
}

void FillGeotagWarnings(const ProjectVerdict& verdict, const DisplayUnit& unit, Overview* overview) {
  for (const VerdictGeotag& g : verdict.geotags) {
    std::string text = fmt::format("Outlying geotag: {}, {:.2f} {} {} from the answer of {}", g.panorama,
                                   g.off_m / unit.metres, unit.name, g.direction, g.run);
    if (g.sigmas) text += fmt::format(" ({:.1f} sigma)", *g.sigmas);
    overview->warnings.push_back({std::move(text), "panorama:" + g.panorama});
  }
}

// What the command line printed when the results were made. The same words of several results are said once.
void FillResultWarnings(const ReportInput& input, const std::set<std::string>& said, Overview* overview) {
  constexpr size_t kNamed = 3;  // results of one warning
  std::vector<std::pair<std::string, std::vector<std::string>>> all;
  for (const ResultRecord& result : input.stages) {
    if (!result.manifest.is_object()) continue;
    const bool alone = result.name.empty() || result.name.front() == '@';
    for (const nlohmann::json& warning : result.manifest.value("warnings", nlohmann::json::array())) {
      if (!warning.is_string() || said.count(warning.get<std::string>()) > 0) continue;
      const auto text = warning.get<std::string>();
      auto same = std::find_if(all.begin(), all.end(), [&](const auto& w) { return w.first == text; });
      if (same == all.end()) same = all.insert(all.end(), {text, {}});
      same->second.push_back(result.stage + (alone ? "" : "/") + result.name);
    }
  }
  for (const auto& [text, titles] : all) {
    const std::set<std::string> distinct(titles.begin(), titles.end());
    std::string names;
    size_t named = 0;
    for (const std::string& title : distinct) {
      if (++named <= kNamed) names += (names.empty() ? "" : ", ") + title;
    }
    if (named > kNamed) names += fmt::format(" and {} more", named - kNamed);
    overview->warnings.push_back(
        {names + ": " + text + (titles.size() > 1 ? " (" + Counted(titles.size(), "time") + ")" : "")});
  }
}

void FillWarnings(const ReportInput& input, const ReportData& data, const ProjectVerdict& verdict,
                  const DisplayUnit& unit, Overview* overview) {
  const Project& project = *input.project;
  std::vector<std::string> all = project.warnings();
  for (const Run& run : project.site().runs) all.insert(all.end(), run.warnings.begin(), run.warnings.end());
  all.insert(all.end(), data.notes.begin(), data.notes.end());
  std::set<std::string> said;
  for (const std::string& warning : all) {
    if (said.insert(warning).second) overview->warnings.push_back({warning});
  }
  FillGeotagWarnings(verdict, unit, overview);
  FillResultWarnings(input, said, overview);
}

}  // namespace

ReportInput ReportInputOf(const Snapshot& snapshot, bool points) {
  return ReportInputOf(snapshot, ResultsOfSnapshot(snapshot), points);
}

ReportInput ReportInputOf(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, bool points) {
  ReportInput input;
  input.project = snapshot.project.get();
  input.variants = snapshot.variants;
  input.points = points;
  for (const SnapshotResult& result : results) {
    ResultRecord record;
    record.stage = result.stage;
    record.name = result.run;
    record.state = result.state;
    record.reason = result.reason;
    if (!result.variant.empty()) record.name += "@" + result.variant;
    if (const auto manifest = ReadManifest(*snapshot.project, record.stage, record.name)) record.manifest = *manifest;
    input.stages.push_back(std::move(record));
  }
  return input;
}

std::vector<std::string> StaleOf(const std::vector<SnapshotResult>& results) {
  std::vector<std::string> stale;
  for (const SnapshotResult& result : results) {
    if (result.stage != "evaluate" && result.stage != "gates") continue;
    if (result.state == "out of date" || result.state == "failed") stale.push_back(result.title + ": " + result.state);
  }
  return stale;
}

Overview LoadOverview(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, const DisplayUnit& unit) {
  Overview overview;
  overview.has_project_file = std::filesystem::exists(snapshot.dir / "trigpoint.yaml");
  overview.stale = StaleOf(results);
  const ReportInput input = ReportInputOf(snapshot, results, false);
  ProgressSink progress;
  const ReportData data = ReadReportData(input, progress, {});
  overview.places = PlaceNames(data);
  if (!overview.has_project_file) FillFound(snapshot, &overview);
  FillVerdict(input, data, unit, &overview);
  const ProjectVerdict verdict = MakeVerdict(input, data);
  FillWarnings(input, data, verdict, unit, &overview);
  FillAnswers(data, &overview);
  if (verdict.Best() != nullptr) FillMatrix(data, *verdict.Best(), &overview);
  for (const VariantData& variant : data.variants) {
    overview.errors.insert(overview.errors.end(), variant.errors.begin(), variant.errors.end());
  }
  try {
    FillPlan(snapshot, unit, &overview);
  } catch (const Error& e) {
    overview.warnings.push_back({std::string("plan: ") + e.what()});
  }
  return overview;
}

std::string StationShown(const Overview* overview, const std::set<std::string>& related, const std::string& selected) {
  std::set<std::string> known;
  if (overview != nullptr) {
    for (const std::string& station : overview->stations) known.insert("station:" + station);
    for (const ErrorRecord& e : overview->errors) known.insert("station:" + e.station);
  }
  // A set of photos called station_077 also belongs to a station of that name, which nobody lists.
  const auto rank = [&](const std::string& object) {
    return std::tuple(object.starts_with("station:"), known.count(object) > 0, object == selected);
  };
  std::string best;
  for (const std::string& object : related) {
    if (!object.starts_with("station:") && !object.starts_with("panorama:")) continue;
    if (best.empty() || rank(object) > rank(best)) best = object;
  }
  return best;
}

NextStep NextOf(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, bool has_project_file) {
  NextStep next;
  if (!has_project_file) {
    next.kind = NextStep::Kind::kCreate;
    return next;
  }
  for (const SnapshotResult& result : results) {
    if (result.state.empty()) next.kind = NextStep::Kind::kChecking;
    if (result.state != "running") continue;
    next.kind = NextStep::Kind::kRunning;
    next.title = result.title;
    return next;
  }
  if (next.kind == NextStep::Kind::kChecking) return next;
  for (const bool stitched : {true, false}) {  // sets of photos are stitched first
    for (const SnapshotResult& result : results) {
      const bool failed = result.state == "failed";
      if ((result.stage == "stitch") != stitched) continue;
      if (!failed && result.state != "missing" && result.state != "out of date") continue;
      if (next.results == 0) next.title = result.title;
      ++next.results;
      next.failed += failed ? 1 : 0;
      if (failed && next.reason.empty()) next.reason = result.title + ": " + result.reason;
    }
  }
  if (next.results > 0) {
    next.kind = NextStep::Kind::kRun;
  } else if (std::filesystem::exists(snapshot.dir / "results" / "report" / "index.html")) {
    next.kind = NextStep::Kind::kReport;
  }
  return next;
}

}  // namespace trigpoint
