#include "localize/references/stray_photo.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace trigpoint {

int StrayPhoto(const std::vector<Eigen::Vector3d>& places, const std::vector<Eigen::Matrix3d>& covariances,
               double held_m) {
  constexpr double kSurely = 16.27;  // chi-square with 3 dof, 0.1 %
  constexpr size_t kLeast = 3;
  if (places.size() < kLeast) return -1;
  std::vector<Eigen::Matrix3d> own, information;
  Eigen::Matrix3d all = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (size_t k = 0; k < places.size(); ++k) {
    own.push_back(covariances[k] + held_m * held_m * Eigen::Matrix3d::Identity());
    information.push_back(own.back().inverse());
    all += information.back();
    moment += information.back() * places[k];
  }
  int stray = -1;
  double most = kSurely;
  for (size_t k = 0; k < places.size(); ++k) {
    const Eigen::Matrix3d of_others = (all - information[k]).inverse();
    const Eigen::Vector3d off = places[k] - of_others * (moment - information[k] * places[k]);
    const double chi2 = off.dot((own[k] + of_others).llt().solve(off));
    if (chi2 > most) most = chi2, stray = static_cast<int>(k);
  }
  return stray;
}

}  // namespace trigpoint
