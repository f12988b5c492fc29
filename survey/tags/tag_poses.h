// Tag poses from pictures whose camera poses are known.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "datasets/io/site.h"
#include "survey/tags/tag_residual.h"

namespace trigpoint {

// A picture with its camera's pose and the tags found in it.
struct TagView {
  const Camera* camera = nullptr;
  Rigid3d world_from_cam;
  std::optional<Matrix6d> covariance;  // of world_from_cam's left tangent, rotation first
  std::string run;                     // pictures of one run, one visit
  std::vector<TagDetection> detections;
};

struct TagPosesOptions {
  double extra_sigma_px = 0.1;  // added to each corner's sigma in quadrature: what the camera model leaves, px
  double gate_px = 10;          // a picture belongs to a tag's place if its corners are predicted this well, px
  double min_side_px = 12;      // smaller pictures of a tag are not used, px
  int min_images = 2;           // fewer pictures than this give a pose whose status is `weak`
  // Correlation of the camera errors of different pictures, 0 to 1: drift moves neighbouring cameras together.
  double camera_correlation = 1;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.extra_sigma_px, {"extra_sigma_px", "px", 0.0, 10.0, "added to each corner's sigma in quadrature"});
    visit(self.gate_px,
          {"gate_px", "px", 0.1, 1000.0, "a picture with corners farther off shows the tag at another place"});
    visit(self.min_side_px, {"min_side_px", "px", 1.0, 1000.0, "tags with a shorter side in the picture are not used"});
    visit(self.min_images, {"min_images", "", 1, 1000, "with fewer pictures the status of a tag is weak"});
    visit(self.camera_correlation,
          {"camera_correlation", "", 0.0, 1.0, "correlation of the camera errors of different pictures"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// The pose of one tag. status:
//   ok         fixed by at least min_images pictures
//   weak       fewer pictures than that
//   ambiguous  both planar solutions explain the pictures; the better one is given
//   duplicate  pictures of one run show the id at two places; the place with more pictures is given, `reason` has both
//   moved      the same between runs
//   unsolved   no pose; `reason` says why
struct TagEstimate {
  int tag_id = -1;
  std::string family;
  double size_m = 0;  // that the pose rests on: as stated, or as a survey found it
  std::optional<Rigid3d> world_from_tag;
  Matrix6d covariance = Matrix6d::Zero();  // of the left tangent (world axes), rotation first
  int images = 0;                          // pictures that went into the pose
  int rejected = 0;                        // pictures that show the id and do not fit
  int runs = 0;
  double rms_px = 0;          // of the corners, per axis
  std::string role = "free";  // control, check, free
  std::string status;
  std::string reason;
  std::vector<int> views;  // indices of the pictures used, ascending
  // Derivative of the pose by that of each picture's camera (left tangents, world axes): where errors of cameras go.
  std::vector<Matrix6d> by_camera;
  bool HasPose() const { return world_from_tag.has_value(); }
};

// Least squares over each tag's six parameters on all its corners, robust (Huber at a chi-square of 8 degrees of
// freedom), the cameras fixed. Hypotheses come from both planar solutions of every picture; the one that explains most
// pictures is refined. Covariance: (J'WJ)^-1 times the variance factor of the residuals where that is above one, plus
// the cameras' own covariance carried through, with options.camera_correlation between pictures.
// Ascending tag id. Throws OptionError, InputError (a tag without a size), Cancelled. Linear in the pictures of a tag
// (quadratic below 60). Does not depend on the number of threads.
std::vector<TagEstimate> EstimateTagPoses(const std::vector<TagView>& views, const TagSizes& sizes,
                                          const TagPosesOptions& options, int threads, ProgressSink& progress,
                                          const CancelToken& cancel);

}  // namespace trigpoint
