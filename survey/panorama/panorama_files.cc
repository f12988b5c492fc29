#include "survey/panorama/panorama_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/error.h"
#include "datasets/io/exif_positions.h"
#include "datasets/io/geodetic_mean.h"
#include "datasets/io/image.h"
#include "datasets/io/panorama_writer.h"

namespace trigpoint {
namespace {

// Position and times of the panorama from its photos: the mean of their geotags.
PanoramaMetadata MetadataOf(const StitchedRig& rig, const Composite& composite) {
  PanoramaMetadata m;
  m.width = composite.width, m.height = composite.height;
  m.part = composite.part;
  m.photos = rig.placed;
  if (rig.heading_rad) m.heading_deg = *rig.heading_rad * kRadToDeg;
  if (rig.level_sigma_deg) m.pitch_deg = m.roll_deg = 0;
  GeodeticMean mean;
  for (size_t i = 0; i < rig.photos.size(); ++i) {
    if (!rig.state.photos[i].placed) continue;
    const PhotoMetadata& p = rig.photos[i].metadata;
    if (p.taken_utc_ns) {
      m.first_utc_ns = std::min(m.first_utc_ns.value_or(*p.taken_utc_ns), *p.taken_utc_ns);
      m.last_utc_ns = std::max(m.last_utc_ns.value_or(*p.taken_utc_ns), *p.taken_utc_ns);
    }
    if (!p.position) continue;
    mean.Add(*p.position, p.has_height);
    if (p.sigma_h_m) m.sigma_h_m = std::max(m.sigma_h_m.value_or(0), *p.sigma_h_m);
    if (p.has_height) m.height_above_sea = p.height_above_sea;
  }
  if (mean.count() > 0) m.position = mean.Mean();
  m.has_height = mean.heights() > 0;
  if (composite.covered < 0.999) {
    m.description = fmt::format("{:.1f} % of the sphere is covered; {}", 100 * composite.covered,
                                composite.part.width < composite.width ? "the picture is the part that holds it"
                                                                       : "the rest is black, transparent in TIFF");
  }
  return m;
}

}  // namespace

void RequireOneSpot(const PhotoSet& set, const std::filesystem::path& dir) {
  std::vector<PhotoMetadata> photos;
  for (const Photo& photo : set.photos) photos.push_back(photo.metadata);
  const std::string why = WhyNotFromOneSpot(photos);
  if (why.empty()) return;
  throw InputError(dir.string() + ": " + why + "; put photos taken on the way into runs/" + set.name +
                   "/images/ as a run, or list single ones in photos.csv");
}

nlohmann::json StitchMetrics(const StitchedRig& rig, int given) {
  const Lens& lens = rig.state.lenses.front();
  const Eigen::MatrixXd& c = rig.bundle.covariance;
  const Eigen::Index at = 6 * rig.placed;
  nlohmann::json m = {{"photos", given},
                      {"placed", rig.placed},
                      {"pairs_tried", rig.pairs_tried},
                      {"pairs_verified", rig.pairs.size()},
                      {"points", rig.state.points.size()},
                      {"focal_px", lens.focal_px},
                      {"focal_sigma_px", c.rows() > at ? std::sqrt(std::max(0.0, c(at, at))) : 0.0},
                      {"fisheye", lens.fisheye},
                      {"focal_start_px", rig.focal_start_px},
                      {"focal_from_exif", rig.focal_from_exif},
                      {"rms_px", rig.parallax.rms_rig_px},
                      {"rms_one_centre_px", rig.parallax.rms_central_px},
                      {"parallax_median_px", rig.parallax.median_px},
                      {"parallax_p95_px", rig.parallax.p95_px},
                      {"centres_rms_m", rig.parallax.spread_m},
                      {"radius_m", rig.state.radius_m},
                      {"radius_log_sigma", rig.bundle.radius_log_sigma},
                      {"shared_errors", rig.bundle.shared_errors},
                      {"full_turn", rig.closure.full_turn},
                      {"closure_deg", rig.closure.error_deg},
                      {"largest_gap_deg", rig.closure.largest_gap_deg},
                      {"level_source", rig.level_source}};
  if (rig.level_sigma_deg) m["level_sigma_deg"] = *rig.level_sigma_deg;
  if (rig.heading_rad) {
    m["heading_deg"] = *rig.heading_rad * kRadToDeg;
    m["heading_sigma_deg"] = rig.heading_sigma_rad * kRadToDeg;
  }
  return m;
}

Composite WritePanorama(const StitchedRig& rig, const CompositeOptions& options, const std::filesystem::path& file,
                        int threads, ProgressSink& progress, const CancelToken& cancel) {
  const auto load = [](const Photo& photo) { return LoadPicture(photo.file, false); };
  std::optional<PanoramaWriter> writer;
  const auto begin = [&](const Composite& c) { writer.emplace(file, c.part.width, c.part.height, options.quality); };
  Composite composite = CompositePanorama(rig, load, options, threads,
                                          {begin, [&](const cv::Mat& rows) { writer->Write(rows); }}, progress, cancel);
  writer->Finish();
  WritePanoramaMetadata(file, MetadataOf(rig, composite));
  const std::string coverage = (file.parent_path() / "coverage.png").string();
  if (!cv::imwrite(coverage, composite.coverage)) throw IoError(coverage + ": cannot be written");
  return composite;
}

}  // namespace trigpoint
