#include "eval/trajectory/estimates.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "calib/geometry/path.h"
#include "datasets/io/yaml.h"
#include "eval/gates/intervals.h"
#include "eval/statistics/distributions.h"

namespace trigpoint {
namespace {

constexpr double kSecondNs = 1e9;

struct Pair {
  size_t row = 0;
  const ReferencePose* reference = nullptr;
  Rigid3d estimate;  // world_from_cam as the estimate has it
};

double Rmse(const std::vector<Pair>& pairs) {
  double sum = 0;
  for (const Pair& p : pairs) sum += (p.estimate.translation - p.reference->world_from_cam->translation).squaredNorm();
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

double MedianRotation(const std::vector<Pair>& pairs) {
  std::vector<double> angles;
  for (const Pair& p : pairs)
    angles.push_back(AngleBetween(p.estimate.rotation, p.reference->world_from_cam->rotation));
  return Quantile(angles, 0.5);
}

Sim3d Fit(const std::vector<Pair>& pairs, TrajectoryAlignment alignment) {
  std::vector<PosePair> poses;
  for (const Pair& p : pairs) poses.push_back({p.reference->stamp_ns, *p.reference->world_from_cam, p.estimate});
  return Align(&poses, alignment);
}

void Transform(const Sim3d& fit, std::vector<Pair>* pairs) {
  for (Pair& p : *pairs) p.estimate = fit.TransformPose(p.estimate);
}

std::vector<Pair> Fitted(std::vector<Pair> pairs, TrajectoryAlignment alignment) {
  if (alignment != TrajectoryAlignment::kNone && pairs.size() >= 3) Transform(Fit(pairs, alignment), &pairs);
  return pairs;
}

// An estimate and the reference poses of the first camera.
class PairSource {
 public:
  PairSource(const PoseSequence& estimate, const std::vector<ReferencePose>& reference,
             const std::vector<BodyCamera>& cameras, const SystemConfig& config, double max_gap_s)
      : reference_(reference),
        offset_s_(config.time_offset_s),
        gap_ns_(static_cast<int64_t>(max_gap_s * kSecondNs)),
        arm_(Eigen::Quaterniond::Identity(), -config.lever_arm_m),
        body_from_cam_(cameras.empty() ? Rigid3d() : cameras.front().cam_from_body.Inverse()) {
    if (!estimate.HasTimes()) throw InputError("its poses have no times; give TUM or EuRoC form");
    estimate_ = ToTrajectory(estimate);
    const std::string camera = cameras.empty() ? "" : cameras.front().name;
    for (size_t i = 0; i < reference.size(); ++i) {
      if (reference[i].camera == camera) rows_.push_back(i);
    }
  }
  const std::vector<size_t>& rows() const { return rows_; }  // of the reference

  // The estimate at the reference's stamps, as world_from_cam, if its poses are those of `point`.
  std::vector<Pair> Pairs(const std::string& point, double offset_s) const {
    std::vector<Pair> pairs;
    const Rigid3d point_from_cam = PointFromCam(point);
    const int64_t offset = Nanoseconds(offset_s);
    for (size_t i = 0; i < rows_.size(); ++i) {
      const ReferencePose& r = reference_[rows_[i]];
      if (!r.world_from_cam) continue;
      const auto at = estimate_.At(r.stamp_ns - offset, gap_ns_);
      if (at) pairs.push_back({i, &r, *at * point_from_cam});
    }
    return pairs;
  }

  // Camera and body differ by how they are turned, in whatever frame.
  double Turned(const std::string& point) const {
    const std::vector<Pair> pairs = Pairs(point, offset_s_);
    return std::min(MedianRotation(pairs), MedianRotation(Fitted(pairs, TrajectoryAlignment::kSE3)));
  }

  // All poses of both, not only those that pair up.
  PoseSequence Truth() const {
    PoseSequence truth;
    for (const size_t i : rows_) {
      if (!reference_[i].world_from_cam) continue;
      truth.stamps_ns.push_back(reference_[i].stamp_ns);
      truth.poses.emplace_back(*reference_[i].world_from_cam);
    }
    return truth;
  }
  PoseSequence Said(const std::string& point) const {
    PoseSequence said;
    for (const TimedPose& pose : estimate_.poses) {
      said.stamps_ns.push_back(pose.stamp_ns + Nanoseconds(offset_s_));
      said.poses.emplace_back(pose.target_from_body * PointFromCam(point));
    }
    return said;
  }

  [[noreturn]] void ThrowApartInTime() const {
    const auto seconds = [](int64_t ns) { return FormatNsAsSeconds(ns, 3); };
    throw InputError(
        fmt::format("it has no pose at any image's time: the images cover {} to {} s, the estimate {} to {} "
                    "s; is it of this run and on its clock? (time_offset_s in system.yaml)",
                    reference_.empty() ? "-" : seconds(reference_.front().stamp_ns),
                    reference_.empty() ? "-" : seconds(reference_.back().stamp_ns),
                    seconds(estimate_.poses.front().stamp_ns), seconds(estimate_.poses.back().stamp_ns)));
  }

 private:
  static int64_t Nanoseconds(double seconds) { return static_cast<int64_t>(std::llround(seconds * kSecondNs)); }
  Rigid3d PointFromCam(const std::string& point) const { return point == "body" ? arm_ * body_from_cam_ : arm_; }

  const std::vector<ReferencePose>& reference_;
  const double offset_s_;  // added to the estimate's stamps
  const int64_t gap_ns_;
  const Rigid3d arm_, body_from_cam_;
  Trajectory estimate_;
  std::vector<size_t> rows_;
};

// Errors near in time are no independent evidence: blocks are resampled. What the reference is off by may be in the
// estimate, too (both may rest on the same geotags): only the lower end is without it.
void AddOwnInterval(const std::vector<Pair>& pairs, const EstimateScoreOptions& options, EstimateReport* report) {
  std::vector<std::pair<double, double>> blocks;  // sum of squares; number
  double reference_variance = 0;
  int64_t begin = 0;
  for (const Pair& p : pairs) {
    const double variance = p.reference->covariance.bottomRightCorner<3, 3>().trace();
    reference_variance += variance / static_cast<double>(pairs.size());
    if (blocks.empty() || static_cast<double>(p.reference->stamp_ns - begin) > options.block_s * kSecondNs) {
      blocks.emplace_back(0, 0);
      begin = p.reference->stamp_ns;
    }
    blocks.back().first += (p.estimate.translation - p.reference->world_from_cam->translation).squaredNorm();
    blocks.back().second += 1;
  }
  report->reference_rms_m = std::sqrt(reference_variance);
  // A fit has taken out what the whole reference is off by, which is most of its variance.
  if (report->alignment != TrajectoryAlignment::kNone) reference_variance = 0;
  if (blocks.size() < 3) return;
  Random random(1);
  std::vector<double> means;
  for (int i = 0; i < options.bootstrap_samples; ++i) {
    double sum = 0, n = 0;
    for (size_t k = 0; k < blocks.size(); ++k) {
      const auto& block = blocks[std::min(blocks.size() - 1,
                                          static_cast<size_t>(random.Uniform() * static_cast<double>(blocks.size())))];
      sum += block.first;
      n += block.second;
    }
    means.push_back(sum / n);
  }
  // Few blocks make the bootstrap too narrow by about this.
  const double widen = std::sqrt(static_cast<double>(blocks.size()) / static_cast<double>(blocks.size() - 1)) *
                       (1 + 2 / static_cast<double>(blocks.size()));
  const double tail = 0.5 * (1 - options.confidence), mean = *report->rmse_m * *report->rmse_m;
  const double low = mean - widen * (mean - Quantile(means, tail));
  const double high = mean + widen * (Quantile(means, 1 - tail) - mean);
  report->own_rmse_interval_m =
      Interval{std::sqrt(std::max(0.0, low - reference_variance * ChiSquareQuantile(1 - tail, 3) / 3)),
               std::sqrt(std::max(0.0, high))};
}

// The rows, and what they sum up to.
void AddRows(const std::vector<ReferencePose>& reference, const std::vector<size_t>& rows,
             const std::vector<Pair>& pairs, EstimateReport* out) {
  EstimateReport& report = *out;
  for (const size_t i : rows) {
    const ReferencePose& r = reference[i];
    EstimateRow row;
    row.stamp_ns = r.stamp_ns;
    row.image = r.image;
    row.reference_status = r.status;
    row.status = r.world_from_cam ? "absent" : "no_reference";
    row.reason = r.world_from_cam ? "the estimate has no pose at this time" : r.reason;
    row.reference_sigma_m = r.covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
    report.attempts += r.world_from_cam.has_value();
    report.rows.push_back(std::move(row));
  }
  std::vector<double> e3, eh, ev;
  double squares = 0, rot_squares = 0;
  for (const Pair& p : pairs) {
    EstimateRow& row = report.rows[p.row];
    row.status = "scored";
    row.reason.clear();
    row.error_m = p.estimate.translation - p.reference->world_from_cam->translation;
    row.error_rot_deg = kRadToDeg * AngleBetween(p.estimate.rotation, p.reference->world_from_cam->rotation);
    e3.push_back(row.error_m->norm());
    eh.push_back(row.error_m->head<2>().norm());
    ev.push_back(std::abs(row.error_m->z()));
    squares += row.error_m->squaredNorm();
    rot_squares += *row.error_rot_deg * *row.error_rot_deg;
  }
  report.answers = static_cast<int>(pairs.size());
  const int absent = report.attempts - report.answers;
  report.error_3d = Summarize(e3, absent);
  report.error_h = Summarize(eh, absent);
  report.error_v = Summarize(ev, absent);
  report.rmse_m = std::sqrt(squares / static_cast<double>(pairs.size()));
  report.rmse_rot_deg = std::sqrt(rot_squares / static_cast<double>(pairs.size()));
}

// Pieces of the path one behind the other, the reference's lengths.
void AddRelative(const std::vector<Pair>& pairs, const EstimateScoreOptions& options, EstimateReport* report) {
  std::vector<PosePair> poses;
  for (const Pair& p : pairs) poses.push_back({p.reference->stamp_ns, *p.reference->world_from_cam, p.estimate});
  RelativeOptions relative;
  relative.delta = options.rpe_m;
  relative.unit = DeltaUnit::kMetres;
  relative.lengths_from_reference = true;
  const TrajectoryErrors errors = RelativeErrors(poses, relative);
  RelativeSummary& summary = report->relative;
  summary.length_m = options.rpe_m;
  summary.pieces = static_cast<int>(errors.translation_m.size());
  if (errors.translation_m.empty()) return;
  summary.rmse_m = StatisticsOf(errors.translation_m).rmse;
  if (!errors.rotation_deg.empty()) summary.rmse_deg = StatisticsOf(errors.rotation_deg).rmse;
  if (const auto rmse = RmseWithInterval({errors.translation_m}, options.confidence)) {
    summary.interval_m = rmse->interval;
  }
}

// d_i = c + R_i l, least squares; blocks' number of independent errors.
std::optional<LeverArm> FindLeverArm(const std::vector<Pair>& pairs, double block_s, double reference_axis_m) {
  if (pairs.size() < 10) return std::nullopt;
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  double before = 0;
  for (const Pair& p : pairs) {
    Eigen::Matrix<double, 3, 6> j;
    j << Eigen::Matrix3d::Identity(), p.reference->world_from_cam->rotation.toRotationMatrix();
    const Eigen::Vector3d d = p.estimate.translation - p.reference->world_from_cam->translation;
    normal += j.transpose() * j;
    right += j.transpose() * d;
    before += d.squaredNorm();
  }
  const Eigen::Matrix<double, 6, 6> inverse = normal.ldlt().solve(Eigen::Matrix<double, 6, 6>::Identity());
  const double n = static_cast<double>(pairs.size());
  // The camera must have turned: a shift and an arm are one and the same for a constant attitude. The arm along the
  // axis of turning stays undetermined and small by its sigma.
  const Eigen::Matrix<double, 6, 1> x =
      (normal + 1e-6 * n * Eigen::Matrix<double, 6, 6>::Identity()).ldlt().solve(right);
  LeverArm arm;
  arm.arm_m = x.tail<3>();
  double after = 0;
  for (const Pair& p : pairs) {
    const Eigen::Vector3d d = p.estimate.translation - p.reference->world_from_cam->translation -
                              p.reference->world_from_cam->rotation * arm.arm_m - x.head<3>();
    after += d.squaredNorm();
  }
  arm.rmse_before_m = std::sqrt(before / n);
  arm.rmse_after_m = std::sqrt(after / n);
  const double seconds =
      static_cast<double>(pairs.back().reference->stamp_ns - pairs.front().reference->stamp_ns) / kSecondNs;
  const double independent = std::clamp(seconds / block_s, 3.0, n);
  const double variance = after / (3 * n) * n / independent;
  const Eigen::Matrix<double, 6, 6> regular = (normal + 1e-6 * n * Eigen::Matrix<double, 6, 6>::Identity())
                                                  .ldlt()
                                                  .solve(Eigen::Matrix<double, 6, 6>::Identity());
  const Eigen::Vector3d reference_variance = Eigen::Vector3d::Constant(reference_axis_m * reference_axis_m);
  arm.sigma_m = (variance * regular.diagonal().tail<3>() + reference_variance).cwiseMax(0).cwiseSqrt();
  double most = 0;
  for (int i = 0; i < 3; ++i) most = std::max(most, std::abs(arm.arm_m[i]) / std::max(1e-9, arm.sigma_m[i]));
  arm.significant = inverse.allFinite() && most > 3 && arm.arm_m.norm() > 0.01 &&
                    arm.rmse_after_m < 0.9 * arm.rmse_before_m && arm.arm_m.norm() < 10;
  return arm;
}

// Far off as it stands, and good after a rigid fit?
bool InAnotherFrame(const EstimateReport& r) {
  // The reference itself may be turned: its sigmas say by how much.
  if (r.own_rmse_interval_m && !(r.own_rmse_interval_m->low > 0)) return false;
  return r.aligned_rmse_m && *r.rmse_m > 1 && *r.aligned_rmse_m < 0.2 * *r.rmse_m;
}

// A clock that is off moves an estimate along its path, and so does a frame that is. A rigid fit at every offset tells
// the two apart where the path bends; with the frame as it stands the clock is found on any path, as well as the
// reference lies there. Where they agree the surer one is taken; where they don't, the fit is right.
struct ClockFinding {
  std::optional<ClockOffset> offset;
  bool or_shifted = false;  // the path does not tell it from a shift
};
ClockFinding FindClock(const PoseSequence& truth, const PoseSequence& said, double max_offset_s, bool fit_first,
                       double reference_axis_m) {
  ClockFinding found;
  found.offset = EstimateTimeOffset(truth, said, max_offset_s, TrajectoryAlignment::kSE3);
  if (fit_first) return found;
  std::optional<ClockOffset> as_it_is = EstimateTimeOffset(truth, said, max_offset_s, TrajectoryAlignment::kNone);
  const double path = truth.poses.empty() ? 0 : PathLengths(truth.poses).back();
  if (!as_it_is || path <= 0) return found;
  // The reference may be off by its sigma all along the path, which looks like a clock that is off.
  const double seconds = static_cast<double>(truth.stamps_ns.back() - truth.stamps_ns.front()) / kSecondNs;
  as_it_is->sigma_s = std::hypot(as_it_is->sigma_s, reference_axis_m * seconds / path);
  as_it_is->significant = as_it_is->significant && std::abs(as_it_is->offset_s) > 3 * as_it_is->sigma_s;
  const std::optional<ClockOffset>& fitted = found.offset;
  if (!fitted || (as_it_is->sigma_s < fitted->sigma_s && std::abs(as_it_is->offset_s - fitted->offset_s) <
                                                             3 * std::hypot(as_it_is->sigma_s, fitted->sigma_s))) {
    found.or_shifted = !fitted || std::abs(as_it_is->offset_s) < 3 * fitted->sigma_s;
    found.offset = as_it_is;
  }
  return found;
}

void AddNotes(bool or_shifted, EstimateReport* r) {
  if (r->time_offset && r->time_offset->significant && r->rmse_with_offset_m) {
    r->notes.push_back(
        fmt::format("its clock is off: {:+.3f} s (sigma {:.3f} s) added to its stamps give an RMSE of "
                    "{:.3f} m instead of {:.3f} m{}",
                    r->time_offset->offset_s, r->time_offset->sigma_s, *r->rmse_with_offset_m, *r->rmse_m,
                    or_shifted ? "; a shift along its path, which is nearly straight, would explain this, too" : ""));
  }
  // Our own poses are those of the camera in the site's frame: what fits better otherwise is the error that they share.
  if (r->system.starts_with("trigpoint")) return;
  if (InAnotherFrame(*r)) {
    r->notes.push_back(
        fmt::format("it seems to be in another frame than the site's east, north, up: after a rigid fit "
                    "its RMSE is {:.3f} m instead of {:.3f} m; set alignment: se3 in system.yaml to fit "
                    "it",
                    *r->aligned_rmse_m, *r->rmse_m));
  } else if (r->lever_arm && r->lever_arm->significant) {
    const LeverArm& a = *r->lever_arm;
    r->notes.push_back(
        fmt::format("its poses fit better as those of a point at ({:.3f}, {:.3f}, {:.3f}) m in the camera's axes: RMSE "
                    "{:.3f} m instead of {:.3f} m; set lever_arm_m in system.yaml",
                    a.arm_m.x(), a.arm_m.y(), a.arm_m.z(), a.rmse_after_m, a.rmse_before_m));
  }
}

}  // namespace

SystemConfig ReadSystemConfig(const std::filesystem::path& file) {
  SystemConfig config;
  if (!std::filesystem::exists(file)) return config;
  const YamlMap map(file, LoadYaml(file), {"point", "lever_arm_m", "time_offset_s", "alignment"});
  config.point = map.Text("point", config.point);
  if (config.point != "auto" && config.point != "camera" && config.point != "body") {
    map.Fail("point", "expected auto, camera or body, found '" + config.point + "'");
  }
  if (map.Has("lever_arm_m")) config.lever_arm_m = Eigen::Vector3d::Map(map.Numbers("lever_arm_m", 3).data());
  config.time_offset_s = map.Number("time_offset_s", 0);
  try {
    config.alignment = ParseTrajectoryAlignment(map.Text("alignment", "none"));
  } catch (const OptionError& e) {
    map.Fail("alignment", e.what());
  }
  return config;
}

EstimateReport ScoreEstimate(const std::string& system, const std::string& run, const PoseSequence& estimate,
                             const std::vector<ReferencePose>& reference, const std::vector<BodyCamera>& cameras,
                             const SystemConfig& config, const EstimateScoreOptions& options) {
  EstimateReport report;
  report.system = system;
  report.run = run;
  report.alignment = config.alignment;
  report.applied_offset_s = config.time_offset_s;
  const PairSource source(estimate, reference, cameras, config, options.max_gap_s);
  report.point = config.point == "auto" ? "camera" : config.point;
  std::vector<Pair> pairs = source.Pairs(report.point, config.time_offset_s);
  if (pairs.empty()) source.ThrowApartInTime();
  if (config.point == "auto" && pairs.size() >= 3 && source.Turned("body") < source.Turned("camera")) {
    report.point = "body";
    pairs = source.Pairs(report.point, config.time_offset_s);
  }
  pairs = Fitted(std::move(pairs), config.alignment);

  AddRows(reference, source.rows(), pairs, &report);
  AddOwnInterval(pairs, options, &report);
  AddRelative(pairs, options, &report);

  // What would explain the errors: clock, frame, lever arm.
  if (pairs.size() >= 3) {
    try {
      report.aligned_rmse_m = Rmse(Fitted(pairs, TrajectoryAlignment::kSE3));
    } catch (const NumericError&) {  // all in one place: nothing to fit
    }
  }
  const double reference_axis_m = report.reference_rms_m / std::sqrt(3.0);
  const bool fit_first = config.alignment != TrajectoryAlignment::kNone || InAnotherFrame(report);
  const ClockFinding clock =
      FindClock(source.Truth(), source.Said(report.point), options.max_offset_s, fit_first, reference_axis_m);
  report.time_offset = clock.offset;
  if (report.time_offset) {
    const double offset = config.time_offset_s + report.time_offset->offset_s;
    const std::vector<Pair> moved = Fitted(source.Pairs(report.point, offset), config.alignment);
    if (!moved.empty()) report.rmse_with_offset_m = Rmse(moved);
  }
  report.lever_arm = FindLeverArm(pairs, options.block_s, reference_axis_m);
  // A clock that is off moves the errors along the path, like an arm; it goes first.
  if (report.lever_arm && report.time_offset && report.time_offset->significant) report.lever_arm->significant = false;
  AddNotes(clock.or_shifted, &report);
  report.notes.insert(report.notes.end(), estimate.warnings.begin(), estimate.warnings.end());
  return report;
}

}  // namespace trigpoint
