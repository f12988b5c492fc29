#include "localize/files/clock_check.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/error.h"
#include "datasets/project/manifest.h"
#include "localize/files/run_reconstruction.h"

namespace trigpoint {
namespace {

// What images and odometry show of the images' times; nothing where images are so far apart that the body may have
// stood still at each, or have times in whole seconds.
std::vector<ClockError> ClockErrorsOf(const LocalizeInput& input, const Reconstruction& reconstruction,
                                      const ReconstructRunOptions& options, const StageContext& context) {
  if (!input.has_odometry || input.time_resolution_s > 0 || MedianStep(input) > options.pairs.video_step_m) return {};
  try {
    return FindClockErrors(input, reconstruction, context.threads, context.cancel);
  } catch (const NumericError&) {
    return {};  // what does not determine the poses shows no times
  }
}

bool IsMoreSignificant(const ClockError& e, const ClockError* than) {
  if (than == nullptr) return true;
  // Of two cameras each is as late as the other is early: the second is named.
  const bool cameras = e.camera >= 0 && than->camera >= 0;
  return e.Sigmas() > (cameras ? 0.95 : 1) * than->Sigmas();
}

std::string Late(double late_s, double sigma_s) {
  return fmt::format("{:.3f} s {} (1 sigma {:.3f} s)", std::abs(late_s), late_s < 0 ? "early" : "late", sigma_s);
}

// What is late ("the images of camera cam1"), and against what, with what to do.
std::pair<std::string, std::string> Describe(const LocalizeInput& input, const ClockError& e) {
  if (e.camera >= 0) {
    const std::string& camera = input.cameras[static_cast<size_t>(e.camera)].name;
    return {"the images of camera " + camera,
            fmt::format("those of the other cameras; expected one clock for all cameras: correct their times, or "
                        "timeshift_cam_imu of {} in camchain.yaml, and check its T_cam_imu",
                        camera)};
  }
  if (!e.from_ns) {
    return {"the images",
            "odometry.tum, and correcting its times does not remove this; expected one clock for both: check the times "
            "of both, and whether odometry has a wrong scale or rate of turn in a part of the run"};
  }
  return {
      fmt::format("from about {:.1f} s on the images", 1e-9 * static_cast<double>(*e.from_ns)),
      "odometry.tum, and before that they are not; expected one clock for both: check the times and the order of the "
      "images (one that was lost shifts the times of all that follow) and of odometry. Odometry whose lengths are "
      "wrong in a part of the run looks the same"};
}

}  // namespace

void RequireOneClock(const Run& run, const LocalizeInput& input, const Reconstruction& reconstruction,
                     const ReconstructRunOptions& options, const StageContext& context) {
  constexpr double kLeast_s = 0.1, kSigmas = 5, kPartSigmas = 6;  // there are 15 places to choose from
  const ClockError* worst = nullptr;
  const std::vector<ClockError> errors = ClockErrorsOf(input, reconstruction, options, context);
  for (const ClockError& e : errors) {
    const bool late = std::abs(e.late_s) > kLeast_s && e.Sigmas() > (e.from_ns ? kPartSigmas : kSigmas);
    if (late && IsMoreSignificant(e, worst)) worst = &e;
  }
  if (worst == nullptr) return;
  const auto [images, others] = Describe(input, *worst);
  throw RefusedInput(
      kRefusedOdometry,
      fmt::format("{}: {} are {} against {}. Option --set reconstruct.check_conventions=false skips this check",
                  (run.dir / "images.txt").string(), images, Late(worst->late_s, worst->sigma_s), others));
}

std::optional<ClockError> FindLateImages(const LocalizeInput& input, const Reconstruction& reconstruction,
                                         const ReconstructRunOptions& options, bool begun,
                                         const StageContext& context) {
  constexpr double kLeast_s = 0.05, kSigmas = 5, kRest_s = 0.01, kRestSigmas = 2;
  const std::vector<ClockError> errors = ClockErrorsOf(input, reconstruction, options, context);
  if (errors.empty()) return std::nullopt;
  const ClockError& all = errors.front();
  const double least_s = begun ? kRest_s : kLeast_s, sigmas = begun ? kRestSigmas : kSigmas;
  return std::abs(all.late_s) > least_s && all.Sigmas() > sigmas ? std::optional(all) : std::nullopt;
}

void SayLate(const Run& run, double late_s, double sigma_s, StageContext& context) {
  context.metrics["odometry_time_correction_s"] = {{"late_s", late_s}, {"sigma_s", sigma_s}};
  context.progress.Log(
      LogLevel::kWarning,
      fmt::format(
          "{}: the images are {} against odometry.tum, as the path on which they were taken shows; the times of "
          "odometry are corrected by that. Set odometry: {{time_offset_s: {:.3f}}} in run.yaml, or correct the "
          "times",
          (run.dir / "images.txt").string(), Late(late_s, sigma_s), run.config.odometry_time_offset_s));
}

}  // namespace trigpoint
