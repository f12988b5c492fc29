// Is a tag as large, as square and as flat as it is said to be?
#pragma once

#include <vector>

#include "survey/tags/tag_poses.h"

namespace trigpoint {

// Three more unknowns beside a tag's pose, from all its pictures with the cameras held; 1 sigma each, from the
// residuals where those are larger than stated.
struct TagShape {
  int tag_id = -1;
  int images = 0;
  double edge_m = 0;                      // as stated
  double size_ratio = 1, size_sigma = 0;  // edge found / edge stated
  double aspect = 1, aspect_sigma = 0;    // height / width
  double twist_m = 0, twist_sigma_m = 0;  // corners 0 and 2 that far behind the sheet's plane, 1 and 3 before it
  bool SizeIsWrong() const;
  bool IsBent() const;  // not square or not flat: a sheet that is bent, or was scaled in one direction
};

// `tags`: with poses and `views` of EstimateTagPoses. Tags with fewer than four pictures are left out. What shows a
// size is that the cameras' distances are known by something else than this tag: odometry, scene points, other tags.
std::vector<TagShape> MeasureTagShapes(const std::vector<TagView>& views, const std::vector<TagEstimate>& tags,
                                       double extra_sigma_px);

// One factor on the edges of all tags: how long a metre is in the frame of the cameras, whose distances images alone do
// not fix.
struct CommonRatio {
  double ratio = 1, sigma = 0;  // 1 sigma; from the tags' scatter where that is larger
  int tags = 0;
};

// The weighted mean of the tags' size ratios and a prior of 1 with `prior_sigma`, with Huber's weights: single tags of
// another size than stated do not move it.
CommonRatio CommonSizeRatio(const std::vector<TagShape>& shapes, double prior_sigma);

}  // namespace trigpoint
