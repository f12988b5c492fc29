// Google Street View by the Map Tiles API, as documented at developers.google.com/maps/documentation/tile/streetview:
// a session token, the nearest panorama of up to 100 places a request, metadata (with the neighbours) and tiles of
// 512 px. A key of the user's own. Its policies forbid to keep pictures and positions: they are for the session only.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/import/providers/listing_service.h"
#include "datasets/io/expired_panoramas.h"
#include "datasets/io/readable.h"

namespace trigpoint {
namespace {

using nlohmann::json;

constexpr double kSeedSpacing_m = 25;  // between places that are asked for their nearest panorama
constexpr int kPlacesPerRequest = 100;
constexpr size_t kMostMetadata = 5000;  // each is a request that Google may bill
constexpr int kMostZoom = 5;
constexpr int64_t kMostAge_s = 24 * 3600;  // of what is kept for a session whose end is not stated

class GoogleStreetView final : public ListingService {
 public:
  explicit GoogleStreetView(const ServiceOptions& options)
      : ListingService("google", "Google Maps", options), key_(options.token) {
    // It stands in addresses.
    if (!IsPlainId(key_)) throw InputError("google: the key has characters other than letters, digits, - and _");
  }
  bool ForSessionOnly() const override { return true; }

  PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken& cancel) override {
    const auto found = sizes_.find(record.id);
    if (found == sizes_.end()) throw InputError("google: panorama " + record.id + " was not found before");
    const Size& size = found->second;
    // Each zoom level is half as wide as the next; the last is the whole picture.
    int zoom = kMostZoom;
    while (width > 0 && zoom > 0 && LevelOf(size.width, zoom - 1) >= width) --zoom;
    const int whole = LevelOf(size.width, zoom), columns = Parts(whole, size.tile), rows = Parts(whole / 2, size.tile);
    int64_t age_s = std::min(session_end_s_ - NowUtc_s(), kMostAge_s);
    cv::Mat picture(rows * size.tile, columns * size.tile, CV_8UC3);
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) {
        const cv::Rect at(x * size.tile, y * size.tile, size.tile, size.tile);
        Tile(record.id, zoom, x, y, size.tile, &age_s, cancel).copyTo(picture(at));
      }
    }
    PanoramaPicture result;
    result.keep_until_s = NowUtc_s() + age_s;
    result.pixels = picture(cv::Rect(0, 0, whole, whole / 2)).clone();
    if (width > 0 && whole > width) {
      cv::resize(result.pixels, result.pixels, {width, width / 2}, 0, 0, cv::INTER_AREA);
    }
    return result;
  }

 private:
  struct Size {
    int width = 0, tile = 0;  // px
  };
  static int LevelOf(int width, int zoom) { return Parts(width, 1 << (kMostZoom - zoom)); }
  static int Parts(int whole, int part) { return (whole + part - 1) / part; }

  void BeginSession(const CancelToken& cancel) {
    const std::string url = client_.base() + "/createSession?key=" + key_;
    json answer;
    try {
      answer = GetJson(client_, Name(), url, cancel, R"({"mapType":"streetview","language":"en-US","region":"US"})");
    } catch (const InputError& e) {
      throw InputError(std::string(e.what()) + "; is the key valid, and the Map Tiles API enabled for it?");
    }
    session_ = TextIn(answer, "session");
    if (session_.empty() || session_.find_first_of(" &#?/%") != std::string::npos) {
      throw InputError("google: " + WithoutQuery(url) + ": expected a session token, found none");
    }
    session_end_s_ = std::llround(std::clamp(NumberIn(answer, "expiry").value_or(0), 0.0, 1e11));
    if (session_end_s_ == 0) session_end_s_ = NowUtc_s() + kMostAge_s;
  }

  // "path?" or "path?name=value&" to the address with session and key.
  std::string Address(const std::string& path) const {
    return client_.base() + path + "session=" + session_ + "&key=" + key_;
  }

  // A session that has ended meanwhile is begun once more.
  json Ask(const std::string& path, const std::string& post, const CancelToken& cancel) {
    if (session_end_s_ <= NowUtc_s()) BeginSession(cancel);
    try {
      return GetJson(client_, Name(), Address(path), cancel, post);
    } catch (const IoError&) {  // of status 401 and 403
      BeginSession(cancel);
      return GetJson(client_, Name(), Address(path), cancel, post);
    }
  }

  void Search(const SearchArea& area, const CancelToken& cancel) override {
    std::set<std::string> seen;
    std::deque<std::string> next;
    const auto add = [&](const json& id) {
      if (!id.is_string() || id.get_ref<const std::string&>().empty()) return;
      if (IsPlainId(id.get<std::string>()) && seen.insert(id.get<std::string>()).second) next.push_back(id);
    };
    const std::vector<Geodetic> places = Places(area);
    for (size_t i = 0; i < places.size(); i += kPlacesPerRequest) {
      json locations = json::array();
      for (size_t k = i; k < std::min(places.size(), i + kPlacesPerRequest); ++k) {
        locations.push_back({{"lat", places[k].latitude_deg}, {"lng", places[k].longitude_deg}});
      }
      const json answer =
          Ask("/streetview/panoIds?",
              json{{"locations", locations}, {"radius", static_cast<int>(kSeedSpacing_m)}}.dump(), cancel);
      for (const json& id : ListIn(answer, "panoIds", client_.base() + "/streetview/panoIds")) add(id);
    }
    for (size_t asked = 0; !next.empty(); ++asked) {
      if (asked >= kMostMetadata) return NoteCut();
      const std::string id = next.front();
      next.pop_front();
      json answer;
      try {
        answer = Ask("/streetview/metadata?panoId=" + id + "&", "", cancel);
      } catch (const InputError&) {  // one that is gone, or whose answer is none
        Keep({}, std::nullopt, false);
        continue;
      }
      // Neighbours beyond the area lead away from it.
      if (!Take(id, answer)) continue;
      const auto links = answer.find("links");
      if (links == answer.end() || !links->is_array()) continue;
      for (const json& link : *links) {
        if (link.is_object() && link.contains("panoId")) add(link["panoId"]);
      }
    }
  }

  // A grid over the area, each place once.
  static std::vector<Geodetic> Places(const SearchArea& area) {
    constexpr double kMetresPerDegree = 111'200;
    constexpr size_t kMostPlaces = 20'000;
    std::vector<Geodetic> places;
    std::set<std::array<int64_t, 2>> cells;
    if (area.points.empty()) return places;
    const double dy = kSeedSpacing_m / kMetresPerDegree;
    const double dx = dy / std::max(0.01, std::cos(area.points.front().latitude_deg * kDegToRad));
    const auto reach = static_cast<int64_t>(std::ceil(area.radius_m / kSeedSpacing_m));
    for (const Geodetic& point : area.points) {
      const std::array<int64_t, 2> middle = {std::llround(point.latitude_deg / dy),
                                             std::llround(point.longitude_deg / dx)};
      for (int64_t y = -reach; y <= reach; ++y) {
        for (int64_t x = -reach; x <= reach; ++x) {
          const std::array<int64_t, 2> cell = {middle[0] + y, middle[1] + x};
          const Geodetic place{static_cast<double>(cell[0]) * dy, static_cast<double>(cell[1]) * dx, 0};
          if (!area.Contains(place) || !cells.insert(cell).second) continue;
          places.push_back(place);
          if (places.size() > kMostPlaces) {
            throw InputError(
                fmt::format("google: a search within {:g} m of {} is too large for one; take a smaller radius",
                            area.radius_m, Counted(area.points.size(), "point")));
          }
        }
      }
    }
    if (places.empty()) places.push_back(area.points.front());
    return places;
  }

  // Whether it lies in the area.
  bool Take(const std::string& asked, const json& answer) {
    PanoramaRecord record;
    record.id = TextIn(answer, "panoId");
    if (record.id != asked) record.id.clear();
    const auto latitude = NumberIn(answer, "lat"), longitude = NumberIn(answer, "lng");
    const auto position = latitude && longitude ? PointOf({{"coordinates", {*longitude, *latitude}}}) : std::nullopt;
    record.heading_deg = HeadingOf(NumberIn(answer, "heading"));
    // 90 deg: level.
    if (const auto tilt = NumberIn(answer, "tilt")) record.pitch_deg = *tilt - 90;
    record.roll_deg = NumberIn(answer, "roll");
    record.date = TextIn(answer, "date");
    record.owner = TextIn(answer, "copyright");
    record.width_px = WidthOf(NumberIn(answer, "imageWidth"));
    const double height = NumberIn(answer, "imageHeight").value_or(0), tile = NumberIn(answer, "tileWidth").value_or(0);
    constexpr int kWidest = 32'768;
    // A part of a sphere does not state which.
    const bool usable = record.width_px >= 512 && record.width_px <= kWidest && 2 * height == record.width_px &&
                        tile >= 128 && tile <= 2048 && tile == NumberIn(answer, "tileHeight").value_or(0);
    const std::string id = record.id;
    const Size size{record.width_px, static_cast<int>(tile)};
    if (!Keep(std::move(record), position, usable)) return false;
    sizes_[id] = size;
    return true;
  }

  // Shortens `age_s` to what the answer allows.
  cv::Mat Tile(const std::string& id, int zoom, int x, int y, int px, int64_t* age_s, const CancelToken& cancel) {
    const std::string what = fmt::format("google: tile {}/{}/{} of panorama {}", zoom, x, y, id);
    HttpAnswer answer;
    for (int attempt = 0; attempt < 2; ++attempt) {
      answer = client_.Get(Address(fmt::format("/streetview/tiles/{}/{}/{}?panoId={}&", zoom, x, y, id)),
                           kMostPictureBytes, cancel);
      if (answer.status != 401 && answer.status != 403) break;
      if (attempt == 0) BeginSession(cancel);
    }
    if (answer.status != 200) {
      const std::string reason = fmt::format("{} cannot be loaded (status {})", what, answer.status);
      if (answer.status == 429 || answer.status >= 500) throw NetworkError(reason + "; try again later");
      throw InputError(reason);
    }
    if (answer.max_age_s) *age_s = std::min(*age_s, *answer.max_age_s);
    if (*age_s <= 0) throw InputError(what + ": the service forbids to store it (Cache-Control)");
    const cv::Mat tile = DecodeDownload(answer.body, what);
    if (tile.cols != px || tile.rows != px) {
      throw InputError(fmt::format("{}: expected {} x {} px, found {} x {} px", what, px, px, tile.cols, tile.rows));
    }
    return tile;
  }

  std::string key_, session_;
  int64_t session_end_s_ = 0;  // UTC
  std::map<std::string, Size> sizes_;
};

}  // namespace

std::unique_ptr<PanoramaProvider> OpenGoogleStreetView(const ServiceOptions& options) {
  return std::make_unique<GoogleStreetView>(options);
}

}  // namespace trigpoint
