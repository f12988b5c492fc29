// Files and folders of every kind that an import knows, behind one call.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/import/bag_run.h"
#include "datasets/import/panorama_provider.h"

namespace trigpoint {

// "bag", "dataset", "video", "colmap", "colmap-database", "panoramas", "stac", "photos", "gcp",
// "tag-layout".
const std::vector<std::string>& ImportKinds();

struct FileImport {
  std::string dir;        // the site, made if it is not there
  std::string from;       // file or folder
  std::string name;       // of the new run or photo set
  std::string images;     // colmap: folder that image names begin in; gcp: the pictures; empty: beside the file
  std::string odometry;   // dataset, video: poses to be the run's odometry; or empty
  double scale = 0;       // colmap: metres per unit; 0: from EXIF positions
  double tag_size_m = 0;  // tag-layout: edge of the black square where the file has none; 0: unknown
  BagRunOptions bag;      // bag, dataset, video; its run is `name`
  PanoramaImportOptions panoramas;
};

// What lies at `from`, by its contents: one of ImportKinds. Throws InputError.
std::string ImportKindOf(const std::filesystem::path& from);
// Writes new files into the site as docs/file_formats.md describes them. Throws OptionError, InputError, IoError.
ImportReport ImportFiles(const FileImport& request, const std::string& kind, ProgressSink& progress,
                         const CancelToken& cancel);

}  // namespace trigpoint
