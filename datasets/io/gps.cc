#include "datasets/io/gps.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/table_position.h"

namespace trigpoint {

void CheckOnEarth(const Geodetic& p, const std::string& where) {
  if (std::abs(p.latitude_deg) <= 90 && std::abs(p.longitude_deg) <= 180 && std::isfinite(p.height_m)) return;
  throw InputError(where + ": expected a latitude of -90 to 90 and a longitude of -180 to 180 degrees, found " +
                   std::to_string(p.latitude_deg) + ", " + std::to_string(p.longitude_deg));
}

void CountFromSea(GpsFix* fix) {
  fix->sigma_sea_m = kUnknownGeoidSigma;
  fix->sigma_v_m = std::hypot(fix->sigma_v_m, kUnknownGeoidSigma);
}

std::optional<size_t> NearestToFix(const std::vector<int64_t>& stamps_ns, const GpsFix& fix) {
  constexpr int64_t kLongestNs = 300'000'000;
  const auto after = std::lower_bound(stamps_ns.begin(), stamps_ns.end(), fix.stamp_ns);
  std::optional<size_t> nearest;
  int64_t least = kLongestNs;
  for (auto at = after == stamps_ns.begin() ? after : after - 1; at != stamps_ns.end() && at <= after; ++at) {
    const int64_t away = std::llabs(*at - fix.stamp_ns);
    if (away > least || (nearest && away == least)) continue;
    least = away;
    nearest = static_cast<size_t>(at - stamps_ns.begin());
  }
  return nearest;
}

void PutFixesInOrder(const std::filesystem::path& file, GpsTrack* track) {
  auto& fixes = track->fixes;
  if (fixes.empty()) {
    throw InputError(file.string() + ": no usable GPS fix" +
                     (track->warnings.empty() ? "" : "; the first problem: " + track->warnings.front()));
  }
  const auto earlier = [](const GpsFix& a, const GpsFix& b) { return a.stamp_ns < b.stamp_ns; };
  if (!std::is_sorted(fixes.begin(), fixes.end(), earlier)) {
    std::stable_sort(fixes.begin(), fixes.end(), earlier);
    track->warnings.push_back(file.string() + ": timestamps are out of order; the fixes were sorted by time");
  }
  const auto same = [](const GpsFix& a, const GpsFix& b) { return a.stamp_ns == b.stamp_ns; };
  const auto doubled = std::unique(fixes.begin(), fixes.end(), same);
  if (doubled != fixes.end()) {
    track->warnings.push_back(file.string() + ": dropped " + Counted(fixes.end() - doubled, "fix", "fixes") +
                              " with a timestamp seen before; the first of each is kept");
    fixes.erase(doubled, fixes.end());
  }
}

GpsTrack ReadGpsCsv(const std::filesystem::path& file) {
  GpsTrack track;
  std::vector<std::string> optional = {"sigma_h_m", "sigma_v_m"};
  optional.insert(optional.end(), PositionColumns().begin(), PositionColumns().end());
  const CsvTable table = CsvTable::Read(file, {"timestamp_s"}, optional);
  if (!table.HasColumn("latitude_deg") && !table.HasColumn("easting_m")) {
    CsvTable::Read(file, {"timestamp_s", "latitude_deg", "longitude_deg"}, optional);  // names the nearest
  }
  track.warnings = table.warnings();
  table.ForEachUsable(&track.warnings, [&](const CsvRow& row) {
    GpsFix fix;
    fix.stamp_ns = row.StampNs("timestamp_s");
    const auto stated = PositionOfRow(row);
    if (!stated) row.Fail("expected a position in columns latitude_deg and longitude_deg, found none");
    fix.position = stated->position;
    fix.sigma_h_m = row.Number("sigma_h_m", fix.sigma_h_m);
    fix.sigma_v_m = stated->has_height ? row.Number("sigma_v_m", fix.sigma_v_m) : kUnknownHeightSigma;
    if (fix.sigma_h_m <= 0 || fix.sigma_v_m <= 0) row.Fail("expected positive sigmas");
    track.fixes.push_back(fix);
  });
  PutFixesInOrder(file, &track);
  return track;
}

}  // namespace trigpoint
