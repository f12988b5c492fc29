#include "app/desktop/calibration_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/base/grid.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr int kColumns = 8, kRows = 6;
constexpr int kFewPoints = 12;  // in a cell of the grid

void ReadCameras(const fs::path& file, CalibrationSheet& view) {
  const json document = json::parse(ReadTextFile(file), nullptr, false);
  if (!document.is_object() || !document.contains("cameras")) {
    throw InputError(file.string() + ": expected the cameras of a calibration");
  }
  for (const json& c : document.at("cameras")) {
    CalibrationCamera camera;
    camera.name = c.value("name", "");
    camera.model = c.value("model", "");
    camera.width = c.value("width", 0), camera.height = c.value("height", 0);
    camera.rms_px = c.value("rms_px", 0.0);
    camera.views = c.value("views", 0), camera.views_used = c.value("views_used", 0);
    const json none = json::object();
    const json sigmas = c.value("sigma", none);
    const json parameters = c.value("parameters", none);
    for (const auto& [name, value] : parameters.items()) {
      camera.parameters.push_back({name, value.is_number() ? value.get<double>() : 0, sigmas.value(name, 0.0)});
    }
    camera.uncertainty = file.parent_path() / ("uncertainty_" + camera.name + ".png");
    view.cameras.push_back(std::move(camera));
  }
  // What the calibration found to be poor, and its advice.
  const json findings = document.value("quality", json::object()).value("findings", json::array());
  for (const json& finding : findings) {
    std::string sentence = finding.value("level", "") + ": " + finding.value("reason", "");
    if (const std::string advice = finding.value("advice", ""); !advice.empty()) sentence += "; " + advice;
    for (CalibrationCamera& camera : view.cameras) {
      const std::string of = finding.value("camera", "");
      if (of.empty() || of == camera.name) camera.next.push_back(sentence);
    }
  }
}

void ReadPoints(const fs::path& file, CalibrationSheet& view) {
  const CsvTable table = CsvTable::Read(file, {"camera", "u", "v", "du_px", "dv_px"}, {"used"});
  for (const CsvRow& row : table.rows()) {
    for (CalibrationCamera& camera : view.cameras) {
      if (camera.name != row.Text("camera")) continue;
      const std::string& used = row.Text("used");
      camera.points.push_back({row.Number("u"), row.Number("v"), row.Number("du_px"), row.Number("dv_px"),
                               used != "0" && used != "false" && used != "no"});
    }
  }
}

void Cover(CalibrationCamera& camera) {
  if (camera.width <= 0 || camera.height <= 0) return;
  camera.columns = kColumns, camera.rows = kRows;
  camera.coverage.assign(kColumns * kRows, 0);
  camera.residual_px.assign(kColumns * kRows, 0);
  for (const CalibrationPoint& p : camera.points) {
    if (!p.used) continue;
    const int column = std::clamp(static_cast<int>((p.u + 0.5) * kColumns / camera.width), 0, kColumns - 1);
    const int row = std::clamp(static_cast<int>((p.v + 0.5) * kRows / camera.height), 0, kRows - 1);
    const size_t cell = CellIndex(row, column, kColumns);
    ++camera.coverage[cell];
    camera.residual_px[cell] += std::hypot(p.du, p.dv);
  }
  // Nine parts of the image in words; the emptiest are worth the next pictures.
  const char* kVertical[] = {"top", "middle", "bottom"};
  const char* kHorizontal[] = {"left", "centre", "right"};
  for (int v = 0; v < 3; ++v) {
    for (int h = 0; h < 3; ++h) {
      int cells = 0, empty = 0;
      for (int row = v * kRows / 3; row < (v + 1) * kRows / 3; ++row) {
        for (int column = h * kColumns / 3; column < (h + 1) * kColumns / 3; ++column) {
          ++cells;
          empty += camera.coverage[CellIndex(row, column, kColumns)] < kFewPoints ? 1 : 0;
        }
      }
      if (2 * empty < cells) continue;
      camera.next.push_back(
          fmt::format("hold the board to the {} {} of the picture: {} of {} cells there have fewer "
                      "than {} points",
                      kVertical[v], kHorizontal[h], empty, cells, kFewPoints));
    }
  }
  for (size_t cell = 0; cell < camera.coverage.size(); ++cell) {
    if (camera.coverage[cell] > 0) camera.residual_px[cell] /= camera.coverage[cell];
  }
}

}  // namespace

CalibrationSheet LoadCalibration(const fs::path& dir) {
  CalibrationSheet view;
  const auto attempt = [&](const char* file, const auto& read) {
    if (!fs::exists(dir / file)) return;
    try {
      read(dir / file, view);
    } catch (const Error& e) {
      view.problems.emplace_back(e.what());
    } catch (const json::exception& e) {
      view.problems.push_back((dir / file).string() + ": " + e.what());
    }
  };
  attempt("calibration.json", ReadCameras);
  attempt("residuals.csv", ReadPoints);
  for (CalibrationCamera& camera : view.cameras) Cover(camera);
  return view;
}

std::vector<std::string> CalibrationNames(const fs::path& results) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (fs::directory_iterator it(results / "calibrate", ignored), end; it != end; it.increment(ignored)) {
    const std::string name = it->path().filename().string();
    if (!name.starts_with('.') && it->is_directory(ignored)) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace trigpoint
