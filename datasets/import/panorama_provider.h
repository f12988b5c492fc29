// Where panoramas come from: services and folders behind one interface. Nothing here downloads anything; a folder that
// somebody filled is the first provider.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/import/colmap_run.h"
#include "datasets/io/site.h"

namespace trigpoint {

// What a service says about a panorama. Angles of the image centre, degrees; height is rarely of use.
struct PanoramaRecord {
  std::string id;
  Geodetic position;
  bool has_height = false;
  std::optional<double> heading_deg, pitch_deg, roll_deg;
  std::string date;  // as said
};

class PanoramaProvider {
 public:
  virtual ~PanoramaProvider() = default;
  virtual std::string Name() const = 0;
  // Those within `radius_m` of `near`, or all.
  virtual std::vector<PanoramaRecord> Find(const std::optional<Geodetic>& near, double radius_m) const = 0;
  // The whole picture, equirectangular, BGR, 2:1. Throws InputError naming what is missing.
  virtual cv::Mat Load(const std::string& id) const = 0;
  // What is wrong with single ones, one sentence each.
  virtual std::vector<std::string> Warnings() const { return {}; }
};

// A folder with metadata JSON: one object per file, a list, or {"panoramas": [...]}. Read are, in any of these
// spellings, id | pano_id | panoId; latitude | lat, longitude | lng | lon, also inside location | position |
// coordinate; heading | heading_deg | yaw | compass_angle; pitch | tilt - 90; roll; altitude | elevation; date |
// captured_at. Pictures: <id>.jpg (.png, ...), or <id>/ with tiles <x>_<y>.jpg (tile_<x>_<y>, columns and rows from 0),
// or with the faces front, right, back, left, up, down (or 0 to 5 in this order; 90 deg each, up and down may be
// missing).
std::unique_ptr<PanoramaProvider> OpenPanoramaFolder(const std::filesystem::path& dir);

struct PanoramaImportOptions {
  std::optional<Geodetic> near;
  double radius_m = 1000;
  // What Street View style positions are good to, 1 sigma: levelled in roll but not in the vehicle's pitch.
  double sigma_h_m = 0.6, sigma_v_m = 20, sigma_heading_deg = 1, sigma_tilt_deg = 2.5;
};

// Writes SITE/panoramas/<id>.jpg and SITE/panoramas.csv. Throws InputError if the table is there already.
ImportReport ImportPanoramas(const std::filesystem::path& site, const PanoramaProvider& provider,
                             const PanoramaImportOptions& options, ProgressSink& progress, const CancelToken& cancel);

// Puts tiles or faces together; for the provider and its tests.
cv::Mat AssembleTiles(const std::vector<std::vector<cv::Mat>>& rows);
// Faces front, right, back, left, up, down, square, 90 deg each; empty ones stay black. `width`: of the panorama.
cv::Mat AssembleFaces(const std::vector<cv::Mat>& faces, int width);

}  // namespace trigpoint
