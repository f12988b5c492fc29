#include "localize/reconstruct/camera_arm.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "calib/geo/geodetic.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

constexpr int kParameters = 7;  // rotation of the body about its origin, its translation (m), odometry's scale
using Parameters = Eigen::Matrix<double, kParameters, 1>;
using ByParameters = Eigen::Matrix<double, 6, kParameters>;

constexpr double kMountSigma_rad = 1 * kDegToRad;  // 1 sigma of what a calibration states
constexpr double kArmSigma_m = 1;                  // wide: it is looked for
constexpr double kKnown_m = 0.1;                   // 1 sigma of a direction that counts
constexpr double kLeast_m = 0.1, kSigmas = 5;

// Whitened odometry residual where the body is placed otherwise in its cameras, which stay where they are.
Vector6d ResidualOf(const BundleProblem& p, const PoseFactor& f, const Parameters& x) {
  const Rigid3d moved(Eigen::Quaterniond(ExpSO3(x.head<3>())), x.segment<3>(3));
  const Rigid3d predicted =
      moved * p.poses[static_cast<size_t>(f.a)] * p.poses[static_cast<size_t>(f.b)].Inverse() * moved.Inverse();
  Rigid3d measured = f.measured;
  measured.translation *= 1 + x(6);
  return f.sqrt_info * predicted.Minus(measured);
}

ByParameters Derivative(const BundleProblem& p, const PoseFactor& f) {
  constexpr double kStep = 1e-5;
  ByParameters j;
  for (int k = 0; k < kParameters; ++k) {
    const Parameters step = kStep * Parameters::Unit(k);
    j.col(k) = (ResidualOf(p, f, step) - ResidualOf(p, f, -step)) / (2 * kStep);
  }
  return j;
}

// The normal equations of the parameters, poses and points moving along.
struct Normals {
  Eigen::Matrix<double, kParameters, kParameters> matrix;
  Parameters right;
};

Normals NormalsOf(const BundleProblem& p, double scale_sigma, int threads, const CancelToken& cancel) {
  Parameters sigma;
  sigma << Eigen::Vector3d::Constant(kMountSigma_rad), Eigen::Vector3d::Constant(kArmSigma_m), scale_sigma;
  Normals normals{sigma.cwiseAbs2().cwiseInverse().asDiagonal(), Parameters::Zero()};
  Eigen::MatrixXd by_poses = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), kParameters);
  for (const PoseFactor& f : p.factors) {
    if (f.kind != PoseFactor::Kind::kBetween) continue;
    const ByParameters j = Derivative(p, f);
    const Vector6d e = ResidualOf(p, f, Parameters::Zero());
    Matrix6d ja, jb;
    RelativeJacobians(p.poses[static_cast<size_t>(f.a)], p.poses[static_cast<size_t>(f.b)], &ja, &jb);
    normals.matrix += f.weight * j.transpose() * j;
    normals.right -= f.weight * j.transpose() * e;
    by_poses.middleRows<6>(6 * f.a) += f.weight * (f.sqrt_info * ja).transpose() * j;
    by_poses.middleRows<6>(6 * f.b) += f.weight * (f.sqrt_info * jb).transpose() * j;
  }
  const BundleCovariance covariance(p, threads, cancel);
  const Eigen::MatrixXd moved = covariance.Times(by_poses);
  normals.matrix -= by_poses.transpose() * moved;
  normals.right += moved.transpose() * covariance.Gradient();
  return normals;
}

}  // namespace

std::optional<ArmError> FindArmError(const Reconstruction& r, double scale_sigma, int threads,
                                     const CancelToken& cancel) {
  const Normals normals = NormalsOf(r.problem, scale_sigma, threads, cancel);
  const Eigen::LDLT<Eigen::Matrix<double, kParameters, kParameters>> ldlt(normals.matrix);
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return std::nullopt;
  const Eigen::Vector3d arm = ldlt.solve(normals.right).segment<3>(3);
  const Eigen::Matrix3d covariance =
      ldlt.solve(Eigen::Matrix<double, kParameters, kParameters>::Identity()).block<3, 3>(3, 3);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  ArmError error;
  for (int i = 0; i < 3; ++i) {
    const double sigma = std::sqrt(std::max(0.0, eigen.eigenvalues()(i)));
    if (!(sigma < kKnown_m)) continue;
    const double along = eigen.eigenvectors().col(i).dot(arm);
    error.arm_m += along * eigen.eigenvectors().col(i);
    error.sigma_m = std::max(error.sigma_m, sigma);
    error.significant |= std::abs(along) > std::max(kLeast_m, kSigmas * sigma);
  }
  if (!(error.sigma_m > 0)) return std::nullopt;
  return error;
}

}  // namespace trigpoint
