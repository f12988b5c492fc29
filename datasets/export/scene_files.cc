#include "datasets/export/scene_files.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <cstring>

#include "calib/base/error.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

template <typename T>
void Put(std::string* out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out->append(bytes, sizeof value);
}

std::string PoseText(const Rigid3d& pose) {
  const Eigen::Vector3d& t = pose.translation;
  const Eigen::Quaterniond& q = pose.rotation;
  return fmt::format("{:.9f} {:.9f} {:.9f} {:.12f} {:.12f} {:.12f} {:.12f}", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                     q.w());
}

template <typename Matrix>
std::string InformationText(const Matrix& covariance) {
  const Matrix information = covariance.inverse();
  std::string text;
  for (int i = 0; i < information.rows(); ++i) {
    for (int j = i; j < information.cols(); ++j) text += fmt::format(" {:.9g}", information(i, j));
  }
  return text;
}

// g2o's tangent: translation first, then the vector part of the quaternion (half the angle), in the measured frame b.
Matrix6d G2oCovariance(const PoseGraph::Edge& edge) {
  const Eigen::Matrix3d rt = edge.a_from_b.rotation.toRotationMatrix().transpose();
  Matrix6d j = Matrix6d::Zero();
  j.topRightCorner<3, 3>() = rt;
  j.bottomLeftCorner<3, 3>() = 0.5 * rt;
  return j * edge.covariance * j.transpose();
}

}  // namespace

void WritePly(const std::filesystem::path& file, const std::vector<PlyColumn>& columns,
              const std::vector<std::string>& comments) {
  static constexpr const char* kTypes[] = {"double", "float", "int", "uchar"};
  const size_t n = columns.empty() ? 0 : columns.front().values.size();
  std::string text = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) text += "comment " + comment + "\n";
  text += fmt::format("element vertex {}\n", n);
  for (const PlyColumn& column : columns) {
    text += fmt::format("property {} {}\n", kTypes[static_cast<size_t>(column.type)], column.name);
  }
  text += "end_header\n";
  for (size_t i = 0; i < n; ++i) {
    for (const PlyColumn& column : columns) {
      const double value = column.values.at(i);
      switch (column.type) {
        case PlyColumn::Type::kDouble: Put(&text, value); break;
        case PlyColumn::Type::kFloat: Put(&text, static_cast<float>(value)); break;
        case PlyColumn::Type::kInt: Put(&text, static_cast<int32_t>(std::lround(value))); break;
        case PlyColumn::Type::kUchar: Put(&text, static_cast<uint8_t>(std::lround(value))); break;
      }
    }
  }
  WriteFileAtomically(file, text);
}

void WriteG2oPoseGraph(const std::filesystem::path& file, const PoseGraph& graph,
                       const std::vector<std::string>& comments) {
  std::string text = CommentLines(comments);
  if (!graph.points.empty()) text += "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n";
  for (const auto& [id, pose] : graph.poses) text += fmt::format("VERTEX_SE3:QUAT {} {}\n", id, PoseText(pose));
  for (const auto& [id, p] : graph.points) {
    text += fmt::format("VERTEX_TRACKXYZ {} {:.9f} {:.9f} {:.9f}\n", id, p.x(), p.y(), p.z());
  }
  for (int id : graph.fixed) text += fmt::format("FIX {}\n", id);
  for (const PoseGraph::Edge& e : graph.edges) {
    text +=
        fmt::format("EDGE_SE3:QUAT {} {} {}{}\n", e.a, e.b, PoseText(e.a_from_b), InformationText(G2oCovariance(e)));
  }
  for (const PoseGraph::PointEdge& e : graph.point_edges) {
    text += fmt::format("EDGE_SE3_TRACKXYZ {} {} 0 {:.9f} {:.9f} {:.9f}{}\n", e.pose, e.point, e.in_pose.x(),
                        e.in_pose.y(), e.in_pose.z(), InformationText(e.covariance));
  }
  WriteFileAtomically(file, text);
}

void WriteG2oBundle(const std::filesystem::path& file, const PoseGraph& graph,
                    const std::vector<std::string>& comments) {
  std::string text = CommentLines(comments);
  for (size_t i = 0; i < graph.cameras.size(); ++i) {
    const auto& c = graph.cameras[i];
    text += fmt::format("PARAMS_CAMERAPARAMETERS {} {:.9f} {:.9f} {:.9f} 0\n", i, c[0], c[1], c[2]);
  }
  for (const auto& [id, pose] : graph.poses) text += fmt::format("VERTEX_SE3:EXPMAP {} {}\n", id, PoseText(pose));
  for (const auto& [id, p] : graph.points) {
    text += fmt::format("VERTEX_XYZ {} {:.9f} {:.9f} {:.9f}\n", id, p.x(), p.y(), p.z());
  }
  for (int id : graph.fixed) text += fmt::format("FIX {}\n", id);
  for (const PoseGraph::PixelEdge& e : graph.pixel_edges) {
    text += fmt::format("EDGE_PROJECT_XYZ2UV:EXPMAP {} {} {} {:.6f} {:.6f}{}\n", e.point, e.pose, e.camera, e.pixel.x(),
                        e.pixel.y(), InformationText(e.covariance));
  }
  WriteFileAtomically(file, text);
}

void WriteKitti(const std::filesystem::path& file, const std::vector<Rigid3d>& world_from_cam) {
  std::string text;
  for (const Rigid3d& pose : world_from_cam) {
    Eigen::Matrix<double, 3, 4> m;
    m << pose.rotation.toRotationMatrix(), pose.translation;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 4; ++j) text += fmt::format("{:.12e}{}", m(i, j), i == 2 && j == 3 ? "\n" : " ");
    }
  }
  WriteFileAtomically(file, text);
}

}  // namespace trigpoint
