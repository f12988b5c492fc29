// What a project's results hold, as far as they are there: read leniently, so that results of an older or newer version
// and broken ones still tell what they can. Everything that could not be read is named in `notes`.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/io/views.h"
#include "datasets/project/project.h"
#include "eval/report/error_run.h"
#include "eval/text/json_values.h"

namespace trigpoint {

// One result as the stage runner knows it.
struct ResultRecord {
  std::string stage, name;  // "localize", "run1@paper"
  std::string state;        // done, out of date, failed, missing, not needed
  std::string reason;
  nlohmann::json manifest;  // null: there is none
};

struct ReportInput {
  const Project* project = nullptr;
  std::vector<std::string> variants = {""};  // results/<stage>/<run>@<variant>
  std::vector<ResultRecord> stages;
  ViewOptions views;             // how the panoramas' views were drawn
  std::string command;           // that makes the report again
  bool points = true;            // also read each run's sparse model, which takes a while
  nlohmann::json default_gates;  // as gates.json, for a project without gates of its own; else null
};

// A row of errors.csv; what is not given is unset.
struct ErrorRecord {
  std::string run, variant, method, station, panorama, reference, kind, status, reason, dominant, trusted;
  int tag_id = -1;
  std::optional<double> error_3d_m, error_h_m, error_v_m, sigma_e_m, sigma_n_m, sigma_u_m, nees, depth_sigma_m;
  std::optional<Eigen::Vector3d> error_enu_m;
  int dof = 0;
  bool shares_evidence = false;
  bool Answered() const { return status == "localized" && error_3d_m.has_value(); }
};

// A table of `evaluate` that this version has no chapter for.
struct FurtherTable {
  std::string name, comment;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  size_t left_out = 0;
};

struct VariantData {
  std::string variant;
  nlohmann::json summary;  // summary.json of evaluate; null: none
  std::vector<ErrorRecord> errors;
  std::vector<FurtherTable> further;
};

// One localize result.
struct RunData {
  std::string run, variant;
  nlohmann::json manifest;  // may be null
  struct Answer {
    std::string panorama, station, status, reason, geotag_status;
    int inliers = 0, matches = 0, views = 0;
    std::optional<double> sigma_m;       // largest axis
    std::optional<double> geotag_off_m;  // geotag minus estimate, horizontal
    std::optional<double> geotag_up_m;   // the same, up
    std::optional<double> sigma_h_m;     // of the estimate, larger horizontal axis
    std::optional<double> sigma_v_m;
    std::optional<Eigen::Vector3d> place_m;  // in site ENU
  };
  std::vector<Answer> answers;
  // Points of the sparse model, a sample of them where there are many.
  struct PointQuality {
    std::optional<double> residual_px;  // mean over its images
    double track_length = 0;            // images that see it
    std::string object;                 // "point:run1/123"; empty in a variant, whose points no desk shows
  };
  std::vector<PointQuality> points;
  // Of each image in the order of time: the mean over the points it sees of their reprojection errors.
  struct ImageResidual {
    double time_s = 0;  // since the run began
    double mean_px = 0;
    std::string object;  // "image:run1/images/000012.jpg"
  };
  std::vector<ImageResidual> image_residuals;
};

struct TagLine {
  int id = -1;
  std::string source, role, status;
  double size_m = 0;
  std::optional<double> sigma_m, rms_px;  // sigma: largest axis
  std::optional<Eigen::Vector3d> place_m, sigmas_m;
  int images = 0, runs = 0;
};

// A trajectory against the reference poses: an entry of estimates.json, and its images.
struct TrajectoryScore {
  nlohmann::json summary;
  std::vector<ErrorAlong> images;
};

// A result of stitch.
struct StitchedSet {
  std::string name;
  nlohmann::json metrics;
  std::filesystem::path panorama;  // empty: only the rig was made
};

struct ReportData {
  std::vector<VariantData> variants;
  std::vector<RunData> runs;
  std::vector<TagLine> tags;
  std::vector<StitchedSet> stitched;
  std::vector<TrajectoryScore> trajectories;  // of the first evaluation
  // gates.json of each variant that has one.
  std::vector<std::pair<std::string, nlohmann::json>> gates;
  nlohmann::json survey;              // summary.json of the first survey; null: none
  std::vector<std::string> stations;  // in the order of stations.csv, then those only results know
  std::vector<nlohmann::json> reviews;
  std::vector<std::string> notes;
  std::string newest;  // end of the newest result, UTC; empty: none
};

ReportData ReadReportData(const ReportInput& input, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
