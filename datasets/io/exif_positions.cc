#include "datasets/io/exif_positions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/base/error.h"
#include "calib/base/median.h"

namespace trigpoint {
namespace {

constexpr double kExifHeightSigma_m = 10;
constexpr double kArmsReach_m = 1;
constexpr double kTimesSigma = 2;   // half of the photos of one spot lie within 1.2
constexpr double kBestSigma_m = 2;  // no phone's errors are smaller among buildings, whatever it states
constexpr size_t kFewestPositions = 4;
// A drift along the order of the photos, in sigmas: of errors that are correlated exponentially over whatever time,
// 0.5 % of sets of 6 to 60 photos show more in any form, and 0.5 % more than the shorter one in a line that explains
// nine tenths of their spread (by simulation, the worst of all times: tests/datasets/io_foreign_test.cc).
constexpr double kLongestDrift = 5.1, kLongestStraightDrift = 3.3, kStraight = 0.9;
constexpr size_t kFewestOfADrift = 6;
constexpr double kWrongFix = 5;  // of the median distance from the middle, or of sigma where that is more

// Per axis; a dilution of precision below 1 promises more than a phone's receiver holds.
double SigmaOf(const PhotoMetadata& photo) {
  return photo.sigma_h_m.value_or(kExifPositionSigma_m * std::max(1.0, photo.dilution.value_or(1)));
}

// The metadata, none if the file cannot be read: it is judged where it is used.
std::optional<PhotoMetadata> MetadataOf(const ImageEntry& image) {
  if (image.video_frame >= 0) return std::nullopt;
  try {
    return ReadPhotoMetadata(image.path);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

// Positions with a sigma per axis, in metres, in the order of the photos' times (else as they come).
struct PhotoPlaces {
  std::vector<Eigen::Vector2d> enu;
  std::vector<double> sigmas;
};

PhotoPlaces PlacesOf(const std::vector<PhotoMetadata>& photos) {
  std::vector<const PhotoMetadata*> placed;
  for (const PhotoMetadata& photo : photos) {
    if (photo.position) placed.push_back(&photo);
  }
  if (std::all_of(placed.begin(), placed.end(), [](const auto* p) { return p->taken_utc_ns.has_value(); })) {
    std::stable_sort(placed.begin(), placed.end(),
                     [](const auto* a, const auto* b) { return *a->taken_utc_ns < *b->taken_utc_ns; });
  }
  PhotoPlaces places;
  std::optional<LocalFrame> frame;
  for (const PhotoMetadata* photo : placed) {
    const Geodetic place{photo->position->latitude_deg, photo->position->longitude_deg, 0};
    if (!frame) frame = LocalFrame(place);
    places.enu.push_back(frame->EnuFromGeodetic(place).head<2>());
    places.sigmas.push_back(std::max(kBestSigma_m, SigmaOf(*photo)));
  }
  return places;
}

double SpanOf(const std::vector<Eigen::Vector2d>& enu) {
  double span = 0;
  for (size_t i = 0; i < enu.size(); ++i) {
    for (size_t k = 0; k < i; ++k) span = std::max(span, (enu[i] - enu[k]).norm());
  }
  return span;
}

// A line through the positions by their order, weighted by their sigmas.
struct Drift {
  size_t count = 0;
  double length_m = 0;  // from the first to the last
  double straight = 0;  // the share of the squared distances from the middle that the line explains
};

// Positions farther than `farthest_m` from the middle are wrong fixes and left out.
Drift DriftOf(const PhotoPlaces& places, const Eigen::Vector2d& middle, double farthest_m) {
  const size_t n = places.enu.size();
  size_t count = 0;
  double weights = 0, mean_order = 0, square = 0, spread = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero(), product = Eigen::Vector2d::Zero();
  const auto weight = [&](size_t i) {
    return (places.enu[i] - middle).norm() > farthest_m ? 0 : 1 / (places.sigmas[i] * places.sigmas[i]);
  };
  for (size_t i = 0; i < n; ++i) {
    count += weight(i) > 0;
    weights += weight(i);
    mean_order += weight(i) * static_cast<double>(i);
    mean += weight(i) * places.enu[i];
  }
  mean_order /= weights;
  mean /= weights;
  for (size_t i = 0; i < n; ++i) {
    const double order = static_cast<double>(i) - mean_order;
    square += weight(i) * order * order;
    product += weight(i) * order * (places.enu[i] - mean);
    spread += weight(i) * (places.enu[i] - mean).squaredNorm();
  }
  if (!(spread > 0)) return {};
  return {count, product.norm() / square * static_cast<double>(n - 1), product.squaredNorm() / square / spread};
}

// Some of the images, spread over the run: where none of them has a position, the others are not opened.
bool AnyHasPosition(const Run& run) {
  constexpr size_t kSample = 64;
  const size_t step = run.images.size() / kSample + 1;
  for (size_t i = 0; i < run.images.size(); i += step) {
    const auto metadata = MetadataOf(run.images[i]);
    if (metadata && metadata->position) return true;
  }
  return false;
}

}  // namespace

GpsTrack ReadImagePositions(const Run& run) {
  GpsTrack track;
  int stated = 0, diluted = 0, above_sea = 0;
  if (!AnyHasPosition(run)) return track;
  for (const ImageEntry& image : run.images) {
    const auto metadata = MetadataOf(image);
    if (!metadata || !metadata->position) continue;
    GpsFix fix{image.stamp_ns, *metadata->position, SigmaOf(*metadata), kUnknownHeightSigma};
    if (metadata->has_height) fix.sigma_v_m = kExifHeightSigma_m;
    if (metadata->has_height && metadata->height_above_sea) CountFromSea(&fix);
    if (!track.fixes.empty()) {
      const Geodetic& last = track.fixes.back().position;
      if (fix.stamp_ns == track.fixes.back().stamp_ns ||
          (last.latitude_deg == fix.position.latitude_deg && last.longitude_deg == fix.position.longitude_deg)) {
        continue;
      }
    }
    stated += metadata->sigma_h_m.has_value();
    diluted += !metadata->sigma_h_m && metadata->dilution;
    above_sea += metadata->has_height && metadata->height_above_sea;
    track.fixes.push_back(fix);
  }
  if (track.fixes.empty()) return track;
  const std::string by_dilution =
      diluted == 0 ? ""
                   : fmt::format("{} with {:g} m times the dilution of precision, ", diluted, kExifPositionSigma_m);
  track.warnings.push_back(fmt::format(
      "{}: no GPS file; {} positions are from the EXIF of the images, {} with the error stated there, {}else {:g} m (1 "
      "sigma); put gps.csv into the run if you have better",
      run.dir.string(), track.fixes.size(), stated, by_dilution, kExifPositionSigma_m));
  if (above_sea > 0) {
    track.warnings.push_back(fmt::format(
        "{}: EXIF states heights above the sea for {} of them; the height of the sea above the ellipsoid is not known, "
        "so all of them share an error of {:g} m (1 sigma)",
        run.dir.string(), above_sea, kUnknownGeoidSigma));
  }
  return track;
}

std::string WhyNotFromOneSpot(const std::vector<PhotoMetadata>& photos) {
  const PhotoPlaces places = PlacesOf(photos);
  if (places.enu.size() < kFewestPositions) return "";
  std::vector<double> east, north, distances;
  for (const Eigen::Vector2d& place : places.enu) {
    east.push_back(place.x());
    north.push_back(place.y());
  }
  const Eigen::Vector2d middle(Median(east), Median(north));
  for (const Eigen::Vector2d& place : places.enu) distances.push_back((place - middle).norm());
  const double half = Median(distances), sigma = Median(places.sigmas);
  std::string found;
  if (half > kArmsReach_m + kTimesSigma * sigma) {
    found = fmt::format("half of them lie more than {:.1f} m from the middle", half);
  } else if (const Drift drift = DriftOf(places, middle, kWrongFix * std::max(half, sigma));
             drift.count >= kFewestOfADrift) {
    const double beyond = std::sqrt(sigma * sigma + 0.5 * kArmsReach_m * kArmsReach_m);  // on a circle of that radius
    if (drift.length_m > kLongestDrift * beyond ||
        (drift.straight > kStraight && drift.length_m > kLongestStraightDrift * beyond)) {
      found = fmt::format("they move on by {:.1f} m from the first to the last", drift.length_m);
    }
  }
  if (found.empty()) return "";
  return fmt::format(
      "the EXIF positions of {} photos span {:.0f} m, and {}; expected photos from one spot, within arm's reach ({:g} "
      "m) and the error of the positions ({:.1f} m, 1 sigma)",
      places.enu.size(), SpanOf(places.enu), found, kArmsReach_m, sigma);
}

}  // namespace trigpoint
