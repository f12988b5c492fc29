#include "calib/camera/rolling_shutter.h"

#include <algorithm>

namespace trigpoint {

MotionRate RateBetween(const Rigid3d& target_from_a, const Rigid3d& target_from_b, const Rigid3d& target_from_between,
                       double seconds) {
  MotionRate rate;
  rate.omega = LogSO3(target_from_a.rotation.conjugate() * target_from_b.rotation) / seconds;
  rate.velocity =
      target_from_between.rotation.conjugate() * (target_from_b.translation - target_from_a.translation) / seconds;
  rate.known = true;
  return rate;
}

MotionRate RateOfCamera(const MotionRate& body, const Rigid3d& cam_from_body) {
  MotionRate rate = body;
  const Eigen::Vector3d arm = cam_from_body.TargetOriginInSource();
  rate.omega = cam_from_body.rotation * body.omega;
  rate.velocity = cam_from_body.rotation * (body.velocity + body.omega.cross(arm));
  return rate;
}

double RowOffset(const Camera& camera, double v) { return v / std::max(1, camera.height() - 1) - 0.5; }

Eigen::Vector2d PixelAtImageTime(const Camera& camera, double readout_s, const Eigen::Vector2d& pixel,
                                 const MotionRate& rate, double inverse_distance) {
  const auto ray = camera.Unproject(pixel);
  if (!ray || !rate.known || readout_s == 0) return pixel;
  const double dt = readout_s * RowOffset(camera, pixel.y());
  const Eigen::Vector3d moved = ExpSO3(dt * rate.omega) * *ray + dt * inverse_distance * rate.velocity;
  return camera.Project(moved).value_or(pixel);
}

}  // namespace trigpoint
