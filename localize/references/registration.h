// The pose of a reference (panorama, photo) in the run's frame (docs/method.md sections 3 and 4).
#pragma once

#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/references/stretched.h"
#include "localize/references/view_retrieval.h"

namespace trigpoint {

struct RegistrationOptions {
  int candidates = 12;        // images matched with a reference, the best of the retrieval
  double passage_m = 30;      // images of one traversal: longest path between them
  int candidate_spacing = 2;  // images of one camera at least so many apart, where they are close together
  double ratio = 0.85;        // ratio test between image and view (paper: 0.7)
  double max_distance = 0.8;  // largest distance of unit descriptors
  double ransac_px = 8;       // threshold of the first pose, px of a view (trajectory drift included)
  int ransac_iterations = 2000;
  double guided_px = 12;               // search radius about a predicted point, px of a view
  int guided_images = 24;              // images near the reference whose points are searched for
  double sigma_px = 1.0;               // noise of a point in a view, 1 sigma
  double outlier_chi2 = 13.8;          // observations beyond it are dropped (2 dof, 0.1 %)
  int min_inliers = 20;                // fewer: not localized
  int min_contradicted_inliers = 100;  // fewer, and its geotag contradicts it: not localized
  double min_matched_share = 0.06;     // of the points that should be seen, so many must be found
  double min_agreement = 0.1;          // share of the matches that must agree on the pose; chance reaches some percent
  double rival_share = 0.3;          // another pose that explains more than this share of what the best does: ambiguous
  double rival_support_share = 0.6;  // the same for the points found where the pose predicts them
  double max_distance_m = 30;        // from the nearest camera
  double max_sigma_m = 1;            // largest position sigma (worst axis) of an answer
  double set_radius_m = 1.0;         // the photos of a set were taken within it of each other
  double homography_px = 4;          // RANSAC threshold of the paper's homography
  int homography_images = 5;         // images that speak for a view, those with the most matches (paper mode)
  int homography_min_inliers = 12;   // views with fewer matches are not used (paper mode)

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.candidates, {"candidates", "images", 1, 1000, "images matched with a reference"});
    visit(self.passage_m, {"passage_m", "m", 0.1, 1e6, "longest path between two images of one traversal"});
    visit(self.candidate_spacing, {"candidate_spacing", "images", 1, 1000,
                                   "images between two candidates of one camera that are close together"});
    visit(self.ratio, {"ratio", "", 0.3, 1.0, "ratio test between image and view"});
    visit(self.max_distance, {"max_distance", "", 0.1, 1.4, "largest distance of unit descriptors"});
    visit(self.ransac_px, {"ransac_px", "px", 0.5, 100, "inlier threshold of the first pose"});
    visit(self.ransac_iterations, {"ransac_iterations", "", 10, 1000000, "most RANSAC samples of the first pose"});
    visit(self.guided_px, {"guided_px", "px", 1, 200, "search radius about a predicted point"});
    visit(self.guided_images,
          {"guided_images", "images", 1, 1000, "images near a reference whose points are searched for"});
    visit(self.sigma_px, {"sigma_px", "px", 0.01, 50, "noise of a point in a view, 1 sigma"});
    visit(self.outlier_chi2, {"outlier_chi2", "", 1, 10000, "observations above this chi-square (2 dof) are dropped"});
    visit(self.min_inliers, {"min_inliers", "", 6, 10000, "with fewer inliers a reference is not localized"});
    visit(self.min_contradicted_inliers,
          {"min_contradicted_inliers", "", 6, 10000,
           "with fewer inliers a reference that its geotag contradicts is not localized"});
    visit(self.min_matched_share, {"min_matched_share", "", 0, 1, "share of expected points that must be found"});
    visit(self.min_agreement, {"min_agreement", "", 0, 1, "share of the matches that must agree on the pose"});
    visit(self.rival_share,
          {"rival_share", "", 0, 1, "another pose with more than this share of the matches: ambiguous"});
    visit(self.rival_support_share, {"rival_support_share", "", 0, 1,
                                     "another pose with more than this share of predicted points found: ambiguous"});
    visit(self.max_distance_m, {"max_distance_m", "m", 0.1, 10000, "largest distance from the nearest camera"});
    visit(self.max_sigma_m, {"max_sigma_m", "m", 0.001, 1000, "largest position sigma of an answer, worst axis"});
    visit(self.set_radius_m, {"set_radius_m", "m", 0.01, 100, "largest distance between two photos of a set"});
    visit(self.homography_px, {"homography_px", "px", 0.5, 100, "threshold of the homography (paper mode)"});
    visit(self.homography_images,
          {"homography_images", "images", 1, 1000, "images that must match a view (paper mode)"});
    visit(self.homography_min_inliers, {"homography_min_inliers", "", 4, 10000, "matches a view needs (paper mode)"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

enum class AnswerStatus { kLocalized, kRejected, kUnmatched };
std::string_view AnswerStatusName(AnswerStatus status);

// A point seen in a view of a reference.
struct ViewObservation {
  int view = 0;
  int feature = 0;
  int point = 0;  // of the reconstruction
  int image = 0;  // the run's image it was matched with
  Eigen::Vector2f pixel;
  bool repeated = false;  // the same point is used in another view of the same centre: no new evidence
  double weight = 1;      // probability that it is no chance match
};

// G1: one view by itself.
struct ViewAnswer {
  AnswerStatus status = AnswerStatus::kUnmatched;
  std::string reason;
  Rigid3d view_from_odom;
  int inliers = 0;
  double distance_m = 0;
};

struct Registration {
  AnswerStatus status = AnswerStatus::kUnmatched;
  std::string reason;
  Rigid3d rig_from_odom;
  Matrix6d covariance = Matrix6d::Zero();  // of rig_from_odom with the points held
  std::vector<ViewObservation> inliers;
  std::vector<ViewAnswer> views;
  int view_matches = 0;  // matches before the geometry decided
  int agreeing = 0;      // of view_matches, with the best pose
  int rival = 0;         // with the best pose elsewhere
  double rival_support = 0;
  double rival_distance_m = 0;
  double support = 0;        // points found where the pose predicts them, beyond what chance would find
  double matched_share = 0;  // support as a share of the points that should be seen
  double distance_m = 0;     // to the nearest camera
  StretchVotes stretch;      // by some of the matches, of localized panoramas
};

// References against the points: all, or `some`, indices into them; answers in their order. paper: views by homography,
// G1 per view, G2 with connected views.
std::vector<Registration> RegisterReferences(const LocalizeInput& input, const Reconstruction& reconstruction,
                                             const Retrieval& retrieval, const RegistrationOptions& options, bool paper,
                                             int threads, uint64_t seed, ProgressSink& progress,
                                             const CancelToken& cancel, const std::vector<size_t>* some = nullptr);

// An image of the run that may show what an earlier traversal has seen.
struct LoopQuery {
  int image = 0;
  std::vector<int> candidates;  // images of the earlier traversal
  double latest_m = 0;          // length of path at which the earlier traversal ends for this image
};
// cam_from_odom (as rig_from_odom) of the images in the frame of the earlier traversal's points, by the same rules.
std::vector<Registration> RegisterImages(const LocalizeInput& input, const Reconstruction& reconstruction,
                                         const std::vector<LoopQuery>& queries, const RegistrationOptions& options,
                                         int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
