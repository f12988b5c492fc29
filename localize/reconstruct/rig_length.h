// The length of a run without odometry, from cameras that stand apart on its body. Their distances are known in metres;
// the motion that images of one centre show has no unit.
#pragma once

#include <limits>
#include <vector>

#include "localize/reconstruct/reconstruct.h"
#include "localize/reconstruct/view_graph.h"

namespace trigpoint {

// Indices of the images that share the camera centre of the image listed first for their body pose. The others stand
// apart from it, by more than a millimetre.
std::vector<int> ImagesOfFirstCentre(const LocalizeInput& input);

// `input` with these of its images; all body poses stay.
LocalizeInput OnlyImages(const LocalizeInput& input, const std::vector<int>& images);

struct RigLength {
  double m_per_unit = 1;                                         // true length over that of the reconstruction
  double sigma_share = std::numeric_limits<double>::infinity();  // 1 sigma of it, a share of it
  int matches = 0;                                               // of images that stand apart, with scene points
  // By how many sigmas of an observation (median of the matches) a unit that is taken for a metre puts those of cameras
  // that stand apart in the wrong place, at most (95 %).
  double contradiction_sigmas = std::numeric_limits<double>::infinity();
  bool known = false;  // else the other values are no measurement
};

// `first` is solved from the images of the first centre alone, with image indices of `input`; its unit is unknown.
// Scene points are matched in images that stand apart. A point p in the frame of the first centre (units, body axes) is
// seen there along R (p + a d), where d is the centres' distance (m, body axes) and a = 1 / `m_per_unit`. A bundle
// adjustment of poses, points, a and the rotation of each camera that stands apart (prior: the usual error of a
// calibration) gives a and its sigma, for stretches of long runs; their mean is widened where they differ by more than
// their sigmas.
RigLength LengthByRig(const LocalizeInput& input, const Reconstruction& first, const ViewGraphOptions& pairs,
                      int threads, const CancelToken& cancel);

// odom_from_body of `first` in metres, with the first pose at the origin. The frame's axes stay.
std::vector<Rigid3d> MotionInMetres(const LocalizeInput& input, const Reconstruction& first, double m_per_unit);

}  // namespace trigpoint
