// Do the places that a site's files state lie on one site?
#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>

#include "calib/base/median.h"
#include "datasets/io/run_parts.h"

namespace trigpoint {
namespace {

constexpr double kFarthest_m = 100e3;  // no site is larger
constexpr double kNear_m = 2e3;        // of an origin, or as far as the places are apart
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
    warnings->push_back(fmt::format("{}{} are not used: they lie more than {:.0f} km from {} (the first: {:.0f} km){}",
                                    far_, of, kFarthest_m / 1000, anchor_->name, first_m_ / 1000,
                                    swapped_ == far_
                                        ? "; with latitude and longitude swapped they fit: exchange the two columns"
                                        : "; correct them"));
  }

 private:
  std::string kind_;
  std::optional<Anchor> anchor_;
  int all_ = 0, nowhere_ = 0, far_ = 0, swapped_ = 0;
  double first_m_ = 0;
};

// Places of one kind that alone say where the site is, beside origin.json.
struct Places {
  std::string kind;
  std::vector<Geodetic> all;
  std::function<void()> leave_out;
};

std::vector<Places> PlacesOf(Site* site) {
  Places control{"control points", {}, [site] {
                   std::erase_if(site->control_points, [](const ControlPoint& p) { return p.geodetic.has_value(); });
                 }};
  for (const ControlPoint& point : site->control_points) {
    if (point.geodetic) control.all.push_back(*point.geodetic);
  }
  Places gps{"GPS fixes", {}, [site] {
               for (Run& run : site->runs) run.gps.clear();
             }};
  for (const Run& run : site->runs) {
    for (const GpsFix& fix : run.gps) gps.all.push_back(fix.position);
  }
  Places geotags{"geotags of panoramas and photos", {}, [site] {
                   for (Reference& r : site->references) r.geotag.has_position = r.geotag.has_height = false;
                 }};
  for (const Reference& reference : site->references) {
    if (reference.geotag.has_position) geotags.all.push_back(reference.geotag.position);
  }
  std::vector<Places> stated;
  for (Places* places : {&control, &gps, &geotags}) {
    if (!places->all.empty()) stated.push_back(std::move(*places));
  }
  return stated;
}

// All places far from the site's origin, and only one kind of them: either may be wrong, and nothing else tells.
void CompareWithOrigin(Site* site) {
  if (!site->origin) return;
  const std::vector<Places> stated = PlacesOf(site);
  if (stated.size() != 1) return;
  const Places& places = stated.front();
  double nearest = std::numeric_limits<double>::infinity(), extent = 0;
  for (const Geodetic& g : places.all) {
    nearest = std::min(nearest, Distance_m(g, *site->origin));
    extent = std::max(extent, Distance_m(g, places.all.front()));
  }
  if (nearest <= std::max(kNear_m, extent)) return;
  char text[400];
  std::snprintf(
      text, sizeof text,
      "all %zu %s lie at least %.1f km from origin.json (expected at most %.0f km, or their own extent) and are not "
      "used: correct them or the origin. An origin that is meant to lie so far away belongs into trigpoint.yaml",
      places.all.size(), places.kind.c_str(), 1e-3 * nearest, 1e-3 * kNear_m);
  site->warnings.push_back(text);
  places.leave_out();
}

// What heights may be that differ from the origin's by more than the ground does.
std::string HeightReading(const std::vector<double>& heights, double origin_m, double allowed_m) {
  constexpr double kFoot_m = 0.3048, kMostGeoid_m = 110;
  const double height = Median(heights);
  if (std::all_of(heights.begin(), heights.end(), [](double h) { return h == 0; })) {
    return ": all are 0, which states no height (leave the column empty)";
  }
  if (std::abs(kFoot_m * height - origin_m) < allowed_m) return ": they seem to be in feet (convert them to metres)";
  if (std::abs(height - origin_m) < kMostGeoid_m) {
    return ": one of the two seems to be above the sea (give both above the ellipsoid)";
  }
  return ": one of the two is wrong; expected metres above the ellipsoid";
}

// What says how high the site lies.
struct Level {
  Geodetic place;
  std::string name;
};

// Control points, else the origin, which states no height if it is 0.
std::optional<Level> FindLevel(const Site& site) {
  std::vector<Geodetic> control;
  for (const ControlPoint& p : site.control_points) {
    if (p.geodetic) control.push_back(*p.geodetic);
  }
  if (!control.empty()) {
    std::nth_element(control.begin(), control.begin() + static_cast<std::ptrdiff_t>(control.size() / 2), control.end(),
                     [](const Geodetic& a, const Geodetic& b) { return a.height_m < b.height_m; });
    return Level{control[control.size() / 2], "control points"};
  }
  if (!site.origin || site.origin->height_m == 0) return std::nullopt;
  return Level{*site.origin, "origin.json"};
}

// Why heights cannot be as stated, by that of the site; empty where they can.
std::string HeightContradiction(const std::string& whose, const std::vector<Geodetic>& places, const Level& level) {
  constexpr double kAllowed_m = 20, kSlope = 0.2;
  if (places.empty()) return "";
  std::vector<double> heights, off, distances;
  for (const Geodetic& place : places) {
    heights.push_back(place.height_m);
    off.push_back(std::abs(place.height_m - level.place.height_m));
    distances.push_back(Distance_m(place, level.place));
  }
  const double allowed = kAllowed_m + kSlope * Median(distances);
  if (Median(off) <= allowed) return "";
  return fmt::format(
      "the heights of {} (median {:.0f} m) differ from that of {} ({:.0f} m) by more than the ground explains{}", whose,
      Median(heights), level.name, level.place.height_m, HeightReading(heights, level.place.height_m, allowed));
}

// Heights of geotags where nothing else can tell them wrong.
void CompareGeotagHeights(const Level& level, Site* site) {
  std::vector<Geodetic> places;
  for (const Reference& reference : site->references) {
    if (reference.geotag.has_height) places.push_back(reference.geotag.position);
  }
  const std::string why = HeightContradiction("geotags", places, level);
  if (why.empty()) return;
  site->warnings.push_back(why + "; these heights are not used");
  for (Reference& reference : site->references) reference.geotag.has_height = false;
}

bool HasGeotagHeights(const Site& site) {
  return std::any_of(site.references.begin(), site.references.end(),
                     [](const Reference& reference) { return reference.geotag.has_height; });
}

void CompareHeightsWithOrigin(Site* site) {
  const std::optional<Level> level = FindLevel(*site);
  const bool gps = std::any_of(site->runs.begin(), site->runs.end(), [](const Run& run) { return !run.gps.empty(); });
  if (!level || level->name != "origin.json" || gps) return;  // `survey` compares geotags with control
  CompareGeotagHeights(*level, site);
}

}  // namespace

std::string GpsHeightContradiction(const Site& site, const Run& run) {
  const std::optional<Level> level = FindLevel(site);
  if (!level || HasGeotagHeights(site)) return "";
  std::vector<Geodetic> places;
  for (const GpsFix& fix : run.gps) {
    if (fix.sigma_sea_m == 0 && fix.sigma_v_m < kUnknownHeightSigma) places.push_back(fix.position);
  }
  return HeightContradiction("GPS fixes of run " + run.name, places, *level);
}

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
  CompareWithOrigin(site);
  CompareHeightsWithOrigin(site);
}

}  // namespace trigpoint
