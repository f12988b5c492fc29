#include "app/pipeline/stitch_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/text.h"
#include "survey/panorama/panorama_files.h"
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
      const auto load = [](const Photo& photo) { return LoadPicture(photo.file, true); };
      const StitchedRig rig =
          StitchPhotos(set, load, options.rig, context.threads, context.seed, context.progress, context.cancel);
      for (const std::string& w : rig.warnings) context.progress.Log(LogLevel::kWarning, w);
      context.metrics.update(StitchMetrics(rig, static_cast<int>(set.photos.size() + set.left_out.size())));
      WritePairs(rig, context.out);
      if (!rig.held_out.empty()) WriteHeldOut(rig, context.out);
      if (!options.compose) {
        WriteRigFiles(rig, nullptr, context.out);
        return;
      }
      const std::string file = "panorama." + options.panorama.format;
      const Composite composite =
          WritePanorama(rig, options.panorama, context.out / file, context.threads, context.progress, context.cancel);
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
