#include "calib/geometry/pose_readings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "calib/base/median.h"
#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

constexpr double kDeg = EIGEN_PI / 180;
constexpr double kTurn = 4 * kDeg;                                // smaller rotations are not turns
constexpr double kLeastRotationGate = 2 * kDeg, kTurnPart = 0.3;  // a turn agrees within these
constexpr double kLeastDirectionGate = 25 * kDeg;
constexpr double kSigmas = 4;
constexpr int kLeastMotions = 4;
constexpr double kMost = 0.5, kAgreement = 0.75;  // shares: below the first a reading is contradicted
constexpr double kAlike = 0.03;                   // shares closer than this do not tell two readings apart,
constexpr double kAlikeMotions = 1.5;             // nor does one motion

Eigen::Quaterniond WrittenWFirst(const Eigen::Quaterniond& q) {
  const Eigen::Vector4d c = q.coeffs();  // as read: x y z w
  return Eigen::Quaterniond(c[0], c[1], c[2], c[3]);
}

// The same axis signs for a rotation: M R M.
Eigen::Quaterniond Mirrored(const Eigen::Quaterniond& q, const Eigen::Vector3d& signs) {
  const Eigen::Matrix3d m = signs.asDiagonal();
  return Eigen::Quaterniond(Eigen::Matrix3d(m * q.toRotationMatrix() * m));
}

// Rotations whose yaw counts from another direction of the frame than its positions, or the other way.
Rigid3d WithYaw(const Rigid3d& p, bool clockwise, double from) {
  const Eigen::Matrix3d r = p.rotation.toRotationMatrix();
  const double yaw = std::atan2(r(1, 0), r(0, 0)), meant = clockwise ? from - yaw : yaw + from;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(meant - yaw, Eigen::Vector3d::UnitZ())) * p.rotation, p.translation};
}

std::string AxisName(const Eigen::Vector3d& in_body) {
  static const char* const kNames[3][2] = {{"forward", "backward"}, {"left", "right"}, {"up", "down"}};
  Eigen::Index axis = 0;
  in_body.cwiseAbs().maxCoeff(&axis);
  return kNames[axis][in_body[axis] > 0 ? 0 : 1];
}

// The 24 rotations that take axes to axes, as other_from_body.
std::vector<Eigen::Matrix3d> AxisRotations() {
  std::vector<Eigen::Matrix3d> rotations;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d r = Eigen::Matrix3d::Zero();
      for (int row = 0; row < 3; ++row) r(row, order[static_cast<size_t>(row)]) = (signs >> row & 1) != 0 ? -1 : 1;
      if (r.determinant() > 0) rotations.push_back(r);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return rotations;
}

PoseReading Part(std::string what, std::string mend, std::function<Rigid3d(const Rigid3d&)> apply) {
  return {std::move(what), std::move(mend), 1, std::move(apply)};
}

PoseReading AsRead() {
  PoseReading reading;
  reading.apply = [](const Rigid3d& p) { return p; };
  return reading;
}

std::vector<PoseReading> AxesReadings() {
  std::vector<PoseReading> readings;
  for (const Eigen::Matrix3d& r : AxisRotations()) {
    if (r.isIdentity()) continue;
    const Eigen::Quaterniond other_from_body(r);
    std::string axes;
    for (int row = 0; row < 3; ++row) axes += (row > 0 ? ", " : "") + AxisName(r.row(row).transpose());
    readings.push_back(Part("its body axes are " + axes + " (expected forward, left, up)",
                            "turn the axes of the poses, or correct T_cam_imu in camchain.yaml",
                            [=](const Rigid3d& p) { return Rigid3d(p.rotation * other_from_body, p.translation); }));
  }
  return readings;
}

// Signs that are wrong in one half of the pose only.
std::vector<PoseReading> SignReadings() {
  const auto moved = [](double x, double y, double z) {
    return [=](const Rigid3d& p) { return Rigid3d(p.rotation, Eigen::Vector3d(x, y, z).cwiseProduct(p.translation)); };
  };
  std::vector<PoseReading> readings;
  readings.push_back(Part("its y is negated", "change the sign of ty", moved(1, -1, 1)));
  readings.push_back(Part("its x is negated", "change the sign of tx", moved(-1, 1, 1)));
  readings.push_back(Part("its z is negated", "change the sign of tz", moved(1, 1, -1)));
  readings.push_back(Part("its x and y are negated", "change the signs of tx and ty", moved(-1, -1, 1)));
  readings.push_back(Part("its positions are negated", "change the signs of tx, ty and tz", moved(-1, -1, -1)));
  readings.push_back(Part("its x and y are swapped", "swap the columns tx and ty", [](const Rigid3d& p) {
    return Rigid3d(p.rotation, {p.translation.y(), p.translation.x(), p.translation.z()});
  }));
  readings.push_back(Part("its yaw is negated (clockwise instead of counter-clockwise)", "negate the yaw",
                          [](const Rigid3d& p) { return WithYaw(p, true, 0); }));
  readings.push_back(Part("its yaw counts clockwise from y (expected counter-clockwise from x)",
                          "state the yaw as 90 deg minus it",
                          [](const Rigid3d& p) { return WithYaw(p, true, 0.5 * EIGEN_PI); }));
  readings.push_back(Part("its yaw counts from y (expected from x)", "add 90 deg to the yaw",
                          [](const Rigid3d& p) { return WithYaw(p, false, 0.5 * EIGEN_PI); }));
  readings.push_back(Part("it is left-handed (y points right)", "negate ty, qx and qz", [](const Rigid3d& p) {
    const Eigen::Vector3d signs(1, -1, 1);
    return Rigid3d(Mirrored(p.rotation, signs), signs.cwiseProduct(p.translation));
  }));
  readings.push_back(Part("its axes are those of Unity (right, up, forward, left-handed)",
                          "convert the poses to forward, left, up", [](const Rigid3d& p) {
                            // x right, y up, z forward to forward, left, up: a mirror, on both sides of the rotation.
                            Eigen::Matrix3d m;
                            m << 0, 0, 1, -1, 0, 0, 0, 1, 0;
                            return Rigid3d(
                                Eigen::Quaterniond(Eigen::Matrix3d(m * p.rotation.toRotationMatrix() * m.transpose())),
                                m * p.translation);
                          }));
  return readings;
}

PoseReading Combined(const PoseReading& first, const PoseReading& then) {
  if (first.changes == 0) return then;
  if (then.changes == 0) return first;
  PoseReading both;
  both.what = first.what + ", and " + then.what;
  both.mend = first.mend + "; then " + then.mend;
  both.changes = first.changes + then.changes;
  both.apply = [first = first.apply, then = then.apply](const Rigid3d& p) { return then(first(p)); };
  return both;
}

bool Enough(const MotionAgreement& m, double share) {
  return (m.turns < kLeastMotions || m.TurnShare() >= share) &&
         (m.directions < kLeastMotions || m.DirectionShare() >= share);
}

double Score(const MotionAgreement& m) {
  return static_cast<double>(m.turns_agree + m.directions_agree) / std::max(1, m.turns + m.directions);
}

// Whether `other` explains the directions of motion far better where both agree within the gates. The wrong sign of a
// small component (heights on a gentle slope) changes no direction by more than the gates, but it changes nearly all.
bool ClearlyCloser(const std::vector<Rigid3d>& other, const std::vector<Rigid3d>& poses,
                   const std::vector<MeasuredMotion>& motions) {
  constexpr double kTold = 3 * kDeg;  // predictions that differ by less are not told apart
  constexpr int kLeast = 6;           // motions; one in ten may say otherwise
  std::vector<double> off, other_off;
  int closer = 0;
  for (const MeasuredMotion& m : motions) {
    const MotionComparison here = CompareMotion(poses, m), there = CompareMotion(other, m);
    if (!here.turn_agrees || !there.turn_agrees || !here.moves || !there.moves) continue;
    if (std::abs(here.direction_off_rad - there.direction_off_rad) < std::max(kTold, m.sigma_direction_rad)) continue;
    off.push_back(here.direction_off_rad);
    other_off.push_back(there.direction_off_rad);
    closer += there.direction_off_rad < here.direction_off_rad ? 1 : 0;
  }
  const auto compared = static_cast<int>(off.size());
  return compared >= kLeast && 10 * closer >= 9 * compared && 3 * Median(other_off) < Median(off);
}

std::vector<Rigid3d> Read(const std::vector<Rigid3d>& poses, const PoseReading& reading) {
  std::vector<Rigid3d> read;
  read.reserve(poses.size());
  for (const Rigid3d& pose : poses) read.push_back(reading.apply(pose));
  return read;
}

}  // namespace

std::vector<PoseReading> PoseReadings() {
  const std::vector<PoseReading> orders = {
      AsRead(), Part("its quaternions are written w x y z (expected x y z w)", "reorder their columns",
                     [](const Rigid3d& p) { return Rigid3d(WrittenWFirst(p.rotation), p.translation); })};
  const std::vector<PoseReading> directions = {
      AsRead(),
      Part("its quaternions rotate the other way (expected odom_from_body)", "negate qx, qy and qz",
           [](const Rigid3d& p) { return Rigid3d(p.rotation.conjugate(), p.translation); }),
      Part("its poses are body_from_odom (expected odom_from_body)", "invert every pose",
           [](const Rigid3d& p) { return p.Inverse(); })};
  // Body axes last: they explain what others do where the motion shows little.
  const std::vector<PoseReading> axes = AxesReadings(), signs = SignReadings();
  std::vector<PoseReading> readings;
  for (const PoseReading& order : orders) {
    for (const PoseReading& direction : directions) readings.push_back(Combined(order, direction));
    for (const PoseReading& sign : signs) readings.push_back(Combined(order, sign));
  }
  for (const PoseReading& order : orders) {
    for (const PoseReading& direction : directions) {
      for (const PoseReading& frame : axes) readings.push_back(Combined(Combined(order, direction), frame));
    }
  }
  std::stable_sort(readings.begin(), readings.end(),
                   [](const PoseReading& a, const PoseReading& b) { return a.changes < b.changes; });
  return readings;
}

PoseReading PosesOfSensor(const std::string& name, const Rigid3d& sensor_from_body) {
  return Part("its poses are those of " + name + " (expected the body's)",
              "multiply every pose from the right by T_cam_imu",
              [=](const Rigid3d& p) { return p * sensor_from_body; });
}

MotionComparison CompareMotion(const std::vector<Rigid3d>& poses, const MeasuredMotion& m) {
  MotionComparison c;
  const Rigid3d b_from_a = m.sensor_from_body * poses[static_cast<size_t>(m.b)].Inverse() *
                           poses[static_cast<size_t>(m.a)] * m.sensor_from_body.Inverse();
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const double turn = std::max(AngleBetween(m.b_from_a.rotation, none), AngleBetween(b_from_a.rotation, none));
  c.rotation_off_rad = AngleBetween(m.b_from_a.rotation, b_from_a.rotation);
  c.turns = turn > kTurn;
  c.turn_agrees =
      !c.turns || c.rotation_off_rad < std::max({kLeastRotationGate, kTurnPart * turn, kSigmas * m.sigma_rotation_rad});
  c.length_m = b_from_a.translation.norm();
  c.moves = m.has_direction && c.length_m > 1e-9;
  if (c.moves) {
    c.direction_off_rad = AngleBetween(m.b_from_a.translation, b_from_a.translation);
    c.direction_agrees = c.direction_off_rad < std::max(kLeastDirectionGate, kSigmas * m.sigma_direction_rad);
  }
  return c;
}

MotionAgreement CompareMotions(const std::vector<Rigid3d>& poses, const std::vector<MeasuredMotion>& motions) {
  MotionAgreement m;
  std::vector<double> rotation_off, direction_off;
  for (const MeasuredMotion& motion : motions) {
    const MotionComparison c = CompareMotion(poses, motion);
    if (c.turns) {
      ++m.turns;
      m.turns_agree += c.turn_agrees ? 1 : 0;
      rotation_off.push_back(c.rotation_off_rad);
    }
    if (c.moves) {
      ++m.directions;
      m.directions_agree += c.direction_agrees ? 1 : 0;
      direction_off.push_back(c.direction_off_rad);
    }
  }
  m.rotation_off_rad = Median(std::move(rotation_off));
  m.direction_off_rad = Median(std::move(direction_off));
  return m;
}

int IndependentMotions(const std::vector<MeasuredMotion>& motions) {
  std::set<int> poses;
  for (const MeasuredMotion& m : motions) poses.insert({m.a, m.b});
  return motions.empty() ? 0 : static_cast<int>(std::min(motions.size(), poses.size() - 1));
}

bool Agrees(const std::vector<Rigid3d>& poses, const MeasuredMotion& motion) {
  const MotionComparison c = CompareMotion(poses, motion);
  return c.turn_agrees && c.direction_agrees;
}

ReadingVerdict JudgeReadings(const std::vector<Rigid3d>& poses, const std::vector<MeasuredMotion>& motions,
                             const std::vector<PoseReading>& readings) {
  ReadingVerdict verdict;
  verdict.as_read = verdict.best = CompareMotions(poses, motions);
  const MotionAgreement& as_read = verdict.as_read;
  if (Enough(as_read, kMost)) {
    verdict.kind = std::max(as_read.turns, as_read.directions) < kLeastMotions ? ReadingVerdict::Kind::kUndecided
                                                                               : ReadingVerdict::Kind::kAgrees;
    for (const PoseReading& reading : readings) {
      if (reading.changes != 1) continue;
      const std::vector<Rigid3d> read = Read(poses, reading);
      if (!Enough(CompareMotions(read, motions), kAgreement) || !ClearlyCloser(read, poses, motions)) continue;
      verdict.kind = ReadingVerdict::Kind::kContradicted;
      verdict.best = CompareMotions(read, motions);
      verdict.better = {reading};
      break;
    }
    return verdict;
  }
  verdict.kind = ReadingVerdict::Kind::kContradicted;
  std::vector<MotionAgreement> agreements;
  double most = 0;
  for (const PoseReading& reading : readings) {
    agreements.push_back(CompareMotions(Read(poses, reading), motions));
    if (Enough(agreements.back(), kAgreement)) most = std::max(most, Score(agreements.back()));
  }
  const double alike = std::max(kAlike, kAlikeMotions / std::max(1, as_read.turns + as_read.directions));
  int simplest = 0;
  for (size_t i = 0; i < readings.size(); ++i) {
    if (!Enough(agreements[i], kAgreement) || Score(agreements[i]) < std::max(kAgreement, most - alike)) continue;
    if (simplest == 0) {
      simplest = readings[i].changes;
      verdict.best = agreements[i];
    }
    if (readings[i].changes == simplest) verdict.better.push_back(readings[i]);
  }
  return verdict;
}

std::string BetterReadings(const ReadingVerdict& verdict, const std::string& counts) {
  constexpr size_t kNamed = 3;
  std::string text;
  for (size_t i = 0; i < std::min(verdict.better.size(), kNamed); ++i) {
    text += (i == 0 ? "; they agree with " + counts + " if " : "; or if ") + verdict.better[i].what + ": " +
            verdict.better[i].mend;
  }
  return text;
}

}  // namespace trigpoint
