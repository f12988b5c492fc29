#include "datasets/io/site_sketch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/readable.h"
#include "datasets/io/tag_families.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

const std::vector<std::string> kKinds = {"tag", "candidate", "control", "check", "station", "path", "candidate_path"};
constexpr double kLeastSize_m = 0.005, kMostSize_m = 5;  // of a tag: others are in another unit
constexpr double kWidest_m = 20e3;                       // of a site: wider ones mix units, frames or axes
constexpr double kMetresPerDegree = 111320;

bool IsPath(const SketchItem& item) { return item.kind == "path" || item.kind == "candidate_path"; }

// What holds for both forms of the file; `where` names the row or feature.
void Check(SketchItem* item, const std::string& where) {
  item->where = where;
  if (std::find(kKinds.begin(), kKinds.end(), item->kind) == kKinds.end()) {
    throw InputError(where + ": unknown kind '" + item->kind + "'; nearest known: '" + NearestName(item->kind, kKinds) +
                     "'");
  }
  const bool on_tag = item->kind == "tag" || item->kind == "control" || item->kind == "check";
  if (on_tag) {
    const auto id = ParseInt(item->name);
    if (!id || *id < 0)
      throw InputError(where + ": expected a tag's id as name of a " + item->kind + ", found '" + item->name + "'");
    item->tag_id = static_cast<int>(*id);
  }
  const bool placed = item->local_m || item->geodetic;
  if (!placed && item->kind != "control" && item->kind != "check") {
    throw InputError(where + ": a " + item->kind + " needs a position");
  }
  const bool faces = item->kind == "tag" || item->kind == "candidate";
  if (faces && !item->heading_rad) {
    throw InputError(where + ": expected heading_deg, the way its printed side faces (0 north, 90 east)");
  }
  if (!(item->sigma_h_m > 0 && item->sigma_v_m > 0)) throw InputError(where + ": expected sigmas above 0");
  if (item->size_m != 0 && !(item->size_m >= kLeastSize_m && item->size_m <= kMostSize_m)) {
    throw InputError(fmt::format("{}: size_mm {:g}: expected {:g} to {:g} mm", where, 1e3 * item->size_m,
                                 1e3 * kLeastSize_m, 1e3 * kMostSize_m));
  }
  const auto& at = item->geodetic;
  if (at && !(std::abs(at->latitude_deg) <= 90 && std::abs(at->longitude_deg) <= 360)) {
    throw InputError(fmt::format("{}: latitude {:g}, longitude {:g}: expected degrees, latitude within -90 to 90",
                                 where, at->latitude_deg, at->longitude_deg));
  }
}

// Metres, roughly: good enough to tell a site from a mistake.
Eigen::Vector2d RoughPlace(const SketchItem& item, const Geodetic& origin) {
  if (item.local_m) return item.local_m->head<2>();
  const double east = item.geodetic->longitude_deg - origin.longitude_deg;
  return kMetresPerDegree * Eigen::Vector2d(east * std::cos(origin.latitude_deg * kDegToRad),
                                            item.geodetic->latitude_deg - origin.latitude_deg);
}

void CheckExtent(const std::vector<SketchItem>& items) {
  const SketchItem* first[2] = {nullptr, nullptr};  // in metres, in degrees
  for (const SketchItem& item : items) {
    if (!item.local_m && !item.geodetic) continue;
    const SketchItem*& its = first[item.local_m ? 0 : 1];
    if (its == nullptr) its = &item;
    const Geodetic origin = its->geodetic.value_or(Geodetic());
    const double away = (RoughPlace(item, origin) - RoughPlace(*its, origin)).norm();
    if (away <= kWidest_m) continue;
    throw InputError(
        fmt::format("{}: {} {} is {:.0f} km from {} {} ({}); a site is at most {:.0f} km wide: check units, "
                    "signs and swapped columns",
                    item.where, item.kind, item.name, away / 1e3, its->kind, its->name, its->where, kWidest_m / 1e3));
  }
}

// The corners of a path follow each other; everything else is there once.
void CheckNames(const std::vector<SketchItem>& items) {
  std::map<std::pair<std::string, std::string>, const SketchItem*> known;
  const SketchItem* last = nullptr;
  for (const SketchItem& item : items) {
    const bool goes_on = last != nullptr && IsPath(item) && last->kind == item.kind && last->name == item.name;
    last = &item;
    if (goes_on) continue;
    const bool surveyed = item.kind == "control" || item.kind == "check";
    const std::string name = surveyed || item.kind == "tag" ? std::to_string(item.tag_id) : item.name;
    const auto [before, fresh] = known.try_emplace({surveyed ? "surveyed" : item.kind, name}, &item);
    if (fresh) continue;
    throw InputError(
        fmt::format("{}: {} {} is there already ({}); {}", item.where, item.kind, item.name, before->second->where,
                    IsPath(item) ? "the corners of a path follow each other: give another path another name"
                                 : "remove one, or give it another name"));
  }
}

std::vector<SketchItem> ReadCsv(const std::filesystem::path& file) {
  const CsvTable table = CsvTable::Read(file, {"kind", "name"},
                                        {"east_m", "north_m", "up_m", "latitude_deg", "longitude_deg", "height_m",
                                         "heading_deg", "size_mm", "sigma_h_m", "sigma_v_m", "tag_id"});
  std::vector<SketchItem> items;
  for (const CsvRow& row : table.rows()) {
    SketchItem item;
    item.kind = row.Text("kind");
    item.name = row.Text("name");
    if (row.Has("east_m")) item.local_m = {row.Number("east_m"), row.Number("north_m"), row.Number("up_m", 0)};
    if (row.Has("latitude_deg")) {
      item.geodetic = Geodetic{row.Number("latitude_deg"), row.Number("longitude_deg"), row.Number("height_m", 0)};
    }
    if (row.Has("heading_deg")) item.heading_rad = row.Number("heading_deg") * kDegToRad;
    item.size_m = row.Number("size_mm", 0) / 1e3;
    if (item.kind == "station") item.sigma_h_m = kSketchGeotag_h_m, item.sigma_v_m = kSketchGeotag_v_m;
    item.sigma_h_m = row.Number("sigma_h_m", item.sigma_h_m);
    item.sigma_v_m = row.Number("sigma_v_m", item.sigma_v_m);
    item.tag_id = static_cast<int>(row.Integer("tag_id", -1));
    Check(&item, row.Where());
    items.push_back(item);
  }
  return items;
}

Geodetic GeodeticOf(const nlohmann::json& position, double height, const std::string& where) {
  if (!position.is_array() || position.size() < 2 || !position[0].is_number() || !position[1].is_number()) {
    throw InputError(where + ": expected coordinates [longitude, latitude, height]");
  }
  if (position.size() > 2 && position[2].is_number()) height = position[2].get<double>();
  return {position[1].get<double>(), position[0].get<double>(), height};
}

// A member that is an object, or empty where it is not there or null.
nlohmann::json ObjectIn(const nlohmann::json& feature, const char* name, const std::string& where) {
  const auto it = feature.find(name);
  if (it == feature.end() || it->is_null()) return nlohmann::json::object();
  if (!it->is_object()) throw InputError(where + ": " + name + ": expected an object, found " + Excerpt(it->dump()));
  return *it;
}

std::vector<SketchItem> ReadGeoJson(const std::filesystem::path& file) {
  const nlohmann::json json = nlohmann::json::parse(ReadTextFile(file), nullptr, false);
  if (json.is_discarded() || !json.is_object() || !json.contains("features") || !json["features"].is_array()) {
    throw InputError(file.string() + ": expected a GeoJSON FeatureCollection");
  }
  std::vector<SketchItem> items;
  int index = 0;
  for (const nlohmann::json& feature : json["features"]) {
    const std::string where = file.string() + ": feature " + std::to_string(index++);
    if (!feature.is_object()) {
      throw InputError(where + ": expected a GeoJSON Feature, found " + Excerpt(feature.dump()));
    }
    const nlohmann::json properties = ObjectIn(feature, "properties", where);
    const nlohmann::json geometry = ObjectIn(feature, "geometry", where);
    const auto number = [&](const char* key, double missing) {
      const auto it = properties.find(key);
      if (it == properties.end() || it->is_null()) return missing;
      if (!it->is_number())
        throw InputError(where + ": property '" + key + "': expected a number, found " + Excerpt(it->dump()));
      return it->get<double>();
    };
    const auto text = [&](const char* key) {
      const auto it = properties.find(key);
      if (it == properties.end() || it->is_null()) return std::string();
      return it->is_string() ? it->get<std::string>() : it->dump();
    };
    SketchItem item;
    item.kind = text("kind");
    item.name = text("name");
    if (properties.contains("heading_deg")) item.heading_rad = number("heading_deg", 0) * kDegToRad;
    item.size_m = number("size_mm", 0) / 1e3;
    if (item.kind == "station") item.sigma_h_m = kSketchGeotag_h_m, item.sigma_v_m = kSketchGeotag_v_m;
    item.sigma_h_m = number("sigma_h_m", item.sigma_h_m);
    item.sigma_v_m = number("sigma_v_m", item.sigma_v_m);
    item.tag_id = static_cast<int>(number("tag_id", -1));
    const double height = number("height_m", 0);
    const nlohmann::json kind = geometry.value("type", nlohmann::json(""));
    const std::string type = kind.is_string() ? kind.get<std::string>() : Excerpt(kind.dump());
    const nlohmann::json coordinates = geometry.value("coordinates", nlohmann::json::array());
    if (type == "LineString") {
      if (item.name.empty()) item.name = "line " + std::to_string(index);
      for (const nlohmann::json& position : coordinates) {
        item.geodetic = GeodeticOf(position, height, where);
        Check(&item, where);
        items.push_back(item);
      }
      continue;
    }
    if (!type.empty() && type != "Point") {
      throw InputError(where + ": geometry '" + type + "': expected a Point, or a LineString for a path");
    }
    if (type == "Point") item.geodetic = GeodeticOf(coordinates, height, where);
    Check(&item, where);
    items.push_back(item);
  }
  return items;
}

}  // namespace

std::vector<SketchItem> ReadSiteSketch(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  const bool json = extension == ".geojson" || extension == ".json";
  std::vector<SketchItem> items = json ? ReadGeoJson(file) : ReadCsv(file);
  CheckNames(items);
  CheckExtent(items);
  return items;
}

void RequireTagIds(const std::vector<SketchItem>& items, const std::string& family) {
  const TagFamilies families(family);
  for (const SketchItem& item : items) {
    if (item.tag_id < 0) continue;
    const std::string problem = TagIdProblem(families.Of(item.tag_id), item.tag_id);
    if (problem.empty()) continue;
    throw InputError(item.where + ": " + problem + "; take another id, or set the tag's family in tags.yaml");
  }
}

std::string SiteSketchCsv(const std::vector<SketchItem>& items) {
  CsvWriter csv({"kind", "name", "east_m", "north_m", "up_m", "latitude_deg", "longitude_deg", "height_m",
                 "heading_deg", "size_mm", "sigma_h_m", "sigma_v_m", "tag_id"},
                {"trigpoint plan 1; sigma=1 per axis"});
  for (const SketchItem& item : items) {
    csv.Text(item.kind).Text(item.name);
    if (item.local_m) {
      for (int k = 0; k < 3; ++k) csv.Number((*item.local_m)[k], 3);
    } else {
      csv.Empty(3);
    }
    if (item.geodetic) {
      csv.Number(item.geodetic->latitude_deg, 9).Number(item.geodetic->longitude_deg, 9);
      csv.Number(item.geodetic->height_m, 3);
    } else {
      csv.Empty(3);
    }
    const double none = std::numeric_limits<double>::quiet_NaN();  // an empty cell
    const bool known = item.kind == "control" || item.kind == "check" || item.kind == "station";
    csv.Number(item.heading_rad ? *item.heading_rad * kRadToDeg : none, 3);
    csv.Number(item.size_m > 0 ? item.size_m * 1e3 : none, 3);
    csv.Number(known ? item.sigma_h_m : none, 4).Number(known ? item.sigma_v_m : none, 4);
    if (item.kind == "station" && item.tag_id >= 0) {
      csv.Integer(item.tag_id);
    } else {
      csv.Empty();
    }
    csv.EndRow();
  }
  return csv.text();
}

}  // namespace trigpoint
