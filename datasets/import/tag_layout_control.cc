#include "datasets/import/tag_layout_control.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/tag_layout.h"
#include "datasets/io/text.h"

namespace trigpoint {

ImportReport ImportTagLayout(const std::filesystem::path& site, const std::filesystem::path& file, double size_m) {
  const std::filesystem::path control = site / "control_points.csv", sizes = site / "tags.yaml";
  for (const std::filesystem::path& out : {control, sizes}) {
    if (std::filesystem::exists(out)) throw InputError(out.string() + ": is there already; move it away first");
  }
  std::vector<LayoutTag> tags = ReadTagLayout(file);
  CsvWriter csv({"tag_id", "corner", "role", "x_m", "y_m", "z_m", "sigma_h_m", "sigma_v_m"},
                {"from " + file.filename().string() + "; sigmas are a guess: put in how well the tags were put up"});
  std::string yaml = "# From " + file.filename().string() + ".\nfamily: " + tags.front().family + "\n", lengths,
              families;
  std::set<std::string> kinds;
  for (LayoutTag& tag : tags) {
    if (tag.size_m == 0) tag.size_m = size_m;
    if (!(tag.size_m > 0)) {
      throw InputError(file.string() + ": the sizes of the tags are not stated; give them by --tag-size METRES");
    }
    constexpr double kLeastSize_m = 0.001, kLargestSize_m = 100, kFarthest_m = 1e5;  // of anything on one site
    if (tag.size_m < kLeastSize_m || tag.size_m > kLargestSize_m ||
        tag.world_from_tag.translation.cwiseAbs().maxCoeff() > kFarthest_m) {
      throw InputError(fmt::format(
          "{}: tag {}: expected an edge from {:g} to {:g} m (an fmap states mm) and coordinates "
          "up to {:g} m, found {:g} m at {:g}, {:g}, {:g} m",
          file.string(), tag.id, kLeastSize_m, kLargestSize_m, kFarthest_m, tag.size_m,
          tag.world_from_tag.translation.x(), tag.world_from_tag.translation.y(), tag.world_from_tag.translation.z()));
    }
    kinds.insert(tag.family);
    if (tag.family != tags.front().family) families += fmt::format("  {}: {}\n", tag.id, tag.family);
    lengths += fmt::format("  {}: {:.6g}\n", tag.id, tag.size_m);
    // Bottom-left, bottom-right, top-right, top-left; y counts down.
    const double h = 0.5 * tag.size_m, corners[4][2] = {{-h, h}, {h, h}, {h, -h}, {-h, -h}};
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector3d p = tag.world_from_tag * Eigen::Vector3d(corners[corner][0], corners[corner][1], 0);
      csv.Integer(tag.id).Integer(corner).Text("control");
      csv.Number(p.x(), 6).Number(p.y(), 6).Number(p.z(), 6).Number(0.01, 3).Number(0.01, 3).EndRow();
    }
  }
  csv.Save(control);
  if (!families.empty()) yaml += "families:\n" + families;
  WriteFileAtomically(sizes, yaml + "sizes_m:\n" + lengths);
  ImportReport report;
  report.files = {control, sizes};
  report.lines.push_back(
      fmt::format("{} of {}, their corners as control", Counted(tags.size(), "tag"), fmt::join(kinds, ", ")));
  return report;
}

}  // namespace trigpoint
