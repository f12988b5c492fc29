#include "survey/panorama/photo_set.h"

#include <algorithm>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

// Wider pictures are panoramas: no lens that is held by hand and straight makes them.
constexpr double kPanoramaAspect = 2.4;

}  // namespace

PhotoSet ReadPhotoSet(const std::filesystem::path& dir, const std::string& name) {
  PhotoSet set;
  set.name = name;
  const std::vector<std::filesystem::path> files = PicturesIn(dir);
  if (files.empty()) {
    throw InputError(dir.string() + ": holds no picture (JPEG, PNG or TIFF); put the photos of one panorama into it");
  }
  for (const std::filesystem::path& file : files) {
    Photo photo;
    photo.file = file;
    photo.name = file.filename().string();
    try {
      photo.metadata = ReadPhotoMetadata(file);
      photo.tilt = ReadPhotoTilt(file);
    } catch (const InputError& e) {
      set.left_out.push_back({photo.name, e.what()});
      continue;
    }
    const PhotoMetadata& m = photo.metadata;
    photo.width = m.ShownSize().width, photo.height = m.ShownSize().height;
    photo.focal_px = m.focal_px;
    if (m.width < 32 || m.height < 32) {
      set.left_out.push_back({photo.name, "is only " + std::to_string(m.width) + " x " + std::to_string(m.height) +
                                              " px; at least 32 x 32 are needed"});
      continue;
    }
    const double aspect = static_cast<double>(std::max(m.width, m.height)) / std::min(m.width, m.height);
    if (aspect > kPanoramaAspect || (m.gpano && !m.gpano->projection.empty())) {
      set.left_out.push_back({photo.name, "is a panorama itself (" + std::to_string(m.width) + " x " +
                                              std::to_string(m.height) + " px), not a photo of one"});
      continue;
    }
    set.photos.push_back(std::move(photo));
  }
  return set;
}

}  // namespace trigpoint
