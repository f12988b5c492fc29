// The least-squares problem behind CalibrateCameras. Private to this folder.
#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <vector>

#include "calib/target/calibrate.h"

namespace trigpoint {

// The board's points under a shape.
class BoardGeometry {
 public:
  explicit BoardGeometry(const Target& target);
  // Board frame, m. `by_shape`: d point / d shape, 3 x 6.
  Eigen::Vector3d Point(int id, const Eigen::Matrix<double, 6, 1>& shape,
                        Eigen::Matrix<double, 3, 6>* by_shape = nullptr) const;
  int size() const { return static_cast<int>(points_.size()); }
  Eigen::Vector3d Middle() const { return middle_; }

 private:
  std::vector<Eigen::Vector3d> points_;
  std::vector<Eigen::Vector2d> normalised_;  // -1 to 1
  std::vector<Eigen::Vector2d> gaps_;        // gaps between tags before the point
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
};

struct BoardObservation {
  int camera = 0, frame = 0, view = 0, point = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  bool used = true;
};

struct CameraState {
  CameraModel model = CameraModel::kPinhole;
  std::vector<double> params;
  std::vector<int> free;  // indices of params that are estimated
  bool square_pixels = false;
  Rigid3d cam_from_rig;
  double sigma_px = 1;
};

struct BoardProblem {
  const BoardGeometry* board = nullptr;
  std::vector<CameraState> cameras;
  std::vector<Rigid3d> rig_from_board;
  std::vector<bool> frame_used;
  Eigen::Matrix<double, 6, 1> shape = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<int> free_shape;
  bool free_extrinsics = true;
  bool free_frames = true;
  std::vector<BoardObservation> observations;

  bool IsActive(const BoardObservation& o) const { return o.used && frame_used[static_cast<size_t>(o.frame)]; }
};

struct SolveReport {
  bool usable = false;
  int iterations = 0;
  double cost_before = 0, cost_after = 0;
};

// predicted - observed, px; false where there is no projection.
bool BoardResidual(const BoardProblem& problem, const BoardObservation& observation, Eigen::Vector2d* residual);

// Minimises over what is free, one thread. `loss` of the whitened squared residual, null: least squares.
SolveReport SolveBoardProblem(BoardProblem& problem, ceres::LossFunction* loss, int max_iterations,
                              const CancelToken& cancel);

// Covariance of what is free apart from the board poses, in units of the whitened residuals: each camera's free
// parameters, then cam_from_rig (tangents) of all cameras but the first, then the free shape. `determined` is false if
// the system is singular to working precision; what is undetermined then has a huge variance.
Eigen::MatrixXd ReducedCovariance(const BoardProblem& problem, bool* determined);
// Free parameters in all, board poses included.
int FreeParameters(const BoardProblem& problem);

// The focal length (and, at first, nothing else) with which planar poses fit the views of one camera best. Views in
// which no pose was found are absent from `cam_from_board`.
struct CameraStart {
  Camera camera;
  std::vector<std::pair<int, Rigid3d>> cam_from_board;  // (view, pose)
};
CameraStart StartCamera(const CalibrationInput& input, int camera, CameraModel model, const BoardGeometry& board);

// Pose of the board in one view, best first (a plane has two); empty if the points are degenerate.
std::vector<Rigid3d> BoardPoses(const Camera& camera, const BoardGeometry& board,
                                const std::vector<BoardPoint>& points);
// Root mean square distance of the points, px; infinite if one has no projection.
double BoardRms(const Camera& camera, const BoardGeometry& board, const Rigid3d& cam_from_board,
                const std::vector<BoardPoint>& points);

}  // namespace trigpoint
