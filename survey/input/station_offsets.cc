#include "survey/input/station_offsets.h"

#include <algorithm>
#include <utility>

#include "calib/base/error.h"

namespace trigpoint {

std::vector<StationOffset> MeasureStations(const Project& project, const std::vector<TagEstimate>& map,
                                           const std::map<std::string, ReferenceTags>& found, const RigFolders& rigs,
                                           const DetectTagsOptions& options, StageContext& context) {
  std::vector<std::pair<const Reference*, const Station*>> jobs;
  for (const Reference& reference : project.site().references) {
    const std::vector<Station>& stations = project.site().stations;
    const auto station =
        std::find_if(stations.begin(), stations.end(), [&](const Station& s) { return s.name == reference.station; });
    if (station == stations.end() || project.review().ExcludesStation(station->name)) continue;
    jobs.emplace_back(&reference, &*station);
  }
  std::vector<StationOffset> offsets;
  context.progress.Begin("offsets of stations", static_cast<int64_t>(jobs.size()));
  for (const auto& [reference, station] : jobs) {
    context.cancel.ThrowIfCancelled();
    try {
      const auto already = found.find(reference->name);
      const ReferenceTags its =
          already != found.end() ? already->second : FindReferenceTags(*reference, rigs, options, context);
      std::vector<PanoramaTag> seen;
      for (size_t i = 0; i < its.tags.size(); ++i) {
        const View& view = its.rig.views[i];
        for (const TagDetection& d : its.tags[i].detections) {
          seen.push_back({d, &view.camera, view.rig_from_view, view.covariance.bottomRightCorner<3, 3>()});
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
