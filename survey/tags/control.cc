#include "survey/tags/control.h"

#include <Eigen/SVD>
#include <algorithm>
#include <map>

namespace trigpoint {
namespace {

constexpr double kLeastSpread = 0.15;  // second principal extent / first
constexpr double kLeastHeight = 0.02;  // of a triangle / its longest side
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
  const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return longest2 > 0 && (b - a).cross(c - a).norm() >= kLeastHeight * longest2;
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
  // A tag's points share its pose: one of them as control holds the others, which then check nothing.
  std::vector<std::vector<size_t>> groups;
  std::map<int, size_t> group_of_tag;
  for (size_t i = 0; i < points->size(); ++i) {
    SurveyPoint& p = (*points)[i];
    p.role = PointRole::kControl;
    const size_t group = p.tag_id < 0 ? groups.size() : group_of_tag.try_emplace(p.tag_id, groups.size()).first->second;
    if (group == groups.size()) groups.emplace_back();
    groups[group].push_back(i);
  }
  int withheld = 0;
  for (size_t g = 2; g < groups.size(); g += 3) {
    for (size_t i : groups[g]) (*points)[i].role = PointRole::kCheck;
    std::vector<Eigen::Vector3d> left;
    for (const SurveyPoint& p : *points) {
      if (p.role == PointRole::kControl) left.push_back(p.world_m);
    }
    const bool enough = AreWellSpread(left);
    for (size_t i : groups[g]) (*points)[i].role = enough ? PointRole::kCheck : PointRole::kControl;
    withheld += enough ? static_cast<int>(groups[g].size()) : 0;
  }
  return withheld;
}

}  // namespace trigpoint
