// What a picture file says about itself: EXIF, and the GPano XMP of panoramas.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

// GPano: angles of the image centre in degrees as in the file (heading clockwise from north, pitch up, roll
// clockwise); `full_*` and `crop_*`: where this picture lies in the full sphere (px), zero if not said.
struct GPano {
  std::string projection;
  std::optional<double> heading_deg, pitch_deg, roll_deg;
  int full_width = 0, full_height = 0;
  int crop_left = 0, crop_top = 0, crop_width = 0, crop_height = 0;
};

// 1 sigma of a focal length by EXIF, a share of it: of 35 mm equivalents, which are whole numbers, some count the
// frame's diagonal, some its width.
inline constexpr double kExifFocalSigma = 0.05;

struct PhotoMetadata {
  int width = 0, height = 0;  // px, as stored, before `orientation`; 0: unknown
  int orientation = 1;        // EXIF 1..8
  bool SwapsSides() const { return orientation >= 5; }
  cv::Size ShownSize() const { return SwapsSides() ? cv::Size(height, width) : cv::Size(width, height); }
  // Of the stored picture, px: from the 35 mm equivalent (36 mm are the picture's long side), else from the focal
  // length and the focal plane's resolution.
  std::optional<double> focal_px;
  std::optional<Geodetic> position;
  bool has_height = false;
  bool height_above_sea = false;        // EXIF says above (or below) sea level; without: above the ellipsoid
  std::optional<double> sigma_h_m;      // GPSHPositioningError
  std::optional<double> dilution;       // GPSDOP: horizontal or, of a fix in 3D, of all axes
  std::optional<double> heading_deg;    // GPSImgDirection, true north only
  std::optional<int64_t> taken_utc_ns;  // DateTimeOriginal with sub-seconds; of the zone in the file, else as UTC
  bool taken_zone_known = false;
  std::optional<GPano> gpano;
};

// Reads the headers only, not the pixels; thread safe. Throws InputError if the file is missing, empty or no picture.
PhotoMetadata ReadPhotoMetadata(const std::filesystem::path& file);

// A pinhole camera for the picture as shown (orientation applied), principal point at its centre. None: no focal
// length in the file.
std::optional<Camera> CameraFromMetadata(const PhotoMetadata& metadata);

// Geotag of a photo or panorama from its metadata: position and height from EXIF GPS, angles from GPano, else heading
// from GPSImgDirection. `file` is named in the warnings.
GeoTag GeoTagFromMetadata(const PhotoMetadata& metadata, const std::filesystem::path& file,
                          std::vector<std::string>* warnings);

// The size of a picture's file, bytes. Throws InputError if there is none or it is empty.
uintmax_t PictureFileSize(const std::filesystem::path& file);

// By its ending: jpg, jpeg, png, tif, tiff; and the containers OpenCV's video readers know.
bool IsPictureName(const std::filesystem::path& file);
bool IsVideoName(const std::filesystem::path& file);
// The pictures of a folder, by name with numbers in numeric order (IMG_2 before IMG_10); hidden files left out.
std::vector<std::filesystem::path> PicturesIn(const std::filesystem::path& dir);

}  // namespace trigpoint
