#include "datasets/solution/reference_rows.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "datasets/solution/solution_covariance.h"

namespace trigpoint {
namespace {

// Photos that look the same way are off the middle the same way; others partly balance.
double CentreSigma(const Solution& s, const ReferenceRow& row) {
  if (row.references.size() < 2) return 0;
  const auto n = static_cast<double>(row.localized.size());
  Eigen::Vector3d looking = Eigen::Vector3d::Zero();
  double scatter = 0;
  for (const size_t i : row.localized) {
    const Rigid3d odom_from_rig = OdomFromRig(s, s.references[i].pose);
    looking += odom_from_rig.rotation * Eigen::Vector3d::UnitZ() / n;
    scatter += (odom_from_rig.translation - row.odom_from_pano.translation).squaredNorm();
  }
  const double of_photos = n > 1 ? scatter / (3 * (n - 1)) / n : 0;
  return std::sqrt(kHeld_m * kHeld_m * std::min(1.0, looking.squaredNorm() + 1 / n) + of_photos);
}

Matrix6d CovarianceOf(const Solution& s, const ReferenceRow& row, double scale,
                      const std::function<Matrix6d(const Solution&, int)>& of_pose) {
  Matrix6d covariance = Matrix6d::Zero();
  for (const size_t i : row.localized) {
    covariance += of_pose(s, s.references[i].pose) / static_cast<double>(row.localized.size());
  }
  covariance.diagonal().tail<3>().array() += std::pow(scale * row.centre_sigma_m, 2);
  return covariance;
}

}  // namespace

std::vector<ReferenceRow> ReferenceRows(const Solution& s) {
  std::vector<ReferenceRow> rows;
  std::map<std::string, size_t> at;
  for (size_t i = 0; i < s.references.size(); ++i) {
    const SolutionReference& r = s.references[i];
    const auto [found, fresh] = at.try_emplace(r.row, rows.size());
    if (fresh) rows.push_back({r.row, {}, {}, i});
    ReferenceRow& row = rows[found->second];
    row.references.push_back(i);
    if (r.status != "localized" || r.pose < 0) continue;
    if (row.localized.empty()) row.shown = i;
    row.localized.push_back(i);
  }
  for (ReferenceRow& row : rows) {
    if (row.localized.empty()) continue;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const size_t i : row.localized) {
      mean += OdomFromRig(s, s.references[i].pose).translation / static_cast<double>(row.localized.size());
    }
    row.odom_from_pano = {OdomFromRig(s, s.references[row.shown].pose).rotation, mean};
    row.centre_sigma_m = CentreSigma(s, row);
  }
  return rows;
}

Matrix6d OdomCovariance(const Solution& s, const ReferenceRow& row) {
  return CovarianceOf(s, row, 1, [](const Solution& its, int pose) { return OdomCovariance(its, pose); });
}

Matrix6d WorldCovariance(const Solution& s, const ReferenceRow& row) {
  return CovarianceOf(s, row, s.georeference->world_from_odom.scale,
                      [](const Solution& its, int pose) { return WorldCovariance(its, pose); });
}

}  // namespace trigpoint
