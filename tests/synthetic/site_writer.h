// Writes sites in the layout that users bring, for synthetic and reworked inputs.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

// panoramas.csv: what a geotag does not have stays empty. `file` is relative to the site.
struct PanoramaRow {
  std::string file, station;
  GeoTag geotag;
};
void WritePanoramasCsv(const std::filesystem::path& file, const std::vector<PanoramaRow>& rows);

// camchain.yaml as Kalibr writes it, and equirectangular cameras. Throws InputError for camera models that have no name
// in it.
void WriteCamchain(const std::filesystem::path& file, const std::vector<BodyCamera>& cameras);

// Writes text to a new file, folders included. Throws IoError.
void WriteText(const std::filesystem::path& file, const std::string& text);

// Pictures as JPEG of quality 95 (.jpg) or PNG, folders included. Throws IoError.
void WritePicture(const std::filesystem::path& file, const cv::Mat& picture);

}  // namespace trigpoint
