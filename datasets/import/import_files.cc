#include "datasets/import/import_files.h"

#include "datasets/colmap/model.h"
#include "datasets/import/dataset_run.h"
#include "datasets/import/phone_files.h"
#include "datasets/import/providers/services.h"
#include "datasets/import/run_track.h"
#include "datasets/import/tag_layout_control.h"
#include "datasets/io/tag_layout.h"

namespace trigpoint {

namespace fs = std::filesystem;

const std::vector<std::string>& ImportKinds() {
  static const std::vector<std::string> kKinds = {"bag",       "dataset", "video",  "colmap", "colmap-database",
                                                  "panoramas", "stac",    "photos", "gcp",    "tag-layout"};
  return kKinds;
}

std::string ImportKindOf(const fs::path& from) {
  const std::string ending = from.extension().string();
  if (HasColmapModel(from)) return "colmap";
  if (IsBag(from)) return "bag";
  if (!DatasetKind(from).empty()) return "dataset";
  if (fs::is_regular_file(from) && (IsVideoName(from) || IsInsta360File(from))) return "video";
  if (ending == ".db") return "colmap-database";
  if (!fs::exists(from)) throw InputError(from.string() + ": there is no such file or folder");
  if (fs::is_regular_file(from) && (ending == ".fmap" || (ending == ".json" && IsTagLayout(from)))) return "tag-layout";
  if (fs::is_regular_file(from) && (ending == ".json" || ending == ".geojson") && IsStacFile(from)) return "stac";
  if (fs::is_regular_file(from) && (ending == ".json" || ending == ".txt")) return "gcp";
  if (fs::is_directory(from)) {
    bool json = false;
    for (const auto& entry : fs::directory_iterator(from)) json = json || entry.path().extension() == ".json";
    return json ? "panoramas" : "photos";
  }
  throw InputError(from.string() + ": its kind cannot be recognised by its name; give it by --as");
}

ImportReport ImportFiles(const FileImport& a, const std::string& kind, ProgressSink& progress,
                         const CancelToken& cancel) {
  if (kind == "colmap" || kind == "colmap-database") {
    ColmapRunOptions options;
    options.run = a.name;
    options.images = a.images;
    if (a.scale > 0) options.scale = a.scale;
    return kind == "colmap" ? ImportColmapRun(a.dir, a.from, options) : ImportColmapDatabase(a.dir, a.from, options);
  }
  if (kind == "bag") {
    BagRunOptions options = a.bag;
    options.run = a.name;
    return ImportBagRun(a.dir, a.from, options, progress, cancel);
  }
  if (kind == "video") return ImportVideoRun(a.dir, a.from, {a.name, a.odometry, a.bag.cameras, a.bag.every});
  if (kind == "dataset") return ImportDatasetRun(a.dir, a.from, {a.name, a.odometry, a.bag.cameras, a.bag.every});
  if (kind == "tag-layout") return ImportTagLayout(a.dir, a.from, a.tag_size_m);
  if (kind == "panoramas") return ImportPanoramas(a.dir, *OpenPanoramaFolder(a.from), a.panoramas, progress, cancel);
  if (kind == "stac") return ImportPanoramas(a.dir, *OpenStacFile(a.from), a.panoramas, progress, cancel);
  if (kind == "photos") return ImportPhotos(a.dir, a.from, a.name, progress, cancel);
  const fs::path images = a.images.empty() ? fs::path(a.from).parent_path() / "images" : fs::path(a.images);
  return ImportOpenSfmGcp(a.dir, a.from, images);
}

}  // namespace trigpoint
