// crosscheck: COLMAP on the same run, and anybody's models and trajectories of it, held against ours.
#include "app/pipeline/crosscheck_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "app/pipeline/crosscheck_colmap.h"
#include "app/pipeline/crosscheck_figures.h"
#include "app/pipeline/crosscheck_panoramas.h"
#include "app/pipeline/drawn_views.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/solution/solution_covariance.h"
#include "eval/errors/crosscheck.h"
#include "eval/errors/results.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr CrossAlignment kAlignments[] = {CrossAlignment::kNone, CrossAlignment::kSE3, CrossAlignment::kSim3};
// The joint covariance of so many cameras is a matrix of a few megabytes.
constexpr size_t kMostCameras = 250;
constexpr double kMedianOfLength = 1.538;  // of a vector whose three components have sigma 1

// Our cameras of the run, with the joint covariance of their positions.
struct Ours {
  RunScene scene;  // odom
  std::map<std::string, Rigid3d> odom_from_cam;
  std::vector<std::string> judged;  // images the covariance is about, spread evenly
  Eigen::MatrixXd covariance;       // 3 x judged, m^2, the first image held
  std::vector<PanoramaResult> answers;
};

// By the solution's normal equations, with a length as uncertain as run.yaml says.
void AddCovariance(int threads, const CancelToken& cancel, Ours* ours) {
  const Solution& solution = ours->scene.solution;
  const size_t n = solution.images.size(), count = std::min(n, kMostCameras);
  Eigen::MatrixXd centre(3, 6);
  centre << Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Identity();
  std::vector<SolutionFunction> centres;
  for (size_t k = 0; k < count; ++k) {
    const SolutionImage& image = solution.images[count == 1 ? 0 : k * (n - 1) / (count - 1)];
    centres.push_back(centre * OdomPose(solution, image.pose, BodyFromCam(solution, image)));
    ours->judged.push_back(image.name);
  }
  ours->covariance = SolutionCovariance(solution, true, threads, cancel).Of(centres);
}

// Rows and columns of the judged images that the other has too.
Eigen::MatrixXd CovarianceOf(const Ours& ours, const std::vector<std::string>& names) {
  std::map<std::string, Eigen::Index> at;
  for (size_t i = 0; i < ours.judged.size(); ++i) at[ours.judged[i]] = static_cast<Eigen::Index>(3 * i);
  const auto n = static_cast<Eigen::Index>(names.size());
  Eigen::MatrixXd covariance(3 * n, 3 * n);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      covariance.block<3, 3>(3 * a, 3 * b) =
          ours.covariance.block<3, 3>(at.at(names[static_cast<size_t>(a)]), at.at(names[static_cast<size_t>(b)]));
    }
  }
  return covariance;
}

// One system beside ours.
struct Other {
  std::string system;  // colmap a, model:NAME, estimate:NAME
  std::string status, reason;
  std::map<std::string, Rigid3d> frame_from_cam;  // by our image names
  int images = 0;                                 // that it was given; 0: not known
  int models = 1;
  std::vector<double> errors_px;  // mean reprojection error of each point
  std::vector<CrossPair> panoramas;
  std::vector<CrossPanorama> all_panoramas;  // those of one side alone, too
  std::vector<PanoramaJudgement> judged;
  std::vector<CrossPair> points;                                                      // with our covariance
  std::vector<CrossComparison> comparisons, panorama_comparisons, point_comparisons;  // one an alignment
};

void SetCameras(const SparseModel& model, const std::map<std::string, std::string>& name_of, Other* other) {
  for (const ModelImage& image : model.images) {
    const auto name = name_of.find(image.name);
    if (name != name_of.end()) other->frame_from_cam[name->second] = image.cam_from_world.Inverse();
  }
  for (const ModelPoint& point : model.points) other->errors_px.push_back(point.error_px);
}

// Depth a has our features: a point of theirs and one of ours are the same if most of their observations are.
void MatchPoints(const Ours& ours, const SparseModel& theirs, Other* other) {
  std::map<std::string, const ModelImage*> images;
  for (const ModelImage& image : theirs.images) images[image.name] = &image;
  std::map<int64_t, const ModelPoint*> points;
  for (const ModelPoint& point : theirs.points) points[point.id] = &point;
  for (const ModelPoint& point : ours.scene.model.points) {
    std::map<int64_t, size_t> votes;
    for (const auto& [id, index] : point.track) {
      const auto feature = static_cast<size_t>(ours.scene.feature_of[id - 1][index]);
      const auto image = images.find(ours.scene.model.images[id - 1].name);
      if (image == images.end() || feature >= image->second->points.size()) continue;
      const int64_t their_point = image->second->points[feature];
      if (their_point >= 0) ++votes[their_point];
    }
    for (const auto& [id, count] : votes) {
      if (2 * count <= point.track.size()) continue;
      const auto covariance = PointCovariance(ours.scene, point);
      if (!covariance) continue;
      CrossPair pair;
      pair.name = std::to_string(point.id);
      pair.ours.translation = point.position;
      pair.theirs.translation = points.at(id)->position;
      pair.covariance = covariance;
      other->points.push_back(pair);
    }
  }
}

void SetPanoramas(std::vector<CrossPanorama> panoramas, Other* other) {
  for (const CrossPanorama& p : panoramas) {
    if (!p.ours || !p.theirs) continue;
    CrossPair pair;
    pair.name = p.name;
    pair.ours.translation = *p.ours;
    pair.theirs.translation = *p.theirs;
    pair.covariance = p.covariance;
    other->panoramas.push_back(pair);
  }
  other->all_panoramas = std::move(panoramas);
}

void Compare(const Ours& ours, Other* other) {
  if (other->frame_from_cam.empty()) return;
  std::vector<CrossPair> pairs;
  std::vector<std::string> names;
  for (const std::string& name : ours.judged) {
    const auto theirs = other->frame_from_cam.find(name);
    if (theirs == other->frame_from_cam.end()) continue;
    CrossPair pair;
    pair.name = name;
    pair.ours = ours.odom_from_cam.at(name);
    pair.theirs = theirs->second;
    pairs.push_back(pair);
    names.push_back(name);
  }
  const Eigen::MatrixXd covariance = ours.covariance.size() > 0 ? CovarianceOf(ours, names) : Eigen::MatrixXd();
  for (CrossAlignment alignment : kAlignments) {
    try {
      CrossComparison c = CompareCameras(pairs, covariance, alignment);
      other->panorama_comparisons.push_back(ComparePlaces(other->panoramas, c.ours_from_theirs, alignment));
      other->point_comparisons.push_back(ComparePlaces(other->points, c.ours_from_theirs, alignment));
      if (alignment == CrossAlignment::kSim3) {
        other->judged =
            JudgePanoramas(other->all_panoramas, c.ours_from_theirs, c.statistics.median_m / kMedianOfLength);
      }
      other->comparisons.push_back(std::move(c));
    } catch (const NumericError& e) {
      other->reason += (other->reason.empty() ? "" : "; ") + std::string("no alignment: ") + e.what();
      return;
    }
  }
}

// models/<name>/: a reconstruction the user brought; images are known by their names, with or without folders.
Other ReadModel(const fs::path& dir, const Ours& ours) {
  Other other;
  other.system = "model:" + dir.filename().string();
  try {
    const SparseModel model = ReadColmapModel(dir);
    std::map<std::string, std::string> name_of;
    std::map<std::string, int> plain;
    for (const auto& [name, pose] : ours.odom_from_cam) ++plain[fs::path(name).filename().string()];
    for (const ModelImage& image : model.images) {
      if (ours.odom_from_cam.count(image.name) > 0) {
        name_of[image.name] = image.name;
        continue;
      }
      const std::string file = fs::path(image.name).filename().string();
      for (const auto& [name, pose] : ours.odom_from_cam) {
        if (plain.count(file) > 0 && plain[file] == 1 && fs::path(name).filename() == file) name_of[image.name] = name;
      }
    }
    other.images = static_cast<int>(model.images.size());
    SetCameras(model, name_of, &other);
    other.status = other.frame_from_cam.empty() ? "skipped" : "done";
    if (other.frame_from_cam.empty()) other.reason = "none of its images is one of the run";
  } catch (const Error& e) {
    other.status = "failed";
    other.reason = e.what();
  }
  return other;
}

// estimates/<system>/<run>.tum: world_from_cam of the first camera, by time.
Other ReadEstimate(const fs::path& file, const Run& run, const Ours& ours) {
  Other other;
  other.system = "estimate:" + file.parent_path().filename().string();
  try {
    const Trajectory trajectory = ReadTrajectory(file);
    for (const ImageEntry& entry : run.images) {
      if (entry.camera != 0 || ours.odom_from_cam.count(entry.file) == 0) continue;
      const auto pose = trajectory.At(entry.stamp_ns, 1'000'000'000);
      if (pose) other.frame_from_cam[entry.file] = *pose;
    }
    other.images = static_cast<int>(trajectory.poses.size());
    other.status = other.frame_from_cam.empty() ? "skipped" : "done";
    if (other.frame_from_cam.empty()) other.reason = "it covers no image of the run";
  } catch (const Error& e) {
    other.status = "failed";
    other.reason = e.what();
  }
  return other;
}

std::string Optional(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "";
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

void WriteDifferences(const std::vector<Other>& others, const fs::path& file) {
  CsvWriter differences(
      {"system", "what", "alignment", "name", "dx_m", "dy_m", "dz_m", "length_m", "rotation_deg", "normalised"},
      {"trigpoint crosscheck_differences 1; frame=odom; theirs minus ours"});
  for (const Other& other : others) {
    const std::pair<const char*, const std::vector<CrossComparison>*> kinds[] = {
        {"cameras", &other.comparisons}, {"panoramas", &other.panorama_comparisons}};
    for (const auto& [what, comparisons] : kinds) {
      for (const CrossComparison& c : *comparisons) {
        for (const CrossDifference& d : c.differences) {
          differences.Text(other.system).Text(what).Text(CrossAlignmentName(c.alignment)).Text(d.name);
          for (int k = 0; k < 3; ++k) differences.Number(d.difference_m[k], 6);
          differences.Number(d.difference_m.norm(), 6);
          std::string(what) == "cameras" ? differences.Number(d.rotation_deg, 5) : differences.Empty();
          differences.Text(Optional(d.normalised, 4)).EndRow();
        }
      }
    }
  }
  differences.Save(file);
}

// The same as Markdown.
std::string WriteSteps(const std::vector<ColmapStep>& steps, const fs::path& file) {
  CsvWriter times({"depth", "step", "exit_code", "wall_s", "cpu_s", "peak_mib"}, {"trigpoint crosscheck_steps 1"});
  std::string md;
  if (!steps.empty()) md += "\n| COLMAP | step | CPU s | wall s | peak MiB |\n|---|---|---|---|---|\n";
  for (const ColmapStep& step : steps) {
    const ChildResult& r = step.result;
    times.Text(step.depth).Text(step.name).Integer(r.exit_code);
    times.Number(r.wall_seconds, 2).Number(r.cpu_seconds, 2).Number(r.peak_mib, 1).EndRow();
    md += fmt::format("| {} | {} | {:.1f} | {:.1f} | {:.0f} |\n", step.depth, step.name, r.cpu_seconds, r.wall_seconds,
                      r.peak_mib);
  }
  times.Save(file);
  return md;
}

void WriteTables(const fs::path& dir, const std::vector<Other>& others, const std::vector<ColmapStep>& steps,
                 const std::string& version, const Ours& ours) {
  std::vector<double> errors;
  for (const ModelPoint& point : ours.scene.model.points) errors.push_back(point.error_px);
  CsvWriter csv({"system", "status", "reason", "images", "registered", "models", "reprojection_px", "what", "alignment",
                 "compared", "rmse_m", "median_m", "max_m", "rotation_median_deg", "rotation_max_deg", "scale",
                 "normalised_median", "normalised_p95", "beyond_99"},
                {"trigpoint crosscheck 1; theirs minus ours, frame=odom; normalised by our covariance (1: as large as "
                 "our stated sigmas)"});
  std::string md = fmt::format(
      "# Cross-check of {}\n\nCOLMAP {}. Ours: {} images, {} points, mean reprojection error {:.3f} px. Differences "
      "are "
      "theirs minus ours; *normalised* is by our own covariance after the same alignment: about 1 is agreement within "
      "what "
      "we state, and the last column is the share of cameras beyond the 99 % value (1 % would be chance). A "
      "reconstruction from images alone has an arbitrary position, orientation and scale: only its sim3 rows are "
      "meaningful.\n\n"
      "| system | what | alignment | compared | rmse m | max m | rotation median deg | scale | normalised median | p95 "
      "| "
      "beyond 99 % |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
      ours.scene.run, version.empty() ? "is not installed (apt install colmap)" : version,
      ours.scene.model.images.size(), ours.scene.model.points.size(), Mean(errors));
  std::string notes;
  for (const Other& other : others) {
    const auto head = [&] {
      csv.Text(other.system).Text(other.status).Text(other.reason).Integer(other.images);
      csv.Integer(static_cast<int64_t>(other.frame_from_cam.size())).Integer(other.models);
      other.errors_px.empty() ? csv.Empty() : csv.Number(Mean(other.errors_px), 4);
    };
    notes +=
        fmt::format("- {}: {}{}; {} of {} images{}{}\n", other.system, other.status,
                    other.reason.empty() ? "" : " (" + other.reason + ")", other.frame_from_cam.size(), other.images,
                    other.errors_px.empty() ? ""
                                            : fmt::format(", {} points, mean reprojection error {:.3f} px",
                                                          other.errors_px.size(), Mean(other.errors_px)),
                    other.panoramas.empty() ? "" : fmt::format(", {} panoramas", other.panoramas.size()));
    if (other.comparisons.empty()) {
      head();
      csv.Empty(12).EndRow();
      continue;
    }
    const std::pair<const char*, const std::vector<CrossComparison>*> kinds[] = {
        {"cameras", &other.comparisons},
        {"panoramas", &other.panorama_comparisons},
        {"points", &other.point_comparisons}};
    for (const auto& [what, comparisons] : kinds) {
      for (const CrossComparison& c : *comparisons) {
        const CrossStatistics& s = c.statistics;
        if (s.count == 0) continue;
        const bool cameras = std::string(what) == "cameras";
        head();
        csv.Text(what).Text(CrossAlignmentName(c.alignment)).Integer(s.count);
        csv.Number(s.rmse_m, 6).Number(s.median_m, 6).Number(s.max_m, 6);
        if (cameras) {
          csv.Number(s.rotation_median_deg, 5).Number(s.rotation_max_deg, 5);
        } else {
          csv.Empty(2);
        }
        csv.Number(c.ours_from_theirs.scale, 6);
        for (const auto& value : {s.normalised_median, s.normalised_p95, s.beyond_99}) csv.Text(Optional(value, 4));
        csv.EndRow();
        md += fmt::format("| {} | {} | {} | {} | {:.4f} | {:.4f} | {} | {:.5f} | {} | {} | {} |\n", other.system, what,
                          CrossAlignmentName(c.alignment), s.count, s.rmse_m, s.max_m,
                          cameras ? fmt::format("{:.4f}", s.rotation_median_deg) : "", c.ours_from_theirs.scale,
                          Optional(s.normalised_median, 2), Optional(s.normalised_p95, 2),
                          s.beyond_99 ? fmt::format("{:.0f} %", 100 * *s.beyond_99) : "");
      }
    }
  }
  md += "\n" + notes;
  for (const Other& other : others) md += FormatPanoramaVerdicts(other.judged, ours.answers);
  csv.Save(dir / "comparison.csv");
  WriteDifferences(others, dir / "differences.csv");
  md += WriteSteps(steps, dir / "steps.csv");
  WriteFileAtomically(dir / "crosscheck.md", md);
}

nlohmann::json MetricsOf(const Other& other) {
  nlohmann::json m = {{"status", other.status}, {"reason", other.reason}, {"registered", other.frame_from_cam.size()}};
  for (const CrossComparison& c : other.comparisons) {
    const CrossStatistics& s = c.statistics;
    nlohmann::json& at = m[std::string(CrossAlignmentName(c.alignment))];
    at = {{"rmse_m", s.rmse_m}, {"max_m", s.max_m}, {"rotation_median_deg", s.rotation_median_deg}};
    if (s.normalised_median) at["normalised_median"] = *s.normalised_median;
    if (s.beyond_99) at["beyond_99"] = *s.beyond_99;
  }
  return m;
}

std::vector<CrossFigure> FiguresOf(const std::vector<Other>& others, const Ours& ours) {
  std::vector<CrossFigure> figures;
  for (const Other& other : others) {
    if (other.comparisons.size() < 3) continue;
    CrossFigure figure;
    figure.system = other.system;
    for (const CrossDifference& d : other.comparisons[2].differences) {
      figure.places.push_back(ours.odom_from_cam.at(d.name).translation);
      figure.differences.push_back(d.difference_m);
      figure.normalised.push_back(d.normalised.value_or(std::nan("")));
    }
    figures.push_back(std::move(figure));
  }
  return figures;
}

void Crosscheck(StageContext& context, const std::string& run, const std::string& variant,
                const CrosscheckOptions& options, const ViewOptions& views) {
  const Project& project = context.project;
  Ours ours;
  ours.scene = ReadRunScene(project, run, variant, "odom");
  for (const ModelImage& image : ours.scene.model.images)
    ours.odom_from_cam[image.name] = image.cam_from_world.Inverse();
  // What is delivered is checked: the table, against the solution that it was written from, too.
  const fs::path localized = ResultOf(project, "localize", {run, variant});
  ours.answers = ReadLocalizeResult(localized, nullptr).panoramas;
  const std::set<std::string> changed = ChangedAnswers(ours.answers, ReadLocalizeResult(localized).panoramas);
  context.progress.Begin("our covariance", 0);
  try {
    AddCovariance(context.threads, context.cancel, &ours);
  } catch (const NumericError& e) {
    context.progress.Log(LogLevel::kWarning,
                         std::string("our covariance cannot be computed, nothing is normalised: ") + e.what());
    ours.covariance.resize(0, 0);
    ours.judged.clear();
    for (const ModelImage& image : ours.scene.model.images) ours.judged.push_back(image.name);
  }

  std::vector<Other> others;
  const fs::path work = context.out / "work";
  fs::create_directories(work);
  ColmapRun colmap(project, run, ours.scene, options, views, work, context.out / "colmap.log", context.threads,
                   context.progress, context.cancel);
  if (colmap.version().empty()) {
    context.progress.Log(LogLevel::kWarning,
                         "COLMAP is not installed, so only models/ and estimates/ are compared: apt install colmap");
  } else {
    const auto add = [&](const ColmapSolution& solution) -> Other& {
      Other other;
      other.system = "colmap " + solution.depth;
      other.status = solution.status;
      other.reason = solution.reason;
      other.images = solution.images;
      other.models = solution.models;
      if (solution.status == "done") SetCameras(solution.model, solution.name_of, &other);
      if (!solution.reason.empty()) {
        context.progress.Log(LogLevel::kWarning, "depth " + solution.depth + ": " + solution.reason);
      }
      others.push_back(std::move(other));
      return others.back();
    };
    if (options.features) {
      const ColmapSolution a = colmap.Features();
      Other& other = add(a);
      if (a.status == "done") MatchPoints(ours, a.model, &other);
    }
    if (options.images || options.panoramas) {
      const ColmapSolution b = colmap.Images();
      add(b);
      if (options.panoramas && !project.site().references.empty()) {
        std::map<std::string, std::pair<std::string, size_t>> view_names;
        const ColmapSolution c = colmap.Panoramas(b, &view_names);
        Other& other = add(c);
        if (c.status == "done") {
          SetPanoramas(PanoramasOf(c.model, view_names, ours.answers, changed), &other);
        }
      }
    }
  }
  std::error_code ignored;
  if (fs::is_directory(project.dir() / "models", ignored)) {
    for (const auto& entry : fs::directory_iterator(project.dir() / "models")) {
      if (HasColmapModel(entry.path())) others.push_back(ReadModel(entry.path(), ours));
    }
  }
  if (fs::is_directory(project.dir() / "estimates", ignored)) {
    for (const auto& entry : fs::directory_iterator(project.dir() / "estimates")) {
      const fs::path file = entry.path() / (run + ".tum");
      if (fs::exists(file)) others.push_back(ReadEstimate(file, project.run(run), ours));
    }
  }
  std::stable_sort(others.begin(), others.end(), [](const Other& a, const Other& b) { return a.system < b.system; });
  for (Other& other : others) {
    context.cancel.ThrowIfCancelled();
    Compare(ours, &other);
    context.metrics["systems"][other.system] = MetricsOf(other);
    if (other.status == "failed") context.progress.Log(LogLevel::kWarning, other.system + ": " + other.reason);
    if (other.judged.empty()) continue;
    WritePanoramaVerdicts(other.judged, ours.answers, context.out / "panoramas.csv");
    context.metrics["panoramas"] = PanoramaVerdictsJson(other.judged, ours.answers);
    for (const std::string& w : PanoramaWarnings(other.judged, ours.answers))
      context.progress.Log(LogLevel::kWarning, w);
  }
  WriteTables(context.out, others, colmap.steps(), colmap.version(), ours);
  const std::vector<CrossFigure> figures = FiguresOf(others, ours);
  fs::create_directories(context.out / "figures");
  if (!figures.empty()) WriteCrossFigures(context.out / "figures", run, figures);
  nlohmann::json& m = context.metrics["colmap"];
  m["version"] = colmap.version().empty() ? "not installed" : colmap.version();
  double cpu = 0;
  for (const ColmapStep& step : colmap.steps()) cpu += step.result.cpu_seconds;
  m["cpu_seconds"] = cpu;
  context.metrics["compared"] = figures.size();
  if (!options.keep) fs::remove_all(work);
}

}  // namespace

StageInfo CrosscheckStage() {
  StageInfo info;
  info.name = "crosscheck";
  info.help = "compare a run with COLMAP, and with models/ and estimates/";
  info.variants = true;
  info.only_on_request = true;
  info.needs = {"localize"};
  info.metric = "compared";
  UseOptions<CrosscheckOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<CrosscheckOptions>(project, "crosscheck", target);
    StageTarget plain = target;
    plain.variant.clear();
    StageRequest request;
    request.version = 3;
    request.options = JsonFromOptions(options);
    request.inputs = RunInputs(project, project.run(target.run));
    request.inputs.push_back(ManifestOf(project, "features", plain));
    request.inputs.push_back(ManifestOf(project, "localize", target));
    request.inputs.push_back(ResultOf(project, "localize", target) / "panoramas.csv");  // as it is now
    if (fs::exists(project.dir() / "models")) request.inputs.push_back(project.dir() / "models");
    if (fs::exists(project.dir() / "estimates")) request.inputs.push_back(project.dir() / "estimates");
    request.values["colmap"] = FindProgram("colmap").string();
    request.body = [=, run = target.run, variant = target.variant](StageContext& context) {
      Crosscheck(context, run, variant, options, ViewOptionsOf(context.project));
    };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit&) {
    return ReadTextFile(outcome.dir / "crosscheck.md") + "\n";
  };
  return info;
}

}  // namespace trigpoint
