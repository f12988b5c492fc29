#include "datasets/io/tables.h"

#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/csv_dialect.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/table_position.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
std::vector<Station> ReadStations(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::vector<Station> stations;
  const CsvTable table =
      CsvTable::Read(file, {"station", "tag_id"}, {"east_m", "north_m", "up_m", "right_m", "out_m", "sigma_m"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    Station station;
    station.name = row.Text("station");
    if (station.name.empty()) row.Fail("column station: expected a name, found nothing");
    for (const Station& other : stations) {
      if (other.name == station.name) row.Fail("station '" + station.name + "' stands in the table twice");
    }
    const int64_t id = row.Integer("tag_id");
    if (id < 0 || id > 1'000'000) row.Fail("column tag_id: expected a tag's number, found " + row.Text("tag_id"));
    station.tag_id = static_cast<int>(id);
    const bool enu = row.Has("east_m") || row.Has("north_m");
    station.in_tag_frame = row.Has("right_m") || row.Has("out_m");
    if (enu == station.in_tag_frame) {
      row.Fail("expected an offset as east_m, north_m, up_m or as right_m, out_m, up_m, found " +
               std::string(enu ? "both" : "neither"));
    }
    station.offset_m = {row.Number(enu ? "east_m" : "right_m"), row.Number(enu ? "north_m" : "out_m"),
                        row.Number("up_m")};
    station.sigma_m = row.Number("sigma_m", station.sigma_m);
    if (station.sigma_m <= 0) row.Fail("column sigma_m: expected a sigma above 0");
    stations.push_back(std::move(station));
  });
  return stations;
}

std::vector<ControlPoint> ReadControlPoints(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::vector<ControlPoint> points;
  const CsvTable table = CsvTable::Read(
      file, {},
      {"role", "tag_id", "corner", "point", "latitude_deg", "longitude_deg", "height_m", "crs", "easting_m",
       "northing_m", "x_m", "y_m", "z_m", "sigma_h_m", "sigma_v_m", "height_system", "epoch"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  bool geoid_named = false;
  std::map<std::tuple<int, int, std::string, std::string>, std::string> lines;  // of each point, where it stands
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    ControlPoint point;
    point.point = row.Text("point");
    if (row.Has("tag_id") == row.Has("point")) row.Fail("expected either a tag_id or a point, not both or neither");
    point.tag_id = static_cast<int>(row.Integer("tag_id", -1));
    point.corner = static_cast<int>(row.Integer("corner", -1));
    if (point.corner < -1 || point.corner > 3) row.Fail("column corner: expected 0 to 3 or nothing");
    const std::string& role = row.Text("role");
    if (!role.empty() && role != "control" && role != "check") {
      row.Fail("column role: expected control or check, found '" + role + "'");
    }
    point.has_role = !role.empty();
    point.control = role != "check";
    const bool local = row.Has("x_m"), projected = row.Has("easting_m"), angles = row.Has("latitude_deg");
    if (local + projected + angles != 1) {
      row.Fail(
          "expected one position: latitude_deg, longitude_deg, height_m, or crs, easting_m, northing_m, height_m, "
          "or x_m, y_m, z_m");
    }
    if (local) {
      point.local_m = Eigen::Vector3d(row.Number("x_m"), row.Number("y_m"), row.Number("z_m"));
    } else {
      point.geodetic = PositionOfRow(row)->position;
      row.Number("height_m");  // a control point has all three coordinates
    }
    point.sigma_h_m = row.Number("sigma_h_m", point.sigma_h_m);
    point.sigma_v_m = row.Number("sigma_v_m", point.sigma_v_m);
    if (point.sigma_h_m <= 0 || point.sigma_v_m <= 0) row.Fail("expected sigmas above 0");
    if (row.Has("height_system")) point.height_system = row.Text("height_system");
    if (point.height_system != "ellipsoidal" && !geoid_named) {
      geoid_named = true;
      warnings->push_back(row.Where("height_system") + ": heights above '" + point.height_system +
                          "' are kept as they are, no geoid is built in; give ellipsoidal heights if the site must "
                          "agree with GPS");
    }
    point.epoch = row.Text("epoch");
    const auto [earlier, fresh] =
        lines.try_emplace(std::make_tuple(point.tag_id, point.corner, point.point, point.epoch), row.Where());
    if (!fresh) {
      row.Fail("the same point as at " + earlier->second +
               "; expected one row for each (and epoch): keep the one that is right");
    }
    points.push_back(std::move(point));
  });
  return points;
}

TagSizes ReadTagSizes(const std::filesystem::path& file) {
  const YamlMap map(file, LoadYaml(file), {"family", "size_m", "sizes_m"});
  TagSizes tags;
  tags.family = map.Text("family", tags.family);
  const std::vector<std::string> families = {"tag36h11",         "tag36h10",         "tag25h9",
                                             "tag16h5",          "tagCircle21h7",    "tagCircle49h12",
                                             "tagStandard41h12", "tagStandard52h13", "tagCustom48h12"};
  if (std::find(families.begin(), families.end(), tags.family) == families.end()) {
    map.Fail("family",
             "unknown family '" + tags.family + "'; nearest known: '" + NearestName(tags.family, families) + "'");
  }
  tags.size_m = map.Number("size_m", 0);
  if (map.Has("size_m") && tags.size_m <= 0) map.Fail("size_m", "expected a length above 0");
  const YamlMap sizes = map.MapOfAnyKeys("sizes_m");
  for (const std::string& key : sizes.Keys()) {
    const auto id = ParseInt(key);
    if (!id || *id < 0) sizes.Fail(key, "expected 'ID: SIZE', a tag's number and its size");
    const double size = sizes.Number(key, 0);
    if (size <= 0) sizes.Fail(key, "expected a length above 0");
    tags.sizes_m[static_cast<int>(*id)] = size;
  }
  return tags;
}

Geodetic ReadOrigin(const std::filesystem::path& file) {
  const nlohmann::json json = nlohmann::json::parse(ReadTextFile(file), nullptr, false);
  if (json.is_discarded() || !json.is_object()) {
    throw InputError(file.string() + ": expected JSON as {\"lat\": 48.0, \"lon\": 7.8, \"alt\": 240.0}");
  }
  const std::vector<std::string> keys = {"latitude_deg", "longitude_deg", "height_m"};
  std::map<std::string, const nlohmann::json*> values;
  for (const auto& [key, value] : json.items()) {
    if (key == "schema") continue;
    const std::string meant = KnownColumn(key, keys, false);
    if (meant.empty()) {
      throw InputError(file.string() + ": unknown key '" + key + "'; nearest known key: '" +
                       NearestName(key, {"lat", "lon", "alt"}) + "'");
    }
    if (!values.emplace(meant, &value).second) {
      throw InputError(file.string() + ": key '" + key + "' states what another key states, too; keep one");
    }
  }
  const auto number = [&](const char* name, const char* key, bool required) {
    const auto it = values.find(name);
    if (it == values.end() && !required) return 0.0;
    if (it == values.end() || !it->second->is_number()) {
      throw InputError(file.string() + ": key '" + key + "': expected a number, found " +
                       (it == values.end() ? "nothing" : it->second->dump()));
    }
    return it->second->get<double>();
  };
  const Geodetic origin{number(keys[0].c_str(), "lat", true), number(keys[1].c_str(), "lon", true),
                        number(keys[2].c_str(), "alt", false)};
  CheckOnEarth(origin, file.string());
  return origin;
}

}  // namespace trigpoint
