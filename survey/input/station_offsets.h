// Offsets of stations from the tags that their panoramas show, for the survey.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "survey/input/reference_tags.h"
#include "survey/tags/station_offset.h"

namespace trigpoint {

// Every panorama, photo and stitched photo set that stations.csv has a tag for, in the order of the references. `found`
// are tags of references, by name, that were looked for already. A file that cannot be read is named in the log and
// left out.
std::vector<StationOffset> MeasureStations(const Project& project, const std::vector<TagEstimate>& map,
                                           const std::map<std::string, ReferenceTags>& found, const RigFolders& rigs,
                                           const DetectTagsOptions& options, StageContext& context);

}  // namespace trigpoint
