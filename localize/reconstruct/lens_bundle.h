// A part of a reconstruction, adjusted with parameters of its cameras' lenses free.
#pragma once

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <array>
#include <functional>
#include <vector>

#include "calib/estimation/marginal_covariance.h"
#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

inline constexpr int kLeastRedundancy = 200;
inline constexpr int kLensParameters = std::tuple_size_v<LensParameters>;
using PoseParameters = std::array<double, 6>;  // angle axis and translation (m) of body_from_odom

// Images, points and odometry of a reconstruction as a problem of Ceres, which points into it: it stays where it is.
class LensBundle {
 public:
  LensBundle(const Reconstruction& reconstruction, std::vector<LensParameters> lenses);
  LensBundle(const LensBundle&) = delete;
  LensBundle& operator=(const LensBundle&) = delete;

  // The cost of an observation: two residuals of its pose, its point and the lens of its camera; nullptr leaves it out.
  using ObservationCost = std::function<ceres::CostFunction*(const BearingObservation&)>;
  // Observations of the points that most images show, `points_per_image` in each; of a long run some stretches. Errors
  // beyond a few sigmas count less.
  void AddImages(int points_per_image, const ObservationCost& cost);
  // Odometry between the poses of the images added; the first pose of each stretch is held.
  void AddMotion();
  // What is known of a camera's lens without the images; `sigma`: 1 sigma of each parameter.
  void AddPrior(size_t camera, const LensParameters& value, const LensParameters& sigma);

  // Half the sum of squares that is left. Throws NumericError.
  double Solve(int max_iterations);
  // Of the lenses that are free, in order, and of poses behind them; empty where images do not determine them. With
  // `part`, the number of the part of the picture in which an observation lies, `shared` is the variance of the lenses
  // over the one that independent errors would give, at least 1. Errors of the lens model are common to all points of a
  // picture (a rolling shutter) or to all points in one part of the pictures (another distortion).
  MarginalCovariance CovarianceOfLenses(const std::function<int(const BearingObservation&)>& part = {});
  // Divides the squared errors of all observations by `times`.
  void Discount(double times);

  // Is more measured than is estimated, by so much that a few more parameters do not fit chance?
  bool IsRedundant() const { return problem.NumResiduals() - problem.NumParameters() >= kLeastRedundancy; }

  bool HasLens(size_t camera) { return problem.HasParameterBlock(lenses[camera].data()); }

  std::vector<LensParameters> lenses;  // of each camera
  ceres::Problem problem;

 private:
  const Reconstruction& reconstruction_;
  ceres::LossFunctionWrapper loss_;
  std::vector<PoseParameters> poses_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<int> first_;  // of each point: the first observation that was added, -1: none
};

// A point (odometry's frame, m) in the frame of a camera of the body.
template <typename T>
Eigen::Matrix<T, 3, 1> InCamera(const Rigid3d& cam_from_body, const T* pose, const T* point) {
  Eigen::Matrix<T, 3, 1> in_body;
  ceres::AngleAxisRotatePoint(pose, point, in_body.data());
  in_body += Eigen::Map<const Eigen::Matrix<T, 3, 1>>(pose + 3);
  return cam_from_body.rotation.cast<T>() * in_body + cam_from_body.translation.cast<T>();
}

}  // namespace trigpoint
