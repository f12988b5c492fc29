#include "app/pipeline/calibrate_hand_eye.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>

#include "app/pipeline/stages.h"
#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/calibration/calibrate_files.h"
#include "datasets/calibration/hand_eye_files.h"
#include "datasets/io/camchain.h"
#include "datasets/io/json_matrix.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/evidence/rolling_tags.h"
#include "survey/tags/hand_eye_sights.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

fs::path DetectionsOf(const Project& project, const Run& run) {
  if (!run.detections.empty()) return run.detections;
  const fs::path file = project.ResultDir("detect", run.name) / "detections.csv";
  if (!fs::exists(file)) {
    throw InputError("run " + run.name + ": its tags are not detected yet; run `trigpoint detect` with --run " +
                     run.name + " first");
  }
  return file;
}

std::vector<HandEyeSight> Sights(const Project& project, const Run& run, const BodyCamera& camera,
                                 ProgressSink& progress) {
  const TagSizes& sizes = project.site().tags;
  std::vector<std::string> warnings;
  int without_odometry = 0;
  std::vector<ImageDetections> images = ReadDetections(DetectionsOf(project, run), 0.5, &warnings);
  MoveToImageTimes(run, sizes, &images);
  std::vector<HandEyeSight> sights = HandEyeSights(run, camera, sizes, images, &without_odometry);
  for (const std::string& warning : warnings) progress.Log(LogLevel::kWarning, warning);
  if (without_odometry > 0) {
    progress.Log(LogLevel::kWarning, Counted(without_odometry, "picture") + " with tags: no odometry at that time");
  }
  return sights;
}

}  // namespace

std::vector<fs::path> HandEyeInputs(const Project& project, const std::string& name) {
  const Run& run = project.run(name);
  std::vector<fs::path> inputs = {DetectionsOf(project, run)};
  for (const char* file : {"camchain.yaml", "run.yaml", "odometry.tum", "odometry.txt", "odometry.csv"}) {
    if (fs::exists(run.dir / file)) inputs.push_back(run.dir / file);
  }
  if (fs::exists(project.dir() / "tags.yaml")) inputs.push_back(project.dir() / "tags.yaml");
  if (!run.config.camera.empty())
    inputs.push_back(project.results() / "calibrate" / run.config.camera / "camchain.yaml");
  return inputs;
}

void CalibrateHandEyeOfRun(const std::string& name, const HandEyeOptions& options, StageContext& context) {
  const Run& run = context.project.run(name);
  if (run.odometry.poses.empty()) {
    throw InputError("run " + name + ": no odometry; hand-eye calibration needs odometry.tum of the body");
  }
  std::vector<CameraOnBody> cameras;
  for (const BodyCamera& camera : run.cameras) {
    CameraOnBody& c = cameras.emplace_back();
    c.camera = camera;
    c.found = CalibrateHandEye(Sights(context.project, run, camera, context.progress), camera.camera,
                               camera.cam_from_body, options, context.progress, context.cancel);
    c.unseen = UnseenOf(c.found, options.prior_m);
    if (!c.unseen.empty()) context.progress.Log(LogLevel::kWarning, camera.name + ": " + c.unseen);
    context.metrics["rms_px"] = c.found.rms_px;
  }
  WriteHandEye(context.out, name, cameras);
  context.metrics["refused"] = false;
}

}  // namespace trigpoint
