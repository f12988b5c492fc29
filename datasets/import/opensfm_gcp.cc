#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "calib/base/error.h"
#include "datasets/import/phone_files.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct Gcp {
  std::optional<Geodetic> position;
  bool has_height = true;
  std::vector<std::pair<std::string, Eigen::Vector2d>> pixels;  // ours
};

// OpenSfM's image coordinates are from the middle, in units of the longer side.
class Sizes {
 public:
  explicit Sizes(const fs::path& images) : images_(images) {}
  Eigen::Vector2d Pixel(const std::string& image, const Eigen::Vector2d& normalised) {
    auto it = sizes_.find(image);
    if (it == sizes_.end()) {
      const PhotoMetadata metadata = ReadPhotoMetadata(images_ / image);
      it = sizes_
               .emplace(image, std::pair(metadata.SwapsSides() ? metadata.height : metadata.width,
                                         metadata.SwapsSides() ? metadata.width : metadata.height))
               .first;
    }
    const auto [width, height] = it->second;
    return normalised * std::max(width, height) + Eigen::Vector2d(0.5 * (width - 1), 0.5 * (height - 1));
  }

 private:
  fs::path images_;
  std::map<std::string, std::pair<int, int>> sizes_;
};

std::vector<std::pair<std::string, Gcp>> ReadJson(const fs::path& file, const fs::path& images, ImportReport* report) {
  const json document = json::parse(ReadTextFile(file), nullptr, false);
  if (!document.is_object() || !document.contains("points") || !document["points"].is_array()) {
    throw InputError(file.string() + ": expected OpenSfM's {\"points\": [...]}");
  }
  Sizes sizes(images);
  std::vector<std::pair<std::string, Gcp>> points;
  for (size_t i = 0; i < document["points"].size(); ++i) {
    try {
      const json& p = document["points"][i];
      Gcp gcp;
      const json& id = p.at("id");
      if (p.contains("position") && p["position"].is_object()) {
        const json& at = p["position"];
        gcp.position =
            Geodetic{at.at("latitude").get<double>(), at.at("longitude").get<double>(), at.value("altitude", 0.0)};
        gcp.has_height = at.contains("altitude") && p.value("has_altitude", true);
      }
      for (const json& o : p.value("observations", json::array())) {
        const std::string image = o.at("shot_id").get<std::string>();
        const Eigen::Vector2d projection(o.at("projection").at(0).get<double>(),
                                         o.at("projection").at(1).get<double>());
        gcp.pixels.emplace_back(image, sizes.Pixel(image, projection));
      }
      points.emplace_back(id.is_string() ? id.get<std::string>() : id.dump(), std::move(gcp));
    } catch (const json::exception& e) {
      report->warnings.push_back(
          fmt::format("{}: point {} cannot be read: {}; it is skipped", file.string(), i, e.what()));
    } catch (const InputError& e) {
      report->warnings.push_back(fmt::format("{}: point {}: {}; it is skipped", file.string(), i, e.what()));
    }
  }
  return points;
}

std::vector<std::pair<std::string, Gcp>> ReadList(const fs::path& file) {
  const std::string text = ReadTextFile(file);
  std::vector<std::pair<std::string, Gcp>> points;
  std::map<std::string, size_t> index;
  std::optional<int> utm_zone;  // 0: WGS 84; negative: south
  int line_number = 0;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = Trim(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    ++line_number;
    if (line.empty() || line.front() == '#') continue;
    const std::string where = FileLine(file, line_number);
    const std::vector<std::string_view> fields = SplitFields(line);
    if (!utm_zone) {
      if (line == "WGS84" || line == "EPSG:4326") {
        utm_zone = 0;
      } else if (const auto code = line.starts_with("EPSG:") ? ParseInt(line.substr(5)) : std::nullopt;
                 code && (*code / 100 == 326 || *code / 100 == 327) && *code % 100 >= 1 && *code % 100 <= 60) {
        utm_zone = static_cast<int>(*code / 100 == 326 ? *code % 100 : -(*code % 100));
      } else if (fields.size() >= 3 && fields[0] == "WGS84" && fields[1] == "UTM") {
        const auto zone = ParseInt(fields[2].substr(0, fields[2].size() - 1));
        if (!zone || *zone < 1 || *zone > 60)
          throw InputError(where + ": '" + std::string(line) + "' names no UTM zone");
        utm_zone = static_cast<int>(fields[2].back() == 'S' ? -*zone : *zone);
      } else {
        throw InputError(where +
                         ": the first line names the system; expected WGS84, WGS84 UTM 32N or EPSG:326zz, found '" +
                         std::string(line) + "'");
      }
      continue;
    }
    if (fields.size() < 6)
      throw InputError(where + ": expected x y z pixel_x pixel_y image [name], found " + std::to_string(fields.size()) +
                       " fields");
    double v[5];
    for (size_t k = 0; k < 5; ++k) {
      const auto number = ParseDouble(fields[k]);
      if (!number || (!std::isfinite(*number) && k != 2))
        throw InputError(where + ": expected a number, found '" + std::string(fields[k]) + "'");
      v[k] = *number;
    }
    Gcp fresh;
    fresh.has_height = std::isfinite(v[2]);
    const double height = fresh.has_height ? v[2] : 0;
    if (*utm_zone == 0) {
      fresh.position = Geodetic{v[1], v[0], height};
    } else {
      fresh.position = GeodeticFromUtm({std::abs(*utm_zone), *utm_zone > 0, v[0], v[1]}, height);
    }
    const std::string name =
        fields.size() > 6 ? std::string(fields[6]) : fmt::format("{},{},{}", fields[0], fields[1], fields[2]);
    const auto [it, is_new] = index.emplace(name, points.size());
    if (is_new) points.emplace_back(fields.size() > 6 ? name : fmt::format("gcp{}", points.size() + 1), fresh);
    // Pixels in these lists count from the corner of the first one.
    points[it->second].second.pixels.emplace_back(std::string(fields[5]), Eigen::Vector2d(v[3] - 0.5, v[4] - 0.5));
  }
  return points;
}

}  // namespace

ImportReport ImportOpenSfmGcp(const fs::path& site, const fs::path& file, const fs::path& images) {
  const fs::path control = site / "control_points.csv", observations = site / "control_observations.csv";
  for (const fs::path& out : {control, observations}) {
    if (fs::exists(out)) throw InputError(out.string() + ": is there already; move it away first");
  }
  ImportReport report;
  const auto points = file.extension() == ".json" ? ReadJson(file, images, &report) : ReadList(file);
  CsvWriter csv(
      {"point", "role", "latitude_deg", "longitude_deg", "height_m", "sigma_h_m", "sigma_v_m"},
      {"from " + file.filename().string() + "; heights as given; sigmas are a guess: put in what your survey says"});
  CsvWriter marks({"point", "image", "u", "v"}, {"pixels: the centre of the first one is 0, 0"});
  int written = 0, without = 0, marked = 0;
  for (const auto& [name, gcp] : points) {
    if (!gcp.position || !gcp.has_height) {
      ++without;
      continue;
    }
    LocalFrame check(*gcp.position);  // throws off the Earth
    csv.Text(name).Text("control").Number(gcp.position->latitude_deg, 10).Number(gcp.position->longitude_deg, 10);
    csv.Number(gcp.position->height_m, 4).Number(0.05, 3).Number(0.1, 3).EndRow();
    ++written;
    for (const auto& [image, pixel] : gcp.pixels) {
      marks.Text(name).Text(image).Number(pixel.x(), 3).Number(pixel.y(), 3).EndRow();
      ++marked;
    }
  }
  if (written == 0) throw InputError(file.string() + ": no point with a position");
  if (without > 0)
    report.warnings.push_back(fmt::format("{} points have no complete position and are left out", without));
  csv.Save(control);
  marks.Save(observations);
  report.files = {control, observations};
  report.lines.push_back(fmt::format("{} control points, {} marks in images", written, marked));
  return report;
}

}  // namespace trigpoint
