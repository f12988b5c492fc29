#include "localize/reconstruct/odometry_stretch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "calib/estimation/huber_by_median.h"
#include "calib/geo/geodetic.h"

namespace trigpoint {
namespace {

constexpr int kLeastMotions = 12;
constexpr int kIterations = 10;
constexpr double kLeastDirection_rad = 1 * kDegToRad;  // 1 sigma, with odometry's own
constexpr double kKnown_rad = 2 * kDegToRad;           // 1 sigma beyond which nothing is known

// Of odometry's displacement v, the part across the direction that the images show is zero after the stretch:
// n (I + a diag(1, -1) + b antidiag(1, 1) + c turn) v = 0.
struct Row {
  Eigen::Vector3d of_abc;
  double rest = 0;
};

std::vector<Row> RowsOf(const std::vector<Rigid3d>& odom_from_body, const std::vector<MeasuredMotion>& motions) {
  constexpr double kLevel = 0.8;  // share of a motion that is horizontal
  std::vector<Row> rows;
  for (const MeasuredMotion& m : motions) {
    if (!m.has_direction) continue;
    const auto pose = [&](int k) { return odom_from_body[static_cast<size_t>(k)] * m.sensor_from_body.Inverse(); };
    const Eigen::Vector3d by_odometry = pose(m.b).translation - pose(m.a).translation;
    const Eigen::Vector3d by_images = pose(m.a).rotation * m.b_from_a.Inverse().translation;
    Eigen::Vector2d v = by_odometry.head<2>(), u = by_images.head<2>();
    if (v.norm() < 1e-6 || v.norm() < kLevel * by_odometry.norm() || u.norm() < kLevel * by_images.norm()) continue;
    v.normalize(), u.normalize();
    const Eigen::Vector2d n(-u.y(), u.x());
    const double sigma = std::hypot(kLeastDirection_rad, m.sigma_direction_rad);
    rows.push_back({Eigen::Vector3d(n.dot(Eigen::Vector2d(v.x(), -v.y())), n.dot(Eigen::Vector2d(v.y(), v.x())),
                                    n.dot(Eigen::Vector2d(-v.y(), v.x()))) /
                        sigma,
                    n.dot(v) / sigma});
  }
  return rows;
}

}  // namespace

std::optional<OdometryStretch> FindStretch(const std::vector<Rigid3d>& odom_from_body,
                                           const std::vector<MeasuredMotion>& motions) {
  const std::vector<Row> rows = RowsOf(odom_from_body, motions);
  const int independent = std::min(static_cast<int>(rows.size()), IndependentMotions(motions));
  if (independent < kLeastMotions) return std::nullopt;
  Eigen::Vector3d abc = Eigen::Vector3d::Zero();
  Eigen::Matrix3d normal;
  HuberByMedian huber;
  for (int k = 0; k < kIterations; ++k) {
    normal.setZero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Row& row : rows) {
      const double weight = huber.Weight(std::abs(row.of_abc.dot(abc) + row.rest));
      normal += weight * row.of_abc * row.of_abc.transpose();
      right -= weight * row.rest * row.of_abc;
    }
    huber.EndRound();
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(normal);
    if (ldlt.info() != Eigen::Success || ldlt.rcond() < 1e-12) return std::nullopt;
    abc = ldlt.solve(right);
  }
  const double r = abc.head<2>().norm();
  if (!(r > 0) || r >= 1) return std::nullopt;
  const Eigen::Vector3d along(abc.x() / r, abc.y() / r, 0);
  OdometryStretch found;
  found.sigma_rad =
      huber.noise() * std::sqrt(along.dot(normal.ldlt().solve(along)) * static_cast<double>(rows.size()) / independent);
  if (!(found.sigma_rad < kKnown_rad)) return std::nullopt;
  found.ratio = (1 + r) / (1 - r);
  found.sigma_ratio = 2 * found.sigma_rad / ((1 - r) * (1 - r));
  found.turned_rad = std::asin(r);
  // What mends odometry lengthens this axis: odometry is long across it.
  found.axis_rad = 0.5 * std::atan2(-abc.y(), -abc.x());
  found.motions = static_cast<int>(rows.size());
  return found;
}

}  // namespace trigpoint
