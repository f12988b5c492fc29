#include "app/desktop/sketch.h"

#include <algorithm>

#include "datasets/project/project.h"
#include "datasets/project/replaced.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

bool IsOnTag(const SketchItem& item) { return item.kind == "control" || item.kind == "check"; }

}  // namespace

Sketch::Sketch(const Project& project) : dir_(project.dir()) {
  for (const auto& [id, size] : project.site().tags.sizes_m) printed_.push_back(id);
  fs::path file;
  for (const char* name : {"plan.geojson", "plan.csv"}) {
    if (fs::is_regular_file(dir_ / name)) file = dir_ / name;
  }
  if (file.empty()) return;
  items_ = ReadSiteSketch(file);
  // As `plan` reads them: without a frame the first position is the origin.
  std::optional<LocalFrame> frame;
  if (project.has_frame()) frame = project.frame();
  for (SketchItem& item : items_) {
    if (item.local_m || !item.geodetic) continue;
    if (!frame) frame = LocalFrame(*(origin_ = item.geodetic));
    item.local_m = frame->EnuFromGeodetic(*item.geodetic);
    item.geodetic.reset();
  }
}

std::optional<Eigen::Vector3d> Sketch::PlaceOf(size_t index) const {
  const SketchItem& item = items_.at(index);
  if (item.local_m) return item.local_m;
  for (const SketchItem& tag : items_) {
    if (tag.kind == "tag" && tag.tag_id == item.tag_id) return tag.local_m;
  }
  return std::nullopt;
}

void Sketch::Remember(SketchStep::Kind kind, const SketchItem& item) {
  before_.push_back({{kind, item.kind + " " + item.name}, items_});
  after_.clear();
  changed_ = true;
}

void Sketch::Add(const SketchItem& item) {
  Remember(SketchStep::Kind::kAdd, item);
  // Rows of one path follow each other.
  auto at = items_.end();
  if (item.kind == "path") {
    const auto last = std::find_if(items_.rbegin(), items_.rend(), [&](const SketchItem& other) {
      return other.kind == item.kind && other.name == item.name;
    });
    if (last != items_.rend()) at = last.base();
  }
  items_.insert(at, item);
}

void Sketch::Replace(size_t index, const SketchItem& item) {
  Remember(SketchStep::Kind::kEdit, items_.at(index));
  const int old = items_.at(index).tag_id;
  items_[index] = item;
  if (item.kind != "tag" || item.tag_id == old) return;
  for (SketchItem& other : items_) {  // what is known of the tag goes with it
    if (other.kind == "tag" || other.tag_id != old) continue;
    other.tag_id = item.tag_id;
    if (IsOnTag(other)) other.name = item.name;
  }
}

void Sketch::MoveTo(size_t index, const Eigen::Vector2d& east_north_m) {
  const auto from = PlaceOf(index);
  if (!from) return;
  Remember(SketchStep::Kind::kMove, items_[index]);
  items_[index].local_m = Eigen::Vector3d(east_north_m.x(), east_north_m.y(), from->z());
}

void Sketch::Remove(size_t index) {
  Remember(SketchStep::Kind::kRemove, items_.at(index));
  const SketchItem gone = items_.at(index);
  items_.erase(items_.begin() + static_cast<std::ptrdiff_t>(index));
  if (gone.kind != "tag") return;
  std::erase_if(items_, [&](const SketchItem& item) { return IsOnTag(item) && item.tag_id == gone.tag_id; });
  for (SketchItem& item : items_) {
    if (item.kind == "station" && item.tag_id == gone.tag_id) item.tag_id = -1;
  }
}

void Sketch::Undo() { Exchange(&before_, &after_); }

void Sketch::Redo() { Exchange(&after_, &before_); }

void Sketch::Exchange(std::vector<Earlier>* from, std::vector<Earlier>* to) {
  if (from->empty()) return;
  Earlier other = std::move(from->back());
  from->pop_back();
  std::swap(other.items, items_);
  to->push_back(std::move(other));
  changed_ = true;
}

int Sketch::FreeTag() const {
  const auto taken = [&](int id) {
    return std::any_of(items_.begin(), items_.end(),
                       [&](const SketchItem& item) { return item.kind == "tag" && item.tag_id == id; });
  };
  for (const int id : printed_) {
    if (!taken(id)) return id;
  }
  int id = 0;
  while (taken(id)) ++id;
  return id;
}

std::string Sketch::FreeName(const std::string& kind, const std::string& stem) const {
  for (int k = 1;; ++k) {
    const std::string name = stem + std::to_string(k);
    const bool taken = std::any_of(items_.begin(), items_.end(),
                                   [&](const SketchItem& item) { return item.kind == kind && item.name == name; });
    if (!taken) return name;
  }
}

fs::path Sketch::Save() {
  std::vector<SketchItem> written = items_;
  for (SketchItem& item : written) {
    if (!origin_ || !item.local_m) continue;
    item.geodetic = LocalFrame(*origin_).GeodeticFromEnu(*item.local_m);
    item.local_m.reset();
  }
  const fs::path kept = ReplaceInputFile(dir_, "plan.csv", SiteSketchCsv(written));
  changed_ = false;
  return kept;
}

}  // namespace trigpoint
