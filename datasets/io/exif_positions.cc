#include "datasets/io/exif_positions.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/base/error.h"
#include "calib/base/median.h"

namespace trigpoint {
namespace {

constexpr double kExifHeightSigma_m = 10;
constexpr double kArmsReach_m = 1;
constexpr double kTimesSigma = 2;   // half of the photos of one spot lie within 1.2
constexpr double kBestSigma_m = 2;  // no phone's errors are smaller among buildings, whatever it states
constexpr size_t kFewestPositions = 4;

// The metadata, none if the file cannot be read: it is judged where it is used.
std::optional<PhotoMetadata> MetadataOf(const ImageEntry& image) {
  if (image.video_frame >= 0) return std::nullopt;
  try {
    return ReadPhotoMetadata(image.path);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

bool HasPosition(const ImageEntry& image) {
  const auto metadata = MetadataOf(image);
  return metadata && metadata->position;
}

}  // namespace

GpsTrack ReadImagePositions(const Run& run) {
  GpsTrack track;
  const std::vector<ImageEntry>& images = run.images;
  if (images.empty() ||
      !(HasPosition(images.front()) || HasPosition(images[images.size() / 2]) || HasPosition(images.back()))) {
    return track;
  }
  int stated = 0, above_sea = 0;
  for (const ImageEntry& image : images) {
    const auto metadata = MetadataOf(image);
    if (!metadata || !metadata->position) continue;
    GpsFix fix{image.stamp_ns, *metadata->position, metadata->sigma_h_m.value_or(kExifPositionSigma_m),
               kUnknownHeightSigma};
    if (metadata->has_height) fix.sigma_v_m = metadata->height_above_sea ? kUnknownGeoidSigma : kExifHeightSigma_m;
    if (!track.fixes.empty()) {
      const Geodetic& last = track.fixes.back().position;
      if (fix.stamp_ns == track.fixes.back().stamp_ns ||
          (last.latitude_deg == fix.position.latitude_deg && last.longitude_deg == fix.position.longitude_deg)) {
        continue;
      }
    }
    stated += metadata->sigma_h_m.has_value();
    above_sea += metadata->has_height && metadata->height_above_sea;
    track.fixes.push_back(fix);
  }
  track.warnings.push_back(fmt::format(
      "{}: no GPS file; {} positions are from the EXIF of the images, {} with the error stated there, else {:g} m (1 "
      "sigma); put gps.csv into the run if you have better",
      run.dir.string(), track.fixes.size(), stated, kExifPositionSigma_m));
  if (above_sea > 0) {
    track.warnings.push_back(fmt::format(
        "{}: EXIF states heights above the sea for {} of them; they count with {:g} m (1 sigma), as the geoid is not "
        "known",
        run.dir.string(), above_sea, kUnknownGeoidSigma));
  }
  return track;
}

std::string WhyNotFromOneSpot(const std::vector<PhotoMetadata>& photos) {
  std::vector<Geodetic> places;
  std::vector<double> sigmas, east, north;
  for (const PhotoMetadata& photo : photos) {
    if (!photo.position) continue;
    places.push_back({photo.position->latitude_deg, photo.position->longitude_deg, 0});
    sigmas.push_back(std::max(kBestSigma_m, photo.sigma_h_m.value_or(kExifPositionSigma_m)));
  }
  if (places.size() < kFewestPositions) return "";
  const LocalFrame frame(places.front());
  for (const Geodetic& place : places) {
    const Eigen::Vector3d enu = frame.EnuFromGeodetic(place);
    east.push_back(enu.x());
    north.push_back(enu.y());
  }
  const Eigen::Vector2d middle(Median(east), Median(north));
  std::vector<double> distances;
  double span = 0;
  for (size_t i = 0; i < east.size(); ++i) {
    distances.push_back((Eigen::Vector2d(east[i], north[i]) - middle).norm());
    for (size_t k = 0; k < i; ++k) span = std::max(span, std::hypot(east[i] - east[k], north[i] - north[k]));
  }
  const double half = Median(distances), sigma = Median(sigmas);
  if (half <= kArmsReach_m + kTimesSigma * sigma) return "";
  return fmt::format(
      "the EXIF positions of {} photos span {:.0f} m, and half of them lie more than {:.1f} m from the middle; "
      "expected "
      "photos from one spot, within arm's reach ({:g} m) and the error of the positions ({:.1f} m, 1 sigma)",
      places.size(), span, half, kArmsReach_m, sigma);
}

}  // namespace trigpoint
