// Yards of simulated surveys: tags on the walls, cameras that look outwards on the way round.
#pragma once

#include <cmath>
#include <string>

#include "survey/network/layout.h"

namespace trigpoint {

// Tag `id` at `world`, in the direction `angle` from the yard's middle, which its printed side faces. Of three, one is
// known.
inline void AddTagOnWall(int id, double angle, const Eigen::Vector3d& world, NetworkLayout* layout) {
  const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0);
  Eigen::Matrix3d columns;
  columns.col(2) = out;
  columns.col(1) = -Eigen::Vector3d::UnitZ();
  columns.col(0) = columns.col(1).cross(columns.col(2));
  layout->world_from_tag[id] = {Eigen::Quaterniond(columns), world};
  if (id % 3 != 1) return;
  SurveyPoint point;
  point.name = std::to_string(id);
  point.tag_id = id;
  point.world_m = world;
  point.sigma_h_m = 0.01;
  point.sigma_v_m = 0.015;
  layout->points.push_back(point);
}

// Round the yard's middle by `turn` (rad), the camera looking to the right of the way.
inline PlannedPass Lap(int frames, double turn, double radius) {
  PlannedPass pass;
  pass.name = "lap";
  BodyCamera camera;
  camera.name = "cam0";
  camera.camera = Camera::FromFieldOfView(1280, 800, 90 * kDegToRad);
  Eigen::Matrix3d rows;
  rows.row(0) = Eigen::Vector3d(-1, 0, 0);
  rows.row(1) = Eigen::Vector3d(0, 0, -1);
  rows.row(2) = Eigen::Vector3d(0, -1, 0);
  camera.cam_from_body = Rigid3d(Eigen::Quaterniond(rows), Eigen::Vector3d(0.1, 0, 0));
  camera.has_extrinsics = true;
  pass.cameras.push_back(camera);
  for (int k = 0; k < frames; ++k) {
    const double a = turn * k / (frames - 1);
    const Eigen::AngleAxisd yaw(a + M_PI / 2, Eigen::Vector3d::UnitZ());
    pass.world_from_body.push_back(
        {int64_t{500'000'000} * k,
         Rigid3d(Eigen::Quaterniond(yaw), radius * Eigen::Vector3d(std::cos(a), std::sin(a), 0))});
  }
  return pass;
}

}  // namespace trigpoint
