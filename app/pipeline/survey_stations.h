// Offsets of stations from the tags that their panoramas show, for the survey.
#pragma once

#include <vector>

#include "app/pipeline/stages.h"
#include "survey/tags/station_offset.h"

namespace trigpoint {

// Every panorama, photo and stitched photo set that stations.csv has a tag for, in the order of the references. A file
// that cannot be read is named in the log and left out.
std::vector<StationOffset> MeasureStations(const Project& project, const std::vector<TagEstimate>& map,
                                           StageContext& context);

}  // namespace trigpoint
