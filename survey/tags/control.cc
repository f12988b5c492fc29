#include "survey/tags/control.h"

#include <Eigen/SVD>

namespace trigpoint {
namespace {

constexpr double kLeastSpread = 0.15;  // second principal extent / first
constexpr double kLeastArea = 0.02;    // of a parallelogram / square of its side
constexpr size_t kMostTried = 25;      // points

}  // namespace

bool AreWellSpread(const std::vector<Eigen::Vector3d>& points) {
  if (points.size() < 3) return false;
  Eigen::MatrixXd centred(3, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) centred.col(static_cast<Eigen::Index>(i)) = points[i];
  centred.colwise() -= Eigen::Vector3d(centred.rowwise().mean());
  const Eigen::VectorXd extent = Eigen::JacobiSVD<Eigen::MatrixXd>(centred).singularValues();
  return extent(0) > 0 && extent(1) >= kLeastSpread * extent(0);
}

bool IsTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return (b - a).cross(c - a).norm() >= kLeastArea * (b - a).squaredNorm();
}

bool HoldAFrame(const std::vector<Eigen::Vector3d>& points) {
  const size_t n = std::min(points.size(), kMostTried);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      for (size_t k = j + 1; k < n; ++k) {
        if (IsTriangle(points[i], points[j], points[k])) return true;
      }
    }
  }
  return false;
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
