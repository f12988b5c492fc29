#include "eval/trajectory/score_estimates.h"

#include <algorithm>
#include <map>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOwnSystem = "trigpoint";

struct Found {
  std::string system;
  fs::path file;
};

std::vector<Found> FindEstimates(const Project& project) {
  std::vector<Found> found;
  std::error_code ignored;
  for (fs::directory_iterator system(project.dir() / "estimates", ignored), end; system != end;
       system.increment(ignored)) {
    for (fs::directory_iterator file(system->path(), ignored); file != end; file.increment(ignored)) {
      if (file->path().extension() == ".tum") found.push_back({system->path().filename().string(), file->path()});
    }
  }
  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.file < b.file; });
  return found;
}

fs::path ReferenceOf(const Project& project, const std::string& run) {
  return project.ResultDir("reference", run) / "poses.csv";
}

PoseSequence SequenceOf(const std::vector<TimedPose>& poses) {
  PoseSequence sequence;
  for (const TimedPose& pose : poses) {
    sequence.stamps_ns.push_back(pose.stamp_ns);
    sequence.poses.emplace_back(pose.target_from_body);
  }
  return sequence;
}

// The cameras of a result of localize, with the sigmas they state.
EstimateReport ScoreCameras(const Project& project, const EvaluatedRun& run, const EstimateScoreOptions& options) {
  SystemConfig config;
  config.point = "camera";
  const bool placed = !run.result.cameras.empty();
  if (!placed) config.alignment = TrajectoryAlignment::kSE3;
  EstimateReport report =
      ScoreEstimate(OwnSystem(run.variant), run.run, SequenceOf(placed ? run.result.cameras : run.result.cameras_odom),
                    ReadReferencePoses(ReferenceOf(project, run.run)), project.run(run.run).cameras, config, options);
  if (!placed) report.notes.push_back("the run has no place in the site's frame: fitted to the reference first");
  std::map<int64_t, Eigen::Vector3d> sigmas;
  for (const CameraResult& camera : run.result.images) {
    if (camera.sigma_m) sigmas.emplace(camera.stamp_ns, *camera.sigma_m);
  }
  for (EstimateRow& row : report.rows) {
    const auto sigma = sigmas.find(row.stamp_ns);
    if (placed && sigma != sigmas.end()) row.estimate_sigma_m = sigma->second;
  }
  return report;
}

}  // namespace

std::string OwnSystem(const std::string& variant) { return ResultNameOf(kOwnSystem, variant); }

bool IsOwnSystem(const std::string& system) { return system == kOwnSystem || system.starts_with(OwnSystem("") + "@"); }

std::vector<fs::path> EstimateInputs(const Project& project) {
  std::vector<fs::path> inputs;
  for (const Found& found : FindEstimates(project)) {
    inputs.push_back(found.file);
    inputs.push_back(found.file.parent_path() / "system.yaml");
    inputs.push_back(ReferenceOf(project, found.file.stem().string()));
  }
  for (const std::string& run : project.RunNames()) {
    if (fs::exists(ReferenceOf(project, run))) inputs.push_back(ReferenceOf(project, run));
  }
  std::sort(inputs.begin(), inputs.end());
  inputs.erase(std::unique(inputs.begin(), inputs.end()), inputs.end());
  return inputs;
}

std::vector<EstimateReport> ScoreEstimates(const Project& project, const EstimateScoreOptions& options,
                                           const std::vector<EvaluatedRun>& runs, ProgressSink& progress) {
  std::vector<EstimateReport> reports;
  for (const EvaluatedRun& run : runs) {
    if (!fs::exists(ReferenceOf(project, run.run)) || run.result.cameras_odom.empty()) continue;
    try {
      reports.push_back(ScoreCameras(project, run, options));
    } catch (const Error& e) {
      progress.Log(LogLevel::kWarning, "the cameras of run " + run.run + " are not scored: " + e.what());
    }
  }
  for (const Found& found : FindEstimates(project)) {
    const std::string run = found.file.stem().string();
    const auto skip = [&](const std::string& why) {
      progress.Log(LogLevel::kWarning, "estimates/" + found.system + "/" + run + ".tum is not scored: " + why);
    };
    try {
      if (IsOwnSystem(found.system)) {
        skip("the name '" + found.system + "' is that of this program's own cameras; rename the folder");
        continue;
      }
      const std::vector<std::string> names = project.RunNames();
      if (std::find(names.begin(), names.end(), run) == names.end()) {
        skip("there is no run '" + run + "'; the file's name must be a run's");
        continue;
      }
      if (!fs::exists(ReferenceOf(project, run))) {
        skip("there are no reference poses of " + run + "; run `trigpoint reference` first");
        continue;
      }
      reports.push_back(ScoreEstimate(found.system, run, ReadPoseSequence(found.file),
                                      ReadReferencePoses(ReferenceOf(project, run)), project.run(run).cameras,
                                      ReadSystemConfig(found.file.parent_path() / "system.yaml"), options));
    } catch (const Error& e) {
      skip(e.what());
    }
  }
  return reports;
}

}  // namespace trigpoint
