// Robust losses of s = |whitened residual|^2; thresholds are chi-square values.
//
// Each gives rho(s), rho'(s), rho''(s) through Ceres' LossFunction, so that one definition serves Ceres and
// our own solvers. All have rho(0) = 0, rho'(0) = 1, rho' >= 0.
#pragma once

#include <ceres/loss_function.h>

#include <memory>
#include <string_view>

namespace trigpoint {

// Dynamic Covariance Scaling (Agarwal et al., ICRA 2013) in closed form: s <= phi: rho = s; else
// rho = phi (3 s - phi) / (phi + s), rho' = (2 phi / (phi + s))^2. Bounded by 3 phi.
class DcsLoss final : public ceres::LossFunction {
 public:
  explicit DcsLoss(double phi) : phi_(phi) {}
  void Evaluate(double s, double rho[3]) const override;

 private:
  double phi_;
};

// Tukey's biweight with cut-off s = c2: constant beyond it.
class TukeyChi2Loss final : public ceres::LossFunction {
 public:
  explicit TukeyChi2Loss(double c2) : c2_(c2) {}
  void Evaluate(double s, double rho[3]) const override;

 private:
  double c2_;
};

// Huber and Cauchy with their knee at s = threshold.
class HuberChi2Loss final : public ceres::LossFunction {
 public:
  explicit HuberChi2Loss(double threshold) : t_(threshold) {}
  void Evaluate(double s, double rho[3]) const override;

 private:
  double t_;
};

class CauchyChi2Loss final : public ceres::LossFunction {
 public:
  explicit CauchyChi2Loss(double threshold) : t_(threshold) {}
  void Evaluate(double s, double rho[3]) const override;

 private:
  double t_;
};

// "none", "huber", "cauchy", "tukey", "dcs"; nullptr for none. Throws OptionError for another name.
std::unique_ptr<ceres::LossFunction> MakeLoss(std::string_view name, double chi2_threshold);

}  // namespace trigpoint
