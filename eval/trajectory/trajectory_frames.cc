#include "eval/trajectory/trajectory_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

constexpr size_t kLeastPairs = 10;
constexpr double kLeastPath_m = 1;
constexpr double kSmaller = 5;        // errors shrink by this factor before frames are said to differ
constexpr double kNothing = 1e-6;     // of the errors that were, or of the path: rounding
constexpr double kWorthAFreedom = 2;  // and by this one for each kind of alignment beyond the simplest

double Rmse(const std::vector<PosePair>& pairs) { return StatisticsOf(AbsoluteErrors(pairs).translation_m).rmse; }

}  // namespace

std::optional<FrameDifference> FindFrameDifference(const std::vector<PosePair>& pairs) {
  if (pairs.size() < kLeastPairs || PathLength(pairs) < kLeastPath_m) return std::nullopt;
  std::optional<FrameDifference> found;
  const double before = Rmse(pairs);
  if (before < kNothing * PathLength(pairs)) return std::nullopt;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const PosePair& pair : pairs) centre += pair.estimate.translation / static_cast<double>(pairs.size());
  for (const TrajectoryAlignment alignment :
       {TrajectoryAlignment::kYaw, TrajectoryAlignment::kSE3, TrajectoryAlignment::kSim3}) {
    std::vector<PosePair> aligned = pairs;
    Sim3d fit;
    try {
      fit = Align(&aligned, alignment);
    } catch (const Error&) {  // degenerate for this kind
      continue;
    }
    const double after = Rmse(aligned);
    const bool better =
        !found || (kWorthAFreedom * after <= found->rmse_after_m && found->rmse_after_m > kNothing * before);
    if (kSmaller * after > before || !better) continue;
    found = FrameDifference{
        alignment, before, after, Eigen::AngleAxisd(fit.rotation).angle() * kRadToDeg, (fit * centre - centre).norm(),
        fit.scale};
  }
  return found;
}

std::string RelativeName(const RelativeOptions& options) {
  const char* frames = options.delta == 1 ? "frame" : "frames";
  const char* unit = options.unit == DeltaUnit::kFrames ? frames : options.unit == DeltaUnit::kMetres ? "m" : "s";
  return fmt::format("{:g} {}{}", options.delta, unit, options.all_pairs ? " all" : "");
}

std::string Describe(const FrameDifference& d, const std::string& unit, double metres_per_unit) {
  const bool scaled = d.proposed == TrajectoryAlignment::kSim3;
  return fmt::format("the frames differ by {:.1f} deg, {:.2f} {}{}: ATE {:.4f} {} as given, {:.4f} {} after a {} fit",
                     d.turned_deg, d.moved_m / metres_per_unit, unit,
                     scaled ? fmt::format(" and a scale of {:.4f}", d.scale) : "", d.rmse_before_m / metres_per_unit,
                     unit, d.rmse_after_m / metres_per_unit, unit,
                     scaled                                    ? "similarity"
                     : d.proposed == TrajectoryAlignment::kYaw ? "yaw and shift"
                                                               : "rigid");
}

}  // namespace trigpoint
