// calibrate: its results have names of their own, and its pictures lie anywhere.
#include "app/cli/calibrate_command.h"

#include <fmt/format.h>

#include "app/cli/stage_command.h"
#include "app/pipeline/calibrate_stage.h"
#include "datasets/calibration/calibration_images.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string dir, name = "cam", target, model, hand_eye, from;
  std::vector<std::string> images, settings;
};

// As it can be found again from any working directory.
std::string ProjectPath(const fs::path& dir, const fs::path& path) {
  return RelativeTo(fs::absolute(dir).lexically_normal(), fs::absolute(path).lexically_normal());
}

// What is found in the working directory is meant, else what is below the project.
std::string ProjectPattern(const fs::path& dir, const std::string& argument) {
  const size_t equals = argument.find('=');
  const bool named = equals != std::string::npos && equals > 0 && argument.find('/') > equals;
  const std::string name = named ? argument.substr(0, equals + 1) : "", pattern = argument.substr(name.size());
  if (pattern.empty() || pattern.front() == '~') return argument;
  try {
    FindCalibrationImages(pattern, fs::current_path());
  } catch (const InputError&) {  // said when it isn't below the project either
    return argument;
  }
  return name + ProjectPath(dir, pattern);
}

StageTarget TargetOf(const Project& project, const Arguments& arguments) {
  std::vector<std::string> settings = arguments.settings;
  if (!arguments.model.empty()) settings.push_back("model=" + DumpJson(arguments.model));
  if (!arguments.hand_eye.empty()) settings.push_back("hand_eye=" + DumpJson(arguments.hand_eye));
  if (!arguments.from.empty()) {
    const bool here = fs::exists(arguments.from);
    settings.push_back("from=" + DumpJson(here ? ProjectPath(project.dir(), arguments.from) : arguments.from));
  }
  StageTarget target;
  target.run = arguments.name;
  target.overrides = ParseOverrides(settings, "calibrate");
  std::string images;
  for (const std::string& pattern : arguments.images) {
    images += (images.empty() ? "" : ";") + ProjectPattern(project.dir(), pattern);
  }
  if (!images.empty()) target.overrides["calibrate"]["images"] = images;
  if (!arguments.target.empty()) {
    const bool here = fs::is_regular_file(arguments.target);
    target.overrides["calibrate"]["target"] = here ? ProjectPath(project.dir(), arguments.target) : arguments.target;
  }
  return target;
}

Ending CalibrationEnding(const StageOutcome& outcome, const std::string& name, const std::string& taken) {
  const bool refused = outcome.manifest.at("metrics").value("refused", false);
  Ending ending("Calibration " + name +
                (refused            ? " is refused"
                 : outcome.computed ? " done in " + taken
                                    : " is up to date"));
  const nlohmann::json document = nlohmann::json::parse(ReadTextFile(outcome.dir / "calibration.json"));
  const std::string text = document.value("text", "");  // of a hand-eye calibration or an import
  ending.Rows(text);
  if (text.empty()) {
    for (const nlohmann::json& camera : document.at("cameras")) {
      ending.Fact(camera.at("name").get<std::string>(),
                  fmt::format("{}, {} of {} pictures, rms {:.3f} px", camera.at("model").get<std::string>(),
                              camera.at("views_used").get<int>(), camera.at("views").get<int>(),
                              camera.at("rms_px").get<double>()));
    }
    for (const nlohmann::json& camera : document.at("quality").at("cameras")) {
      ending.Fact(
          camera.at("name").get<std::string>(),
          fmt::format("the board covers {:.0f} % of the picture; a far point's pixel is known to {:.3f} px "
                      "(median, 1 sigma)",
                      100 * camera.at("coverage").get<double>(), camera.at("uncertainty_median_px").get<double>()));
    }
    for (const nlohmann::json& f : document.at("quality").at("findings")) {
      const std::string advice = f.at("advice").get<std::string>();
      ending.Problem(Capitalised(f.at("level").get<std::string>()), f.at("check").get<std::string>() + ": " +
                                                                        f.at("reason").get<std::string>() +
                                                                        (advice.empty() ? "" : ". Next: " + advice));
    }
  }
  ending.Look("Files", outcome.dir);
  return refused ? ending : ending.Next("camera: " + name + " in the run.yaml of the runs that this camera took");
}

int Calibrate(Session& session, const Arguments& arguments) {
  CheckVariantName(arguments.name);
  MakeBareProject(arguments.dir, "calibrate");
  const Project project = OpenProjectToCompute(session, arguments.dir);
  const StageInfo& stage = StageNamed("calibrate");
  StageRequest request = stage.make(project, TargetOf(project, arguments));
  request.stage = stage.name;
  request.name = arguments.name;
  const StageOutcome outcome = RunStageShown(session, project, request, "calibrate/" + arguments.name);
  const nlohmann::json& metrics = outcome.manifest.at("metrics");
  const bool refused = metrics.value("refused", false);
  session.PrintDetails(stage.summary(outcome, DisplayUnitNamed(session.options.units)));
  session.End(CalibrationEnding(outcome, arguments.name, session.Taken()));
  session.PrintJson({{"command", "calibrate"},
                     {"project", project.dir().string()},
                     {"ok", !refused},
                     {"name", arguments.name},
                     {"status", outcome.computed ? "computed" : "up to date"},
                     {"dir", outcome.dir.string()},
                     {"metrics", metrics},
                     {"warnings", outcome.manifest.value("warnings", nlohmann::json::array())}});
  return refused ? kGateExitCode : 0;
}

}  // namespace

void MakeBareProject(const fs::path& dir, const std::string& command) {
  if (!fs::is_directory(dir) || fs::exists(dir / "trigpoint.yaml")) return;
  try {
    Project::Open(dir);
  } catch (const InputError&) {
    const fs::path whole = fs::absolute(dir / "x").lexically_normal().parent_path();
    WriteFileAtomically(dir / "trigpoint.yaml", "# Made by trigpoint " + command +
                                                    "; `trigpoint init` completes it when there are runs.\nschema: 1\n"
                                                    "name: " +
                                                    DumpJson(whole.filename().string()) + "\n");
  }
}

void AddCalibrateCommand(CLI::App& app, Session& session) {
  const StageInfo& stage = StageNamed("calibrate");
  CLI::App& command = AddCommand(
      app, session, "calibrate", stage.help,
      OptionTable(stage) +
          "The target: a Kalibr target YAML (checkerboard, aprilgrid, circlegrid; also charuco), or one line in "
          "metres:\n"
          "  checkerboard:9x6:0.025                 inner corners, square\n"
          "  charuco:8x8:0.0254:0.019:DICT_4X4_50   squares, square, marker, dictionary\n"
          "  aprilgrid:6x6:0.088:0.3                tags, tag, gap / tag\n"
          "  asymmetric_circles:4x11:0.02           columns x rows, spacing (circles: a square grid)\n"
          "Several cameras that photograph the board together are a rig: give --images for each. Pictures of one "
          "moment\n"
          "have the same name, or the same last number in it.\n"
          "A run uses the result by `camera: NAME` in its run.yaml.\n\n"
          "Examples:\n"
          "  trigpoint calibrate my_site --images 'board/*.jpg' --target checkerboard:9x6:0.025 --name phone\n"
          "  trigpoint calibrate my_site --images 'cam0=left/*.png' --images 'cam1=right/*.png' --target april.yaml "
          "\\\n"
          "      --model kannala_brandt --name rig\n"
          "  trigpoint calibrate my_site --hand-eye run1 --name mounted\n"
          "  trigpoint calibrate my_site --from camera_info.yaml --name factory\n"
          "  trigpoint calibrate my_site --name phone --set model=rational   # the same pictures again\n");
  const auto arguments = std::make_shared<Arguments>();
  command
      .add_option("DIR", arguments->dir, "the project, or any folder: the result goes to DIR/results/calibrate/NAME")
      ->required();
  command.add_option("--images", arguments->images, "pictures of the board: a pattern in quotes; once for each camera")
      ->allow_extra_args(false);
  command.add_option("--target", arguments->target, "the board: a file, or one line (see below)");
  command.add_option("--name", arguments->name, "the calibration's name")->capture_default_str();
  command.add_option("--model", arguments->model, "pinhole, radtan, radtan5, rational, kannala_brandt");
  command.add_option(
      "--hand-eye", arguments->hand_eye,
      "instead of pictures of a board: how the cameras of this run sit on its body, from its odometry and "
      "the tags it saw (after `trigpoint detect`)");
  command.add_option("--from", arguments->from,
                     "instead: import a Kalibr camchain, OpenCV YAML or XML, ROS camera_info, COLMAP cameras.txt or "
                     ".bin, Agisoft XML or JSON");
  AddSetOption(command, &arguments->settings);
  command.callback(
      [&session, arguments] { session.action = [arguments](Session& s) { return Calibrate(s, *arguments); }; });
}

}  // namespace trigpoint
