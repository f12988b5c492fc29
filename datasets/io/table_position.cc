#include "datasets/io/table_position.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

// Degrees are written with as many: the fifth decimal is a metre. Metres are not, the fifth is a hundredth of a
// millimetre.
constexpr size_t kDecimalsOfDegrees = 5;

size_t Decimals(const std::string& number) {
  const size_t point = number.find('.');
  return point == std::string::npos ? 0 : number.size() - point - 1;
}

Geodetic FromCrs(const CsvRow& row, double height) {
  std::string crs = row.Text("crs");
  if (crs.starts_with("EPSG:") || crs.starts_with("epsg:")) crs.erase(0, 5);
  const int code = static_cast<int>(ParseInt(crs).value_or(0));
  const double east = row.Number("easting_m"), north = row.Number("northing_m");
  if (code == 4326 || code == 4979) return {north, east, height};
  if (crs.empty() && std::abs(east) <= 180 && std::abs(north) <= 90 &&
      std::min(Decimals(row.Text("easting_m")), Decimals(row.Text("northing_m"))) >= kDecimalsOfDegrees) {
    return {north, east, height};
  }
  // ETRS89's ellipsoid is that of WGS 84 to a tenth of a millimetre; the plate has carried it off by less than a metre,
  // which is part of the shift that is estimated between control and satellites.
  const bool etrs89 = code >= 25828 && code <= 25838;
  const bool northern = etrs89 || (code > 32600 && code <= 32660), southern = code > 32700 && code <= 32760;
  if (!northern && !southern) {
    throw InputError(
        row.Where("crs") +
        ": expected EPSG:326zz or EPSG:327zz (UTM on WGS 84), EPSG:258zz (on ETRS89) or EPSG:4326, found '" +
        row.Text("crs") +
        "'; other systems need their datum's transformation, which is not built in: convert the points first");
  }
  try {
    return GeodeticFromUtm({code % 100, northern, east, north}, height);
  } catch (const InputError& e) {
    row.Fail(e.what());
  }
}

}  // namespace

const std::vector<std::string>& PositionColumns() {
  static const std::vector<std::string> columns = {"latitude_deg", "longitude_deg", "height_m",
                                                   "crs",          "easting_m",     "northing_m"};
  return columns;
}

std::optional<TablePosition> PositionOfRow(const CsvRow& row) {
  if (row.Has("latitude_deg") != row.Has("longitude_deg")) {
    row.Fail("expected both latitude_deg and longitude_deg, or neither");
  }
  if (row.Has("easting_m") != row.Has("northing_m")) {
    row.Fail("expected both easting_m and northing_m, or neither");
  }
  if (!row.Has("latitude_deg") && !row.Has("easting_m")) return std::nullopt;
  if (row.Has("latitude_deg") && row.Has("easting_m")) {
    row.Fail("expected latitude_deg, longitude_deg or easting_m, northing_m, found both");
  }
  TablePosition result;
  result.has_height = row.Has("height_m");
  const double height = row.Number("height_m", 0);
  result.position = row.Has("easting_m") ? FromCrs(row, height)
                                         : Geodetic{row.Number("latitude_deg"), row.Number("longitude_deg"), height};
  CheckOnEarth(result.position, row.Where());
  return result;
}

}  // namespace trigpoint
