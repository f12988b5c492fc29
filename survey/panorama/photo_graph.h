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

// Whether the pairs go all the way round, and how far they turn in all when laid end to end.
//
// Along the tree of the strongest pairs each photo has an azimuth that is not wrapped; a pair off the tree whose own
// turn contradicts that by about a full circle closes the ring. Turns of narrow photos go as 1 / focal length, so the
// focal length times `turns` is the one with which the ring closes (Szeliski & Shum 1997, section 5), whatever it was
// begun with.
struct RingClosure {
  bool closed = false;  // pairs worth a fair part of the others close it, and agree with one another
  double turns = 0;     // full circles that the ring's pairs add up to: 1 with the right focal length
};
RingClosure FindClosure(int photos, const std::vector<PhotoPair>& pairs);

}  // namespace trigpoint
