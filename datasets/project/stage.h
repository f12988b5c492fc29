// Stages: what turns inputs and options into one results folder, once.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/project.h"

namespace trigpoint {

// Handed to a stage's body. Artefacts are written below `out` (a temporary folder beside the final place, renamed
// when the body returns); metrics end up in manifest.json and --json.
struct StageContext {
  const Project& project;
  std::filesystem::path out;
  int threads = 0;
  uint64_t seed = 1;
  ProgressSink& progress;
  const CancelToken& cancel;
  nlohmann::json& metrics;
};

// One result to be made: results/<stage>/<name>. Its identity is the hash of stage, version, options, seed and the
// contents of its inputs (files; results of earlier stages are named by their manifests).
struct StageRequest {
  std::string stage;
  std::string name;  // run, or run@variant; may be empty for a stage with a single result
  int version = 1;   // raise it when the stage's output changes for the same inputs
  nlohmann::json options;
  std::vector<std::filesystem::path> inputs;
  std::function<void(StageContext&)> body;
};

enum class StageState { kMissing, kDone, kOutOfDate, kFailed, kRunning };

struct StageOutcome {
  bool computed = false;  // false: an up-to-date result was there
  std::filesystem::path dir;
  nlohmann::json manifest;
};

// Computes the result unless an up-to-date one is there. Writes manifest.json and log.txt. On failure the old result
// stays, a failure record is left beside it for `status`, and the error goes on to the caller.
StageOutcome RunStage(const Project& project, const StageRequest& request, int threads, uint64_t seed,
                      ProgressSink& progress, const CancelToken& cancel);

StageState StateOf(const Project& project, const StageRequest& request, uint64_t seed);

}  // namespace trigpoint
