#include "localize/two_view.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "calib/estimation/ransac.h"
#include "calib/geometry/bearing.h"
#include "localize/minimal_solvers.h"

namespace trigpoint {
namespace {

// Sine of the angle between ray b and the epipolar plane of ray a, signed.
double EpipolarError(const Rigid3d& b_from_a, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d n = b_from_a.translation.cross(b_from_a.rotation * a);
  const double length = n.norm();
  return length > 1e-12 ? b.dot(n) / length : 0.0;
}

// Left rotation (3) and direction of the translation (2) moved by delta.
Rigid3d Moved(const Rigid3d& pose, const Eigen::Matrix<double, 5, 1>& delta) {
  Rigid3d moved = pose;
  moved.rotation = ExpSO3(delta.head<3>()) * pose.rotation;
  const double length = pose.translation.norm();
  if (length > 0) {
    const Eigen::Matrix<double, 2, 3> basis = TangentBasis(pose.translation / length);
    moved.translation = (pose.translation / length + basis.transpose() * delta.tail<2>()).normalized() * length;
  }
  return moved;
}

Rigid3d Refine(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b, const Rigid3d& prior,
               const Rigid3d& start, const TwoViewOptions& options, int iterations) {
  Rigid3d pose = start;
  const double sigma = 0.5 * options.inlier_rad;
  const bool moves = prior.translation.norm() > 1e-6;
  for (int it = 0; it < iterations; ++it) {
    Eigen::Matrix<double, 5, 5> h = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> g = Eigen::Matrix<double, 5, 1>::Zero();
    constexpr double kEps = 1e-6;
    std::array<Rigid3d, 5> moved;
    for (int k = 0; k < 5; ++k)
      moved[static_cast<size_t>(k)] = Moved(pose, kEps * Eigen::Matrix<double, 5, 1>::Unit(k));
    // Annealed Cauchy: wide first, so that a poor prior is pulled in.
    const double knee = sigma * std::max(1.0, 8.0 * std::pow(0.5, it));
    for (size_t i = 0; i < a.size(); ++i) {
      const double e = EpipolarError(pose, a[i], b[i]);
      const double weight = 1 / ((1 + e * e / (knee * knee)) * sigma * sigma);
      Eigen::Matrix<double, 5, 1> j;
      for (int k = 0; k < 5; ++k) j(k) = (EpipolarError(moved[static_cast<size_t>(k)], a[i], b[i]) - e) / kEps;
      h.noalias() += weight * j * j.transpose();
      g += weight * e * j;
    }
    // The prior: rotation and direction.
    const Eigen::Vector3d dr = LogSO3(pose.rotation * prior.rotation.conjugate());
    const double wr = 1 / (options.sigma_rotation_rad * options.sigma_rotation_rad);
    h.topLeftCorner<3, 3>().diagonal().array() += wr;
    g.head<3>() += wr * dr;
    const double wd = 1 / (options.sigma_direction_rad * options.sigma_direction_rad);
    h.bottomRightCorner<2, 2>().diagonal().array() += wd;
    if (moves) {
      const Eigen::Vector3d u = pose.translation.normalized();
      g.tail<2>() -= wd * (TangentBasis(u) * prior.translation.normalized());
    }
    const Eigen::Matrix<double, 5, 1> step = -h.ldlt().solve(g);
    if (!step.allFinite()) break;
    pose = Moved(pose, step);
    if (it > 4 && step.norm() < 1e-7) break;
  }
  return pose;
}

std::vector<int> Inliers(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                         const Rigid3d& pose, double threshold) {
  std::vector<int> inliers;
  for (size_t i = 0; i < a.size(); ++i) {
    if (std::abs(EpipolarError(pose, a[i], b[i])) < threshold) inliers.push_back(static_cast<int>(i));
  }
  return inliers;
}

}  // namespace

TwoViewResult VerifyTwoView(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                            const Rigid3d& prior, const TwoViewOptions& options) {
  TwoViewResult result;
  result.b_from_a = prior;
  if (a.size() < 8) return result;
  result.b_from_a = Refine(a, b, prior, prior, options, 12);
  result.inliers = Inliers(a, b, result.b_from_a, options.inlier_rad);
  const int n = static_cast<int>(a.size());
  if (static_cast<double>(result.inliers.size()) >= options.min_prior_inliers * n) return result;

  RansacOptions ransac;
  ransac.max_iterations = options.ransac_iterations;
  ransac.threshold = options.inlier_rad;
  ransac.seed = options.seed;
  const double length = std::max(prior.translation.norm(), 1e-6);
  const auto best = Ransac<Rigid3d, 5>(
      n, ransac,
      [&](const std::vector<int>& sample) {
        std::vector<Rigid3d> poses = FivePointPoses(a, b, sample);
        for (Rigid3d& p : poses) p.translation = p.translation.normalized() * length;
        return poses;
      },
      [&](const Rigid3d& pose, int i) {
        return std::abs(EpipolarError(pose, a[static_cast<size_t>(i)], b[static_cast<size_t>(i)]));
      },
      {result.b_from_a});
  if (best.found && best.inliers.size() > result.inliers.size() + 8) {
    // The prior is contradicted by the images: it may no longer pull.
    TwoViewOptions free = options;
    free.sigma_rotation_rad = free.sigma_direction_rad = 10;
    result.b_from_a = Refine(a, b, best.model, best.model, free, 10);
    result.inliers = Inliers(a, b, result.b_from_a, options.inlier_rad);
    result.used_ransac = true;
  }
  return result;
}

std::vector<int> VerifyHomography(const std::vector<Eigen::Vector2f>& a, const std::vector<Eigen::Vector2f>& b,
                                  double threshold_px, Eigen::Matrix3d* homography) {
  std::vector<int> inliers;
  if (a.size() < 8) return inliers;
  std::vector<cv::Point2f> pa, pb;
  for (size_t i = 0; i < a.size(); ++i) {
    pa.emplace_back(a[i].x(), a[i].y());
    pb.emplace_back(b[i].x(), b[i].y());
  }
  cv::Mat mask;
  const cv::Mat h = cv::findHomography(pa, pb, cv::RANSAC, threshold_px, mask, 1000, 0.995);
  if (h.empty()) return inliers;
  for (int i = 0; i < mask.rows; ++i) {
    if (mask.at<uint8_t>(i) != 0) inliers.push_back(i);
  }
  if (homography != nullptr) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) (*homography)(r, c) = h.at<double>(r, c);
    }
  }
  return inliers;
}

}  // namespace trigpoint
