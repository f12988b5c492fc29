// Boards seen by a known camera: their points, and pictures of them.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/camera/camera.h"
#include "calib/estimation/random.h"
#include "calib/target/calibrate.h"

namespace trigpoint {

// cam_from_board with the board's middle on the ray of `pixel`, tilted by `tilt` about an axis in the picture at angle
// `axis`, then turned about its normal by `spin`.
inline Rigid3d LookAtBoard(const Camera& camera, const Target& target, const Eigen::Vector2d& pixel, double distance_m,
                           double tilt, double axis, double spin) {
  const std::vector<Eigen::Vector3d> points = target.BoardPoints();
  const Eigen::Vector3d middle = 0.5 * (points.front() + points.back());
  const Eigen::Vector3d ray = camera.Unproject(pixel).value();
  const Eigen::Quaterniond facing = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray);
  const Eigen::Quaterniond rotation = facing *
                                      Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(axis), std::sin(axis), 0)) *
                                      Eigen::AngleAxisd(spin, Eigen::Vector3d::UnitZ());
  return {rotation, distance_m * ray - rotation * middle};
}

// `count` views over the whole picture, tilted up to 40 deg; points outside the picture are left out.
inline std::vector<Rigid3d> SpreadViews(const Camera& camera, const Target& target, int count, double distance_m,
                                        Random& random) {
  std::vector<Rigid3d> views;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d pixel(camera.width() * random.Uniform(0.25, 0.75),
                                camera.height() * random.Uniform(0.25, 0.75));
    views.push_back(LookAtBoard(camera, target, pixel, distance_m * random.Uniform(0.8, 1.3), random.Uniform(0.1, 0.7),
                                random.Uniform(0, 2 * std::numbers::pi), random.Uniform(-0.4, 0.4)));
  }
  return views;
}

// The points of a board at `cam_from_board`, with noise of `sigma_px` per coordinate.
inline std::vector<BoardPoint> SeePoints(const Camera& camera, const std::vector<Eigen::Vector3d>& board,
                                         const Rigid3d& cam_from_board, double sigma_px, Random& random) {
  std::vector<BoardPoint> points;
  for (size_t i = 0; i < board.size(); ++i) {
    const auto pixel = camera.Project(cam_from_board * board[i]);
    if (!pixel || !camera.Contains(*pixel)) continue;
    points.push_back({static_cast<int>(i), *pixel + sigma_px * Eigen::Vector2d(random.Normal(), random.Normal())});
  }
  return points;
}

inline CalibrationInput MakeInput(const Camera& camera, const Target& target, const std::vector<Rigid3d>& views,
                                  double sigma_px, Random& random) {
  CalibrationInput input;
  input.target = target;
  input.cameras.push_back({"cam0", camera.width(), camera.height()});
  const std::vector<Eigen::Vector3d> board = target.BoardPoints();
  for (size_t f = 0; f < views.size(); ++f) {
    input.frames.push_back("frame" + std::to_string(f));
    input.views.push_back({0, static_cast<int>(f), "image" + std::to_string(f) + ".png",
                           SeePoints(camera, board, views[f], sigma_px, random)});
  }
  return input;
}

// Picture of a flat texture: `texture` (8 bit grey) with `texels_per_m` and the board's origin at `origin` texels; what
// lies outside is light grey. A pixel is the mean of the board over its area: coarser sampling moves edges by more than
// detectors err.
inline cv::Mat RenderBoard(const Camera& camera, const Rigid3d& cam_from_board, const cv::Mat& texture,
                           double texels_per_m, const Eigen::Vector2d& origin, bool y_up) {
  constexpr int kSamples = 8;  // a side
  const Rigid3d board_from_cam = cam_from_board.Inverse();
  // Texels hit by the corners of the pixels; between them the map is as good as bilinear.
  const int stride = camera.width() + 1;
  std::vector<Eigen::Vector2d> hits(static_cast<size_t>(stride * (camera.height() + 1)), Eigen::Vector2d(-1e6, -1e6));
  for (int v = 0; v <= camera.height(); ++v) {
    for (int u = 0; u < stride; ++u) {
      const auto ray = camera.Unproject({u - 0.5, v - 0.5});
      if (!ray) continue;
      const Eigen::Vector3d direction = board_from_cam.rotation * *ray;
      const double s = -board_from_cam.translation.z() / direction.z();
      const Eigen::Vector3d hit = board_from_cam.translation + s * direction;
      if (s > 0) {
        hits[static_cast<size_t>(v * stride + u)] =
            origin + texels_per_m * Eigen::Vector2d(hit.x(), y_up ? -hit.y() : hit.y());
      }
    }
  }
  const auto value = [&](const Eigen::Vector2d& at) {
    const bool inside = at.x() >= 0 && at.y() >= 0 && at.x() < texture.cols && at.y() < texture.rows;
    return inside ? static_cast<int>(texture.at<uchar>(static_cast<int>(at.y()), static_cast<int>(at.x()))) : 200;
  };
  cv::Mat picture(camera.height(), camera.width(), CV_8U);
  for (int v = 0; v < camera.height(); ++v) {
    for (int u = 0; u < camera.width(); ++u) {
      const auto* top = &hits[static_cast<size_t>(v * stride + u)];
      const auto* bottom = top + stride;
      int sum = 0;
      for (int j = 0; j < kSamples; ++j) {
        const double b = (j + 0.5) / kSamples;
        const Eigen::Vector2d left = top[0] + b * (bottom[0] - top[0]), right = top[1] + b * (bottom[1] - top[1]);
        for (int i = 0; i < kSamples; ++i) sum += value(left + (i + 0.5) / kSamples * (right - left));
      }
      picture.at<uchar>(v, u) = cv::saturate_cast<uchar>(static_cast<double>(sum) / (kSamples * kSamples));
    }
  }
  cv::GaussianBlur(picture, picture, {0, 0}, 0.6);
  return picture;
}

}  // namespace trigpoint
