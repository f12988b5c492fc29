// Timed poses and their files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct TimedPose {
  int64_t stamp_ns = 0;
  Rigid3d target_from_body;  // e.g. odom_from_body, world_from_cam: the frame the trajectory is given in
};

// Poses in strictly ascending time.
struct Trajectory {
  std::vector<TimedPose> poses;
  std::vector<std::string> warnings;  // what was repaired or dropped while reading, one sentence each

  // Interpolated on SE(3) (slerp, linear); nothing outside the covered time or in a gap longer than `max_gap_ns`.
  std::optional<Rigid3d> At(int64_t stamp_ns, int64_t max_gap_ns) const;
};

// `timestamp tx ty tz qx qy qz qw`, seconds (or integer nanoseconds); '#' comments. EuRoC CSV and KITTI (3x4 rows,
// no time: `times` gives it) too. Out-of-order and doubled stamps are sorted/dropped with a warning; rows that are
// not finite or whose quaternion is not a unit one (within 1e-3) are dropped and named; a file with no usable row
// throws InputError naming file and line.
Trajectory ReadTrajectory(const std::filesystem::path& file);
Trajectory ReadKittiTrajectory(const std::filesystem::path& file, const std::filesystem::path& times);
// TUM, nine decimals for time and position; written to a temporary name and renamed. `header`: '#' lines without '#'.
void WriteTum(const std::filesystem::path& file, const std::vector<TimedPose>& poses,
              const std::vector<std::string>& header);

// Decimal seconds to nanoseconds and back, exact to the nanosecond (no double in between).
int64_t ParseSecondsToNs(std::string_view text);  // throws InputError
std::string FormatNsAsSeconds(int64_t ns, int decimals = 9);

}  // namespace trigpoint
