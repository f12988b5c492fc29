// Gravity, as far as a photo's headers have a place for it.
#pragma once

#include <filesystem>
#include <optional>

namespace trigpoint {

// Of the optical axis above the horizon, and of the picture clockwise: EXIF CameraElevationAngle, or the XMP of
// panorama apps (GPano) and of mapping cameras (Camera).
struct PhotoTilt {
  std::optional<double> pitch_deg, roll_deg;
};

// What the headers say; nothing where they cannot be read.
PhotoTilt ReadPhotoTilt(const std::filesystem::path& file);

}  // namespace trigpoint
