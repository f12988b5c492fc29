// What the results say of a photo set, for the panorama desk. No Qt here.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint {

struct PlacedPhoto {
  std::string name;
  bool placed = false;
  double x = 0, y = 0, z = 0;                    // centre in the rig, m: right, down, forward
  double sigma_x = 0, sigma_y = 0, sigma_z = 0;  // m, 1 sigma
  double azimuth_rad = 0;                        // of its optical axis, right of forward
  double focal_px = 0;
};

struct PhotoSetView {
  std::filesystem::path panorama;  // empty: not stitched yet
  std::vector<PlacedPhoto> photos;
  std::map<std::pair<std::string, std::string>, int> pairs;  // matches between two photos
  std::optional<double> closure_deg, covered_share, parallax_median_px;
  std::vector<std::string> problems;
};

// Reads results/stitch/<set>; what is missing is left out, what is broken is named.
PhotoSetView LoadPhotoSet(const std::filesystem::path& stitch_result, const std::vector<std::string>& photos);

}  // namespace trigpoint
