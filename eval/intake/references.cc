// The panoramas, photos and photo sets of a folder that still grows, for SiteCheck of check.h.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/base/error.h"
#include "calib/geometry/bearing.h"
#include "datasets/io/image.h"
#include "datasets/io/photo_sets.h"
#include "eval/errors/stations.h"
#include "eval/intake/check.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {

// In JSON under its members' names.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FieldSet, name, photos, placed, full_turn, gap_deg, before_gap, after_gap, problem)

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Photo sets are looked at coarsely: whether the ring is closed shows at any size.
constexpr int kSetFeatures = 1200, kSetSide_px = 1000;
constexpr int kLessUrgent = 10;  // niceness of matching them: pictures of runs go first

// The axis of a photo, as seen from the middle of its set, rad.
struct PhotoAxis {
  double azimuth = 0, elevation = 0, height = 0;  // height: of its field of view
  std::string photo;
};

std::vector<PhotoAxis> AxesOf(const StitchedRig& rig) {
  std::vector<PhotoAxis> axes;
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    const RigPhoto& p = rig.state.photos[i];
    if (!p.placed) continue;
    const PairView& view = rig.views[i];
    const Lens& lens = rig.state.lenses[static_cast<size_t>(p.lens)];
    const auto ray = [&](double y) { return RayOfPixel(view, lens, {0.5 * view.width, y * view.height}); };
    const Eigen::Vector3d axis = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    axes.push_back({std::atan2(axis.x(), axis.z()), std::asin(std::clamp(-axis.y(), -1.0, 1.0)),
                    AngleBetween(ray(0), ray(1)), rig.photos[i].name});
  }
  return axes;
}

// The widest part of a row of photos without an axis, and the photos on either side of it. Rows lie one above the
// other: what one lacks does not hide in the other.
void FindGap(const StitchedRig& rig, FieldSet* set) {
  constexpr double kRow = 0.25;  // of a photo's height, between rows
  std::vector<PhotoAxis> axes = AxesOf(rig);
  std::sort(axes.begin(), axes.end(), [](const auto& a, const auto& b) { return a.elevation < b.elevation; });
  double widest = 0;
  for (size_t begin = 0, end = 0; begin < axes.size(); begin = end) {
    for (end = begin + 1; end < axes.size(); ++end) {
      if (axes[end].elevation - axes[end - 1].elevation > kRow * axes[end].height) break;
    }
    std::sort(axes.begin() + static_cast<std::ptrdiff_t>(begin), axes.begin() + static_cast<std::ptrdiff_t>(end),
              [](const auto& a, const auto& b) { return a.azimuth < b.azimuth; });
    for (size_t k = begin; k < end; ++k) {
      const PhotoAxis& next = axes[k + 1 < end ? k + 1 : begin];
      const double gap = next.azimuth - axes[k].azimuth + (k + 1 < end ? 0 : 2 * std::numbers::pi);
      if (gap > widest) widest = gap, set->before_gap = axes[k].photo, set->after_gap = next.photo;
    }
  }
}

FieldSet LookAtSet(const fs::path& dir, int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
  FieldSet set;
  set.name = dir.filename().string();
  try {
    const PhotoSet photos = ReadPhotoSet(dir, set.name);
    set.photos = static_cast<int>(photos.photos.size());
    StitchOptions options;
    options.max_features = kSetFeatures;
    options.feature_size_px = kSetSide_px;
    const StitchedRig rig = StitchPhotos(
        photos, [](const Photo& photo) { return LoadPicture(photo.file, true); }, options, threads, seed, progress,
        cancel);
    set.placed = rig.placed;
    set.full_turn = rig.closure.full_turn;
    set.gap_deg = rig.closure.largest_gap_deg;
    if (!set.full_turn) FindGap(rig, &set);
  } catch (const InputError& e) {
    set.problem = e.what();
  } catch (const NumericError& e) {
    set.problem = e.what();
  }
  return set;
}

}  // namespace

void SiteCheck::OpenReferenceLines() {
  set_lines_ = std::make_unique<JsonLines>(out_ / "sets.jsonl",
                                           json{{"schema", 2}, {"features", kSetFeatures}, {"side_px", kSetSide_px}});
  ReadSets();
  reference_lines_ = std::make_unique<JsonLines>(out_ / "panoramas.jsonl", json{{"schema", 1}});
  ReadReferences();
}

void SiteCheck::ReadReferences() {
  reference_lines_->Read([&](const json& j) {
    references_[j.at("name").get<std::string>()] = {FileStamp{j.at("size"), j.at("changed_ns")}, j.at("problem")};
  });
}

// So that one look at the folder waits for panoramas and photos as it waits for a run's pictures.
void SiteCheck::WatchReferences() {
  references_arriving_ = false;
  for (const Reference& reference : project_->site().references) {
    if (reference.kind == ReferenceKind::kPhotoSet || reference.files.empty()) continue;
    const fs::path& file = reference.files.front();
    const FileStamp stamp = StampOf(file);
    const auto known = references_.find(reference.name);
    if (known != references_.end() && known->second.first == stamp) continue;
    references_arriving_ |= !watch_.IsStable(file, stamp) && stamp.size > 0;
  }
}

// A picture is read once, and again only after it changed.
void SiteCheck::AddReferences(CheckOutcome* outcome) {
  FieldFacts* facts = &outcome->facts;
  for (const Reference& reference : project_->site().references) {
    facts->referenced.insert(StationNamed(reference.station, project_->site().stations));
    if (reference.kind == ReferenceKind::kPhotoSet || reference.files.empty()) continue;
    const fs::path& file = reference.files.front();
    const FileStamp stamp = StampOf(file);
    const auto known = references_.find(reference.name);
    if (known == references_.end() || known->second.first != stamp) {
      if (!watch_.IsStable(file, stamp) && stamp.size > 0) {  // still being copied
        ++outcome->waiting;
        continue;
      }
      std::string problem;
      try {
        reference.kind == ReferenceKind::kPanorama ? LoadPanorama(file, true) : LoadPicture(file, true);
      } catch (const InputError& e) {
        problem = e.what();
      }
      JsonAppender(reference_lines_->file())
          .Add(
              {{"name", reference.name}, {"size", stamp.size}, {"changed_ns", stamp.changed_ns}, {"problem", problem}});
      ReadReferences();
    }
    const std::string& problem = references_.at(reference.name).second;
    if (!problem.empty()) facts->unreadable[reference.name] = problem;
  }
}

void SiteCheck::ReadSets() {
  set_lines_->Read([&](const json& j) {
    const auto set = j.get<FieldSet>();
    sets_[set.name] = {j.at("like"), set};
  });
}

// Sets are matched one after the other, beside the pictures, which a camera goes on copying meanwhile.
void SiteCheck::WatchSets(ProgressSink& progress) {
  if (matching_ && matching_->task.Listen(progress, std::chrono::milliseconds(0))) {
    const std::unique_ptr<Matching> ended = std::move(matching_);
    json line;
    try {
      line = json::parse(ended->task.Take().bytes);
    } catch (const MemoryError& e) {
      FieldSet set;
      set.name = ended->set.name;
      set.photos = ended->set.photos;
      set.problem = e.what();
      line = json(set);
    }
    line["like"] = ended->set.like;
    JsonAppender(set_lines_->file()).Add(line);
    ReadSets();
    set_matched_ = true;
  }
  watched_sets_.clear();
  for (const fs::path& dir : PhotoSetFolders(dir_)) {
    WatchedSet set{dir.filename().string(), "", 0, true};
    for (const fs::path& photo : PicturesIn(dir)) {
      const FileStamp stamp = StampOf(photo);
      set.like += fmt::format("{} {} {};", photo.filename().string(), stamp.size, stamp.changed_ns);
      set.stable = watch_.IsStable(photo, stamp) && set.stable;
      ++set.photos;
    }
    const auto known = sets_.find(set.name);
    const bool news = set.photos > 0 && (known == sets_.end() || known->second.first != set.like);
    if (news && set.stable && !matching_) {
      const auto body = [dir, threads = threads_, seed = seed_](ProgressSink& its) {
        if (nice(kLessUrgent) < 0) its.Log(LogLevel::kDebug, "nice: refused");
        return json(LookAtSet(dir, threads, seed, its, {})).dump();
      };
      matching_.reset(new Matching{set, {"photo set " + set.name + ": matching its photos", body}});
    }
    watched_sets_.push_back(std::move(set));
  }
}

// A verdict on an earlier state of the folder is not repeated.
void SiteCheck::AddSets(FieldFacts* facts) const {
  for (const WatchedSet& set : watched_sets_) {
    const auto known = sets_.find(set.name);
    if (known != sets_.end() && known->second.first == set.like) {
      facts->sets.push_back(known->second.second);
    } else if (set.photos > 0) {
      facts->sets_arriving[set.name] = set.photos;
    }
  }
}

}  // namespace trigpoint
