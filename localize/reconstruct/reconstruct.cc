#include "localize/reconstruct/reconstruct.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "calib/base/parallel.h"
#include "calib/estimation/loss.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "calib/geometry/nearest_to_rays.h"

namespace trigpoint {
namespace {

// Of the mean squared stray of stretches from odometry: well beyond chance and odometry's own small faults.
constexpr double kMostExcess = 4;

// Wrong matches can pull a point into a camera, where its direction has no derivative. No real point is as near.
constexpr double kNearest_m = 0.05;

// Raw odometry residual of factor k at the current state.
Vector6d OdometryResidual(const BundleProblem& p, const PoseFactor& f) {
  const Rigid3d predicted = p.poses[static_cast<size_t>(f.a)] * p.poses[static_cast<size_t>(f.b)].Inverse();
  Rigid3d measured = f.measured;
  measured.translation *= p.scales.front().value;
  return predicted.Minus(measured);
}

// Of squared residuals, without the largest 2 %: an outlier is no noise.
double TrimmedMean(std::vector<double> v) {
  if (v.empty()) return 1.0;
  std::sort(v.begin(), v.end());
  const size_t keep = v.size() - v.size() * 2 / 100;
  double sum = 0;
  for (size_t i = 0; i < keep; ++i) sum += v[i];
  // The mean of the lower 98 % of a chi-square with 1 dof is 0.884 of the whole's.
  return sum / static_cast<double>(keep) / (keep < v.size() ? 0.884 : 1.0);
}

// The steps of odometry that show its noise: those from one moment to the next. Between cameras of one moment, whose
// clocks differ by milliseconds, nothing moves.
std::vector<const PoseFactor*> StepsOf(const BundleProblem& p, const std::vector<int>& moments) {
  std::vector<const PoseFactor*> steps;
  for (const PoseFactor& f : p.factors) {
    if (moments[static_cast<size_t>(f.a)] != moments[static_cast<size_t>(f.b)]) steps.push_back(&f);
  }
  return steps;
}

// Expectation-maximisation step for the odometry's noise: sigma^2 = mean(r^2 + posterior variance of r), a factor on
// each of the six axes of the body (a robot's yaw is far noisier than its tilt, forward noisier than sideways). r^2 is
// taken from the differences of successive residuals: what they have in common over a stretch is the slow drift of
// scale and direction that images alone accumulate; it is no noise of odometry. Where poses are noisy instead of steps,
// successive residuals have opposite signs and differ by more: there the residuals themselves are taken.
Vector6d EstimateOdometryNoise(const BundleProblem& p, const std::vector<int>& moments, int threads,
                               const CancelToken& cancel) {
  const std::vector<const PoseFactor*> steps = StepsOf(p, moments);
  std::vector<int> next(p.poses.size(), -1);
  for (const PoseFactor& f : p.factors) next[static_cast<size_t>(f.a)] = f.b;
  std::vector<Matrix6d> diagonal, with_next;
  BundleCovariance(p, threads, cancel).PoseBlocks(next, &diagonal, &with_next);
  // Squares of all components, normalised.
  std::array<std::vector<double>, 6> of_differences, of_residuals;
  Vector6d last = Vector6d::Zero();
  for (const PoseFactor* step : steps) {
    const PoseFactor& f = *step;
    const size_t a = static_cast<size_t>(f.a), b = static_cast<size_t>(f.b);
    Matrix6d ja, jb;
    RelativeJacobians(p.poses[a], p.poses[b], &ja, &jb);
    const Matrix6d cross = ja * with_next[a] * jb.transpose();
    const Matrix6d posterior =
        ja * diagonal[a] * ja.transpose() + jb * diagonal[b] * jb.transpose() + cross + cross.transpose();
    const Vector6d e = OdometryResidual(p, f);
    const Vector6d normalised = f.sqrt_info.diagonal().cwiseProduct(e);
    for (int i = 0; i < 6 && step != steps.front(); ++i) {
      const double known = std::pow(f.sqrt_info(i, i), 2) * std::max(0.0, posterior(i, i));
      of_differences[static_cast<size_t>(i)].push_back(0.5 * std::pow(normalised(i) - last(i), 2) + known);
      of_residuals[static_cast<size_t>(i)].push_back(std::pow(normalised(i), 2) + known);
    }
    last = normalised;
  }
  Vector6d by_differences, by_residuals;
  for (Eigen::Index i = 0; i < 6; ++i) {
    by_differences(i) = TrimmedMean(std::move(of_differences[static_cast<size_t>(i)]));
    by_residuals(i) = TrimmedMean(std::move(of_residuals[static_cast<size_t>(i)]));
  }
  // Two standard deviations of a mean of squares.
  const double chance = 2 * std::sqrt(2.0 / (6.0 * static_cast<double>(steps.size())));
  const bool noisy_poses = by_residuals.cwiseQuotient(by_differences).mean() < 1 - chance;
  return (noisy_poses ? by_residuals : by_differences).cwiseSqrt();
}

// How far the way along the run strays from odometry's over long stretches, beyond what its noise from step to step
// allows: mean over stretches of the squared sum of forward residuals, less the scale they share, over its expectation.
// Images alone let the length of steps drift (forward motion, a distortion that isn't modelled); odometry doesn't, so
// that an excess is caused by the features.
double LongWaveExcess(const BundleProblem& p, const std::vector<int>& moments) {
  constexpr size_t kStretch = 10;
  std::vector<double> along, length, sigma;
  for (const PoseFactor* f : StepsOf(p, moments)) {
    const double way = f->measured.translation.norm();
    if (way < 1e-6) continue;
    const Eigen::Vector3d unit = f->measured.translation / way;
    along.push_back(unit.dot(OdometryResidual(p, *f).tail<3>()));
    length.push_back(way);
    sigma.push_back(1 / (f->sqrt_info.diagonal().tail<3>().cwiseProduct(unit)).norm());
  }
  double xx = 0, xy = 0;
  for (size_t i = 0; i < along.size(); ++i) {
    xx += length[i] * length[i] / (sigma[i] * sigma[i]);
    xy += length[i] * along[i] / (sigma[i] * sigma[i]);
  }
  double sum = 0;
  size_t stretches = 0;
  for (size_t first = 0; first + kStretch <= along.size(); first += kStretch, ++stretches) {
    double off = 0, variance = 0;
    for (size_t i = first; i < first + kStretch; ++i) {
      off += along[i] - xy / xx * length[i];
      variance += sigma[i] * sigma[i];
    }
    sum += off * off / variance;
  }
  return stretches >= 4 ? sum / static_cast<double>(stretches) : 0;
}

// Factors that whiten odometry with `most`, its stated noise, instead of `noise`, the estimated one, along the axes
// where the estimate may be smaller by chance. The limit is the 2.5 % quantile of a mean of chi-squares (Wilson and
// Hilferty 1931); squared differences of neighbours know as much as two thirds as many independent squares.
Vector6d FactorToStated(const Vector6d& noise, const Vector6d& most, size_t steps) {
  const double spread = 2.0 / 9 / std::max(1.0, 2.0 / 3 * static_cast<double>(steps));
  const double limit = std::pow(std::max(0.0, 1 - spread - 1.96 * std::sqrt(spread)), 3);
  const Vector6d ratio = noise.cwiseQuotient(most);
  return (ratio.array().square() > limit).select(ratio, Vector6d::Ones());
}

// By how much images contradict odometry, 1 where they do not: the larger of the mean squared odometry residual,
// whitened, and of the noise factors that the data ask for (`wanted`: times the noise of the factors), which may not
// grow. An outlier of odometry counts as kSlipped at most, so that a single one is no contradiction. Of a few steps
// some always look better than `most` along some axes; what remains along the others would look like a contradiction.
double Contradiction(const BundleProblem& p, const std::vector<const PoseFactor*>& steps, const Vector6d& wanted,
                     const Vector6d& noise, const Vector6d& most) {
  constexpr double kSlipped = 100;
  const Vector6d to_stated = FactorToStated(noise, most, steps.size());
  double sum = 0;
  for (const PoseFactor* f : steps) {
    sum += std::min(kSlipped, (f->sqrt_info * OdometryResidual(p, *f)).cwiseProduct(to_stated).squaredNorm());
  }
  return std::max(sum / (6.0 * static_cast<double>(steps.size())), wanted.cwiseProduct(to_stated).squaredNorm() / 6);
}

// Whitened squared error of an observation at a point.
double SquaredErrorAt(const Rigid3d& view_from_world, const BearingObservation& o, const Eigen::Vector3d& y) {
  const Eigen::Vector3d u = (view_from_world * y).normalized();
  return u.dot(o.ray.cast<double>()) > 0 ? (o.w.cast<double>() * u).squaredNorm()
                                         : std::numeric_limits<double>::infinity();
}

// One track's rays. A track that wrong matches have joined shows two points: the one that more of its rays meet is
// kept, the other rays do not count.
class TrackTriangulation {
 public:
  void Add(const Rigid3d& view_from_world, const BearingObservation& o) {
    poses_.push_back(view_from_world), observations_.push_back(&o), rays_.push_back(o.ray.cast<double>());
  }
  void Clear() { poses_.clear(), observations_.clear(), rays_.clear(); }

  // NaN without an answer. Rays within `chi2` of the point belong to it.
  Eigen::Vector3d Solve(double chi2) {
    Eigen::Vector3d y = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    if (rays_.size() < 2) return y;
    Eigen::Vector3d all;
    const bool solved = TriangulateRays(poses_, rays_, &all);
    if (solved && (rays_.size() == 2 || Count(all, chi2) == rays_.size())) return all;
    if (rays_.size() == 2) return y;
    Eigen::Vector3d best = all;
    size_t most = solved ? Count(all, chi2) : 0;
    // The first and every other ray, neighbours, and ends: enough to meet two that belong together.
    for (size_t step = 1; step < rays_.size(); ++step) {
      for (size_t i = 0; i + step < rays_.size(); i += std::max<size_t>(1, rays_.size() / 6)) {
        if (!TriangulateRays({poses_[i], poses_[i + step]}, {rays_[i], rays_[i + step]}, &y)) continue;
        if (const size_t count = Count(y, chi2); count > most) most = count, best = y;
      }
    }
    if (most < 2) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    std::vector<Rigid3d> poses;
    std::vector<Eigen::Vector3d> rays;
    for (size_t i = 0; i < rays_.size(); ++i) {
      if (SquaredErrorAt(poses_[i], *observations_[i], best) < chi2) {
        poses.push_back(poses_[i]), rays.push_back(rays_[i]);
      }
    }
    return TriangulateRays(poses, rays, &y) && Count(y, chi2) >= most ? y : best;
  }

 private:
  size_t Count(const Eigen::Vector3d& y, double chi2) const {
    size_t count = 0;
    for (size_t i = 0; i < rays_.size(); ++i) count += SquaredErrorAt(poses_[i], *observations_[i], y) < chi2;
    return count;
  }
  std::vector<Rigid3d> poses_;
  std::vector<const BearingObservation*> observations_;
  std::vector<Eigen::Vector3d> rays_;
};

// Points from their active observations; rays within `chi2` (2 dof) of a point belong to it.
void Triangulate(double chi2, Reconstruction* r, int threads, const CancelToken& cancel) {
  BundleProblem& p = r->problem;
  std::vector<int> first(p.points.size() + 1, 0);
  for (const BearingObservation& o : p.observations) ++first[static_cast<size_t>(o.point) + 1];
  for (size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
  ParallelFor(static_cast<int64_t>((p.points.size() + 1023) / 1024), threads, cancel, [&](int64_t block) {
    TrackTriangulation track;
    const size_t end = std::min(p.points.size(), static_cast<size_t>(block + 1) * 1024);
    for (size_t j = static_cast<size_t>(block) * 1024; j < end; ++j) {
      track.Clear();
      for (int k = first[j]; k < first[j + 1]; ++k) {
        const BearingObservation& o = p.observations[static_cast<size_t>(k)];
        if (!o.active) continue;
        track.Add(p.views[static_cast<size_t>(o.view)] * p.poses[static_cast<size_t>(o.pose)], o);
      }
      p.points[j] = track.Solve(chi2);
    }
  });
}

// Which points are fit for the bundle, and their depths. Deactivates bad observations.
void Gate(const ReconstructOptions& o, double chi2, Reconstruction* r) {
  // A single observation is judged by its own noise; the inflation is for the sum of correlated observations.
  chi2 /= r->correlation_inflation * r->correlation_inflation;
  BundleProblem& p = r->problem;
  r->point_valid.assign(p.points.size(), false);
  r->depth_m.assign(p.points.size(), 0);
  r->dropped_observations = 0;
  size_t k = 0;
  for (size_t j = 0; j < p.points.size(); ++j) {
    const size_t begin = k;
    while (k < p.observations.size() && p.observations[k].point == static_cast<int>(j)) ++k;
    bool valid = p.points[j].allFinite();
    int good = 0;
    double depth = std::numeric_limits<double>::infinity();
    std::vector<Eigen::Vector3d> directions;
    for (size_t i = begin; i < k; ++i) {
      BearingObservation& ob = p.observations[i];
      const Rigid3d view_from_world = p.views[static_cast<size_t>(ob.view)] * p.poses[static_cast<size_t>(ob.pose)];
      const Eigen::Vector3d d = p.points[j] - view_from_world.TargetOriginInSource();
      ob.active = valid && d.norm() > kNearest_m && SquaredError(p, ob) < chi2;
      if (!ob.active) continue;
      ++good;
      depth = std::min(depth, d.norm());
      directions.push_back(d.normalized());
    }
    double parallax = 0;
    for (const Eigen::Vector3d& d : directions) {
      parallax = std::max(parallax, AngleBetween(d, directions.front()));
    }
    valid = valid && good >= 2 && parallax > o.min_parallax_deg * kDegToRad && depth < o.max_depth_m;
    r->point_valid[j] = valid;
    r->depth_m[j] = depth;
    if (!valid) {
      for (size_t i = begin; i < k; ++i) p.observations[i].active = false;
    }
    for (size_t i = begin; i < k; ++i) r->dropped_observations += p.observations[i].active ? 0 : 1;
  }
}

// Points that are not valid anew from their active observations, and all where their observations want them.
void TriangulateInvalid(double chi2, Reconstruction* r, int threads, const CancelToken& cancel) {
  BundleProblem& p = r->problem;
  const std::vector<Eigen::Vector3d> before = p.points;
  Triangulate(chi2, r, threads, cancel);
  for (size_t j = 0; j < p.points.size(); ++j) {
    if (r->point_valid[j]) p.points[j] = before[j];
  }
  OptimizePoints(p, 5, threads, cancel);
}

// Triangulates anew the points that did not fit the earlier poses, from all of their observations.
void RetriangulateInvalid(double chi2, Reconstruction* r, int threads, const CancelToken& cancel) {
  for (BearingObservation& o : r->problem.observations) {
    if (!r->point_valid[static_cast<size_t>(o.point)]) o.active = true;
  }
  TriangulateInvalid(chi2, r, threads, cancel);
}

// The first poses are many sigmas of an observation off: with the final kernel correct observations would be
// rejected, and a subset that agrees by chance would be kept. Kernel and gate begin wide and shrink together.
void ApproachSolution(const ReconstructOptions& options, bool near, const BundleOptions& rough, Reconstruction* r,
                      ProgressSink& progress, const CancelToken& cancel) {
  BundleProblem& p = r->problem;
  r->point_valid.assign(p.points.size(), false);
  const std::vector<double> widths = near ? std::vector<double>{3.0} : std::vector<double>{20.0, 8.0, 3.0};
  for (const double wider : widths) {
    const double gate = wider * wider * options.outlier_chi2;
    RetriangulateInvalid(gate, r, rough.threads, cancel);
    Gate(options, gate, r);
    p.loss = MakeLoss(options.loss, wider * wider * options.loss_chi2);
    SolveBundle(p, rough, progress, cancel);
  }
  p.loss = MakeLoss(options.loss, options.loss_chi2);
}

// Variance factor of the active observations: the sum of their squared errors over the degrees of freedom, 2 for an
// observation, less 3 for a point and 6 for a pose. Robust as far as the gate has deactivated outliers.
double VarianceFactor(const BundleProblem& p) {
  double sum = 0;
  int64_t n = 0, points = 0, last = -1;
  for (const BearingObservation& o : p.observations) {
    if (!o.active) continue;
    sum += SquaredError(p, o);
    ++n;
    if (o.point != last) ++points, last = o.point;
  }
  const double dof =
      2.0 * static_cast<double>(n) - 3.0 * static_cast<double>(points) - 6.0 * static_cast<double>(p.poses.size());
  return dof > 10 ? sum / dof : 1.0;
}

// How much wider the features' noise acts than it looks. A track's errors are correlated in time (the same texture,
// seen a little differently), so that n observations know less than n independent ones. From the lag-one
// autocorrelation of the residuals along tracks, corrected for the degrees of freedom that each point takes: sqrt((1 +
// rho) / (1 - rho)), the inflation of a mean's standard deviation under first-order autoregressive noise.
double CorrelationInflation(const BundleProblem& p) {
  double product = 0, square = 0, expected = 0;
  std::vector<Eigen::Vector2d> residuals;
  size_t k = 0;
  while (k < p.observations.size()) {
    const int point = p.observations[k].point;
    residuals.clear();
    for (; k < p.observations.size() && p.observations[k].point == point; ++k) {
      const BearingObservation& o = p.observations[k];
      if (!o.active) continue;
      const Rigid3d view_from_world = p.views[static_cast<size_t>(o.view)] * p.poses[static_cast<size_t>(o.pose)];
      residuals.push_back(o.w.cast<double>() * ((view_from_world * p.points[static_cast<size_t>(point)]).normalized() -
                                                o.ray.cast<double>()));
    }
    const double n = static_cast<double>(residuals.size());
    if (n < 6) continue;
    for (size_t i = 0; i + 1 < residuals.size(); ++i) {
      product += residuals[i].dot(residuals[i + 1]);
      square += 0.5 * (residuals[i].squaredNorm() + residuals[i + 1].squaredNorm());
      // Independent noise leaves this correlation behind: a point fits about 1.5 of n values a component.
      expected -= 0.5 * (residuals[i].squaredNorm() + residuals[i + 1].squaredNorm()) * 1.5 / n;
    }
  }
  if (!(square > 0)) return 1;
  return InflationBy(std::clamp((product - expected) / square, 0.0, kMostCorrelation));
}

void ScaleObservationNoise(double factor, BundleProblem* p) {
  for (BearingObservation& o : p->observations) o.w /= static_cast<float>(factor);
}

// The observations know less than they seem to: their noise acts wider, and the loss with it.
void WidenNoise(const ReconstructOptions& options, double wider, Reconstruction* r) {
  ScaleObservationNoise(wider, &r->problem);
  r->correlation_inflation *= wider;
  r->problem.loss = MakeLoss(options.loss, options.loss_chi2 / (r->correlation_inflation * r->correlation_inflation));
}

// Widens the noise of features that stray from odometry over long stretches. Returns the factor.
double WidenByLongWave(const ReconstructOptions& options, const std::vector<int>& moments, Reconstruction* r) {
  const double excess = LongWaveExcess(r->problem, moments);
  if (!(excess > kMostExcess)) return 1;
  const double wider = std::sqrt(excess);
  WidenNoise(options, wider, r);
  return wider;
}

// The factor on odometry's noise that follows from the one its factors have. Where odometry is limited (LimitsOf), that
// is most of the noise, and the stated part cannot be told from it: it stays above a twentieth.
Vector6d NextNoiseFactor(const LocalizeInput& input, const BundleProblem& p, const std::vector<int>& moments,
                         const Vector6d& noise_factor, const Vector6d& most_noise, int threads,
                         const CancelToken& cancel) {
  const Vector6d factor = EstimateOdometryNoise(p, moments, threads, cancel);
  const double least = input.flat || input.time_resolution_s > 0 ? 0.05 : 0;
  return noise_factor.cwiseProduct(factor.cwiseMax(0.05)).cwiseMin(most_noise).cwiseMax(least);
}

// The features' noise as their residuals show it. `long_wave`: factor on it because images contradict odometry.
void EstimateSigma(const ReconstructOptions& options, double long_wave, Reconstruction* r) {
  // sigma_px is of a single observation; the weights count its inflation by correlation, too.
  const double factor = std::clamp(std::sqrt(VarianceFactor(r->problem)), 0.1, 10.0);
  const double inflation = CorrelationInflation(r->problem) * long_wave;
  ScaleObservationNoise(factor * inflation, &r->problem);
  r->sigma_px *= factor * r->correlation_inflation;
  r->correlation_inflation = inflation;
  r->problem.loss = MakeLoss(options.loss, options.loss_chi2 / (inflation * inflation));
}

}  // namespace

namespace {

// Holds the length of a run that nothing has measured, and nothing else: how far the farthest pose is from the first.
PoseFactor LengthFactor(const LocalizeInput& input) {
  PoseFactor f;
  f.kind = PoseFactor::Kind::kBetween;
  f.scale = 0;
  f.a = 0;
  double farthest = 0;
  for (size_t k = 1; k < input.odom_from_body.size(); ++k) {
    const Rigid3d first_from_k = input.odom_from_body[0].Inverse() * input.odom_from_body[k];
    if (first_from_k.translation.norm() <= farthest) continue;
    farthest = first_from_k.translation.norm();
    f.b = static_cast<int>(k);
    f.measured = first_from_k;
  }
  f.sqrt_info.setZero();
  f.sqrt_info.bottomRightCorner<1, 3>() = f.measured.translation.normalized().transpose() / (1e-3 * farthest);
  return f;
}

}  // namespace

namespace {

// 1 sigma of a step of odometry as the options state it: rotation, translation.
Vector6d StepSigma(const Rigid3d& step, const ReconstructOptions& o) {
  const double length = step.translation.norm();
  // Over more than a metre directions wander: their variance grows with the length, not their sigma.
  const double wander = o.odometry_rotation_deg_m * std::min(length, std::sqrt(length));
  const double rotation = std::hypot(o.odometry_rotation_deg, wander) * kDegToRad;
  const double translation = std::hypot(o.odometry_translation_m, o.odometry_translation_part * length);
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(rotation), Eigen::Vector3d::Constant(translation);
  return sigma;
}

// 1 sigma of what odometry of two dimensions and times that are cut off leave open of a step.
Vector6d LimitsOf(const LocalizeInput& input, size_t pose, const Rigid3d& step) {
  // Ground slopes by 3 deg (1 sigma), and 10 m farther on independently of here.
  constexpr double kSlope_rad = 3 * kDegToRad, kOtherwise_m = 10;
  const double length = step.translation.norm();
  Vector6d sigma = Vector6d::Zero();
  if (input.flat) {
    const double turned = kSlope_rad * std::sqrt(2 * (1 - std::exp(-length / kOtherwise_m)));
    sigma.head<2>().setConstant(turned);
    sigma(5) = kSlope_rad * length;
  }
  if (!(input.time_resolution_s > 0)) return sigma;
  const double step_s = 1e-9 * static_cast<double>(input.pose_stamps[pose + 1] - input.pose_stamps[pose]);
  if (step_s > 0) {
    // The difference of two times that are even within the resolution, as a share of the step.
    const double share = input.time_resolution_s / std::sqrt(6.0) / step_s;
    // About and along all axes: in a curve the step's direction changes, too.
    sigma.head<3>().array() += share * Eigen::AngleAxisd(step.rotation).angle();
    sigma.tail<3>().array() += share * length;
  }
  return sigma;
}

}  // namespace

std::vector<PoseFactor> OdometryFactors(const LocalizeInput& input, const ReconstructOptions& o,
                                        const Vector6d& noise_factor) {
  std::vector<PoseFactor> factors;
  for (size_t k = 0; k + 1 < input.odom_from_body.size(); ++k) {
    PoseFactor f;
    f.kind = PoseFactor::Kind::kBetween;
    f.a = static_cast<int>(k);
    f.b = static_cast<int>(k + 1);
    f.scale = 0;
    f.measured = input.odom_from_body[k].Inverse() * input.odom_from_body[k + 1];
    const Vector6d stated = StepSigma(f.measured, o).cwiseProduct(noise_factor);
    const Vector6d sigma = (stated.array().square() + LimitsOf(input, k, f.measured).array().square()).sqrt();
    f.sqrt_info = Matrix6d(sigma.cwiseInverse().asDiagonal());
    f.loss = std::make_shared<HuberChi2Loss>(22.5);  // 0.1 % of chi-square with 6 dof: a wheel that slips
    factors.push_back(f);
  }
  if (!input.has_odometry) factors.push_back(LengthFactor(input));
  return factors;
}

std::vector<double> RotationVariances(const std::vector<PoseFactor>& odometry, size_t poses) {
  std::vector<double> variances(poses, 0);
  for (const PoseFactor& f : odometry) {
    variances[static_cast<size_t>(f.b)] += f.sqrt_info.topLeftCorner<3, 3>().inverse().squaredNorm() / 3;
  }
  std::partial_sum(variances.begin(), variances.end(), variances.begin());
  return variances;
}

namespace {

// Images that many odometry steps contradict have errors that no residual shows: a calibration that is off, wrong
// matches that agree, panoramas that are not level. Their noise is widened until the two are consistent, so that a
// result is not worse than the odometry it was given.
void WidenUntilConsistent(const LocalizeInput& input, const ReconstructOptions& options, const BundleOptions& bundle,
                          const Vector6d& most_noise, Vector6d* noise_factor, Reconstruction* r, ProgressSink& progress,
                          const CancelToken& cancel) {
  BundleProblem& p = r->problem;
  const std::vector<int> moments = MomentsOfPoses(input);
  if (StepsOf(p, moments).size() < 4) return;
  constexpr int kRounds = 12;
  // Two standard deviations of a mean of chi-squares with 6 dof above 1.
  const double limit = 1 + 2 / std::sqrt(3.0 * static_cast<double>(StepsOf(p, moments).size()));
  for (int round = 0; round < kRounds; ++round) {
    const Vector6d wanted = EstimateOdometryNoise(p, moments, bundle.threads, cancel);
    const double contradiction = Contradiction(p, StepsOf(p, moments), wanted, *noise_factor, most_noise);
    if (contradiction < limit) return;
    const double wider = std::clamp(std::sqrt(contradiction), kLeastWidening, 3.0);
    WidenNoise(options, wider, r);
    Gate(options, options.outlier_chi2, r);
    r->summary = SolveBundle(p, bundle, progress, cancel);
    RetriangulateInvalid(4 * options.outlier_chi2, r, bundle.threads, cancel);
    Gate(options, options.outlier_chi2, r);
    *noise_factor = NextNoiseFactor(input, p, moments, *noise_factor, most_noise, bundle.threads, cancel);
    p.factors = OdometryFactors(input, options, *noise_factor);
  }
}

}  // namespace

bool TriangulateRays(const std::vector<Rigid3d>& view_from_world, const std::vector<Eigen::Vector3d>& rays,
                     Eigen::Vector3d* point) {
  NearestToRays meeting;
  for (size_t i = 0; i < rays.size(); ++i) {
    meeting.Add(view_from_world[i].TargetOriginInSource(), view_from_world[i].rotation.conjugate() * rays[i]);
  }
  const Eigen::Vector3d spread = meeting.Spread();
  if (!(spread(0) > 1e-9 * spread(2))) return false;
  *point = meeting.Point();
  if (!point->allFinite()) return false;
  // In front of at least the most of its views.
  size_t front = 0;
  for (size_t i = 0; i < rays.size(); ++i) front += (view_from_world[i] * *point).dot(rays[i]) > 0 ? 1 : 0;
  return 2 * front > rays.size();
}

std::optional<BearingObservation> ObservationOf(const LocalizeInput& input, const TrackObservation& t,
                                                double sigma_px) {
  const FrameImage& image = input.images[static_cast<size_t>(t.image)];
  const Camera& camera = input.cameras[static_cast<size_t>(image.camera)].camera;
  const Eigen::Vector2d pixel = t.pixel.cast<double>();
  const std::optional<Eigen::Vector3d> ray = camera.Unproject(pixel);
  if (!ray || !camera.Project(*ray)) return {};
  BearingObservation o;
  o.point = t.track;
  o.pose = image.pose;
  o.view = image.camera;
  o.ray = ray->cast<float>();
  o.w = camera.BearingSqrtInfo(pixel, sigma_px).cast<float>();
  return o;
}

namespace {

// About the axes of the body what the pairs of images say, along them no less than stated: pairs see no length.
Vector6d FirstNoiseFactor(const ReconstructStart& start, const ReconstructOptions& options) {
  if (!options.estimate_odometry) return Vector6d::Ones();
  Vector6d factor = Vector6d::Constant(start.odometry_noise.rotation);
  factor.tail<3>().setConstant(std::max(1.0, start.odometry_noise.translation));
  return factor;
}

// The problem that is to be solved: poses where they start, the first held, points nowhere yet.
Reconstruction Unsolved(const LocalizeInput& input, const ReconstructStart& start, int tracks,
                        std::vector<TrackObservation> track_observations, const ReconstructOptions& options) {
  Reconstruction r;
  BundleProblem& p = r.problem;
  for (const BodyCamera& c : input.cameras) p.views.push_back(c.cam_from_body);
  for (const Rigid3d& pose : start.odom_from_body) p.poses.push_back(pose.Inverse());
  p.pose_constant.assign(p.poses.size(), false);
  if (!p.pose_constant.empty()) p.pose_constant[0] = true;
  p.points.assign(static_cast<size_t>(tracks), Eigen::Vector3d::Zero());
  // With room for those of loops and references, so that a long run never holds all of them twice.
  const size_t room = track_observations.size() + track_observations.size() / 8;
  p.observations.reserve(room);
  r.image_of.reserve(room);
  r.feature_of.reserve(room);
  for (const TrackObservation& t : track_observations) {
    const std::optional<BearingObservation> o = ObservationOf(input, t, options.sigma_px);
    if (!o) continue;
    p.observations.push_back(*o);
    r.image_of.push_back(t.image);
    r.feature_of.push_back(t.feature);
  }
  r.sigma_px = options.sigma_px;
  p.loss = MakeLoss(options.loss, options.loss_chi2);
  return r;
}

}  // namespace

Reconstruction Reconstruct(const LocalizeInput& input, const ReconstructStart& start, int tracks,
                           std::vector<TrackObservation> track_observations, const ReconstructOptions& options,
                           bool paper, int threads, ProgressSink& progress, const CancelToken& cancel) {
  Reconstruction r = Unsolved(input, start, tracks, std::move(track_observations), options);
  BundleProblem& p = r.problem;
  const BundleOptions rough{.max_iterations = 12, .relative_cost_tolerance = 1e-3, .threads = threads};
  const BundleOptions near{.distance_tolerance = 0.5, .threads = threads};  // enough for estimates of noise
  const BundleOptions precise{.threads = threads};
  const std::vector<int> moments = MomentsOfPoses(input);

  Vector6d noise_factor = FirstNoiseFactor(start, options);
  // An upper limit: with a larger noise of odometry, wrong images would outweigh a measurement whose noise is stated.
  const Vector6d most_noise = noise_factor;
  p.factors = OdometryFactors(input, options, noise_factor);
  if (paper) Triangulate(400 * options.outlier_chi2, &r, threads, cancel);
  const int rounds = paper ? 1 : options.rounds;
  double long_wave = 1;  // factor on the features' noise because images contradict odometry
  double gate = paper ? 100 * options.outlier_chi2 : 13 * options.outlier_chi2;
  if (paper) {
    Gate(options, gate, &r);
    OptimizePoints(p, 10, threads, cancel);
  } else {
    ApproachSolution(options, start.near, rough, &r, progress, cancel);
  }
  for (int round = 0; round < rounds; ++round) {
    cancel.ThrowIfCancelled();
    Gate(options, gate, &r);
    r.summary = SolveBundle(p, round + 1 < rounds ? rough : near, progress, cancel);
    if (!paper) {
      RetriangulateInvalid(4 * options.outlier_chi2, &r, threads, cancel);
      gate = round == 0 ? 9 * options.outlier_chi2 : options.outlier_chi2;
      if (options.estimate_sigma) {
        Gate(options, gate, &r);
        EstimateSigma(options, long_wave, &r);
      }
      if (options.estimate_odometry && StepsOf(p, moments).size() >= 8) {
        Gate(options, gate, &r);
        noise_factor = NextNoiseFactor(input, p, moments, noise_factor, most_noise, threads, cancel);
        p.factors = OdometryFactors(input, options, noise_factor);
        if (options.estimate_sigma) long_wave *= WidenByLongWave(options, moments, &r);
      }
    }
  }
  if (!paper && options.estimate_sigma && options.estimate_odometry) {
    WidenUntilConsistent(input, options, near, most_noise, &noise_factor, &r, progress, cancel);
  }
  Gate(options, options.outlier_chi2, &r);
  if (!paper) {
    r.summary = SolveBundle(p, precise, progress, cancel);
    Gate(options, options.outlier_chi2, &r);
  }
  r.odometry_noise_factor = noise_factor;
  return r;
}

void AddObservations(const std::vector<ImageObservation>& added, Reconstruction* r) {
  std::vector<BearingObservation>& observations = r->problem.observations;
  observations.reserve(observations.size() + added.size());
  r->image_of.reserve(observations.size() + added.size());
  r->feature_of.reserve(observations.size() + added.size());
  for (const ImageObservation& row : added) {
    observations.push_back(row.o);
    r->image_of.push_back(row.image);
    r->feature_of.push_back(row.feature);
  }
  std::vector<int> place(observations.size());  // which one belongs there
  std::iota(place.begin(), place.end(), 0);
  std::stable_sort(place.begin(), place.end(), [&](int a, int b) {
    return observations[static_cast<size_t>(a)].point < observations[static_cast<size_t>(b)].point;
  });
  // In place, cycle by cycle: they are the most that a long run has in memory.
  for (size_t begin = 0; begin < place.size(); ++begin) {
    for (size_t to = begin; static_cast<size_t>(place[to]) != to;) {
      const size_t from = static_cast<size_t>(place[to]);
      place[to] = static_cast<int>(to);
      if (from == begin) break;
      std::swap(observations[to], observations[from]);
      std::swap(r->image_of[to], r->image_of[from]);
      std::swap(r->feature_of[to], r->feature_of[from]);
      to = from;
    }
  }
}

void Settle(const ReconstructOptions& options, double chi2, Reconstruction* r, int threads, const CancelToken& cancel) {
  TriangulateInvalid(chi2, r, threads, cancel);
  Gate(options, chi2, r);
}

}  // namespace trigpoint
