#include "app/pipeline/stitch_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "calib/base/error.h"
#include "datasets/io/exif_positions.h"
#include "datasets/io/geodetic_mean.h"
#include "datasets/io/image.h"
#include "datasets/io/panorama_writer.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/text.h"
#include "survey/panorama/composite.h"
#include "survey/panorama/rig_files.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct StitchStageOptions {
  StitchOptions rig;
  CompositeOptions panorama;
  bool compose = true;  // also make the picture, not the rig alone

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.rig, {"rig", "", 0, 0, "estimation of the rig: the poses of the photos to each other"});
    visit(self.panorama, {"panorama", "", 0, 0, "composition of the panorama from the photos"});
    visit(self.compose, {"compose", "", 0, 1, "compose the panorama; false: estimate the rig only"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

fs::path FolderOfSet(const Project& project, const std::string& name) {
  for (const fs::path& dir : PhotoSetFolders(project.dir())) {
    if (dir.filename() == name) return dir;
  }
  throw InputError("project " + project.dir().string() + " has no photo set '" + name + "'");
}

// Photos taken along a walk match at most by chance; stitching them would give a panorama that is wrong.
void RequireOneSpot(const PhotoSet& set, const fs::path& dir) {
  std::vector<PhotoMetadata> photos;
  for (const Photo& photo : set.photos) photos.push_back(photo.metadata);
  const std::string why = WhyNotFromOneSpot(photos);
  if (why.empty()) return;
  throw InputError(dir.string() + ": " + why + "; put photos taken on the way into runs/" + set.name +
                   "/images/ as a run, or list single ones in photos.csv");
}

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

nlohmann::json Metrics(const StitchedRig& rig, int given) {
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

std::string Summary(const StageOutcome& outcome, const DisplayUnit& unit) {
  const nlohmann::json& m = outcome.manifest.at("metrics");
  const auto number = [&](const char* name) { return m.at(name).get<double>(); };
  std::string text = fmt::format(
      "{} of {} photos placed; {}focal length {:.2f} px +- {:.2f} (1 sigma{})\n", m.at("placed").get<int>(),
      m.at("photos").get<int>(), m.value("fisheye", false) ? "fisheye, " : "", number("focal_px"),
      number("focal_sigma_px"), m.at("focal_from_exif").get<bool>() ? ", first value from EXIF" : ", without EXIF");
  text += fmt::format("residuals {:.2f} px rms with one centre for all photos, {:.2f} px with each photo's own\n",
                      number("rms_one_centre_px"), number("rms_px"));
  text += fmt::format(
      "parallax {:.1f} px median, {:.1f} px for 5 %; the photos' centres lie {:.3f} {} (rms) about their mean, which "
      "is "
      "the panorama's centre; their scale is known to a factor of {:.2f} (1 sigma)\n",
      number("parallax_median_px"), number("parallax_p95_px"), number("centres_rms_m") / unit.metres, unit.name,
      std::exp(number("radius_log_sigma")));
  if (m.at("full_turn").get<bool>()) {
    text += fmt::format("full turn, closes to {:+.2f} deg before adjustment\n", number("closure_deg"));
  } else if (number("largest_gap_deg") > 0) {
    text += fmt::format("no full turn: {:.0f} deg of the horizon are not seen\n", number("largest_gap_deg"));
  } else {
    text += "the whole horizon is seen, by too few photos to close a ring\n";
  }
  text += m.contains("level_sigma_deg")
              ? fmt::format("levelled by {} ({:.2f} deg, 1 sigma)", m.at("level_source").get<std::string>(),
                            number("level_sigma_deg"))
              : std::string("not levelled");
  text += m.contains("heading_deg") ? fmt::format(", heading {:.1f} deg +- {:.1f} by compass\n", number("heading_deg"),
                                                  number("heading_sigma_deg"))
                                    : std::string(", heading unknown\n");
  if (m.contains("panorama")) {
    text += fmt::format("{} ({} x {} px, {:.1f} % of the sphere)\n",
                        (outcome.dir / m.at("panorama").get<std::string>()).string(), m.at("width_px").get<int>(),
                        m.at("height_px").get<int>(), 100 * number("covered_share"));
  }
  return text;
}

}  // namespace

StageInfo StitchStage() {
  StageInfo info;
  info.name = "stitch";
  info.help = "make a panorama of hand-held photos, and the pose of each";
  info.metric = "placed";
  UseOptions<StitchStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<StitchStageOptions>(project, "stitch", target);
    const fs::path dir = FolderOfSet(project, target.run);
    StageRequest request;
    request.options = JsonFromOptions(options);
    request.version = 12;
    request.inputs = PicturesIn(dir);
    for (const fs::path& mask : PicturesIn(dir / "masks")) request.inputs.push_back(mask);
    request.body = [options, dir, name = target.run](StageContext& context) {
      const PhotoSet set = ReadPhotoSet(dir, name);
      RequireOneSpot(set, dir);
      const auto load = [](bool grey) { return [grey](const Photo& photo) { return LoadPicture(photo.file, grey); }; };
      const StitchedRig rig =
          StitchPhotos(set, load(true), options.rig, context.threads, context.seed, context.progress, context.cancel);
      for (const std::string& w : rig.warnings) context.progress.Log(LogLevel::kWarning, w);
      context.metrics.update(Metrics(rig, static_cast<int>(set.photos.size() + set.left_out.size())));
      WritePairs(rig, context.out);
      if (!rig.held_out.empty()) WriteHeldOut(rig, context.out);
      if (!options.compose) {
        WriteRigFiles(rig, nullptr, context.out);
        return;
      }
      const std::string file = "panorama." + options.panorama.format;
      std::optional<PanoramaWriter> writer;
      const auto begin = [&](const Composite& c) {
        writer.emplace(context.out / file, c.part.width, c.part.height, options.panorama.quality);
      };
      const Composite composite = CompositePanorama(rig, load(false), options.panorama, context.threads,
                                                    {begin, [&](const cv::Mat& rows) { writer->Write(rows); }},
                                                    context.progress, context.cancel);
      writer->Finish();
      WritePanoramaMetadata(context.out / file, MetadataOf(rig, composite));
      if (!cv::imwrite((context.out / "coverage.png").string(), composite.coverage)) {
        throw IoError((context.out / "coverage.png").string() + ": cannot be written");
      }
      WriteRigFiles(rig, &composite, context.out);
      context.metrics["panorama"] = file;
      context.metrics["width_px"] = composite.part.width;
      context.metrics["height_px"] = composite.part.height;
      context.metrics["covered_share"] = composite.covered;
    };
    return request;
  };
  info.summary = Summary;
  return info;
}

std::vector<Job> StitchJobs(const Project& project, std::vector<std::string> sets, const nlohmann::json& overrides) {
  std::vector<std::string> there;
  for (const fs::path& dir : PhotoSetFolders(project.dir())) there.push_back(dir.filename().string());
  for (const std::string& set : sets) {
    if (std::find(there.begin(), there.end(), set) != there.end()) continue;
    const std::string nearest = NearestName(set, there);
    throw InputError("project " + project.dir().string() + " has no photo set '" + set + "'" +
                     (nearest.empty() ? "" : "; nearest: '" + nearest + "'"));
  }
  if (sets.empty()) sets = there;
  std::vector<Job> jobs;
  for (const std::string& set : sets) jobs.push_back({&StageNamed("stitch"), {set, "", overrides}});
  return jobs;
}

}  // namespace trigpoint
