// Views cut from a panorama: every pixel shows the direction that its camera says, seam and poles included.
#include "datasets/io/views.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "calib/geo/geodetic.h"

namespace trigpoint {
namespace {

// A panorama whose grey value tells the direction: 128 + 100 * (d . axis), d the unit ray of the pixel.
cv::Mat Shaded(int width, const Eigen::Vector3d& axis) {
  const Camera camera = Camera::Equirectangular(width, width / 2);
  cv::Mat panorama(width / 2, width, CV_8U);
  for (int v = 0; v < panorama.rows; ++v) {
    for (int u = 0; u < panorama.cols; ++u) {
      const Eigen::Vector3d d = camera.Unproject(Eigen::Vector2d(u, v))->normalized();
      panorama.at<uint8_t>(v, u) = static_cast<uint8_t>(std::lround(128 + 100 * d.dot(axis)));
    }
  }
  return panorama;
}

class ViewsAt : public testing::TestWithParam<double> {};

TEST_P(ViewsAt, ShowWhatLiesInTheirDirections) {
  ViewOptions options;
  options.pitch_deg = GetParam();
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1)}) {
    const cv::Mat panorama = Shaded(1024, axis);
    const ViewRig rig = PanoramaViews("pano", panorama.cols, options);
    ASSERT_EQ(rig.views.size(), 8U);
    const ViewRenderer renderer(rig, panorama.size());
    const cv::Mat prepared = renderer.Prepare(panorama);
    for (size_t k = 0; k < rig.views.size(); ++k) {
      const View& view = rig.views[k];
      const cv::Mat picture = renderer.Render(prepared, k);
      for (int v = 0; v < picture.rows; v += 7) {
        for (int u = 0; u < picture.cols; u += 7) {
          const Eigen::Vector3d d =
              view.rig_from_view.rotation * view.camera.Unproject(Eigen::Vector2d(u, v))->normalized();
          ASSERT_NEAR(picture.at<uint8_t>(v, u), 128 + 100 * d.dot(axis), 1.6)
              << view.name << " at " << u << ", " << v << ", axis " << axis.transpose();
        }
      }
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Pitches, ViewsAt, testing::Values(0.0, 30.0, 60.0, -60.0));

}  // namespace
}  // namespace trigpoint
