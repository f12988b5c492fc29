#include "calib/estimation/bundle_terms.h"

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
      const double s = f.scaled ? p.scale : 1.0;
      e.head<3>() = LogSO3(q * f.measured.rotation.conjugate());
      e.tail<3>() = a.translation - rtb - s * f.measured.translation;
      const Eigen::Matrix3d jl = LeftJacobianInverseSO3(e.head<3>());
      out->ja.topLeftCorner<3, 3>() = jl;
      out->ja.bottomLeftCorner<3, 3>() = Skew(rtb);
      out->ja.bottomRightCorner<3, 3>().setIdentity();
      out->jb.topLeftCorner<3, 3>() = -jl * rp;
      out->jb.bottomLeftCorner<3, 3>() = -Skew(rtb) * rp;
      out->jb.bottomRightCorner<3, 3>() = -rp;
      if (f.scaled) out->js.tail<3>() = -f.measured.translation;
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
      const Rigid3d inverse = a.Inverse();
      e = inverse.Minus(f.measured);
      const Eigen::Matrix3d rt = inverse.rotation.toRotationMatrix();
      out->ja.topLeftCorner<3, 3>() = -LeftJacobianInverseSO3(e.head<3>()) * rt;
      out->ja.bottomLeftCorner<3, 3>() = -rt * Skew(a.translation);
      out->ja.bottomRightCorner<3, 3>() = -rt;
      break;
    }
    case PoseFactor::Kind::kPosition: {
      const Eigen::Matrix3d rt = a.rotation.conjugate().toRotationMatrix();
      const Eigen::Vector3d d = f.arm - a.translation;
      e.tail<3>() = rt * d - f.measured.translation;
      out->ja.bottomLeftCorner<3, 3>() = rt * Skew(d);
      out->ja.bottomRightCorner<3, 3>() = -rt;
      break;
    }
  }
  out->r = f.sqrt_info * e;
  out->ja = f.sqrt_info * out->ja;
  out->jb = f.sqrt_info * out->jb;
  out->js = f.sqrt_info * out->js;
}

}  // namespace trigpoint
