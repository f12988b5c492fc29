#include "survey/input/known_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;

std::optional<Eigen::Vector3d> WorldOf(const Project& project, const ControlPoint& point) {
  if (point.local_m) return point.local_m;
  if (point.geodetic && project.has_frame()) return project.frame().EnuFromGeodetic(*point.geodetic);
  return std::nullopt;
}

KnownPoints ReadKnownPoints(const Project& project, std::vector<std::string>* warnings) {
  KnownPoints known;
  known.points = project.site().control_points;
  const fs::path& dir = project.dir();
  if (fs::exists(dir / "control_observations.csv")) {
    known.marks = ReadControlObservations(dir / "control_observations.csv", warnings);
  }
  const auto add = [&](const OpenSfmControl& control) {
    known.points.insert(known.points.end(), control.points.begin(), control.points.end());
    known.marks.insert(known.marks.end(), control.marks.begin(), control.marks.end());
  };
  if (fs::exists(dir / "ground_control_points.json"))
    add(ReadOpenSfmJson(dir / "ground_control_points.json", warnings));
  if (fs::exists(dir / "gcp_list.txt")) add(ReadOpenSfmList(dir / "gcp_list.txt", warnings));
  return known;
}

size_t CameraNamed(const SurveyRun& run, const std::string& name) {
  for (size_t c = 0; c < run.cameras.size(); ++c) {
    if (run.cameras[c].name == name) return c;
  }
  return 0;
}

std::vector<SurveyMark> MarksOf(const Project& project, const std::string& point, const KnownPoints& known,
                                const SurveyInput& input, std::vector<std::string>* warnings) {
  std::vector<SurveyMark> marks;
  for (const PointMark& mark : known.marks) {
    if (mark.point != point) continue;
    int found = 0;
    const auto add = [&](size_t r, const BodyCamera& camera, int index, int64_t stamp_ns) {
      SurveyMark m;
      m.run = static_cast<int>(r);
      m.stamp_ns = stamp_ns;
      m.camera = index;
      m.sigma_px = mark.sigma_px;
      const double w = camera.camera.width(), h = camera.camera.height();
      m.pixel = mark.normalised ? Eigen::Vector2d(mark.pixel * std::max(w, h) + 0.5 * Eigen::Vector2d(w - 1, h - 1))
                                : mark.pixel;
      if (found++ == 0) marks.push_back(m);
    };
    for (size_t r = 0; r < input.runs.size(); ++r) {
      const SurveyRun& its = input.runs[r];
      if (its.stills) {
        for (const ImageDetections& photo : its.images) {
          if (!NamesPath(mark.image, photo.image)) continue;
          const size_t camera = CameraNamed(its, photo.camera);
          add(r, its.cameras[camera], static_cast<int>(camera), photo.stamp_ns);
        }
        continue;
      }
      const Run& run = project.run(its.name);
      for (const ImageEntry& image : run.images) {
        if (image.file != mark.image && !NamesPath(mark.image, image.path.string())) continue;
        const BodyCamera& camera = run.cameras[static_cast<size_t>(image.camera)];
        add(r, camera, image.camera, BodyStamp(image.stamp_ns, camera));
      }
    }
    if (found != 1) {
      warnings->push_back(fmt::format("point {}: image '{}' is {}", point, mark.image,
                                      found == 0 ? "no picture of the survey; its mark is left out"
                                                 : "in the survey more than once; the first is taken"));
    }
  }
  return marks;
}

std::set<std::string> StatedSystems(const Project& project, const std::vector<ControlPoint>& points) {
  std::set<std::string> systems;
  for (const ControlPoint& c : points) {
    if (c.local_m) systems.insert("local x, y, z");
  }
  const fs::path table = project.dir() / "control_points.csv", list = project.dir() / "gcp_list.txt";
  if (fs::exists(table)) {
    const CsvTable csv = CsvTable::Read(table, {}, {"crs", "easting_m", "latitude_deg"});
    for (const CsvRow& row : csv.rows()) {
      if (row.Has("easting_m") && row.Has("crs")) systems.insert(row.Text("crs"));
      if (row.Has("latitude_deg")) systems.insert("WGS 84 latitude, longitude");
    }
  }
  if (fs::exists(list)) {
    std::istringstream in(ReadTextFile(list));
    for (std::string line; std::getline(in, line);) {
      if (Trim(line).empty() || Trim(line).front() == '#') continue;
      systems.insert(std::string(Trim(line)));
      break;
    }
  }
  return systems;
}

}  // namespace trigpoint
