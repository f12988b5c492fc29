#include "localize/views.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "calib/geo/geodetic.h"

namespace trigpoint {

ViewRig PanoramaViews(const std::string& name, int pano_width, const ViewOptions& options) {
  ViewRig rig;
  rig.name = name;
  const double fov = options.fov_deg * kDegToRad;
  int size = options.size_px;
  if (size == 0) {
    // The panorama's angular resolution at the view's centre.
    const double focal = pano_width / (2 * std::numbers::pi);
    size = std::min(1024, static_cast<int>(std::lround(2 * focal * std::tan(0.5 * fov) / 8)) * 8);
  }
  for (int k = 0; k < options.count; ++k) {
    View view;
    view.name = std::to_string(static_cast<int>(std::lround(360.0 * k / options.count)));
    view.camera = Camera::FromFieldOfView(size, size, fov);
    // Turning right is positive about +y (down); pitching up is positive about +x (right).
    view.rig_from_view.rotation =
        Eigen::AngleAxisd(2 * std::numbers::pi * k / options.count, Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(options.pitch_deg * kDegToRad, Eigen::Vector3d::UnitX());
    rig.views.push_back(view);
  }
  return rig;
}

cv::Mat RenderView(const cv::Mat& panorama, const View& view) {
  const Camera& camera = view.camera;
  cv::Mat source = panorama;
  // Much finer panoramas are averaged down first: plain interpolation would alias.
  const double ratio = panorama.cols / (2 * std::numbers::pi) / camera.MeanFocal();
  if (ratio > 1.6) {
    const double f = 1.3 / ratio;
    cv::resize(
        panorama, source,
        cv::Size(static_cast<int>(std::lround(panorama.cols * f)), static_cast<int>(std::lround(panorama.rows * f))), 0,
        0, cv::INTER_AREA);
  }
  // The left and right edges meet; top and bottom are the poles and meet nothing.
  cv::Mat closed;
  cv::copyMakeBorder(source, closed, 0, 0, 1, 1, cv::BORDER_WRAP);
  const Eigen::Matrix3d r = view.rig_from_view.rotation.toRotationMatrix();
  cv::Mat map_x(camera.height(), camera.width(), CV_32F), map_y(camera.height(), camera.width(), CV_32F);
  const double f = camera.params()[0], cx = camera.params()[2], cy = camera.params()[3];
  for (int v = 0; v < camera.height(); ++v) {
    float* x = map_x.ptr<float>(v);
    float* y = map_y.ptr<float>(v);
    for (int u = 0; u < camera.width(); ++u) {
      const Eigen::Vector3d d = r * Eigen::Vector3d((u - cx) / f, (v - cy) / f, 1);
      const double lon = std::atan2(d.x(), d.z()), lat = std::atan2(-d.y(), std::hypot(d.x(), d.z()));
      x[u] = static_cast<float>((lon / (2 * std::numbers::pi) + 0.5) * source.cols + 0.5);
      y[u] = static_cast<float>((0.5 - lat / std::numbers::pi) * source.rows - 0.5);
    }
  }
  cv::Mat out;
  cv::remap(closed, out, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

}  // namespace trigpoint
