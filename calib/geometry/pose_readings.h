// Ways in which a file of poses may be meant, and which of them agrees with motions measured in another way.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

// One way to read poses that are documented as odom_from_body with quaternions x y z w, body axes forward, left, up.
struct PoseReading {
  std::string what;  // how the file differs from what is expected; empty: it does not
  std::string mend;  // what its owner does about it
  int changes = 0;   // number of differences: of readings that agree equally well, the simplest is named
  std::function<Rigid3d(const Rigid3d&)> apply;  // pose as read to odom_from_body
};

// The documented reading first; then wrong orders, inverses, signs, body axes, and combinations of these.
std::vector<PoseReading> PoseReadings();

// Poses of a sensor instead of the body.
PoseReading PosesOfSensor(const std::string& name, const Rigid3d& sensor_from_body);

// Motion of a sensor on the body between two poses, measured without odometry.
struct MeasuredMotion {
  int a = 0, b = 0;          // indices of poses
  Rigid3d sensor_from_body;  // the same at both
  Rigid3d b_from_a;          // of the sensor; the length of the translation is unknown
  bool has_direction = false;
  double sigma_rotation_rad = 0, sigma_direction_rad = 0;
  int matches = 0;  // features that show it
};

// How many of the motions agree with poses. Motions that neither turn nor are predicted to turn are not counted among
// the turns.
struct MotionAgreement {
  int turns = 0, turns_agree = 0;
  int directions = 0, directions_agree = 0;
  double rotation_off_rad = 0, direction_off_rad = 0;  // medians of those counted

  double TurnShare() const { return turns > 0 ? static_cast<double>(turns_agree) / turns : 1; }
  double DirectionShare() const { return directions > 0 ? static_cast<double>(directions_agree) / directions : 1; }
};

MotionAgreement CompareMotions(const std::vector<Rigid3d>& odom_from_body, const std::vector<MeasuredMotion>& motions);

// Motions that share poses share errors: of n poses, at most n - 1 motions are independent.
int IndependentMotions(const std::vector<MeasuredMotion>& motions);

// Whether one motion agrees, in as far as it shows anything.
bool Agrees(const std::vector<Rigid3d>& odom_from_body, const MeasuredMotion& motion);

// What one motion shows against poses.
struct MotionComparison {
  bool turns = false, turn_agrees = true;
  bool moves = false, direction_agrees = true;
  double rotation_off_rad = 0, direction_off_rad = 0;
  double length_m = 0;  // of the sensor's translation, by the poses
};

MotionComparison CompareMotion(const std::vector<Rigid3d>& odom_from_body, const MeasuredMotion& motion);

struct ReadingVerdict {
  enum class Kind { kAgrees, kUndecided, kContradicted };
  Kind kind = Kind::kUndecided;
  MotionAgreement as_read, best;
  std::vector<PoseReading> better;  // the readings that agree; several where the motion does not tell them apart
};

// `poses` as read. Contradicted: at least four of the turns or directions can be compared and most disagree, or another
// reading is far closer to all of them. Undecided: fewer can be compared.
ReadingVerdict JudgeReadings(const std::vector<Rigid3d>& poses, const std::vector<MeasuredMotion>& motions,
                             const std::vector<PoseReading>& readings);

// "; they agree with COUNTS if READING: what to do; or if ...", at most three readings; empty: none agrees. `counts`
// says how many agree with the best.
std::string BetterReadings(const ReadingVerdict& verdict, const std::string& counts);

}  // namespace trigpoint
