// Anybody's trajectory of a run against its reference poses (reference_poses.h).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/statistics.h"
#include "eval/trajectory/trajectory.h"
#include "eval/truth/reference_poses.h"

namespace trigpoint {

struct EstimateScoreOptions {
  double max_gap_s = 1;     // an estimate is not interpolated across a longer gap: that image counts as absent, s
  double max_offset_s = 1;  // clocks are looked for within this, s
  double block_s = 5;       // errors this near in time count once, s
  double rpe_m = 10;        // length of the pieces of relative errors, m
  double confidence = 0.95;
  int bootstrap_samples = 1000;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_gap_s, {"max_gap_s", "s", 1e-3, 1e4, "an estimate is not interpolated across a longer gap"});
    visit(self.max_offset_s, {"max_offset_s", "s", 1e-3, 1e4, "largest clock offset that is searched for"});
    visit(self.rpe_m, {"rpe_m", "m", 0.1, 1e5, "length of the pieces of path that relative errors are taken over"});
    visit(self.block_s, {"block_s", "s", 1e-3, 1e4, "errors closer in time than this count as one"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// What a system says of its trajectories: estimates/<system>/system.yaml, every key with this default.
struct SystemConfig {
  std::string point = "auto";  // what the poses are of: camera (the first), body, or auto: what fits the rotations
  Eigen::Vector3d lever_arm_m = Eigen::Vector3d::Zero();  // where that point lies in the pose's own axes
  double time_offset_s = 0;                               // added to its stamps
  TrajectoryAlignment alignment = TrajectoryAlignment::kNone;
};
// Throws InputError naming file, line and key. The defaults if the file is not there.
SystemConfig ReadSystemConfig(const std::filesystem::path& file);

// One image of the run. status: scored, absent (the estimate has no pose then), no_reference.
struct EstimateRow {
  int64_t stamp_ns = 0;
  std::string image, status, reason, reference_status;
  std::optional<Eigen::Vector3d> error_m;  // estimate - reference, east, north, up
  std::optional<double> error_rot_deg;
  Eigen::Vector3d reference_sigma_m = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> estimate_sigma_m;  // as the estimate states it
};

// Relative errors (RPE) over consecutive pieces of the reference's path.
struct RelativeSummary {
  double length_m = 0;  // of a piece
  int pieces = 0;
  std::optional<double> rmse_m, rmse_deg;
  // Pieces taken as independent, each as one component: wide rather than narrow. Unset with fewer than three.
  std::optional<Interval> interval_m;
};

// A lever arm the errors would be explained by, in the reference camera's axes, beside a constant shift in world.
struct LeverArm {
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero(), sigma_m = Eigen::Vector3d::Zero();
  double rmse_before_m = 0, rmse_after_m = 0;
  bool significant = false;  // beyond three sigma, 1 cm, and a tenth of the error
};

struct EstimateReport {
  std::string system, run;
  std::string point;  // camera or body
  TrajectoryAlignment alignment = TrajectoryAlignment::kNone;
  double applied_offset_s = 0;
  std::vector<EstimateRow> rows;
  int attempts = 0, answers = 0;  // images with a reference; of these, with an estimate
  ErrorStatistics error_3d, error_h, error_v;
  std::optional<double> rmse_m, rmse_rot_deg;
  double reference_rms_m = 0;  // 1 sigma in space of the reference, root mean square
  // Of the estimate's own RMSE. Blocks in time are resampled; the lower end takes all of the reference's uncertainty
  // out (the estimate does not share it), the upper end none (it does).
  std::optional<Interval> own_rmse_interval_m;
  RelativeSummary relative;
  std::optional<double> aligned_rmse_m;    // after a rigid fit
  std::optional<ClockOffset> time_offset;  // beyond what is applied
  std::optional<double> rmse_with_offset_m;
  std::optional<LeverArm> lever_arm;
  std::vector<std::string> notes;  // other clock, other frame, lever arm: one sentence each
};

// `reference`: of the run's first camera (others are ignored). Throws InputError when the two have no time in common.
EstimateReport ScoreEstimate(const std::string& system, const std::string& run, const PoseSequence& estimate,
                             const std::vector<ReferencePose>& reference, const std::vector<BodyCamera>& cameras,
                             const SystemConfig& config, const EstimateScoreOptions& options);

// estimates.csv of all reports; a Markdown table with the notes; JSON.
void WriteEstimates(const std::vector<EstimateReport>& reports, const std::filesystem::path& file);
std::string FormatEstimates(const std::vector<EstimateReport>& reports, const std::string& unit = "m",
                            double metres_per_unit = 1);
nlohmann::json EstimatesJson(const std::vector<EstimateReport>& reports);

// poses.csv of results/reference/<run>, written and read.
void WriteReferencePoses(const std::vector<ReferencePose>& poses, const std::string& datum,
                         const std::filesystem::path& file);
std::vector<ReferencePose> ReadReferencePoses(const std::filesystem::path& file);

}  // namespace trigpoint
