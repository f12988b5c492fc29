#include "datasets/import/providers/listing_service.h"

#include <fmt/format.h>

#include "calib/base/counted.h"
#include "calib/base/error.h"

namespace trigpoint {

std::vector<PanoramaRecord> ListingService::Find(const SearchArea& area, const CancelToken& cancel) {
  found_.clear();
  warnings_.clear();
  unusable_ = 0;
  area_ = &area;
  Search(area, cancel);
  if (unusable_ > 0) {
    warnings_.push_back(
        fmt::format("{}: {} without a usable id, position or file; left out", name_, Counted(unusable_, "panorama")));
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
  record.attribution = (record.owner.empty() ? "" : record.owner + ", ") + credit_ +
                       (record.licence.empty() ? "" : ", " + record.licence);
  const std::string id = record.id;
  return found_.emplace(id, std::move(record)).second;
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
