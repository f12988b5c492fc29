// What tests of derivatives and of estimators share.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "calib/estimation/random.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

// Central differences of f: R^n -> R^m at x, with a step relative to the argument.
template <typename Function>
Eigen::MatrixXd NumericJacobian(Function&& f, const Eigen::VectorXd& x, double step = 1e-6) {
  Eigen::MatrixXd jacobian;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double h = step * std::max(1.0, std::abs(x(i)));
    Eigen::VectorXd above = x, below = x;
    above(i) += h, below(i) -= h;
    const Eigen::VectorXd column = (Eigen::VectorXd(f(above)) - Eigen::VectorXd(f(below))) / (above(i) - below(i));
    if (jacobian.size() == 0) jacobian.resize(column.size(), x.size());
    jacobian.col(i) = column;
  }
  return jacobian;
}

inline Eigen::Vector3d RandomNormal3(Random& random) {
  const double x = random.Normal(), y = random.Normal(), z = random.Normal();
  return {x, y, z};
}

// Uniform over all rotations.
inline Eigen::Quaterniond RandomRotation(Random& random) {
  const double w = random.Normal(), x = random.Normal(), y = random.Normal(), z = random.Normal();
  return Eigen::Quaterniond(w, x, y, z).normalized();
}

inline Rigid3d RandomPose(Random& random, double extent_m) {
  const Eigen::Quaterniond q = RandomRotation(random);
  return {q, extent_m * RandomNormal3(random)};
}

// A full covariance with standard deviations about sigma_rotation (rad) and sigma_translation (m).
inline Matrix6d RandomCovariance(Random& random, double sigma_rotation, double sigma_translation) {
  Matrix6d mix;
  for (int i = 0; i < 36; ++i) mix(i / 6, i % 6) = random.Normal() + (i % 7 == 0 ? 2.0 : 0.0);
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(sigma_rotation), Eigen::Vector3d::Constant(sigma_translation);
  const Matrix6d root = scale.asDiagonal() * mix / 3.0;
  return root * root.transpose();
}

// One draw of a normal distribution with this covariance.
template <int N>
Eigen::Matrix<double, N, 1> Draw(const Eigen::Matrix<double, N, N>& covariance, Random& random) {
  Eigen::Matrix<double, N, 1> z;
  for (int i = 0; i < N; ++i) z(i) = random.Normal();
  return covariance.llt().matrixL() * z;
}

// Largest deviation of a sample covariance from the predicted one, relative to sqrt(c_ii c_jj).
template <typename A, typename B>
double CovarianceDeviation(const A& sampled, const B& predicted) {
  double worst = 0;
  for (Eigen::Index i = 0; i < predicted.rows(); ++i) {
    for (Eigen::Index j = 0; j < predicted.cols(); ++j) {
      const double scale = std::sqrt(predicted(i, i) * predicted(j, j));
      worst = std::max(worst, std::abs(sampled(i, j) - predicted(i, j)) / scale);
    }
  }
  return worst;
}

}  // namespace trigpoint
