// One solution of several runs of a site: one world, one datum (docs/method.md section 5).
//
// Every run keeps its own odometry, whose length is free, and its own noise of features. What they share is one
// unknown: a panorama, whose geotag counts once, a tag, a point that images of two runs show. Gauge: geotags, GPS,
// control and the tag map, all in the world; covariances are those in the world, between runs, too.
#pragma once

#include <string>
#include <vector>

#include "localize/georegistration/georegistration.h"
#include "localize/georegistration/world_fit.h"
#include "localize/site/join_runs.h"
#include "localize/site/link_runs.h"

namespace trigpoint {

struct SiteOptions {
  LinkOptions links;
  RegistrationOptions registration;  // of images against the points of other runs
  GeoRegistrationOptions geo;
  double outlier_chi2 = 13.8;  // points of two runs become one where all observations are within it (2 dof, 0.1 %)

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.links, {"links", "", 0, 0, "images of different runs that show the same"});
    visit(self.registration, {"registration", "", 0, 0, "such images against the points of the other run"});
    visit(self.geo, {"geo", "", 0, 0, "geotags and GPS"});
    visit(self.outlier_chi2,
          {"outlier_chi2", "", 1, 10000, "points of two runs are joined below this chi-square (2 degrees of freedom)"});
  }
  std::vector<std::string> Check() const;
};

// What joins a run with the others.
struct RunInSite {
  std::string name;
  int images = 0;
  int shared_panoramas = 0, shared_tags = 0, shared_points = 0;
  double scale = 1, scale_sigma = 0;  // true length / odometry's
  double largest_move_m = 0;          // of a camera, against the run by itself
};

struct SiteAdjustment {
  Solution solution;  // in the world; see Solution::runs
  WorldFit fit;
  std::vector<int> tags;  // ids; the poses of the problem from fit.first_tag on are theirs
  std::vector<RunInSite> runs;
  std::vector<std::vector<int>> runs_of_reference;  // of each of the solution's references: the runs that localized it
  int links_tried = 0, links_found = 0, links_refused = 0;
  std::vector<std::string> warnings;
};

// `map`: world_from_tag of a map of tags and control points, by tag, with the map's joint covariance of those that
// stand in `evidence.tags` (sightings: none, they are the runs' tags). evidence.gps: every fix takes part; else those
// of runs that were georeferenced by GPS alone. Throws InputError where no run can be placed, Cancelled. Time and
// memory are linear in the runs where these share what is near. The result does not depend on threads.
SiteAdjustment AdjustSite(std::vector<SiteRun> runs, const WorldEvidence& evidence, const SiteOptions& options,
                          int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
