// Options of detecting tags, for the stages that look for tags in other pictures than a run's.
#pragma once

#include "app/pipeline/stages.h"
#include "survey/tags/detection.h"

namespace trigpoint {

// What `detect` looks for and how, for its runs and for panoramas, photos and photo sets.
DetectTagsOptions DetectorOptions(const Project& project, const StageTarget& target);

}  // namespace trigpoint
