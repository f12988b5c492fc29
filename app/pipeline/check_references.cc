// The panoramas, photos and photo sets of a folder that still grows, for SiteCheck of check.h.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/pipeline/check.h"
#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/photo_sets.h"
#include "eval/errors/stations.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Photo sets are looked at coarsely: whether the ring is closed shows at any size.
constexpr int kSetFeatures = 1200, kSetSide_px = 1000;

// The widest part of the horizon without an optical axis, and the photos on either side of it.
void FindGap(const StitchedRig& rig, FieldSet* set) {
  std::vector<std::pair<double, std::string>> axes;
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    if (!rig.state.photos[i].placed) continue;
    const Eigen::Vector3d axis = rig.state.photos[i].cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    axes.emplace_back(std::atan2(axis.x(), axis.z()), rig.photos[i].name);
  }
  std::sort(axes.begin(), axes.end());
  double widest = 0;
  for (size_t k = 0; k < axes.size(); ++k) {
    const auto& next = axes[(k + 1) % axes.size()];
    const double gap = next.first - axes[k].first + (k + 1 == axes.size() ? 2 * M_PI : 0);
    if (gap > widest) widest = gap, set->before_gap = axes[k].second, set->after_gap = next.second;
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
  set_lines_ = std::make_unique<JsonLines>(
      out_ / "sets.jsonl", nlohmann::json{{"schema", 1}, {"features", kSetFeatures}, {"side_px", kSetSide_px}});
  ReadSets();
  reference_lines_ = std::make_unique<JsonLines>(out_ / "panoramas.jsonl", nlohmann::json{{"schema", 1}});
  ReadReferences();
}

void SiteCheck::ReadReferences() {
  reference_lines_->Read([&](const nlohmann::json& j) {
    references_[j.at("name").get<std::string>()] = {FileStamp{j.at("size"), j.at("changed_ns")}, j.at("problem")};
  });
}

// A picture is read once, and again only after it changed.
void SiteCheck::AddReferences(FieldFacts* facts) {
  for (const Reference& reference : project_->site().references) {
    facts->referenced.insert(StationNamed(reference.station, project_->site().stations));
    if (reference.kind == ReferenceKind::kPhotoSet || reference.files.empty()) continue;
    const fs::path& file = reference.files.front();
    const FileStamp stamp = StampOf(file);
    const auto known = references_.find(reference.name);
    if (known == references_.end() || known->second.first != stamp) {
      if (!watch_.IsStable(file, stamp) && stamp.size > 0) continue;  // still being copied
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
  set_lines_->Read([&](const nlohmann::json& j) {
    const FieldSet set{j.at("name"),    j.at("photos"),     j.at("placed"),    j.at("full_turn"),
                       j.at("gap_deg"), j.at("before_gap"), j.at("after_gap"), j.at("problem")};
    sets_[set.name] = {j.at("like"), set};
  });
}

void SiteCheck::AddSets(FieldFacts* facts, ProgressSink& progress, const CancelToken& cancel) {
  for (const fs::path& dir : PhotoSetFolders(dir_)) {
    std::string like;  // names, sizes and times of the photos: an unchanged set is not stitched again
    bool stable = true;
    const std::vector<fs::path> photos = PicturesIn(dir);
    for (const fs::path& photo : photos) {
      const FileStamp stamp = StampOf(photo);
      like += fmt::format("{} {} {};", photo.filename().string(), stamp.size, stamp.changed_ns);
      stable = watch_.IsStable(photo, stamp) && stable;
    }
    const auto known = sets_.find(dir.filename().string());
    if (stable && (known == sets_.end() || known->second.first != like)) {
      const FieldSet set = LookAtSet(dir, threads_, seed_, progress, cancel);
      JsonAppender(set_lines_->file())
          .Add({{"name", set.name},
                {"like", like},
                {"photos", set.photos},
                {"placed", set.placed},
                {"full_turn", set.full_turn},
                {"gap_deg", set.gap_deg},
                {"before_gap", set.before_gap},
                {"after_gap", set.after_gap},
                {"problem", set.problem}});
      ReadSets();
    }
    // A verdict on an earlier state of the folder is not repeated.
    if (const auto set = sets_.find(dir.filename().string()); set != sets_.end() && set->second.first == like) {
      facts->sets.push_back(set->second.second);
    } else if (!photos.empty()) {
      facts->sets_arriving[dir.filename().string()] = static_cast<int>(photos.size());
    }
  }
}

}  // namespace trigpoint
