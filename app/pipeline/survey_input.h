// What the survey works on, from a project's files and the results of other stages.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "app/pipeline/stages.h"
#include "calib/base/path_option.h"
#include "survey/input/datum.h"
#include "survey/input/job.h"
#include "survey/input/runs.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

struct SurveyStageOptions : DatumOptions {
  SurveyOptions map;
  bool tie_points = true;     // scene points seen in the pictures tie the cameras
  int ties_per_image = 150;   // the longest tracks, until every picture has so many
  bool nssda = false;         // state 95 % values as the NSSDA asks for
  bool repeatability = true;  // maps of fewer runs and of single days, compared
  bool photo_sets = true;     // stitched photo sets take part, too
  bool stations = true;       // offsets of stations from the tags that their panoramas show
  std::string against;        // a tags.csv, or a variant, to test for moved tags
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    SurveyOptions::Visit(self.map, visit);
    DatumOptions::Visit(self, visit);
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
