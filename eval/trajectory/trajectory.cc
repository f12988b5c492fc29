#include "eval/trajectory/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "datasets/io/text.h"
#include "eval/statistics/statistics.h"
#include "eval/text/markdown.h"

namespace trigpoint {
namespace {

constexpr double kNsPerS = 1e9;

// As evo holds a time: ties between neighbours depend on it.
double Seconds(int64_t ns) {
  constexpr int64_t kSecond = 1'000'000'000;
  const int64_t whole = ns / kSecond;
  return static_cast<double>(whole) + static_cast<double>(ns % kSecond) / kNsPerS;
}

// Index of the stamp nearest in time, the first of equally near ones.
size_t NearestIndex(const std::vector<int64_t>& stamps, int64_t stamp) {
  auto nearest = std::lower_bound(stamps.begin(), stamps.end(), stamp);
  const auto distance = [&](const auto& it) { return std::abs(Seconds(*it) - Seconds(stamp)); };
  if (nearest == stamps.end() || (nearest != stamps.begin() && distance(std::prev(nearest)) <= distance(nearest))) {
    nearest = std::lower_bound(stamps.begin(), stamps.end(), *std::prev(nearest));
  }
  return static_cast<size_t>(nearest - stamps.begin());
}

// "3.2 to 17.5 s"
std::string CoveredTime(const std::vector<int64_t>& stamps) {
  if (stamps.empty()) return "nothing";
  return FormatNsAsSeconds(stamps.front(), 3) + " to " + FormatNsAsSeconds(stamps.back(), 3) + " s";
}

// a^-1 b with the transpose for the inverse, whether or not it is one exactly.
MatrixPose Between(const MatrixPose& a, const MatrixPose& b) {
  MatrixPose c;
  c.rotation = a.rotation.transpose() * b.rotation;
  c.translation = a.rotation.transpose() * (b.translation - a.translation);
  return c;
}

double RotationDeg(const Eigen::Matrix3d& rotation) {
  return kRadToDeg * LogSO3(Eigen::Quaterniond(rotation).normalized()).norm();
}

// The estimate moved in time and referred to the reference's body.
PoseSequence Prepared(const PoseSequence& estimate, const AssociationOptions& options) {
  PoseSequence prepared = estimate;
  const auto offset_ns = static_cast<int64_t>(std::llround(options.offset_s * kNsPerS));
  for (int64_t& stamp : prepared.stamps_ns) stamp += offset_ns;
  const MatrixPose body(options.estimate_body_from_reference_body);
  for (MatrixPose& pose : prepared.poses) {
    pose.translation += pose.rotation * body.translation;
    pose.rotation *= body.rotation;
  }
  return prepared;
}

const MatrixPose& PoseOf(const PosePair& pair, bool reference) { return reference ? pair.reference : pair.estimate; }

// Progress along the trajectory, in frames, metres or seconds, at every pair.
std::vector<double> Progress(const std::vector<PosePair>& pairs, DeltaUnit unit, bool reference) {
  std::vector<double> progress(pairs.size(), 0.0);
  for (size_t i = 1; i < pairs.size(); ++i) {
    switch (unit) {
      case DeltaUnit::kFrames: progress[i] = static_cast<double>(i); break;
      case DeltaUnit::kSeconds:
        progress[i] = static_cast<double>(pairs[i].stamp_ns - pairs[0].stamp_ns) / kNsPerS;
        break;
      case DeltaUnit::kMetres:
        progress[i] = progress[i - 1] +
                      (PoseOf(pairs[i], reference).translation - PoseOf(pairs[i - 1], reference).translation).norm();
        break;
    }
  }
  return progress;
}

using Pieces = std::vector<std::pair<size_t, size_t>>;

Pieces ConsecutivePieces(const std::vector<double>& progress, const RelativeOptions& options) {
  Pieces pieces;
  // By metres, evo's first piece begins where the path has first grown by delta; by frames, with the first pose.
  std::optional<size_t> begin;
  double since = 0;
  if (options.unit != DeltaUnit::kMetres) begin = 0;
  for (size_t i = 1; i < progress.size(); ++i) {
    since += progress[i] - progress[i - 1];
    if (since < options.delta) continue;
    if (begin) pieces.emplace_back(*begin, i);
    begin = i;
    since = 0;
  }
  return pieces;
}

Pieces AllPieces(const std::vector<double>& progress, const RelativeOptions& options) {
  Pieces pieces;
  const double tolerance = options.unit == DeltaUnit::kFrames ? 0 : options.relative_tolerance * options.delta;
  for (size_t i = 0; i + 1 < progress.size(); ++i) {
    const double target = progress[i] + options.delta;
    // The nearest in progress; of equally near ones the first.
    const auto from = progress.begin() + static_cast<ptrdiff_t>(i) + 1;
    auto j = std::lower_bound(from, progress.end(), target);
    if (j == progress.end() || (j != from && target - *std::prev(j) <= *j - target)) {
      j = std::lower_bound(from, progress.end(), *std::prev(j));
    }
    if (std::abs(*j - target) <= tolerance) pieces.emplace_back(i, static_cast<size_t>(j - progress.begin()));
  }
  return pieces;
}

TrajectoryErrors ErrorsOf(const std::vector<PosePair>& pairs, const Pieces& pieces) {
  TrajectoryErrors errors;
  for (const auto& [i, j] : pieces) {
    const MatrixPose reference = Between(pairs[i].reference, pairs[j].reference);
    const MatrixPose estimate = Between(pairs[i].estimate, pairs[j].estimate);
    errors.stamps_ns.push_back(pairs[i].stamp_ns);
    errors.translation_m.push_back(
        (reference.rotation.transpose() * (estimate.translation - reference.translation)).norm());
    errors.rotation_deg.push_back(RotationDeg(reference.rotation.transpose() * estimate.rotation));
  }
  return errors;
}

nlohmann::json Json(const SampleStatistics& s) {
  return {{"count", s.count}, {"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std}, {"min", s.min},
          {"max", s.max},     {"sse", s.sse},   {"p75", s.p75},   {"p90", s.p90},       {"p95", s.p95}, {"p99", s.p99}};
}

nlohmann::json Json(const std::optional<SampleStatistics>& s) { return s ? Json(*s) : nlohmann::json(); }

const char* Name(DeltaUnit unit) {
  switch (unit) {
    case DeltaUnit::kFrames: return "frames";
    case DeltaUnit::kMetres: return "m";
    case DeltaUnit::kSeconds: return "s";
  }
  return "";
}

[[noreturn]] void ThrowNoPairs(const PoseSequence& reference, const PoseSequence& estimate, double apart_s) {
  throw InputError(
      fmt::format("no two poses are within {:g} s of each other: the reference covers {}, the estimate {}; check the "
                  "clocks, or give a time offset",
                  apart_s, CoveredTime(reference.stamps_ns), CoveredTime(estimate.stamps_ns)));
}

std::vector<PosePair> Interpolated(const PoseSequence& reference, const PoseSequence& estimate,
                                   bool reference_is_longer, const AssociationOptions& options) {
  const PoseSequence& stamps = reference_is_longer ? estimate : reference;
  const Trajectory dense = ToTrajectory(reference_is_longer ? reference : estimate);
  const auto max_gap = static_cast<int64_t>(options.max_gap_s * kNsPerS);
  std::vector<PosePair> pairs;
  for (size_t i = 0; i < stamps.poses.size(); ++i) {
    const auto at = dense.At(stamps.stamps_ns[i], max_gap);
    if (!at) continue;
    pairs.push_back(reference_is_longer ? PosePair{stamps.stamps_ns[i], *at, stamps.poses[i]}
                                        : PosePair{stamps.stamps_ns[i], stamps.poses[i], *at});
  }
  if (pairs.empty()) ThrowNoPairs(reference, estimate, options.max_gap_s);
  return pairs;
}

// Between poses, s.
double MedianStep(const PoseSequence& sequence) {
  std::vector<double> steps;
  for (size_t i = 1; i < sequence.stamps_ns.size(); ++i) {
    steps.push_back(Seconds(sequence.stamps_ns[i]) - Seconds(sequence.stamps_ns[i - 1]));
  }
  return steps.empty() ? 0 : Median(std::move(steps));
}

std::string LengthText(double metres, double metres_per_unit) {
  return fmt::format("{:.4f}", metres / metres_per_unit);
}

// A row a kind of error of each report, below the head.
std::vector<std::vector<std::string>> ErrorTable(const std::vector<TrajectoryReport>& reports, const std::string& unit,
                                                 double metres_per_unit) {
  const auto length = [&](double metres) { return LengthText(metres, metres_per_unit); };
  const auto degrees = [](double deg) { return fmt::format("{:.3f}", deg); };
  std::vector<std::vector<std::string>> lines{
      {"estimate", "error", "n", "rmse", "mean", "median", "P90", "P95", "max", "std"}};
  const auto add = [&](const TrajectoryReport& r, const std::string& what, const SampleStatistics& s,
                       const auto& text) {
    lines.push_back({r.name, what, std::to_string(s.count), text(s.rmse), text(s.mean), text(s.median), text(s.p90),
                     text(s.p95), text(s.max), text(s.std)});
  };
  for (const TrajectoryReport& r : reports) {
    add(r, "ATE " + unit, r.ate_m, length);
    if (r.ate_h_m) add(r, "ATE horizontal " + unit, *r.ate_h_m, length);
    if (r.ate_v_m) add(r, "ATE vertical " + unit, *r.ate_v_m, length);
    if (r.ate_deg) add(r, "ATE deg", *r.ate_deg, degrees);
    for (const RelativeReport& rpe : r.rpe) {
      const std::string over =
          fmt::format("RPE {:g} {}{} ", rpe.options.delta, Name(rpe.options.unit), rpe.options.all_pairs ? " all" : "");
      if (rpe.m) add(r, over + unit, *rpe.m, length);
      if (rpe.deg) add(r, over + "deg", *rpe.deg, degrees);
    }
  }
  return lines;
}

}  // namespace

PoseSequence::PoseSequence(const Trajectory& trajectory) : warnings(trajectory.warnings) {
  for (const TimedPose& pose : trajectory.poses) {
    stamps_ns.push_back(pose.stamp_ns);
    poses.emplace_back(pose.target_from_body);
  }
}

Trajectory ToTrajectory(const PoseSequence& sequence) {
  Trajectory trajectory;
  for (size_t i = 0; i < sequence.stamps_ns.size(); ++i) {
    if (i > 0 && sequence.stamps_ns[i] == sequence.stamps_ns[i - 1]) continue;
    trajectory.poses.push_back({sequence.stamps_ns[i], sequence.poses[i].ToRigid()});
  }
  return trajectory;
}

std::vector<PosePair> Associate(const PoseSequence& reference, const PoseSequence& given,
                                const AssociationOptions& options) {
  const PoseSequence estimate = Prepared(given, options);
  std::vector<PosePair> pairs;
  if (reference.HasTimes() != estimate.HasTimes()) {
    throw InputError(fmt::format("the {} has no times but the {} has; give both in a form with times, or both without",
                                 reference.HasTimes() ? "estimate" : "reference",
                                 reference.HasTimes() ? "reference" : "estimate"));
  }
  if (!reference.HasTimes()) {
    if (reference.poses.size() != estimate.poses.size()) {
      throw InputError(
          fmt::format("without times, poses correspond by their number: expected as many as the "
                      "reference's {}, found {}",
                      reference.poses.size(), estimate.poses.size()));
    }
    for (size_t i = 0; i < reference.poses.size(); ++i) {
      pairs.push_back({static_cast<int64_t>(i), reference.poses[i], estimate.poses[i]});
    }
    return pairs;
  }
  const bool reference_is_longer = reference.poses.size() >= estimate.poses.size();
  if (options.interpolate) return Interpolated(reference, estimate, reference_is_longer, options);
  const PoseSequence& longer = reference_is_longer ? reference : estimate;
  const PoseSequence& shorter = reference_is_longer ? estimate : reference;
  for (size_t i = 0; i < shorter.poses.size(); ++i) {
    const size_t j = NearestIndex(longer.stamps_ns, shorter.stamps_ns[i]);
    if (std::abs(Seconds(longer.stamps_ns[j]) - Seconds(shorter.stamps_ns[i])) > options.max_difference_s) continue;
    const size_t r = reference_is_longer ? j : i, e = reference_is_longer ? i : j;
    pairs.push_back({reference.stamps_ns[r], reference.poses[r], estimate.poses[e]});
  }
  if (pairs.empty()) ThrowNoPairs(reference, estimate, options.max_difference_s);
  return pairs;
}

TrajectoryAlignment ParseTrajectoryAlignment(const std::string& name) {
  for (const auto a : {TrajectoryAlignment::kNone, TrajectoryAlignment::kOrigin, TrajectoryAlignment::kYaw,
                       TrajectoryAlignment::kSE3, TrajectoryAlignment::kSim3}) {
    if (ToString(a) == name) return a;
  }
  throw OptionError("alignment is '" + name + "', expected none, origin, yaw, se3 or sim3");
}

std::string ToString(TrajectoryAlignment alignment) {
  switch (alignment) {
    case TrajectoryAlignment::kNone: return "none";
    case TrajectoryAlignment::kOrigin: return "origin";
    case TrajectoryAlignment::kYaw: return "yaw";
    case TrajectoryAlignment::kSE3: return "se3";
    case TrajectoryAlignment::kSim3: return "sim3";
  }
  return "";
}

Sim3d Align(std::vector<PosePair>* pairs, TrajectoryAlignment alignment) {
  Sim3d fit;
  if (alignment == TrajectoryAlignment::kNone || pairs->empty()) return fit;
  if (alignment == TrajectoryAlignment::kOrigin) {
    const Rigid3d t = pairs->front().reference.ToRigid() * pairs->front().estimate.ToRigid().Inverse();
    fit = {1.0, t.rotation, t.translation};
  } else {
    std::vector<Eigen::Vector3d> source, target;
    for (const PosePair& pair : *pairs) {
      source.push_back(pair.estimate.translation);
      target.push_back(pair.reference.translation);
    }
    fit = AlignPoints(source, target,
                      alignment == TrajectoryAlignment::kYaw   ? AlignmentKind::kYawTranslation
                      : alignment == TrajectoryAlignment::kSE3 ? AlignmentKind::kSE3
                                                               : AlignmentKind::kSim3);
  }
  const Eigen::Matrix3d rotation = fit.rotation.toRotationMatrix();
  for (PosePair& pair : *pairs) {
    pair.estimate.translation = fit * pair.estimate.translation;
    pair.estimate.rotation = rotation * pair.estimate.rotation;
  }
  return fit;
}

SampleStatistics StatisticsOf(const std::vector<double>& sample) {
  if (sample.empty()) throw InputError("statistics of an empty sample");
  SampleStatistics s;
  const double n = static_cast<double>(sample.size());
  s.count = static_cast<int>(sample.size());
  s.mean = std::accumulate(sample.begin(), sample.end(), 0.0) / n;
  double variance = 0;
  for (const double v : sample) s.sse += v * v, variance += (v - s.mean) * (v - s.mean);
  s.rmse = std::sqrt(s.sse / n);
  s.std = std::sqrt(variance / n);
  s.min = *std::min_element(sample.begin(), sample.end());
  s.max = *std::max_element(sample.begin(), sample.end());
  s.median = Quantile(sample, 0.5);
  s.p75 = Quantile(sample, 0.75);
  s.p90 = Quantile(sample, 0.9);
  s.p95 = Quantile(sample, 0.95);
  s.p99 = Quantile(sample, 0.99);
  return s;
}

TrajectoryErrors AbsoluteErrors(const std::vector<PosePair>& pairs) {
  TrajectoryErrors errors;
  for (const PosePair& pair : pairs) {
    errors.stamps_ns.push_back(pair.stamp_ns);
    errors.translation_m.push_back((pair.estimate.translation - pair.reference.translation).norm());
    errors.rotation_deg.push_back(RotationDeg(pair.reference.rotation.transpose() * pair.estimate.rotation));
  }
  return errors;
}

RelativeOptions ParseRelative(const std::string& text) {
  RelativeOptions options;
  const std::string unit = text.empty() ? "" : text.substr(text.size() - 1);
  const auto delta = ParseDouble(std::string_view(text).substr(0, text.empty() ? 0 : text.size() - 1));
  if (!delta || !(*delta > 0) || !std::isfinite(*delta) || (unit != "f" && unit != "m" && unit != "s")) {
    throw OptionError("RPE over '" + text + "': expected a length with its unit: 1f (frames), 10m (metres), 0.5s");
  }
  options.delta = *delta;
  options.unit = unit == "f" ? DeltaUnit::kFrames : unit == "m" ? DeltaUnit::kMetres : DeltaUnit::kSeconds;
  return options;
}

TrajectoryErrors RelativeErrors(const std::vector<PosePair>& pairs, const RelativeOptions& options,
                                bool positions_only) {
  if (!(options.delta > 0)) throw OptionError(fmt::format("delta is {:g}, expected more than 0", options.delta));
  const std::vector<double> progress = Progress(pairs, options.unit, options.lengths_from_reference);
  const Pieces pieces = options.all_pairs ? AllPieces(progress, options) : ConsecutivePieces(progress, options);
  if (!positions_only) return ErrorsOf(pairs, pieces);
  TrajectoryErrors errors;
  for (const auto& [i, j] : pieces) {
    const double reference = (pairs[j].reference.translation - pairs[i].reference.translation).norm();
    const double estimate = (pairs[j].estimate.translation - pairs[i].estimate.translation).norm();
    errors.stamps_ns.push_back(pairs[i].stamp_ns);
    errors.translation_m.push_back(std::abs(reference - estimate));
  }
  return errors;
}

double PathLength(const std::vector<PosePair>& pairs) {
  return pairs.empty() ? 0 : Progress(pairs, DeltaUnit::kMetres, true).back();
}

TrajectoryReport EvaluateTrajectory(const std::string& name, const PoseSequence& reference,
                                    const PoseSequence& estimate, const TrajectoryReportOptions& options) {
  TrajectoryReport report{.name = name};
  report.reference_poses = static_cast<int>(reference.poses.size());
  report.estimate_poses = static_cast<int>(estimate.poses.size());
  AssociationOptions association = options.association;
  report.time_offset = EstimateTimeOffset(reference, Prepared(estimate, association));
  if (options.find_offset && report.time_offset && report.time_offset->significant) {
    association.offset_s += report.time_offset->offset_s;
    association.interpolate = true;  // a clock that is moved leaves no stamps beside each other
    association.max_gap_s = std::max({association.max_gap_s, 3 * MedianStep(reference), 3 * MedianStep(estimate)});
  }
  report.applied_offset_s = association.offset_s;
  report.interpolated = association.interpolate;
  std::vector<PosePair> pairs = Associate(reference, estimate, association);
  report.pairs = static_cast<int>(pairs.size());
  report.path_length_m = PathLength(pairs);
  report.reference_from_estimate = Align(&pairs, options.alignment);
  const TrajectoryErrors absolute = AbsoluteErrors(pairs);
  report.ate_m = StatisticsOf(absolute.translation_m);
  if (reference.positions_only) {
    std::vector<double> h, v;
    for (const PosePair& pair : pairs) {
      const Eigen::Vector3d e = pair.estimate.translation - pair.reference.translation;
      h.push_back(e.head<2>().norm());
      v.push_back(std::abs(e.z()));
    }
    report.ate_h_m = StatisticsOf(h);
    report.ate_v_m = StatisticsOf(v);
    report.reference_sigma_h_m = reference.sigma_h_m;
    report.reference_sigma_v_m = reference.sigma_v_m;
  } else {
    report.ate_deg = StatisticsOf(absolute.rotation_deg);
  }
  for (const RelativeOptions& relative : options.relative) {
    const TrajectoryErrors errors = RelativeErrors(pairs, relative, reference.positions_only);
    RelativeReport& rpe = report.rpe.emplace_back(RelativeReport{.options = relative});
    if (!errors.translation_m.empty()) rpe.m = StatisticsOf(errors.translation_m);
    if (!errors.rotation_deg.empty()) rpe.deg = StatisticsOf(errors.rotation_deg);
  }
  report.warnings = reference.warnings;
  report.warnings.insert(report.warnings.end(), estimate.warnings.begin(), estimate.warnings.end());
  return report;
}

std::string FormatTrajectoryReports(const std::vector<TrajectoryReport>& reports,
                                    const TrajectoryReportOptions& options, const std::string& unit,
                                    double metres_per_unit) {
  const auto length = [&](double metres) { return LengthText(metres, metres_per_unit); };
  const std::vector<std::vector<std::string>> lines = ErrorTable(reports, unit, metres_per_unit);
  std::string text =
      fmt::format("Lengths in {}; alignment {}\n\n{}", unit, ToString(options.alignment), AlignMarkdown(lines));
  for (const TrajectoryReport& r : reports) {
    text += fmt::format("{}: {} pairs of {} reference and {} estimated poses, path {} {}", r.name, r.pairs,
                        r.reference_poses, r.estimate_poses, length(r.path_length_m), unit);
    if (options.alignment == TrajectoryAlignment::kSim3) {
      text += fmt::format(", scale {:.6f}", r.reference_from_estimate.scale);
    }
    if (r.applied_offset_s != 0) text += fmt::format(", clock moved by {:+.4f} s", r.applied_offset_s);
    if (r.ate_h_m) {
      text += fmt::format("; the track states 1 sigma {} horizontal, {} vertical {} per axis, part of every error here",
                          length(r.reference_sigma_h_m), length(r.reference_sigma_v_m), unit);
    }
    text += "\n";
    for (const RelativeReport& rpe : r.rpe) {
      if (!rpe.m) {
        text += fmt::format("Note: {} is too short for one piece of {:g} {}\n", r.name, rpe.options.delta,
                            Name(rpe.options.unit));
      }
    }
    for (const std::string& warning : r.warnings) text += "Note: " + warning + "\n";
    if (!r.time_offset || !r.time_offset->significant || options.find_offset) continue;
    text += fmt::format(
        "Note: {} fits better with its clock moved by {:+.3f} s (sigma {:.3f} s): ATE {} instead of {} {} after a "
        "rigid "
        "fit; --offset auto applies it\n",
        r.name, r.time_offset->offset_s, r.time_offset->sigma_s, length(r.time_offset->rmse_after_m),
        length(r.time_offset->rmse_before_m), unit);
  }
  return text;
}

nlohmann::json TrajectoryReportsJson(const std::vector<TrajectoryReport>& reports,
                                     const TrajectoryReportOptions& options) {
  nlohmann::json estimates = nlohmann::json::array();
  for (const TrajectoryReport& r : reports) {
    const Sim3d& s = r.reference_from_estimate;
    nlohmann::json rpe = nlohmann::json::array();
    for (const RelativeReport& piece : r.rpe) {
      rpe.push_back({{"delta", piece.options.delta},
                     {"unit", Name(piece.options.unit)},
                     {"all_pairs", piece.options.all_pairs},
                     {"m", Json(piece.m)},
                     {"deg", Json(piece.deg)}});
    }
    nlohmann::json j{{"name", r.name},
                     {"reference_poses", r.reference_poses},
                     {"estimate_poses", r.estimate_poses},
                     {"pairs", r.pairs},
                     {"path_length_m", r.path_length_m},
                     {"applied_offset_s", r.applied_offset_s},
                     {"interpolated", r.interpolated},
                     {"reference_from_estimate",
                      {{"scale", s.scale},
                       {"rotation_xyzw", {s.rotation.x(), s.rotation.y(), s.rotation.z(), s.rotation.w()}},
                       {"translation_m", {s.translation.x(), s.translation.y(), s.translation.z()}}}},
                     {"ate_m", Json(r.ate_m)},
                     {"ate_deg", Json(r.ate_deg)},
                     {"rpe", rpe},
                     {"warnings", r.warnings}};
    if (r.ate_h_m) {
      j["ate_h_m"] = Json(r.ate_h_m);
      j["ate_v_m"] = Json(r.ate_v_m);
      j["reference_sigma_h_m"] = r.reference_sigma_h_m;
      j["reference_sigma_v_m"] = r.reference_sigma_v_m;
    }
    if (r.time_offset) {
      j["time_offset"] = {{"offset_s", r.time_offset->offset_s},
                          {"sigma_s", r.time_offset->sigma_s},
                          {"significant", r.time_offset->significant}};
    }
    estimates.push_back(std::move(j));
  }
  return {{"schema", "trigpoint trajectory 1"},
          {"alignment", ToString(options.alignment)},
          {"max_difference_s", options.association.max_difference_s},
          {"interpolated", options.association.interpolate},
          {"estimates", estimates}};
}

}  // namespace trigpoint
