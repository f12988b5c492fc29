#include "datasets/io/rig_file.h"

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

using nlohmann::json;

// Of a photo of rig.json, its row of rig.csv has the focal length.
Camera ReadCamera(const json& photo, const json& document, const CsvRow& row) {
  const json& lens = document.at("lenses").at(photo.at("lens").get<size_t>());
  const int w = photo.at("width_px").get<int>(), h = photo.at("height_px").get<int>();
  const double f = row.Number("focal_px");
  // Rigs of before fisheyes have their principal points in the middle.
  const json principal = photo.value("principal_px", json{0.5 * (w - 1), 0.5 * (h - 1)});
  const bool fisheye = lens.at("model").get<std::string>() == CameraModelName(CameraModel::kKannalaBrandt);
  // Of the picture as shown; rigs of before had one for all photos of a lens.
  const json decentring = photo.value("decentring", json{lens.value("p1", 0.0), lens.value("p2", 0.0)});
  const double p1 = fisheye ? 0.0 : decentring.at(0).get<double>();
  const double p2 = fisheye ? 0.0 : decentring.at(1).get<double>();
  return Camera(fisheye ? CameraModel::kKannalaBrandt : CameraModel::kRadtan, w, h,
                {f, f, principal.at(0).get<double>(), principal.at(1).get<double>(), lens.at("k1").get<double>(),
                 lens.at("k2").get<double>(), p1, p2});
}

// [rotation, translation] of a photo of rig.json.
Matrix6d ReadCovariance(const json& photo) {
  const json& c = photo.at("covariance_rotation_rad_translation_m");
  Matrix6d covariance;
  for (size_t r = 0; r < 6; ++r) {
    for (size_t k = 0; k < 6; ++k) {
      covariance(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(k)) = c.at(r).at(k).get<double>();
    }
  }
  return covariance;
}

// Of the lower triangle, row by row; empty where it is not that of so many photos.
Eigen::MatrixXd ReadShapeCovariance(const json& shape, size_t photos) {
  const Eigen::Index n = 6 * static_cast<Eigen::Index>(photos);
  if (static_cast<Eigen::Index>(shape.size()) != n * (n + 1) / 2) return {};
  Eigen::MatrixXd covariance(n, n);
  size_t at = 0;
  for (Eigen::Index r = 0; r < n; ++r) {
    for (Eigen::Index k = 0; k <= r; ++k, ++at) {
      covariance(r, k) = covariance(k, r) = shape[at].is_number() ? shape[at].get<double>() : 0.0;
    }
  }
  return covariance;
}

}  // namespace

RigFile ReadRigFiles(const std::filesystem::path& dir) {
  RigFile file;
  const std::filesystem::path sidecar = dir / "rig.json";
  std::map<std::string, json> photos;
  json document;
  try {
    document = json::parse(ReadTextFile(sidecar));
    for (const json& p : document.at("photos")) photos[p.at("photo").get<std::string>()] = p;
    file.radius_m = document.at("circle").at("radius_m").get<double>();
    file.radius_log_sigma = document.at("circle").at("log_sigma").get<double>();
  } catch (const json::exception& e) {
    throw InputError(sidecar.string() + ": expected the sidecar of rig.csv, found something else (" + e.what() +
                     "); run `trigpoint stitch` again");
  }
  const CsvTable table =
      CsvTable::Read(dir / "rig.csv", {"photo", "tx", "ty", "tz", "qx", "qy", "qz", "qw", "focal_px"},
                     {"sigma_tx_m", "sigma_ty_m", "sigma_tz_m"});
  for (const CsvRow& row : table.rows()) {
    View view;
    view.name = row.Text("photo");
    const Eigen::Quaterniond q(row.Number("qw"), row.Number("qx"), row.Number("qy"), row.Number("qz"));
    if (std::abs(q.norm() - 1) > 1e-3)
      row.Fail("expected a unit quaternion, found one of length " + std::to_string(q.norm()));
    view.rig_from_view = {q, {row.Number("tx"), row.Number("ty"), row.Number("tz")}};
    const auto it = photos.find(view.name);
    if (it == photos.end()) row.Fail("photo '" + view.name + "' is not in rig.json beside it");
    try {
      view.camera = ReadCamera(it->second, document, row);
      view.covariance = ReadCovariance(it->second);
    } catch (const json::exception& e) {
      throw InputError(sidecar.string() + ": photo '" + view.name + "': " + e.what());
    }
    file.rig.views.push_back(std::move(view));
  }
  file.shape_covariance = ReadShapeCovariance(document.value("shape_covariance", json::array()), file.rig.views.size());
  if (file.rig.views.size() < 2) throw InputError((dir / "rig.csv").string() + ": expected at least two photos");
  return file;
}

}  // namespace trigpoint
