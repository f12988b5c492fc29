// What fixes the map.
#pragma once

#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "datasets/project/project.h"
#include "survey/input/job.h"

namespace trigpoint {

struct DatumOptions {
  std::string datum = "auto";  // what may fix the map
  int fixed_tag = -1;          // datum tag: the tag that is held
  std::string fixed_pose;      // datum tag: its world_from_tag, "x y z qx qy qz qw"; empty: upright at 0, 0, 0
  std::string plane_tags;      // datum plane: ids of tags whose centres lie on one horizontal plane, "3 6 9"
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.datum, {"datum", "", 0, 0,
                       "what fixes the map: auto (control, else geotags, else gps), control, geotags, gps, tag, plane, "
                       "gravity, none"});
    visit(self.fixed_tag, {"fixed_tag", "", -1, 1e6, "datum tag: id of the tag that is held fixed"});
    visit(self.fixed_pose, {"fixed_pose", "", 0, 0, "datum tag: its world_from_tag, \"x y z qx qy qz qw\""});
    visit(self.plane_tags, {"plane_tags", "", 0, 0, "datum plane: tags on one horizontal plane, \"3 6 9\""});
  }
  std::vector<std::string> Check() const;  // of the name of the datum
};

// Adds total stations, surveyed points and geotags to the runs of a job, and what of them fixes the map. Throws
// InputError where what was asked for is not there, OptionError.
void SetDatum(const Project& project, const DatumOptions& options, const CancelToken& cancel, SurveyJob* job);

}  // namespace trigpoint
