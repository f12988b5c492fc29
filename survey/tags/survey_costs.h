// Cost functions of the tag map. Poses are 7-blocks with Rigid3Manifold; residuals are predicted minus observed,
// whitened. `scale` points at a factor on the sigma that variance component estimation sets between solves.
#pragma once

#include <ceres/sized_cost_function.h>

#include "calib/estimation/manifold.h"
#include "survey/tags/tag_residual.h"

namespace trigpoint {

// Corners of one tag in one picture: world_from_body, world_from_tag -> 8 (px / sigma). See tag_residual.h.
class TagCost final : public ceres::SizedCostFunction<8, 7, 7> {
 public:
  TagCost(const TagSight& sight, double size_m, const Rigid3d& cam_from_body, const double* scale)
      : sight_(sight), size_m_(size_m), cam_from_body_(cam_from_body), scale_(scale) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;
  const TagSight& sight() const { return sight_; }

 private:
  TagSight sight_;
  double size_m_;
  Rigid3d cam_from_body_;
  const double* scale_;
};

// Odometry between two body poses: world_from_a, world_from_b, scale of the odometry -> 6:
//   r_R = Log(Rm' Ra' Rb) / sigma_R          (rad)
//   r_t = (Ra' (tb - ta) - s tm) / sigma_t   (m)
class OdometryCost final : public ceres::SizedCostFunction<6, 7, 7, 1> {
 public:
  OdometryCost(const Rigid3d& a_from_b, double sigma_rot_rad, double sigma_m, const double* scale_rot,
               const double* scale_m)
      : a_from_b_(a_from_b), sigma_rot_(sigma_rot_rad), sigma_m_(sigma_m), scale_rot_(scale_rot), scale_m_(scale_m) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Rigid3d a_from_b_;
  double sigma_rot_, sigma_m_;
  const double* scale_rot_;
  const double* scale_m_;
};

// A point fixed to a pose (a tag's centre or corner, an antenna) against known coordinates: world_from_x -> 3 (m):
//   r = sqrt_info (R lever + t + offset - point)
class PointCost final : public ceres::SizedCostFunction<3, 7> {
 public:
  PointCost(const Eigen::Vector3d& lever, const Eigen::Vector3d& offset, const Eigen::Vector3d& point,
            const Eigen::Vector3d& sigma)
      : lever_(lever), wanted_(point - offset), inverse_sigma_(sigma.cwiseInverse()) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d lever_, wanted_, inverse_sigma_;
};

// A measured distance between the centres of two tags: world_from_a, world_from_b -> 1 (m).
class DistanceCost final : public ceres::SizedCostFunction<1, 7, 7> {
 public:
  DistanceCost(double distance_m, double sigma_m) : distance_m_(distance_m), sigma_m_(sigma_m) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double distance_m_, sigma_m_;
};

// A number with a prior: x -> 1.
class NumberCost final : public ceres::SizedCostFunction<1, 1> {
 public:
  NumberCost(double mean, double sigma) : mean_(mean), sigma_(sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double mean_, sigma_;
};

}  // namespace trigpoint
