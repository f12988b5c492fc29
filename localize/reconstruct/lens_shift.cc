#include "localize/reconstruct/lens_shift.h"

#include <cmath>

namespace trigpoint {
namespace {

std::optional<Eigen::Matrix<double, 3, 2>> RayByPixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  constexpr double kStep = 0.25;
  Eigen::Matrix<double, 3, 2> j;
  for (int i = 0; i < 2; ++i) {
    const auto more = camera.Unproject(pixel + kStep * Eigen::Vector2d::Unit(i));
    const auto less = camera.Unproject(pixel - kStep * Eigen::Vector2d::Unit(i));
    if (!more || !less) return std::nullopt;
    j.col(i) = (*more - *less) / (2 * kStep);
  }
  return j;
}

struct RayCost {
  Rigid3d cam_from_body;
  Eigen::Matrix<double, 2, 3> w;
  Eigen::Vector3d ray;
  LensShift whitened_shift;
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* lens, T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_cam = InCamera(cam_from_body, pose, point);
    if (in_cam.squaredNorm() < T(1e-12)) return false;
    Eigen::Map<Eigen::Matrix<T, 2, 1>>{residual} =
        w.cast<T>() * (in_cam.normalized() - ray.cast<T>()) +
        whitened_shift.cast<T>() * Eigen::Map<const Eigen::Matrix<T, kLensParameters, 1>>(lens);
    return true;
  }
};

}  // namespace

double HalfDiagonal(const Camera& camera) { return 0.5 * std::hypot(camera.width(), camera.height()); }

LensShift ShiftOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d d = pixel - 0.5 * Eigen::Vector2d(camera.width() - 1, camera.height() - 1);
  const double r2 = d.squaredNorm() / std::pow(HalfDiagonal(camera), 2);
  LensShift s;
  s << d, Eigen::Matrix2d::Identity(), r2 * d, r2 * r2 * d;
  return s;
}

bool WhitenedShift(const Camera& camera, const Eigen::Vector2d& pixel, const Eigen::Matrix<double, 2, 3>& w,
                   LensShift* shift) {
  const auto by_pixel = RayByPixel(camera, pixel);
  if (by_pixel) *shift = w * *by_pixel * ShiftOf(camera, pixel);
  return by_pixel.has_value();
}

ceres::CostFunction* RayCostOf(const Rigid3d& cam_from_body, const BearingObservation& o, const LensShift& whitened) {
  return new ceres::AutoDiffCostFunction<RayCost, 2, 6, 3, kLensParameters>(
      new RayCost{cam_from_body, o.w.cast<double>(), o.ray.cast<double>(), whitened});
}

}  // namespace trigpoint
