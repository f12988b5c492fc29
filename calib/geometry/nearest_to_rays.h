#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace trigpoint {

// The point nearest to rays: it minimises the sum of squared distances to them.
class NearestToRays {
 public:
  // `along` is a unit vector.
  void Add(const Eigen::Vector3d& origin, const Eigen::Vector3d& along) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along * along.transpose();
    normal_ += across;
    right_ += across * origin;
  }
  // Of how many rays lie across each direction, ascending: the first one is 0 where all are parallel.
  Eigen::Vector3d Spread() const {
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(normal_, Eigen::EigenvaluesOnly).eigenvalues();
  }
  double Trace() const { return normal_.trace(); }
  Eigen::Vector3d Point() const { return normal_.ldlt().solve(right_); }

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
};

}  // namespace trigpoint
