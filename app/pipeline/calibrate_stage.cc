// calibrate: cameras from pictures of a board.
#include "app/pipeline/calibrate_stage.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/pipeline/calibrate_hand_eye.h"
#include "calib/base/error.h"
#include "calib/base/path_option.h"
#include "datasets/calibration/board_pictures.h"
#include "datasets/calibration/calibrate_files.h"
#include "datasets/calibration/calibration_images.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/calibration/target_file.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct CalibrateStageOptions {
  std::string images;
  std::string target;
  std::string hand_eye;
  std::string from;
  std::string from_camera;
  int from_width = 0, from_height = 0;
  bool mirrored = false;
  bool accept = false;
  CalibrateOptions calibration;
  CalibrationGates gates;
  HandEyeOptions hand_eye_options;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.images,
          PathOption({"images", "", 0, 0, "the pictures: a file pattern, or camera=pattern for each camera, by ';'"},
                     PathKind::kPattern));
    visit(self.target, PathOption({"target", "", 0, 0, "the board: a Kalibr target YAML, or as checkerboard:9x6:0.025"},
                                  PathKind::kFile));
    visit(self.hand_eye,
          {"hand_eye", "", 0, 0,
           "instead of pictures of a board: a run whose odometry and tags give the poses of its cameras on the body"});
    visit(
        self.from,
        PathOption({"from", "", 0, 0,
                    "instead of pictures of a board: a file to import (Kalibr, OpenCV, ROS camera_info, COLMAP, JSON)"},
                   PathKind::kFile));
    visit(self.from_camera, {"from_camera", "", 0, 0, "only this camera of the file"});
    visit(self.from_width, {"from_width", "px", 0, 1e6, "size of the pictures, where the file lacks it"});
    visit(self.from_height, {"from_height", "px", 0, 1e6, "size of the pictures, where the file lacks it"});
    visit(self.mirrored, {"mirrored", "", 0, 1, "the pictures are flipped left-right, as run.yaml's mirrored"});
    visit(self.accept, {"accept", "", 0, 1, "let runs use the result even if a gate refuses it"});
    CalibrateOptions::Visit(self.calibration, visit);
    visit(self.gates, {"gates", "", 0, 0, "limits beyond which a calibration gets a warning or is refused"});
    visit(self.hand_eye_options, {"hand_eye_options", "", 0, 0, "options of hand-eye calibration"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = calibration.Check();
    for (const std::string& problem : gates.Check()) problems.push_back("gates: " + problem);
    for (const std::string& problem : hand_eye_options.Check()) problems.push_back("hand_eye_options: " + problem);
    if (images.empty() + hand_eye.empty() + from.empty() < 2) {
      problems.push_back("options images, hand_eye and from: expected one of them");
    }
    return problems;
  }
};

// Options of the command line and trigpoint.yaml, over those the result was made with before.
CalibrateStageOptions OptionsFor(const Project& project, const StageTarget& target) {
  CalibrateStageOptions options = ResolveOptions<CalibrateStageOptions>(project, "calibrate", target);
  if (options.images.empty() && options.hand_eye.empty() && options.from.empty()) {
    const auto manifest = ReadManifest(project, "calibrate", target.run);
    if (!manifest) {
      throw OptionError("calibration '" + target.run +
                        "': expected --images and --target, --hand-eye or --from; there is no earlier result "
                        "whose pictures could be used again");
    }
    StageTarget again = target;
    json values = manifest->value("options", json::object());
    if (const auto it = target.overrides.find("calibrate"); it != target.overrides.end()) values.update(*it);
    again.overrides["calibrate"] = values;
    options = ResolveOptions<CalibrateStageOptions>(project, "calibrate", again);
  }
  if (!options.images.empty() && options.target.empty()) {
    throw OptionError("calibration '" + target.run +
                      "': expected --target, a Kalibr target YAML or a board as checkerboard:9x6:0.025");
  }
  return options;
}

void Calibrate(const CalibrateStageOptions& options, const Target& target,
               const std::vector<CalibrationImages>& cameras, StageContext& context) {
  const FoundBoards boards = FindBoards(target, cameras, options.mirrored, context.project.dir(), context.threads,
                                        context.progress, context.cancel);
  const CalibrationInput& input = boards.input;
  Calibration calibration = CalibrateCameras(input, options.calibration, context.progress, context.cancel);
  const Quality quality =
      JudgeCalibration(input, options.calibration, options.gates, context.progress, context.cancel, &calibration);
  for (const Finding& f : quality.findings) {
    context.progress.Log(f.level == FindingLevel::kNote ? LogLevel::kInfo : LogLevel::kWarning,
                         (f.camera.empty() ? "" : f.camera + ": ") + f.reason);
  }
  WriteCalibration(context.out, input, calibration, quality, boards.left_out);
  const bool refused = quality.level == FindingLevel::kRefusal && !options.accept;
  WriteCameraFiles(context.out, AsCamchain(calibration),
                   {"trigpoint calibrate from " + target.Text(),
                    fmt::format("rms {:.3f} px; sigmas and their correlation: calibration.json",
                                calibration.cameras.front().rms_px)},
                   refused);
  context.metrics["refused"] = refused;
  context.metrics["pictures"] = boards.pictures;
  context.metrics["views"] = input.views.size();
  context.metrics["rms_px"] = calibration.cameras.front().rms_px;
  context.metrics["cameras"] = json::array();
  for (const CalibratedCamera& camera : calibration.cameras) context.metrics["cameras"].push_back(CameraJson(camera));
}

fs::path BelowProject(const Project& project, const std::string& path) {
  return fs::path(path).is_absolute() ? fs::path(path) : project.dir() / path;
}

void Import(const CalibrateStageOptions& options, StageContext& context) {
  const fs::path file = BelowProject(context.project, options.from);
  CameraFile cameras = ReadCameraFile(file, options.from_width, options.from_height);
  std::vector<std::string> names;
  for (const BodyCamera& camera : cameras.cameras) names.push_back(camera.name);
  if (!options.from_camera.empty()) {
    std::erase_if(cameras.cameras, [&](const BodyCamera& camera) { return camera.name != options.from_camera; });
    if (cameras.cameras.empty()) {
      throw InputError(file.string() + ": there is no camera '" + options.from_camera + "'; nearest: '" +
                       NearestName(options.from_camera, names) + "'");
    }
  } else if (!cameras.related) {
    throw InputError(file.string() + ": " + std::to_string(names.size()) +
                     " cameras without their poses to each other; import one by --set from_camera=" + names.front());
  }
  WriteCameraFiles(context.out, cameras.cameras,
                   {"imported by trigpoint from " + file.filename().string() + " (" + cameras.format + ")"}, false);
  context.metrics["cameras"] = WriteImport(context.out, file, cameras);
  context.metrics["refused"] = false;
}

}  // namespace

StageInfo CalibrateStage() {
  StageInfo info;
  info.name = "calibrate";
  info.help = "calibrate cameras from pictures of a board";
  info.metric = "rms_px";
  info.per_run = true;  // a calibration's name stands in place of a run's
  UseOptions<CalibrateStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const CalibrateStageOptions options = OptionsFor(project, target);
    StageRequest request;
    request.version = 3;
    request.options = JsonFromOptions(options);
    if (!options.hand_eye.empty()) {
      request.inputs = HandEyeInputs(project, options.hand_eye);
      request.body = [options](StageContext& context) {
        CalibrateHandEyeOfRun(options.hand_eye, options.hand_eye_options, context);
      };
      return request;
    }
    if (!options.from.empty()) {
      request.inputs = {BelowProject(project, options.from)};
      request.body = [options](StageContext& context) { Import(options, context); };
      return request;
    }
    const Target board = ReadTarget(options.target, project.dir());
    const std::vector<CalibrationImages> cameras = FindCalibrationImages(options.images, project.dir());
    if (const fs::path file = TargetFileOf(options.target, project.dir()); !file.empty())
      request.inputs.push_back(file);
    for (const CalibrationImages& camera : cameras)
      request.inputs.insert(request.inputs.end(), camera.files.begin(), camera.files.end());
    request.body = [options, board, cameras](StageContext& context) { Calibrate(options, board, cameras, context); };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit&) { return CalibrationSummary(outcome); };
  return info;
}

}  // namespace trigpoint
