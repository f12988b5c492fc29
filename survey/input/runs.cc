#include "survey/input/runs.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/base/error.h"

namespace trigpoint {

std::vector<const Run*> SurveyRuns(const Project& project) {
  std::vector<const Run*> runs;
  for (const Run& run : project.site().runs) {
    if (run.config.role != "evaluation") runs.push_back(&run);
  }
  return runs;
}

void RequireKnownLens(const std::string& run, const std::vector<BodyCamera>& cameras, bool self_calibrate) {
  const bool known = std::none_of(cameras.begin(), cameras.end(),
                                  [](const BodyCamera& c) { return c.focal_sigma_share >= kWildGuess; });
  if (known || self_calibrate) return;
  throw InputError("run " + run +
                   ": the lens of its pictures is not known; expected camchain.yaml (`trigpoint calibrate`), photos "
                   "whose EXIF states the focal length, a lens that `trigpoint reconstruct` found, or `trigpoint "
                   "survey --set self_calibrate=true`");
}

void WarnOfGuessedLens(const SurveyRun& run, std::vector<std::string>* warnings) {
  double share = 0;
  for (const BodyCamera& camera : run.cameras) share = std::max(share, camera.focal_sigma_share);
  if (!(share > 0)) return;
  warnings->push_back(fmt::format(
      "run {}: its lens is taken from EXIF (focal length good to {:.0f} %, 1 sigma; no distortion), and the map's "
      "sigmas do not contain that error; calibrate the camera (trigpoint calibrate), run `trigpoint reconstruct` "
      "first, which estimates the lens, or run `trigpoint survey --set self_calibrate=true`",
      run.name, 100 * share));
}

}  // namespace trigpoint
