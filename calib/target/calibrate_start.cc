#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "calib/target/board_problem.h"

namespace trigpoint {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Focal lengths tried, as part of the picture's longer side: from fisheye to tele lens.
constexpr double kLeastFocal = 0.15, kMostFocal = 6.0;
constexpr int kFocals = 24;

// A camera without distortion and with its principal point in the middle.
Camera PlainCamera(CameraModel model, int width, int height, double focal) {
  std::vector<double> params = {focal, focal, 0.5 * (width - 1), 0.5 * (height - 1)};
  if (model == CameraModel::kKannalaBrandt) {
    params.resize(8, 0.0);
    return {model, width, height, params};
  }
  return {CameraModel::kPinhole, width, height, params};
}

}  // namespace

double BoardRms(const Camera& camera, const BoardGeometry& board, const Rigid3d& cam_from_board,
                const std::vector<BoardPoint>& points) {
  double sum = 0;
  for (const BoardPoint& point : points) {
    const auto pixel = camera.Project(cam_from_board * board.Point(point.id, Eigen::Matrix<double, 6, 1>::Zero()));
    if (!pixel) return kInfinity;
    sum += (*pixel - point.pixel).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

std::vector<Rigid3d> BoardPoses(const Camera& camera, const BoardGeometry& board,
                                const std::vector<BoardPoint>& points) {
  // Rays turned so that their mean is the axis: any central camera, beyond 180 degrees too.
  std::vector<Eigen::Vector3d> rays;
  std::vector<cv::Point3d> places;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const Eigen::Vector3d middle = board.Middle();  // IPPE wants the board about its origin
  for (const BoardPoint& point : points) {
    const auto ray = camera.Unproject(point.pixel);
    if (!ray) continue;
    rays.push_back(*ray);
    mean += *ray;
    const Eigen::Vector3d p = board.Point(point.id, Eigen::Matrix<double, 6, 1>::Zero()) - middle;
    places.emplace_back(p.x(), p.y(), 0);
  }
  if (rays.size() < 4 || mean.norm() < 1e-6) return {};
  const Eigen::Quaterniond turned_from_cam = Eigen::Quaterniond::FromTwoVectors(mean, Eigen::Vector3d::UnitZ());
  std::vector<cv::Point2d> seen;
  std::vector<cv::Point3d> used;
  for (size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d ray = turned_from_cam * rays[i];
    if (ray.z() < 0.05) continue;
    seen.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
    used.push_back(places[i]);
  }
  if (seen.size() < 4) return {};
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(used, seen, cv::Matx33d::eye(), cv::noArray(), rotations, translations, false,
                        cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {  // degenerate points
    return {};
  }
  std::vector<std::pair<double, Rigid3d>> poses;
  for (size_t i = 0; i < rotations.size(); ++i) {
    cv::Matx33d r;
    cv::Rodrigues(rotations[i], r);
    const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.val);
    Eigen::Vector3d translation(translations[i].at<double>(0), translations[i].at<double>(1),
                                translations[i].at<double>(2));
    translation -= rotation * middle;
    const Rigid3d pose = Rigid3d(turned_from_cam.conjugate(), Eigen::Vector3d::Zero()) *
                         Rigid3d(Eigen::Quaterniond(rotation), translation);
    if (pose.IsFinite()) poses.emplace_back(BoardRms(camera, board, pose, points), pose);
  }
  std::stable_sort(poses.begin(), poses.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Rigid3d> sorted;
  for (const auto& [rms, pose] : poses) sorted.push_back(pose);
  return sorted;
}

CameraStart StartCamera(const CalibrationInput& input, int camera, CameraModel model, const BoardGeometry& board) {
  const auto& size = input.cameras[static_cast<size_t>(camera)];
  const double longer = std::max(size.width, size.height);
  const double cap = 0.02 * longer;  // px; a view that fits worse says no more
  CameraStart best;
  double least = kInfinity;
  for (int i = 0; i < kFocals; ++i) {
    CameraStart start;
    const double focal =
        longer * kLeastFocal * std::pow(kMostFocal / kLeastFocal, static_cast<double>(i) / (kFocals - 1));
    start.camera = PlainCamera(model, size.width, size.height, focal);
    double sum = 0;
    for (size_t v = 0; v < input.views.size(); ++v) {
      const CalibrationView& view = input.views[v];
      if (view.camera != camera) continue;
      const std::vector<Rigid3d> poses = BoardPoses(start.camera, board, view.points);
      const double rms = poses.empty() ? kInfinity : BoardRms(start.camera, board, poses.front(), view.points);
      sum += std::min(rms, cap);
      if (!poses.empty() && std::isfinite(rms)) start.cam_from_board.emplace_back(static_cast<int>(v), poses.front());
    }
    if (sum < least) {
      least = sum;
      best = std::move(start);
    }
  }
  return best;
}

}  // namespace trigpoint
