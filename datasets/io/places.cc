// Do the places that a site's files state lie on one site?
#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "calib/base/median.h"
#include "datasets/io/run_parts.h"

namespace trigpoint {
namespace {

constexpr double kFarthest_m = 100e3;  // no site is larger
constexpr double kNowhere_deg = 1e-6;  // receivers without a fix state latitude 0, longitude 0

struct Anchor {
  Geodetic place;
  std::string name;
};

double Distance_m(const Geodetic& a, const Geodetic& b) {
  return (EcefFromGeodetic({a.latitude_deg, a.longitude_deg, 0}) -
          EcefFromGeodetic({b.latitude_deg, b.longitude_deg, 0}))
      .norm();
}

bool IsNowhere(const Geodetic& g) {
  return std::abs(g.latitude_deg) < kNowhere_deg && std::abs(g.longitude_deg) < kNowhere_deg;
}

std::optional<Geodetic> Middle(const std::vector<Geodetic>& places) {
  if (places.empty()) return std::nullopt;
  std::vector<double> latitudes, eastward;  // longitudes from the first: 180 and -180 degrees are one meridian
  for (const Geodetic& g : places) {
    latitudes.push_back(g.latitude_deg);
    eastward.push_back(std::remainder(g.longitude_deg - places.front().longitude_deg, 360));
  }
  return Geodetic{Median(latitudes), std::remainder(places.front().longitude_deg + Median(eastward), 360), 0};
}

// What the others are compared with: the most deliberate statement there is.
std::optional<Anchor> FindAnchor(const Site& site) {
  if (site.origin) return Anchor{*site.origin, "origin.json"};
  std::vector<Geodetic> control, gps, references;
  for (const ControlPoint& point : site.control_points) {
    if (point.geodetic) control.push_back(*point.geodetic);
  }
  for (const Run& run : site.runs) {
    for (const GpsFix& fix : run.gps) gps.push_back(fix.position);
  }
  for (const Reference& reference : site.references) {
    if (reference.geotag.has_position) references.push_back(reference.geotag.position);
  }
  if (const auto middle = Middle(control)) return Anchor{*middle, "the control points"};
  if (const auto middle = Middle(gps)) return Anchor{*middle, "GPS"};
  constexpr size_t kMajority = 3;
  if (references.size() < kMajority) return std::nullopt;
  return Anchor{*Middle(references), "the middle of the geotags"};
}

// Counts what is not used of one kind, for one message.
class FarPlaces {
 public:
  FarPlaces(std::string kind, std::optional<Anchor> anchor) : kind_(std::move(kind)), anchor_(std::move(anchor)) {}

  // Is a place to be left out?
  bool Out(const Geodetic& g) {
    ++all_;
    if (IsNowhere(g)) {
      ++nowhere_;
      return true;
    }
    if (!anchor_) return false;
    const double distance = Distance_m(g, anchor_->place);
    if (distance <= kFarthest_m) return false;
    const Geodetic swapped{g.longitude_deg, g.latitude_deg, 0};
    if (std::abs(swapped.latitude_deg) <= 90 && Distance_m(swapped, anchor_->place) <= kFarthest_m) ++swapped_;
    if (far_++ == 0) first_m_ = distance;
    return true;
  }
  void Warn(std::vector<std::string>* warnings) const {
    const std::string of = " of " + std::to_string(all_) + " " + kind_;
    if (nowhere_ > 0) {
      warnings->push_back(
          std::to_string(nowhere_) + of +
          " state latitude 0, longitude 0, as receivers without a fix do; these positions are not used");
    }
    if (far_ == 0) return;
    warnings->push_back(std::to_string(far_) + of + " lie " + std::to_string(std::llround(first_m_ / 1000)) +
                        " km from " + anchor_->name + "; expected at most " +
                        std::to_string(std::llround(kFarthest_m / 1000)) + " km" +
                        (swapped_ == far_ ? "; with latitude and longitude swapped they lie there: the columns of one "
                                            "of the two are swapped"
                                          : "") +
                        "; these positions are not used");
  }

 private:
  std::string kind_;
  std::optional<Anchor> anchor_;
  int all_ = 0, nowhere_ = 0, far_ = 0, swapped_ = 0;
  double first_m_ = 0;
};

}  // namespace

bool IsGeoTiff(const std::filesystem::path& file) {
  TIFFSetErrorHandler(nullptr);
  TIFFSetWarningHandler(nullptr);
  const std::unique_ptr<TIFF, void (*)(TIFF*)> tiff(TIFFOpen(file.c_str(), "r"), [](TIFF* open) {
    if (open != nullptr) TIFFClose(open);
  });
  if (!tiff) return false;
  constexpr uint32_t kPixelScale = 33550, kTransformation = 34264;
  uint32_t width = 0;
  uint16_t count = 0;
  void* values = nullptr;
  return TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width) == 1 && width > 0 &&
         (TIFFGetField(tiff.get(), kPixelScale, &count, &values) == 1 ||
          TIFFGetField(tiff.get(), kTransformation, &count, &values) == 1);
}

void LeaveOutFarPlaces(Site* site) {
  // Fixes without a place are no evidence of where the site is.
  for (Run& run : site->runs) {
    FarPlaces nowhere("GPS fixes of run " + run.name, std::nullopt);
    std::erase_if(run.gps, [&](const GpsFix& fix) { return nowhere.Out(fix.position); });
    nowhere.Warn(&run.warnings);
  }
  const std::optional<Anchor> anchor = FindAnchor(*site);
  FarPlaces control("control points", anchor), references("geotags of panoramas and photos", anchor);
  std::erase_if(site->control_points,
                [&](const ControlPoint& point) { return point.geodetic && control.Out(*point.geodetic); });
  control.Warn(&site->warnings);
  for (Run& run : site->runs) {
    FarPlaces gps("GPS fixes of run " + run.name, anchor);
    std::erase_if(run.gps, [&](const GpsFix& fix) { return gps.Out(fix.position); });
    gps.Warn(&run.warnings);
  }
  for (Reference& reference : site->references) {
    GeoTag& tag = reference.geotag;
    if (tag.has_position && references.Out(tag.position)) tag.has_position = tag.has_height = false;
  }
  references.Warn(&site->warnings);
}

}  // namespace trigpoint
