// The motion of a run that has no odometry, from its images alone: incremental structure from motion (Schoenberger &
// Frahm 2016). It is known up to a similarity; a reconstruction starts from it as it does from odometry.
#pragma once

#include <optional>
#include <vector>

#include "localize/reconstruct/view_graph.h"

namespace trigpoint {

struct StructureFromMotionOptions {
  int exhaustive = 60;         // runs of so many images and fewer: all pairs are tried
  int retrieved = 20;          // else of each image: the pairs with those that look most like it
  int neighbours = 4;          // and with those that follow it in time
  int min_matches = 15;        // matches with known points that place an image, at least
  double min_share = 0.25;     // of its matches with known points that must agree on its place
  int tracks_per_image = 400;  // tracks that an image takes part with, the longest first: more are not needed here

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.exhaustive, {"exhaustive", "images", 2, 1000, "runs of up to this many images: all pairs are tried"});
    visit(self.retrieved, {"retrieved", "images", 1, 1000, "pairs of an image with the images most similar to it"});
    visit(self.neighbours, {"neighbours", "images", 0, 100, "pairs of an image with the images that follow it"});
    visit(self.min_matches, {"min_matches", "matches", 6, 1000, "matches with known points needed to place an image"});
    visit(self.min_share, {"min_share", "", 0, 1, "share of the matches that must agree on an image's place"});
    visit(self.tracks_per_image, {"tracks_per_image", "tracks", 50, 100000, "longest tracks used of each image"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct ImageMotion {
  // Of each body pose; nothing where its images could not be placed. Frame: the first placed pose. Length: the median
  // distance of points from the images that see them is kUsualDepth, as if m. The cameras of a rig share one centre.
  static constexpr double kUsualDepth = 10;
  std::vector<std::optional<Rigid3d>> odom_from_body;
  int pairs_tried = 0, pairs_verified = 0;
  int placed = 0;  // poses
};

// Turns the motion about its first placed pose so that z is up: bodies stand upright, and cameras whose place on a body
// nobody has stated are held with little roll and about level, or look straight down. `tops`: of each image, the
// direction that is up in its picture, camera frame. Where the images contradict each other the motion stays as it is.
void LevelMotion(const LocalizeInput& input, const std::vector<Eigen::Vector3d>& tops, ImageMotion* motion);

// Reads images, cameras and times of `input`, not its odometry. Throws InputError where no two images fit each other.
// Deterministic for a seed, with any number of threads.
ImageMotion MotionFromImages(const LocalizeInput& input, const StructureFromMotionOptions& options,
                             const ViewGraphOptions& pairs, int threads, uint64_t seed, ProgressSink& progress,
                             const CancelToken& cancel);

}  // namespace trigpoint
