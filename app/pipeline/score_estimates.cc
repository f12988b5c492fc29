#include "app/pipeline/score_estimates.h"

#include <algorithm>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

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

}  // namespace

std::vector<fs::path> EstimateInputs(const Project& project) {
  std::vector<fs::path> inputs;
  for (const Found& found : FindEstimates(project)) {
    inputs.push_back(found.file);
    inputs.push_back(found.file.parent_path() / "system.yaml");
    inputs.push_back(ReferenceOf(project, found.file.stem().string()));
  }
  std::sort(inputs.begin(), inputs.end());
  inputs.erase(std::unique(inputs.begin(), inputs.end()), inputs.end());
  return inputs;
}

std::vector<EstimateReport> ScoreEstimates(const Project& project, const EstimateScoreOptions& options,
                                           ProgressSink& progress) {
  std::vector<EstimateReport> reports;
  for (const Found& found : FindEstimates(project)) {
    const std::string run = found.file.stem().string();
    const auto skip = [&](const std::string& why) {
      progress.Log(LogLevel::kWarning, "estimates/" + found.system + "/" + run + ".tum is not scored: " + why);
    };
    try {
      const std::vector<std::string> runs = project.RunNames();
      if (std::find(runs.begin(), runs.end(), run) == runs.end()) {
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
