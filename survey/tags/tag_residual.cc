#include "survey/tags/tag_residual.h"

#include <cmath>
#include <optional>

#include "calib/base/error.h"

namespace trigpoint {

TagSight MakeTagSight(const Camera& camera, const TagDetection& detection, double extra_sigma_px) {
  TagSight sight;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : detection.corners) centre += 0.25 * corner;
  for (int k = 0; k < 4; ++k) {
    const std::optional<Eigen::Vector3d> ray = camera.Unproject(detection.corners[k]);
    if (!ray) throw NumericError("tag " + std::to_string(detection.id) + ": a corner has no ray in this camera");
    sight.rays[k] = *ray;
    sight.sigma_px[k] = std::hypot(detection.corner_sigma_px[k], extra_sigma_px);
    sight.whitening[k] = camera.BearingSqrtInfo(detection.corners[k], sight.sigma_px[k]);
    const Eigen::Vector2d out = (detection.corners[k] - centre).normalized();
    if (const auto farther = camera.Unproject(detection.corners[k] + out)) {
      sight.outward.segment<2>(2 * k) = sight.whitening[k] * *farther;
    }
  }
  return sight;
}

Vector8d TagResidual(const TagSight& sight, double size_m, const Rigid3d& cam_from_body, const Rigid3d& world_from_body,
                     const Rigid3d& world_from_tag, Matrix86d* by_body, Matrix86d* by_tag) {
  const Eigen::Matrix3d cam_from_world =
      (cam_from_body.rotation * world_from_body.rotation.conjugate()).toRotationMatrix();
  Vector8d residual;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d lever = world_from_tag.rotation * TagCorner(size_m, k);
    const Eigen::Vector3d from_body = lever + world_from_tag.translation - world_from_body.translation;
    const Eigen::Vector3d p = cam_from_world * from_body + cam_from_body.translation;
    const double distance = std::max(p.norm(), 1e-12);
    const Eigen::Vector3d ray = p / distance;
    residual.segment<2>(2 * k) = sight.whitening[k] * ray;
    if (by_body == nullptr && by_tag == nullptr) continue;
    const Eigen::Matrix<double, 2, 3> by_point =
        sight.whitening[k] * (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / distance * cam_from_world;
    if (by_tag != nullptr) {
      by_tag->block<2, 3>(2 * k, 0) = -by_point * Skew(lever);
      by_tag->block<2, 3>(2 * k, 3) = by_point;
    }
    if (by_body != nullptr) {
      by_body->block<2, 3>(2 * k, 0) = by_point * Skew(from_body);
      by_body->block<2, 3>(2 * k, 3) = -by_point;
    }
  }
  return residual;
}

bool TagFaces(const TagSight& sight, double size_m, const Rigid3d& cam_from_tag) {
  for (int k = 0; k < 4; ++k) {
    if ((cam_from_tag * TagCorner(size_m, k)).dot(sight.rays[k]) <= 0) return false;
  }
  // z points into the tag, away from whoever reads it.
  return (cam_from_tag.rotation * Eigen::Vector3d::UnitZ()).dot(cam_from_tag.translation) > 0;
}

double ResidualPx(const TagSight& sight, const Vector8d& residual) {
  double sum = 0;
  for (int k = 0; k < 4; ++k) sum += residual.segment<2>(2 * k).squaredNorm() * sight.sigma_px[k] * sight.sigma_px[k];
  return std::sqrt(sum / 8);
}

}  // namespace trigpoint
