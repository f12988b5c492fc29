// Positions on the Earth as tables state them, read alike in each of them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"

namespace trigpoint {

// latitude_deg, longitude_deg or crs, easting_m, northing_m; height_m.
const std::vector<std::string>& PositionColumns();

struct TablePosition {
  Geodetic position;  // height 0 where none is stated
  bool has_height = false;
};

// None where the row states none. Easting and northing without a crs are longitude and latitude, as geographic
// programs write x and y, if both have five decimals or more and lie on the Earth. Throws InputError naming row and
// column.
std::optional<TablePosition> PositionOfRow(const CsvRow& row);

}  // namespace trigpoint
