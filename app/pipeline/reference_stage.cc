// reference: the reference pose of every image of a run, from a tag map.
#include <fmt/format.h>

#include <algorithm>

#include "app/pipeline/stage_list.h"
#include "datasets/io/camchain.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/errors/reference_maps.h"
#include "eval/evidence/rolling_tags.h"
#include "eval/trajectory/estimates.h"
#include "eval/truth/reference_poses.h"
#include "eval/truth/reference_report.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct ReferenceStageOptions {
  ReferencePoseOptions poses;
  std::string map = "survey";       // survey, survey@V or a release
  std::string motion = "odometry";  // what bridges images without tags
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    ReferencePoseOptions::Visit(self.poses, visit);
    visit(self.map, {"map", "", 0, 0, "the tag map: survey, survey@V or a release"});
    visit(self.motion, {"motion", "", 0, 0,
                        "motion that bridges images without tags: odometry, or tracks (those of localize, so that the "
                        "reference is not independent of localize)"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = poses.Check();
    if (motion != "odometry" && motion != "tracks") {
      problems.push_back("option motion is '" + motion + "', expected odometry or tracks");
    }
    return problems;
  }
};

// The run's motion as the images' bodies: odometry, or what localize made of odometry and tracks.
Trajectory MotionOf(const Run& run, const ReferenceStageOptions& options, const fs::path& localized) {
  if (options.motion == "odometry") return run.odometry;
  Trajectory motion = ReadTrajectory(localized / "cameras_odom.tum");
  for (TimedPose& pose : motion.poses) {  // of the first camera, on its clock
    pose.stamp_ns = BodyStamp(pose.stamp_ns, run.cameras.front());
    pose.target_from_body = pose.target_from_body * run.cameras.front().cam_from_body;
  }
  return motion;
}

void MakeReference(const ReferenceStageOptions& options, const StageTarget& target, StageContext& context) {
  const Project& project = context.project;
  const Run& run = project.run(target.run);
  const bool guessed = std::any_of(run.cameras.begin(), run.cameras.end(),
                                   [](const BodyCamera& camera) { return camera.focal_sigma_share > 0; });
  if (run.cameras.empty() || guessed)
    throw InputError("run " + run.name + " has no calibrated camera; expected camchain.yaml");
  const fs::path folder = ReferenceMapFolder(project, options.map);
  const ReferenceMap map = ReadReferenceMap(project, folder, options.map);
  const std::string missing = MissingCovariances(map, folder);
  if (!missing.empty()) context.progress.Log(LogLevel::kWarning, missing);
  ReferencePoseInput input;
  input.cameras = run.cameras;
  input.images = run.images;
  std::vector<std::string> warnings;
  input.detections = ReadDetections(ResultOf(project, "detect", target) / "detections.csv", 0.5, &warnings);
  MoveToImageTimes(run, project.site().tags, &input.detections);
  if (input.images.empty()) input.images = ImagesOfDetections(input.detections, run.cameras);
  input.motion = MotionOf(run, options, ResultOf(project, "localize", target));
  if (input.motion.poses.empty()) {
    context.progress.Log(LogLevel::kWarning,
                         "run " + run.name + " has no odometry: only images that see a tag get a pose");
  }
  input.scale_sigma = run.config.odometry_scale_sigma;
  input.tags = map.tags;
  input.cross = map.cross;
  input.sizes = project.site().tags;
  ReferencePoses result = EstimateReferencePoses(input, options.poses, context.progress, context.cancel);
  for (const std::string& warning : result.warnings) context.progress.Log(LogLevel::kWarning, warning);

  // A 360 image reports the pose for all of its views.
  std::erase_if(result.poses, [&](const ReferencePose& pose) {
    return std::any_of(run.cameras.begin(), run.cameras.end(),
                       [&](const BodyCamera& c) { return c.name == pose.camera && c.IsFurtherView(); });
  });

  std::vector<std::string> evidence = map.evidence;
  for (const std::string& name : map.runs) evidence.push_back("tags:" + name);
  for (const int id : result.tags_used) evidence.push_back("tag:" + std::to_string(id));
  evidence.push_back("images:" + run.name);
  if (options.motion == "tracks") evidence.push_back("localize:" + run.name);
  WriteReferencePoses(result.poses, options.map, context.out / "poses.csv");
  std::vector<TimedPose> cameras;
  for (const ReferencePose& pose : result.poses) {
    if (pose.world_from_cam && pose.camera == run.cameras.front().name) {
      cameras.push_back({pose.stamp_ns, *pose.world_from_cam});
    }
  }
  WriteTum(context.out / "cameras.tum", cameras,
           {"trigpoint cameras 1; frame=enu; datum=" + options.map + "; world_from_cam from the tag map"});
  for (const char* unit : {"m", "ft", "us-ft"}) {
    WriteFileAtomically(context.out / fmt::format("report_{}.md", unit),
                        ReferenceText(result, evidence, DisplayUnitNamed(unit)));
  }
  context.metrics = ReferenceMetrics(result, evidence);
}

}  // namespace

StageInfo ReferenceStage() {
  StageInfo info;
  info.name = "reference";
  info.help = "the reference pose of every image of a run, with covariance, from the tag map";
  info.metric = "tags";
  info.needs = {"detect", "survey"};
  info.flags = {"map", "motion"};
  UseOptions<ReferenceStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<ReferenceStageOptions>(project, "reference", target);
    StageRequest request;
    request.version = 3;
    request.options = JsonFromOptions(options);
    const Run& run = project.run(target.run);
    for (const char* file : {"images.txt", "camchain.yaml", "odometry.tum", "run.yaml"}) {
      request.inputs.push_back(run.dir / file);
    }
    request.inputs.push_back(project.dir() / "tags.yaml");
    request.inputs.push_back(ManifestOf(project, "detect", target));
    if (options.map.starts_with("survey")) {
      // Map and covariance themselves: a map that came out the same changes nothing.
      request.inputs.push_back(ReferenceMapFolder(project, options.map) / "tags.csv");
      request.inputs.push_back(ReferenceMapFolder(project, options.map) / "tags_cov.csv");
    } else {
      request.inputs.push_back(ReleaseFolder(project, options.map));  // all of it: it must be as published
    }
    if (options.motion == "tracks") request.inputs.push_back(ManifestOf(project, "localize", target));
    request.body = [options, target](StageContext& context) { MakeReference(options, target, context); };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget& target) -> std::string {
    const auto options = ResolveOptions<ReferenceStageOptions>(project, "reference", target);
    if (!options.map.starts_with("survey")) return "";
    const fs::path tags = ReferenceMapFolder(project, options.map) / "tags.csv";
    if (!fs::exists(tags)) return "no tag map (" + RelativeTo(project.dir(), tags) + ")";
    return IsSiteFrame(TagMapFrame(tags)) ? "" : "the tag map is in its own frame, not in the site's";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return ReadTextFile(outcome.dir / ("report_" + unit.name + ".md")) +
           "Poses: " + (outcome.dir / "poses.csv").string() + "\n";
  };
  return info;
}

}  // namespace trigpoint
