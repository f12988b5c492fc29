#include "datasets/io/table_position.h"

#include <algorithm>
#include <cmath>
#include <map>

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
  if (row.Text("crs").empty()) {
    const double east = row.Number("easting_m"), north = row.Number("northing_m");
    if (std::abs(east) <= 180 && std::abs(north) <= 90 &&
        std::min(Decimals(row.Text("easting_m")), Decimals(row.Text("northing_m"))) >= kDecimalsOfDegrees) {
      return {north, east, height};
    }
    throw InputError(row.Where("crs") +
                     ": expected the system of easting and northing: an EPSG code, a PROJ string or "
                     "WKT, found ''");
  }
  const InputCrs& crs = CrsOfRow(row);
  double x = 0, y = 0;
  if (crs.geographic()) {
    x = row.Number("easting_m");
    y = row.Number("northing_m");
  } else {
    if (std::abs(crs.unit_m() - 1) > 1e-9 && !row.Has("unit")) {
      row.Fail("the unit of " + crs.name() + " is " + std::to_string(crs.unit_m()) +
               " m: state the unit of easting, northing and height in a column unit (m, ft or us-ft)");
    }
    x = LengthOfRow(row, "easting_m") / crs.unit_m();
    y = LengthOfRow(row, "northing_m") / crs.unit_m();
  }
  try {
    return crs.ToWgs84(x, y, height / crs.height_unit_m());
  } catch (const InputError& e) {
    row.Fail(e.what());
  }
}

}  // namespace

const std::vector<std::string>& PositionColumns() {
  static const std::vector<std::string> columns = {"latitude_deg", "longitude_deg", "height_m", "crs",
                                                   "easting_m",    "northing_m",    "unit",     "height_unit"};
  return columns;
}

double LengthOfRow(const CsvRow& row, const std::string& column) {
  const bool own = column == "height_m" && row.Has("height_unit");
  const char* const stated = own ? "height_unit" : "unit";
  if (!row.Has(stated)) return row.Number(column);
  const std::optional<double> unit = LengthUnit(row.Text(stated));
  if (!unit) row.Fail(std::string("column ") + stated + ": expected m, ft or us-ft, found '" + row.Text(stated) + "'");
  return row.Number(column) * *unit;
}

const InputCrs& CrsOfRow(const CsvRow& row) {
  thread_local std::map<std::string, InputCrs> known;
  const std::string& text = row.Text("crs");
  const auto found = known.find(text);
  if (found != known.end()) return found->second;
  try {
    return known.emplace(text, InputCrs::Named(text)).first->second;
  } catch (const InputError& e) {
    throw InputError(row.Where("crs") + ": " + e.what());
  }
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
  const double height = result.has_height ? LengthOfRow(row, "height_m") : 0;
  result.position = row.Has("easting_m") ? FromCrs(row, height)
                                         : Geodetic{row.Number("latitude_deg"), row.Number("longitude_deg"), height};
  CheckOnEarth(result.position, row.Where());
  return result;
}

}  // namespace trigpoint
