// Loop closure: where a run returns to an earlier place, common points tie both traversals and remove the drift.
#pragma once

#include "localize/references/registration.h"

namespace trigpoint {

struct LoopOptions {
  bool close = true;           // look for loops and close them
  double gap_m = 30;           // path between two traversals, at least
  double radius_m = 3;         // between the cameras of both traversals, as far as is known; and
  double drift_part = 0.003;   // drift of positions beyond the stated noise, as a part of the path, 1 sigma
  double drift_deg_m = 0.002;  // and of directions, a metre
  double angle_deg = 40;       // between the optical axes, at most
  double spacing_m = 1.5;      // path between the images tried
  int candidates = 4;          // images of the earlier visit matched with each
  double gate_chi2 = 22.5;     // of a loop's pose against what tracks and odometry predict: chi-square, 6 dof
  int min_agreeing = 2;        // loops nearby that must agree with it

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.close, {"close", "", 0, 1, "look for loops and close them"});
    visit(self.gap_m, {"gap_m", "m", 1, 1e6, "least path length between two visits of a place"});
    visit(self.radius_m, {"radius_m", "m", 0.01, 1000, "largest distance between cameras of the two visits"});
    visit(self.drift_part, {"drift_part", "", 0, 1, "drift beyond the stated noise, share of the path, 1 sigma"});
    visit(self.drift_deg_m, {"drift_deg_m", "deg/m", 0, 1, "drift of directions beyond the stated noise, 1 sigma"});
    visit(self.angle_deg, {"angle_deg", "deg", 1, 180, "largest angle between the optical axes"});
    visit(self.spacing_m, {"spacing_m", "m", 0.01, 1000, "path length between the images tried"});
    visit(self.candidates, {"candidates", "images", 1, 100, "images of the earlier visit matched with each image"});
    visit(self.gate_chi2,
          {"gate_chi2", "", 1, 10000, "gate of a loop against odometry's prediction: chi-square, 6 dof"});
    visit(self.min_agreeing, {"min_agreeing", "", 0, 100, "nearby loops that must agree with a loop"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct LoopSummary {
  int tried = 0;            // images that may see an earlier traversal
  int found = 0;            // with a pose in it
  int contradicting = 0;    // refused: odometry and tracks say otherwise, or the neighbours do
  int closed = 0;           // images that tie the traversals together
  int merged_points = 0;    // points seen in both
  double correction_m = 0;  // largest movement of a camera by it
};

// Finds where later images see points of earlier traversals, by the rules for references, merges the points and solves
// again. The odometry gates: a facade that looks like another is refused when the drift it implies is not believable.
LoopSummary CloseLoops(const LocalizeInput& input, const LoopOptions& options, const RegistrationOptions& registration,
                       const ReconstructOptions& reconstruct, Reconstruction* reconstruction, int threads,
                       uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
