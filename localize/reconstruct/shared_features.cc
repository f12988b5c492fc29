#include "localize/reconstruct/shared_features.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calib/camera/shrunk_picture.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/features.h"
#include "localize/reconstruct/two_view.h"

namespace trigpoint {
namespace {

constexpr double kContrast = 0.02;     // of shrunk pictures
constexpr double kMostDistance = 0.8;  // of unit descriptors
constexpr double kInlier_px = 1.5;     // of the shrunk picture
constexpr double kStill_px = 3;        // of it: a feature that stays where it was, its noise in both pictures included

}  // namespace

QuickFeatures FindQuickFeatures(const cv::Mat& grey, const cv::Mat& mask, const Camera& camera,
                                const SharedFeatureOptions& options) {
  const double shrink = std::min(1.0, static_cast<double>(options.side_px) / std::max(grey.cols, grey.rows));
  cv::Mat small = grey;
  if (shrink < 1) cv::resize(grey, small, {}, shrink, shrink, cv::INTER_AREA);
  FeatureOptions find;
  find.max_features = options.features;
  find.contrast_threshold = kContrast;
  const FeatureSet features = ExtractFeatures(small, ReducedMask(mask, small.size()), find);
  QuickFeatures quick;
  quick.pixel_rad = 1 / (shrink * camera.MeanFocal());
  cv::Mat kept(0, DescriptorBlock::kDim, CV_8U);
  for (size_t i = 0; i < features.points.size(); ++i) {
    const Eigen::Vector2d pixel =
        (features.points[i].cast<double>() + Eigen::Vector2d(0.5, 0.5)) / shrink - Eigen::Vector2d(0.5, 0.5);
    const auto ray = camera.Unproject(pixel);
    if (!ray) continue;
    quick.rays.push_back(ray->normalized());
    kept.push_back(features.descriptors.row(static_cast<int>(i)));
  }
  quick.descriptors = DescriptorBlock(kept);
  return quick;
}

namespace {

void AddDirection(const WideBaselineResult& found, SharedView* view) {
  constexpr double kMostSigma_rad = 0.1;  // about that up to which `reconstruct` compares directions
  const Eigen::Matrix<double, 5, 5> covariance =
      found.information.ldlt().solve(Eigen::Matrix<double, 5, 5>::Identity());
  view->sigma_direction_rad = std::sqrt(covariance.bottomRightCorner<2, 2>().trace() / 2);
  if (found.rotation_only || !(view->sigma_direction_rad < kMostSigma_rad)) return;
  view->direction = found.b_from_a.translation.normalized();
}

}  // namespace

SharedView CompareViews(const QuickFeatures& a, const QuickFeatures& b, const SharedFeatureOptions& options) {
  const Matches matches = MatchMutual(a.descriptors, b.descriptors, options.ratio, kMostDistance);
  SharedView view;
  view.matches = static_cast<int>(matches.size());
  if (view.matches < kLeastMatches) return view;
  std::vector<Eigen::Vector3d> rays_a, rays_b;
  for (const auto& [i, j] : matches) {
    rays_a.push_back(a.rays[static_cast<size_t>(i)]);
    rays_b.push_back(b.rays[static_cast<size_t>(j)]);
  }
  WideBaselineOptions verify;
  const double pixel = std::max(a.pixel_rad, b.pixel_rad);
  verify.inlier_rad = kInlier_px * pixel;
  verify.ransac_iterations = options.ransac_iterations;
  WideBaselineResult found = VerifyWideBaseline(rays_a, rays_b, {}, verify);
  // A short way with a turn has several minima, one of them behind the views.
  if (!found.verified) found = EstimateRelativePose(rays_a, rays_b, verify).best;
  if (found.verified) {
    view.features = static_cast<int>(found.inliers.size());
    view.b_from_a = found.b_from_a.rotation;
    AddDirection(found, &view);
    return view;
  }
  // A camera that stands still sees no parallax, which a relative pose needs.
  int still = 0;
  for (size_t k = 0; k < rays_a.size(); ++k) still += AngleBetween(rays_a[k], rays_b[k]) < kStill_px * pixel ? 1 : 0;
  if (still >= kLeastMatches && 2 * still >= view.matches) view.features = still;
  return view;
}

}  // namespace trigpoint
