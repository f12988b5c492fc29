#include "datasets/io/tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <tuple>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/csv_dialect.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/height_system.h"
#include "datasets/io/input_crs.h"
#include "datasets/io/table_position.h"
#include "datasets/io/tag_families.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

// Positions of control points, each in the system, the units and above the surface that its row names.
class PositionReader {
 public:
  PositionReader(const std::filesystem::path& file, std::vector<std::string>* warnings)
      : folder_(file.parent_path()), file_(file), warnings_(warnings) {}

  void Read(const CsvRow& row, ControlPoint* point) {
    const bool local = row.Has("x_m"), projected = row.Has("easting_m");
    if (local + projected + row.Has("latitude_deg") != 1) {
      row.Fail(
          "expected one position: latitude_deg, longitude_deg, height_m, or crs, easting_m, northing_m, height_m, "
          "or x_m, y_m, z_m");
    }
    if (row.Has("height_system")) point->height_system = row.Text("height_system");
    if (local) {
      point->local_m = Eigen::Vector3d(LengthOfRow(row, "x_m"), LengthOfRow(row, "y_m"), LengthOfRow(row, "z_m"));
      return;
    }
    row.Number("height_m");  // a control point has all three coordinates
    point->geodetic = PositionOfRow(row)->position;
    const InputCrs* crs = projected && row.Has("crs") ? &CrsOfRow(row) : nullptr;
    if (crs != nullptr) StateAccuracy(*crs);
    if (point->height_system == "ellipsoidal") return;
    if (crs != nullptr && crs->has_vertical()) {
      row.Fail("height_system '" + point->height_system + "' contradicts the crs, which has heights of its own");
    }
    AddGeoid(row, point);
  }

  // Points whose heights are above something that is not known here are of use only if all are.
  void LeaveOutUnknownHeights(std::vector<ControlPoint>* points) const {
    const auto is_unknown = [&](const ControlPoint& point) {
      return point.geodetic && unknown_.count(point.height_system) > 0;
    };
    std::set<std::string> surfaces;
    for (const ControlPoint& point : *points) {
      if (point.geodetic) surfaces.insert(is_unknown(point) ? point.height_system : "");
    }
    if (unknown_.empty() || surfaces.size() < 2) return;
    const auto count = std::erase_if(*points, is_unknown);
    warnings_->push_back(file_.string() + ": " + std::to_string(count) +
                         " points are skipped: their height_system is not known, and other points have another one; "
                         "correct column height_system, or give all heights above the ellipsoid");
  }

 private:
  // From the height above what height_system names to the one above the ellipsoid. The two are looked up at the same
  // place: a height has no bearing on it that matters here.
  void AddGeoid(const CsvRow& row, ControlPoint* point) {
    const auto [at, fresh] = geoids_.try_emplace(point->height_system);
    if (fresh) OpenGeoid(row, point->height_system, &at->second);
    if (!at->second) return;
    try {
      point->geodetic->height_m += at->second->Undulation(*point->geodetic);
    } catch (const InputError& e) {
      row.Fail(e.what());
    }
  }

  void OpenGeoid(const CsvRow& row, const std::string& name, std::optional<HeightSystem>* geoid) {
    std::string why = "the geoid is not known (expected egm84, egm96, egm2008, or the file of a grid, .gtx or .tif)";
    if (HeightSystem::IsKnown(name)) {
      try {
        *geoid = HeightSystem::Named(name, "height system ", folder_);
        return;
      } catch (const OptionError& e) {
        why = e.what();
      }
    }
    unknown_.insert(name);
    warnings_->push_back(row.Where("height_system") + ": heights above '" + name + "' are kept as they are: " + why +
                         ". The site agrees with GPS only if they are ellipsoidal");
  }

  // Once for each system, what its change of datum is good to.
  void StateAccuracy(const InputCrs& crs) {
    constexpr double kNoticed_m = 0.05;
    const bool vague = crs.accuracy_m() && *crs.accuracy_m() > kNoticed_m;
    if ((!vague && !crs.datum_assumed()) || !stated_.insert(crs.name()).second) return;
    warnings_->push_back(file_.string() + ": " + crs.name() + ": " +
                         (vague ? fmt::format("its transformation to WGS 84 is good to {:.3g} m", *crs.accuracy_m())
                                : std::string("it names no datum and is taken as WGS 84, which may be off by 2 m")) +
                         ": all points may be shifted together by that against GPS and geotags");
  }

  std::filesystem::path folder_, file_;
  std::vector<std::string>* warnings_;
  std::map<std::string, std::optional<HeightSystem>> geoids_;
  std::set<std::string> unknown_, stated_;
};

}  // namespace

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
       "northing_m", "x_m", "y_m", "z_m", "sigma_h_m", "sigma_v_m", "height_system", "epoch", "unit", "height_unit"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  PositionReader positions(file, warnings);
  std::map<std::tuple<int, int, std::string, std::string>, std::string> lines;  // of each point, where it stands
  std::map<std::tuple<int, int, std::string>, std::string> epochs;              // and the first epoch it has
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
    positions.Read(row, &point);
    point.sigma_h_m = row.Number("sigma_h_m", point.sigma_h_m);
    point.sigma_v_m = row.Number("sigma_v_m", point.sigma_v_m);
    if (point.sigma_h_m <= 0 || point.sigma_v_m <= 0) row.Fail("expected sigmas above 0");
    point.epoch = row.Text("epoch");
    const auto [first, alone] =
        epochs.try_emplace(std::make_tuple(point.tag_id, point.corner, point.point), point.epoch);
    for (const std::string& epoch : {point.epoch, first->second}) {
      if (alone || first->second == point.epoch || YearOfEpoch(epoch)) continue;
      row.Fail(
          "column epoch: a point in several rows is compared between their epochs: expected a year as 2023.45 or " +
          std::string("a date as 2023-06-15 in each, found '") + epoch + "'");
    }
    const auto [earlier, fresh] =
        lines.try_emplace(std::make_tuple(point.tag_id, point.corner, point.point, point.epoch), row.Where());
    if (!fresh) {
      row.Fail("the same point as at " + earlier->second +
               "; expected one row for each (and epoch): keep the one that is right");
    }
    points.push_back(std::move(point));
  });
  positions.LeaveOutUnknownHeights(&points);
  return points;
}

std::optional<double> YearOfEpoch(const std::string& epoch) {
  constexpr double kYear_ns = 365.25 * 86400e9, kStart_ns = 30 * kYear_ns;  // of 2000, since 1970
  if (const auto ns = ParseUtcToNs(epoch)) return 2000 + (static_cast<double>(*ns) - kStart_ns) / kYear_ns;
  const auto year = ParseDouble(epoch);
  return year && *year >= 1900 && *year < 2200 ? year : std::nullopt;
}

std::vector<ControlPoint> AtNewestEpoch(const std::vector<ControlPoint>& points) {
  std::vector<ControlPoint> newest;
  for (const ControlPoint& point : points) {
    const auto same = std::find_if(newest.begin(), newest.end(), [&](const ControlPoint& other) {
      return std::tie(other.tag_id, other.corner, other.point) == std::tie(point.tag_id, point.corner, point.point);
    });
    if (same == newest.end()) {
      newest.push_back(point);
    } else if (YearOfEpoch(same->epoch).value_or(0) < YearOfEpoch(point.epoch).value_or(0)) {
      *same = point;
    }
  }
  return newest;
}

TagSizes ReadTagSizes(const std::filesystem::path& file) {
  const YamlMap map(file, LoadYaml(file), {"family", "families", "size_m", "sizes_m"});
  TagSizes tags;
  const std::vector<std::string> known = KnownTagFamilies();
  const auto family = [&](const YamlMap& from, const std::string& key, const std::string& missing) {
    std::string name = from.Text(key, missing);
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      from.Fail(key, "unknown family '" + name + "'; nearest known: '" + NearestName(name, known) + "'");
    }
    return name;
  };
  const auto id_of = [](const YamlMap& from, const std::string& key, const char* what, std::map<int, int>* lines) {
    const auto id = ParseInt(key);
    if (!id || *id < 0) from.Fail(key, std::string("expected 'ID: ") + what);
    const auto [first, fresh] = lines->emplace(static_cast<int>(*id), from.Node(key).Mark().line + 1);
    if (!fresh) {
      from.Fail(key, fmt::format("tag {} is listed on line {}, too; an id is one tag of a site: keep one of the two",
                                 *id, first->second));
    }
    return static_cast<int>(*id);
  };
  std::map<int, int> family_lines, size_lines;
  tags.family = family(map, "family", tags.family);
  const YamlMap families = map.MapOfAnyKeys("families");
  std::map<int, std::string> others;
  for (const std::string& key : families.Keys()) {
    others[id_of(families, key, "FAMILY', a tag's number and its family", &family_lines)] = family(families, key, "");
  }
  const TagFamilies all(tags.family, others);
  const auto check = [&](const YamlMap& from, const std::string& key, int id) {
    const std::string problem = TagIdProblem(all.Of(id), id);
    if (!problem.empty()) from.Fail(key, problem + "; correct the id or the family");
  };
  for (const std::string& key : families.Keys()) check(families, key, static_cast<int>(*ParseInt(key)));
  tags.family = all.Text();
  tags.size_m = map.Number("size_m", 0);
  if (map.Has("size_m") && tags.size_m <= 0) map.Fail("size_m", "expected a length above 0");
  const YamlMap sizes = map.MapOfAnyKeys("sizes_m");
  for (const std::string& key : sizes.Keys()) {
    const int id = id_of(sizes, key, "SIZE', a tag's number and its size", &size_lines);
    const double size = sizes.Number(key, 0);
    if (size <= 0) sizes.Fail(key, "expected a length above 0");
    check(sizes, key, id);
    tags.sizes_m[id] = size;
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
