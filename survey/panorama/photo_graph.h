// From pairwise rotations to one orientation of every photo: spanning tree, averaging, and what contradicts it.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "survey/panorama/photo_pairs.h"

namespace trigpoint {

struct PhotoGraph {
  std::vector<bool> placed;                      // of the largest connected part
  std::vector<Eigen::Quaterniond> cam_from_rig;  // rig: the most connected photo's camera frame
  std::vector<PhotoPair> pairs;                  // those that agree with it
  std::vector<PhotoPair> contradicting;          // those that don't: repeated textures
  int parts = 0;                                 // connected parts with at least two photos
};

// `pairs`: accepted ones with their rotations and scores. A pair that turns more than `limit_rad` off what the others
// say is dropped (but never less than four times the median disagreement).
PhotoGraph BuildPhotoGraph(int photos, std::vector<PhotoPair> pairs, double limit_rad);

}  // namespace trigpoint
