#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/base/error.h"
#include "datasets/import/panorama_provider.h"
#include "datasets/import/providers/answers.h"
#include "datasets/import/source_links.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const json* Member(const json& object, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    const auto it = object.find(name);
    if (it != object.end() && !it->is_null()) return &*it;
  }
  return nullptr;
}

std::optional<double> Number(const json& object, std::initializer_list<const char*> names) {
  const json* member = Member(object, names);
  if (member == nullptr) return std::nullopt;
  if (member->is_number()) {
    const double v = member->get<double>();
    return std::isfinite(v) ? std::optional<double>(v) : std::nullopt;
  }
  return member->is_string() ? ParseDouble(member->get<std::string>()) : std::nullopt;
}

std::optional<PanoramaRecord> ReadRecord(const json& object, const std::string& where, const std::string& fallback_id,
                                         std::vector<std::string>* warnings) {
  const auto skip = [&](const std::string& why) {
    warnings->push_back(where + ": " + why + "; the panorama is skipped");
    return std::nullopt;
  };
  if (!object.is_object()) return skip("expected an object");
  PanoramaRecord record;
  const json* id = Member(object, {"id", "pano_id", "panoId", "panoid", "pano"});
  record.id = id == nullptr ? fallback_id : id->is_string() ? id->get<std::string>() : id->dump();
  if (record.id.empty() || record.id.find_first_of("/\\") != std::string::npos || record.id.front() == '.') {
    return skip("'" + record.id + "' is no id that a file can be named by");
  }
  const json* nested = Member(object, {"location", "position", "coordinate", "coordinates", "latLng"});
  const json& place = nested != nullptr && nested->is_object() ? *nested : object;
  const auto latitude = Number(place, {"latitude", "latitude_deg", "lat"});
  const auto longitude = Number(place, {"longitude", "longitude_deg", "lng", "lon"});
  if (!latitude || !longitude) return skip("panorama " + record.id + " has no latitude and longitude");
  if (std::abs(*latitude) > 90 || std::abs(*longitude) > 180) {
    return skip(
        fmt::format("panorama {}: latitude {}, longitude {} is out of range", record.id, *latitude, *longitude));
  }
  record.position = {*latitude, *longitude, 0};
  auto height = Number(place, {"altitude", "elevation", "height_m"});
  // Beside a width it is the picture's, in pixels.
  if (!height && Member(place, {"width"}) == nullptr) height = Number(place, {"height"});
  if (height) {
    record.position.height_m = *height;
    record.has_height = true;
  }
  const json* pov = Member(object, {"pov", "orientation", "pose"});
  const json& angles = pov != nullptr && pov->is_object() ? *pov : object;
  record.heading_deg = Number(angles, {"heading", "heading_deg", "yaw", "compass_angle", "originHeading"});
  record.pitch_deg = Number(angles, {"pitch", "pitch_deg", "originPitch"});
  if (const auto tilt = Number(angles, {"tilt"}); tilt && !record.pitch_deg) record.pitch_deg = *tilt - 90;
  record.roll_deg = Number(angles, {"roll", "roll_deg"});
  const json* date = Member(object, {"date", "captured_at", "imageDate", "capture_date"});
  if (date != nullptr) record.date = date->is_string() ? date->get<std::string>() : date->dump();
  for (const char* name : {"licence", "license"})
    record.licence = record.licence.empty() ? TextIn(object, name) : record.licence;
  for (const char* name : {"attribution", "copyright"}) {
    if (record.attribution.empty()) record.attribution = TextIn(object, name);
  }
  return record;
}

constexpr const char* kFaces[] = {"front", "right", "back", "left", "up", "down"};

class PanoramaFolder final : public PanoramaProvider {
 public:
  explicit PanoramaFolder(const fs::path& dir) : dir_(dir) {
    if (!fs::is_directory(dir)) throw InputError(dir.string() + ": there is no such folder");
    std::set<std::string> seen;
    int impossible = 0;
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(dir)) {
      if (entry.path().extension() == ".json") files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) {
      RequireInside(dir, file);
      const json document = json::parse(ReadTextFile(file), nullptr, false);
      if (document.is_discarded()) {
        warnings_.push_back(file.string() + ": is no JSON; it is skipped");
        continue;
      }
      const json* list = document.is_object() ? Member(document, {"panoramas", "panos", "data", "images"}) : &document;
      const bool many = list != nullptr && list->is_array();
      const size_t count = many ? list->size() : 1;
      for (size_t i = 0; i < count; ++i) {
        const std::string where = many ? fmt::format("{}, entry {}", file.string(), i) : file.string();
        auto record = ReadRecord(many ? (*list)[i] : document, where, many ? "" : file.stem().string(), &warnings_);
        if (!record) continue;
        impossible += TakeOutImpossible(&*record);
        if (!seen.insert(record->id).second) {
          warnings_.push_back(where + ": panorama " + record->id + " is there twice; the first is kept");
          continue;
        }
        records_.push_back(*record);
      }
    }
    if (impossible > 0) warnings_.push_back(ImpossibleValues(dir.string(), impossible));
    if (records_.empty()) {
      throw InputError(dir.string() +
                       ": no panorama with a position; expected JSON files with id, latitude, longitude" +
                       (warnings_.empty() ? "" : "; the first problem: " + warnings_.front()));
    }
  }

  std::string Name() const override { return dir_.string(); }
  std::vector<std::string> Warnings() const override { return warnings_; }
  // Street View style positions: levelled in roll but not in the vehicle's pitch.
  SourceQuality Sigmas() const override { return {0.6, 20, 1, 2.5}; }

  std::vector<PanoramaRecord> Find(const SearchArea& area, const CancelToken&) override {
    std::vector<PanoramaRecord> found;
    for (const PanoramaRecord& record : records_) {
      if (area.Contains(record.position)) found.push_back(record);
    }
    return found;
  }

  PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken&) override {
    cv::Mat whole = Whole(record.id);
    if (width > 0 && whole.cols > width) cv::resize(whole, whole, {width, width / 2}, 0, 0, cv::INTER_AREA);
    return {"", whole};
  }

 private:
  cv::Mat Whole(const std::string& id) const {
    for (const char* ending : {".jpg", ".jpeg", ".png", ".tif", ".JPG"}) {
      if (!fs::exists(dir_ / (id + ending))) continue;
      RequireInside(dir_, dir_ / (id + ending));
      return LoadPanorama(dir_ / (id + ending), false);
    }
    const fs::path parts = dir_ / id;
    if (!fs::is_directory(parts)) {
      throw InputError(dir_.string() + ": no picture of panorama " + id + "; expected " + id + ".jpg, or a folder " +
                       id + "/ with tiles or faces");
    }
    std::vector<cv::Mat> faces(6);
    bool any = false;
    for (size_t f = 0; f < 6; ++f) {
      const fs::path file = Picture(parts, {kFaces[f], std::to_string(f)});
      if (file.empty()) continue;
      RequireInside(dir_, file);
      faces[f] = LoadPicture(file, false);
      any = true;
    }
    if (any) {
      for (size_t f = 0; f < 4; ++f) {
        if (faces[f].empty()) throw InputError(parts.string() + ": the face " + kFaces[f] + " is missing");
      }
      return AssembleFaces(faces, 4 * faces[0].cols);
    }
    std::map<int, std::map<int, fs::path>> tiles;  // row, column
    for (const fs::path& file : PicturesIn(parts)) {
      std::string stem = file.stem().string();
      if (stem.starts_with("tile_")) stem = stem.substr(5);
      const size_t bar = stem.find('_');
      const auto x = ParseInt(stem.substr(0, bar)),
                 y = bar == std::string::npos ? std::nullopt : ParseInt(stem.substr(bar + 1));
      if (!x || !y || *x < 0 || *y < 0 || *x > 255 || *y > 255) continue;
      RequireInside(dir_, file);
      tiles[static_cast<int>(*y)][static_cast<int>(*x)] = file;
    }
    if (tiles.empty()) throw InputError(parts.string() + ": neither faces (front.jpg, ...) nor tiles (<x>_<y>.jpg)");
    const int columns = tiles.begin()->second.rbegin()->first + 1, rows = tiles.rbegin()->first + 1;
    std::vector<std::vector<cv::Mat>> grid;
    for (int y = 0; y < rows; ++y) {
      grid.emplace_back();
      for (int x = 0; x < columns; ++x) {
        if (tiles[y].count(x) == 0) throw InputError(fmt::format("{}: tile {}_{} is missing", parts.string(), x, y));
        grid.back().push_back(LoadPicture(tiles[y][x], false));
      }
    }
    return AssembleTiles(grid);
  }

  static fs::path Picture(const fs::path& dir, const std::vector<std::string>& stems) {
    for (const std::string& stem : stems) {
      for (const char* ending : {".jpg", ".jpeg", ".png"}) {
        if (fs::exists(dir / (stem + ending))) return dir / (stem + ending);
      }
    }
    return {};
  }

  fs::path dir_;
  std::vector<PanoramaRecord> records_;
  std::vector<std::string> warnings_;
};

}  // namespace

std::unique_ptr<PanoramaProvider> OpenPanoramaFolder(const fs::path& dir) {
  return std::make_unique<PanoramaFolder>(dir);
}

cv::Mat AssembleTiles(const std::vector<std::vector<cv::Mat>>& rows) {
  std::vector<cv::Mat> lines;
  for (const auto& row : rows) {
    cv::Mat line;
    for (const cv::Mat& tile : row) {
      if (tile.rows != row.front().rows) throw InputError("tiles of one row differ in height");
    }
    cv::hconcat(row, line);
    lines.push_back(line);
  }
  for (const cv::Mat& line : lines) {
    if (line.cols != lines.front().cols) throw InputError("rows of tiles differ in width");
  }
  cv::Mat whole;
  cv::vconcat(lines, whole);
  // Services fill the last column and row with black beyond the picture: it is twice as wide as high.
  const int width = std::min(whole.cols, 2 * whole.rows), height = width / 2;
  return whole(cv::Rect(0, 0, width, height)).clone();
}

cv::Mat AssembleFaces(const std::vector<cv::Mat>& faces, int width) {
  const int height = width / 2;
  cv::Mat panorama(height, width, CV_8UC3, cv::Scalar::all(0));
  // Faces look along z turned by 0, 90, 180, 270 deg to the right, up and down; x right, y down in each.
  for (size_t f = 0; f < faces.size() && f < 6; ++f) {
    const cv::Mat& face = faces[f];
    if (face.empty()) continue;
    if (face.rows != face.cols)
      throw InputError(fmt::format("face {} is {} x {} px, expected a square", kFaces[f], face.cols, face.rows));
    cv::Mat map_x(height, width, CV_32F), map_y(height, width, CV_32F);
    const double half = 0.5 * face.cols;
    for (int v = 0; v < height; ++v) {
      const double latitude = (0.5 - (v + 0.5) / height) * M_PI;
      for (int u = 0; u < width; ++u) {
        const double longitude = ((u + 0.5) / width - 0.5) * 2 * M_PI;
        const double x = std::cos(latitude) * std::sin(longitude), y = -std::sin(latitude),
                     z = std::cos(latitude) * std::cos(longitude);
        double a = 0, b = 0, c = 0;  // right, down, forward of the face
        switch (f) {
          case 0: a = x, b = y, c = z; break;
          case 1: a = -z, b = y, c = x; break;
          case 2: a = -x, b = y, c = -z; break;
          case 3: a = z, b = y, c = -x; break;
          case 4: a = x, b = z, c = -y; break;
          default: a = x, b = -z, c = y; break;
        }
        const bool inside = c > 0 && std::abs(a) <= c && std::abs(b) <= c;
        map_x.at<float>(v, u) = inside ? static_cast<float>(half * (1 + a / c) - 0.5) : -10.F;
        map_y.at<float>(v, u) = inside ? static_cast<float>(half * (1 + b / c) - 0.5) : -10.F;
      }
    }
    cv::Mat part, mask = map_x > -5;
    cv::remap(face, part, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    part.copyTo(panorama, mask);
  }
  return panorama;
}

}  // namespace trigpoint
