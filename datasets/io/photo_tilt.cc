#include "datasets/io/photo_tilt.h"

#include <cmath>
#include <exiv2/exiv2.hpp>

#include "datasets/io/exiv2_lock.h"
#include "datasets/io/text.h"

namespace trigpoint {

PhotoTilt ReadPhotoTilt(const std::filesystem::path& file) {
  const auto lock = LockExiv2();
  PhotoTilt tilt;
  try {
    const auto image = Exiv2::ImageFactory::open(file.string());
    image->readMetadata();
    const auto xmp = [&](const char* key) -> std::optional<double> {
      for (const Exiv2::Xmpdatum& datum : image->xmpData()) {
        if (datum.key() != key) continue;
        const auto value = ParseDouble(datum.toString());
        if (value && std::isfinite(*value) && std::abs(*value) <= 180) return value;
      }
      return std::nullopt;
    };
    const auto it = image->exifData().findKey(Exiv2::ExifKey("Exif.Photo.CameraElevationAngle"));
    if (it != image->exifData().end() && it->count() > 0 && it->toRational().second != 0) {
      const double angle = static_cast<double>(it->toRational().first) / it->toRational().second;
      if (std::abs(angle) <= 90) tilt.pitch_deg = angle;
    }
    for (const char* key : {"Xmp.GPano.PosePitchDegrees", "Xmp.Camera.Pitch"}) {
      if (!tilt.pitch_deg) tilt.pitch_deg = xmp(key);
    }
    for (const char* key : {"Xmp.GPano.PoseRollDegrees", "Xmp.Camera.Roll"}) {
      if (!tilt.roll_deg) tilt.roll_deg = xmp(key);
    }
  } catch (const Exiv2::AnyError&) {
    return {};
  }
  return tilt;
}

}  // namespace trigpoint
