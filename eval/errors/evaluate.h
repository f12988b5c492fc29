// Errors of localized panoramas against the positions their tags give (Agarwal, Burgard, Spinello 2015, section V;
// docs/method.md section 7): error = estimated position - (tag position + measured offset).
//
// Two kinds of number, never mixed:
//   relative  in the run's own optimised frame, against tags estimated from that run's own cameras
//             (reference = self): the common error of cameras and tags cancels, as in the paper. So does the run's
//             scale, which the tags' edges show; these errors are in metres of the tags.
//   absolute  in site ENU (world), against a tag map, error of the global fit included.
//
// The pipeline's use:
//   EvaluateInput input;              // one EvaluatedRun per localize result, stations, tag maps
//   const Evaluation e = Evaluate(input, options);
//   WriteEvaluation(e, stage.out);    // eval/errors/evaluation_files.h
#pragma once

#include <Eigen/Core>
#include <compare>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "datasets/io/site.h"
#include "eval/errors/answer_covariance.h"
#include "eval/errors/depth.h"
#include "eval/errors/results.h"
#include "eval/errors/stations.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/consistency.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {

struct EvaluateOptions {
  double passed_radius_m = 12;   // a station counts as passed by a run that came at least this near, m
  double confidence = 0.95;      // of intervals
  int bootstrap_samples = 1000;  // bootstrap samples of every interval; 0: no intervals
  // Structure farther from a panorama than this is ignored, m.
  double structure_radius_m = 30;
  double ray_sigma_mrad = 1;  // 1 sigma of a ray to a feature: about half a pixel of a 1000 px wide image
  // Answers are not trusted where the structure's depth has a larger sigma than this, m. On the rendered lot answers
  // beyond it were more than twice as bad as the others.
  double trust_depth_sigma_m = 0.25;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.passed_radius_m,
          {"passed_radius_m", "m", 0.0, 1000.0, "largest distance at which a run counts as passing a station"});
    visit(self.confidence, {"confidence", "", 0.5, 0.999, "confidence of the intervals"});
    visit(self.bootstrap_samples,
          {"bootstrap_samples", "", 0, 1000000, "bootstrap samples of every interval; 0: no intervals"});
    visit(self.structure_radius_m,
          {"structure_radius_m", "m", 1.0, 1e4, "structure farther from a panorama is ignored"});
    visit(self.ray_sigma_mrad, {"ray_sigma_mrad", "mrad", 1e-3, 100.0, "1 sigma of a ray to a feature"});
    visit(self.trust_depth_sigma_m, {"trust_depth_sigma_m", "m", 1e-4, 1e4,
                                     "an answer is not trusted if the structure's depth has a larger sigma"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// One localize result under test.
struct EvaluatedRun {
  std::string run;
  std::string variant;             // empty: the default results
  std::string method = "single";   // of `result.panoramas`: g2 in paper mode, else single. views are always g1
  bool odometry_levelled = false;  // run.yaml: +z of the odom frame is up
  LocalizeResult result;
  // odom_from_tag, estimated from `result.cameras_odom` and the run's detections; empty: no relative errors.
  std::vector<TagResult> self_tags;
  double self_metre = 1;  // length of a metre in that frame, by these tags
  // What the global fit rests on, one name each ("geotag:S57", "gps:run1", "control:57", "tags:run3"); decides what is
  // shared with a map.
  std::vector<std::string> evidence;
  AnswerCovariances covariances;          // empty: answers' own sigmas, as if independent of each other and of the tags
  std::vector<StructurePoint> structure;  // of the run's sparse model, odom frame; may be empty
  std::map<std::string, double> stitch_sigma;  // panorama -> 1 sigma per axis of its stitched centre, m
  // Panorama -> 1 sigma of its rotation in world, root mean square of the axes.
  std::map<std::string, double> sigma_rot_rad;
};

// A tag map in site ENU that results are held against.
struct ReferenceMap {
  std::string name;                   // as errors.csv shows it: "survey", a variant or a release
  std::vector<TagResult> tags;        // world_from_tag
  std::vector<std::string> runs;      // the runs whose images went into it
  std::vector<std::string> evidence;  // control points, geotags behind it, one name each ("control:57")
  // Of points that were surveyed each by itself, the tag's own evidence: only what shares that shares an error's cause.
  std::map<int, std::string> own_evidence;
  TagCovariances cross;                 // between different tags, where they are given
  std::map<int, std::string> unusable;  // tag -> why it is no reference
};

struct EvaluateInput {
  std::vector<EvaluatedRun> runs;
  std::vector<Station> stations;
  std::vector<ReferenceMap> references;  // may be empty: only relative errors then
  // Stations whose offset comes from their own panoramas: the ground truth shares these with every answer there.
  std::set<std::string> measured_stations;
};

// A row of errors.csv. status is the localizer's (localized, rejected, unmatched), or
//   missing       the result has no row for the station
//   no_reference  it was localized but there is nothing to hold it against; `reason` says why
// Only `localized` rows have errors. `missing`, `rejected` and `unmatched` are abstentions where the row is an attempt.
struct ErrorRow {
  std::string run, variant;
  std::string method;  // g1, g2, single
  std::string station, panorama;
  int tag_id = -1;
  std::string reference;  // self, or ReferenceMap::name
  std::string kind;       // relative, absolute
  std::string status, reason;
  // Does the reference give the station's position? Without it, neither an answer nor an abstention counts.
  bool attempt = true;
  std::optional<double> error_3d_m;
  std::optional<double> error_h_m, error_v_m;  // unset when the vertical of the odom frame is not known
  std::optional<Eigen::Vector3d> error_enu_m;  // estimate - reference; unset when north is not known
  std::optional<double> error_rot_deg;         // set where tags that the panorama shows give its rotation
  std::optional<double> sigma_rot_deg;         // of the difference, root mean square of the axes; unset: not known
  // Of the difference, ENU; unset unless both sides have theirs. Relative: what the cameras have in common taken out.
  std::optional<Eigen::Matrix3d> covariance_m2;
  std::optional<double> nees;  // e' C^-1 e
  int dof = 0;
  std::optional<double> nees_h, nees_v;  // of its horizontal (2) and vertical (1) part
  // The error budget: 1 sigma in space (root of the trace) of each part of the difference; unset where not given.
  std::optional<double> sigma_tag_map_m, sigma_station_offset_m, sigma_stitch_m, sigma_localization_m;
  std::string dominant;  // the largest of them: tag map, station offset, stitch centre, localization
  std::optional<DepthSupport> depth;
  std::optional<bool> trusted;  // unset without structure
  // For joint covariances: the reference's part of the covariance with how it follows from the tag's.
  std::optional<Eigen::Matrix3d> reference_covariance_m2;
  Eigen::Matrix<double, 3, 6> centre_from_tag = Eigen::Matrix<double, 3, 6>::Zero();
  bool passed = false;  // the run came within passed_radius_m of the reference position
  // Both sides rest on the same data (the run's own tags, a map the run went into, a geotag in both): the difference
  // is an agreement, not an accuracy.
  bool shares_evidence = false;
};

// What belongs together in one table and one set of percentiles.
struct ErrorGroup {
  std::string variant, method, reference, kind;
  bool shares_evidence = false;  // kept apart: never in one percentile with independent numbers
  auto operator<=>(const ErrorGroup&) const = default;
};

// Confidence intervals of the percentiles of one component, clustered by station and run; unset with too little data.
struct PercentileIntervals {
  std::optional<Interval> median, p90;                    // over answers
  std::optional<Interval> median_attempts, p90_attempts;  // over attempts, given which were answered
};

struct GroupSummary {
  ErrorGroup group;
  int runs = 0, stations = 0;
  int attempts = 0;  // rows that are one: every station of every run with a reference position
  int answers = 0;   // of these, answered and scored
  int unscored = 0;  // no_reference
  int passed = 0;    // attempts at stations that the run passed
  int passed_answers = 0;
  std::map<std::string, int> reasons;  // of abstentions and unscored answers: "status: reason" -> count
  ErrorStatistics error_3d, error_h, error_v;
  // Bootstrap intervals of the 3D error over answers, clustered by station and run; unset with too little data.
  std::optional<Interval> median_interval, p90_interval;
  PercentileIntervals intervals_3d, intervals_h, intervals_v;
  double station_share = 0, run_share = 0;  // of the variance of log errors
  // Normalised errors: horizontal, vertical, and in space by run and by station; rows taken as independent.
  NeesSummary nees_h, nees_v;
  std::map<std::string, NeesSummary> nees_by_run, nees_by_station;
  // With the covariance between errors that share a cause: a station's reference, tags of one map, a run's global fit.
  std::optional<NeesSummary> nees_joint;
  // The error budget, root mean square of the rows' sigmas, and its largest part.
  std::map<std::string, double> budget_m;
  std::string dominant;
  // Answers that the depth rule does not trust, and the 3D errors of both sides.
  int untrusted = 0;
  ErrorStatistics error_trusted, error_untrusted;
  std::vector<RiskPoint> coverage_risk;  // ordered by DepthSupport::depth_sigma_m
  int nees_count = 0;
  std::optional<double> anees_per_dof;  // sum nees / sum dof over the rows that have it
  // Where it lies with the stated confidence if every sigma is right and rows are independent: chi-square of the summed
  // degrees of freedom, divided by them (Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2).
  std::optional<Interval> anees_bounds;
  std::vector<CumulativePoint> cumulative;  // of the 3D error over attempts, with its band
  // What is behind each side, sorted, without repetition.
  std::vector<std::string> estimate_rests_on, reference_rests_on;
};

struct Evaluation {
  std::vector<ErrorRow> rows;         // ordered by variant, method, reference, kind, run, station
  std::vector<GroupSummary> groups;   // the same order
  std::vector<std::string> stations;  // columns of the tables, in the order of stations.csv
  std::vector<std::string> warnings;  // duplicate stations and the like, one sentence each
  EvaluateOptions options;
};

// Pure function of its input; thread safe. Throws OptionError for options out of range, InputError when there is no
// run. O(rows) plus the bootstrap.
Evaluation Evaluate(const EvaluateInput& input, const EvaluateOptions& options = {});

}  // namespace trigpoint
