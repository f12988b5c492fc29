// What errors of a run's answers have in common: its images, its length, its fit to the Earth.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/io/site.h"
#include "datasets/solution/solution.h"
#include "eval/errors/results.h"

namespace trigpoint {

// Of a vector for each panorama.
struct JointCovariance {
  std::map<std::string, Eigen::Index> at;  // panorama -> the first of its three rows and columns
  Eigen::MatrixXd m2;

  // Unset if one of them is not known.
  std::optional<Eigen::Matrix3d> Between(const std::string& a, const std::string& b) const;
};

// ENU, m^2.
struct AnswerCovariances {
  JointCovariance absolute;  // of positions in the world
  // Of positions less those that the station's tag gives, a tag whose pose was estimated from the run's cameras: the
  // tag moves with the cameras that show it. Noise of the tag's corners and of the offset is not part of it.
  JointCovariance relative;
};

// tag -> image of the solution, derivative of the tag's pose by the camera's (left tangents, odom axes).
using TagDerivatives = std::map<int, std::vector<std::pair<int, Matrix6d>>>;

// By the solution's normal equations, at the length that the fit to the Earth gives it. `tags`: odom_from_tag. Empty
// without a georeference. Throws NumericError if the solution is not fixed by its data. Time is linear in the images.
AnswerCovariances CovariancesOfAnswers(const Solution& solution, const std::vector<TagResult>& tags,
                                       const TagDerivatives& by_camera, const std::vector<Station>& stations,
                                       int threads, const CancelToken& cancel);

}  // namespace trigpoint
