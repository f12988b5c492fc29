// Absolute and relative errors of trajectories (ATE/APE and RPE; Sturm et al., "A Benchmark for the Evaluation of
// RGB-D SLAM Systems", IROS 2012), with the conventions of the program evo, so that numbers can be compared.
//
//   std::vector<PosePair> pairs = Associate(ReadPoseSequence(a), ReadPoseSequence(b), {.max_difference_s = 0.01});
//   const Sim3d fit = Align(&pairs, TrajectoryAlignment::kSE3);
//   const TrajectoryErrors ate = AbsoluteErrors(pairs);
//   const TrajectoryErrors rpe = RelativeErrors(pairs, {.delta = 10, .unit = DeltaUnit::kMetres});
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"
#include "datasets/io/site.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

// A pose whose rotation is kept as the file gives it: KITTI's rows are no exact rotations, and evo uses them as they
// are. Over 100 m the difference reaches 1e-5 m.
struct MatrixPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  MatrixPose() = default;
  MatrixPose(const Rigid3d& pose)  // NOLINT(google-explicit-constructor): a Rigid3d is one
      : rotation(pose.rotation.toRotationMatrix()), translation(pose.translation) {}
  Rigid3d ToRigid() const { return {Eigen::Quaterniond(rotation), translation}; }
};

// A trajectory as a file gives it. Ascending time; doubled stamps are kept (and named), as evo keeps them.
struct PoseSequence {
  std::vector<int64_t> stamps_ns;  // empty: no times; poses correspond by their number (KITTI)
  std::vector<MatrixPose> poses;
  std::vector<std::string> warnings;
  // A GPS track: nothing is known of how the body is turned, `poses` have no rotation, and +z is up.
  bool positions_only = false;
  double sigma_h_m = 0, sigma_v_m = 0;  // of a GPS track: median 1 sigma per axis as stated; 0: not stated

  PoseSequence() = default;
  PoseSequence(const Trajectory& trajectory);  // NOLINT(google-explicit-constructor)
  bool HasTimes() const { return !stamps_ns.empty(); }
};

// For interpolation; of doubled stamps the first is kept.
Trajectory ToTrajectory(const PoseSequence& sequence);

// TUM (`timestamp tx ty tz qx qy qz qw`), EuRoC CSV (`timestamp_ns,x,y,z,qw,qx,qy,qz,...`) or KITTI (12 numbers: a
// 3 x 4 matrix row by row); '#' comments. Throws InputError naming file and line for anything else.
PoseSequence ReadPoseSequence(const std::filesystem::path& file);

// A GPS track as positions in the east-north-up frame. Throws InputError for no fix.
PoseSequence PoseSequenceFromGps(const std::vector<GpsFix>& fixes, const LocalFrame& frame);

// Two poses of the same body at (nearly) the same time.
struct PosePair {
  int64_t stamp_ns = 0;  // the reference's; the number of the pose where there are no times
  MatrixPose reference;  // reference frame from body
  MatrixPose estimate;   // estimate's frame from body
};

struct AssociationOptions {
  double max_difference_s = 0.01;
  double offset_s = 0;  // added to the estimate's stamps
  // The estimate's body is another than the reference's: estimate_body_from_reference_body (lever arm, mounting).
  Rigid3d estimate_body_from_reference_body;
  // Instead of evo's rule: the estimate is interpolated at every stamp of the reference (or the reference at the
  // estimate's where it has more poses), never across a gap longer than max_gap_s.
  bool interpolate = false;
  double max_gap_s = 1;
};

// evo's rule: each pose of the shorter trajectory takes the nearest in time of the longer one (the earlier of two
// equally near, compared as doubles), kept if at most max_difference_s away; the reference counts as the longer of two
// equally long ones. Sequences without times pair by number and must be equally long. Ascending time. O(n log n).
// Throws InputError when no pair is found, naming the covered times, or when just one side has times.
std::vector<PosePair> Associate(const PoseSequence& reference, const PoseSequence& estimate,
                                const AssociationOptions& options = {});

// How the estimate's frame is brought to the reference's. kNone compares numbers as they stand.
enum class TrajectoryAlignment { kNone, kOrigin, kYaw, kSE3, kSim3 };

// none, origin, yaw, se3, sim3. Throws OptionError naming the choices.
TrajectoryAlignment ParseTrajectoryAlignment(const std::string& name);
std::string ToString(TrajectoryAlignment alignment);

// Transforms the estimates; returns reference_from_estimate. kOrigin makes the first pair's poses equal; the others are
// least-squares fits of the positions (Umeyama 1991). Throws NumericError when there are too few pairs for a fit.
Sim3d Align(std::vector<PosePair>* pairs, TrajectoryAlignment alignment);

struct SampleStatistics {
  int count = 0;
  double rmse = 0, mean = 0, median = 0, std = 0, min = 0, max = 0, sse = 0;  // std: of the population, as in evo
  double p75 = 0, p90 = 0, p95 = 0, p99 = 0;                                  // linear interpolation
};
// Throws InputError for an empty sample.
SampleStatistics StatisticsOf(const std::vector<double>& sample);

struct TrajectoryErrors {
  std::vector<int64_t> stamps_ns;     // of the (first) pose
  std::vector<double> translation_m;  // |reference position - estimated position|, or its relative form
  std::vector<double> rotation_deg;   // angle of reference^-1 * estimate; empty where the reference has none
};

TrajectoryErrors AbsoluteErrors(const std::vector<PosePair>& pairs);

enum class DeltaUnit { kFrames, kMetres, kSeconds };

struct RelativeOptions {
  double delta = 1;
  DeltaUnit unit = DeltaUnit::kFrames;
  // false: consecutive pieces, the next begins where the last ended. true: a piece from every pose.
  bool all_pairs = false;
  // all_pairs by metres or seconds: a piece is used if its length differs by at most this share of delta.
  double relative_tolerance = 0.1;
  bool lengths_from_reference = false;  // evo's default measures the path of the estimate
};
// "1f", "10m", "0.5s": frames, metres, seconds. Throws OptionError saying what is expected.
RelativeOptions ParseRelative(const std::string& text);

// Errors of relative poses: (ref_i^-1 ref_j)^-1 (est_i^-1 est_j) over pieces of the given length. Empty if the
// trajectory is too short. Throws OptionError for delta <= 0. `positions_only`: | |p_ref_j - p_ref_i| - |p_est_j -
// p_est_i| | (evo's "point_distance"), since a position alone has no frame to express a step in.
TrajectoryErrors RelativeErrors(const std::vector<PosePair>& pairs, const RelativeOptions& options,
                                bool positions_only = false);

// Length of the reference's path through the pairs, m.
double PathLength(const std::vector<PosePair>& pairs);

struct ClockOffset {
  double offset_s = 0;  // to be added to the estimate's stamps
  double sigma_s = 0;   // 1 sigma, with what the alignment leaves open and as many errors as are independent in time
  double rmse_before_m = 0;  // without the offset
  double rmse_after_m = 0;
  bool significant = false;  // more than three sigma and two percent of a reference interval away from zero
};
// The time offset that fits the estimate best to the reference, which is interpolated, within +-max_offset_s.
// `alignment`: none, or a rigid fit at every offset (anything else), which takes what an offset does along a straight
// path: sigma_s is large there. Unset when they share too little time, have none, or the motion is too small to tell.
std::optional<ClockOffset> EstimateTimeOffset(const PoseSequence& reference, const PoseSequence& estimate,
                                              double max_offset_s = 1.0,
                                              TrajectoryAlignment alignment = TrajectoryAlignment::kSE3);

// What `trigpoint trajectory` prints for one estimate.
struct TrajectoryReportOptions {
  AssociationOptions association;
  bool find_offset = false;  // the time offset that fits best is used, if significant (on top of association.offset_s)
  TrajectoryAlignment alignment = TrajectoryAlignment::kNone;
  std::vector<RelativeOptions> relative = {RelativeOptions{}};
};
struct RelativeReport {
  RelativeOptions options;
  std::optional<SampleStatistics> m, deg;  // unset when the trajectory is too short for one piece
};
struct TrajectoryReport {
  std::string name;
  int reference_poses = 0, estimate_poses = 0, pairs = 0;
  double path_length_m = 0;
  Sim3d reference_from_estimate;
  SampleStatistics ate_m;
  std::optional<SampleStatistics> ate_deg;                  // unset against positions
  std::optional<SampleStatistics> ate_h_m, ate_v_m;         // against a GPS track, whose +z is up
  double reference_sigma_h_m = 0, reference_sigma_v_m = 0;  // of a GPS track
  std::vector<RelativeReport> rpe;                          // as options.relative
  std::optional<ClockOffset> time_offset;
  double applied_offset_s = 0;
  bool interpolated = false;
  std::vector<std::string> warnings;
};
TrajectoryReport EvaluateTrajectory(const std::string& name, const PoseSequence& reference,
                                    const PoseSequence& estimate, const TrajectoryReportOptions& options);
// A Markdown table, a row per estimate; and the same as JSON with a schema. Lengths in units of `metres_per_unit`.
std::string FormatTrajectoryReports(const std::vector<TrajectoryReport>& reports,
                                    const TrajectoryReportOptions& options, const std::string& unit = "m",
                                    double metres_per_unit = 1);
nlohmann::json TrajectoryReportsJson(const std::vector<TrajectoryReport>& reports,
                                     const TrajectoryReportOptions& options);

}  // namespace trigpoint
