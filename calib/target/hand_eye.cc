#include "calib/target/hand_eye.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/manifold.h"

namespace trigpoint {
namespace {

constexpr int kLeastPasses = 4;
constexpr int kLeastSights = 4;         // of a pass
constexpr double kLeastTurn = 0.1;      // rad, within some pass: else only the rotation's direction is seen
constexpr double kOutlierSigmas = 5.0;  // of a corner

struct Pass {
  std::vector<const HandEyeSight*> sights;
  std::vector<Rigid3d> first_from_body;
  Rigid3d first_from_tag;
};

// Corner of a tag: cam_from_body, first_from_tag, scale -> 2 (px / sigma).
class CornerCost final : public ceres::SizedCostFunction<2, 7, 7, 1> {
 public:
  CornerCost(const Camera& camera, const Rigid3d& first_from_body, const Eigen::Vector3d& corner,
             const Eigen::Vector2d& pixel, const double* sigma)
      : camera_(camera), first_from_body_(first_from_body), corner_(corner), pixel_(pixel), sigma_(sigma) {}

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Rigid3d cam_from_body = Rigid3FromBlock(blocks[0]), first_from_tag = Rigid3FromBlock(blocks[1]);
    const Eigen::Matrix3d body_from_first = first_from_body_.rotation.conjugate().toRotationMatrix();
    const Eigen::Vector3d turned = first_from_tag.rotation * corner_;
    const Eigen::Vector3d in_body =
        body_from_first * (turned + first_from_tag.translation - blocks[2][0] * first_from_body_.translation);
    const Eigen::Vector3d in_cam_turned = cam_from_body.rotation * in_body;
    Eigen::Matrix<double, 2, 3> by_point;
    const auto pixel = camera_.Project(in_cam_turned + cam_from_body.translation, &by_point);
    if (!pixel) {  // behind the camera: far off, and flat
      residuals[0] = residuals[1] = 1e4 / *sigma_;
      if (jacobians == nullptr) return true;
      for (int b = 0; b < 3; ++b) {
        if (jacobians[b] != nullptr) std::fill_n(jacobians[b], b == 2 ? 2 : 14, 0.0);
      }
      return true;
    }
    const double w = 1 / *sigma_;
    residuals[0] = w * (pixel->x() - pixel_.x());
    residuals[1] = w * (pixel->y() - pixel_.y());
    if (jacobians == nullptr) return true;
    Eigen::Matrix<double, 2, 6> tangent;
    if (jacobians[0] != nullptr) {
      tangent << w * by_point * -Skew(in_cam_turned), w * by_point;
      ToAmbient(tangent, blocks[0], jacobians[0]);
    }
    const Eigen::Matrix<double, 2, 3> by_first =
        w * by_point * cam_from_body.rotation.toRotationMatrix() * body_from_first;
    if (jacobians[1] != nullptr) {
      tangent << by_first * -Skew(turned), by_first;
      ToAmbient(tangent, blocks[1], jacobians[1]);
    }
    if (jacobians[2] != nullptr) Eigen::Map<Eigen::Vector2d>{jacobians[2]} = -by_first * first_from_body_.translation;
    return true;
  }

 private:
  const Camera& camera_;
  Rigid3d first_from_body_;
  Eigen::Vector3d corner_;
  Eigen::Vector2d pixel_;
  const double* sigma_;
};

// The camera's place against the start's, and the scale against 1.
class PlacePrior final : public ceres::SizedCostFunction<3, 7> {
 public:
  PlacePrior(const Eigen::Vector3d& cam_in_body, double sigma) : place_(cam_in_body), sigma_(sigma) {}
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Rigid3d cam_from_body = Rigid3FromBlock(blocks[0]);
    const Eigen::Matrix3d rt = cam_from_body.rotation.conjugate().toRotationMatrix();
    Eigen::Map<Eigen::Vector3d>{residuals} = (cam_from_body.TargetOriginInSource() - place_) / sigma_;
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Matrix<double, 3, 6> tangent;
    tangent << -rt * Skew(cam_from_body.translation) / sigma_, -rt / sigma_;
    Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
    Rigid3Manifold().MinusJacobian(blocks[0], minus.data());
    Eigen::Map<Eigen::Matrix<double, 3, 7, Eigen::RowMajor>>{jacobians[0]} = tangent * minus;
    return true;
  }

 private:
  Eigen::Vector3d place_;
  double sigma_;
};

class ScalePrior final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit ScalePrior(double sigma) : sigma_(sigma) {}
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    residuals[0] = (blocks[0][0] - 1) / sigma_;
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1 / sigma_;
    return true;
  }

 private:
  double sigma_;
};

std::vector<Pass> CutIntoPasses(const std::vector<HandEyeSight>& sights, const HandEyeOptions& options) {
  std::map<int, std::vector<const HandEyeSight*>> by_tag;
  for (const HandEyeSight& sight : sights) by_tag[sight.tag_id].push_back(&sight);
  std::vector<Pass> passes;
  for (auto& [tag, seen] : by_tag) {
    std::stable_sort(seen.begin(), seen.end(), [](const auto* a, const auto* b) { return a->stamp_ns < b->stamp_ns; });
    Pass pass;
    double way = 0;
    const auto close = [&] {
      if (pass.sights.size() >= kLeastSights) passes.push_back(pass);
      pass = Pass();
      way = 0;
    };
    for (const HandEyeSight* sight : seen) {
      if (!pass.sights.empty()) {
        const double since_last = 1e-9 * static_cast<double>(sight->stamp_ns - pass.sights.back()->stamp_ns);
        const double since_first = 1e-9 * static_cast<double>(sight->stamp_ns - pass.sights.front()->stamp_ns);
        way += (sight->odom_from_body.translation - pass.sights.back()->odom_from_body.translation).norm();
        if (since_last > options.max_gap_s || since_first > options.max_pass_s || way > options.max_pass_m) close();
      }
      pass.sights.push_back(sight);
      pass.first_from_body.push_back(pass.sights.front()->odom_from_body.Inverse() * sight->odom_from_body);
    }
    close();
  }
  return passes;
}

struct State {
  std::array<double, 7> cam_from_body{};
  std::vector<std::array<double, 7>> tags;
  double scale = 1, sigma = 1;
};

class Solver {
 public:
  Solver(const std::vector<Pass>& passes, const Camera& camera, const Rigid3d& start, const HandEyeOptions& options,
         const CancelToken& cancel)
      : passes_(passes), camera_(camera), place_(start.TargetOriginInSource()), options_(options), cancel_(cancel) {
    for (const Pass& pass : passes) used_.emplace_back(pass.sights.size(), true);
  }

  // Tag poses from each pass' middle picture, by rays on the tag's plane: a coarse start that the robust loss mends.
  State Begin(const Rigid3d& cam_from_body) const {
    State state;
    Rigid3ToBlock(cam_from_body, state.cam_from_body.data());
    for (const Pass& pass : passes_) {
      const size_t middle = pass.sights.size() / 2;
      const HandEyeSight& sight = *pass.sights[middle];
      // Far enough that the tag has its size in the picture, facing the camera.
      Eigen::Vector2d centre = Eigen::Vector2d::Zero();
      for (const Eigen::Vector2d& p : sight.pixels) centre += 0.25 * p;
      const Eigen::Vector3d ray = camera_.Unproject(centre).value_or(Eigen::Vector3d::UnitZ());
      double angle = 0, size = 0;
      Eigen::Vector3d down = Eigen::Vector3d::Zero();
      std::array<Eigen::Vector3d, 4> rays;
      for (size_t k = 0; k < 4; ++k) rays[k] = camera_.Unproject(sight.pixels[k]).value_or(ray);
      for (size_t k = 0; k < 4; ++k) {
        angle = std::max(angle, (rays[k] - rays[(k + 1) % 4]).norm());
        size = std::max(size, (sight.corners_m[k] - sight.corners_m[(k + 1) % 4]).norm());
      }
      down = rays[0] + rays[1] - rays[2] - rays[3];  // bottom less top
      const Eigen::Vector3d z = ray.normalized();
      const Eigen::Vector3d y = (down - down.dot(z) * z).normalized();
      Eigen::Matrix3d r;
      r << y.cross(z), y, z;
      const Rigid3d cam_from_tag(Eigen::Quaterniond(r), z * size / std::max(angle, 1e-6));
      std::array<double, 7> block{};
      Rigid3ToBlock(pass.first_from_body[middle] * cam_from_body.Inverse() * cam_from_tag, block.data());
      state.tags.push_back(block);
    }
    return state;
  }

  // Leaves out pass `without` (-1: none). Returns the final robust cost.
  double Solve(State& state, int without, int iterations, bool robust) const {
    ceres::Problem::Options problem_options;
    problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(problem_options);
    CauchyChi2Loss loss(9.0);
    for (size_t g = 0; g < passes_.size(); ++g) {
      if (static_cast<int>(g) == without) continue;
      for (size_t i = 0; i < passes_[g].sights.size(); ++i) {
        if (!used_[g][i]) continue;
        const HandEyeSight& sight = *passes_[g].sights[i];
        for (size_t k = 0; k < 4; ++k) {
          problem.AddResidualBlock(
              new CornerCost(camera_, passes_[g].first_from_body[i], sight.corners_m[k], sight.pixels[k], &state.sigma),
              robust ? &loss : nullptr, state.cam_from_body.data(), state.tags[g].data(), &state.scale);
        }
      }
      if (problem.HasParameterBlock(state.tags[g].data()))
        problem.SetManifold(state.tags[g].data(), new Rigid3Manifold);
    }
    problem.AddResidualBlock(new PlacePrior(place_, options_.prior_m), nullptr, state.cam_from_body.data());
    problem.SetManifold(state.cam_from_body.data(), new Rigid3Manifold);
    if (problem.HasParameterBlock(&state.scale)) {
      if (options_.scale_sigma > 0) {
        problem.AddResidualBlock(new ScalePrior(options_.scale_sigma), nullptr, &state.scale);
      } else {
        problem.SetParameterBlockConstant(&state.scale);
      }
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    auto* ordering = new ceres::ParameterBlockOrdering;
    for (size_t g = 0; g < state.tags.size(); ++g) {
      if (problem.HasParameterBlock(state.tags[g].data())) ordering->AddElementToGroup(state.tags[g].data(), 0);
    }
    ordering->AddElementToGroup(state.cam_from_body.data(), 1);
    if (problem.HasParameterBlock(&state.scale)) ordering->AddElementToGroup(&state.scale, 1);
    options.linear_solver_ordering.reset(ordering);
    options.max_num_iterations = iterations;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    cancel_.ThrowIfCancelled();
    return summary.IsSolutionUsable() ? summary.final_cost : std::numeric_limits<double>::infinity();
  }

  // Sets sigma from the middle of all residuals; leaves out sights with a corner beyond it if `reject`.
  void Weigh(State& state, bool reject) {
    std::vector<double> all;
    std::vector<std::vector<double>> worst(passes_.size());
    for (size_t g = 0; g < passes_.size(); ++g) {
      for (size_t i = 0; i < passes_[g].sights.size(); ++i) {
        double most = 0;
        for (const Eigen::Vector2d& r : Residuals(state, g, i)) {
          all.push_back(std::abs(r.x()));
          all.push_back(std::abs(r.y()));
          most = std::max(most, r.norm());
        }
        worst[g].push_back(most);
      }
    }
    state.sigma = std::max(0.01, 1.4826 * Median(all));
    if (!reject) return;
    for (size_t g = 0; g < passes_.size(); ++g) {
      for (size_t i = 0; i < worst[g].size(); ++i) used_[g][i] = worst[g][i] < kOutlierSigmas * state.sigma;
    }
  }

  std::array<Eigen::Vector2d, 4> Residuals(const State& state, size_t g, size_t i) const {
    const HandEyeSight& sight = *passes_[g].sights[i];
    std::array<Eigen::Vector2d, 4> residuals;
    const double one = 1;
    for (size_t k = 0; k < 4; ++k) {
      const CornerCost cost(camera_, passes_[g].first_from_body[i], sight.corners_m[k], sight.pixels[k], &one);
      const double* blocks[] = {state.cam_from_body.data(), state.tags[g].data(), &state.scale};
      cost.Evaluate(blocks, residuals[k].data(), nullptr);
    }
    return residuals;
  }

  bool Used(size_t g, size_t i) const { return used_[g][i]; }

 private:
  const std::vector<Pass>& passes_;
  const Camera& camera_;
  Eigen::Vector3d place_;
  const HandEyeOptions& options_;
  const CancelToken& cancel_;
  std::vector<std::vector<bool>> used_;
};

// The 24 rotations that take axes to axes.
std::vector<Eigen::Quaterniond> AxisRotations() {
  std::vector<Eigen::Quaterniond> all;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      if (a == b) continue;
      for (int signs = 0; signs < 4; ++signs) {
        Eigen::Matrix3d r = Eigen::Matrix3d::Zero();
        r(a, 0) = signs % 2 == 0 ? 1 : -1;
        r(b, 1) = signs / 2 == 0 ? 1 : -1;
        r.col(2) = r.col(0).cross(r.col(1));
        all.emplace_back(r);
      }
    }
  }
  return all;
}

// What there is to see; throws if it is too little.
HandEyeResult CountPasses(const std::vector<Pass>& passes) {
  HandEyeResult result;
  result.passes = static_cast<int>(passes.size());
  for (const Pass& pass : passes) {
    result.sights += static_cast<int>(pass.sights.size());
    for (const Rigid3d& pose : pass.first_from_body)
      result.turned_rad = std::max(result.turned_rad, LogSO3(pose.rotation).norm());
  }
  if (result.passes < kLeastPasses) {
    throw InputError(
        "hand-eye calibration: expected at least 4 stretches with a tag in 4 or more pictures in a row, found " +
        std::to_string(result.passes) + "; drive past more tags, or past the same ones again");
  }
  if (result.turned_rad < kLeastTurn) {
    throw InputError("hand-eye calibration: the body rotates too little while it sees a tag (" +
                     std::to_string(static_cast<int>(std::lround(result.turned_rad * 180 / std::numbers::pi))) +
                     " deg at most) to determine the camera's position on it; drive curves in front of tags");
  }
  return result;
}

// The best of the solutions that begin with `start` turned by multiples of 90 deg.
State SolveFromAllSides(const Solver& solver, const Rigid3d& start, ProgressSink& progress) {
  State best;
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Quaterniond& turn : AxisRotations()) {
    Rigid3d begin(turn * start.rotation, Eigen::Vector3d::Zero());
    begin.translation = -(begin.rotation * start.TargetOriginInSource());
    State state = solver.Begin(begin);
    state.sigma = 5;  // px: the odometry's errors, at first
    const double cost = solver.Solve(state, -1, 30, true);
    if (cost < least) {
      least = cost;
      best = state;
    }
    progress.Advance(1);
  }
  if (!std::isfinite(least)) throw NumericError("hand-eye calibration did not converge from any start");
  return best;
}

// Covariance and the scale's sigma by a jackknife over passes.
void Jackknife(const Solver& solver, const State& best, ProgressSink& progress, HandEyeResult& result) {
  const double n = result.passes;
  std::vector<Vector6d> away;
  Vector6d mean = Vector6d::Zero();
  std::vector<double> scales;
  for (int g = 0; g < result.passes; ++g) {
    State state = best;
    solver.Solve(state, g, 50, true);
    away.push_back(Rigid3FromBlock(state.cam_from_body.data()).Minus(result.cam_from_body));
    mean += away.back() / n;
    scales.push_back(state.scale);
    progress.Advance(1);
  }
  double scale_mean = 0;
  for (double s : scales) scale_mean += s / n;
  for (size_t g = 0; g < away.size(); ++g) {
    result.covariance += (n - 1) / n * (away[g] - mean) * (away[g] - mean).transpose();
    result.scale_sigma += (n - 1) / n * (scales[g] - scale_mean) * (scales[g] - scale_mean);
  }
  result.scale_sigma = std::sqrt(result.scale_sigma);
}

// Rotation axes of the motion within passes: what lies along all of them is not seen.
std::optional<Eigen::Vector3d> UnseenDirection(const std::vector<Pass>& passes) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (const Pass& pass : passes) {
    for (const Rigid3d& pose : pass.first_from_body) {
      const Eigen::Vector3d w = LogSO3(pose.rotation);
      axes += w.dot(w) * Eigen::Matrix3d::Identity() - w * w.transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(axes);
  // What tilting there is must stand out from the odometry's own attitude noise: 1.5 deg rms of the turning is too
  // little.
  constexpr double kFlat = 0.03;
  if (!(eigen.eigenvalues()[0] < kFlat * kFlat * eigen.eigenvalues()[2] || eigen.eigenvalues()[0] < 1e-3)) {
    return std::nullopt;
  }
  Eigen::Vector3d unseen = eigen.eigenvectors().col(0);
  if (unseen.sum() < 0) unseen *= -1;
  return unseen;
}

}  // namespace

HandEyeResult CalibrateHandEye(const std::vector<HandEyeSight>& sights, const Camera& camera, const Rigid3d& start,
                               const HandEyeOptions& options, ProgressSink& progress, const CancelToken& cancel) {
  const std::vector<Pass> passes = CutIntoPasses(sights, options);
  HandEyeResult result = CountPasses(passes);
  Solver solver(passes, camera, start, options, cancel);
  progress.Begin("hand-eye calibration", 24 + result.passes);
  State best = SolveFromAllSides(solver, start, progress);
  for (int round = 0; round < 3; ++round) {
    solver.Weigh(best, false);
    solver.Solve(best, -1, 100, true);
  }
  solver.Weigh(best, true);
  if (!std::isfinite(solver.Solve(best, -1, 100, true))) throw NumericError("hand-eye calibration did not converge");
  result.cam_from_body = Rigid3FromBlock(best.cam_from_body.data());
  result.scale = best.scale;
  Jackknife(solver, best, progress, result);

  double sum = 0;
  for (size_t g = 0; g < passes.size(); ++g) {
    for (size_t i = 0; i < passes[g].sights.size(); ++i) {
      if (!solver.Used(g, i)) continue;
      ++result.sights_used;
      for (const Eigen::Vector2d& r : solver.Residuals(best, g, i)) sum += r.squaredNorm();
    }
  }
  result.rms_px = std::sqrt(sum / std::max(1, 4 * result.sights_used));

  if (const std::optional<Eigen::Vector3d> unseen = UnseenDirection(passes)) {
    result.unseen_body = *unseen;
    // Its variance is the prior's.
    const Eigen::Vector3d u = result.cam_from_body.rotation * result.unseen_body;
    result.covariance.bottomRightCorner<3, 3>() += options.prior_m * options.prior_m * u * u.transpose();
  }
  return result;
}

}  // namespace trigpoint
