#include "datasets/io/csv_dialect.h"

#include <algorithm>
#include <array>
#include <utility>

namespace trigpoint {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

bool Contains(const std::vector<std::string>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// "Latitude [deg]" as latitude_deg.
std::string Normalised(std::string_view column) {
  std::string name;
  for (const char c : column) {
    if (IsDigit(c) || (c >= 'a' && c <= 'z')) {
      name += c;
    } else if (c >= 'A' && c <= 'Z') {
      name += static_cast<char>(c - 'A' + 'a');
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (name.ends_with('_')) name.pop_back();
  return name;
}

using Names = std::vector<std::string>;

// Names without their unit that other programs use, most telling first.
const std::vector<std::pair<std::string, Names>>& OtherNames() {
  static const std::vector<std::pair<std::string, Names>> names = {
      {"latitude_deg", {"latitude", "lat", "gps_latitude", "gpslatitude", "gps_lat", "lat_wgs84", "latitude_wgs84"}},
      {"longitude_deg",
       {"longitude", "lon", "lng", "long", "gps_longitude", "gpslongitude", "gps_lon", "lon_wgs84", "longitude_wgs84"}},
      {"height_m",
       {"height", "alt", "altitude", "ellipsoidal_height", "height_ellipsoidal", "gps_altitude", "gpsaltitude", "ele",
        "elevation", "h"}},
      {"easting_m", {"easting", "east", "e"}},
      {"northing_m", {"northing", "north", "n"}},
      {"crs", {"epsg", "srid", "srs", "coordinate_system"}},
      {"heading_deg", {"heading", "azimuth", "bearing", "compass", "compass_angle", "yaw"}},
      {"sigma_h_m", {"sigma_h", "sigma_horizontal", "std_h", "sd_h"}},
      {"sigma_v_m", {"sigma_v", "sigma_vertical", "std_v", "sd_v"}},
      {"timestamp_s", {"timestamp", "time", "t", "stamp", "seconds", "sec", "unix_time"}},
      {"file", {"filename", "file_name", "image", "image_name", "photo", "picture", "panorama", "path", "label"}},
      {"station", {"station_name", "station_id"}},
      {"tag_id", {"tag", "marker_id", "marker"}},
      {"point", {"point_name", "point_id", "name", "label", "gcp"}},
  };
  return names;
}

// Units as they stand at the end of a name.
std::string WithoutUnit(const std::string& name) {
  static const std::array<std::string, 13> units = {"_decimal_degrees", "_m",   "_metres",  "_meters", "_metre",
                                                    "_meter",           "_deg", "_degrees", "_degree", "_dd",
                                                    "_decimal",         "_s",   "_px"};
  for (const std::string& unit : units) {
    if (name.size() > unit.size() && name.ends_with(unit)) return name.substr(0, name.size() - unit.size());
  }
  return name;
}

// How well a normalised name fits `known`: 0 best; the number of names if it does not.
constexpr size_t kNot = 1000;
size_t Preference(const std::string& name, const std::string& known, bool local) {
  if (name == known) return 0;
  const std::string bare = WithoutUnit(name);
  const bool axis = bare == "x" || bare == "y" || bare == "z";
  if (axis) {
    const std::string meant = local ? bare + "_m" : bare == "x" ? "easting_m" : bare == "y" ? "northing_m" : "height_m";
    return known == meant ? 500 : kNot;
  }
  if (known != name && name == bare && WithoutUnit(known) == name) return 1;
  for (const auto& [canonical, others] : OtherNames()) {
    if (canonical != known) continue;
    const auto it = std::find(others.begin(), others.end(), bare);
    // A unit that stands there must be the right kind: no length of an angle.
    const bool angle = known.ends_with("_deg"), length = known.ends_with("_m");
    const bool in_deg = name.ends_with("_deg") || name.ends_with("_degrees") || name.ends_with("_degree") ||
                        name.ends_with("_dd") || name.ends_with("_decimal");
    const bool unit_fits = name == bare || (angle && in_deg) || (length && !in_deg);
    if (it != others.end() && unit_fits) return 2 + static_cast<size_t>(it - others.begin());
  }
  return kNot;
}

}  // namespace

char DelimiterOf(std::string_view header) {
  static constexpr std::array<char, 4> kDelimiters = {',', ';', '\t', '|'};
  std::array<size_t, 4> counts{};
  bool quoted = false;
  for (const char c : header) {
    if (c == '"') quoted = !quoted;
    const auto it = std::find(kDelimiters.begin(), kDelimiters.end(), c);
    if (!quoted && it != kDelimiters.end()) ++counts[static_cast<size_t>(it - kDelimiters.begin())];
  }
  return kDelimiters[static_cast<size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin())];
}

bool IsNumberWith(char decimal, std::string_view text) {
  if (!text.empty() && (text.front() == '-' || text.front() == '+')) text.remove_prefix(1);
  const size_t at = text.find(decimal);
  return at != std::string_view::npos && at + 1 < text.size() &&
         std::all_of(text.begin(), text.begin() + at, IsDigit) &&
         std::all_of(text.begin() + at + 1, text.end(), IsDigit);
}

std::string KnownColumn(std::string_view column, const std::vector<std::string>& known, bool projected) {
  const std::string name = Normalised(column);
  const bool local = !projected && Contains(known, "x_m");
  std::string best;
  size_t best_preference = kNot;
  for (const std::string& candidate : known) {
    const size_t preference = Preference(name, candidate, local);
    if (preference < best_preference) best = candidate, best_preference = preference;
  }
  return best;
}

std::vector<std::string> UseKnownColumns(const std::vector<std::string>& known, std::vector<std::string>* columns) {
  std::vector<std::string> understood;
  bool projected = false;
  for (const std::string& column : *columns) projected = projected || KnownColumn(column, known, true) == "crs";
  const bool local = !projected && Contains(known, "x_m");
  for (const std::string& name : known) {
    if (Contains(*columns, name)) continue;
    size_t best = kNot;
    std::string* chosen = nullptr;
    for (std::string& column : *columns) {
      if (Contains(known, column)) continue;
      const size_t preference = Preference(Normalised(column), name, local);
      if (preference < best) best = preference, chosen = &column;
    }
    if (chosen == nullptr) continue;
    understood.push_back(name + " from '" + *chosen + "'" +
                         (name == "height_m" ? " (metres above the WGS 84 ellipsoid)" : ""));
    *chosen = name;
  }
  return understood;
}

}  // namespace trigpoint
