#include "localize/reconstruct/camera_mount.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "calib/estimation/huber_by_median.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

constexpr size_t kLeastMotions = 8;
constexpr int kIterations = 10;
constexpr double kLeastRotation_rad = 0.3 * kDegToRad, kLeastDirection_rad = 1 * kDegToRad;  // sigmas, with odometry's
constexpr double kKnown_rad = 1 * kDegToRad;  // 1 sigma of an axis that counts

// One vector by odometry and as it was measured, camera axes: a rotation vector, whose error has three components, or a
// unit direction, whose error has two.
struct VectorPair {
  Eigen::Vector3d predicted, measured;
  double sigma = 1;  // of a component
  size_t components = 3;
};

std::vector<VectorPair> PairsOf(const std::vector<Rigid3d>& odom_from_body,
                                const std::vector<MeasuredMotion>& motions) {
  std::vector<VectorPair> pairs;
  size_t directions = 0;
  for (const MeasuredMotion& m : motions) {
    const Rigid3d b_from_a = m.sensor_from_body * odom_from_body[static_cast<size_t>(m.b)].Inverse() *
                             odom_from_body[static_cast<size_t>(m.a)] * m.sensor_from_body.Inverse();
    pairs.push_back({LogSO3(b_from_a.rotation), LogSO3(m.b_from_a.rotation),
                     std::hypot(kLeastRotation_rad, m.sigma_rotation_rad), 3});
    if (!m.has_direction || b_from_a.translation.norm() < 1e-6) continue;
    pairs.push_back({b_from_a.translation.normalized(), m.b_from_a.translation.normalized(),
                     std::hypot(kLeastDirection_rad, m.sigma_direction_rad), 2});
    ++directions;
  }
  return directions < kLeastMotions ? std::vector<VectorPair>() : pairs;
}

}  // namespace

std::optional<MountError> FindMountError(const std::vector<Rigid3d>& odom_from_body,
                                         const std::vector<MeasuredMotion>& motions) {
  const std::vector<VectorPair> pairs = PairsOf(odom_from_body, motions);
  if (pairs.empty()) return std::nullopt;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  // true_cam_from_stated_cam
  Eigen::Matrix3d normal;
  HuberByMedian huber;
  for (int k = 0; k < kIterations; ++k) {
    normal.setZero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const VectorPair& pair : pairs) {
      const Eigen::Vector3d predicted = turn * pair.predicted, off = (pair.measured - predicted) / pair.sigma;
      const Eigen::Matrix3d j = -Skew(predicted) / pair.sigma;  // of Exp(d) predicted
      const double weight = huber.Weight(off.norm(), pair.components);
      normal += weight * j.transpose() * j;
      right += weight * j.transpose() * off;
    }
    huber.EndRound();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {  // axes that the motions do not show stay as stated
      // The stated sigmas decide: before the fit the residuals contain the error that is looked for.
      if (1 / std::sqrt(std::max(1e-12, eigen.eigenvalues()(i))) < kKnown_rad) {
        step += eigen.eigenvectors().col(i) * (eigen.eigenvectors().col(i).dot(right) / eigen.eigenvalues()(i));
      }
    }
    turn = ExpSO3(step) * turn;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
  MountError error;
  error.rotation = -LogSO3(turn);
  error.motions = static_cast<int>(motions.size());
  double variance = 0;
  for (int i = 0; i < 3; ++i) {
    const double axis = huber.noise() * huber.noise() / std::max(1e-12, eigen.eigenvalues()(i));
    if (std::sqrt(axis) < kKnown_rad) variance = std::max(variance, axis);
  }
  if (!(variance > 0)) return std::nullopt;
  error.sigma_rad = std::sqrt(variance);
  return error;
}

}  // namespace trigpoint
