#include "calib/estimation/bundle_terms.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "calib/estimation/manifold.h"

namespace trigpoint {
namespace {

// e and its derivatives by both poses' left tangents, not whitened yet.
void EvaluateTwoView(const BundleProblem& p, const PoseFactor& f, Vector6d* e, Matrix6d* ja, Matrix6d* jb) {
  const Rigid3d& view_a = p.views[static_cast<size_t>(f.view_a)];
  const Rigid3d& view_b = p.views[static_cast<size_t>(f.view_b)];
  const Rigid3d a = view_a * p.poses[static_cast<size_t>(f.a)], b = view_b * p.poses[static_cast<size_t>(f.b)];
  const Rigid3d a_from_b = a * b.Inverse();
  const double length = std::max(a_from_b.translation.norm(), 1e-9);
  const Eigen::Vector3d u = a_from_b.translation / length;
  e->head<3>() = LogSO3(a_from_b.rotation * f.measured.rotation.conjugate());
  e->tail<3>() = u - f.measured.translation;
  Matrix6d by_a, by_b, outer = Matrix6d::Zero();
  RelativeJacobians(a, b, &by_a, &by_b);
  outer.topLeftCorner<3, 3>() = LeftJacobianInverseSO3(e->head<3>());
  outer.bottomRightCorner<3, 3>() = (Eigen::Matrix3d::Identity() - u * u.transpose()) / length;
  // A camera on a body: its left tangent is the body's, turned.
  const auto on_body = [](const Rigid3d& view) {
    Matrix6d j = Matrix6d::Zero();
    j.topLeftCorner<3, 3>() = j.bottomRightCorner<3, 3>() = view.rotation.toRotationMatrix();
    return j;
  };
  *ja = outer * by_a * on_body(view_a);
  *jb = outer * by_b * on_body(view_b);
}

// world_from_rig against what is measured: e, not whitened, and its derivatives by the rig's pose and the frame's.
Vector6d EvaluatePlace(const Rigid3d& rig_from_odom, const Rigid3d& world_from_odom, const Rigid3d& measured,
                       Matrix6d* by_rig, Matrix6d* by_frame) {
  const Vector6d e = (world_from_odom * rig_from_odom.Inverse()).Minus(measured);
  RelativeJacobians(world_from_odom, rig_from_odom, by_frame, by_rig);
  const Eigen::Matrix3d jl = LeftJacobianInverseSO3(e.head<3>());
  by_rig->topRows<3>() = (jl * by_rig->topRows<3>()).eval();
  by_frame->topRows<3>() = (jl * by_frame->topRows<3>()).eval();
  return e;
}

// A point of rig b in a view of a: the unit ray to it with its derivatives. Far off where it lies behind the view.
void EvaluateRigPoint(const BundleProblem& p, const PoseFactor& f, Vector6d* e, Matrix6d* ja, Matrix6d* jb) {
  constexpr double kBehind = 1e3;
  const Rigid3d& view = p.views[static_cast<size_t>(f.view_a)];
  const Rigid3d& a = p.poses[static_cast<size_t>(f.a)];
  const Rigid3d& b = p.poses[static_cast<size_t>(f.b)];
  const Eigen::Matrix3d odom_from_b = b.rotation.conjugate().toRotationMatrix();
  const Eigen::Matrix3d view_from_a = view.rotation.toRotationMatrix();
  const Eigen::Vector3d from_b = f.arm - b.translation;
  const Eigen::Vector3d rotated = a.rotation * (odom_from_b * from_b);
  const Eigen::Vector3d q = view_from_a * (rotated + a.translation) + view.translation;
  const double n = std::max(q.norm(), 1e-9);
  const Eigen::Vector3d u = q / n, ray = f.measured.translation;
  e->head<3>() = u;
  if (u.dot(ray) <= 0) {
    e->head<3>() += kBehind * ray.unitOrthogonal();
    return;
  }
  const Eigen::Matrix3d by_a = (Eigen::Matrix3d::Identity() - u * u.transpose()) / n * view_from_a;
  const Eigen::Matrix3d by_odom = by_a * a.rotation.toRotationMatrix() * odom_from_b;
  ja->topLeftCorner<3, 3>() = -by_a * Skew(rotated);
  ja->topRightCorner<3, 3>() = by_a;
  jb->topLeftCorner<3, 3>() = by_odom * Skew(from_b);
  jb->topRightCorner<3, 3>() = -by_odom;
}

}  // namespace

void EvaluateFactor(const BundleProblem& p, const PoseFactor& f, FactorTerms* out) {
  const Rigid3d& a = p.poses[static_cast<size_t>(f.a)];
  out->ja.setZero();
  out->jb.setZero();
  out->js.setZero();
  Vector6d e = Vector6d::Zero();
  switch (f.kind) {
    case PoseFactor::Kind::kBetween: {
      const Rigid3d& b = p.poses[static_cast<size_t>(f.b)];
      const Eigen::Quaterniond q = a.rotation * b.rotation.conjugate();
      const Eigen::Matrix3d rp = q.toRotationMatrix();
      const Eigen::Vector3d rtb = rp * b.translation;
      const double s = f.scale < 0 ? 1.0 : p.scales[static_cast<size_t>(f.scale)].value;
      e.head<3>() = LogSO3(q * f.measured.rotation.conjugate());
      e.tail<3>() = a.translation - rtb - s * f.measured.translation;
      const Eigen::Matrix3d jl = LeftJacobianInverseSO3(e.head<3>());
      out->ja.topLeftCorner<3, 3>() = jl;
      out->ja.bottomLeftCorner<3, 3>() = Skew(rtb);
      out->ja.bottomRightCorner<3, 3>().setIdentity();
      out->jb.topLeftCorner<3, 3>() = -jl * rp;
      out->jb.bottomLeftCorner<3, 3>() = -Skew(rtb) * rp;
      out->jb.bottomRightCorner<3, 3>() = -rp;
      if (f.scale >= 0) out->js.tail<3>() = -f.measured.translation;
      break;
    }
    case PoseFactor::Kind::kTwoView: EvaluateTwoView(p, f, &e, &out->ja, &out->jb); break;
    case PoseFactor::Kind::kPrior: {
      e = a.Minus(f.measured);
      out->ja.topLeftCorner<3, 3>() = LeftJacobianInverseSO3(e.head<3>());
      out->ja.bottomRightCorner<3, 3>().setIdentity();
      break;
    }
    case PoseFactor::Kind::kGeotag: {
      const Rigid3d frame = f.b < 0 ? Rigid3d() : p.poses[static_cast<size_t>(f.b)];
      e = EvaluatePlace(a, frame, f.measured, &out->ja, &out->jb);
      break;
    }
    case PoseFactor::Kind::kPosition: {
      const Rigid3d frame = f.b < 0 ? Rigid3d() : p.poses[static_cast<size_t>(f.b)];
      const Rigid3d world_from_rig = frame * a.Inverse();
      e.tail<3>() = world_from_rig * f.arm - f.measured.translation;
      RelativeJacobians(frame, a, &out->jb, &out->ja);
      Matrix6d of_point = Matrix6d::Zero();
      of_point.bottomLeftCorner<3, 3>() = -Skew(world_from_rig.rotation * f.arm);
      of_point.bottomRightCorner<3, 3>().setIdentity();
      out->ja = (of_point * out->ja).eval();
      out->jb = (of_point * out->jb).eval();
      break;
    }
    case PoseFactor::Kind::kRigPoint: EvaluateRigPoint(p, f, &e, &out->ja, &out->jb); break;
  }
  if (f.b < 0) out->jb.setZero();
  out->r = f.sqrt_info * e;
  out->ja = f.sqrt_info * out->ja;
  out->jb = f.sqrt_info * out->jb;
  out->js = f.sqrt_info * out->js;
}

MapTerms EvaluateMap(const BundleProblem& p, const MapFactor& map) {
  const auto n = static_cast<Eigen::Index>(map.rigs.size());
  const bool framed = map.frame >= 0;
  const Rigid3d frame = framed ? p.poses[static_cast<size_t>(map.frame)] : Rigid3d();
  MapTerms t{Eigen::VectorXd::Zero(6 * n), Eigen::MatrixXd::Zero(6 * n, 6 * n + (framed ? 6 : 0))};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Rigid3d& rig = p.poses[static_cast<size_t>(map.rigs[static_cast<size_t>(i)])];
    Matrix6d by_rig, by_frame;
    t.r.segment<6>(6 * i) = EvaluatePlace(rig, frame, map.measured[static_cast<size_t>(i)], &by_rig, &by_frame);
    t.j.block<6, 6>(6 * i, 6 * i) = by_rig;
    if (framed) t.j.block<6, 6>(6 * i, 6 * n) = by_frame;
  }
  t.r = (map.sqrt_info * t.r).eval();
  t.j = (map.sqrt_info * t.j).eval();
  return t;
}

}  // namespace trigpoint
