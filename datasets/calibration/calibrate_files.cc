#include "datasets/calibration/calibrate_files.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>

#include "calib/base/grid.h"
#include "calib/target/plots.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/json_matrix.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

Eigen::MatrixXd Correlation(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

void WriteResiduals(const fs::path& file, const CalibrationInput& input, const Calibration& calibration) {
  CsvWriter residuals({"camera", "image", "point", "u", "v", "du_px", "dv_px", "used"},
                      {"trigpoint calibration residuals 1; predicted - observed"});
  for (const PointResidual& r : calibration.residuals) {
    const CalibrationView& view = input.views[static_cast<size_t>(r.view)];
    residuals.Text(input.cameras[static_cast<size_t>(view.camera)].name)
        .Text(view.image)
        .Integer(r.point)
        .Number(r.pixel.x(), 4)
        .Number(r.pixel.y(), 4)
        .Number(r.residual.x(), 4)
        .Number(r.residual.y(), 4)
        .Integer(r.used ? 1 : 0)
        .EndRow();
  }
  residuals.Save(file);
}

void WriteViews(const fs::path& file, const CalibrationInput& input, const Calibration& calibration,
                const std::vector<LeftOutPicture>& left_out) {
  CsvWriter views(
      {"camera", "image", "frame", "status", "reason", "points", "points_used", "rms_px", "tilt_deg", "distance_m"},
      {"trigpoint calibration views 1; rms: of the distances of the points used"});
  for (size_t v = 0; v < input.views.size(); ++v) {
    const CalibrationView& view = input.views[v];
    const ViewSummary& s = calibration.views[v];
    views.Text(input.cameras[static_cast<size_t>(view.camera)].name)
        .Text(view.image)
        .Text(input.frames[static_cast<size_t>(view.frame)])
        .Text(s.used ? "used" : "outlier")
        .Text(s.reason)
        .Integer(s.points)
        .Integer(s.points_used)
        .Number(s.rms_px, 4)
        .Number(s.tilt_rad / kDegToRad, 2)
        .Number(s.distance_m, 4)
        .EndRow();
  }
  for (const LeftOutPicture& picture : left_out) {
    views.Text(picture.camera).Text(picture.image).Empty().Text("no board").Text(picture.reason).Empty(5).EndRow();
  }
  views.Save(file);
}

}  // namespace

json CameraJson(const CalibratedCamera& camera) {
  json parameters = json::object(), sigmas = json::object();
  const Eigen::VectorXd sigma = camera.Sigmas();
  for (size_t i = 0; i < camera.parameters.size(); ++i) {
    parameters[camera.parameters[i]] = camera.camera.params()[i];
    sigmas[camera.parameters[i]] = sigma[static_cast<Eigen::Index>(i)];
  }
  json out = {{"name", camera.name},
              {"model", CameraModelName(camera.camera.model())},
              {"width", camera.camera.width()},
              {"height", camera.camera.height()},
              {"parameters", parameters},
              {"sigma", sigmas},
              {"rms_px", camera.rms_px},
              {"rms_all_px", camera.rms_all_px},
              {"sigma_px", camera.sigma_px},
              {"views", camera.views},
              {"views_used", camera.views_used},
              {"points", camera.points},
              {"points_used", camera.points_used}};
  const Eigen::Vector3d t = camera.cam_from_rig.translation;
  const Eigen::Quaterniond q = camera.cam_from_rig.rotation;
  const Vector6d rig_sigma = camera.cam_from_rig_covariance.diagonal().cwiseMax(0).cwiseSqrt();
  out["cam_from_rig"] = {
      {"translation_m", {t.x(), t.y(), t.z()}},
      {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}},
      {"sigma_rotation_deg", {rig_sigma[0] / kDegToRad, rig_sigma[1] / kDegToRad, rig_sigma[2] / kDegToRad}},
      {"sigma_translation_m", {rig_sigma[3], rig_sigma[4], rig_sigma[5]}}};
  return out;
}

std::vector<BodyCamera> AsCamchain(const Calibration& calibration) {
  std::vector<BodyCamera> cameras;
  for (const CalibratedCamera& camera : calibration.cameras) {
    BodyCamera body;
    body.name = camera.name;
    body.camera = camera.camera;
    body.cam_from_body = camera.cam_from_rig;
    cameras.push_back(body);
  }
  return cameras;
}

void WriteCameraFiles(const fs::path& out, const std::vector<BodyCamera>& cameras,
                      const std::vector<std::string>& comments, bool refused) {
  if (refused) {
    WriteCamchain(out / "camchain_refused.yaml", cameras, comments);
    return;
  }
  WriteCamchain(out / "camchain.yaml", cameras, comments);
  WriteColmapCameras(out / "cameras.txt", cameras, comments);
  for (const BodyCamera& camera : cameras) {
    WriteOpenCvCamera(out / ("opencv_" + camera.name + ".yaml"), camera, comments);
    WriteRosCameraInfo(out / ("camera_info_" + camera.name + ".yaml"), camera, comments);
  }
}

namespace {

void WritePicture(const fs::path& file, const cv::Mat& picture) {
  bool written = false;
  try {
    written = cv::imwrite(file.string(), picture);
  } catch (const cv::Exception&) {  // the same to a user: named below
  }
  if (!written) throw IoError(file.string() + ": cannot be written");
}

void WriteMaps(const fs::path& out, const CalibrationInput& input, const Calibration& calibration,
               const Quality& quality) {
  for (size_t c = 0; c < calibration.cameras.size(); ++c) {
    const CalibratedCamera& camera = calibration.cameras[c];
    const int width = camera.camera.width(), height = camera.camera.height();
    const ProjectionUncertainty& u = quality.uncertainty[c];
    CsvWriter uncertainty({"u", "v", "sigma_px", "covered"},
                          {"trigpoint projection uncertainty 1; camera=" + camera.name +
                           "; sigma=1; far points, after the best rotation; largest direction"});
    for (size_t i = 0; i < u.sigma_px.size(); ++i) {
      uncertainty.Number(u.grid.pixels[i].x(), 1)
          .Number(u.grid.pixels[i].y(), 1)
          .Number(u.sigma_px[i], 5)
          .Integer(u.covered[i] ? 1 : 0)
          .EndRow();
    }
    uncertainty.Save(out / ("uncertainty_" + camera.name + ".csv"));
    WritePicture(out / ("uncertainty_" + camera.name + ".png"),
                 DrawMap(u.grid, u.sigma_px, u.covered, width, height,
                         camera.name + ": uncertainty of a far point's pixel, 1 sigma", "px"));
    WritePicture(out / ("coverage_" + camera.name + ".png"),
                 DrawCoverage(input, calibration, quality.coverage[c], static_cast<int>(c)));
    WritePicture(out / ("residuals_" + camera.name + ".png"),
                 DrawResiduals(input, calibration, quality.pattern[c], static_cast<int>(c)));
    const Coverage& cells = quality.coverage[c];
    CsvWriter coverage({"u", "v", "points"},
                       {"trigpoint calibration coverage 1; camera=" + camera.name + "; middle of each cell"});
    for (int r = 0; r < cells.rows; ++r) {
      for (int col = 0; col < cells.cols; ++col) {
        coverage.Number((col + 0.5) * width / cells.cols - 0.5, 1)
            .Number((r + 0.5) * height / cells.rows - 0.5, 1)
            .Integer(cells.points[CellIndex(r, col, cells.cols)])
            .EndRow();
      }
    }
    coverage.Save(out / ("coverage_" + camera.name + ".csv"));
    if (!quality.halves.done) continue;
    const CameraDifference& d = quality.halves.difference[c];
    CsvWriter halves({"u", "v", "du_px", "dv_px", "covered"},
                     {"trigpoint calibration halves 1; camera=" + camera.name + "; second half less first half"});
    std::vector<double> size;
    for (size_t i = 0; i < d.shift_px.size(); ++i) {
      size.push_back(d.shift_px[i].norm());
      halves.Number(d.grid.pixels[i].x(), 1)
          .Number(d.grid.pixels[i].y(), 1)
          .Number(d.shift_px[i].x(), 5)
          .Number(d.shift_px[i].y(), 5)
          .Integer(d.covered[i] ? 1 : 0)
          .EndRow();
    }
    halves.Save(out / ("halves_" + camera.name + ".csv"));
    WritePicture(out / ("halves_" + camera.name + ".png"),
                 DrawMap(d.grid, size, d.covered, width, height,
                         camera.name + ": difference between two halves of the pictures", "px"));
  }
}

std::string QualityText(const Quality& quality) {
  std::string text = "# Is this calibration good enough?\n\n";
  text += quality.level == FindingLevel::kRefusal ? "No: it is refused. Correct every item that is marked as refusal.\n"
          : quality.level == FindingLevel::kWarning ? "Yes, with the warnings below.\n"
                                                    : "Yes.\n";
  for (const Finding& f : quality.findings) {
    text += fmt::format("\n- **{}**{} ({}): {}.", FindingLevelName(f.level), f.camera.empty() ? "" : " " + f.camera,
                        f.check, f.reason);
    if (!f.advice.empty()) text += " *Next:* " + f.advice + ".";
  }
  return text + "\n";
}

json QualityJson(const Calibration& calibration, const Quality& quality) {
  json findings = json::array(), cameras = json::array();
  for (const Finding& f : quality.findings) {
    findings.push_back({{"level", FindingLevelName(f.level)},
                        {"camera", f.camera},
                        {"check", f.check},
                        {"reason", f.reason},
                        {"advice", f.advice}});
  }
  for (size_t c = 0; c < calibration.cameras.size(); ++c) {
    json camera = {{"name", calibration.cameras[c].name},
                   {"coverage", quality.coverage[c].share},
                   {"poor_parts", quality.coverage[c].poor},
                   {"uncertainty_median_px", quality.uncertainty[c].median_covered_px},
                   {"uncertainty_max_covered_px", quality.uncertainty[c].max_covered_px},
                   {"uncertainty_max_px", quality.uncertainty[c].max_px},
                   {"no_ray_share", quality.uncertainty[c].no_ray_share},
                   {"systematic_px", quality.pattern[c].systematic_px}};
    if (quality.halves.done) {
      camera["halves_rms_px"] = quality.halves.difference[c].rms_covered_px;
      camera["halves_max_px"] = quality.halves.difference[c].max_covered_px;
      camera["halves_over_predicted"] = quality.halves.ratio[c];
      camera["rms_own_half_px"] = quality.halves.rms_own_px[c];
      camera["rms_other_half_px"] = quality.halves.rms_other_px[c];
    }
    cameras.push_back(camera);
  }
  json proportions = json::object();
  for (int i = 3; i < BoardShape::kSize; ++i) {
    if (quality.proportions.sigma[i] <= 0) continue;
    proportions[BoardShape::kNames[i]] = {{"value", quality.proportions.values[i]},
                                          {"sigma", quality.proportions.sigma[i]}};
  }
  return {{"status", quality.level == FindingLevel::kRefusal   ? "refused"
                     : quality.level == FindingLevel::kWarning ? "warned"
                                                               : "good"},
          {"findings", findings},
          {"cameras", cameras},
          {"board_systematic_px", quality.board_systematic_px},
          {"board_proportions", proportions}};
}

}  // namespace

void WriteCalibration(const fs::path& out, const CalibrationInput& input, const Calibration& calibration,
                      const Quality& quality, const std::vector<LeftOutPicture>& left_out) {
  WriteMaps(out, input, calibration, quality);
  WriteFileAtomically(out / "quality.md", QualityText(quality));
  json cameras = json::array();
  for (const CalibratedCamera& camera : calibration.cameras) cameras.push_back(CameraJson(camera));
  json board = json::object();
  for (int i = 0; i < BoardShape::kSize; ++i) {
    if (calibration.board.sigma[i] <= 0) continue;
    board[BoardShape::kNames[i]] = {{"value", calibration.board.values[i]}, {"sigma", calibration.board.sigma[i]}};
  }
  const json document = {{"schema", 1},
                         {"target", input.target.Text()},
                         {"rig", "the first camera; tangents: rotation (rad), translation (m)"},
                         {"cameras", cameras},
                         {"board_shape", board},
                         {"quality", QualityJson(calibration, quality)},
                         {"determined", calibration.determined},
                         {"iterations", calibration.iterations},
                         {"cost", calibration.cost_after},
                         {"sigma_factor", calibration.sigma_factor},
                         {"covariance_of", calibration.labels},
                         {"covariance", JsonRows(calibration.covariance)},
                         {"correlation", JsonRows(Correlation(calibration.covariance))}};
  WriteFileAtomically(out / "calibration.json", DumpJson(document, 2) + "\n");
  WriteResiduals(out / "residuals.csv", input, calibration);
  WriteViews(out / "views.csv", input, calibration, left_out);
}

json WriteImport(const fs::path& out, const fs::path& file, const CameraFile& cameras) {
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
  WriteFileAtomically(out / "calibration.json",
                      DumpJson({{"schema", 1}, {"kind", "import"}, {"cameras", list}, {"text", text}}, 2) + "\n");
  return list;
}

std::string CalibrationSummary(const StageOutcome& outcome) {
  const json document = json::parse(ReadTextFile(outcome.dir / "calibration.json"));
  std::string text = document.value("text", "");
  if (!text.empty()) return text + "Results: " + outcome.dir.string() + "\n";
  for (const json& camera : document.at("cameras")) {
    text += fmt::format("{}: {}, {} of {} pictures, rms {:.3f} px (one coordinate: sigma {:.3f} px)\n",
                        camera.at("name").get<std::string>(), camera.at("model").get<std::string>(),
                        camera.at("views_used").get<int>(), camera.at("views").get<int>(),
                        camera.at("rms_px").get<double>(), camera.at("sigma_px").get<double>());
    for (const auto& [name, value] : camera.at("parameters").items()) {
      text += fmt::format("  {:3} {:12.5f}  sigma {:.5f}\n", name, value.get<double>(),
                          camera.at("sigma").at(name).get<double>());
    }
  }
  for (const auto& [name, value] : document.at("board_shape").items()) {
    text += fmt::format("board {} {:.6f}  sigma {:.6f}\n", name, value.at("value").get<double>(),
                        value.at("sigma").get<double>());
  }
  const json& quality = document.at("quality");
  for (const json& camera : quality.at("cameras")) {
    text += fmt::format(
        "{}: the board covers {:.0f} % of the picture; a far point's pixel is known to {:.3f} px (median "
        "where it was seen, 1 sigma)",
        camera.at("name").get<std::string>(), 100 * camera.at("coverage").get<double>(),
        camera.at("uncertainty_median_px").get<double>());
    if (camera.contains("halves_rms_px")) {
      text += fmt::format("; two halves of the pictures differ by {:.3f} px", camera.at("halves_rms_px").get<double>());
    }
    text += "\n";
  }
  for (const json& f : quality.at("findings")) {
    const std::string camera = f.at("camera").get<std::string>(), advice = f.at("advice").get<std::string>();
    text += fmt::format("{}{} ({}): {}{}\n", f.at("level").get<std::string>(), camera.empty() ? "" : " " + camera,
                        f.at("check").get<std::string>(), f.at("reason").get<std::string>(),
                        advice.empty() ? "" : ". Next: " + advice);
  }
  const std::string status = quality.at("status").get<std::string>();
  text += status == "refused"  ? "This calibration is refused: runs cannot use it. Correct what is named above.\n"
          : status == "warned" ? "This calibration can be used, with the warnings above.\n"
                               : "This calibration can be used.\n";
  return text + "Results: " + outcome.dir.string() + "\n";
}

}  // namespace trigpoint
