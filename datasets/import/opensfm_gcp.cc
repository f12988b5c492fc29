#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/import/made_files.h"
#include "datasets/import/phone_files.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/survey_tables.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// OpenSfM's image coordinates are from the middle, in units of the longer side.
class Sizes {
 public:
  explicit Sizes(const fs::path& images) : images_(images) {}
  Eigen::Vector2d Pixel(const PointMark& mark) {
    if (!mark.normalised) return mark.pixel;
    auto it = sizes_.find(mark.image);
    if (it == sizes_.end()) {
      const cv::Size shown = ReadPhotoMetadata(images_ / mark.image).ShownSize();
      it = sizes_.emplace(mark.image, Eigen::Vector2d(shown.width, shown.height)).first;
    }
    return mark.pixel * it->second.maxCoeff() + 0.5 * (it->second - Eigen::Vector2d::Ones());
  }

 private:
  fs::path images_;
  std::map<std::string, Eigen::Vector2d> sizes_;
};

}  // namespace

ImportReport ImportOpenSfmGcp(const fs::path& site, const fs::path& file, const fs::path& images) {
  const fs::path control = site / "control_points.csv", observations = site / "control_observations.csv";
  for (const fs::path& out : {control, observations}) {
    if (fs::exists(out)) throw InputError(out.string() + ": is there already; move it away first");
  }
  ImportReport report;
  const OpenSfmControl known =
      file.extension() == ".json" ? ReadOpenSfmJson(file, &report.warnings) : ReadOpenSfmList(file, &report.warnings);
  if (known.points.empty()) {
    throw InputError(file.string() + ": no point with a position" +
                     (report.warnings.empty() ? "" : "; the first problem: " + report.warnings.front()));
  }
  CsvWriter csv({"point", "role", "latitude_deg", "longitude_deg", "height_m", "sigma_h_m", "sigma_v_m"},
                {"from " + file.filename().string() +
                 "; heights as given; sigmas are a handheld receiver's: replace them by those of your survey"});
  CsvWriter marks({"point", "image", "u", "v"}, {"pixels: the centre of the first one is 0, 0"});
  for (const ControlPoint& point : known.points) {
    csv.Text(point.point).Text(point.control ? "control" : "check");
    csv.Number(point.geodetic->latitude_deg, 10).Number(point.geodetic->longitude_deg, 10);
    csv.Number(point.geodetic->height_m, 4).Number(point.sigma_h_m, 3).Number(point.sigma_v_m, 3).EndRow();
  }
  Sizes sizes(images);
  int marked = 0, without = 0;
  for (const PointMark& mark : known.marks) {
    if (std::none_of(known.points.begin(), known.points.end(),
                     [&](const ControlPoint& point) { return point.point == mark.point; })) {
      ++without;
      continue;
    }
    try {
      const Eigen::Vector2d pixel = sizes.Pixel(mark);
      marks.Text(mark.point).Text(mark.image).Number(pixel.x(), 3).Number(pixel.y(), 3).EndRow();
      ++marked;
    } catch (const InputError& e) {
      report.warnings.push_back(fmt::format("point {}: {}; its mark is left out", mark.point, e.what()));
    }
  }
  if (without > 0) report.warnings.push_back(Counted(without, "mark") + " of points without a position; left out");
  MadeFiles made;
  csv.Save(made.Making(control));
  marks.Save(made.Making(observations));
  made.Keep();
  report.files = {control, observations};
  report.lines.push_back(Counted(known.points.size(), "control point") + ", " + Counted(marked, "mark") + " in images");
  return report;
}

}  // namespace trigpoint
