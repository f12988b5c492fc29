// Which tags moved between two maps of the same site?
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "eval/errors/results.h"

namespace trigpoint {

struct TagMove {
  int tag_id = -1;
  Eigen::Vector3d moved_m = Eigen::Vector3d::Zero();  // b - a, east, north, up, after the common shift is taken out
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();  // 1 sigma of it, both maps
  double turned_deg = 0;
  std::optional<double> chi2_position, chi2_rotation;  // 3 degrees of freedom each; unset without covariances
  bool moved = false, turned = false;
};

struct EpochTest {
  std::vector<TagMove> tags;  // in both maps, ascending id
  std::vector<int> only_a, only_b;
  // What most tags have in common: the datum's change, not theirs. world_b = shift + rotation about up * world_a.
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  double yaw_deg = 0;
  double critical_chi2 = 0;
  double significance = 0.01;  // of saying anything about any tag if none moved
};

// Robust (Tukey's biweight) common shift and yaw of the tags, then each tag's rest against both maps' covariances,
// taken as independent, at `significance` for all tests together (Bonferroni). Maps that share their control points
// share its error too: the test is then on the safe side. With fewer than four common tags no shift is taken out.
EpochTest TestEpoch(const std::vector<TagResult>& a, const std::vector<TagResult>& b, double significance = 0.01);

std::string FormatEpoch(const EpochTest& test, const std::string& a, const std::string& b,
                        const std::string& unit = "m", double metres_per_unit = 1);
nlohmann::json EpochJson(const EpochTest& test);

}  // namespace trigpoint
