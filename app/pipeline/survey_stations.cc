#include "app/pipeline/survey_stations.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "app/pipeline/set_localization.h"
#include "datasets/io/image.h"
#include "localize/views.h"
#include "survey/panorama/rig_files.h"

namespace trigpoint {
namespace {

constexpr int kLargestView = 2048;  // px

// The views of a reference and their pictures; none where it has no rig yet.
struct Pictures {
  ViewRig rig;
  std::vector<cv::Mat> pictures;
};

Pictures LoadPictures(const Project& project, const Reference& reference) {
  Pictures out;
  if (reference.kind == ReferenceKind::kPanorama) {
    const cv::Mat panorama = LoadPanorama(reference.files.front(), true);
    ViewOptions options;  // its own resolution: far tags are small
    options.size_px = std::min(kLargestView, static_cast<int>(std::lround(panorama.cols / std::numbers::pi)));
    out.rig = PanoramaViews(reference.name, panorama.cols, options);
    for (const View& view : out.rig.views) out.pictures.push_back(RenderView(panorama, view));
  } else if (reference.kind == ReferenceKind::kPhotoSet) {
    const auto rigs = StitchedRigs(project);
    const auto rig = rigs.find(reference.name);
    if (rig == rigs.end() || !std::filesystem::exists(rig->second / "rig.csv")) return out;
    out.rig = ReadRigFiles(rig->second).rig;
    for (const View& view : out.rig.views) {
      const auto file = std::find_if(reference.files.begin(), reference.files.end(),
                                     [&](const auto& path) { return path.filename() == view.name; });
      if (file == reference.files.end()) throw InputError(reference.name + ": its rig has no photo " + view.name);
      out.pictures.push_back(LoadPhoto(*file, view.camera, true));
    }
  } else if (reference.camera) {
    out.rig.views.push_back({"0", *reference.camera, Rigid3d()});
    out.pictures.push_back(LoadPhoto(reference.files.front(), *reference.camera, true));
  }
  return out;
}

}  // namespace

std::vector<StationOffset> MeasureStations(const Project& project, const std::vector<TagEstimate>& map,
                                           StageContext& context) {
  std::vector<std::pair<const Reference*, const Station*>> jobs;
  for (const Reference& reference : project.site().references) {
    const std::vector<Station>& stations = project.site().stations;
    const auto station =
        std::find_if(stations.begin(), stations.end(), [&](const Station& s) { return s.name == reference.station; });
    if (station == stations.end() || project.review().ExcludesStation(station->name)) continue;
    jobs.emplace_back(&reference, &*station);
  }
  DetectTagsOptions options;
  options.family = project.site().tags.family;
  std::vector<StationOffset> offsets;
  ProgressSink silent;
  context.progress.Begin("offsets of stations", static_cast<int64_t>(jobs.size()));
  for (const auto& [reference, station] : jobs) {
    context.cancel.ThrowIfCancelled();
    try {
      const Pictures p = LoadPictures(project, *reference);
      const auto view = [&](int64_t i) -> const View& { return p.rig.views[static_cast<size_t>(i)]; };
      const DetectTagsResult found = DetectTags(
          static_cast<int64_t>(p.pictures.size()), [&](int64_t i) { return p.pictures[static_cast<size_t>(i)]; },
          [&](int64_t i) { return &view(i).camera; }, options, context.threads, silent, context.cancel);
      std::vector<PanoramaTag> seen;
      for (size_t i = 0; i < found.images.size(); ++i) {
        const View& its = p.rig.views[i];
        for (const TagDetection& d : found.images[i].detections) {
          seen.push_back({d, &its.camera, its.rig_from_view, its.covariance.bottomRightCorner<3, 3>()});
        }
      }
      offsets.push_back(EstimateStationOffset(*station, reference->name, seen, map, {}));
    } catch (const InputError& e) {
      context.progress.Log(LogLevel::kWarning, std::string("no offset from the tags it shows: ") + e.what());
    }
    context.progress.Advance(1);
  }
  return offsets;
}

}  // namespace trigpoint
