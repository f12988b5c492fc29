// How a piece of a surface looks from one camera, and from another.
#pragma once

#include <optional>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "localize/reconstruct/patch.h"

namespace trigpoint {

// A camera and its pose.
struct PlacedCamera {
  const Camera& camera;
  Rigid3d from_world;
};

// How the surface at a point of the world, as `from` shows it, appears to `to`. Nothing where a camera does not see the
// point, or where it appears several times larger to one than to the other.
std::optional<SurfaceWarp> WarpBetween(const PlacedCamera& from, const PlacedCamera& to, const Eigen::Vector3d& point);

// A plane through the point, as both show it. Nothing where `from` sees it edge on. The result refers to
// both cameras.
std::optional<ExpectedPlane> PlaneBetween(const PlacedCamera& from, const PlacedCamera& to,
                                          const Eigen::Vector3d& point, const Eigen::Vector3d& normal);

}  // namespace trigpoint
