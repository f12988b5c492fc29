#include "localize/reconstruct/surface_warp.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

namespace trigpoint {
namespace {

constexpr double kMostStretch = 3;  // of one picture against the other
constexpr double kEdgeOn = 0.03;    // sine of the angle between a surface and the ray that sees it

// Directions across the ray to a point, which are how a surface that faces the camera lies, and of one pixel each.
struct Facing {
  Eigen::Matrix<double, 3, 2> across;
  Eigen::Matrix2d per_px;  // across * per_px: what moves the point by a pixel
};

std::optional<Facing> FacingOf(const Camera& camera, const Eigen::Vector3d& in_camera) {
  Facing f;
  f.across.col(0) = in_camera.unitOrthogonal();
  f.across.col(1) = in_camera.normalized().cross(f.across.col(0));
  Eigen::Matrix<double, 2, 3> j;
  if (!camera.Project(in_camera, &j)) return {};
  f.per_px = (j * f.across).inverse();
  return f;
}

}  // namespace

std::optional<SurfaceWarp> WarpBetween(const PlacedCamera& from, const PlacedCamera& to, const Eigen::Vector3d& point) {
  const Rigid3d &a = from.from_world, &b = to.from_world;
  const Eigen::Vector3d in_a = a * point, in_b = b * point;
  const std::optional<Facing> facing = FacingOf(from.camera, in_a);
  Eigen::Matrix<double, 2, 3> jb;
  if (!facing || !to.camera.Project(in_b, &jb)) return {};
  const Eigen::Matrix<double, 2, 3> moved = jb * (b.rotation * a.rotation.conjugate()).toRotationMatrix();
  const SurfaceWarp warp{moved * facing->across * facing->per_px, moved * in_a.normalized()};
  const double stretch = std::sqrt(std::abs(warp.facing.determinant()));
  if (!(stretch < kMostStretch && stretch > 1 / kMostStretch)) return {};
  return warp;
}

std::optional<ExpectedPlane> PlaneBetween(const PlacedCamera& from, const PlacedCamera& to,
                                          const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d in_from = from.from_world * point;
  const Eigen::Vector3d n = from.from_world.rotation * normal.normalized();
  const std::optional<Facing> facing = FacingOf(from.camera, in_from);
  const double along = n.dot(in_from.normalized());
  const auto middle = from.camera.Project(in_from), shown_middle = to.camera.Project(to.from_world * point);
  if (!facing || !middle || !shown_middle || !(std::abs(along) > kEdgeOn)) return {};
  const Rigid3d to_from_from = to.from_world * from.from_world.Inverse();
  const double distance = n.dot(in_from);
  const auto shown = [=, &from, &to](const Eigen::Vector2d& px) -> Eigen::Vector2d {
    const Eigen::Vector2d nowhere = Eigen::Vector2d::Constant(std::nan(""));
    const auto ray = from.camera.Unproject(*middle + px);
    if (!ray || !(distance / n.dot(*ray) > 0)) return nowhere;
    const auto pixel = to.camera.Project(to_from_from * Eigen::Vector3d(distance / n.dot(*ray) * *ray));
    return pixel ? Eigen::Vector2d(*pixel - *shown_middle) : nowhere;
  };
  return ExpectedPlane{-(facing->across * facing->per_px).transpose() * n / along, shown};
}

}  // namespace trigpoint
