#include "calib/geometry/alignment.h"

#include <Eigen/SVD>

#include "calib/base/error.h"

namespace trigpoint {

Sim3d AlignPoints(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& target,
                  AlignmentKind kind) {
  const size_t least = kind == AlignmentKind::kYawTranslation ? 2 : 3;
  if (source.size() != target.size() || source.size() < least) {
    throw NumericError("alignment needs at least " + std::to_string(least) + " pairs of points, found " +
                       std::to_string(std::min(source.size(), target.size())));
  }
  const double n = static_cast<double>(source.size());
  Eigen::Vector3d ms = Eigen::Vector3d::Zero(), mt = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < source.size(); ++i) ms += source[i], mt += target[i];
  ms /= n, mt /= n;
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  double spread = 0;
  for (size_t i = 0; i < source.size(); ++i) {
    cross += (target[i] - mt) * (source[i] - ms).transpose();
    spread += (source[i] - ms).squaredNorm();
  }
  Sim3d result;
  // Spread that rounding alone leaves of coincident points, squared.
  const double nothing = 1e-24 * n * (ms.squaredNorm() + mt.squaredNorm());
  if (kind == AlignmentKind::kYawTranslation) {
    const double yaw = std::atan2(cross(1, 0) - cross(0, 1), cross(0, 0) + cross(1, 1));
    if (!(cross.topLeftCorner<2, 2>().norm() > nothing)) throw NumericError("alignment: the points coincide");
    result.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
    if (!(svd.singularValues()(0) > nothing)) throw NumericError("alignment: the points coincide");
    Eigen::Vector3d d(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1.0 : 1.0);
    if (svd.singularValues()(1) > 1e-12 * svd.singularValues()(0)) {
      const Eigen::Matrix3d r = svd.matrixU() * d.asDiagonal() * svd.matrixV().transpose();
      result.rotation = Eigen::Quaterniond(r).normalized();
    } else {  // points on a line
      result.rotation = Eigen::Quaterniond::FromTwoVectors(svd.matrixV().col(0), svd.matrixU().col(0));
    }
    if (kind == AlignmentKind::kSim3) result.scale = svd.singularValues().dot(d) / spread;
  }
  result.translation = mt - result.scale * (result.rotation * ms);
  return result;
}

}  // namespace trigpoint
