// Writes an equirectangular picture row by row, and what viewers need to know about it: GPano XMP, EXIF GPS.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>

#include "calib/geo/geodetic.h"

namespace Exiv2 {
class ExifData;
}

namespace trigpoint {

// JPEG (holes black) or TIFF with an alpha channel (holes transparent), by the file's ending. Nothing but the rows
// handed over is held in memory.
class PanoramaWriter {
 public:
  // Throws IoError if the file cannot be made, InputError for another ending than jpg, jpeg, tif, tiff.
  PanoramaWriter(const std::filesystem::path& file, int width, int height, int quality);
  ~PanoramaWriter();
  PanoramaWriter(const PanoramaWriter&) = delete;
  PanoramaWriter& operator=(const PanoramaWriter&) = delete;
  // The next rows from the top: 8-bit BGRA, `width` wide. Throws IoError (disk full).
  void Write(const cv::Mat& rows);
  // After the last row. Throws IoError, also if rows are missing.
  void Finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct PanoramaMetadata {
  int width = 0, height = 0;  // of the full sphere
  cv::Rect part;              // of it that the picture is; empty: all of it
  // Of the full sphere's centre: clockwise from north, above the horizon, clockwise; none: not known.
  std::optional<double> heading_deg, pitch_deg, roll_deg;
  int photos = 0;                                    // it was made from
  std::optional<int64_t> first_utc_ns, last_utc_ns;  // when they were taken
  std::optional<Geodetic> position;
  bool has_height = false;
  bool height_above_sea = false;  // else above the ellipsoid
  std::optional<double> sigma_h_m;
  std::string description;
};

// The GPS tags of `metadata.position`, which must be set, with its height and sigma; a height also sets the EXIF
// version, which states whether it is above the sea (2.32) or the ellipsoid (3.0).
void WriteExifPosition(const PanoramaMetadata& metadata, Exiv2::ExifData* exif);

// Adds GPano XMP and EXIF to a finished JPEG or TIFF. Throws IoError.
void WritePanoramaMetadata(const std::filesystem::path& file, const PanoramaMetadata& metadata);

}  // namespace trigpoint
