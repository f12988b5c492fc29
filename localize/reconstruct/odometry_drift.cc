#include "localize/reconstruct/odometry_drift.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/median.h"
#include "calib/estimation/huber_by_median.h"
#include "calib/estimation/median_test.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/path.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

constexpr int kLeastMotions = 8;
constexpr int kIterations = 10;
constexpr double kLeast_rad = 0.1 * kDegToRad;  // 1 sigma of a rotation between two images: what their lens adds

// By what odometry turns more than two images show, body axes, in sigmas, and over how many metres.
struct Turn {
  Eigen::Vector3d off;
  double length = 0;
};

std::vector<Turn> TurnsOf(const std::vector<Rigid3d>& poses, const std::vector<double>& travelled,
                          const std::vector<MeasuredMotion>& motions) {
  std::vector<Turn> turns;
  for (const MeasuredMotion& m : motions) {
    const auto a = static_cast<size_t>(m.a), b = static_cast<size_t>(m.b);
    const Eigen::Quaterniond body_from_sensor = m.sensor_from_body.rotation.conjugate();
    const Eigen::Quaterniond by_odometry = poses[a].rotation.conjugate() * poses[b].rotation;  // a_from_b
    const Eigen::Quaterniond by_images =
        body_from_sensor * m.b_from_a.rotation.conjugate() * m.sensor_from_body.rotation;
    const double sigma = std::hypot(kLeast_rad, m.sigma_rotation_rad);
    turns.push_back({LogSO3(by_images.conjugate() * by_odometry) / sigma, (travelled[b] - travelled[a]) / sigma});
  }
  return turns;
}

// Poses with steps that are turned back by the drift over the metres travelled from each to the next.
std::vector<Rigid3d> TurnedBack(const std::vector<Rigid3d>& poses, const std::vector<double>& travelled,
                                const Eigen::Vector3d& rad_m) {
  std::vector<Rigid3d> mended = {poses.front()};
  for (size_t k = 1; k < poses.size(); ++k) {
    Rigid3d step = poses[k - 1].Inverse() * poses[k];
    step.rotation = step.rotation * ExpSO3((travelled[k - 1] - travelled[k]) * rad_m);
    mended.push_back(mended.back() * step);
    mended.back().rotation.normalize();
  }
  return mended;
}

}  // namespace

std::optional<OdometryDrift> FindDrift(const std::vector<Rigid3d>& odom_from_body,
                                       const std::vector<MeasuredMotion>& motions, double noise_rad) {
  constexpr double kSigmas = 4;
  const int independent = IndependentMotions(motions);
  if (independent < kLeastMotions) return std::nullopt;
  const std::vector<double> travelled = PathLengths(odom_from_body);
  const std::vector<Turn> turns = TurnsOf(odom_from_body, travelled, motions);
  OdometryDrift drift;
  drift.length_m = travelled.back();
  drift.noise_rad = noise_rad;
  Eigen::Array<bool, 3, 1> significant;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    HuberByMedian huber;
    double normal = 0;
    for (int k = 0; k < kIterations; ++k) {
      double right = 0;
      normal = 0;
      for (const Turn& turn : turns) {
        const double weight = huber.Weight(std::abs(turn.off(axis) - drift.rad_m(axis) * turn.length));
        normal += weight * turn.length * turn.length;
        right += weight * turn.length * turn.off(axis);
      }
      huber.EndRound();
      if (!(normal > 0)) return std::nullopt;
      drift.rad_m(axis) = right / normal;
    }
    drift.sigma_rad_m(axis) = huber.noise() * std::sqrt(static_cast<double>(turns.size()) / independent / normal);
    const double total = drift.rad_m(axis) * drift.length_m, chance = drift.sigma_rad_m(axis) * drift.length_m;
    significant(axis) = noise_rad > 0 && std::abs(total) > kSigmas * std::hypot(noise_rad, chance);
  }
  drift.significant = significant.any();
  drift.significant_rad_m = significant.select(drift.rad_m.array(), 0.0);
  return drift;
}

std::vector<Rigid3d> WithoutDrift(const std::vector<Rigid3d>& odom_from_body, const Eigen::Vector3d& rad_m) {
  return TurnedBack(odom_from_body, PathLengths(odom_from_body), rad_m);
}

double TurnNoise(const std::vector<Rigid3d>& odom_from_body, const std::vector<MeasuredMotion>& motions,
                 const std::vector<double>& variances) {
  constexpr size_t kLeast = 4;
  constexpr double kMost = 1e3;
  if (motions.empty() || variances.size() != odom_from_body.size()) return 1;
  std::vector<double> squares, images, odometry;
  std::vector<int> spans;
  for (const MeasuredMotion& m : motions) {
    squares.push_back(std::pow(CompareMotion(odom_from_body, m).rotation_off_rad, 2));
    images.push_back(std::pow(kLeast_rad, 2) + std::pow(m.sigma_rotation_rad, 2));
    odometry.push_back(std::abs(variances[static_cast<size_t>(m.b)] - variances[static_cast<size_t>(m.a)]));
    spans.push_back(std::abs(m.b - m.a));
  }
  const auto median = [&](double factor) {  // over its expectation
    std::vector<double> ratios;
    for (size_t k = 0; k < squares.size(); ++k) {
      ratios.push_back(squares[k] / (images[k] + factor * factor * odometry[k]) / kMediansOfChi2[3]);
    }
    return Median(std::move(ratios));
  };
  // Motions over the same steps have their noise in common.
  const size_t apart = (odom_from_body.size() - 1) / static_cast<size_t>(std::max(1, Median(std::move(spans))));
  const size_t independent = std::min({apart, motions.size(), static_cast<size_t>(IndependentMotions(motions))});
  if (independent < kLeast || !IsMedianTooLarge(median(1), independent, 3)) return 1;
  double least = 1, most = kMost;
  while (most > 1.001 * least) {
    const double middle = std::sqrt(least * most);
    (median(middle) > 1 ? least : most) = middle;
  }
  return most;
}

std::string DriftText(const OdometryDrift& drift) {
  constexpr const char* kAxes[] = {"roll", "pitch", "heading"};  // about body x (forward), y (left), z (up)
  Eigen::Index axis = 0;
  drift.rad_m.cwiseAbs().maxCoeff(&axis);
  return fmt::format(
      "its {} drifts by {:+.3f} deg a metre (1 sigma {:.3f} deg; about the body's x forward, y left, z up), that is "
      "{:.1f} "
      "deg over the run's {:.0f} m, where its stated noise adds up to {:.1f} deg (1 sigma)",
      kAxes[axis], drift.rad_m(axis) * kRadToDeg, drift.sigma_rad_m(axis) * kRadToDeg,
      drift.rad_m(axis) * drift.length_m * kRadToDeg, drift.length_m, drift.noise_rad * kRadToDeg);
}

namespace {

// How far the body has travelled at a time, evenly between two poses; nothing before the first and after the last.
double TravelledAt(const std::vector<int64_t>& stamps_ns, const std::vector<double>& travelled, int64_t stamp_ns) {
  const auto after = std::upper_bound(stamps_ns.begin(), stamps_ns.end(), stamp_ns);
  if (after == stamps_ns.begin()) return travelled.front();
  if (after == stamps_ns.end()) return travelled.back();
  const auto k = static_cast<size_t>(after - stamps_ns.begin());
  const double share =
      static_cast<double>(stamp_ns - stamps_ns[k - 1]) / static_cast<double>(stamps_ns[k] - stamps_ns[k - 1]);
  return travelled[k - 1] + share * (travelled[k] - travelled[k - 1]);
}

}  // namespace

Trajectory WithoutDrift(const Trajectory& odometry, const std::vector<int64_t>& stamps_ns,
                        const std::vector<Rigid3d>& odom_from_body, const Eigen::Vector3d& rad_m) {
  const std::vector<double> travelled = PathLengths(odom_from_body);
  std::vector<Rigid3d> poses;
  std::vector<double> travelled_at;
  for (const TimedPose& pose : odometry.poses) {
    poses.push_back(pose.target_from_body);
    travelled_at.push_back(TravelledAt(stamps_ns, travelled, pose.stamp_ns));
  }
  poses = TurnedBack(poses, travelled_at, rad_m);
  Trajectory result = odometry;
  for (size_t k = 0; k < poses.size(); ++k) result.poses[k].target_from_body = poses[k];
  return result;
}

}  // namespace trigpoint
