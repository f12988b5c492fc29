#include "survey/tags/control.h"

#include <Eigen/SVD>

namespace trigpoint {
namespace {

constexpr double kLeastSpread = 0.15;  // second principal extent / first

}  // namespace

bool AreWellSpread(const std::vector<Eigen::Vector3d>& points) {
  if (points.size() < 3) return false;
  Eigen::MatrixXd centred(3, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) centred.col(static_cast<Eigen::Index>(i)) = points[i];
  centred.colwise() -= Eigen::Vector3d(centred.rowwise().mean());
  const Eigen::VectorXd extent = Eigen::JacobiSVD<Eigen::MatrixXd>(centred).singularValues();
  return extent(0) > 0 && extent(1) >= kLeastSpread * extent(0);
}

int WithholdChecks(std::vector<SurveyPoint>* points) {
  for (SurveyPoint& p : *points) p.role = PointRole::kControl;
  int withheld = 0;
  for (size_t i = 2; i < points->size(); i += 3) {
    std::vector<Eigen::Vector3d> left;
    for (size_t k = 0; k < points->size(); ++k) {
      if (k != i && (*points)[k].role == PointRole::kControl) left.push_back((*points)[k].world_m);
    }
    if (!AreWellSpread(left)) continue;
    (*points)[i].role = PointRole::kCheck;
    ++withheld;
  }
  return withheld;
}

}  // namespace trigpoint
