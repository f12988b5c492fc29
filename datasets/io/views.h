// Rectilinear views of equirectangular panoramas (docs/method.md section 3).
#pragma once

#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/base/option.h"
#include "calib/camera/rig.h"

namespace trigpoint {

struct ViewOptions {
  int count = 8;         // views around, evenly spaced, the first along the image centre
  double fov_deg = 90;   // horizontal field of view of each
  double pitch_deg = 0;  // of all views, up positive
  int size_px = 0;       // width and height; 0: about the panorama's own resolution, at most 1024

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.count, {"count", "", 1, 36, "views around a panorama"});
    visit(self.fov_deg, {"fov_deg", "deg", 20, 120, "horizontal field of view of a view"});
    visit(self.pitch_deg, {"pitch_deg", "deg", -60, 60, "pitch of all views, up positive"});
    visit(self.size_px,
          {"size_px", "px", 0, 4096, "width and height of a view; 0: the panorama's resolution, <= 1024"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// The views of a panorama of the given size. Rig frame: the panorama's (z at the image centre, x right, y down).
// View k looks 360 deg * k / count to the right of the centre; perfect pinholes that share one centre.
ViewRig PanoramaViews(const std::string& name, int pano_width, const ViewOptions& options);

// Width and height of a view in which the panorama's centre keeps its resolution.
int FullSizeOfView(int pano_width, const ViewOptions& options);

// Draws the views of a rig from panoramas of one size: where a view's pixels lie is worked out once. Thread safe.
class ViewRenderer {
 public:
  ViewRenderer(ViewRig rig, cv::Size panorama);

  // A panorama as Render takes it: averaged down where it is much finer than the views, its seam closed.
  cv::Mat Prepare(const cv::Mat& panorama) const;
  // The picture of one view, 8-bit grey in, 8-bit grey out. The seam is interpolated across.
  cv::Mat Render(const cv::Mat& prepared, size_t view) const;

  const ViewRig& rig() const { return rig_; }
  cv::Size panorama() const { return panorama_; }
  // Whether these are its views and that the size of its panoramas.
  bool Draws(const ViewRig& rig, cv::Size panorama) const;

 private:
  // Fixed-point coordinates in a prepared panorama, as cv::convertMaps makes them.
  struct Map {
    std::once_flag made;
    cv::Mat whole, fraction;
  };
  void MakeMap(const View& view, Map* map) const;

  ViewRig rig_;
  cv::Size panorama_, reduced_;
  mutable std::vector<Map> maps_;
};

// The renderer of the last size of panorama: a site's are mostly of one size. Thread safe.
class RendererOfSize {
 public:
  std::shared_ptr<const ViewRenderer> Get(const ViewRig& rig, cv::Size panorama);

 private:
  std::mutex mutex_;
  std::shared_ptr<const ViewRenderer> last_;
};

// The picture of a single view.
cv::Mat RenderView(const cv::Mat& panorama, const View& view);

}  // namespace trigpoint
