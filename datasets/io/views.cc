#include "datasets/io/views.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/geo/geodetic.h"

namespace trigpoint {

int FullSizeOfView(int pano_width, const ViewOptions& options) {
  const double focal = pano_width / (2 * std::numbers::pi);
  return static_cast<int>(std::lround(2 * focal * std::tan(0.5 * options.fov_deg * kDegToRad) / 8)) * 8;
}

ViewRig PanoramaViews(const std::string& name, int pano_width, const ViewOptions& options) {
  ViewRig rig;
  rig.name = name;
  const double fov = options.fov_deg * kDegToRad;
  const int size = options.size_px > 0 ? options.size_px : std::min(1024, FullSizeOfView(pano_width, options));
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

ViewRenderer::ViewRenderer(ViewRig rig, cv::Size panorama)
    : rig_(std::move(rig)), panorama_(panorama), reduced_(panorama), maps_(rig_.views.size()) {
  // Much finer panoramas are averaged down first: plain interpolation would alias.
  double finest = 0;
  for (const View& view : rig_.views) finest = std::max(finest, view.camera.MeanFocal());
  const double ratio = panorama.width / (2 * std::numbers::pi) / finest;
  if (ratio > 1.6) {
    const double f = 1.3 / ratio;
    reduced_ =
        cv::Size(static_cast<int>(std::lround(panorama.width * f)), static_cast<int>(std::lround(panorama.height * f)));
  }
}

bool ViewRenderer::Draws(const ViewRig& rig, cv::Size panorama) const {
  const auto same = [](const View& a, const View& b) {
    return a.camera.params() == b.camera.params() && a.camera.width() == b.camera.width() &&
           a.camera.height() == b.camera.height() && a.rig_from_view.rotation.isApprox(b.rig_from_view.rotation, 1e-12);
  };
  return panorama == panorama_ &&
         std::equal(rig.views.begin(), rig.views.end(), rig_.views.begin(), rig_.views.end(), same);
}

cv::Mat ViewRenderer::Prepare(const cv::Mat& panorama) const {
  cv::Mat source = panorama;
  if (reduced_ != panorama_) cv::resize(panorama, source, reduced_, 0, 0, cv::INTER_AREA);
  // The left and right edges meet; top and bottom are the poles and meet nothing.
  cv::Mat closed;
  cv::copyMakeBorder(source, closed, 0, 0, 1, 1, cv::BORDER_WRAP);
  return closed;
}

void ViewRenderer::MakeMap(const View& view, Map* map) const {
  const Camera& camera = view.camera;
  const Eigen::Matrix3d r = view.rig_from_view.rotation.toRotationMatrix();
  cv::Mat map_x(camera.height(), camera.width(), CV_32F), map_y(camera.height(), camera.width(), CV_32F);
  const double f = camera.params()[0], cx = camera.params()[2], cy = camera.params()[3];
  for (int v = 0; v < camera.height(); ++v) {
    float* x = map_x.ptr<float>(v);
    float* y = map_y.ptr<float>(v);
    for (int u = 0; u < camera.width(); ++u) {
      const Eigen::Vector3d d = r * Eigen::Vector3d((u - cx) / f, (v - cy) / f, 1);
      const double lon = std::atan2(d.x(), d.z()), lat = std::atan2(-d.y(), std::hypot(d.x(), d.z()));
      x[u] = static_cast<float>((lon / (2 * std::numbers::pi) + 0.5) * reduced_.width + 0.5);
      y[u] = static_cast<float>((0.5 - lat / std::numbers::pi) * reduced_.height - 0.5);
    }
  }
  cv::convertMaps(map_x, map_y, map->whole, map->fraction, CV_16SC2);
}

cv::Mat ViewRenderer::Render(const cv::Mat& prepared, size_t view) const {
  Map& map = maps_[view];
  std::call_once(map.made, [&] { MakeMap(rig_.views[view], &map); });
  cv::Mat out;
  cv::remap(prepared, out, map.whole, map.fraction, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

std::shared_ptr<const ViewRenderer> RendererOfSize::Get(const ViewRig& rig, cv::Size panorama) {
  const std::lock_guard lock(mutex_);
  if (!last_ || !last_->Draws(rig, panorama)) last_ = std::make_shared<ViewRenderer>(rig, panorama);
  return last_;
}

cv::Mat RenderView(const cv::Mat& panorama, const View& view) {
  ViewRig rig;
  rig.views.push_back(view);
  const ViewRenderer renderer(rig, panorama.size());
  return renderer.Render(renderer.Prepare(panorama), 0);
}

}  // namespace trigpoint
