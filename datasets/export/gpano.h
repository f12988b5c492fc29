// Panoramas with their estimated pose in GPano XMP and EXIF GPS, for street view services and viewers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "calib/geo/geodetic.h"

namespace trigpoint {

struct PanoramaPose {
  Geodetic position;  // ellipsoidal height
  Attitude attitude;  // of the image centre
  double sigma_h_m = 0;
  std::string copyright;  // whose picture it is, if that is known
};

// Copies the picture (JPEG or TIFF; its pixels unchanged) and writes the pose over whatever it said; tags about size
// and crop that are there stay. Throws IoError.
void WritePanoramaWithPose(const std::filesystem::path& picture, const std::filesystem::path& out,
                           const PanoramaPose& pose);

}  // namespace trigpoint
