// Stages: what turns inputs and options into one results folder, once.
//
//   results/<stage>/<name>/             manifest.json, log.txt, the artefacts
//   results/<stage>/.failed-<name>/     manifest.json and log.txt of the last attempt, if it failed
//   results/<stage>/.tmp-<name>/        the one being made; what a killed process leaves goes with the next lock
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
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

// One result to be made: results/<stage>/<name>. Its identity is the hash of stage, version, options, values, seed and
// the contents of its inputs.
struct StageRequest {
  std::string stage;
  std::string name;  // run, or run@variant; empty or @variant for a stage with a single result
  int version = 1;   // raise it when the stage's output changes for the same inputs
  nlohmann::json options = nlohmann::json::object();
  // Files and folders. An earlier stage's result is named by its manifest.json and counts by what it holds, so that
  // one that was made again and came out the same changes nothing. One that does not exist counts as missing.
  std::vector<std::filesystem::path> inputs;
  std::function<void(StageContext&)> body;
  // What else the result depends on and no input file says, e.g. the site's origin. Also goes into the manifest.
  nlohmann::json values = nlohmann::json::object();
  // Options that were given on the command line, {stage: {option: value}}: part of `options`, kept apart in the
  // manifest so that a change of trigpoint.yaml is noticed behind them.
  nlohmann::json given = nlohmann::json::object();
};

enum class StageState { kMissing, kDone, kOutOfDate, kFailed, kRunning };

// "missing", "done", "out of date", "failed", "running".
std::string_view StageStateName(StageState state);

struct StageOutcome {
  bool computed = false;  // false: an up-to-date result was there
  std::filesystem::path dir;
  nlohmann::json manifest;
};

// Computes the result unless an up-to-date one is there. Writes manifest.json and log.txt. On failure the old result
// stays, a failure record is left beside it for `status`, and the error goes on to the caller; what is not a
// trigpoint::Error becomes one. On cancellation nothing but the old result stays. Takes the project's lock unless this
// project object has it; stages of one project run one after the other.
StageOutcome RunStage(const Project& project, const StageRequest& request, int threads, uint64_t seed,
                      ProgressSink& progress, const CancelToken& cancel);

// Needs no lock and writes nothing.
StageState StateOf(const Project& project, const StageRequest& request, uint64_t seed);

// The manifest of a result, or of its failed attempt; nothing if there is none that can be read.
std::optional<nlohmann::json> ReadManifest(const Project& project, const std::string& stage, const std::string& name);
std::optional<nlohmann::json> ReadFailure(const Project& project, const std::string& stage, const std::string& name);

}  // namespace trigpoint
