// A run made of a COLMAP reconstruction, so that everything that works on runs works on it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/colmap/model.h"

namespace trigpoint {

// What an import wrote, in words and as files.
struct ImportReport {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> lines;
  std::vector<std::string> warnings;
  std::filesystem::path kept;  // panoramas.csv as it was, where rows were added to one that was there
};

struct ColmapRunOptions {
  std::string run;               // name of the run to be made
  std::filesystem::path images;  // folder that the model's image names are relative to
  std::optional<double> scale;   // metres per unit of the model; unset: from EXIF positions, else 1 and a warning
};

// Writes SITE/runs/<run>/ (images.txt, images as a link, camchain.yaml, odometry.tum, run.yaml) and SITE/models/<run>/
// (the model, unless it lies there). The poses of the model become the run's odometry: bodies are COLMAP's rigs, or the
// camera itself; images are numbered one a second by name. Throws InputError if the run exists, images are missing, or
// no camera can be represented.
ImportReport ImportColmapRun(const std::filesystem::path& site, const std::filesystem::path& model_dir,
                             const ColmapRunOptions& options);

// The same of a database: cameras and images, without poses.
ImportReport ImportColmapDatabase(const std::filesystem::path& site, const std::filesystem::path& database,
                                  const ColmapRunOptions& options);

}  // namespace trigpoint
