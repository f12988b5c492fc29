#include "survey/input/photo_sets.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/error.h"
#include "survey/tags/excluded_detections.h"

namespace trigpoint {
namespace {

// The photos of a stitched set: the rig takes odometry's place, one photo to the next.
SurveyRun RunOfSet(const std::string& name, const ReferenceTags& its) {
  SurveyRun set;
  set.name = "photo set " + name;
  set.stills = true;
  set.scale_sigma = its.rig_scale_sigma;
  set.max_gap_s = 2 * static_cast<double>(its.rig.views.size());
  for (size_t i = 0; i < its.rig.views.size(); ++i) {
    const View& view = its.rig.views[i];
    ImageDetections photo;
    photo.stamp_ns = static_cast<int64_t>(i) * 1'000'000'000;  // their order is all that is known
    photo.image = "photos/" + name + "/" + view.name;
    photo.detections = its.tags[i].detections;
    const auto camera = std::find_if(set.cameras.begin(), set.cameras.end(), [&](const BodyCamera& c) {
      return c.camera.params() == view.camera.params() && c.camera.width() == view.camera.width() &&
             c.camera.height() == view.camera.height();
    });
    if (camera == set.cameras.end()) {
      BodyCamera lens;
      lens.name = "lens" + std::to_string(set.cameras.size());
      lens.camera = view.camera;
      photo.camera = lens.name;
      set.cameras.push_back(lens);
    } else {
      photo.camera = camera->name;
    }
    set.odometry.poses.push_back({photo.stamp_ns, view.rig_from_view});
    set.images.push_back(std::move(photo));
  }
  return set;
}

void AddPhotoSet(const Project& project, const Reference& reference, const RigFolders& rigs,
                 const DetectTagsOptions& options, const StageContext& context, SurveyJob* job) {
  ReferenceTags its = FindReferenceTags(reference, rigs, options, context);
  SurveyRun set = RunOfSet(reference.name, its);
  LeaveOutExcluded(project.review(), set.name, set.images);
  std::set<int> unknown;
  bool any = false;
  for (ImageDetections& photo : set.images) {
    std::erase_if(photo.detections, [&](const TagDetection& d) {
      const bool sized = job->input.sizes.SizeOf(d.id) > 0;
      if (!sized) unknown.insert(d.id);
      return !sized;
    });
    any |= !photo.detections.empty();
  }
  for (int id : unknown) {
    job->warnings.push_back(fmt::format("{}: tag {} has no size in tags.yaml and takes no part", set.name, id));
  }
  if (!any) return;  // none to be seen, or not stitched yet
  job->input.runs.push_back(std::move(set));
  job->sets[reference.name] = std::move(its);
}

}  // namespace

void AddPhotoSets(const Project& project, const RigFolders& rigs, const DetectTagsOptions& options,
                  StageContext& context, SurveyJob* job) {
  for (const Reference& reference : project.site().references) {
    if (reference.kind != ReferenceKind::kPhotoSet || project.review().ExcludesStation(reference.station) ||
        project.review().ExcludesPanorama(reference.name)) {
      continue;
    }
    context.cancel.ThrowIfCancelled();
    try {
      AddPhotoSet(project, reference, rigs, options, context, job);
    } catch (const InputError& e) {
      job->warnings.push_back("photo set " + reference.name + " takes no part: " + e.what());
    }
  }
}

}  // namespace trigpoint
