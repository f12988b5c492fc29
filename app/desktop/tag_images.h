// The images in which a tag was detected, those first that deserve a look. No Qt here.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

class Project;

struct TagImage {
  std::string image;             // RUN/FILE
  double side_px = 0;            // how large the tag is in it: its diagonal
  std::optional<double> rms_px;  // of its corners from the map's, by the survey
};

enum class TagImageOrder { kLargest, kWorstResidual };

// Detections of all runs. Those the survey states no residual of come last in the order of residuals. Throws InputError
// for a table that cannot be read.
std::vector<TagImage> ImagesOfTag(const Project& project, int tag_id, TagImageOrder order);

}  // namespace trigpoint
