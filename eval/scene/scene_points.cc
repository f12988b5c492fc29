#include "eval/scene/scene_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>
#include <unordered_map>

#include "datasets/colmap/model.h"

namespace trigpoint {
namespace {

constexpr double kLeastSigmaPx = 0.1;  // of a feature, whatever few residuals say

struct Viewer {
  Eigen::Vector3d centre;
  double focal_px = 1;
};

double LargestSigma(const ModelPoint& point, const std::unordered_map<uint32_t, Viewer>& viewers, double sigma_px) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const auto& [image, index] : point.track) {
    const auto viewer = viewers.find(image);
    if (viewer == viewers.end()) continue;
    const Eigen::Vector3d ray = point.position - viewer->second.centre;
    const double across = ray.norm() * sigma_px / viewer->second.focal_px;
    if (!(across > 0)) continue;
    const Eigen::Vector3d d = ray.normalized();
    information += (Eigen::Matrix3d::Identity() - d * d.transpose()) / (across * across);
  }
  if (!information.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(information, Eigen::EigenvaluesOnly);
  const double least = solver.eigenvalues()(0), most = solver.eigenvalues()(2);
  return least > 1e-12 * most ? 1 / std::sqrt(least) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::vector<ScenePoint> ReadScenePoints(const std::filesystem::path& sparse, int run) {
  const SparseModel model = ReadColmapModel(sparse);
  std::unordered_map<uint32_t, double> focal;
  for (const auto& [id, camera] : model.cameras) focal[id] = camera.MeanFocal();
  std::unordered_map<uint32_t, Viewer> viewers;
  for (const ModelImage& image : model.images) {
    viewers[image.id] = {image.cam_from_world.TargetOriginInSource(), focal[image.camera_id]};
  }
  std::vector<double> residuals;
  for (const ModelPoint& point : model.points) {
    if (std::isfinite(point.error_px)) residuals.push_back(point.error_px);
  }
  double sigma_px = kLeastSigmaPx;
  if (!residuals.empty()) {
    const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
    std::nth_element(residuals.begin(), middle, residuals.end());
    // The mean length of a residual is sqrt(pi / 2) standard deviations of an axis (Rayleigh).
    sigma_px = std::max(sigma_px, *middle / 1.2533);
  }
  std::vector<ScenePoint> points;
  for (const ModelPoint& point : model.points) {
    if (!point.position.allFinite()) continue;
    ScenePoint& p = points.emplace_back();
    p.run = run;
    p.id = static_cast<int64_t>(point.id);
    p.position = point.position;
    p.track_length = static_cast<int>(point.track.size());
    p.sigma_m = LargestSigma(point, viewers, sigma_px);
  }
  return points;
}

}  // namespace trigpoint
