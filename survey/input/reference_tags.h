// The tags that panoramas, photos and stitched photo sets show, for the survey.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calib/camera/rig.h"
#include "datasets/project/stage.h"
#include "survey/tags/detection.h"

namespace trigpoint {

struct ReferenceTags {
  ViewRig rig;                  // its views: photos of a set, views cut from a panorama; none where it has no rig yet
  std::vector<ImageTags> tags;  // of each view
  double rig_scale_sigma = 0;   // 1 sigma of a set's rig's size, a share of it
};

// Where the stitched rigs of photo sets lie, by the name of their set.
using RigFolders = std::map<std::string, std::filesystem::path>;

// Throws InputError for a picture that cannot be read.
ReferenceTags FindReferenceTags(const Reference& reference, const RigFolders& rigs, const DetectTagsOptions& options,
                                const StageContext& context);

}  // namespace trigpoint
