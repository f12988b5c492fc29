// Photo sets in the localization: the photos as views with their own centres, and what the run's points say about
// these.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/references/refine_rig.h"
#include "localize/references/registration.h"
#include "localize/references/view_retrieval.h"

namespace trigpoint {

// What stitching knows of a photo set's rig beyond its views.
struct StitchedShape {
  Eigen::MatrixXd covariance;  // of all views' [turn (rad), centre (m)] if the rig's size were known
  double log_scale_sigma = 0;  // 1 sigma of ln(size)
};

// What became of one photo set's rig.
struct SetRefinement {
  int reference = 0;  // index into LocalizeInput::references
  std::string name;
  RigFreedom freedom = RigFreedom::kFixed;
  std::vector<double> hold_out;  // px, of fixed, scaled, prior, free; empty if not asked for
  RefinedRig rig;
};

// Refines the rig of every photo set that was registered, against the points of the run and the other references:
// places of photos relative to each other, size of the whole, pose of its centre (the mean of the photos' centres). It
// replaces `references` and `registrations`. A set whose rig had the wrong size to be registered at all is tried at
// others; one that would need a size that stitching rules out is refused. `shapes`: of these sets, by the index of
// their reference. `mode`: auto, fixed (nothing is done), scaled, prior, free.
std::vector<SetRefinement> RefineSets(const LocalizeInput& input, const std::map<int, StitchedShape>& shapes,
                                      const RegistrationOptions& options, const std::string& mode,
                                      const Reconstruction& reconstruction, const Retrieval& retrieval, uint64_t seed,
                                      ProgressSink& progress, const CancelToken& cancel,
                                      std::vector<ReferenceViews>* references,
                                      std::vector<Registration>* registrations);

}  // namespace trigpoint
