#include "localize/references/chance_match.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace trigpoint {
namespace {

using Kinds = Eigen::Matrix<double, Eigen::Dynamic, 3>;

// 1, descriptor distance, log depth, the latter two normalised.
Kinds KindsOf(const std::vector<FoundMatch>& matches) {
  Kinds x(static_cast<Eigen::Index>(matches.size()), 3);
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    const FoundMatch& m = matches[static_cast<size_t>(i)];
    x.row(i) << 1, m.descriptor_distance, std::log(std::max(1e-3, m.depth_m));
  }
  for (Eigen::Index column : {1, 2}) {
    const double mean = x.col(column).mean();
    const double deviation = std::sqrt((x.col(column).array() - mean).square().mean());
    x.col(column) = (x.col(column).array() - mean) / std::max(1e-9, deviation);
  }
  return x;
}

Eigen::ArrayXd Logistic(const Eigen::VectorXd& v) { return 1 / (1 + (-v.array()).exp()); }

}  // namespace

std::vector<double> TrueShares(const std::vector<FoundMatch>& matches, double radius_px) {
  constexpr double kChanceInside = 0.25;  // area of half the radius
  constexpr double kTrueInside = 0.99;
  constexpr int kIterations = 50;
  if (matches.empty()) return {};
  const Kinds x = KindsOf(matches);
  Eigen::ArrayXd inside(x.rows());
  for (Eigen::Index i = 0; i < x.rows(); ++i) inside(i) = matches[static_cast<size_t>(i)].error_px < radius_px / 2;
  // Few matches say little about kinds: a normal prior of 1 on the slopes, a wide one on the level.
  const Eigen::Vector3d prior(0.01, 1, 1);
  Eigen::Vector3d b(1, 0, 0);
  for (int k = 0; k < kIterations; ++k) {  // scoring
    const Eigen::ArrayXd share = Logistic(x * b), within = kChanceInside + (kTrueInside - kChanceInside) * share;
    const Eigen::ArrayXd slope = (kTrueInside - kChanceInside) * share * (1 - share);
    const Eigen::ArrayXd variance = within * (1 - within);
    const Eigen::Vector3d gradient =
        x.transpose() * ((inside - within) / variance * slope).matrix() - prior.cwiseProduct(b);
    Eigen::Matrix3d information = x.transpose() * (slope.square() / variance).matrix().asDiagonal() * x;
    information.diagonal() += prior;
    const Eigen::Vector3d step = information.ldlt().solve(gradient).cwiseMax(-1.0).cwiseMin(1.0);
    b += step;
    if (step.cwiseAbs().maxCoeff() < 1e-6) break;
  }
  const Eigen::ArrayXd share = Logistic(x * b);
  return {share.begin(), share.end()};
}

double TrueProbability(double share, double chi2, double spread, double radius) {
  // Densities about the predicted place; pi is common to both.
  const double right = share * std::exp(-0.5 * chi2) / (2 * spread), chance = (1 - share) / (radius * radius);
  return right + chance > 0 ? right / (right + chance) : 0;
}

}  // namespace trigpoint
