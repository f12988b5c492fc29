// Reworks a site with truth into what comes from street-level imagery services and other cameras: panoramas levelled
// in roll only, with a hidden part, a logo strip and rough geotags; runs seen through a mirror.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct StreetViewOptions {
  double max_pitch_deg = 3.5;      // the vehicle's pitch, uniform in +-; the geotag says 0
  double heading_sigma_deg = 0.3;  // of the geotag's heading
  // Geotag positions: horizontal error of log-normal length with this median and 90th percentile, any direction.
  double position_median_m = 0.35;
  double position_p90_m = 1.2;
  int outliers = 1;  // panoramas whose position is wrong by outlier_m
  double outlier_m = 7;
  double sigma_h_m = 0.5;          // what the geotag claims, per axis
  double hidden_below_deg = 35;    // below the horizon; everything under it is hidden
  std::string hidden_by = "both";  // black, roof (the vehicle's), or both: in turn
  bool logo = true;                // a strip of text, the same in all panoramas, above the hidden part

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_pitch_deg, {"max_pitch_deg", "deg", 0, 45, "largest pitch that the geotag does not tell"});
    visit(self.heading_sigma_deg, {"heading_sigma_deg", "deg", 0, 180, "error of the geotag's heading"});
    visit(self.position_median_m, {"position_median_m", "m", 1e-6, 1e3, "median error of the geotag's position"});
    visit(self.position_p90_m, {"position_p90_m", "m", 1e-6, 1e3, "its 90th percentile"});
    visit(self.outliers, {"outliers", "", 0, 1e4, "panoramas with a wrong position"});
    visit(self.outlier_m, {"outlier_m", "m", 0, 1e6, "how wrong"});
    visit(self.sigma_h_m, {"sigma_h_m", "m", 1e-3, 1e3, "the error that the geotag claims"});
    visit(self.hidden_below_deg,
          {"hidden_below_deg", "deg", 0, 90, "angle below the horizon from which all is hidden"});
    visit(self.hidden_by, {"hidden_by", "", 0, 0, "black, roof or both"});
    visit(self.logo, {"logo", "", 0, 1, "a strip of text in every panorama"});
  }
  std::vector<std::string> Check() const;
};

// An equirectangular panorama turned: ray_in_old = old_from_new * ray_in_new. Bicubic.
cv::Mat RotatePanorama(const cv::Mat& panorama, const Eigen::Quaterniond& old_from_new);

// Copies a site whose panoramas' truth stands in `truth` (panoramas.tum, or panoramas_<run>.tum) to `out`, its
// panoramas reworked as described, and writes `out_truth` (with the turned panoramas' poses). Runs are copied as they
// are; photos, stations and control points are left out. Same arguments, same folder. Throws InputError, IoError,
// OptionError.
void MakeStreetViewSite(const std::filesystem::path& site, const std::filesystem::path& truth,
                        const std::filesystem::path& out, const std::filesystem::path& out_truth,
                        const StreetViewOptions& options, uint64_t seed, ProgressSink& progress,
                        const CancelToken& cancel);

// Copies a site with one run's pictures flipped left to right and `mirrored: true` in its run.yaml; the truth stays.
void MakeMirroredSite(const std::filesystem::path& site, const std::string& run, const std::filesystem::path& out,
                      ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
