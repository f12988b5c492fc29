// Least squares over a chain of body poses that see tags known with a covariance: the solver behind reference_poses.h.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/base/progress.h"
#include "survey/tags/tag_residual.h"

namespace trigpoint {

struct ChainObservation {
  TagSight sight;
  double size_m = 0;
  Rigid3d cam_from_body;
  int body = 0, tag = 0;
  bool rejected = false;  // by the solver
  double rms_px = 0;      // after the solution
};

// r_R = Log(Rm' Ra' Rb) / sigma_rot (rad), r_t = (Ra' (tb - ta) - s tm) / sigma_m (m)
struct ChainMotion {
  int a = 0, b = 0;
  Rigid3d a_from_b;
  double sigma_rot_rad = 1, sigma_m = 1;
};

struct ChainProblem {
  std::vector<Rigid3d> bodies;     // world_from_body, start and solution
  std::vector<bool> free;          // a body that is not free is held
  std::vector<Rigid3d> tags;       // world_from_tag, the map's; refined by the solution
  Eigen::MatrixXd tag_covariance;  // joint, 6 a tag, left tangent, rotation first
  std::vector<ChainObservation> observations;
  std::vector<ChainMotion> motions;
  double scale = 1, scale_sigma = 0.01;                                  // of the motion: metres = scale * motion
  double corner_factor = 1, motion_rot_factor = 1, motion_m_factor = 1;  // on the sigmas
};

struct ChainOptions {
  double gate_chi2 = 31.8;
  int variance_rounds = 3;
  int max_iterations = 30;
};

struct ChainSolution {
  std::vector<Matrix6d> body_covariance;  // left tangent, rotation first; zero for a body that is held
  double scale_sigma = 0;
  int iterations = 0;
  double cost = 0;
};

// Throws NumericError if the equations are singular, Cancelled.
ChainSolution SolveChain(ChainProblem* problem, const ChainOptions& options, ProgressSink& progress,
                         const CancelToken& cancel);

}  // namespace trigpoint
