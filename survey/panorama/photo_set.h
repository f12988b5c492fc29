// The photos of a hand-held panorama as brought: files, what their headers say, and which cannot be used and why.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/exif.h"
#include "datasets/io/photo_tilt.h"

namespace trigpoint {

struct Photo {
  std::filesystem::path file;
  std::string name;  // the file's name
  PhotoMetadata metadata;
  PhotoTilt tilt;
  int width = 0, height = 0;       // px, as shown: orientation applied
  std::optional<double> focal_px;  // of EXIF, px of the picture as shown
};

// A photo that takes no part, and why.
struct LeftOutPhoto {
  std::string name;
  std::string reason;
};

struct PhotoSet {
  std::string name;
  std::vector<Photo> photos;  // by name, numbers in numeric order
  std::vector<LeftOutPhoto> left_out;
};

// Reads the headers of a folder's pictures. What cannot be read, is empty, or is a panorama itself (2.4 times wider
// than high, or told so by GPano) is left out and named. Throws InputError if the folder has no picture at all.
PhotoSet ReadPhotoSet(const std::filesystem::path& dir, const std::string& name);

}  // namespace trigpoint
