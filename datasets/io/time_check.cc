#include "datasets/io/time_check.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <vector>

#include "calib/base/median.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

using Complex = std::complex<double>;
constexpr double kStepS = 0.1;      // of the search
constexpr double kGpsWanderS = 30;  // GPS errors stay alike for half a minute at least; a short track cannot show it
constexpr int64_t kNoGap = std::numeric_limits<int64_t>::max();

int64_t ToNs(double seconds) { return std::llround(seconds * 1e9); }
double ToSeconds(int64_t ns) { return 1e-9 * static_cast<double>(ns); }

// How well the data fit under an offset: residuals in the order of time.
using Residuals = std::function<std::vector<double>(double offset_s)>;

double SumOfSquares(const std::vector<double>& r) {
  double sum = 0;
  for (double x : r) sum += x * x;
  return sum;
}

// How many neighbouring residuals say the same: 1 + 2 sum of the autocorrelation up to its first zero.
double CorrelationTime(const std::vector<double>& r) {
  const double sum = SumOfSquares(r);
  double time = 1;
  for (size_t lag = 1; sum > 0 && lag < r.size() / 4; ++lag) {
    double product = 0;
    for (size_t i = lag; i < r.size(); ++i) product += r[i] * r[i - lag];
    if (product <= 0) break;
    time += 2 * product / sum;
  }
  return time;
}

// Grid search, parabola, and the variance from the curvature. `parameters`: fitted besides the offset.
TimeOffset Minimise(const Residuals& residuals, double max_offset_s, size_t parameters, double least_correlation) {
  TimeOffset result;
  const int steps = std::max(10, static_cast<int>(std::ceil(max_offset_s / kStepS)));  // to each side
  const double step = max_offset_s / steps;
  std::vector<double> cost;
  for (int i = -steps; i <= steps; ++i) cost.push_back(SumOfSquares(residuals(i * step)));
  const auto best = static_cast<size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
  const bool at_edge = best == 0 || best + 1 == cost.size();
  // The curvature over a few steps, so that interpolation's kinks do not matter.
  const size_t reach = 3;
  const size_t middle = std::clamp(best, reach, cost.size() - 1 - reach);
  const double left = cost[middle - reach], centre = cost[middle], right = cost[middle + reach];
  const double h = step * static_cast<double>(reach);
  const double curvature = (left - 2 * centre + right) / (h * h);
  const std::vector<double> r = residuals((static_cast<double>(best) - steps) * step);
  if (r.size() < parameters + 10 || !(curvature > 0)) return result;
  result.offset_s = (static_cast<double>(best) - steps) * step;
  if (!at_edge) {
    const double a = cost[best - 1], b = cost[best], c = cost[best + 1];
    if (a - 2 * b + c > 0) result.offset_s += 0.5 * step * (a - c) / (a - 2 * b + c);
  }
  const double variance =
      SumOfSquares(r) / static_cast<double>(r.size() - parameters) * std::max(CorrelationTime(r), least_correlation);
  result.sigma_s = std::sqrt(2 * variance / curvature);
  // Nothing is seen if one standard deviation spans the search.
  result.observable = result.sigma_s < 0.5 * max_offset_s;
  return result;
}

std::string Describe(const TimeOffset& offset) {
  char text[64];
  std::snprintf(text, sizeof(text), "%+.2f s (+- %.2f s)", offset.offset_s, offset.sigma_s);
  return text;
}

void Judge(const Run& run, const TimeCheckOptions& options, const char* sensor, const char* reference, const char* key,
           double declared_s, TimeOffset* offset) {
  if (!offset->observable) return;
  const double size = std::abs(offset->offset_s);
  if (size <= options.min_report_s || size <= options.sigmas * offset->sigma_s) return;
  char advice[96];
  std::snprintf(advice, sizeof(advice), "%s: %.2f", key, declared_s + offset->offset_s);
  offset->warning = (run.dir / "run.yaml").string() + ": the " + sensor + " contradicts the declared time offset: it " +
                    "fits the " + reference + " best with " + Describe(*offset) +
                    " added to its stamps; if its clock " + "is off, set " + advice;
}

// A piece of the track: gps = a * odometry + b.
struct Segment {
  std::vector<Complex> gps;
  std::vector<int64_t> stamps;
};

// Positions of the antenna, seen in the plane the body moves in.
class PlanarOdometry {
 public:
  explicit PlanarOdometry(const Run& run) : run_(run) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const TimedPose& pose : run.odometry.poses) mean += pose.target_from_body.translation;
    mean /= static_cast<double>(run.odometry.poses.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const TimedPose& pose : run.odometry.poses) {
      const Eigen::Vector3d d = pose.target_from_body.translation - mean;
      scatter += d * d.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
    axes_ = solver.eigenvectors().rightCols<2>().transpose();
    origin_ = mean;
  }
  Complex At(int64_t stamp_ns) const {
    const Rigid3d pose = run_.odometry.At(stamp_ns, kNoGap).value();
    const Eigen::Vector2d p = axes_ * (pose * run_.config.gps_lever_arm_m - origin_);
    return {p.x(), p.y()};
  }

 private:
  const Run& run_;
  Eigen::Matrix<double, 2, 3> axes_;
  Eigen::Vector3d origin_;
};

std::vector<double> SegmentResiduals(const Segment& segment, const PlanarOdometry& odometry, double offset_s,
                                     bool reflected) {
  const size_t n = segment.gps.size();
  std::vector<Complex> x(n);
  Complex mean_x = 0, mean_y = 0;
  for (size_t i = 0; i < n; ++i) {
    x[i] = odometry.At(segment.stamps[i] + ToNs(offset_s));
    if (reflected) x[i] = std::conj(x[i]);
    mean_x += x[i] / static_cast<double>(n);
    mean_y += segment.gps[i] / static_cast<double>(n);
  }
  Complex xy = 0;
  double xx = 0;
  for (size_t i = 0; i < n; ++i) {
    xy += std::conj(x[i] - mean_x) * (segment.gps[i] - mean_y);
    xx += std::norm(x[i] - mean_x);
  }
  const Complex a = xx > 0 ? xy / xx : Complex(0);
  std::vector<double> east, north;
  for (size_t i = 0; i < n; ++i) {
    const Complex r = a * (x[i] - mean_x) - (segment.gps[i] - mean_y);
    east.push_back(r.real());
    north.push_back(r.imag());
  }
  east.insert(east.end(), north.begin(), north.end());
  return east;
}

double Duration(const Trajectory& trajectory) {
  return trajectory.poses.size() < 2 ? 0
                                     : ToSeconds(trajectory.poses.back().stamp_ns - trajectory.poses.front().stamp_ns);
}

// Speed of turning (rad/s) over time, the same for a body and a camera fixed to it. Smoothed: raw differences
// interpolated would fit best where the interpolation halves the noise, that is between the samples, and not where the
// clocks agree.
class TurnRate {
 public:
  TurnRate(const Trajectory& trajectory, double width_s) : width_s_(width_s) {
    const auto& poses = trajectory.poses;
    for (size_t i = 1; i < poses.size(); ++i) {
      const double from = ToSeconds(poses[i - 1].stamp_ns - poses.front().stamp_ns);
      const double to = ToSeconds(poses[i].stamp_ns - poses.front().stamp_ns);
      const Eigen::Vector3d turn =
          LogSO3(poses[i - 1].target_from_body.rotation.conjugate() * poses[i].target_from_body.rotation);
      samples_.push_back({0.5 * (from + to), to - from, turn});
    }
    start_ns_ = poses.front().stamp_ns;
  }
  // Weighted by a Gaussian of the width; nothing where no samples are near.
  std::optional<double> At(int64_t stamp_ns) const {
    const double t = ToSeconds(stamp_ns - start_ns_);
    auto it = std::lower_bound(samples_.begin(), samples_.end(), t - 3 * width_s_,
                               [](const Sample& sample, double at) { return sample.at < at; });
    double time = 0;
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    for (; it != samples_.end() && it->at <= t + 3 * width_s_; ++it) {
      if (it->duration > 3 * width_s_) return std::nullopt;  // a gap
      const double u = (it->at - t) / width_s_;
      const double weight = std::exp(-0.5 * u * u);
      time += weight * it->duration;
      turn += weight * it->turn;
    }
    return time > 0.5 * width_s_ ? std::optional<double>(turn.norm() / time) : std::nullopt;
  }

 private:
  struct Sample {
    double at, duration;
    Eigen::Vector3d turn;  // rotation vector in the body's (or camera's) own frame
  };
  double width_s_;
  int64_t start_ns_ = 0;
  std::vector<Sample> samples_;
};

template <typename Stamped>
double MedianStep(const std::vector<Stamped>& data) {
  std::vector<double> steps;
  for (size_t i = 1; i < data.size(); ++i) steps.push_back(ToSeconds(data[i].stamp_ns - data[i - 1].stamp_ns));
  return Median(std::move(steps));
}

}  // namespace

TimeOffset CheckGpsTime(const Run& run, const TimeCheckOptions& options) {
  const double max_offset_s = std::min(options.max_offset_s, 0.2 * Duration(run.odometry));
  if (run.gps.size() < 10 || max_offset_s <= 0) return {};
  const int64_t begin = run.odometry.poses.front().stamp_ns + ToNs(max_offset_s);
  const int64_t end = run.odometry.poses.back().stamp_ns - ToNs(max_offset_s);
  const LocalFrame frame(run.gps.front().position);
  std::vector<Segment> segments;
  int64_t segment_end = std::numeric_limits<int64_t>::min();
  for (const GpsFix& fix : run.gps) {
    if (fix.stamp_ns < begin || fix.stamp_ns > end) continue;
    if (fix.stamp_ns >= segment_end) {
      segments.emplace_back();
      segment_end = fix.stamp_ns + ToNs(options.segment_s);
    }
    const Eigen::Vector3d enu = frame.EnuFromGeodetic(fix.position);
    segments.back().gps.emplace_back(enu.x(), enu.y());
    segments.back().stamps.push_back(fix.stamp_ns);
  }
  std::erase_if(segments, [](const Segment& segment) { return segment.gps.size() < 10; });
  if (segments.empty()) return {};
  const PlanarOdometry odometry(run);
  const auto residuals = [&](double offset_s, bool reflected) {
    std::vector<double> all;
    for (const Segment& segment : segments) {
      const std::vector<double> r = SegmentResiduals(segment, odometry, offset_s, reflected);
      all.insert(all.end(), r.begin(), r.end());
    }
    return all;
  };
  // Which side of the plane is up is not known: the better one.
  const bool reflected = SumOfSquares(residuals(0, true)) < SumOfSquares(residuals(0, false));
  TimeOffset offset = Minimise([&](double offset_s) { return residuals(offset_s, reflected); }, max_offset_s,
                               4 * segments.size() + 1, kGpsWanderS / std::max(MedianStep(run.gps), 1e-3));
  Judge(run, options, "GPS", "odometry", "gps.time_offset_s", run.config.gps_time_offset_s, &offset);
  return offset;
}

TimeOffset CheckOdometryTime(const Run& run, const Trajectory& frame_from_cam, const TimeCheckOptions& options) {
  const double max_offset_s = std::min(options.max_offset_s, 0.2 * Duration(run.odometry));
  if (max_offset_s <= 0 || frame_from_cam.poses.size() < 10) return {};
  const double width_s = 1.5 * std::max({MedianStep(run.odometry.poses), MedianStep(frame_from_cam.poses), 0.1});
  const TurnRate cameras(frame_from_cam, width_s), odometry(run.odometry, width_s);
  const int64_t margin = ToNs(max_offset_s + width_s);
  const int64_t begin = std::max(run.odometry.poses.front().stamp_ns, frame_from_cam.poses.front().stamp_ns) + margin;
  const int64_t end = std::min(run.odometry.poses.back().stamp_ns, frame_from_cam.poses.back().stamp_ns) - margin;
  struct Sample {
    int64_t stamp_ns;
    double rate;
  };
  std::vector<Sample> samples;
  // Some thousand samples tell all there is.
  const int64_t step = std::max(ToNs(0.5 * width_s), (end - begin) / 5000);
  for (int64_t stamp = begin; stamp < end; stamp += step) {
    if (const auto rate = cameras.At(stamp)) samples.push_back({stamp, *rate});
  }
  const auto residuals = [&](double offset_s) {
    std::vector<double> r;
    for (const Sample& sample : samples) {
      // Adding the offset to the odometry's stamps brings what it says at t - offset to t.
      const auto rate = odometry.At(sample.stamp_ns - ToNs(offset_s));
      r.push_back(rate ? *rate - sample.rate : 0);
    }
    return r;
  };
  TimeOffset offset = Minimise(residuals, max_offset_s, 1, 1);
  // Where both are known at stops alone, what lies between two stops is interpolated: it tells no time.
  TimeCheckOptions sampled = options;
  sampled.min_report_s =
      std::max(options.min_report_s, std::min(MedianStep(run.odometry.poses), MedianStep(frame_from_cam.poses)));
  Judge(run, sampled, "odometry", "cameras", "odometry.time_offset_s", run.config.odometry_time_offset_s, &offset);
  return offset;
}

}  // namespace trigpoint
