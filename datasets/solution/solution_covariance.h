// Joint covariances of a solution's poses, solved for on demand.
#pragma once

#include <vector>

#include "datasets/solution/solution.h"

namespace trigpoint {

class SolutionCovariance {
 public:
  // Factors the solution's normal equations: seconds for thousands of images. `solution` must stay where it is.
  // free_scale: the odometry's length is known to scale_sigma only, else it is held; in world the georeference brings
  // its uncertainty, so it must be held. Throws NumericError if something is not fixed by the data.
  SolutionCovariance(const Solution& solution, bool free_scale, int threads, const CancelToken& cancel);

  // Of odom_from_rig of the given poses (indices into problem.poses, left tangents, odom axes), jointly: 6 rows and
  // columns each.
  Eigen::MatrixXd Odom(const std::vector<int>& poses) const;
  // The same of world_from_rig. Needs a georeference.
  Eigen::MatrixXd World(const std::vector<int>& poses) const;

 private:
  const Solution& solution_;
  BundleCovariance covariance_;
};

// Fills in the covariances of a solution's poses, at the odometry's scale held. Throws NumericError as above.
void AddCovariances(Solution* solution, int threads, const CancelToken& cancel);

// Of one pose, from what the solution holds: nothing to be solved. Need covariances; and a georeference for world.
Matrix6d OdomCovariance(const Solution& solution, int pose);
Matrix6d WorldCovariance(const Solution& solution, int pose);

// Of something rigidly mounted on what `covariance` (left tangent of frame_from_rig) is about.
Matrix6d MountedCovariance(const Rigid3d& frame_from_rig, const Matrix6d& covariance, const Rigid3d& rig_from_x);

}  // namespace trigpoint
