// Photo sets in the localization: the photos as views with their own centres, and what the run's points say about
// these.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "app/pipeline/localize_files.h"
#include "datasets/project/project.h"
#include "survey/panorama/refine_rig.h"

namespace trigpoint {

// What became of one photo set's rig.
struct SetRefinement {
  int reference = 0;  // index into LocalizeJob::references
  std::string name;
  RigFreedom freedom = RigFreedom::kFixed;
  std::vector<double> hold_out;  // px, of fixed, scaled, prior, free; empty if not asked for
  RefinedRig rig;
};

// Refines the rig of every photo set that was registered, against the points of the run and the other references:
// places of photos relative to each other, size of the whole, pose of its centre (the mean of the photos' centres). It
// replaces `references` and `registrations`. A set whose rig had the wrong size to be registered at all is tried at
// others; one that would need a size that stitching rules out is refused. `mode`: auto, fixed (nothing is done),
// scaled, prior, free.
std::vector<SetRefinement> RefineSets(const LocalizeJob& job, const RegistrationOptions& options,
                                      const std::string& mode, const Reconstruction& reconstruction,
                                      const Retrieval& retrieval, uint64_t seed, ProgressSink& progress,
                                      const CancelToken& cancel, std::vector<ReferenceViews>* references,
                                      std::vector<Registration>* registrations);

// rigs.csv: every photo of every refined set, relative to its rig and in the world. Throws IoError.
void WriteRigs(const std::vector<SetRefinement>& sets, const Localization& result, const std::filesystem::path& dir);

// The stitched rigs there are, by the name of their set: results/stitch/<set>.
std::map<std::string, std::filesystem::path> StitchedRigs(const Project& project);

}  // namespace trigpoint
