#include "datasets/import/providers/answers.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

using nlohmann::json;

// A file of its own in the system's folder for such, gone with its owner.
class ScratchFile {
 public:
  explicit ScratchFile(const std::string& bytes) {
    std::string name = (std::filesystem::temp_directory_path() / "trigpoint_XXXXXX.jpg").string();
    const int fd = mkstemps(name.data(), 4);
    if (fd < 0) throw IoError(name + ": cannot be made");
    close(fd);
    path_ = name;
    WriteFileAtomically(path_, bytes);
  }
  ~ScratchFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// What a reader of a scratch file throws, in words of where the file is from.
[[noreturn]] void FailAs(const InputError& e, const ScratchFile& file, const std::string& what) {
  std::string reason = e.what();
  const size_t at = reason.find(file.path().string());
  if (at != std::string::npos) reason.replace(at, file.path().string().size(), what);
  throw InputError(reason);
}

[[noreturn]] void FailWith(const std::string& source, const std::string& url, int status) {
  const std::string at = source + ": " + WithoutQuery(url);
  if (status == 401 || status == 403) {
    throw IoError(
        fmt::format("{} refuses the request (status {}): the token is missing, wrong or expired; make a new one "
                    "with the service and give it as in `trigpoint import --help`",
                    at, status));
  }
  if (status == 429) throw NetworkError(at + " refuses more requests for now (status 429); try again later");
  if (status >= 500) throw NetworkError(fmt::format("{} fails (status {}); try again later", at, status));
  throw InputError(fmt::format("{} answers with status {}", at, status));
}

}  // namespace

json GetJson(HttpClient& client, const std::string& source, const std::string& url, const CancelToken& cancel,
             const std::string& post) {
  const HttpAnswer answer = client.Get(url, kMostJsonBytes, cancel, post);
  if (answer.status != 200) FailWith(source, url, answer.status);
  // Depth is bounded: each level of a deeper one would cost stack.
  constexpr int kDeepest = 64;
  json document = json::parse(
      answer.body, [](int depth, json::parse_event_t, json&) { return depth <= kDeepest; }, false);
  if (!document.is_object()) {
    throw InputError(source + ": " + WithoutQuery(url) + ": expected a JSON object, found '" +
                     Excerpt(ValidUtf8(answer.body.substr(0, 60))) + "'");
  }
  return document;
}

std::optional<double> NumberIn(const json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end()) return std::nullopt;
  std::optional<double> value;
  if (it->is_number()) value = it->get<double>();
  if (it->is_string()) value = ParseDouble(it->get<std::string>());
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::string TextIn(const json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end() || !it->is_string()) return "";
  std::string text = it->get<std::string>().substr(0, 300);
  for (char& c : text) {
    if ((c >= 0 && c < ' ') || c == '\x7f') c = ' ';
  }
  return ValidUtf8(Trim(text));
}

const json* ObjectIn(const json& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_object() ? &*it : nullptr;
}

std::optional<Geodetic> PointOf(const json& geometry) {
  const auto it = geometry.find("coordinates");
  if (it == geometry.end() || !it->is_array() || it->size() < 2 || !(*it)[0].is_number() || !(*it)[1].is_number()) {
    return std::nullopt;
  }
  const Geodetic point{(*it)[1].get<double>(), (*it)[0].get<double>(), 0};
  const bool there = std::abs(point.latitude_deg) <= 90 && std::abs(point.longitude_deg) <= 180 &&
                     (point.latitude_deg != 0 || point.longitude_deg != 0);
  return there ? std::optional<Geodetic>(point) : std::nullopt;
}

bool IsPlainId(const std::string& id) {
  return !id.empty() && id.size() <= 128 && std::all_of(id.begin(), id.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_';
  });
}

PanoramaPicture GetPicture(HttpClient& client, const std::string& source, const std::string& id, const std::string& url,
                           int width, const CancelToken& cancel) {
  HttpAnswer answer = client.Get(url, kMostPictureBytes, cancel);
  if (answer.status >= 400 && answer.status < 500 && answer.status != 429) {
    throw InputError(
        fmt::format("{}: the picture of panorama {} cannot be loaded (status {})", source, id, answer.status));
  }
  if (answer.status != 200 && answer.status != 206) FailWith(source, url, answer.status);
  const ScratchFile file(answer.body);
  PanoramaPicture picture;
  try {
    picture.pixels = LoadPanorama(file.path(), false);
  } catch (const InputError& e) {
    FailAs(e, file, source + ": panorama " + id);
  }
  const PhotoMetadata metadata = ReadPhotoMetadata(file.path());
  const bool jpeg = answer.body.starts_with("\xFF\xD8");
  const bool whole = metadata.width == picture.pixels.cols && metadata.orientation == 1;
  if (jpeg && whole && (width == 0 || metadata.width <= width)) {
    picture.jpeg = std::move(answer.body);
  } else if (width > 0 && picture.pixels.cols > width) {
    cv::resize(picture.pixels, picture.pixels, {width, width / 2}, 0, 0, cv::INTER_AREA);
  }
  return picture;
}

cv::Mat DecodeDownload(const std::string& bytes, const std::string& what) {
  const ScratchFile file(bytes);
  try {
    return LoadPicture(file.path(), false);
  } catch (const InputError& e) {
    FailAs(e, file, what);
  }
}

std::vector<std::array<double, 4>> BoxesOf(const SearchArea& area, double most_deg) {
  constexpr double kMetresPerDegree = 111'000;  // a little less than there are: boxes are a little larger
  constexpr size_t kMostBoxes = 10'000;
  std::set<std::array<int64_t, 2>> cells;
  std::vector<std::array<double, 4>> boxes;
  for (const Geodetic& point : area.points) {
    const double dy = area.radius_m / kMetresPerDegree;
    const double dx = dy / std::max(0.01, std::cos(point.latitude_deg * kDegToRad));
    if (area.points.size() == 1 && 2 * dx <= most_deg) {
      return {{point.longitude_deg - dx, point.latitude_deg - dy, point.longitude_deg + dx, point.latitude_deg + dy}};
    }
    // Cells of a fixed grid, so that neighbouring points share them.
    const auto cell = [&](double degrees) { return static_cast<int64_t>(std::floor(degrees / most_deg)); };
    for (int64_t y = cell(point.latitude_deg - dy); y <= cell(point.latitude_deg + dy); ++y) {
      for (int64_t x = cell(point.longitude_deg - dx); x <= cell(point.longitude_deg + dx); ++x) {
        if (!cells.insert({x, y}).second) continue;
        const double west = static_cast<double>(x) * most_deg, south = static_cast<double>(y) * most_deg;
        boxes.push_back({west, south, west + most_deg, south + most_deg});
        if (boxes.size() > kMostBoxes) {
          throw InputError(
              fmt::format("a search within {:g} m of {} points is too large for one; take a smaller radius",
                          area.radius_m, area.points.size()));
        }
      }
    }
  }
  return boxes;
}

}  // namespace trigpoint
