#include "localize/references/refine_rig.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/manifold.h"
#include "calib/estimation/marginal_covariance.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

// Blocks: rig_from_world (7), [w; e] of the photo (6), ln s (1), point (3). Analytic: the camera gives its own
// Jacobian.
class RigPixelCost final : public ceres::SizedCostFunction<2, 7, 6, 1, 3> {
 public:
  RigPixelCost(const View& view, const Eigen::Vector2d& pixel, double sigma)
      : view_(view), pixel_(pixel), sigma_(sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Rigid3d rig_from_world = Rigid3FromBlock(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> w(parameters[1]), e(parameters[1] + 3);
    const double s = std::exp(parameters[2][0]);
    const Eigen::Quaterniond nominal = view_.rig_from_view.rotation.conjugate();
    const Eigen::Quaterniond cam_from_rig = ExpSO3(w) * nominal;
    const Eigen::Vector3d centre = s * (view_.rig_from_view.translation + e);
    const Eigen::Map<const Eigen::Vector3d> point(parameters[3]);
    const Eigen::Vector3d in_rig = rig_from_world * point;
    const Eigen::Vector3d in_cam = cam_from_rig * (in_rig - centre);
    Eigen::Matrix<double, 2, 3> j;
    const auto pixel = view_.camera.Project(in_cam, &j);
    if (!pixel) {
      // Behind the photo: an outlier whatever happens.
      residuals[0] = residuals[1] = 1000;
      if (jacobians != nullptr) {
        if (jacobians[0] != nullptr) std::fill(jacobians[0], jacobians[0] + 14, 0.0);
        if (jacobians[1] != nullptr) std::fill(jacobians[1], jacobians[1] + 12, 0.0);
        if (jacobians[2] != nullptr) std::fill(jacobians[2], jacobians[2] + 2, 0.0);
        if (jacobians[3] != nullptr) std::fill(jacobians[3], jacobians[3] + 6, 0.0);
      }
      return true;
    }
    Eigen::Map<Eigen::Vector2d> out(residuals);
    out = (*pixel - pixel_) / sigma_;
    if (jacobians == nullptr) return true;
    j /= sigma_;
    const Eigen::Matrix3d r = cam_from_rig.toRotationMatrix();
    if (jacobians[0] != nullptr) {
      // Through the manifold: d/d ambient = (d/d tangent) * (d tangent / d ambient), of which Ceres undoes the second.
      Eigen::Matrix<double, 2, 6> tangent;
      tangent.leftCols<3>() = -j * r * Skew(rig_from_world.rotation * point);
      tangent.rightCols<3>() = j * r;
      Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
      Rigid3Manifold().MinusJacobian(parameters[0], minus.data());
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> m(jacobians[0]);
      m = tangent * minus;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> m(jacobians[1]);
      // Exp(w + d) = Exp(J_l d) Exp(w)
      m.leftCols<3>() = -j * Skew(in_cam) * LeftJacobianSO3(w);
      m.rightCols<3>() = -s * j * r;
    }
    if (jacobians[2] != nullptr) {
      Eigen::Map<Eigen::Vector2d> m(jacobians[2]);
      m = -j * r * centre;
    }
    if (jacobians[3] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> m(jacobians[3]);
      m = j * r * rig_from_world.rotation.toRotationMatrix();
    }
    return true;
  }

 private:
  const View& view_;
  Eigen::Vector2d pixel_;
  double sigma_;
};

// A point's place against where it is known to be.
struct PointPrior {
  Eigen::Vector3d known;
  Eigen::Matrix3d sqrt_info;
  template <typename T>
  bool operator()(const T* point, T* residual) const {
    Eigen::Map<Eigen::Matrix<T, 3, 1>>{residual} =
        sqrt_info.cast<T>() * (Eigen::Map<const Eigen::Matrix<T, 3, 1>>(point) - known.cast<T>());
    return true;
  }
};

// L * x for the stacked [w; e] of all photos: L^T L is the information.
class ShapeCost final : public ceres::CostFunction {
 public:
  ShapeCost(Eigen::MatrixXd sqrt_info, int views) : l_(std::move(sqrt_info)) {
    set_num_residuals(static_cast<int>(l_.rows()));
    for (int v = 0; v < views; ++v) mutable_parameter_block_sizes()->push_back(6);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Index views = l_.cols() / 6;
    Eigen::Map<Eigen::VectorXd> r(residuals, l_.rows());
    r.setZero();
    for (Eigen::Index v = 0; v < views; ++v) {
      r += l_.middleCols<6>(6 * v) * Eigen::Map<const Eigen::Matrix<double, 6, 1>>(parameters[v]);
      if (jacobians != nullptr && jacobians[v] != nullptr) {
        Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>> m(jacobians[v], l_.rows(), 6);
        m = l_.middleCols<6>(6 * v);
      }
    }
    return true;
  }

 private:
  Eigen::MatrixXd l_;
};

struct LogScalePrior {
  double inverse_sigma;
  template <typename T>
  bool operator()(const T* log_scale, T* residual) const {
    residual[0] = log_scale[0] * inverse_sigma;
    return true;
  }
};

// Of all photos' [w; e] before the points are used.
Eigen::MatrixXd ShapeCovariance(const RefineRigInput& input, RigFreedom freedom) {
  const Eigen::Index n = 6 * static_cast<Eigen::Index>(input.rig.views.size());
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(n, n);
  if (input.shape_covariance.rows() == n) c = input.shape_covariance;
  if (freedom == RigFreedom::kFree) {
    // Turns as stitched; centres know nothing of one another.
    for (Eigen::Index v = 0; v < n / 6; ++v) {
      c.middleRows<3>(6 * v + 3).setZero();
      c.middleCols<3>(6 * v + 3).setZero();
      c.block<3, 3>(6 * v + 3, 6 * v + 3) = Eigen::Matrix3d::Identity() * input.free_sigma_m * input.free_sigma_m;
    }
  }
  // What the stitching holds by its gauge, and what its model leaves out: 0.01 deg, 1 mm.
  for (Eigen::Index v = 0; v < n / 6; ++v) {
    c.diagonal().segment<3>(6 * v).array() += 1.7e-4 * 1.7e-4;
    c.diagonal().segment<3>(6 * v + 3).array() += 1e-3 * 1e-3;
  }
  return c;
}

Eigen::MatrixXd ShapePrior(const RefineRigInput& input, RigFreedom freedom) {
  const Eigen::MatrixXd c = ShapeCovariance(input, freedom);
  const Eigen::LLT<Eigen::MatrixXd> llt(c);
  if (llt.info() != Eigen::Success) throw NumericError("the rig's covariance is not positive definite");
  // c = L L^T: the whitening is L^-1.
  return llt.matrixL().solve(Eigen::MatrixXd::Identity(c.rows(), c.cols()));
}

using Place = std::array<double, 3>;
Place PlaceOf(const KnownPoint& p) { return {p.point.x(), p.point.y(), p.point.z()}; }

// Free centres hold the size in themselves.
bool HasScale(RigFreedom freedom) { return freedom == RigFreedom::kScaled || freedom == RigFreedom::kPrior; }

struct RigSolution {
  RefinedRig rig;
  std::vector<std::array<double, 6>> deltas;
  double log_scale = 0;
  std::map<Place, size_t> point_of;  // by where each was thought to be
  std::vector<Place> points;         // where it turned out to be
};

// Points are eliminated first. Within a group Ceres goes by addresses in memory, which must not differ from run to run:
// the points lie in one row, all else has groups of its own.
ceres::ParameterBlockOrdering* EliminationOrder(const ceres::Problem& problem, double* pose, RigSolution* solution) {
  auto* order = new ceres::ParameterBlockOrdering;
  for (Place& point : solution->points) order->AddElementToGroup(point.data(), 0);
  int group = 1;
  order->AddElementToGroup(pose, group++);
  order->AddElementToGroup(&solution->log_scale, group++);
  for (auto& d : solution->deltas) {
    if (problem.HasParameterBlock(d.data())) order->AddElementToGroup(d.data(), group++);
  }
  return order;
}

// Photos and scale: priors of those that are free, the others are held.
void AddPriors(const RefineRigInput& input, RigFreedom freedom, const Eigen::MatrixXd& shape, ceres::Problem* problem,
               RigSolution* solution) {
  std::vector<double*> blocks;
  for (auto& d : solution->deltas) blocks.push_back(d.data());
  if (freedom == RigFreedom::kPrior || freedom == RigFreedom::kFree) {
    problem->AddResidualBlock(new ShapeCost(shape, static_cast<int>(blocks.size())), nullptr, blocks);
  } else {
    for (double* d : blocks) {
      if (problem->HasParameterBlock(d)) problem->SetParameterBlockConstant(d);
    }
  }
  double* const log_scale = &solution->log_scale;
  if (HasScale(freedom)) {
    problem->AddResidualBlock(new ceres::AutoDiffCostFunction<LogScalePrior, 1, 1>(
                                  new LogScalePrior{1 / std::max(1e-6, input.log_scale_sigma)}),
                              nullptr, log_scale);
    problem->SetParameterLowerBound(log_scale, 0, -4);
    problem->SetParameterUpperBound(log_scale, 0, 4);
  } else {
    problem->SetParameterBlockConstant(log_scale);
  }
}

// The mean of the photos' centres, to which the origin goes, by all unknowns. What moves all centres alike is known
// badly, as the rig's pose takes it in; it leaves both with the origin.
Eigen::MatrixXd OriginJacobian(const RefineRigInput& input, RigFreedom freedom, Eigen::Index unknowns,
                               const RigSolution& solution) {
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(3, unknowns);
  const auto n = static_cast<Eigen::Index>(input.rig.views.size());
  for (Eigen::Index v = 0; v < n; ++v) {
    const auto photo = static_cast<size_t>(v);
    const Eigen::Map<const Eigen::Vector3d> e(solution.deltas[photo].data() + 3);
    const double share = solution.rig.scale / static_cast<double>(n);
    if (HasScale(freedom)) j.col(6) += share * (input.rig.views[photo].rig_from_view.translation + e);
    if (freedom != RigFreedom::kFixed) j.block<3, 3>(0, unknowns - 6 * (n - v) + 3).diagonal().setConstant(share);
  }
  return j;
}

// `covariance`: of the rig's pose, ln s where it is free, and all photos' w, e; of a fixed rig that of its pose alone.
void SetCovariances(const RefineRigInput& input, RigFreedom freedom, const Eigen::MatrixXd& covariance,
                    RigSolution* solution) {
  RefinedRig& rig = solution->rig;
  if (covariance.size() == 0) {
    rig.covariance = Matrix6d::Identity() * 1e6;
    return;
  }
  const Eigen::Index unknowns = covariance.rows(), n = static_cast<Eigen::Index>(input.rig.views.size());
  const Eigen::MatrixXd origin = OriginJacobian(input, freedom, unknowns, *solution);
  Eigen::MatrixXd by_pose = Eigen::MatrixXd::Identity(6, unknowns);
  by_pose.bottomRows<3>() -= origin;
  rig.covariance = by_pose * covariance * by_pose.transpose();
  if (HasScale(freedom)) rig.scale_sigma = rig.scale * std::sqrt(std::max(0.0, covariance(6, 6)));
  if (freedom == RigFreedom::kFixed) return;
  Eigen::MatrixXd by_views = Eigen::MatrixXd::Zero(6 * n, unknowns);
  for (Eigen::Index v = 0; v < n; ++v) {
    const View& view = input.rig.views[static_cast<size_t>(v)];
    const Eigen::Map<const Eigen::Vector3d> e(solution->deltas[static_cast<size_t>(v)].data() + 3);
    Matrix6d by_photo = rig.scale * Matrix6d::Identity();
    by_photo.topLeftCorner<3, 3>() = -view.rig_from_view.rotation.toRotationMatrix();
    auto j = by_views.middleRows<6>(6 * v);
    j.bottomRows<3>() = -origin;
    if (HasScale(freedom)) j.block<3, 1>(3, 6) += rig.scale * (view.rig_from_view.translation + e);
    j.middleCols<6>(unknowns - 6 * (n - v)) += by_photo;
  }
  rig.view_covariance = by_views * covariance * by_views.transpose();
  rig.rig.views = input.rig.views;
  for (Eigen::Index v = 0; v < n; ++v) {
    rig.rig.views[static_cast<size_t>(v)].covariance = rig.view_covariance.block<6, 6>(6 * v, 6 * v);
  }
}

// Of the rig's pose, ln s and all photos' w, e, where the photos were held as stitched: the pose and the size follow
// their errors. `all_free`: the inverse of the information on all of them. The shape's prior, which it contains, is
// part of the photos' own block alone, which is not used.
Eigen::MatrixXd WithHeldPhotos(const Eigen::MatrixXd& all_free, const Eigen::MatrixXd& shape) {
  const Eigen::Index n = shape.rows(), k = all_free.rows() - n;
  const Eigen::MatrixXd information = all_free.llt().solve(Eigen::MatrixXd::Identity(k + n, k + n));
  const Eigen::LLT<Eigen::MatrixXd> own(information.topLeftCorner(k, k));
  const Eigen::MatrixXd by_shape = -own.solve(information.topRightCorner(k, n));
  Eigen::MatrixXd out(k + n, k + n);
  out << own.solve(Eigen::MatrixXd::Identity(k, k)) + by_shape * shape * by_shape.transpose(), by_shape * shape,
      shape * by_shape.transpose(), shape;
  return out;
}

// At the minimum. Empty if the points do not determine the pose.
Eigen::MatrixXd CovarianceOf(const RefineRigInput& input, RigFreedom freedom, const Eigen::MatrixXd& prior,
                             const std::vector<double*>& points, double* pose, ceres::Problem* problem,
                             RigSolution* solution) {
  std::vector<double*> photos, kept = {pose};
  for (auto& d : solution->deltas) photos.push_back(d.data());
  if (freedom == RigFreedom::kScaled) {
    problem->AddResidualBlock(new ShapeCost(prior, static_cast<int>(photos.size())), nullptr, photos);
    for (double* d : photos) problem->SetParameterBlockVariable(d);
  }
  if (HasScale(freedom)) kept.push_back(&solution->log_scale);
  if (freedom != RigFreedom::kFixed) kept.insert(kept.end(), photos.begin(), photos.end());
  const Eigen::MatrixXd covariance = Marginalise(problem, kept, points, {}).covariance;
  const bool held = freedom == RigFreedom::kScaled && covariance.size() > 0;
  return held ? WithHeldPhotos(covariance, ShapeCovariance(input, freedom)) : covariance;
}

RigSolution Solve(const RefineRigInput& input, RigFreedom freedom, const Eigen::MatrixXd& prior,
                  const std::vector<KnownPoint>& points, bool with_covariance) {
  RigSolution out;
  std::array<double, 7> pose{};
  Rigid3ToBlock(input.rig_from_world, pose.data());
  out.deltas.assign(input.rig.views.size(), {0, 0, 0, 0, 0, 0});
  ceres::Problem::Options own;
  own.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(own);
  CauchyChi2Loss loss(4.0);
  out.points.reserve(points.size());
  std::vector<double*> free_points;
  for (const KnownPoint& p : points) {
    const auto [entry, fresh] = out.point_of.try_emplace(PlaceOf(p), out.points.size());
    if (fresh) out.points.push_back(PlaceOf(p));
    double* const point = out.points[entry->second].data();
    problem.AddResidualBlock(new RigPixelCost(input.rig.views[static_cast<size_t>(p.view)], p.pixel, input.sigma_px),
                             &loss, pose.data(), out.deltas[static_cast<size_t>(p.view)].data(), &out.log_scale, point);
    if (!fresh) continue;
    const Eigen::LLT<Eigen::Matrix3d> llt(p.covariance);
    if (llt.info() != Eigen::Success) {
      problem.SetParameterBlockConstant(point);
      continue;
    }
    free_points.push_back(point);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointPrior, 3, 3>(
                                 new PointPrior{p.point, llt.matrixL().solve(Eigen::Matrix3d::Identity())}),
                             nullptr, point);
  }
  problem.SetManifold(pose.data(), new Rigid3Manifold);
  AddPriors(input, freedom, prior, &problem, &out);
  ceres::Solver::Options solve;
  solve.linear_solver_type = ceres::DENSE_SCHUR;
  solve.linear_solver_ordering.reset(EliminationOrder(problem, pose.data(), &out));
  solve.max_num_iterations = 40;
  solve.function_tolerance = 1e-8;
  solve.logging_type = ceres::SILENT;
  solve.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(solve, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw NumericError("the rig cannot be refined: " + summary.message);
  out.rig.rig_from_world = Rigid3FromBlock(pose.data());
  out.rig.scale = std::exp(out.log_scale);
  if (!with_covariance) return out;
  SetCovariances(input, freedom, CovarianceOf(input, freedom, prior, free_points, pose.data(), &problem, &out), &out);
  return out;
}

// Of a point where the solution has it; of one that took no part, where it is known to be.
double ErrorPx(const RefineRigInput& input, const RigSolution& s, const KnownPoint& p) {
  const View& view = input.rig.views[static_cast<size_t>(p.view)];
  const auto& d = s.deltas[static_cast<size_t>(p.view)];
  const Eigen::Quaterniond cam_from_rig =
      ExpSO3(Eigen::Vector3d(d[0], d[1], d[2])) * view.rig_from_view.rotation.conjugate();
  const Eigen::Vector3d centre = s.rig.scale * (view.rig_from_view.translation + Eigen::Vector3d(d[3], d[4], d[5]));
  const auto solved = s.point_of.find(PlaceOf(p));
  const Eigen::Vector3d point = solved == s.point_of.end() ? p.point : Eigen::Vector3d(s.points[solved->second].data());
  const auto pixel = view.camera.Project(cam_from_rig * (s.rig.rig_from_world * point - centre));
  return pixel ? (*pixel - p.pixel).norm() : 1e3;
}

constexpr double kNoHoldOut = 1e9;  // px, of an observation that too few others are left to predict

// Reprojection errors (px) of points that took no part, in the order of the points: five folds, whole points.
std::vector<double> HoldOutErrors(const RefineRigInput& input, RigFreedom freedom) {
  constexpr size_t kFolds = 5;
  // Folds of whole points: a point seen by two photos is in one of them.
  std::map<Place, size_t> fold_of;
  for (const KnownPoint& p : input.points) fold_of.try_emplace(PlaceOf(p), fold_of.size() % kFolds);
  const Eigen::MatrixXd prior = ShapePrior(input, freedom);
  std::vector<double> errors(input.points.size(), kNoHoldOut);
  for (size_t fold = 0; fold < kFolds; ++fold) {
    const auto held = [&](const KnownPoint& p) { return fold_of.at(PlaceOf(p)) == fold; };
    std::vector<KnownPoint> used;
    for (const KnownPoint& p : input.points) {
      if (!held(p)) used.push_back(p);
    }
    if (used.size() < 6) continue;
    const RigSolution s = Solve(input, freedom, prior, used, false);
    for (size_t i = 0; i < input.points.size(); ++i) {
      if (held(input.points[i])) errors[i] = ErrorPx(input, s, input.points[i]);
    }
  }
  return errors;
}

// Whether the second errors are smaller by more than chance: the mean difference of robust costs (Cauchy's) exceeds two
// of its standard errors, photos being the independent units, as what is wrong with a photo is so for all its points.
bool IsBetter(const RefineRigInput& input, const std::vector<double>& strict, const std::vector<double>& freer) {
  const auto cost = [&](double e) { return std::log1p(e * e / (input.sigma_px * input.sigma_px)); };
  std::map<int, std::pair<double, int>> of_view;  // sum of gains, number
  double sum = 0;
  for (size_t i = 0; i < input.points.size(); ++i) {
    const double gain = cost(strict[i]) - cost(freer[i]);
    auto& [gains, count] = of_view[input.points[i].view];
    gains += gain, sum += gain;
    ++count;
  }
  const double n = static_cast<double>(input.points.size()), views = static_cast<double>(of_view.size());
  if (views < 2) return false;
  const double mean = sum / n;
  double square = 0;
  for (const auto& [view, g] : of_view) square += std::pow(g.first - mean * g.second, 2);
  return mean > 2 * std::sqrt(square * views / (views - 1)) / n;
}

}  // namespace

std::string RigFreedomName(RigFreedom freedom) {
  switch (freedom) {
    case RigFreedom::kFixed: return "fixed";
    case RigFreedom::kScaled: return "scaled";
    case RigFreedom::kPrior: return "prior";
    case RigFreedom::kFree: return "free";
  }
  return "";
}

RefinedRig RefineRig(const RefineRigInput& input, RigFreedom freedom) {
  if (input.points.size() < 6) throw NumericError("a rig needs at least 6 known points to be refined");
  RigSolution s = Solve(input, freedom, ShapePrior(input, freedom), input.points, true);
  RefinedRig out = s.rig;
  double sum = 0;
  for (const KnownPoint& p : input.points) {
    const double e = ErrorPx(input, s, p);
    if (e > 4 * input.sigma_px) continue;
    sum += e * e;
    ++out.used;
  }
  out.rms_px = out.used > 0 ? std::sqrt(sum / (2 * out.used)) : 0;
  if (out.rig.views.empty()) out.rig = input.rig;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (size_t v = 0; v < out.rig.views.size(); ++v) {
    const auto& d = s.deltas[v];
    Rigid3d& pose = out.rig.views[v].rig_from_view;
    pose.rotation = (ExpSO3(Eigen::Vector3d(d[0], d[1], d[2])) * pose.rotation.conjugate()).conjugate();
    pose.translation = out.scale * (pose.translation + Eigen::Vector3d(d[3], d[4], d[5]));
    mean += pose.translation / static_cast<double>(out.rig.views.size());
  }
  for (View& view : out.rig.views) view.rig_from_view.translation -= mean;
  out.rig_from_world.translation -= mean;
  return out;
}

Eigen::MatrixXd StitchedViewCovariance(const RefineRigInput& input) {
  const Eigen::MatrixXd shape = ShapeCovariance(input, RigFreedom::kPrior);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(7 + shape.rows(), 7 + shape.cols());
  covariance(6, 6) = input.log_scale_sigma * input.log_scale_sigma;
  covariance.bottomRightCorner(shape.rows(), shape.cols()) = shape;
  RigSolution as_stitched;
  as_stitched.deltas.resize(input.rig.views.size());
  SetCovariances(input, RigFreedom::kPrior, covariance, &as_stitched);
  return as_stitched.rig.view_covariance;
}

RigFreedom ChooseFreedom(const RefineRigInput& input, std::vector<double>* errors) {
  RigFreedom best = RigFreedom::kFixed;
  std::vector<double> least = HoldOutErrors(input, best);
  if (errors != nullptr) *errors = {Median(least)};
  for (const RigFreedom freedom : {RigFreedom::kScaled, RigFreedom::kPrior, RigFreedom::kFree}) {
    std::vector<double> tried = HoldOutErrors(input, freedom);
    if (errors != nullptr) errors->push_back(Median(tried));
    if (IsBetter(input, least, tried)) least = std::move(tried), best = freedom;
  }
  return best;
}

}  // namespace trigpoint
