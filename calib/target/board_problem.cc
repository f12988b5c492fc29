#include "calib/target/board_problem.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <memory>

#include "calib/base/error.h"
#include "calib/camera/projection.h"
#include "calib/estimation/manifold.h"

namespace trigpoint {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix2X = Eigen::Matrix<double, 2, Eigen::Dynamic>;

struct Derivatives {
  Matrix2X by_params;
  Matrix26 by_rig, by_frame, by_shape;
};

// Raw residual of a point; `d`, if given, its derivatives (tangents of the poses).
bool Residual(const BoardGeometry& board, CameraModel model, bool square, std::vector<double> params,
              const Rigid3d& cam_from_rig, const Rigid3d& rig_from_board, const Vector6& shape, int point,
              const Eigen::Vector2d& observed, Eigen::Vector2d* residual, Derivatives* d) {
  if (square) params[1] = params[0];
  Eigen::Matrix<double, 3, 6> board_by_shape = Eigen::Matrix<double, 3, 6>::Zero();
  const Eigen::Vector3d on_board = board.Point(point, shape, d != nullptr ? &board_by_shape : nullptr);
  const Eigen::Vector3d turned = rig_from_board.rotation * on_board;
  const Eigen::Vector3d in_rig = turned + rig_from_board.translation;
  const Eigen::Vector3d turned_rig = cam_from_rig.rotation * in_rig;
  const Eigen::Vector3d in_cam = turned_rig + cam_from_rig.translation;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> by_point = Eigen::Matrix<double, 2, 3>::Zero();
  if (!ProjectByParams(model, params, in_cam, &pixel, d != nullptr ? &by_point : nullptr,
                       d != nullptr ? &d->by_params : nullptr) ||
      !pixel.allFinite()) {
    return false;
  }
  *residual = pixel - observed;
  if (d == nullptr) return true;
  if (square) {
    d->by_params.col(0) += d->by_params.col(1);
    d->by_params.col(1).setZero();
  }
  const Eigen::Matrix<double, 2, 3> by_rig_point = by_point * cam_from_rig.rotation.toRotationMatrix();
  d->by_rig << by_point * -Skew(turned_rig), by_point;
  d->by_frame << by_rig_point * -Skew(turned), by_rig_point;
  d->by_shape = by_rig_point * rig_from_board.rotation.toRotationMatrix() * board_by_shape;
  return true;
}

// Parameters: intrinsics, cam_from_rig, rig_from_board, board shape -> 2, whitened (px / sigma).
class BoardCost final : public ceres::CostFunction {
 public:
  BoardCost(const BoardProblem& problem, const BoardObservation& observation)
      : board_(*problem.board),
        camera_(problem.cameras[static_cast<size_t>(observation.camera)]),
        observation_(observation) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {static_cast<int>(camera_.params.size()), 7, 7, BoardShape::kSize};
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    Derivatives d;
    Eigen::Vector2d raw = Eigen::Vector2d::Zero();
    const size_t count = camera_.params.size();
    if (!Residual(board_, camera_.model, camera_.square_pixels, std::vector<double>(blocks[0], blocks[0] + count),
                  Rigid3FromBlock(blocks[1]), Rigid3FromBlock(blocks[2]), Eigen::Map<const Vector6>(blocks[3]),
                  observation_.point, observation_.pixel, &raw, jacobians != nullptr ? &d : nullptr)) {
      return false;
    }
    const double w = 1 / camera_.sigma_px;
    Eigen::Map<Eigen::Vector2d>{residuals} = w * raw;
    if (jacobians == nullptr) return true;
    using RowMajor2X = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;
    if (jacobians[0] != nullptr)
      Eigen::Map<RowMajor2X>(jacobians[0], 2, static_cast<Eigen::Index>(count)) = w * d.by_params;
    if (jacobians[1] != nullptr) ToAmbient(w * d.by_rig, blocks[1], jacobians[1]);
    if (jacobians[2] != nullptr) ToAmbient(w * d.by_frame, blocks[2], jacobians[2]);
    if (jacobians[3] != nullptr) Eigen::Map<RowMajor2X>(jacobians[3], 2, BoardShape::kSize) = w * d.by_shape;
    return true;
  }

 private:
  const BoardGeometry& board_;
  const CameraState& camera_;
  BoardObservation observation_;
};

class CancelCallback final : public ceres::IterationCallback {
 public:
  explicit CancelCallback(const CancelToken& cancel) : cancel_(cancel) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return cancel_.IsCancelled() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const CancelToken& cancel_;
};

std::vector<int> Without(int count, const std::vector<int>& free) {
  std::vector<int> fixed;
  for (int i = 0; i < count; ++i) {
    if (std::find(free.begin(), free.end(), i) == free.end()) fixed.push_back(i);
  }
  return fixed;
}

void HoldFixed(ceres::Problem& problem, double* block, int count, const std::vector<int>& free) {
  if (free.empty()) {
    problem.SetParameterBlockConstant(block);
  } else if (static_cast<int>(free.size()) < count) {
    problem.SetManifold(block, new ceres::SubsetManifold(count, Without(count, free)));
  }
}

// What the solver moves, apart from the shape.
struct ParameterBlocks {
  std::vector<std::array<double, 7>> rigs, frames;
  std::vector<std::vector<double>> params;

  explicit ParameterBlocks(const BoardProblem& problem)
      : rigs(problem.cameras.size()), frames(problem.rig_from_board.size()) {
    for (size_t c = 0; c < rigs.size(); ++c) Rigid3ToBlock(problem.cameras[c].cam_from_rig, rigs[c].data());
    for (size_t f = 0; f < frames.size(); ++f) Rigid3ToBlock(problem.rig_from_board[f], frames[f].data());
    for (const CameraState& camera : problem.cameras) params.push_back(camera.params);
  }
  void WriteTo(BoardProblem& problem) const {
    for (size_t c = 0; c < rigs.size(); ++c) {
      CameraState& camera = problem.cameras[c];
      camera.params = params[c];
      if (camera.square_pixels) camera.params[1] = camera.params[0];
      camera.cam_from_rig = Rigid3FromBlock(rigs[c].data());
    }
    for (size_t f = 0; f < frames.size(); ++f) problem.rig_from_board[f] = Rigid3FromBlock(frames[f].data());
  }
};

bool MoreThanPosesFree(const BoardProblem& problem) {
  return !problem.free_shape.empty() || (problem.free_extrinsics && problem.cameras.size() > 1) ||
         std::any_of(problem.cameras.begin(), problem.cameras.end(), [](const auto& c) { return !c.free.empty(); });
}

}  // namespace

const char* const BoardShape::kNames[BoardShape::kSize] = {"bend_x_m", "bend_y_m", "twist_m",
                                                           "stretch",  "shear",    "gap_m"};

BoardGeometry::BoardGeometry(const Target& target) : points_(target.BoardPoints()) {
  Eigen::Vector3d low = points_.front(), high = points_.front();
  for (const Eigen::Vector3d& p : points_) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  middle_ = 0.5 * (low + high);
  const Eigen::Vector2d half = (0.5 * (high - low)).head<2>().cwiseMax(1e-9);
  for (size_t i = 0; i < points_.size(); ++i) {
    normalised_.emplace_back((points_[i] - middle_).head<2>().cwiseQuotient(half));
    const int columns = target.PointColumns();
    const int c = static_cast<int>(i) % columns, r = static_cast<int>(i) / columns;
    gaps_.emplace_back(target.kind == TargetKind::kAprilGrid ? Eigen::Vector2d(c / 2, r / 2) : Eigen::Vector2d(0, 0));
  }
}

Eigen::Vector3d BoardGeometry::Point(int id, const Vector6& shape, Eigen::Matrix<double, 3, 6>* by_shape) const {
  const auto i = static_cast<size_t>(id);
  const Eigen::Vector3d& p = points_[i];
  const double x = normalised_[i].x(), y = normalised_[i].y();
  const double bend_x = 1 - x * x, bend_y = 1 - y * y;
  if (by_shape != nullptr) {
    by_shape->setZero();
    by_shape->row(2) << bend_x, bend_y, x * y, 0, 0, 0;
    (*by_shape)(1, 3) = p.y();
    (*by_shape)(0, 4) = p.y();
    by_shape->col(5) << gaps_[i], 0;
  }
  return {p.x() + shape[4] * p.y() + shape[5] * gaps_[i].x(), p.y() * (1 + shape[3]) + shape[5] * gaps_[i].y(),
          p.z() + shape[0] * bend_x + shape[1] * bend_y + shape[2] * x * y};
}

bool BoardResidual(const BoardProblem& problem, const BoardObservation& o, Eigen::Vector2d* residual) {
  const CameraState& camera = problem.cameras[static_cast<size_t>(o.camera)];
  return Residual(*problem.board, camera.model, camera.square_pixels, camera.params, camera.cam_from_rig,
                  problem.rig_from_board[static_cast<size_t>(o.frame)], problem.shape, o.point, o.pixel, residual,
                  nullptr);
}

SolveReport SolveBoardProblem(BoardProblem& problem, ceres::LossFunction* loss, int max_iterations,
                              const CancelToken& cancel) {
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.manifold_ownership = ceres::TAKE_OWNERSHIP;
  ceres::Problem ceres_problem(problem_options);
  ParameterBlocks blocks(problem);
  auto& [rigs, frames, params] = blocks;
  for (const BoardObservation& o : problem.observations) {
    if (!problem.IsActive(o)) continue;
    const auto c = static_cast<size_t>(o.camera), f = static_cast<size_t>(o.frame);
    ceres_problem.AddResidualBlock(new BoardCost(problem, o), loss, params[c].data(), rigs[c].data(), frames[f].data(),
                                   problem.shape.data());
  }
  SolveReport report;
  if (ceres_problem.NumResidualBlocks() == 0) return report;
  auto* ordering = new ceres::ParameterBlockOrdering;
  HoldFixed(ceres_problem, problem.shape.data(), BoardShape::kSize, problem.free_shape);
  ordering->AddElementToGroup(problem.shape.data(), 1);
  for (size_t c = 0; c < rigs.size(); ++c) {
    if (!ceres_problem.HasParameterBlock(rigs[c].data())) continue;
    HoldFixed(ceres_problem, params[c].data(), static_cast<int>(params[c].size()), problem.cameras[c].free);
    ceres_problem.SetManifold(rigs[c].data(), new Rigid3Manifold);
    if (c == 0 || !problem.free_extrinsics) ceres_problem.SetParameterBlockConstant(rigs[c].data());
    ordering->AddElementToGroup(params[c].data(), 1);
    ordering->AddElementToGroup(rigs[c].data(), 1);
  }
  for (size_t f = 0; f < frames.size(); ++f) {
    if (!ceres_problem.HasParameterBlock(frames[f].data())) continue;
    ceres_problem.SetManifold(frames[f].data(), new Rigid3Manifold);
    if (!problem.free_frames) ceres_problem.SetParameterBlockConstant(frames[f].data());
    ordering->AddElementToGroup(frames[f].data(), 0);
  }
  ceres::Solver::Options options;
  const bool more_than_poses = MoreThanPosesFree(problem);
  options.linear_solver_type = more_than_poses ? ceres::DENSE_SCHUR : ceres::SPARSE_NORMAL_CHOLESKY;
  const std::shared_ptr<ceres::ParameterBlockOrdering> poses_first(ordering);
  if (more_than_poses) options.linear_solver_ordering = poses_first;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-10;
  options.parameter_tolerance = 1e-10;
  options.num_threads = 1;  // several don't repeat bit for bit
  options.logging_type = ceres::SILENT;
  CancelCallback callback(cancel);
  options.callbacks.push_back(&callback);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  cancel.ThrowIfCancelled();
  report.usable = summary.IsSolutionUsable();
  report.iterations = static_cast<int>(summary.iterations.size());
  report.cost_before = summary.initial_cost;
  report.cost_after = summary.final_cost;
  if (report.usable) blocks.WriteTo(problem);
  return report;
}

int FreeParameters(const BoardProblem& problem) {
  size_t count = problem.free_shape.size();
  for (const CameraState& camera : problem.cameras) count += camera.free.size();
  if (problem.free_extrinsics) count += 6 * (problem.cameras.size() - 1);
  for (bool used : problem.frame_used) count += used ? 6 : 0;
  return static_cast<int>(count);
}

Eigen::MatrixXd ReducedCovariance(const BoardProblem& problem, bool* determined) {
  std::vector<Eigen::Index> camera_at, rig_at;
  Eigen::Index size = 0;
  for (const CameraState& camera : problem.cameras) {
    camera_at.push_back(size);
    size += static_cast<Eigen::Index>(camera.free.size());
  }
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    rig_at.push_back(c == 0 ? -1 : size);
    if (c > 0) size += 6;
  }
  const Eigen::Index shape_at = size;
  size += static_cast<Eigen::Index>(problem.free_shape.size());

  Eigen::MatrixXd reduced = Eigen::MatrixXd::Zero(size, size);
  std::vector<std::vector<const BoardObservation*>> by_frame(problem.rig_from_board.size());
  for (const BoardObservation& o : problem.observations) {
    if (problem.IsActive(o)) by_frame[static_cast<size_t>(o.frame)].push_back(&o);
  }
  for (size_t f = 0; f < by_frame.size(); ++f) {
    if (by_frame[f].empty()) continue;
    Matrix6d pose = Matrix6d::Zero();
    Eigen::MatrixXd across = Eigen::MatrixXd::Zero(size, 6);
    for (const BoardObservation* o : by_frame[f]) {
      const auto c = static_cast<size_t>(o->camera);
      const CameraState& camera = problem.cameras[c];
      Derivatives d;
      Eigen::Vector2d raw = Eigen::Vector2d::Zero();
      if (!Residual(*problem.board, camera.model, camera.square_pixels, camera.params, camera.cam_from_rig,
                    problem.rig_from_board[f], problem.shape, o->point, o->pixel, &raw, &d)) {
        continue;
      }
      Matrix2X row = Matrix2X::Zero(2, size);
      for (size_t i = 0; i < camera.free.size(); ++i)
        row.col(camera_at[c] + static_cast<Eigen::Index>(i)) = d.by_params.col(camera.free[i]);
      if (c > 0) row.middleCols<6>(rig_at[c]) = d.by_rig;
      for (size_t i = 0; i < problem.free_shape.size(); ++i)
        row.col(shape_at + static_cast<Eigen::Index>(i)) = d.by_shape.col(problem.free_shape[i]);
      const double w = 1 / (camera.sigma_px * camera.sigma_px);
      reduced.noalias() += w * row.transpose() * row;
      across.noalias() += w * row.transpose() * d.by_frame;
      pose.noalias() += w * d.by_frame.transpose() * d.by_frame;
    }
    reduced.noalias() -= across * pose.ldlt().solve(across.transpose());
  }
  // Scaled to a unit diagonal, so that "singular" doesn't depend on units.
  const Eigen::VectorXd scale = reduced.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * (0.5 * (reduced + reduced.transpose())) * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  constexpr double kSingular = 1e-13;
  *determined = size == 0 || eigen.eigenvalues().minCoeff() > kSingular;
  const Eigen::MatrixXd inverse = eigen.eigenvectors() *
                                  eigen.eigenvalues().cwiseMax(kSingular).cwiseInverse().asDiagonal() *
                                  eigen.eigenvectors().transpose();
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace trigpoint
