// Rows of poses `timestamp tx ty tz` and a quaternion, whose w comes last (TUM) or first (EuRoC).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/io/lines.h"

namespace trigpoint {

// Of a row with commas or blanks; commas after the last value separate nothing.
std::vector<std::string_view> PoseFields(std::string_view row);

struct PoseRows {
  std::vector<DataLine> lines;  // without a header
  bool w_first = false;
};
// A header that names qx, qy, qz and qw gives the order. Without one, rows with blanks are TUM's, and in rows with
// commas the number of columns or the motion shows it. They refer to `text`, which must outlive them. Throws InputError
// where nothing shows the order, and for decimal commas.
PoseRows FindPoseRows(const std::filesystem::path& file, std::string_view text);

}  // namespace trigpoint
