#include "localize/reconstruct/kept_features.h"

#include <fmt/format.h>

#include "calib/base/fnv.h"

namespace trigpoint {
namespace {

// Two masks are alike or not.
uint64_t DigestOf(const cv::Mat& mask) {
  uint64_t digest = kFnvBasis;
  for (int y = 0; y < mask.rows; ++y) digest = Fnv1a(mask.ptr(y), static_cast<size_t>(mask.cols), digest);
  return digest;
}

std::string TextOf(const FeatureOptions& o) {
  return fmt::format("{} {} {}", o.max_features, o.contrast_threshold, o.edge_threshold);
}

}  // namespace

KeptFeatures::KeptFeatures(const FeaturesBefore& before, const std::filesystem::path& out)
    : before_(before), sources_(out / kPicturesFile) {
  std::ifstream in(before.dir / kPicturesFile);
  if (before.dir.empty() || !in) return;
  for (std::string line; std::getline(in, line);) {
    const size_t tab = line.find('\t');
    if (tab != std::string::npos) source_of_[line.substr(tab + 1)] = line.substr(0, tab);
  }
  database_.emplace(ColmapDatabase::OpenRead(before.dir / kFeaturesFile));
  for (const DatabaseImage& image : database_->Images()) id_of_[image.name] = image.id;
}

std::string KeptFeatures::SourceOf(const Run& run, const ImageEntry& entry, const cv::Mat& mask,
                                   const FeatureOptions& o) const {
  const BodyCamera& camera = run.cameras[static_cast<size_t>(entry.camera)];
  if (camera.part.kind != PicturePart::Kind::kAll) return "";
  return fmt::format("{} {} {} {}x{} {:x} {}", before_.hash_of(entry.path), entry.video_frame, run.config.mirrored,
                     camera.camera.width(), camera.camera.height(), mask.empty() ? 0 : DigestOf(mask), TextOf(o));
}

std::string KeptFeatures::SourceOf(const Site& site, const PreparedReference& p, const FeatureStageOptions& o) const {
  const Reference& reference = site.references[static_cast<size_t>(p.reference)];
  if (reference.kind != ReferenceKind::kPanorama) return "";
  return fmt::format("{} {} {} {} {} {} {}", before_.hash_of(site.dir / p.name),
                     reference.mask.empty() ? "-" : before_.hash_of(reference.mask), o.views.count, o.views.fov_deg,
                     o.views.pitch_deg, p.rig.views.front().camera.width(), TextOf(o.references));
}

bool KeptFeatures::Has(const std::string& name, const std::string& source) const {
  const auto it = source_of_.find(name);
  return !source.empty() && it != source_of_.end() && it->second == source && id_of_.count(name) > 0;
}

int64_t KeptFeatures::Write(const std::string& name, const std::string& source, const FeatureSet& found, uint32_t image,
                            ColmapDatabase* database) {
  if (!source.empty()) sources_ << source << '\t' << name << '\n';
  if (Has(name, source)) return database->CopyFeatures(*database_, id_of_.at(name), image);
  database->WriteFeatures(image, found);
  return static_cast<int64_t>(found.size());
}

}  // namespace trigpoint
