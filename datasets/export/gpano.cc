#include "datasets/export/gpano.h"

#include <fmt/format.h>

#include <cmath>
#include <exiv2/exiv2.hpp>

#include "calib/base/error.h"
#include "datasets/io/exiv2_lock.h"
#include "datasets/io/panorama_writer.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

// What the GPS tags state: the height is above the ellipsoid.
PanoramaMetadata PositionOf(const PanoramaPose& pose) {
  PanoramaMetadata metadata;
  metadata.position = pose.position;
  metadata.has_height = true;
  if (pose.sigma_h_m > 0) metadata.sigma_h_m = pose.sigma_h_m;
  return metadata;
}

}  // namespace

void WritePanoramaWithPose(const std::filesystem::path& picture, const std::filesystem::path& out,
                           const PanoramaPose& pose) {
  std::error_code error;
  std::filesystem::create_directories(out.parent_path(), error);
  std::filesystem::copy_file(picture, out, std::filesystem::copy_options::overwrite_existing, error);
  if (error) throw IoErrorFor(out, "written", error.value());
  std::filesystem::permissions(out, std::filesystem::perms::owner_write, std::filesystem::perm_options::add, error);
  const auto lock = LockExiv2();
  try {
    const auto image = Exiv2::ImageFactory::open(out.string());
    image->readMetadata();
    Exiv2::XmpData& xmp = image->xmpData();
    const int width = image->pixelWidth(), height = image->pixelHeight();
    const auto if_missing = [&](const char* key, const std::string& value) {
      if (xmp.findKey(Exiv2::XmpKey(key)) == xmp.end()) xmp[key] = value;
    };
    xmp["Xmp.GPano.ProjectionType"] = "equirectangular";
    if_missing("Xmp.GPano.UsePanoramaViewer", "True");
    if_missing("Xmp.GPano.FullPanoWidthPixels", std::to_string(width));
    if_missing("Xmp.GPano.FullPanoHeightPixels", std::to_string(height));
    if_missing("Xmp.GPano.CroppedAreaImageWidthPixels", std::to_string(width));
    if_missing("Xmp.GPano.CroppedAreaImageHeightPixels", std::to_string(height));
    if_missing("Xmp.GPano.CroppedAreaLeftPixels", "0");
    if_missing("Xmp.GPano.CroppedAreaTopPixels", "0");
    const double heading_deg = pose.attitude.heading_rad * kRadToDeg;
    xmp["Xmp.GPano.PoseHeadingDegrees"] = fmt::format("{:.4f}", heading_deg);
    xmp["Xmp.GPano.PosePitchDegrees"] = fmt::format("{:.4f}", pose.attitude.pitch_rad * kRadToDeg);
    xmp["Xmp.GPano.PoseRollDegrees"] = fmt::format("{:.4f}", pose.attitude.roll_rad * kRadToDeg);
    Exiv2::ExifData& exif = image->exifData();
    WriteExifPosition(PositionOf(pose), &exif);
    exif["Exif.GPSInfo.GPSImgDirectionRef"] = "T";
    exif["Exif.GPSInfo.GPSImgDirection"] = fmt::format("{}/1000", std::llround(std::abs(heading_deg) * 1000));
    if (!pose.copyright.empty()) exif["Exif.Image.Copyright"] = pose.copyright;
    image->writeMetadata();
  } catch (const Exiv2::AnyError& e) {
    std::filesystem::remove(out, error);
    throw IoError(out.string() + ": its headers cannot be written: " + e.what());
  }
}

}  // namespace trigpoint
