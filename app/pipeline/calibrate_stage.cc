// calibrate: cameras from pictures of a board.
#include "app/pipeline/calibrate_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>

#include "app/pipeline/calibrate_hand_eye.h"
#include "calib/base/path_option.h"
#include "datasets/calibration/calibrate_files.h"
#include "datasets/calibration/calibration_images.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/calibration/target_file.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

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

cv::Mat LoadBoardPicture(const fs::path& file, bool mirrored, const SizeCheck& check = {}) {
  cv::Mat grey = LoadPicture(file, true, check);
  if (mirrored) cv::flip(grey, grey, 1);
  return grey;
}

std::string OtherSize(const std::pair<int, int>& most, const std::string& camera, int width, int height) {
  return fmt::format("expected a picture of {} x {} as the other pictures of {}, found {} x {}", most.first,
                     most.second, camera, width, height);
}

using Sizes = std::map<std::pair<int, int>, int>;  // how many pictures have it
std::pair<int, int> MostFrequent(const Sizes& sizes) {
  const auto most =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == sizes.end() ? std::pair(0, 0) : most->first;
}

// Of most of a camera's pictures, as their headers state it; 0 x 0: unknown.
std::pair<int, int> StatedSize(const CalibrationImages& camera) {
  Sizes sizes;
  for (const fs::path& file : camera.files) {
    try {
      const PhotoMetadata metadata = ReadPhotoMetadata(file);
      if (metadata.width > 0) ++sizes[{metadata.width, metadata.height}];
    } catch (const InputError&) {  // said where it is read
    }
  }
  return MostFrequent(sizes);
}

// Refuses a picture that is larger than most, whose pixels would take gigabytes; others are compared once they are
// read.
SizeCheck NotLarger(const fs::path& file, const std::pair<int, int>& most, const std::string& camera) {
  return [=](const cv::Size& stored) {
    if (most.first == 0 || int64_t{stored.width} * stored.height <= int64_t{most.first} * most.second) return;
    throw InputError(file.string() + ": " + OtherSize(most, camera, stored.width, stored.height));
  };
}

// Pictures of another size than most are left out and named.
void RequireOneSize(const std::vector<CalibrationImages>& cameras, std::vector<std::vector<BoardView>>* found) {
  for (size_t c = 0; c < cameras.size(); ++c) {
    Sizes sizes;
    for (const BoardView& view : (*found)[c]) {
      if (view.width > 0) ++sizes[{view.width, view.height}];
    }
    const std::pair<int, int> most = MostFrequent(sizes);
    for (BoardView& view : (*found)[c]) {
      if (view.width == 0 || std::pair(view.width, view.height) == most) continue;
      view.problem = OtherSize(most, cameras[c].camera, view.width, view.height);
      view.usable = false;
    }
  }
}

// No board in any picture: is there another one?
void ThrowNoBoard(const CalibrateStageOptions& options, const Target& target,
                  const std::vector<CalibrationImages>& cameras, const std::string& first_problem) {
  std::string text = "the " + target.Text() + " was found in none of the pictures; the first: " + first_problem;
  if (target.kind == TargetKind::kCheckerboard) {
    constexpr size_t kTried = 3;
    for (size_t i = 0; i < std::min(kTried, cameras.front().files.size()); ++i) {
      try {
        const fs::path& file = cameras.front().files[i];
        const auto [cols, rows] = OtherCheckerboardIn(LoadBoardPicture(file, options.mirrored), target);
        if (cols == 0) continue;
        text += fmt::format(
            "; {} shows a checkerboard of {} x {} inner corners: correct the target, whose numbers count the corners "
            "between squares, not the squares",
            file.filename().string(), cols, rows);
        break;
      } catch (const InputError&) {  // the picture is already reported as unusable
      }
    }
  }
  throw InputError(text);
}

// A target described with too few corners is found as part of the larger board. Throws InputError then.
void RequireWholeBoard(const CalibrateStageOptions& options, const Target& target,
                       const std::vector<fs::path>& pictures) {
  if (target.kind != TargetKind::kCheckerboard) return;
  constexpr size_t kTried = 5;
  std::map<std::pair<int, int>, int> larger;
  for (size_t k = 0; k < std::min(kTried, pictures.size()); ++k) {
    const fs::path& file = pictures[k * pictures.size() / std::min(kTried, pictures.size())];
    const auto [cols, rows] = OtherCheckerboardIn(LoadBoardPicture(file, options.mirrored), target);
    if (cols < target.cols || rows < target.rows || (cols == target.cols && rows == target.rows)) continue;
    if (++larger[{cols, rows}] < 2) continue;
    throw InputError(
        fmt::format("the pictures, {} for example, show a checkerboard of {} x {} inner corners, of which the {} is a "
                    "part: correct the target, whose numbers count the corners between squares, not the squares",
                    file.filename().string(), cols, rows, target.Text()));
  }
}

void Calibrate(const CalibrateStageOptions& options, const Target& target, std::vector<CalibrationImages> cameras,
               StageContext& context) {
  struct Picture {
    size_t camera, index;
  };
  std::vector<Picture> pictures;
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (size_t i = 0; i < cameras[c].files.size(); ++i) pictures.push_back({c, i});
  }
  const auto file = [&](const Picture& p) -> const fs::path& { return cameras[p.camera].files[p.index]; };
  std::vector<std::pair<int, int>> stated;
  for (const CalibrationImages& camera : cameras) stated.push_back(StatedSize(camera));
  const auto load = [&](int64_t i) {
    const Picture& p = pictures[static_cast<size_t>(i)];
    const SizeCheck check = NotLarger(file(p), stated[p.camera], cameras[p.camera].camera);
    return LoadBoardPicture(file(p), options.mirrored, check);
  };
  const std::vector<BoardView> all = DetectBoards(static_cast<int64_t>(pictures.size()), load, target, context.threads,
                                                  context.progress, context.cancel);
  std::vector<std::vector<BoardView>> found(cameras.size());
  for (size_t i = 0; i < pictures.size(); ++i) found[pictures[i].camera].push_back(all[i]);
  RequireOneSize(cameras, &found);

  CalibrationInput input;
  input.target = target;
  input.frames = PairFrames(&cameras);
  std::vector<LeftOutPicture> left_out;
  for (size_t c = 0; c < cameras.size(); ++c) {
    CalibrationInput::CameraSize size;
    size.name = cameras[c].camera;
    for (size_t i = 0; i < found[c].size(); ++i) {
      const BoardView& view = found[c][i];
      const std::string name = RelativeTo(context.project.dir(), cameras[c].files[i]);
      if (!view.usable) {
        left_out.push_back({size.name, name, view.problem});
        continue;
      }
      size.width = view.width;
      size.height = view.height;
      input.views.push_back({static_cast<int>(c), cameras[c].frame_of[i], name, view.points});
    }
    input.cameras.push_back(size);
  }
  for (size_t i = 0; i < left_out.size(); ++i) {
    context.progress.Log(LogLevel::kWarning, left_out[i].image + ": " + left_out[i].reason);
  }
  if (input.views.empty())
    ThrowNoBoard(options, target, cameras, left_out.front().image + ": " + left_out.front().reason);
  std::vector<fs::path> used;
  for (size_t i = 0; i < pictures.size(); ++i) {
    if (found[pictures[i].camera][pictures[i].index].usable) used.push_back(file(pictures[i]));
  }
  RequireWholeBoard(options, target, used);
  Calibration calibration = CalibrateCameras(input, options.calibration, context.progress, context.cancel);
  const Quality quality =
      JudgeCalibration(input, options.calibration, options.gates, context.progress, context.cancel, &calibration);
  for (const Finding& f : quality.findings) {
    context.progress.Log(f.level == FindingLevel::kNote ? LogLevel::kInfo : LogLevel::kWarning,
                         (f.camera.empty() ? "" : f.camera + ": ") + f.reason);
  }
  WriteCalibration(context.out, input, calibration, quality, left_out);
  const bool refused = quality.level == FindingLevel::kRefusal && !options.accept;
  WriteCameraFiles(context.out, AsCamchain(calibration),
                   {"trigpoint calibrate from " + target.Text(),
                    fmt::format("rms {:.3f} px; sigmas and their correlation: calibration.json",
                                calibration.cameras.front().rms_px)},
                   refused);
  context.metrics["refused"] = refused;
  context.metrics["pictures"] = pictures.size();
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
  json list = json::array();
  std::string text = cameras.format + " file " + file.string() + "\n";
  for (const BodyCamera& camera : cameras.cameras) {
    list.push_back({{"name", camera.name},
                    {"model", CameraModelName(camera.camera.model())},
                    {"width", camera.camera.width()},
                    {"height", camera.camera.height()},
                    {"params", camera.camera.params()}});
    text += fmt::format("{}: {}, {} x {}, mean focal length {:.3f} px\n", camera.name,
                        CameraModelName(camera.camera.model()), camera.camera.width(), camera.camera.height(),
                        camera.camera.MeanFocal());
  }
  text += "The uncertainty is unknown: a file of this kind doesn't hold it.\n";
  WriteFileAtomically(context.out / "calibration.json",
                      DumpJson({{"schema", 1}, {"kind", "import"}, {"cameras", list}, {"text", text}}, 2) + "\n");
  context.metrics["cameras"] = list;
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
