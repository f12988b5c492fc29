#include "datasets/import/providers/listing_service.h"

#include <fmt/format.h>

#include "calib/base/counted.h"
#include "calib/base/error.h"

namespace trigpoint {

std::vector<PanoramaRecord> ListingService::Find(const SearchArea& area, const CancelToken& cancel) {
  found_.clear();
  warnings_.clear();
  unusable_ = impossible_ = parts_ = 0;
  cut_ = false;
  area_ = &area;
  Search(area, cancel);
  if (unusable_ > 0) {
    warnings_.push_back(
        fmt::format("{}: {} without a usable id, position or file; left out", name_, Counted(unusable_, "panorama")));
  }
  if (parts_ > 0) {
    warnings_.push_back(fmt::format("{}: {} of less than a full turn; left out", name_, Counted(parts_, "picture")));
  }
  if (impossible_ > 0) warnings_.push_back(ImpossibleValues(name_, impossible_));
  if (cut_ || Full()) {
    warnings_.push_back(
        fmt::format("{}: at least {} there: the service gives no more in one list, and the list is cut; "
                    "take a smaller --radius for all of them",
                    name_, Counted(found_.size(), "panorama")));
  }
  std::vector<PanoramaRecord> records;
  for (auto& [id, record] : found_) records.push_back(std::move(record));
  return records;
}

bool ListingService::Keep(PanoramaRecord record, const std::optional<Geodetic>& position, bool has_file) {
  if (!IsPlainId(record.id) || !position || !has_file) {
    ++unusable_;
    return false;
  }
  record.position = *position;
  if (!area_->Contains(record.position)) return false;
  if (found_.count(record.id) > 0) return false;
  impossible_ += TakeOutImpossible(&record);
  for (const std::string* part : {&record.owner, &credit_, &record.licence}) {
    if (!part->empty()) record.attribution += (record.attribution.empty() ? "" : ", ") + *part;
  }
  const std::string id = record.id;
  return found_.emplace(id, std::move(record)).second;
}

bool ListingService::Divide(const Box& box, int halvings, const std::function<void(const Box&)>& search) {
  constexpr int kMostHalvings = 6;
  if (halvings >= kMostHalvings || Full()) {
    cut_ = true;
    return false;
  }
  const auto [west, south, east, north] = box;
  const double x = 0.5 * (west + east), y = 0.5 * (south + north);
  for (const Box& quarter :
       {Box{west, south, x, y}, Box{x, south, east, y}, Box{west, y, x, north}, Box{x, y, east, north}}) {
    search(quarter);
  }
  return true;
}

const nlohmann::json& ListingService::ListIn(const nlohmann::json& answer, const char* key,
                                             const std::string& url) const {
  const auto list = answer.find(key);
  if (list == answer.end() || !list->is_array()) {
    throw InputError(name_ + ": " + WithoutQuery(url) + ": expected a list \"" + key + "\", found none");
  }
  return *list;
}

}  // namespace trigpoint
