// From a site's files to the localization's input.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "datasets/io/views.h"
#include "localize/georegistration/world_fit.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/kept_features.h"
#include "localize/references/stitched_sets.h"

namespace trigpoint {

// Input of one run with its GPS; holds the feature stores open.
struct LocalizeJob {
  LocalizeInput input;
  std::vector<GpsPlace> gps;
  std::vector<PreparedReference> references;  // as input.references
  std::map<int, StitchedShape> shapes;        // of those that are a whole photo set: index into references
  std::vector<std::string> warnings;
  int without_odometry = 0;  // images skipped
  int without_features = 0;
};

// The run alone: images with features, and with odometry if the run has any (else every pose is the identity). Throws
// as below.
LocalizeJob MakeRunJob(const Run& run, const std::filesystem::path& run_features);
// `rigs`: folders of stitched rigs by the name of their photo set; a set with one is one reference of many views, else
// every photo is one of its own. `reference_results`: folders of all parts of the references. Throws InputError if
// nothing can be localized (no odometry, no image with it).
LocalizeJob MakeLocalizeJob(const Site& site, const Run& run, bool has_frame, const LocalFrame& frame,
                            const std::filesystem::path& run_features,
                            const std::vector<std::filesystem::path>& reference_results, const ViewOptions& views,
                            const std::map<std::string, std::filesystem::path>& rigs = {});

}  // namespace trigpoint
