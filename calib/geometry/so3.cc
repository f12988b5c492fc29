#include "calib/geometry/so3.h"

#include <algorithm>
#include <cmath>

namespace trigpoint {

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& w) {
  const double angle2 = w.squaredNorm();
  const double angle = std::sqrt(angle2);
  const double half_sinc = angle2 > 1e-12 ? std::sin(0.5 * angle) / angle : 0.5 - angle2 / 48.0;
  Eigen::Quaterniond q;
  q.w() = std::cos(0.5 * angle);
  q.vec() = half_sinc * w;
  return q;
}

Eigen::Vector3d LogSO3(const Eigen::Quaterniond& q_in) {
  const double sign = q_in.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q_in.vec();
  const double w = sign * q_in.w();
  const double n = v.norm();
  if (n < 1e-9) return 2.0 * v * (1.0 + n * n / 6.0) / std::max(w, 0.5);
  return (2.0 * std::atan2(n, w) / n) * v;
}

Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& w) {
  const double t2 = w.squaredNorm();
  const Eigen::Matrix3d k = Skew(w);
  if (t2 < 1e-10) return Eigen::Matrix3d::Identity() + 0.5 * k + k * k / 6.0;
  const double t = std::sqrt(t2);
  const double s = std::sin(0.5 * t);  // 1 - cos t = 2 s^2 without cancellation
  return Eigen::Matrix3d::Identity() + 2.0 * s * s / t2 * k + (t - std::sin(t)) / (t2 * t) * k * k;
}

Eigen::Matrix3d LeftJacobianInverseSO3(const Eigen::Vector3d& w) {
  const double t2 = w.squaredNorm();
  const Eigen::Matrix3d k = Skew(w);
  if (t2 < 1e-10) return Eigen::Matrix3d::Identity() - 0.5 * k + k * k / 12.0;
  const double t = std::sqrt(t2);
  const double c = 1.0 / t2 - 1.0 / (2.0 * t * std::tan(0.5 * t));
  return Eigen::Matrix3d::Identity() - 0.5 * k + c * k * k;
}

double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return LogSO3(a.conjugate() * b).norm();
}

}  // namespace trigpoint
