// What `plan` works on: a sketch of the site, or the site as it was surveyed.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/path_option.h"
#include "datasets/io/site_sketch.h"
#include "datasets/project/project.h"
#include "datasets/project/stage.h"
#include "survey/network/network.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

struct PlanOptions {
  NetworkOptions network;
  std::string sketch;        // plan.csv or plan.geojson of this name; empty: those, else the site as it was surveyed
  bool earlier_runs = true;  // where a sketch adds to a surveyed site: its runs count, too; else its tags' places alone
  std::string camera;   // of sketched paths: a calibration's name or a camchain file; empty: fov_deg, width, height
  double fov_deg = 90;  // horizontal field of view
  int width = 1920, height = 1080;
  std::string camera_yaws_deg = "0";  // cameras on the body, degrees to the left of its way: "0 180"
  double speed_m_s = 1;
  double rate_hz = 2;
  double control_sigma_h_m = 0.01, control_sigma_v_m = 0.015;  // of control that is suggested
  double max_tag_sigma_m = 0;                                  // gates; 0: no such gate
  double max_camera_sigma_m = 0;
  double min_redundancy = 0;
  std::string suggest;  // tags, control, path; empty: the ranking alone
  int count = 1;        // how many of them
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    NetworkOptions::Visit(self.network, visit);
    visit(self.sketch,
          PathOption({"sketch", "", 0, 0, "the sketch; empty: plan.csv, plan.geojson, else the site as surveyed"},
                     PathKind::kFile));
    visit(self.earlier_runs,
          {"earlier_runs", "", 0, 0, "where a sketch adds to a surveyed site: use the observations of its runs, too"});
    visit(self.camera, PathOption({"camera", "", 0, 0, "of sketched paths: a calibration's name or a camchain file"},
                                  PathKind::kFile));
    visit(self.fov_deg, {"fov_deg", "deg", 5.0, 170.0, "horizontal field of view, where no camera is named"});
    visit(self.width, {"width", "px", 16, 1e5, "width of a picture, where no camera is named"});
    visit(self.height, {"height", "px", 16, 1e5, "height of a picture, where no camera is named"});
    visit(self.camera_yaws_deg,
          {"camera_yaws_deg", "deg", 0, 0, "cameras on the body, to the left of its way: \"0 180\""});
    visit(self.speed_m_s, {"speed_m_s", "m/s", 0.01, 50.0, "along sketched paths"});
    visit(self.rate_hz, {"rate_hz", "Hz", 0.01, 200.0, "pictures a second along sketched paths"});
    visit(self.control_sigma_h_m, {"control_sigma_h_m", "m", 1e-4, 100.0, "1 sigma per axis of suggested control"});
    visit(self.control_sigma_v_m, {"control_sigma_v_m", "m", 1e-4, 100.0, "1 sigma of its height"});
    visit(self.max_tag_sigma_m, {"max_tag_sigma_m", "m", 0.0, 100.0, "gate: 3D sigma of the weakest tag; 0: none"});
    visit(self.max_camera_sigma_m,
          {"max_camera_sigma_m", "m", 0.0, 100.0, "gate: 95th percentile of the cameras' 3D sigma; 0: none"});
    visit(self.min_redundancy,
          {"min_redundancy", "", 0.0, 1.0, "gate: redundancy of the least controlled known point; 0: none"});
    visit(self.suggest, {"suggest", "", 0, 0, "what to propose: tags, control, path"});
    visit(self.count, {"count", "", 1, 20, "how many of them"});
  }
  std::vector<std::string> Check() const;
};

struct PlanStationItem {
  std::string name;
  int tag_id = -1;
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();  // of its centre from the tag's, world axes
  double sigma_m = 0.01;
};

struct PlanLayout {
  NetworkLayout network;
  std::string source;  // "plan.csv", "the survey of 2 runs"
  std::vector<PlanStationItem> stations;
  std::map<std::string, Rigid3d> candidates;  // places for tags that were sketched
  std::vector<PlannedPass> candidate_passes;  // paths that were sketched, but are not planned
  double candidate_size_m = 0;
  bool learned = false;            // from an earlier survey, with its noise
  NetworkOptions noise;            // the options' own, or as that survey found it
  std::map<int, int> images_seen;  // pictures of each tag in that survey
  std::vector<std::string> notes;
};

// The sketch's file, empty if there is none. Throws InputError where the options name one that is not there.
std::filesystem::path SketchFile(const Project& project, const PlanOptions& options);
// Does a sketch without tags add to the site as it was surveyed: paths, known points, places for tags?
bool AddsToSurvey(const std::vector<SketchItem>& items, bool has_survey_runs);

// The site as its survey runs show it: tags and odometry alone, which is enough to know where everything is. `to_add`:
// a sketch that is added to it, which takes a datum. Throws InputError.
PlanLayout LayoutOfSurvey(const Project& project, const SurveyInput& input, const NetworkOptions& noise,
                          const std::filesystem::path& to_add, StageContext& context);
// The items of the sketch `file`, added to `plan`: an empty one, or the site as it was surveyed. Throws InputError.
PlanLayout LayoutOfSketch(const Project& project, const std::filesystem::path& file,
                          const std::vector<SketchItem>& items, const PlanOptions& options, PlanLayout plan);
// Of a map that was made of `input`: with its noise, and pictures it did not place put where odometry has them.
PlanLayout LayoutOfMap(const Project& project, const SurveyInput& input, const SurveyResult& map,
                       const NetworkOptions& noise);
// world_from_tag of an upright tag whose printed side faces `heading_rad`, clockwise from north.
Rigid3d UprightTag(const Eigen::Vector3d& centre, double heading_rad);
// Poses of a body that moves along corners at constant speed; `way_from_body`: how it is turned against its way (x
// along it, level; z up).
std::vector<TimedPose> PosesAlong(const std::vector<Eigen::Vector3d>& corners, double speed_m_s, double rate_hz,
                                  const Eigen::Quaterniond& way_from_body = Eigen::Quaterniond::Identity());
// The mean of way_from_body over a pass; none where it does not keep its attitude along its way.
std::optional<Eigen::Quaterniond> WayFromBody(const std::vector<TimedPose>& poses);

}  // namespace trigpoint
