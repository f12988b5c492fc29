// The time offset between two trajectories: EstimateTimeOffset of trajectory.h.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/base/error.h"
#include "calib/geometry/alignment.h"
#include "eval/statistics/statistics.h"
#include "eval/trajectory/trajectory.h"

namespace trigpoint {
namespace {

constexpr double kNsPerS = 1e9;

// Reference positions at the estimate's stamps moved by an offset, with the estimate's positions, fitted or as they
// are.
struct ShiftedFit {
  double rmse = 0;
  std::vector<Eigen::Vector3d> target, residual;  // reference; estimate - reference
  std::vector<Eigen::Vector3d> velocity;          // of the reference, m/s
};

class Shifter {
 public:
  Shifter(const PoseSequence& reference, const PoseSequence& estimate, bool aligned)
      : reference_(ToTrajectory(reference)), estimate_(ToTrajectory(estimate)), aligned_(aligned) {
    std::vector<double> gaps;
    for (size_t i = 1; i < reference_.poses.size(); ++i) {
      gaps.push_back(static_cast<double>(reference_.poses[i].stamp_ns - reference_.poses[i - 1].stamp_ns));
    }
    // The spacing of the reference limits the interpolation and gives the resolution of the offset.
    if (!gaps.empty()) interval_ns_ = Quantile(gaps, 0.5);
    max_gap_ns_ = static_cast<int64_t>(std::max(1.0 * kNsPerS, 3 * interval_ns_));
  }
  bool Enough() const { return reference_.poses.size() >= 3 && estimate_.poses.size() >= 3; }
  double interval_s() const { return interval_ns_ / kNsPerS; }

  // Unset if less than half of the estimate is covered.
  std::optional<ShiftedFit> At(double offset_s) const {
    const auto offset_ns = static_cast<int64_t>(std::llround(offset_s * kNsPerS));
    const auto step = static_cast<int64_t>(std::max(2e7, 0.5 * interval_ns_));
    std::vector<Eigen::Vector3d> source;
    ShiftedFit fit;
    for (const TimedPose& pose : estimate_.poses) {
      const int64_t stamp = pose.stamp_ns + offset_ns;
      const auto at = reference_.At(stamp, max_gap_ns_);
      if (!at) continue;
      source.push_back(pose.target_from_body.translation);
      fit.target.push_back(at->translation);
      const auto before = reference_.At(stamp - step, max_gap_ns_), after = reference_.At(stamp + step, max_gap_ns_);
      const double seconds = static_cast<double>((after ? step : 0) + (before ? step : 0)) / kNsPerS;
      fit.velocity.push_back(
          seconds > 0
              ? Eigen::Vector3d(((after ? *after : *at).translation - (before ? *before : *at).translation) / seconds)
              : Eigen::Vector3d(Eigen::Vector3d::Zero()));
    }
    if (source.size() < 3 || 2 * source.size() < estimate_.poses.size()) return std::nullopt;
    Sim3d target_from_source;
    if (aligned_) {
      try {
        target_from_source = AlignPoints(source, fit.target, AlignmentKind::kSE3);
      } catch (const NumericError&) {
        return std::nullopt;
      }
    }
    double sum = 0;
    for (size_t i = 0; i < source.size(); ++i) {
      fit.residual.push_back(target_from_source * source[i] - fit.target[i]);
      sum += fit.residual.back().squaredNorm();
    }
    fit.rmse = std::sqrt(sum / static_cast<double>(source.size()));
    return fit;
  }

  // Variance of the offset: r = v dt (+ t + w x p) with residuals that are independent every `tau` samples.
  double Variance(const ShiftedFit& fit) const {
    Eigen::Matrix<double, 7, 7> normal = Eigen::Matrix<double, 7, 7>::Zero();
    const auto n = static_cast<double>(fit.target.size());
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& p : fit.target) mean += p / n;
    for (size_t i = 0; i < fit.target.size(); ++i) {
      Eigen::Matrix<double, 3, 7> j;
      j << fit.velocity[i], Eigen::Matrix3d::Identity(), -Skew(fit.target[i] - mean);
      normal += j.transpose() * j;
    }
    double information = normal(0, 0);
    if (aligned_) {
      // Collinear positions leave a rotation open, which says nothing of the offset either.
      const Eigen::Matrix<double, 6, 6> rest =
          normal.bottomRightCorner<6, 6>() + 1e-9 * normal.trace() * Eigen::Matrix<double, 6, 6>::Identity();
      information -= normal.block<1, 6>(0, 1) * rest.ldlt().solve(normal.block<6, 1>(1, 0));
    }
    if (!(information > 1e-9 * normal(0, 0))) return std::numeric_limits<double>::infinity();
    return fit.rmse * fit.rmse / 3 / information * CorrelatedSamples(fit.residual);
  }

 private:
  // How many successive residuals count as one: 1 + 2 sum of autocorrelations up to the first that is negligible.
  static double CorrelatedSamples(const std::vector<Eigen::Vector3d>& r) {
    double power = 0, samples = 1;
    for (const Eigen::Vector3d& v : r) power += v.squaredNorm();
    for (size_t lag = 1; power > 0 && lag < r.size() / 3; ++lag) {
      double product = 0;
      for (size_t i = lag; i < r.size(); ++i) product += r[i].dot(r[i - lag]);
      const double correlation = product / power * static_cast<double>(r.size()) / static_cast<double>(r.size() - lag);
      if (correlation < 0.05) break;
      samples += 2 * correlation;
    }
    return std::min(samples, static_cast<double>(r.size()) / 3);
  }

  Trajectory reference_, estimate_;
  bool aligned_;
  double interval_ns_ = 0;
  int64_t max_gap_ns_ = 0;
};

}  // namespace

std::optional<ClockOffset> EstimateTimeOffset(const PoseSequence& reference, const PoseSequence& estimate,
                                              double max_offset_s, TrajectoryAlignment alignment) {
  const Shifter shifter(reference, estimate, alignment != TrajectoryAlignment::kNone);
  if (!shifter.Enough()) return std::nullopt;
  const auto before = shifter.At(0);
  if (!before) return std::nullopt;
  const auto rmse = [&](double offset_s) {
    const auto fit = shifter.At(offset_s);
    return fit ? fit->rmse : std::numeric_limits<double>::infinity();
  };
  constexpr int kSteps = 20;  // a coarse grid each side, then golden section about the best
  const double step = max_offset_s / kSteps;
  double best = 0, best_rmse = before->rmse;
  for (int i = -kSteps; i <= kSteps; ++i) {
    if (const double r = rmse(i * step); r < best_rmse) best = i * step, best_rmse = r;
  }
  double low = best - step, high = best + step;
  constexpr double kGolden = 0.6180339887498949;
  while (high - low > 1e-5) {
    const double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
    if (rmse(a) < rmse(b)) {
      high = b;
    } else {
      low = a;
    }
  }
  ClockOffset result;
  result.offset_s = 0.5 * (low + high);
  const auto after = shifter.At(result.offset_s);
  if (!after) return std::nullopt;
  result.rmse_before_m = before->rmse;
  result.rmse_after_m = after->rmse;
  result.sigma_s = std::sqrt(shifter.Variance(*after));
  if (!std::isfinite(result.sigma_s)) return std::nullopt;
  result.significant = std::abs(result.offset_s) > 3 * result.sigma_s &&
                       std::abs(result.offset_s) > 0.02 * shifter.interval_s() &&
                       result.rmse_after_m < result.rmse_before_m;
  return result;
}

}  // namespace trigpoint
