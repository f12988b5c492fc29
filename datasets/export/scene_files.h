// Writers of scenes: point clouds (PLY), graphs (g2o), trajectories (KITTI). All write atomically and throw IoError.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

// One property of every vertex.
struct PlyColumn {
  enum class Type { kDouble, kFloat, kInt, kUchar };
  std::string name;
  Type type = Type::kFloat;
  std::vector<double> values;
};

// Binary little-endian PLY with one element `vertex`. Columns must be equally long; kInt and kUchar are rounded.
void WritePly(const std::filesystem::path& file, const std::vector<PlyColumn>& columns,
              const std::vector<std::string>& comments);

// A graph in g2o's text format. Covariances are of our tangent [rotation (rad), translation (m)], left.
struct PoseGraph {
  struct Edge {
    int a = 0, b = 0;
    Rigid3d a_from_b;
    Matrix6d covariance = Matrix6d::Identity();
  };
  struct PointEdge {
    int pose = 0, point = 0;
    Eigen::Vector3d in_pose = Eigen::Vector3d::Zero();  // the point in the pose's frame, m
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  };
  struct PixelEdge {
    int pose = 0, point = 0, camera = 0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  };
  std::vector<std::pair<int, Rigid3d>> poses;           // id, world_from_x
  std::vector<std::pair<int, Eigen::Vector3d>> points;  // id, world
  std::vector<std::array<double, 3>> cameras;           // focal, cx, cy (px) of undistorted pixels
  std::vector<Edge> edges;
  std::vector<PointEdge> point_edges;
  std::vector<PixelEdge> pixel_edges;
  std::vector<int> fixed;
};

// VERTEX_SE3:QUAT, EDGE_SE3:QUAT, and for points VERTEX_TRACKXYZ, EDGE_SE3_TRACKXYZ.
void WriteG2oPoseGraph(const std::filesystem::path& file, const PoseGraph& graph,
                       const std::vector<std::string>& comments);
// VERTEX_SE3:EXPMAP, VERTEX_XYZ, EDGE_PROJECT_XYZ2UV:EXPMAP, PARAMS_CAMERAPARAMETERS.
void WriteG2oBundle(const std::filesystem::path& file, const PoseGraph& graph,
                    const std::vector<std::string>& comments);

// Twelve numbers a line: the upper 3 x 4 of world_from_cam, row by row.
void WriteKitti(const std::filesystem::path& file, const std::vector<Rigid3d>& world_from_cam);

}  // namespace trigpoint
