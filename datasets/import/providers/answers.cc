#include "datasets/import/providers/answers.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
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

// A file in memory for the readers of pictures; a kill leaves nothing of it on a disk.
class ScratchFile {
 public:
  explicit ScratchFile(std::string_view bytes) : fd_(memfd_create("picture", MFD_CLOEXEC)) {
    if (fd_ < 0) throw IoError("a picture in memory cannot be made: " + std::string(std::strerror(errno)));
    path_ = "/proc/self/fd/" + std::to_string(fd_);
    while (!bytes.empty()) {
      const ssize_t written = write(fd_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) {
        close(fd_);
        throw IoError("a picture of " + std::to_string(bytes.size()) + " bytes does not fit into memory");
      }
      bytes.remove_prefix(static_cast<size_t>(written));
    }
  }
  ~ScratchFile() { close(fd_); }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  int fd_;
  std::filesystem::path path_;
};

// What a reader of a scratch file throws, in words of where the file is from.
[[noreturn]] void FailAs(const InputError& e, const ScratchFile& file, const std::string& what) {
  std::string reason = e.what();
  const size_t at = reason.find(file.path().string());
  if (at != std::string::npos) reason.replace(at, file.path().string().size(), what);
  throw InputError(reason);
}

// At most so deep: each level of a deeper one would cost stack.
json ParseBounded(const std::string& text) {
  constexpr int kDeepest = 64;
  return json::parse(
      text, [](int depth, json::parse_event_t, json&) { return depth <= kDeepest; }, false);
}

// Does a refusal state, as Facebook's Graph API does, that the token is not or no longer valid?
bool NamesAToken(const std::string& body) {
  constexpr double kTokenCode = 190;
  const json answer = ParseBounded(body);
  const json* error = answer.is_object() ? ObjectIn(answer, "error") : nullptr;
  return error != nullptr && NumberIn(*error, "code") == kTokenCode;
}

[[noreturn]] void FailWith(const std::string& source, const std::string& url, const HttpAnswer& answer) {
  const int status = answer.status;
  const std::string at = source + ": " + WithoutQuery(url);
  if (status >= 400 && status < 500 && NamesAToken(answer.body)) {
    throw IoError(
        fmt::format("{} refuses the token (status {}, error 190): the token is missing, wrong or expired; "
                    "make a new one with the service and give it as in `trigpoint import --help`",
                    at, status));
  }
  if (status == 401 || status == 403) {
    throw IoError(
        fmt::format("{} refuses the request (status {}): the token is missing, wrong or expired; make a new one "
                    "with the service and give it as in `trigpoint import --help`",
                    at, status));
  }
  if (status == 429) {
    throw NetworkError(at + " refuses more requests for now (status 429); try again " +
                       (answer.retry_after_s ? fmt::format("in {:.0f} s", std::ceil(*answer.retry_after_s)) : "later"));
  }
  if (status >= 500) throw NetworkError(fmt::format("{} fails (status {}); try again later", at, status));
  throw InputError(fmt::format("{} answers with status {}", at, status));
}

}  // namespace

json ParseObject(const std::string& text, const std::string& what) {
  json document = ParseBounded(text);
  if (!document.is_object()) {
    throw InputError(what + ": expected a JSON object, found '" + Excerpt(ValidUtf8(text.substr(0, 60))) + "'");
  }
  return document;
}

json GetJson(HttpClient& client, const std::string& source, const std::string& url, const CancelToken& cancel,
             const std::string& post) {
  const HttpAnswer answer = client.Get(url, kMostJsonBytes, cancel, post);
  if (answer.status != 200) FailWith(source, url, answer);
  return ParseObject(answer.body, source + ": " + WithoutQuery(url));
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
  if (answer.status != 200 && answer.status != 206) FailWith(source, url, answer);
  return TakePicture(std::move(answer.body), source + ": panorama " + id, width);
}

PanoramaPicture TakePicture(std::string bytes, const std::string& what, int width) {
  constexpr int kNarrowest = 512, kWidest = 32'768;
  const ScratchFile file(bytes);
  PanoramaPicture picture;
  PhotoMetadata metadata;
  try {
    metadata = ReadPhotoMetadata(file.path());
    const int longest = std::max(metadata.width, metadata.height);
    if (longest > 0 && (longest < kNarrowest || longest > kWidest)) {  // before gigabytes are decoded for nothing
      throw InputError(fmt::format("{}: expected a picture from {} to {} px wide, found {} x {} px", what, kNarrowest,
                                   kWidest, metadata.width, metadata.height));
    }
    picture.pixels = LoadPanorama(file.path(), false, kWidest);
  } catch (const InputError& e) {
    FailAs(e, file, what);
  }
  const bool jpeg = bytes.starts_with("\xFF\xD8");
  const bool whole = metadata.width == picture.pixels.cols && metadata.orientation == 1;
  if (jpeg && whole && (width == 0 || metadata.width <= width)) {
    picture.jpeg = std::move(bytes);
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
