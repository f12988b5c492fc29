// Minimal solvers from OpenGV, behind plain types (its headers are slow to compile).
#pragma once

#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

// Relative poses b_from_a (unit translation) that five matched rays allow (Nister 2004), in front of both cameras.
std::vector<Rigid3d> FivePointPoses(const std::vector<Eigen::Vector3d>& rays_a,
                                    const std::vector<Eigen::Vector3d>& rays_b, const std::vector<int>& sample);

// Camera poses cam_from_world from three rays (cam) and points (world) (Kneip 2011).
std::vector<Rigid3d> ThreePointPoses(const std::vector<Eigen::Vector3d>& rays,
                                     const std::vector<Eigen::Vector3d>& points, const std::vector<int>& sample);

// Rig poses rig_from_world from three rays (view) of several views and points (world): generalised P3P.
std::vector<Rigid3d> GeneralisedThreePointPoses(const std::vector<Eigen::Vector3d>& rays,
                                                const std::vector<int>& view_of_ray,
                                                const std::vector<Rigid3d>& rig_from_view,
                                                const std::vector<Eigen::Vector3d>& points,
                                                const std::vector<int>& sample);

}  // namespace trigpoint
