// Positions on the Earth as tables state them, read alike in each of them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "datasets/io/input_crs.h"

namespace trigpoint {

// latitude_deg, longitude_deg or crs, easting_m, northing_m; height_m; unit, height_unit.
const std::vector<std::string>& PositionColumns();

struct TablePosition {
  Geodetic position;  // height 0 where none is stated
  bool has_height = false;
};

// A coordinate in metres: in the unit of column `unit` (m, ft, us-ft), or of `height_unit` for a height, where the row
// states one, whatever the column's own name.
double LengthOfRow(const CsvRow& row, const std::string& column);

// The system of column crs, kept for the next row of this thread. Throws InputError naming row and column.
const InputCrs& CrsOfRow(const CsvRow& row);

// None where the row states none. The height is above the ellipsoid, or above what the crs has heights of. Easting and
// northing without a crs are longitude and latitude, as geographic programs write x and y, if both have five decimals
// or more and lie on the Earth. Throws InputError naming row and column.
std::optional<TablePosition> PositionOfRow(const CsvRow& row);

}  // namespace trigpoint
