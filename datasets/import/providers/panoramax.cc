// Panoramax: a STAC API (1.0.0) with the extensions view and perspective imagery. No key. Documented at
// docs.panoramax.fr.
#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "calib/base/error.h"
#include "datasets/import/providers/listing_service.h"
#include "datasets/io/readable.h"

namespace trigpoint {
namespace {

using nlohmann::json;

constexpr double kPanoramaxBox_deg = 0.02;
constexpr size_t kItemsPerPage = 1000;
// The accuracy is the radius that holds 95 %, of two axes alike.
constexpr double kRadius95PerSigma = 2.4477;

std::string OwnerOf(const json& item, const json& properties) {
  const auto providers = item.find("providers");
  if (providers != item.end() && providers->is_array()) {
    for (const json& provider : *providers) {
      if (!provider.is_object()) continue;
      const auto roles = provider.find("roles");
      const bool producer = roles != provider.end() && roles->is_array() &&
                            std::find(roles->begin(), roles->end(), "producer") != roles->end();
      if (producer && !TextIn(provider, "name").empty()) return TextIn(provider, "name");
    }
  }
  return TextIn(properties, "geovisio:producer");
}

// The address of the first picture among assets of any names, thumbnails aside.
std::string AnyPicture(const json& assets) {
  for (const auto& asset : assets) {
    if (!asset.is_object() || !TextIn(asset, "type").starts_with("image/")) continue;
    const auto roles = asset.find("roles");
    const bool thumbnail = roles != asset.end() && roles->is_array() &&
                           std::find(roles->begin(), roles->end(), "thumbnail") != roles->end();
    const auto href = asset.find("href");
    if (!thumbnail && href != asset.end() && href->is_string()) return href->get<std::string>();
  }
  return "";
}

}  // namespace

std::optional<StacItem> ReadStacItem(const json& item) {
  const json* properties = item.is_object() ? ObjectIn(item, "properties") : nullptr;
  if (properties == nullptr) return std::nullopt;
  StacItem read;
  PanoramaRecord& record = read.record;
  record.id = TextIn(item, "id");
  const json* geometry = ObjectIn(item, "geometry");
  if (geometry != nullptr) read.position = PointOf(*geometry);
  if (const json* assets = ObjectIn(item, "assets")) {
    for (const auto& [name, url] : {std::pair{"hd", &read.full}, std::pair{"sd", &read.small}}) {
      const json* asset = ObjectIn(*assets, name);
      const auto href = asset != nullptr ? asset->find("href") : json::const_iterator();
      if (asset != nullptr && href != asset->end() && href->is_string()) *url = href->get<std::string>();
    }
    if (read.full.empty() && read.small.empty()) read.full = AnyPicture(*assets);
  }
  record.heading_deg = NumberIn(*properties, "view:azimuth");
  record.pitch_deg = NumberIn(*properties, "pers:pitch");
  record.roll_deg = NumberIn(*properties, "pers:roll");
  if (const auto accuracy = NumberIn(*properties, "quality:horizontal_accuracy"); accuracy && *accuracy != 0) {
    record.sigma_h_m = *accuracy / kRadius95PerSigma;
  }
  record.date = TextIn(*properties, "datetime");
  record.owner = OwnerOf(item, *properties);
  record.licence = TextIn(*properties, "license");
  if (const json* interior = ObjectIn(*properties, "pers:interior_orientation")) {
    read.whole_turn = NumberIn(*interior, "field_of_view") == 360.0;
    read.part = interior->contains("field_of_view") && !read.whole_turn;
    const auto size = interior->find("sensor_array_dimensions");
    if (size != interior->end() && size->is_array() && !size->empty() && (*size)[0].is_number()) {
      record.width_px = ListingService::WidthOf((*size)[0].get<double>());
    }
  }
  return read;
}

namespace {

class Panoramax final : public ListingService {
 public:
  explicit Panoramax(const ServiceOptions& options) : ListingService("panoramax", "Panoramax", options) {}

  PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken& cancel) override {
    const auto files = files_.find(record.id);
    if (files == files_.end()) throw InputError("panoramax: panorama " + record.id + " was not found before");
    // The small derivate is 2048 px wide.
    const bool small = width > 0 && width <= 2048 && !files->second.small.empty();
    const std::string& url = small || files->second.full.empty() ? files->second.small : files->second.full;
    return GetPicture(client_, Name(), record.id, url, width, cancel);
  }

 private:
  void Search(const SearchArea& area, const CancelToken& cancel) override {
    for (const Box& box : BoxesOf(area, kPanoramaxBox_deg)) FindInBox(box, 0, cancel);
  }

  // Page by page. Servers without pages fill the first one: then the box is cut into four.
  void FindInBox(const Box& box, int halvings, const CancelToken& cancel) {
    const auto [west, south, east, north] = box;
    std::string url = fmt::format("{}/search?bbox={:.7f},{:.7f},{:.7f},{:.7f}&limit={}", client_.base(), west, south,
                                  east, north, kItemsPerPage);
    std::set<std::string> visited;
    while (!url.empty() && !Full()) {
      if (static_cast<int>(visited.size()) >= kMostPages || !visited.insert(url).second) return NoteCut();
      const json page = GetJson(client_, Name(), url, cancel);
      const json& items = ListIn(page, "features", url);
      url = NextPage(page);
      const bool cut = url.empty() && items.size() >= kItemsPerPage && visited.size() == 1;
      if (cut && Divide(box, halvings, [&](const Box& quarter) { FindInBox(quarter, halvings + 1, cancel); })) return;
      for (const json& item : items) Take(item);
    }
  }

  // The next page's address, if there is one and it is on the same server.
  std::string NextPage(const json& page) const {
    const auto links = page.find("links");
    if (links == page.end() || !links->is_array()) return "";
    for (const json& link : *links) {
      if (!link.is_object() || TextIn(link, "rel") != "next") continue;
      const auto href = link.find("href");
      if (href == link.end() || !href->is_string()) return "";
      const std::string url = href->get<std::string>();
      if (OriginOf(url) == OriginOf(client_.base())) return url;
      throw InputError("panoramax: the service names as its next page " + Excerpt(WithoutQuery(url)) +
                       "; expected one of the same server");
    }
    return "";
  }

  void Take(const json& item) {
    std::optional<StacItem> read = ReadStacItem(item);
    if (!read || !read->whole_turn) return;
    const std::string id = read->record.id;
    if (Keep(std::move(read->record), read->position, !read->full.empty() || !read->small.empty())) {
      files_[id] = {read->full, read->small};
    }
  }

  struct Files {
    std::string full, small;
  };
  std::map<std::string, Files> files_;
};

}  // namespace

std::unique_ptr<PanoramaProvider> OpenPanoramax(const ServiceOptions& options) {
  return std::make_unique<Panoramax>(options);
}

}  // namespace trigpoint
