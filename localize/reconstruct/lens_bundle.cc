#include "localize/reconstruct/lens_bundle.h"

#include <algorithm>
#include <numeric>

#include "calib/base/error.h"
#include "calib/estimation/marginal_covariance.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

constexpr double kLossSigmas = 2.5;  // beyond it errors count less (Cauchy)

// A pose factor between two poses, as the bundle has it; scaled by nothing.
struct BetweenCost {
  const PoseFactor& factor;
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    Eigen::Quaternion<T> qa, qb;
    T q[4];
    ceres::AngleAxisToQuaternion(a, q);
    qa = Eigen::Quaternion<T>(q[0], q[1], q[2], q[3]);
    ceres::AngleAxisToQuaternion(b, q);
    qb = Eigen::Quaternion<T>(q[0], q[1], q[2], q[3]);
    const Eigen::Quaternion<T> turn = qa * qb.conjugate();
    const Eigen::Matrix<T, 3, 1> shift =
        Eigen::Map<const Eigen::Matrix<T, 3, 1>>(a + 3) - turn * Eigen::Map<const Eigen::Matrix<T, 3, 1>>(b + 3);
    const Eigen::Quaternion<T> off = turn * factor.measured.rotation.conjugate().cast<T>();
    const T wxyz[4] = {off.w(), off.x(), off.y(), off.z()};
    Eigen::Matrix<T, 6, 1> e;
    ceres::QuaternionToAngleAxis(wxyz, e.data());
    e.template tail<3>() = shift - factor.measured.translation.cast<T>();
    Eigen::Map<Eigen::Matrix<T, 6, 1>>{residual} = factor.sqrt_info.cast<T>() * e;
    return true;
  }
};

struct PriorCost {
  LensParameters value, sigma;
  template <typename T>
  bool operator()(const T* lens, T* residual) const {
    for (size_t k = 0; k < value.size(); ++k) residual[k] = (lens[k] - value[k]) / sigma[k];
    return true;
  }
};

// Poses that take part: all, or some stretches of a long run.
std::vector<bool> PosesToUse(size_t poses) {
  constexpr size_t kMost = 150, kStretches = 5;
  std::vector<bool> used(poses, poses <= kMost);
  for (size_t k = 0; k < kStretches && poses > kMost; ++k) {
    const size_t begin = k * (poses - kMost / kStretches) / (kStretches - 1);
    std::fill_n(used.begin() + static_cast<std::ptrdiff_t>(begin), kMost / kStretches, true);
  }
  return used;
}

// Points to adjust: those that most images show, so many that every image has enough.
std::vector<bool> PointsToUse(const Reconstruction& r, const std::vector<bool>& poses, int points_per_image) {
  std::vector<int> seen(r.problem.points.size(), 0);
  std::vector<std::vector<size_t>> observations(r.problem.points.size());
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    const auto point = static_cast<size_t>(o.point);
    if (!o.active || !r.point_valid[point] || !poses[static_cast<size_t>(o.pose)]) continue;
    ++seen[point];
    observations[point].push_back(k);
  }
  std::vector<size_t> order(seen.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return seen[a] > seen[b]; });
  const int last = r.image_of.empty() ? -1 : *std::max_element(r.image_of.begin(), r.image_of.end());
  std::vector<int> of_image(static_cast<size_t>(last + 1), 0);
  std::vector<bool> used(seen.size(), false);
  for (const size_t j : order) {
    if (seen[j] < 2) break;
    const auto has_room = [&](size_t k) { return of_image[static_cast<size_t>(r.image_of[k])] < points_per_image; };
    if (std::none_of(observations[j].begin(), observations[j].end(), has_room)) continue;
    used[j] = true;
    for (const size_t k : observations[j]) ++of_image[static_cast<size_t>(r.image_of[k])];
  }
  return used;
}

ceres::Problem::Options LossIsKept() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

}  // namespace

LensBundle::LensBundle(const Reconstruction& r, std::vector<LensParameters> of_cameras)
    : lenses(std::move(of_cameras)),
      problem(LossIsKept()),
      reconstruction_(r),
      loss_(new ceres::CauchyLoss(kLossSigmas), ceres::TAKE_OWNERSHIP),
      points_(r.problem.points),
      first_(points_.size(), -1) {
  for (const Rigid3d& pose : r.problem.poses) {
    const Eigen::Vector3d w = LogSO3(pose.rotation);
    poses_.push_back({w.x(), w.y(), w.z(), pose.translation.x(), pose.translation.y(), pose.translation.z()});
  }
}

void LensBundle::AddImages(int points_per_image, const ObservationCost& cost) {
  const Reconstruction& r = reconstruction_;
  const std::vector<bool> poses = PosesToUse(r.problem.poses.size());
  const std::vector<bool> used = PointsToUse(r, poses, points_per_image);
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    const auto point = static_cast<size_t>(o.point), pose = static_cast<size_t>(o.pose);
    const auto camera = static_cast<size_t>(o.view);
    if (!o.active || !used[point] || !poses[pose] || camera >= lenses.size()) continue;
    ceres::CostFunction* const function = cost(o);
    if (function == nullptr) continue;
    problem.AddResidualBlock(function, &loss_, poses_[pose].data(), points_[point].data(), lenses[camera].data());
    if (first_[point] < 0) first_[point] = static_cast<int>(k);
  }
  if (problem.NumResidualBlocks() == 0)
    throw NumericError("the lens cannot be estimated: expected points seen in several images, found none");
}

void LensBundle::AddMotion() {
  std::vector<bool> follows(poses_.size(), false);
  for (const PoseFactor& f : reconstruction_.problem.factors) {
    const auto first = static_cast<size_t>(f.a), second = static_cast<size_t>(f.b);
    if (f.kind != PoseFactor::Kind::kBetween || !problem.HasParameterBlock(poses_[first].data()) ||
        !problem.HasParameterBlock(poses_[second].data()))
      continue;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<BetweenCost, 6, 6, 6>(new BetweenCost{f}), nullptr,
                             poses_[first].data(), poses_[second].data());
    follows[std::max(first, second)] = true;
  }
  for (size_t k = 0; k < poses_.size(); ++k) {
    if (follows[k] || !problem.HasParameterBlock(poses_[k].data())) continue;
    problem.SetParameterBlockConstant(poses_[k].data());
  }
}

void LensBundle::AddPrior(size_t camera, const LensParameters& value, const LensParameters& sigma) {
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<PriorCost, kLensParameters, kLensParameters>(new PriorCost{value, sigma}),
      nullptr, lenses[camera].data());
}

double LensBundle::Solve(int max_iterations) {
  ceres::Solver::Options solve;
  solve.linear_solver_type = ceres::SPARSE_SCHUR;
  solve.num_threads = 1;  // several don't repeat bit for bit
  solve.max_num_iterations = max_iterations;
  solve.function_tolerance = 1e-6;
  solve.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solve, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw NumericError("the lenses cannot be estimated: " + summary.message);
  return summary.final_cost;
}

void LensBundle::Discount(double times) {
  auto* const scaled = new ceres::ScaledLoss(new ceres::CauchyLoss(kLossSigmas), 1 / times, ceres::TAKE_OWNERSHIP);
  loss_.Reset(scaled, ceres::TAKE_OWNERSHIP);
}

MarginalCovariance LensBundle::CovarianceOfLenses(const std::function<int(const BearingObservation&)>& part) {
  const auto is_free = [&](double* block) {
    return problem.HasParameterBlock(block) && !problem.IsParameterBlockConstant(block);
  };
  std::vector<double*> kept, points;
  for (LensParameters& lens : lenses) {
    if (is_free(lens.data())) kept.push_back(lens.data());
  }
  const int asked = kLensParameters * static_cast<int>(kept.size());
  for (PoseParameters& pose : poses_) {
    if (is_free(pose.data())) kept.push_back(pose.data());
  }
  std::vector<std::vector<int>> groupings(part ? 2 : 0);
  for (size_t j = 0; j < points_.size(); ++j) {
    if (!is_free(points_[j].data())) continue;
    points.push_back(points_[j].data());
    if (!part) continue;
    const auto first = static_cast<size_t>(first_[j]);
    groupings[0].push_back(reconstruction_.image_of[first]);
    groupings[1].push_back(part(reconstruction_.problem.observations[first]));
  }
  return Marginalise(&problem, kept, points, groupings, asked);
}

}  // namespace trigpoint
