// The tags that panoramas, photos and stitched photo sets show, for the survey.
#pragma once

#include <string>
#include <vector>

#include "app/pipeline/stages.h"
#include "calib/camera/rig.h"
#include "survey/tags/detection.h"

namespace trigpoint {

struct ReferenceTags {
  ViewRig rig;                  // its views: photos of a set, views cut from a panorama; none where it has no rig yet
  std::vector<ImageTags> tags;  // of each view
  double rig_scale_sigma = 0;   // 1 sigma of a set's rig's size, a share of it
};

// Throws InputError for a picture that cannot be read.
ReferenceTags FindReferenceTags(const Project& project, const Reference& reference, const DetectTagsOptions& options,
                                const StageContext& context);

// What `detect` looks for and how, for its runs and for these.
DetectTagsOptions DetectorOptions(const Project& project, const StageTarget& target);

}  // namespace trigpoint
