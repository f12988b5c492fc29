// Are two trajectories given in the same frame?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "eval/trajectory/trajectory.h"

namespace trigpoint {

struct FrameDifference {
  TrajectoryAlignment proposed = TrajectoryAlignment::kSE3;  // the one with the fewest freedoms that explains it
  double rmse_before_m = 0, rmse_after_m = 0;
  double turned_deg = 0;  // rotation between the frames
  double moved_m = 0;     // what remains of it at the trajectory's centre
  double scale = 1;
};

// Unset where no alignment makes the errors of `pairs` at least five times smaller, or where fewer than ten pairs or
// less than a metre of path could not tell frames from errors.
std::optional<FrameDifference> FindFrameDifference(const std::vector<PosePair>& pairs);
// "the frames differ by 12.3 deg and 35.20 m: ATE 35.2031 m as given, 0.0123 m after a rigid fit".
std::string Describe(const FrameDifference& difference, const std::string& unit = "m", double metres_per_unit = 1);

// "10 m", "1 frames all".
std::string RelativeName(const RelativeOptions& options);

}  // namespace trigpoint
