// KartaView's API, version 2.0, as documented at kartaview.org/doc: photos by box, page by page. No token.
#include <fmt/format.h>

#include <algorithm>

#include "calib/base/error.h"
#include "datasets/import/providers/listing_service.h"

namespace trigpoint {
namespace {

using nlohmann::json;

constexpr double kKartaViewBox_deg = 0.01;
constexpr int kPhotosPerPage = 500;

class KartaView final : public ListingService {
 public:
  explicit KartaView(const ServiceOptions& options)
      : ListingService("kartaview", "(c) Grab and KartaView Contributors", options) {}

  PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken& cancel) override {
    const auto url = urls_.find(record.id);
    if (url == urls_.end()) throw InputError("kartaview: panorama " + record.id + " was not found before");
    return GetPicture(client_, Name(), record.id, url->second, width, cancel);
  }

 private:
  void Search(const SearchArea& area, const CancelToken& cancel) override {
    for (const auto& [west, south, east, north] : BoxesOf(area, kKartaViewBox_deg)) {
      for (int page = 1; !Full(); ++page) {
        if (page > kMostPages) return NoteCut();
        const std::string url =
            fmt::format("{}/2.0/photo/?nwLat={:.7f}&nwLng={:.7f}&seLat={:.7f}&seLng={:.7f}&page={}&itemsPerPage={}",
                        client_.base(), north, west, south, east, page, kPhotosPerPage);
        const json answer = GetJson(client_, Name(), url, cancel);
        if (IsEmpty(answer, url)) break;
        const json* stated = ObjectIn(answer, "result");
        const json result = stated != nullptr ? *stated : json::object();
        const json& photos = ListIn(result, "data", url);
        for (const json& photo : photos) Take(photo);
        if (photos.empty() || result.value("hasMoreData", json()) != true) break;
      }
    }
  }

  // The service states errors in an answer of HTTP status 200: nothing is there; done, or with incidents.
  static bool IsEmpty(const json& answer, const std::string& url) {
    constexpr double kNothing = 601, kDone = 600, kDoneInParts = 602, kNotAuthenticated = 401;
    const json* status = ObjectIn(answer, "status");
    const auto code = status != nullptr ? NumberIn(*status, "apiCode") : std::nullopt;
    if (!code || *code == kDone || *code == kDoneInParts) return false;
    if (*code == kNothing) return true;
    const std::string at = fmt::format("kartaview: {} answers with apiCode {:g}", WithoutQuery(url), *code);
    if (*code == kNotAuthenticated) {
      throw IoError(at + ": the service gives this list to registered clients only; take another service");
    }
    throw InputError(fmt::format("{}, expected {:g}; try again later", at, kDone));
  }

  void Take(const json& photo) {
    if (!photo.is_object() || TextIn(photo, "projection") != "SPHERE") return;
    PanoramaRecord record;
    record.id = TextIn(photo, "id");
    const auto latitude = NumberIn(photo, "lat"), longitude = NumberIn(photo, "lng");
    const auto position = latitude && longitude ? PointOf({{"coordinates", {*longitude, *latitude}}}) : std::nullopt;
    record.heading_deg = HeadingOf(NumberIn(photo, "heading"));
    record.date = TextIn(photo, "shotDate");
    std::replace(record.date.begin(), record.date.end(), ' ', 'T');
    record.licence = kByTerms;
    record.width_px = WidthOf(NumberIn(photo, "width"));
    // The processed picture has faces and plates blurred.
    std::string url = TextIn(photo, "fileurlProc");
    if (url.empty()) {
      constexpr std::string_view kSize = "{{sizeprefix}}";
      url = TextIn(photo, "fileurl");
      if (const size_t at = url.find(kSize); at != std::string::npos) url.replace(at, kSize.size(), "proc");
    }
    const std::string id = record.id;
    if (Keep(std::move(record), position, !url.empty())) urls_[id] = url;
  }

  std::map<std::string, std::string> urls_;
};

}  // namespace

std::unique_ptr<PanoramaProvider> OpenKartaView(const ServiceOptions& options) {
  return std::make_unique<KartaView>(options);
}

}  // namespace trigpoint
