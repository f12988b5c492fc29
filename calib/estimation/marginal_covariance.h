// What is known of poses and lenses once the points they were found from are given up.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace ceres {
class Problem;
}

namespace trigpoint {

struct MarginalCovariance {
  // The inverse of J^T J for the blocks kept, tangents stacked in order, every point eliminated (Schur complement).
  // What no residual depends on gets zeros; empty if the rest is not determined.
  Eigen::MatrixXd covariance;
  // How many times larger the variance of what is asked for is than that says, by the grouping that shows the most:
  // points of a group may err alike (the outline of one thing before another, one repeated window), and then they count
  // for less than their number. 1 without groups.
  double shared = 1;
};

// `kept` and `points` are free blocks, and the others of the problem are held; a point has three columns or less and
// shares no residual with another point. `groupings`: each one number a point. `shared` is computed for the first
// `asked` tangents kept; -1: for all.
MarginalCovariance Marginalise(ceres::Problem* problem, const std::vector<double*>& kept,
                               const std::vector<double*>& points, const std::vector<std::vector<int>>& groupings,
                               int asked = -1);

}  // namespace trigpoint
