// Two tag maps against each other: which tags moved between two surveys, and how well surveys repeat.
#pragma once

#include <string>
#include <vector>

#include "survey/tags/tag_map.h"

namespace trigpoint {

struct TagChange {
  int tag_id = -1;
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();  // now - before, world axes of `now`
  double turn_deg = 0;
  double chi2 = 0;  // 6 degrees of freedom
  bool moved = false;
};

struct SurveyEpochs {
  bool aligned = false;  // the maps have datums of their own: a rigid fit that most tags agree on was applied first
  std::vector<TagChange> tags;  // in both maps, ascending id
  std::string problem;          // why nothing could be tested
};

// Difference of every common tag against both maps' covariances in quadrature, chi-square at `significance` (two-sided
// probability of a false alarm of a tag, 0.001). Maps of the same datum are compared as they are, others after a robust
// rigid fit; then what moved is what most tags do not share.
SurveyEpochs TestEpochs(const std::vector<TagEstimate>& before, const std::vector<TagEstimate>& now, bool same_datum);

// How far maps made of other pictures lie apart.
struct Repeatability {
  int maps = 0;         // maps that were compared
  int differences = 0;  // tags compared, over all maps
  double rms_m = 0;     // root mean square distance of a tag, one map against the other
};

// Root mean square of common tags' distances over several pairs of maps, pooled. Maps without a world datum are fitted
// to each other first.
Repeatability CompareMaps(const std::vector<std::pair<SurveyResult, SurveyResult>>& pairs);

}  // namespace trigpoint
