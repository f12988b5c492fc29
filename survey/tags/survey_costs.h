// Cost functions of the tag map. Poses are 7-blocks with Rigid3Manifold; residuals are predicted minus observed,
// whitened. `scale` points at a factor on the sigma that variance component estimation sets between solves.
#pragma once

#include <ceres/sized_cost_function.h>

#include <array>

#include "calib/camera/camera.h"
#include "calib/estimation/manifold.h"
#include "survey/tags/tag_residual.h"

namespace trigpoint {

// Corners of one tag in one picture: world_from_body, world_from_tag, shift of the camera's corners -> 8 (px / sigma).
// See tag_residual.h. A detector may draw corners towards the tag's centre: the observed corners are taken to lie
// `shift` px farther out.
class TagCost final : public ceres::SizedCostFunction<8, 7, 7, 1> {
 public:
  TagCost(const TagSight& sight, double size_m, const Rigid3d& cam_from_body, const double* scale)
      : sight_(sight), size_m_(size_m), cam_from_body_(cam_from_body), scale_(scale) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  TagSight sight_;
  double size_m_;
  Rigid3d cam_from_body_;
  const double* scale_;
};

// A camera with five of its numbers moved: log of the focal length, principal point (px), first two coefficients of
// distortion. A pinhole becomes a radtan camera.
constexpr int kCameraNumbers = 5;
Camera AdjustedCamera(const Camera& camera, const double* change);

// Corners of one tag in pixels, where the camera is estimated, too: world_from_body, world_from_tag, change of the
// camera
// -> 8 (px / sigma).
class TagPixelCost final : public ceres::SizedCostFunction<8, 7, 7, kCameraNumbers> {
 public:
  TagPixelCost(const Camera& camera, const TagDetection& detection, const std::array<double, 4>& sigma_px,
               double size_m, const Rigid3d& cam_from_body, const double* scale)
      : camera_(camera),
        corners_(detection.corners),
        sigma_px_(sigma_px),
        size_m_(size_m),
        cam_from_body_(cam_from_body),
        scale_(scale) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Camera camera_;
  std::array<Eigen::Vector2d, 4> corners_;
  std::array<double, 4> sigma_px_;
  double size_m_;
  Rigid3d cam_from_body_;
  const double* scale_;
};

// Odometry between two body poses: world_from_a, world_from_b, scale of the odometry, drift of its heading -> 6:
//   r_R = (Log(Rm' Ra' Rb) - drift * way) / sigma_R           (rad)
//   r_t = (Ra' (tb - ta) / s - tm) / sigma_t                 (m of the odometry)
// It is what was measured that is noisy: s tm would take the noise of many short steps for a scale that is too small.
// way: length of the way between them, m, along odometry's z axis in the body's frame at b; drift: rad/m about it.
class OdometryCost final : public ceres::SizedCostFunction<6, 7, 7, 1, 1> {
 public:
  // `factor`: six factors on the sigmas.
  OdometryCost(const Rigid3d& a_from_b, const Eigen::Vector3d& way, const Vector6d& sigma, const double* factor)
      : a_from_b_(a_from_b), way_(way), sigma_(sigma), factor_(factor) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Rigid3d a_from_b_;
  Eigen::Vector3d way_;
  Vector6d sigma_;
  const double* factor_;
};

// 1 sigma of odometry over a step: a random walk over the way travelled; a standing robot drifts a little with time.
Vector6d OdometryStepSigma(double length_m, double seconds, double rotation_deg, double translation_m);

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

// The same where the known coordinates belong to a datum of their own: world_from_x, shift (m) -> 3:
//   r = sqrt_info (R lever + t + offset + shift - point)
class ShiftedPointCost final : public ceres::SizedCostFunction<3, 7, 3> {
 public:
  ShiftedPointCost(const Eigen::Vector3d& lever, const Eigen::Vector3d& offset, const Eigen::Vector3d& point,
                   const Eigen::Vector3d& sigma)
      : point_(lever, offset, point, sigma), inverse_sigma_(sigma.cwiseInverse()) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  PointCost point_;
  Eigen::Vector3d inverse_sigma_;
};

// A pose near a known one: world_from_x -> 6, left tangent over sigma. An infinite sigma leaves its component free.
class PosePriorCost final : public ceres::SizedCostFunction<6, 7> {
 public:
  PosePriorCost(const Rigid3d& known, const Vector6d& sigma) : known_(known), inverse_sigma_(sigma.cwiseInverse()) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Rigid3d known_;
  Vector6d inverse_sigma_;
};

// Which way is up in the body, as levelled odometry says: world_from_body -> 3 (rad): r = (R' z - up) / sigma.
class GravityCost final : public ceres::SizedCostFunction<3, 7> {
 public:
  GravityCost(const Eigen::Vector3d& up_in_body, double sigma_rad) : up_(up_in_body), sigma_(sigma_rad) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d up_;
  double sigma_;
};

// A tag's centre at a known height: world_from_tag -> 1 (m).
class HeightCost final : public ceres::SizedCostFunction<1, 7> {
 public:
  HeightCost(double height_m, double sigma_m) : height_m_(height_m), sigma_m_(sigma_m) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double height_m_, sigma_m_;
};

// A point marked in a picture: world_from_body, point -> 2 (px / sigma): W (unit ray), W * observed ray = 0.
class MarkCost final : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  MarkCost(const Eigen::Matrix<double, 2, 3>& w, const Rigid3d& cam_from_body) : w_(w), cam_from_body_(cam_from_body) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Matrix<double, 2, 3> w_;
  Rigid3d cam_from_body_;
};

// A point against known coordinates: point -> 3 (m).
class KnownPointCost final : public ceres::SizedCostFunction<3, 3> {
 public:
  KnownPointCost(const Eigen::Vector3d& point, const Eigen::Vector3d& sigma)
      : point_(point), inverse_sigma_(sigma.cwiseInverse()) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d point_, inverse_sigma_;
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

// ln number / sigma: known to a factor.
class FactorCost final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit FactorCost(double log_sigma) : log_sigma_(log_sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double log_sigma_;
};

}  // namespace trigpoint
