#include "localize/references/view_errors.h"

#include <Eigen/Eigenvalues>
#include <map>

#include "localize/references/cost_by_errors.h"

namespace trigpoint {
namespace {

SharedErrors MakeErrors(bool focal, const Eigen::MatrixXd& covariance, size_t poses) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(covariance);
  const Eigen::VectorXd sigmas = axes.eigenvalues().cwiseMax(0).cwiseSqrt();
  return {focal, axes.eigenvectors() * sigmas.asDiagonal(), std::vector<int>(poses, -1)};
}

std::vector<SharedErrors> ErrorsOf(const std::vector<PlacedViews>& references, size_t poses) {
  std::vector<SharedErrors> all;
  std::map<double, size_t> of_focal;
  for (const auto& [pose, first, focal_px, errors] : references) {
    if (pose < 0 || first < 0) continue;
    const auto at_pose = static_cast<size_t>(pose);
    if (errors.focal_share > 0) {
      const auto [at, fresh] = of_focal.try_emplace(focal_px, all.size());
      const double variance = errors.focal_share * errors.focal_share;
      if (fresh) all.push_back(MakeErrors(true, Eigen::MatrixXd::Constant(1, 1, variance), poses));
      all[at->second].first_view[at_pose] = first;
    }
    if (errors.poses.size() == 0) continue;
    all.push_back(MakeErrors(false, errors.poses, poses));
    all.back().first_view[at_pose] = first;
  }
  return all;
}

// The same sum of squares in fewer columns: a rig has many errors, and its pose six unknowns.
Eigen::MatrixXd Compressed(const Eigen::MatrixXd& shifts) {
  constexpr double kLittle = 1e-6;  // of the largest variance: a thousandth of its sigma
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(shifts.transpose() * shifts);
  const Eigen::VectorXd& ascending = axes.eigenvalues();
  const Eigen::Index kept = (ascending.array() > kLittle * ascending.tail<1>().value()).count();
  return shifts * axes.eigenvectors().rightCols(kept);
}

}  // namespace

Eigen::MatrixXd PoseShiftsByViews(const std::vector<PlacedViews>& references, const BundleProblem& p, int threads,
                                  const CancelToken& cancel) {
  const std::vector<SharedErrors> all = ErrorsOf(references, p.poses.size());
  if (all.empty()) return {};
  const BundleCovariance covariance(p, threads, cancel);
  Eigen::MatrixXd out(6 * static_cast<Eigen::Index>(p.poses.size()), 0);
  for (const SharedErrors& errors : all) {
    const Eigen::MatrixXd gradient = CostByErrors(errors, p).mixed() * errors.root;
    const Eigen::MatrixXd shifts = Compressed(-covariance.Times(gradient));
    out.conservativeResize(Eigen::NoChange, out.cols() + shifts.cols());
    out.rightCols(shifts.cols()) = shifts;
  }
  return out;
}

}  // namespace trigpoint
