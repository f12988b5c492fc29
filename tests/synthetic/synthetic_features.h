// Features for sites without pixels: every point has a descriptor of its own, so that the whole localization, matching
// included, runs on observations whose noise is known exactly.
#pragma once

#include "datasets/colmap/database.h"
#include "tests/synthetic/synthetic_site.h"

namespace trigpoint {

// Features in the order of the observations; a wrong observation keeps its point's descriptor.
FeatureSet SyntheticImageFeatures(const SyntheticSite& site, int image);
// Features of one view, in the order of the panorama's observations of that view.
FeatureSet SyntheticViewFeatures(const SyntheticSite& site, int panorama, int view);

}  // namespace trigpoint
