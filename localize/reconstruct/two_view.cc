#include "localize/reconstruct/two_view.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "calib/base/median.h"
#include "calib/estimation/ransac.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/minimal_solvers.h"

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

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

// The tangent that takes the prior to the pose, to first order: rotation, direction of translation along the rows of
// the prior's TangentBasis, which its covariance is of. `by_pose`: its derivative by the tangent of Moved. The pose's
// basis is another one, even near the prior, where the smallest component changes; directions are carried over along
// the arc between the two, so that a prior has the same weight at any distance.
Vector5d FromPrior(const Rigid3d& pose, const Rigid3d& prior, Matrix5d* by_pose = nullptr) {
  Vector5d d = Vector5d::Zero();
  d.head<3>() = LogSO3(pose.rotation * prior.rotation.conjugate());
  if (by_pose != nullptr) by_pose->setIdentity();
  if (prior.translation.norm() > 1e-6) {
    const Eigen::Vector3d to = pose.translation.normalized(), from = prior.translation.normalized();
    const Eigen::Matrix<double, 2, 3> basis = TangentBasis(from);
    d.tail<2>() = basis * to;
    if (by_pose != nullptr) {
      by_pose->bottomRightCorner<2, 2>() =
          basis * Eigen::Quaterniond::FromTwoVectors(to, from).toRotationMatrix() * TangentBasis(to).transpose();
    }
  }
  return d;
}

// Least sum of squared epipolar errors, robust, and of the distance from the prior. The kernel is `widest` sigmas wide
// at first, so that a poor start is pulled in.
Rigid3d Refine(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b, const Rigid3d& prior,
               const Matrix5d& prior_information, const Rigid3d& start, double sigma, double widest, int iterations) {
  Rigid3d pose = start;
  for (int it = 0; it < iterations; ++it) {
    Eigen::Matrix<double, 5, 5> h = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> g = Eigen::Matrix<double, 5, 1>::Zero();
    constexpr double kEps = 1e-6;
    std::array<Rigid3d, 5> moved;
    for (int k = 0; k < 5; ++k)
      moved[static_cast<size_t>(k)] = Moved(pose, kEps * Eigen::Matrix<double, 5, 1>::Unit(k));
    const double knee = sigma * std::max(1.0, widest * std::pow(0.5, it));
    for (size_t i = 0; i < a.size(); ++i) {
      const double e = EpipolarError(pose, a[i], b[i]);
      const double weight = 1 / ((1 + e * e / (knee * knee)) * sigma * sigma);
      Eigen::Matrix<double, 5, 1> j;
      for (int k = 0; k < 5; ++k) j(k) = (EpipolarError(moved[static_cast<size_t>(k)], a[i], b[i]) - e) / kEps;
      h.noalias() += weight * j * j.transpose();
      g += weight * e * j;
    }
    Matrix5d by_pose;
    const Vector5d from_prior = FromPrior(pose, prior, &by_pose);
    h += by_pose.transpose() * prior_information * by_pose;
    g += by_pose.transpose() * prior_information * from_prior;
    const Eigen::Matrix<double, 5, 1> step = -h.ldlt().solve(g);
    if (!step.allFinite()) break;
    pose = Moved(pose, step);
    if (knee <= sigma && step.norm() < 1e-7) break;
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

Matrix5d PriorInformation(double sigma_rotation, double sigma_direction) {
  Vector5d w;
  w << Eigen::Vector3d::Constant(std::pow(sigma_rotation, -2)),
      Eigen::Vector2d::Constant(std::pow(sigma_direction, -2));
  return w.asDiagonal();
}

// Whether the rays meet in front of both views.
bool MeetInFront(const Rigid3d& b_from_a, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d ra = b_from_a.rotation * a;
  const double c = ra.dot(b), ta = ra.dot(b_from_a.translation), tb = b.dot(b_from_a.translation);
  // Nearly parallel rays meet far away, wherever their noise puts it.
  if (1 - c * c < 1e-6) return c > 0;
  return c * tb - ta > 0 && tb - c * ta > 0;
}

// Truncated squared errors and the distance from the prior: the less, the better.
double Cost(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b, const Rigid3d& pose,
            const Rigid3d& prior, const Matrix5d& prior_information, double inlier_rad) {
  constexpr double kThreshold = 4;  // sigmas of an inlier at most
  double cost = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double e = kThreshold * EpipolarError(pose, a[i], b[i]) / inlier_rad;
    cost += MeetInFront(pose, a[i], b[i]) ? std::min(e * e, kThreshold * kThreshold) : kThreshold * kThreshold;
  }
  const Vector5d d = FromPrior(pose, prior);
  return cost + d.dot(prior_information * d);
}

// Information of the relative pose from its inliers, with the noise that they show (median of absolute errors).
Matrix5d EdgeInformation(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                         const Rigid3d& pose, const std::vector<int>& inliers, double least_sigma) {
  constexpr double kEps = 1e-6;
  std::vector<double> errors;
  Matrix5d h = Matrix5d::Zero();
  for (int k : inliers) {
    const auto i = static_cast<size_t>(k);
    const double e = EpipolarError(pose, a[i], b[i]);
    errors.push_back(std::abs(e));
    Eigen::Matrix<double, 5, 1> j;
    for (int c = 0; c < 5; ++c) {
      j(c) = (EpipolarError(Moved(pose, kEps * Eigen::Matrix<double, 5, 1>::Unit(c)), a[i], b[i]) - e) / kEps;
    }
    h.noalias() += j * j.transpose();
  }
  const double sigma = std::max(least_sigma, 1.4826 * Median(std::move(errors)));
  return h / (sigma * sigma);
}

// log10 of how many models with `inliers` of `matches` within the threshold are expected where all matches are random
// (a-contrario RANSAC; Moisan & Stival 2004): `chance` is the probability that a random match is within it.
double Log10FalseAlarms(int matches, int inliers, double chance) {
  constexpr int kSample = 5;
  if (inliers <= kSample) return 0;
  const auto log_choose = [](double n, double k) {
    return std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
  };
  const double models = 10;  // of a sample, at most
  return (std::log(models * (matches - kSample)) + log_choose(matches, inliers) + log_choose(inliers, kSample) +
          (inliers - kSample) * std::log(std::min(chance, 1.0))) /
         std::log(10.0);
}

// Whether a rotation alone explains the inliers: then the direction of translation is noise.
bool RotationExplains(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                      const std::vector<int>& inliers, double threshold) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int k : inliers) sum += b[static_cast<size_t>(k)] * a[static_cast<size_t>(k)].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  const Eigen::Matrix3d rotation = u * svd.matrixV().transpose();
  size_t close = 0;
  for (int k : inliers) {
    close += (rotation * a[static_cast<size_t>(k)] - b[static_cast<size_t>(k)]).norm() < threshold ? 1 : 0;
  }
  return 10 * close > 8 * inliers.size();
}

RansacOptions FivePointRansac(const WideBaselineOptions& options) {
  RansacOptions ransac;
  ransac.max_iterations = options.ransac_iterations;
  ransac.confidence = 0.999;
  ransac.threshold = options.inlier_rad;
  ransac.seed = options.seed;
  return ransac;
}

// What the matches say of a pose: whether it is verified, and how well it is known then.
WideBaselineResult Verified(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                            const Rigid3d& pose, const WideBaselineOptions& options) {
  WideBaselineResult result;
  result.b_from_a = pose;
  result.inliers = EpipolarInliers(a, b, pose, options.inlier_rad);
  const int inliers = static_cast<int>(result.inliers.size());
  result.log10_false_alarms =
      Log10FalseAlarms(static_cast<int>(a.size()), inliers, 2 * options.inlier_rad / options.span_rad);
  result.verified = inliers >= kLeastMatches && result.log10_false_alarms < std::log10(options.max_false_alarms);
  if (!result.verified) return result;
  result.rotation_only = RotationExplains(a, b, result.inliers, 2 * options.inlier_rad);
  result.information = EdgeInformation(a, b, pose, result.inliers, 0.5 * options.inlier_rad);
  return result;
}

}  // namespace

std::vector<int> EpipolarInliers(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                                 const Rigid3d& b_from_a, double inlier_rad) {
  std::vector<int> inliers = Inliers(a, b, b_from_a, inlier_rad);
  std::erase_if(inliers,
                [&](int k) { return !MeetInFront(b_from_a, a[static_cast<size_t>(k)], b[static_cast<size_t>(k)]); });
  return inliers;
}

WideBaselineResult VerifyWideBaseline(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                                      const Rigid3d& prior, const WideBaselineOptions& options) {
  const int n = static_cast<int>(a.size());
  if (n < kLeastMatches) return {};
  Rigid3d first = prior;
  first.translation = prior.translation.norm() > 1e-9 ? prior.translation.normalized() : Eigen::Vector3d::UnitX();
  const Matrix5d information = options.prior_covariance.ldlt().solve(Matrix5d::Identity());
  const double sigma = 0.5 * options.inlier_rad;
  const double widest =
      std::clamp(std::sqrt(options.prior_covariance.topLeftCorner<3, 3>().trace()) / sigma, 8.0, 256.0);
  // Epipolar errors do not see the sign of the translation: a start that nothing is known of may end behind the views.
  const bool known = options.prior_covariance.topLeftCorner<3, 3>().trace() < 1;  // rad^2
  std::vector<Rigid3d> guesses;
  if (known) guesses.push_back(Refine(a, b, first, information, first, sigma, widest, 20));
  // Where most matches agree with odometry there is nothing else to look for.
  if (!known || 2 * EpipolarInliers(a, b, guesses[0], options.inlier_rad).size() < a.size()) {
    const auto best = Ransac<Rigid3d, 5>(
        n, FivePointRansac(options), [&](const std::vector<int>& sample) { return FivePointPoses(a, b, sample); },
        [&](const Rigid3d& pose, int i) {
          return std::abs(EpipolarError(pose, a[static_cast<size_t>(i)], b[static_cast<size_t>(i)]));
        },
        guesses);
    if (!best.found) return {};
    guesses.push_back(Refine(a, b, first, information, best.model, sigma, 4, 20));
  }
  const auto cost = [&](const Rigid3d& pose) { return Cost(a, b, pose, first, information, options.inlier_rad); };
  const bool first_wins = guesses.size() == 2 && cost(guesses[1]) >= cost(guesses[0]);
  return Verified(a, b, first_wins ? guesses[0] : guesses.back(), options);
}

RelativePoseEstimate EstimateRelativePose(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                                          const WideBaselineOptions& options) {
  constexpr double kNearly = 1.15;  // of the least cost
  constexpr double kOtherRotation = 2 * EIGEN_PI / 180, kOtherDirection = 20 * EIGEN_PI / 180;
  RelativePoseEstimate estimate;
  const int n = static_cast<int>(a.size());
  if (n < kLeastMatches) return estimate;
  const double sigma = 0.5 * options.inlier_rad;
  const Matrix5d free = 1e-6 * Matrix5d::Identity();
  const auto found = Ransac<Rigid3d, 5>(
      n, FivePointRansac(options), [&](const std::vector<int>& sample) { return FivePointPoses(a, b, sample); },
      [&](const Rigid3d& pose, int i) {
        const auto k = static_cast<size_t>(i);
        return MeetInFront(pose, a[k], b[k]) ? std::abs(EpipolarError(pose, a[k], b[k])) : 1.0;
      });
  if (!found.found) return estimate;
  // Along each axis and both ways: a short or a planar scene has several minima.
  std::vector<Rigid3d> starts = {found.model};
  for (int k = 0; k < 3; ++k) {
    for (const double sign : {-1.0, 1.0}) starts.emplace_back(found.model.rotation, sign * Eigen::Vector3d::Unit(k));
  }
  std::vector<std::pair<double, Rigid3d>> solutions;
  for (const Rigid3d& start : starts) {
    const Rigid3d pose = Refine(a, b, start, free, start, sigma, 8, 15);
    solutions.emplace_back(Cost(a, b, pose, pose, free, options.inlier_rad), pose);
  }
  std::stable_sort(solutions.begin(), solutions.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
  const Rigid3d& pose = solutions.front().second;
  for (const auto& [cost, other] : solutions) {
    if (cost > kNearly * solutions.front().first) break;
    estimate.rotation_ambiguous |= AngleBetween(pose.rotation, other.rotation) > kOtherRotation;
    estimate.direction_ambiguous |= AngleBetween(pose.translation, other.translation) > kOtherDirection;
  }
  estimate.best = Verified(a, b, pose, options);
  return estimate;
}

TwoViewResult VerifyTwoView(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                            const Rigid3d& prior, const TwoViewOptions& options) {
  TwoViewResult result;
  result.b_from_a = prior;
  if (a.size() < 8) return result;
  result.b_from_a = Refine(a, b, prior, PriorInformation(options.sigma_rotation_rad, options.sigma_direction_rad),
                           prior, 0.5 * options.inlier_rad, 8, 12);
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
    result.b_from_a = Refine(a, b, best.model, PriorInformation(10, 10), best.model, 0.5 * options.inlier_rad, 8, 10);
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
