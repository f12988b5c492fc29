#include "datasets/io/survey_tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/input_crs.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

// OpenSfM states no sigmas: a handheld receiver's.
constexpr double kOpenSfmSigmaH = 0.5, kOpenSfmSigmaV = 1.0;

int TagId(const CsvRow& row, const char* column) {
  const int64_t id = row.Integer(column);
  if (id < 0 || id > 1'000'000) row.Fail(std::string("column ") + column + ": expected a tag's number");
  return static_cast<int>(id);
}

ControlPoint OpenSfmPoint(const std::string& name, const Geodetic& position) {
  ControlPoint point;
  point.point = name;
  point.has_role = false;
  point.control = true;
  point.geodetic = position;
  point.sigma_h_m = kOpenSfmSigmaH;
  point.sigma_v_m = kOpenSfmSigmaV;
  return point;
}

// The system of a gcp_list.txt, its first line: as OpenSfM writes it, or anything that PROJ knows.
InputCrs ListSystem(const std::string& line, const std::filesystem::path& file, int number) {
  std::istringstream words(line);
  std::vector<std::string> all;
  for (std::string word; words >> word;) all.push_back(word);
  try {
    if (all.size() == 1 && all[0] == "WGS84") return InputCrs::Named("EPSG:4326");
    if (all.size() == 3 && all[0] == "WGS84" && all[1] == "UTM" && all[2].size() >= 2) {
      const bool north = all[2].back() == 'N';
      const int64_t zone = ParseInt(all[2].substr(0, all[2].size() - 1)).value_or(0);
      if (zone < 1 || zone > 60 || (!north && all[2].back() != 'S')) throw InputError("expected a zone as in 32N");
      return InputCrs::Named("EPSG:" + std::to_string((north ? 32600 : 32700) + zone));
    }
    return InputCrs::Named(line);
  } catch (const InputError& e) {
    throw InputError(FileLine(file, number) +
                     ": the first line is the system of the coordinates (WGS84, \"WGS84 UTM "
                     "32N\", an EPSG code, a PROJ string or WKT): " +
                     e.what());
  }
}

// OpenDroneMap's mark of a check point: the point's name, or a word behind it.
bool IsCheck(const std::vector<std::string_view>& fields) {
  for (size_t k = 6; k < fields.size(); ++k) {
    std::string word(fields[k].substr(0, 3));
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::toupper(c); });
    if (word == "CHK" && (k == 6 || fields[k].size() == 3)) return true;
  }
  return false;
}

}  // namespace

std::vector<MeasuredDistance> ReadDistances(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::vector<MeasuredDistance> distances;
  const CsvTable table = CsvTable::Read(file, {"from", "to", "distance_m"}, {"sigma_m", "role"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    MeasuredDistance d;
    d.from = TagId(row, "from");
    d.to = TagId(row, "to");
    if (d.from == d.to) row.Fail("expected two tags, found tag " + row.Text("from") + " twice");
    d.distance_m = row.Number("distance_m");
    if (!(d.distance_m > 0)) row.Fail("column distance_m: expected a length above 0");
    d.sigma_m = row.Number("sigma_m", d.sigma_m);
    if (!(d.sigma_m > 0)) row.Fail("column sigma_m: expected a sigma above 0");
    const std::string& role = row.Text("role");
    if (!role.empty() && role != "control" && role != "check") {
      row.Fail("column role: expected control or check, found '" + role + "'");
    }
    d.check = role == "check";
    distances.push_back(d);
  });
  return distances;
}

bool NamesPath(const std::string& named, const std::string& path) {
  return path == named || path.ends_with("/" + named);
}

std::vector<PointMark> ReadControlObservations(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::vector<PointMark> marks;
  const CsvTable table = CsvTable::Read(file, {"point", "image", "u", "v"}, {"sigma_px"});
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    PointMark mark;
    mark.point = row.Text("point");
    mark.image = row.Text("image");
    if (mark.point.empty() || mark.image.empty()) row.Fail("expected the names of a point and an image");
    mark.pixel = {row.Number("u"), row.Number("v")};
    mark.sigma_px = row.Number("sigma_px", mark.sigma_px);
    if (!(mark.sigma_px > 0)) row.Fail("column sigma_px: expected a sigma above 0");
    marks.push_back(std::move(mark));
  });
  return marks;
}

OpenSfmControl ReadOpenSfmJson(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  const nlohmann::json json = nlohmann::json::parse(ReadTextFile(file), nullptr, false);
  if (json.is_discarded() || !json.is_object() || !json.contains("points") || !json["points"].is_array()) {
    throw InputError(file.string() + ": expected JSON with a list \"points\"");
  }
  OpenSfmControl control;
  for (const nlohmann::json& point : json["points"]) {
    try {
      const std::string name = point.at("id").is_string() ? point["id"].get<std::string>() : point["id"].dump();
      if (point.contains("position") && point["position"].is_object()) {
        const nlohmann::json& p = point["position"];
        const bool has_height =
            p.contains("altitude") && p["altitude"].is_number() && point.value("has_altitude", true);
        if (!has_height) throw InputError(file.string() + ": point " + name + " has no altitude");
        const Geodetic position{p.at("latitude").get<double>(), p.at("longitude").get<double>(),
                                p["altitude"].get<double>()};
        CheckOnEarth(position, file.string() + ": point " + name);
        control.points.push_back(OpenSfmPoint(name, position));
      }
      for (const nlohmann::json& o : point.value("observations", nlohmann::json::array())) {
        PointMark mark;
        mark.point = name;
        mark.image = o.at("shot_id").get<std::string>();
        mark.pixel = {o.at("projection").at(0).get<double>(), o.at("projection").at(1).get<double>()};
        mark.normalised = true;
        control.marks.push_back(std::move(mark));
      }
    } catch (const nlohmann::json::exception& e) {
      warnings->push_back(file.string() + ": a point is skipped: " + e.what());
    } catch (const InputError& e) {
      warnings->push_back(std::string(e.what()) + "; the point is skipped");
    }
  }
  return control;
}

OpenSfmControl ReadOpenSfmList(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::istringstream text(ReadTextFile(file));
  std::optional<InputCrs> system;
  bool any_check = false;
  OpenSfmControl control;
  std::map<std::array<double, 3>, std::string> unnamed;
  std::set<std::string> known;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    const std::string_view content = Trim(line);
    if (content.empty() || content.front() == '#') continue;
    if (!system) {
      system.emplace(ListSystem(std::string(content), file, number));
      continue;
    }
    const std::vector<std::string_view> fields = SplitFields(content);
    std::array<double, 5> values{};
    bool good = fields.size() >= 6;
    for (size_t k = 0; good && k < values.size(); ++k) {
      const std::optional<double> value = ParseDouble(fields[k]);
      good = value && std::isfinite(*value);
      if (good) values[k] = *value;
    }
    if (!good) {
      warnings->push_back(FileLine(file, number) +
                          ": expected x y z u v image [name], with numbers for the first five; the line is skipped");
      continue;
    }
    const auto [x, y, z, u, v] = values;
    const std::string image(fields[5]);
    const std::string name =
        fields.size() > 6 ? std::string(fields[6])
                          : unnamed.try_emplace({x, y, z}, "point " + std::to_string(unnamed.size() + 1)).first->second;
    try {
      if (known.insert(name).second) {
        const Geodetic position = system->ToWgs84(x, y, z);
        CheckOnEarth(position, FileLine(file, number));
        control.points.push_back(OpenSfmPoint(name, position));
        control.points.back().control = !IsCheck(fields);
        any_check |= IsCheck(fields);
      }
      control.marks.push_back({name, image, {u, v}, false});
    } catch (const InputError& e) {
      known.erase(name);
      const std::string what = e.what(), where = FileLine(file, number);
      warnings->push_back((what.starts_with(where) ? what : where + ": " + what) + "; the line is skipped");
    }
  }
  // Who marks check points has decided about the others.
  for (ControlPoint& point : control.points) point.has_role = any_check;
  if (system && (system->datum_assumed() || (system->accuracy_m() && *system->accuracy_m() > 0.05))) {
    warnings->push_back(file.string() + ": " + system->name() +
                        ": its transformation to WGS 84 is not exact: all points " +
                        "may be shifted together against GPS and geotags, by metres at most");
  }
  if (!system) throw InputError(file.string() + ": is empty; expected WGS84 or a projection first");
  return control;
}

}  // namespace trigpoint
