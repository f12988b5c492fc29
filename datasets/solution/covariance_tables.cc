#include "datasets/solution/covariance_tables.h"

#include <set>

#include "datasets/io/csv.h"
#include "datasets/solution/solution_covariance.h"

namespace trigpoint {
namespace {

CsvWriter Table(const std::string& what, const std::string& name, const SolutionGeoreference& geo) {
  std::vector<std::string> columns = {what + "_a", what + "_b"};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) columns.push_back({'c', static_cast<char>('0' + i), static_cast<char>('0' + j)});
  }
  return CsvWriter(columns, {"trigpoint " + name + " 1; frame=enu; datum=" + geo.source +
                             "; rotation (rad) first, left tangent, row by row"});
}

void Put(CsvWriter& csv, const std::string& name, const Matrix6d& c) {
  csv.Text(name).Text(name);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) csv.Number(c(i, j), 15);
  }
  csv.EndRow();
}

}  // namespace

void WriteCovarianceTables(const Solution& s, const std::filesystem::path& dir) {
  if (!s.georeference || s.covariances.empty()) return;
  CsvWriter cameras = Table("image", "cameras_cov", *s.georeference);
  for (const SolutionImage& image : s.images) {
    const Rigid3d world_from_body =
        s.georeference->world_from_odom.TransformPose(s.problem.poses[static_cast<size_t>(image.pose)].Inverse());
    const Rigid3d body_from_cam = s.cameras[static_cast<size_t>(image.camera)].cam_from_body.Inverse();
    Put(cameras, image.name, MountedCovariance(world_from_body, WorldCovariance(s, image.pose), body_from_cam));
  }
  cameras.Save(dir / "cameras_cov.csv");
  CsvWriter panoramas = Table("panorama", "panoramas_cov", *s.georeference);
  std::set<std::string> put;
  for (const SolutionReference& reference : s.references) {
    if (reference.pose < 0 || reference.status != "localized" || !put.insert(reference.row).second) continue;
    Put(panoramas, reference.row, WorldCovariance(s, reference.pose));
  }
  panoramas.Save(dir / "panoramas_cov.csv");
}

}  // namespace trigpoint
