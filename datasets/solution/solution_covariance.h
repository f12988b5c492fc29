// Joint covariances of a solution's poses, solved for on demand.
#pragma once

#include <utility>
#include <vector>

#include "datasets/solution/solution.h"

namespace trigpoint {

// Something that depends on a solution, by its derivatives: as many rows as it has values.
struct SolutionFunction {
  std::vector<std::pair<int, Eigen::MatrixXd>> by_pose;  // by odom_from_rig (left tangent), 6 columns each
  Eigen::MatrixXd by_similarity;  // by the georeference, 7 columns; empty: it does not depend on that
};

// Poses of what is mounted on a rig, 6 values (left tangent). In world the similarity takes it, not the rig, to its
// place: with a run's length, camera centres and points scale, lever arms don't. `pose`: index into problem.poses.
SolutionFunction OdomPose(const Solution& solution, int pose, const Rigid3d& rig_from_x = Rigid3d());
SolutionFunction WorldPose(const Solution& solution, int pose, const Rigid3d& rig_from_x = Rigid3d());
SolutionFunction operator*(const Eigen::MatrixXd& d, const SolutionFunction& f);
SolutionFunction operator+(const SolutionFunction& a, const SolutionFunction& b);

class SolutionCovariance {
 public:
  // Factors the solution's normal equations: seconds for thousands of images. `solution` must stay where it is.
  // free_scale: the odometry's length is known to scale_sigma only, else it is held; in world the georeference brings
  // its uncertainty, so it must be held. Throws NumericError if something is not fixed by the data.
  SolutionCovariance(const Solution& solution, bool free_scale, int threads, const CancelToken& cancel);

  // Of the functions jointly, the first one's rows and columns first.
  Eigen::MatrixXd Of(const std::vector<SolutionFunction>& functions) const;

 private:
  const Solution& solution_;
  BundleCovariance covariance_;
};

// Fills in the covariances of a solution's poses, at the odometry's scale held. Throws NumericError as above.
void AddCovariances(Solution* solution, int threads, const CancelToken& cancel);

// Of one pose, from what the solution holds: nothing to be solved. Need covariances; and a georeference for world.
Matrix6d OdomCovariance(const Solution& solution, int pose);
Matrix6d WorldCovariance(const Solution& solution, int pose);
// The same of an image's world_from_cam, which rides on the body.
Matrix6d ImageWorldCovariance(const Solution& solution, const SolutionImage& image);

}  // namespace trigpoint
