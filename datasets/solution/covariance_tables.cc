#include "datasets/solution/covariance_tables.h"

#include "datasets/solution/reference_rows.h"
#include "datasets/solution/solution_covariance.h"

namespace trigpoint {
namespace {

CsvWriter Table(const std::string& what, const std::string& name, const SolutionGeoreference& geo) {
  return CsvWriter(WithCovarianceColumns({what + "_a", what + "_b"}),
                   {"trigpoint " + name + " 1; frame=enu; datum=" + geo.source +
                    "; rotation (rad) first, left tangent, row by row"});
}

void Put(CsvWriter& csv, const std::string& name, const Matrix6d& c) {
  csv.Text(name).Text(name);
  PutCovariance(c, &csv);
  csv.EndRow();
}

}  // namespace

std::vector<std::string> WithCovarianceColumns(std::vector<std::string> columns) {
  for (char i = '0'; i < '6'; ++i) {
    for (char j = '0'; j < '6'; ++j) columns.push_back({'c', i, j});
  }
  return columns;
}

void PutCovariance(const Matrix6d& covariance, CsvWriter* csv) {
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) csv->Number(covariance(i, j), 15);
  }
}

void WriteCameraCovariances(const Solution& s, const std::filesystem::path& dir) {
  if (!s.georeference || s.covariances.empty()) return;
  CsvWriter cameras = Table("image", "cameras_cov", *s.georeference);
  for (const SolutionImage& image : s.images) {
    const bool further_view = s.cameras[static_cast<size_t>(image.camera)].IsFurtherView();
    if (!further_view) Put(cameras, image.name, ImageWorldCovariance(s, image));
  }
  cameras.Save(dir / "cameras_cov.csv");
}

void WritePanoramaCovariances(const Solution& s, const std::filesystem::path& dir) {
  if (!s.georeference || s.covariances.empty()) return;
  CsvWriter panoramas = Table("panorama", "panoramas_cov", *s.georeference);
  for (const ReferenceRow& row : ReferenceRows(s)) {
    if (!row.localized.empty()) Put(panoramas, row.name, WorldCovariance(s, row));
  }
  panoramas.Save(dir / "panoramas_cov.csv");
}

}  // namespace trigpoint
