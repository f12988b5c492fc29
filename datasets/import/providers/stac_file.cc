// A file with STAC items: an item, a FeatureCollection or an ItemCollection. Pictures lie below the file's folder or at
// http(s) addresses.
#include <algorithm>

#include "calib/base/error.h"
#include "datasets/import/providers/listing_service.h"
#include "datasets/import/source_links.h"
#include "datasets/io/path_error.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

bool IsAddress(const std::string& href) { return href.find("://") != std::string::npos; }

json ReadStac(const fs::path& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  if (error) throw InputError(file.string() + ": there is no such file");
  if (size > kMostJsonBytes) {
    throw InputError(file.string() + ": expected a STAC file of at most " + std::to_string(kMostJsonBytes >> 20) +
                     " MiB, found " + std::to_string(size >> 20) + " MiB; divide it");
  }
  return ParseObject(ReadTextFile(file), file.string());
}

bool HasAssets(const json& item) { return item.is_object() && ObjectIn(item, "assets") != nullptr; }

// The items of a document that is STAC; null: it is not.
const json* ItemsOf(const json& document) {
  const std::string type = TextIn(document, "type");
  if (type == "Feature") return HasAssets(document) ? &document : nullptr;
  if (type != "FeatureCollection" && type != "ItemCollection") return nullptr;
  const auto items = document.find("features");
  if (items == document.end() || !items->is_array()) return nullptr;
  return items->empty() || std::any_of(items->begin(), items->end(), HasAssets) ? &*items : nullptr;
}

class StacFile final : public ListingService {
 public:
  StacFile(fs::path file, std::vector<StacItem> items, const std::string& base)
      : ListingService("stac", "", {base, "", {}}), file_(std::move(file)), items_(std::move(items)) {}

  PanoramaPicture Load(const PanoramaRecord& record, int width, const CancelToken& cancel) override {
    const auto found = hrefs_.find(record.id);
    if (found == hrefs_.end()) throw InputError(file_.string() + ": panorama " + record.id + " was not found before");
    const std::string& href = found->second;
    if (IsAddress(href)) return GetPicture(client_, Name(), record.id, href, width, cancel);
    const fs::path folder = file_.has_parent_path() ? file_.parent_path() : fs::path(".");
    const fs::path picture = PictureFile(record.id, folder, href);
    RequireInside(folder, picture);
    std::error_code error;
    const auto size = fs::file_size(picture, error);
    if (error) {
      throw InputError(file_.string() + ": panorama " + record.id + ": there is no file " + picture.string() +
                       " below the file's folder");
    }
    if (size > kMostPictureBytes) {
      throw InputError(picture.string() + ": expected a picture of at most " + std::to_string(kMostPictureBytes >> 20) +
                       " MiB, found " + std::to_string(size >> 20) + " MiB");
    }
    return TakePicture(ReadTextFile(picture), picture.string(), width);
  }

 private:
  // An address's %20 is a space, unless there is a file of that very name.
  fs::path PictureFile(const std::string& id, const fs::path& folder, const std::string& href) const {
    const std::string plain = fs::exists(folder / href) ? href : Unescaped(href);
    try {
      return ResolveInside(folder, folder, plain, file_.string());
    } catch (const PathError&) {
      throw InputError(file_.string() + ": panorama " + id + ": names the picture " + Excerpt(href) +
                       "; expected one in or below the file's folder, or an address that begins with https://");
    }
  }

  void Search(const SearchArea&, const CancelToken&) override {
    for (const StacItem& item : items_) {
      if (Full()) return;
      if (item.part) {
        NotePart();
        continue;
      }
      const std::string& href = item.full.empty() ? item.small : item.full;
      if (Keep(item.record, item.position, !href.empty())) hrefs_[item.record.id] = href;
    }
  }

  fs::path file_;
  std::vector<StacItem> items_;
  std::map<std::string, std::string> hrefs_;
};

}  // namespace

bool IsStacFile(const fs::path& file) {
  try {
    return ItemsOf(ReadStac(file)) != nullptr;
  } catch (const InputError&) {
    return false;
  }
}

std::unique_ptr<PanoramaProvider> OpenStacFile(const fs::path& file) {
  const json document = ReadStac(file);
  const json* found = ItemsOf(document);
  if (found == nullptr) {
    throw InputError(file.string() +
                     ": expected a STAC Item, or a FeatureCollection of Items with \"assets\", found '" +
                     TextIn(document, "type") + "'");
  }
  std::vector<StacItem> items;
  // The client trusts http on this machine only if its own address is there.
  std::string base = "https://localhost";
  const auto take = [&](const json& feature) {
    std::optional<StacItem> item = ReadStacItem(feature);
    if (!item) return;
    for (const std::string& href : {item->full, item->small}) {
      if (IsOnThisMachine(OriginOf(href))) base = OriginOf(href);
    }
    items.push_back(std::move(*item));
  };
  if (found->is_array()) {
    for (const json& feature : *found) take(feature);
  } else {
    take(*found);
  }
  return std::make_unique<StacFile>(file, std::move(items), base);
}

}  // namespace trigpoint
