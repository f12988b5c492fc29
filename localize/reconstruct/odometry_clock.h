// Does odometry run on the clock of the images? The rotation between pictures is compared with odometry's at shifted
// times, which needs no tags and no scale.
#pragma once

#include <optional>
#include <vector>

#include "datasets/io/trajectory.h"

namespace trigpoint {

// Motion of a sensor on the body between two images, measured without odometry.
struct MeasuredTurn {
  int64_t a_ns = 0, b_ns = 0;           // stamps of the images
  Eigen::Quaterniond sensor_from_body;  // the same at both
  Eigen::Quaterniond b_from_a;          // of the sensor: its rotation
  // and its translation's direction (unit, of b_from_a), with 1 sigma, where that is known
  std::optional<Eigen::Vector3d> direction = std::nullopt;
  double sigma_direction_rad = 0;
};

struct OdometryClock {
  double offset_s = 0;  // to be added to odometry's stamps; with a rate, at the first turn
  double rate = 0;      // seconds that are to be added for each second after it; 0 unless significant
  double sigma_s = 0;   // 1 sigma, from all offsets that the turns allow and the step of odometry
  double off_before_rad = 0, off_after_rad = 0;  // median difference of rotation without and with the offset
  bool agrees = false;                           // no offset lies within three sigma, or within 0.05 s
  bool significant = false;                      // the turns agree far better with the offset than without
};

// The offset within +-`most_s` with which odometry turns as the images do. Nothing where fewer than eight turns can be
// compared. The noise of the turns is found from their residuals at the best offset; a turn counts for no more than
// sqrt(12) sigma, and the turns between n images for at most n - 1 independent ones. Where no single offset makes them
// agree, rates of less than 5 % are tried, too. Linear in turns and offsets tried.
std::optional<OdometryClock> FindOdometryClock(const Trajectory& odometry, const std::vector<MeasuredTurn>& turns,
                                               double most_s);

// A clock that agrees in one part of a run and is off in the other, as where a picture was lost and later ones have
// each the time of the one before.
struct ClockStep {
  int64_t at_ns = 0;  // about where it steps
  bool after = true;  // it is off after that, else before
  OdometryClock clock;
};

// Nothing where one offset or one rate explains all turns. The place is known to a quarter of the run.
std::optional<ClockStep> FindClockStep(const Trajectory& odometry, std::vector<MeasuredTurn> turns, double most_s);

}  // namespace trigpoint
