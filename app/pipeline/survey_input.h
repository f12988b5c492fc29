// What the survey works on, from a project's files and the results of other stages.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "app/pipeline/reference_tags.h"
#include "calib/base/path_option.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

struct SurveyStageOptions {
  SurveyOptions map;
  std::string datum = "auto";  // what may fix the map
  int fixed_tag = -1;          // datum tag: the tag that is held
  std::string fixed_pose;      // datum tag: its world_from_tag, "x y z qx qy qz qw"; empty: upright at 0, 0, 0
  std::string plane_tags;      // datum plane: ids of tags whose centres lie on one horizontal plane, "3 6 9"
  bool tie_points = true;      // scene points seen in the pictures tie the cameras
  int ties_per_image = 150;    // the longest tracks, until every picture has so many
  bool nssda = false;          // state 95 % values as the NSSDA asks for
  bool repeatability = true;   // maps of fewer runs and of single days, compared
  bool photo_sets = true;      // stitched photo sets take part, too
  bool stations = true;        // offsets of stations from the tags that their panoramas show
  std::string against;         // a tags.csv, or a variant, to test for moved tags
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    SurveyOptions::Visit(self.map, visit);
    visit(self.datum, {"datum", "", 0, 0,
                       "what fixes the map: auto (control, else geotags, else gps), control, geotags, gps, tag, plane, "
                       "gravity, none"});
    visit(self.fixed_tag, {"fixed_tag", "", -1, 1e6, "datum tag: id of the tag that is held fixed"});
    visit(self.fixed_pose, {"fixed_pose", "", 0, 0, "datum tag: its world_from_tag, \"x y z qx qy qz qw\""});
    visit(self.plane_tags, {"plane_tags", "", 0, 0, "datum plane: tags on one horizontal plane, \"3 6 9\""});
    visit(self.tie_points, {"tie_points", "", 0, 1, "tie the cameras by scene points seen in several pictures"});
    visit(self.ties_per_image, {"ties_per_image", "", 10, 1e6, "scene points per picture, the longest tracks first"});
    visit(self.nssda, {"nssda", "", 0, 1, "state 95 % values by the NSSDA's rule"});
    visit(self.repeatability, {"repeatability", "", 0, 1, "compare maps of fewer runs and of single days"});
    visit(self.photo_sets, {"photo_sets", "", 0, 1, "use the photos of stitched sets for the map, too"});
    visit(self.stations, {"stations", "", 0, 1, "estimate stations' offsets from the tags their panoramas show"});
    visit(self.against,
          PathOption({"against", "", 0, 0, "test which tags moved since: a tags.csv, or a variant's name"},
                     PathKind::kFile));
  }
  std::vector<std::string> Check() const;
};

// Runs that make the map: their role is survey or both.
std::vector<const Run*> SurveyRuns(const Project& project);

// A point surveyed at several epochs: an earlier one against the newest, which is used.
struct EpochDifference {
  std::string point;
  std::string earlier, used;                               // epochs as stated
  Eigen::Vector3d difference_m = Eigen::Vector3d::Zero();  // used minus earlier, world axes
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();       // 1 sigma of it; the epochs taken as independent
  double chi2 = 0;                                         // 3 degrees of freedom
  bool Moved() const { return chi2 > 16.27; }              // 99.9 %
};

// What the surveyed points were given in, each as stated.
struct ControlSystems {
  std::set<std::string> crs, heights, epochs;  // an empty epoch: not stated
  std::vector<EpochDifference> epoch_differences;
};

struct SurveyJob {
  SurveyInput input;
  ControlSystems control;
  bool has_check = false;    // some surveyed points take no part
  bool local_frame = false;  // the surveyed points are in a local frame of their own, which is not georeferenced
  std::string check_note;    // how the check points were chosen, or why there are none
  std::map<std::string, ReferenceTags> sets;  // tags of the photo sets that take part, by name
  std::vector<std::string> warnings;
};

// Detections by run, where they are not those of the stage `detect`.
using DetectionsOfRuns = std::map<std::string, std::vector<ImageDetections>>;

// Do scene points tie this run's images? Its reconstruction is read then.
bool UsesScenePoints(const SurveyStageOptions& options, const Run& run);
// Is the lens of this run's images a guess, in whose place the one is used that its reconstruction has found, if there
// is one? The survey does not ask for that reconstruction: pictures of tags alone have too few features for it.
bool UsesFoundLens(const SurveyStageOptions& options, const Run& run);

// Runs whose odometry `reconstruct` refused, and why: a map cannot rest on it. None where the option check_conventions
// of the map is off.
std::map<std::string, std::string> RunsOfRefusedOdometry(const Project& project, const StageTarget& target,
                                                         const SurveyStageOptions& options);

// Throws InputError, OptionError.
SurveyJob MakeSurveyJob(const Project& project, const StageTarget& target, const SurveyStageOptions& options,
                        StageContext& context, const DetectionsOfRuns* detections = nullptr);

}  // namespace trigpoint
