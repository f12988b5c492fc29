// What tests of runs past surveyed tags share.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "calib/camera/camera.h"
#include "calib/estimation/random.h"
#include "localize/georegistration/world_fit.h"

namespace trigpoint::test {

inline Eigen::Vector3d Normal3(Random* random, double sigma) {
  return {sigma * random->Normal(), sigma * random->Normal(), sigma * random->Normal()};
}

// x forward, y left, z up seen by a camera that looks to the left.
inline Rigid3d CamFromBody() {
  Eigen::Matrix3d r;
  r << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return {Eigen::Quaterniond(r), Eigen::Vector3d(0.1, 0.2, 0)};
}

// How a tag left of a run stands against its bodies: x right, y down, z into the tag, seen from the run.
inline Eigen::Quaterniond FacingTheRun() {
  Eigen::Matrix3d facing;
  facing << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return Eigen::Quaterniond(facing);
}

// Tag `id`, half a metre wide, as the images of the `poses` poses that are near pose `at` show it.
template <typename Truth>
WorldTag SightedTag(int id, const Rigid3d& world_from_tag, int at, int poses, double sigma_px,
                    const Truth& world_from_body, Random* random) {
  const Camera camera = Camera::FromFieldOfView(900, 700, 1.5);
  WorldTag tag;
  tag.id = id;
  const double h = 0.25;
  tag.corners = {Eigen::Vector3d(-h, h, 0), Eigen::Vector3d(h, h, 0), Eigen::Vector3d(h, -h, 0),
                 Eigen::Vector3d(-h, -h, 0)};
  for (int i = std::max(0, at - 2); i <= std::min(poses - 1, at + 2); ++i) {
    TagSighting s;
    s.image = i;
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d p = CamFromBody() * (world_from_body(i).Inverse() * (world_from_tag * tag.corners[k]));
      const Eigen::Vector2d pixel = *camera.Project(p) + sigma_px * Eigen::Vector2d(random->Normal(), random->Normal());
      s.rays[k] = *camera.Unproject(pixel);
      s.w[k] = camera.BearingSqrtInfo(pixel, sigma_px);
    }
    tag.sightings.push_back(s);
  }
  tag.body_from_tag = world_from_body(tag.sightings.front().image).Inverse() * world_from_tag;
  return tag;
}

// Odometry's factor between the last two of `pose + 1` poses.
inline PoseFactor OdometryFactor(int pose, const Rigid3d& step, double turn_sigma_rad, double step_sigma_m) {
  PoseFactor f;
  f.kind = PoseFactor::Kind::kBetween;
  f.a = pose - 1, f.b = pose;
  f.scale = 0;
  f.measured = step;
  f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / turn_sigma_rad), Eigen::Vector3d::Constant(1 / step_sigma_m);
  return f;
}

}  // namespace trigpoint::test
