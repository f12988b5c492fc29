#include "survey/tags/planar_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <opencv2/calib3d.hpp>

#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

// Levenberg-Marquardt of one pose on its own corners.
void RefinePose(const TagSight& sight, double size_m, PlanarPose* pose) {
  const Rigid3d identity;
  const auto evaluate = [&](const Rigid3d& t, Matrix86d* j) {
    return TagResidual(sight, size_m, identity, identity, t, nullptr, j);
  };
  Matrix86d j;
  Vector8d r = evaluate(pose->cam_from_tag, &j);
  double lambda = 1e-6;
  for (int i = 0; i < 30; ++i) {
    Matrix6d a = j.transpose() * j;
    a.diagonal() *= 1 + lambda;
    const Vector6d step = -a.ldlt().solve(j.transpose() * r);
    if (!step.allFinite()) break;
    const Rigid3d next = pose->cam_from_tag.Plus(step);
    Matrix86d j_next;
    const Vector8d r_next = evaluate(next, &j_next);
    const double gain = r.squaredNorm() - r_next.squaredNorm();
    if (gain < 0) {
      lambda = std::max(lambda, 1e-6) * 10;
      if (lambda > 1e6) break;
      continue;
    }
    pose->cam_from_tag = next;
    r = r_next;
    j = j_next;
    lambda *= 0.1;
    if (gain < 1e-12 * (1 + r.squaredNorm())) break;
  }
  pose->chi2 = r.squaredNorm();
  pose->rms_px = ResidualPx(sight, r);
}

}  // namespace

std::vector<PlanarPose> EstimatePlanarPoses(const TagSight& sight, double size_m) {
  const Eigen::Vector3d axis = (sight.rays[0] + sight.rays[1] + sight.rays[2] + sight.rays[3]).normalized();
  Eigen::Matrix3d local_from_cam;
  local_from_cam.topRows<2>() = TangentBasis(axis);
  local_from_cam.row(2) = axis.transpose();
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d ray = local_from_cam * sight.rays[k];
    if (ray.z() < 0.05) return {};
    const Eigen::Vector3d corner = TagCorner(size_m, k);
    object.emplace_back(corner.x(), corner.y(), 0);
    image.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
  }
  for (int k = 0; k < 4; ++k) {  // a convex quadrangle, seen from its printed side
    const cv::Point2d a = image[(k + 1) % 4] - image[k], b = image[(k + 2) % 4] - image[(k + 1) % 4];
    if (a.x * b.y - a.y * b.x >= 0) return {};
  }
  std::vector<cv::Mat> rotations, translations;
  cv::solvePnPGeneric(object, image, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations, translations, false,
                      cv::SOLVEPNP_IPPE);
  std::vector<PlanarPose> poses;
  for (size_t i = 0; i < rotations.size(); ++i) {
    const Eigen::Vector3d w(rotations[i].at<double>(0), rotations[i].at<double>(1), rotations[i].at<double>(2));
    const Eigen::Vector3d t(translations[i].at<double>(0), translations[i].at<double>(1),
                            translations[i].at<double>(2));
    PlanarPose pose;
    pose.cam_from_tag =
        Rigid3d(Eigen::Quaterniond(local_from_cam.transpose()) * ExpSO3(w), local_from_cam.transpose() * t);
    if (!pose.cam_from_tag.IsFinite()) continue;
    RefinePose(sight, size_m, &pose);
    if (!pose.cam_from_tag.IsFinite() || !TagFaces(sight, size_m, pose.cam_from_tag)) continue;
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const PlanarPose& other) {
      return AngleBetween(other.cam_from_tag.rotation, pose.cam_from_tag.rotation) < 1e-4;
    });
    if (!known) poses.push_back(pose);
  }
  std::sort(poses.begin(), poses.end(), [](const PlanarPose& a, const PlanarPose& b) { return a.chi2 < b.chi2; });
  return poses;
}

}  // namespace trigpoint
