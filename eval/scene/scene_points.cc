#include "eval/scene/scene_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <unordered_map>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/colmap/model.h"
#include "datasets/io/image.h"

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

// Empty: it cannot be read.
cv::Mat LoadColourIfAny(const SceneImage& image) {
  try {
    return LoadColour(*image.run, image.entry);
  } catch (const Error&) {
    return {};
  }
}

}  // namespace

std::vector<ScenePoint> ReadScenePoints(const std::filesystem::path& sparse, int run,
                                        std::vector<std::string>* images) {
  const SparseModel model = ReadColmapModel(sparse);
  std::unordered_map<uint32_t, double> focal;
  for (const auto& [id, camera] : model.cameras) focal[id] = camera.MeanFocal();
  std::unordered_map<uint32_t, Viewer> viewers;
  const size_t first = images->size();  // of this model
  std::unordered_map<uint32_t, size_t> order;
  for (const ModelImage& image : model.images) {
    order[image.id] = images->size() - first;
    images->push_back(image.name);
    viewers[image.id] = {image.cam_from_world.TargetOriginInSource(), focal[image.camera_id]};
  }
  std::vector<double> residuals;
  for (const ModelPoint& point : model.points) {
    if (std::isfinite(point.error_px)) residuals.push_back(point.error_px);
  }
  // The mean length of a residual is sqrt(pi / 2) standard deviations of an axis (Rayleigh).
  const double sigma_px = std::max(kLeastSigmaPx, Median(std::move(residuals)) / 1.2533);
  std::vector<ScenePoint> points;
  for (const ModelPoint& point : model.points) {
    if (!point.position.allFinite()) continue;
    ScenePoint& p = points.emplace_back();
    p.run = run;
    p.id = static_cast<int64_t>(point.id);
    p.position = point.position;
    p.track_length = static_cast<int>(point.track.size());
    p.sigma_m = LargestSigma(point, viewers, sigma_px);
    p.residual_px = point.error_px;
    for (const auto& [image, index] : point.track) {
      const auto at = order.find(image);
      if (at == order.end() || index >= model.images[at->second].pixels.size()) continue;
      p.image = static_cast<int>(first + at->second);
      p.pixel = model.images[at->second].pixels[index].cast<float>();
      break;
    }
  }
  return points;
}

std::vector<std::array<uint8_t, 3>> PointColoursOf(const SceneModel& model, ProgressSink& progress,
                                                   const CancelToken& cancel) {
  std::vector<std::array<uint8_t, 3>> colours(model.points.size(), {160, 160, 160});
  std::vector<std::vector<size_t>> seen(model.images.size());
  for (size_t i = 0; i < model.points.size(); ++i) {
    if (model.points[i].image >= 0) seen[static_cast<size_t>(model.points[i].image)].push_back(i);
  }
  std::vector<size_t> order(seen.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const ImageEntry &one = model.images[a].entry, &other = model.images[b].entry;
    return std::tie(one.path, one.video_frame) < std::tie(other.path, other.video_frame);
  });
  progress.Begin("colours of the points", static_cast<int64_t>(seen.size()));
  for (const size_t k : order) {
    cancel.ThrowIfCancelled();
    progress.Advance(1);
    if (seen[k].empty() || !model.images[k].run) continue;
    const cv::Mat picture = LoadColourIfAny(model.images[k]);
    for (const size_t i : seen[k]) {
      const auto row = static_cast<int>(std::lround(model.points[i].pixel.y()));
      const auto column = static_cast<int>(std::lround(model.points[i].pixel.x()));
      if (row < 0 || column < 0 || row >= picture.rows || column >= picture.cols) continue;
      const auto& bgr = picture.at<cv::Vec3b>(row, column);
      colours[i] = {bgr[2], bgr[1], bgr[0]};
    }
  }
  return colours;
}

}  // namespace trigpoint
