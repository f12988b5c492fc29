// Where images of one run show what another run has seen.
#pragma once

#include <vector>

#include "localize/references/registration.h"
#include "localize/site/join_runs.h"

namespace trigpoint {

struct LinkOptions {
  bool images = true;     // look for images of different runs that show the same
  double radius_m = 5;    // between their cameras, as far as is known
  double angle_deg = 40;  // between their optical axes, at most
  double spacing_m = 2;   // path between the images tried
  int candidates = 4;     // images of other runs matched with each
  int min_agreeing = 1;   // other links of the run that must agree

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.images, {"images", "", 0, 1, "look for images of different runs that show the same place"});
    visit(self.radius_m, {"radius_m", "m", 0.01, 1000, "largest distance between the cameras of such images"});
    visit(self.angle_deg, {"angle_deg", "deg", 1, 180, "largest angle between their optical axes"});
    visit(self.spacing_m, {"spacing_m", "m", 0.01, 1000, "path length between the images tried"});
    visit(self.candidates, {"candidates", "images", 1, 100, "images of other runs matched with each image"});
    visit(self.min_agreeing, {"min_agreeing", "", 0, 100, "other links of a run that must agree with a link"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct RunLinks {
  int tried = 0, found = 0, refused = 0;
  std::vector<PoseFactor> factors;  // poses of both runs against each other, as one image shows
  PointPairs pairs;
};

// Images of each run against the points of those before it, by the rules for references; what contradicts the other
// links of its run is refused: structure repeats.
RunLinks LinkRuns(const JoinedRuns& joined, const LinkOptions& options, const RegistrationOptions& registration,
                  int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
