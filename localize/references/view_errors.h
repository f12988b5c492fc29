// How far errors of references' views, which no residual shows, move the poses of a solution (docs/method.md section
// 4).
#pragma once

#include <vector>

#include "calib/estimation/bundle.h"
#include "localize/reconstruct/frames.h"

namespace trigpoint {

// The views of a reference in a bundle problem.
struct PlacedViews {
  int pose = -1;   // the reference's; -1: not part of the problem
  int first = -1;  // of them, index into BundleProblem::views; -1: likewise
  double focal_px = 0;
  ViewErrors errors;
};

// How far the poses of `p`, which is solved, move (left tangent [rotation (rad), translation (m)], 6 rows a pose) with
// each error of the views, of one sigma and independent of the others: columns for BundleProblem::pose_shifts, which
// must be empty. By the implicit function theorem, to first order,
//   d poses / d error = -H^-1 d gradient / d error
// with the points eliminated from both. Nothing if all views are exact. Throws NumericError if the data do not
// determine `p`.
Eigen::MatrixXd PoseShiftsByViews(const std::vector<PlacedViews>& references, const BundleProblem& p, int threads,
                                  const CancelToken& cancel);

}  // namespace trigpoint
