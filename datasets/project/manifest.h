// The record of a result, results/<stage>/<name>/manifest.json.
#pragma once

#include <string>
#include <utility>

#include "calib/base/error.h"
#include "datasets/project/project.h"

namespace trigpoint {

// Input that a stage's check refuses. The record of the failed attempt keeps `what`, e.g. "odometry", so that stages
// which can do without that result know that the input itself is wrong.
class RefusedInput : public InputError {
 public:
  RefusedInput(std::string what, const std::string& message) : InputError(message), what_is_refused(std::move(what)) {}
  std::string what_is_refused;
};

// Why the manifest that is there is not what was written, e.g. "it has no SHA-256 of itself"; empty if it is, or if
// there is none.
std::string ManifestDamage(const Project& project, const std::string& stage, const std::string& name);

// Removes a result that nothing reads any more, with the records beside it. False, with nothing removed, unless its
// folder holds only what its manifest lists. The caller has the project's lock. Throws IoError.
bool RemoveResult(const Project& project, const std::string& stage, const std::string& name);

}  // namespace trigpoint
