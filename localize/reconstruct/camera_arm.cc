#include "localize/reconstruct/camera_arm.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "calib/geo/geodetic.h"
#include "calib/geometry/so3.h"
#include "localize/reconstruct/odometry_parameters.h"

namespace trigpoint {
namespace {

// Rotation of the body about its origin, its translation (m), odometry's scale.
constexpr Eigen::Index kParameters = 7;

constexpr double kMountSigma_rad = 1 * kDegToRad;  // 1 sigma of what a calibration states
constexpr double kArmSigma_m = 1;                  // wide: it is looked for
constexpr double kKnown_m = 0.1;                   // 1 sigma of a direction that counts
constexpr double kLeast_m = 0.1, kSigmas = 5;

// Where the body is placed otherwise in its cameras, which stay where they are.
Vector6d ResidualOf(const BundleProblem& p, const PoseFactor& f, const Eigen::VectorXd& x) {
  const Rigid3d moved(Eigen::Quaterniond(ExpSO3(x.head<3>())), x.segment<3>(3));
  const Rigid3d predicted =
      moved * p.poses[static_cast<size_t>(f.a)] * p.poses[static_cast<size_t>(f.b)].Inverse() * moved.Inverse();
  Rigid3d measured = f.measured;
  measured.translation *= 1 + x(6);
  return f.sqrt_info * predicted.Minus(measured);
}

}  // namespace

std::optional<ArmError> FindArmError(const Reconstruction& r, double scale_sigma, int threads,
                                     const CancelToken& cancel) {
  const BundleProblem& p = r.problem;
  Eigen::VectorXd sigmas(kParameters);
  sigmas << Eigen::Vector3d::Constant(kMountSigma_rad), Eigen::Vector3d::Constant(kArmSigma_m), scale_sigma;
  const auto residual = [&](const PoseFactor& f, const Eigen::VectorXd& x) { return ResidualOf(p, f, x); };
  const ParameterEstimate found =
      OdometryParameters(p, residual, sigmas, threads, cancel).Estimate({0, 1, 2, 3, 4, 5, 6});
  const Eigen::Vector3d arm = found.value.segment<3>(3);
  const Eigen::Matrix3d covariance = found.covariance.block<3, 3>(3, 3);
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
