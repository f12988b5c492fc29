// What phones and other people's tools give: HEIC photos, ground control points in OpenSfM's forms.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/import/colmap_run.h"

namespace trigpoint {

// The primary picture of a HEIC or HEIF file, BGR, turned upright as the file says; `exif`: its EXIF block from the
// TIFF header on, empty if there is none. Throws InputError; also where this build has no libheif.
cv::Mat ReadHeic(const std::filesystem::path& file, std::vector<uint8_t>* exif);

// Every HEIC of a folder as JPEG with its EXIF in SITE/photos/<set>/ (a hand-held set), other pictures copied beside
// them. Of a HEIC and another picture of one name, as phones export both, the other one is used, with a warning. Throws
// InputError if the set is there already or nothing can be read.
ImportReport ImportPhotos(const std::filesystem::path& site, const std::filesystem::path& folder,
                          const std::string& set, ProgressSink& progress, const CancelToken& cancel);

// ground_control_points.json (OpenSfM's points with normalised observations) or gcp_list.txt (a first line with the
// system: WGS84 or EPSG:n, then x y z pixel_x pixel_y image [name]) into SITE/control_points.csv and
// control_observations.csv. Points without a position are left out, and said. `images`: the folder of the pictures, for
// their sizes. Throws InputError.
ImportReport ImportOpenSfmGcp(const std::filesystem::path& site, const std::filesystem::path& file,
                              const std::filesystem::path& images);

}  // namespace trigpoint
