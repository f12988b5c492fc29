#include "calib/geometry/so3.h"

#include <gtest/gtest.h>

#include <numbers>

#include "calib/geometry/bearing.h"
#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

constexpr double kPi = std::numbers::pi;
// Zero, both sides of every switch between a series and a closed form, ordinary angles, and up to pi.
const double kAngles[] = {0,    1e-12, 1e-9, 1e-8, 0.9e-6,    1.1e-6,     0.9e-5,     1.1e-5,    1e-4,
                          1e-3, 0.1,   1,    2,    kPi - 0.1, kPi - 1e-3, kPi - 1e-6, kPi - 1e-8};

std::vector<Eigen::Vector3d> Vectors() {
  Random random(1);
  std::vector<Eigen::Vector3d> result;
  for (const double angle : kAngles) {
    result.push_back(angle * RandomNormal3(random).normalized());
    result.push_back(angle * Eigen::Vector3d::UnitX());
  }
  return result;
}

TEST(So3, ExpIsTheRotationByTheFullAngle) {
  for (const Eigen::Vector3d& w : Vectors()) {
    const double angle = w.norm();
    const Eigen::Vector3d axis = angle > 0 ? Eigen::Vector3d(w / angle) : Eigen::Vector3d::UnitX();
    const Eigen::Quaterniond expected(Eigen::AngleAxisd(angle, axis));
    EXPECT_LT((ExpSO3(w).coeffs() - expected.coeffs()).norm(), 1e-15) << angle;
    EXPECT_NEAR(ExpSO3(w).norm(), 1, 1e-15);
  }
}

TEST(So3, LogUndoesExp) {
  for (const Eigen::Vector3d& w : Vectors()) {
    const Eigen::Quaterniond q = ExpSO3(w);
    EXPECT_LT((LogSO3(q) - w).norm(), 1e-15 + 1e-14 * w.norm()) << w.norm();
    // The other quaternion of the same rotation.
    EXPECT_LT((LogSO3(Eigen::Quaterniond(-q.coeffs())) - w).norm(), 1e-15 + 1e-14 * w.norm()) << w.norm();
  }
}

TEST(So3, LogStaysWithinPi) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d w = random.Uniform(kPi, 10) * RandomNormal3(random).normalized();
    EXPECT_LE(LogSO3(ExpSO3(w)).norm(), kPi + 1e-12);
    EXPECT_LT(AngleBetween(ExpSO3(LogSO3(ExpSO3(w))), ExpSO3(w)), 1e-12);
  }
}

TEST(So3, LeftJacobianIsTheDerivativeOfExp) {
  for (const Eigen::Vector3d& w : Vectors()) {
    const Eigen::Quaterniond inverse = ExpSO3(w).conjugate();
    const Eigen::MatrixXd numeric =
        NumericJacobian([&](const Eigen::VectorXd& v) { return LogSO3(ExpSO3(v) * inverse); }, w, 1e-5);
    EXPECT_LT((LeftJacobianSO3(w) - numeric).cwiseAbs().maxCoeff(), 1e-9) << w.norm();
  }
}

TEST(So3, InverseJacobianInvertsAndIsTheDerivativeOfLog) {
  for (const Eigen::Vector3d& w : Vectors()) {
    EXPECT_LT((LeftJacobianInverseSO3(w) * LeftJacobianSO3(w) - Eigen::Matrix3d::Identity()).norm(), 1e-10) << w.norm();
    if (w.norm() > kPi - 1e-4) continue;  // the step would cross the cut of Log
    const Eigen::MatrixXd numeric =
        NumericJacobian([&](const Eigen::VectorXd& d) { return LogSO3(ExpSO3(Eigen::Vector3d(d)) * ExpSO3(w)); },
                        Eigen::Vector3d::Zero(), 1e-5);
    EXPECT_LT((LeftJacobianInverseSO3(w) - numeric).cwiseAbs().maxCoeff(), 1e-7) << w.norm();
  }
}

TEST(So3, InverseJacobianAtExactlyPi) {
  const Eigen::Vector3d w = kPi * Eigen::Vector3d(1, 2, -2).normalized();
  EXPECT_LT((LeftJacobianInverseSO3(w) * LeftJacobianSO3(w) - Eigen::Matrix3d::Identity()).norm(), 1e-12);
}

TEST(So3, AngleBetweenRotations) {
  const Eigen::Quaterniond a = ExpSO3({0.3, -0.2, 0.9});
  EXPECT_NEAR(AngleBetween(a, a * ExpSO3({0, 0.25, 0})), 0.25, 1e-14);
  EXPECT_NEAR(AngleBetween(a, Eigen::Quaterniond(-a.coeffs())), 0, 1e-15);
}

TEST(Bearing, TangentBasisIsOrthonormalAndRightHandedEverywhere) {
  Random random(3);
  std::vector<Eigen::Vector3d> rays = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ(),
                                       -Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Ones().normalized()};
  for (int i = 0; i < 100; ++i) rays.push_back(RandomNormal3(random).normalized());
  for (const Eigen::Vector3d& ray : rays) {
    Eigen::Matrix3d frame;
    frame << TangentBasis(ray), ray.transpose();
    EXPECT_LT((frame * frame.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_NEAR(frame.determinant(), 1, 1e-14);
  }
}

TEST(Bearing, AngleIsAccurateForSmallAngles) {
  EXPECT_NEAR(AngleBetween(Eigen::Vector3d(0, 0, 5), Eigen::Vector3d(2e-9, 0, 2)), 1e-9, 1e-18);
  EXPECT_NEAR(AngleBetween(Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-3, 0, 0)), kPi, 1e-15);
}

}  // namespace
}  // namespace trigpoint
