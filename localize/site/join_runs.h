// Runs of a site as one problem in the world: each brings its images, points and odometry as `localize` left them; a
// panorama that several of them show is one pose, seen from all of them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/solution/solution.h"
#include "localize/georegistration/world_fit.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

struct SiteRun {
  std::string name;
  LocalizeInput input;
  Solution solution;  // as localized
  std::vector<GpsPlace> gps;
  std::vector<WorldTag> tags;  // that its images show; its own indices of images
};

// world_from_odom of each run: the run that is known best in the world where its own georeference has it, the others
// where the panoramas and tags that they share with runs placed before put them, else by their own, else by the tags of
// the map and control points of `evidence` that they show. Unset: none of these; such a run can take no part. What is
// shared by name but lies elsewhere (an answer of a repeated structure, a tag that was moved) is named in `warnings`.
struct PlacedRun {
  std::optional<Sim3d> world_from_odom;
  std::vector<int> elsewhere;  // indices of its solution's references that lie elsewhere than in the other runs
};
std::vector<PlacedRun> PlaceRuns(const std::vector<SiteRun>& runs, const WorldEvidence& evidence,
                                 std::vector<std::string>* warnings);

struct JoinedRuns {
  LocalizeInput input;            // cameras, images, body poses one after the other; references by name, each once
  Reconstruction reconstruction;  // in the world: body poses, references, turned views
  std::vector<SolutionRun> runs;
  std::vector<int> run_of_image, run_of_point;
  std::vector<SolutionReference> references;        // as input.references
  std::vector<std::vector<int>> runs_of_reference;  // whose observations it has
  std::vector<int> view_of;  // of each observation of a reference: the view of its rig; of others -1
};

// All runs have to be placed. Their solutions are given up. Odometry's lengths are free, one for each run.
// tilt_sigma_rad: how level the frames of odometries are that are not declared to be.
JoinedRuns JoinRuns(std::vector<SiteRun>* runs, const std::vector<PlacedRun>& placed, double tilt_sigma_rad);

// Points of different runs that are said to be one; indices of problem.points.
using PointPairs = std::vector<std::pair<int, int>>;
// Those of one feature of a panorama.
PointPairs PairsByPanoramas(const JoinedRuns& joined);
// Makes them one where a place explains all their observations (chi-square, 2 degrees of freedom, of a single
// observation); the number of points that have gone.
int MergePoints(const PointPairs& pairs, double outlier_chi2, JoinedRuns* joined, int threads,
                const CancelToken& cancel);

}  // namespace trigpoint
