// GPS tracks: CSV, NMEA 0183, GPX.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

struct GpsTrack {
  std::vector<GpsFix> fixes;  // ascending time on the run's clock, no time twice
  std::vector<std::string> warnings;
};

// Ties a receiver's UTC to the run's clock: stamp = UTC - time_zero. Without `time_zero_utc_ns` stamps are Unix time.
struct RunClock {
  std::optional<int64_t> time_zero_utc_ns;
  std::string date;  // YYYY-MM-DD (UTC) for NMEA without RMC or ZDA sentences
};

// A height nobody measured is 0 with kUnknownHeightSigma; one above the sea, where nobody says how far the sea lies
// from the ellipsoid (-107 to +86 m), is kept with this sigma, which is of one error that all fixes share.
constexpr double kUnknownGeoidSigma = 50;

// Makes a fix whose height is above the sea, with the sigma that it has there, one above the ellipsoid.
void CountFromSea(GpsFix* fix);

// The one of ascending stamps that is nearest to a fix; none where it is more than 0.3 s away: the fix does not say
// where that pose is.
std::optional<size_t> NearestToFix(const std::vector<int64_t>& stamps_ns, const GpsFix& fix);

// `timestamp_s` (on the run's clock), `latitude_deg`, `longitude_deg` [, `height_m`, `sigma_h_m`, `sigma_v_m`].
GpsTrack ReadGpsCsv(const std::filesystem::path& file);

// GGA (height = above sea + geoid separation), RMC and ZDA (date), GST (sigmas); any talker. Sentences with a wrong
// checksum, an invalid status or no fix are counted and skipped. The day goes on at midnight. RTK fixes (quality 4, 5)
// without GST get 0.02 / 0.04 m and 0.3 / 0.5 m.
GpsTrack ReadNmea(const std::filesystem::path& file, const RunClock& clock);

// Why the heights of a run's fixes cannot be above the ellipsoid, where no geotag has a height and only control points,
// or else the site's origin, can tell; empty where they can.
std::string GpsHeightContradiction(const Site& site, const Run& run);

// GPX 1.0 and 1.1 track points with time; height = ele + geoidheight.
GpsTrack ReadGpx(const std::filesystem::path& file, const RunClock& clock);

}  // namespace trigpoint
