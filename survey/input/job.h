// What the survey works on, made of a project's files and its runs.
#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "survey/input/reference_tags.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

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

}  // namespace trigpoint
