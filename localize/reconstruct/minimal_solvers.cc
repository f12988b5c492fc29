#include "localize/reconstruct/minimal_solvers.h"

#include <Eigen/SVD>
#include <opengv/absolute_pose/CentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/NoncentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/methods.hpp>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>

namespace trigpoint {
namespace {

// Depths of a midpoint triangulation: ray a at the origin, ray b (b frame) with b_from_a.
bool InFront(const Rigid3d& b_from_a, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d ra = b_from_a.rotation * a;
  // min |la ra + t - lb b|
  const double c = ra.dot(b), det = 1 - c * c;
  if (det < 1e-12) return true;
  const double ta = ra.dot(b_from_a.translation), tb = b.dot(b_from_a.translation);
  return (c * tb - ta) > 0 && (tb - c * ta) > 0;
}

Rigid3d FromWorldFromCam(const opengv::transformation_t& t) {
  const Rigid3d world_from_cam(Eigen::Quaterniond(Eigen::Matrix3d(t.leftCols<3>())), t.col(3));
  return world_from_cam.Inverse();
}

}  // namespace

std::vector<Rigid3d> FivePointPoses(const std::vector<Eigen::Vector3d>& rays_a,
                                    const std::vector<Eigen::Vector3d>& rays_b, const std::vector<int>& sample) {
  opengv::bearingVectors_t a, b;
  for (int i : sample) {
    a.push_back(rays_a[static_cast<size_t>(i)]);
    b.push_back(rays_b[static_cast<size_t>(i)]);
  }
  // OpenGV: bearing1^T E bearing2 = 0 with the pose 1 from 2; ours is b from a.
  opengv::relative_pose::CentralRelativeAdapter adapter(b, a);
  std::vector<Rigid3d> poses;
  for (const opengv::essential_t& e : opengv::relative_pose::fivept_nister(adapter)) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(e, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
    if (u.determinant() < 0) u.col(2) *= -1;
    if (v.determinant() < 0) v.col(2) *= -1;
    Eigen::Matrix3d w;
    w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    for (const Eigen::Matrix3d& r :
         {Eigen::Matrix3d(u * w * v.transpose()), Eigen::Matrix3d(u * w.transpose() * v.transpose())}) {
      for (double sign : {1.0, -1.0}) {
        const Rigid3d pose(Eigen::Quaterniond(r), sign * u.col(2));
        bool ok = true;
        for (size_t k = 0; k < a.size(); ++k) ok = ok && InFront(pose, a[k], b[k]);
        if (ok) poses.push_back(pose);
      }
    }
  }
  return poses;
}

std::vector<Rigid3d> ThreePointPoses(const std::vector<Eigen::Vector3d>& rays,
                                     const std::vector<Eigen::Vector3d>& points, const std::vector<int>& sample) {
  opengv::bearingVectors_t f;
  opengv::points_t p;
  for (int i : sample) {
    f.push_back(rays[static_cast<size_t>(i)]);
    p.push_back(points[static_cast<size_t>(i)]);
  }
  opengv::absolute_pose::CentralAbsoluteAdapter adapter(f, p);
  std::vector<Rigid3d> poses;
  for (const opengv::transformation_t& t : opengv::absolute_pose::p3p_kneip(adapter)) {
    if (t.allFinite()) poses.push_back(FromWorldFromCam(t));
  }
  return poses;
}

std::vector<Rigid3d> GeneralisedThreePointPoses(const std::vector<Eigen::Vector3d>& rays,
                                                const std::vector<int>& view_of_ray,
                                                const std::vector<Rigid3d>& rig_from_view,
                                                const std::vector<Eigen::Vector3d>& points,
                                                const std::vector<int>& sample) {
  opengv::bearingVectors_t f;
  opengv::points_t p;
  std::vector<int> correspondence;
  opengv::translations_t offsets;
  opengv::rotations_t rotations;
  for (int i : sample) {
    const Rigid3d& view = rig_from_view[static_cast<size_t>(view_of_ray[static_cast<size_t>(i)])];
    correspondence.push_back(static_cast<int>(offsets.size()));
    offsets.push_back(view.translation);
    rotations.push_back(view.rotation.toRotationMatrix());
    f.push_back(rays[static_cast<size_t>(i)]);
    p.push_back(points[static_cast<size_t>(i)]);
  }
  opengv::absolute_pose::NoncentralAbsoluteAdapter adapter(f, correspondence, p, offsets, rotations);
  std::vector<Rigid3d> poses;
  for (const opengv::transformation_t& t : opengv::absolute_pose::gp3p(adapter)) {
    if (t.allFinite()) poses.push_back(FromWorldFromCam(t));
  }
  return poses;
}

}  // namespace trigpoint
