// Panoramas whose pictures are stretched in height: without sky and ground, and enlarged to 2:1 all the same. Near the
// horizon they fit a pose, which is wrong.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

namespace trigpoint {

// Elevations in the picture are `factor` times the true ones.
constexpr int kStretchFactors = 19;
double StretchFactor(int k);  // 0.62 to 1.62 in steps of 5.5 %: midway, what is 20 deg up is off by half a degree

// How many matches agree on a pose.
struct StretchVotes {
  int as_it_is = 0;
  std::vector<int> stretched;  // by factor; empty: not counted
};

// rays: unit, rig frame (y down); points: any frame; threshold: largest angle of a match that agrees, rad.
std::vector<int> VoteForStretch(const std::vector<Eigen::Vector3d>& rays, const std::vector<Eigen::Vector3d>& points,
                                double threshold, uint64_t seed);

// The factor with which clearly more matches agree than without.
std::optional<int> StretchShown(const StretchVotes& votes);

}  // namespace trigpoint
