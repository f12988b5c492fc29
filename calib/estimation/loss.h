// Robust losses of s = |whitened residual|^2; thresholds are chi-square values.
//
// Each gives rho(s), rho'(s), rho''(s) through Ceres' LossFunction, so that one definition serves Ceres and
// our own solvers. All have rho(0) = 0, rho'(0) = 1, rho' >= 0.
#pragma once

#include <ceres/loss_function.h>

#include <memory>
#include <string_view>

namespace trigpoint {

// A loss that can say what it is, so that a file can hold it: MakeLoss(name(), threshold()) is the same one.
class Chi2Loss : public ceres::LossFunction {
 public:
  virtual std::string_view name() const = 0;
  virtual double threshold() const = 0;
};

// Dynamic Covariance Scaling (Agarwal et al., ICRA 2013) in closed form: s <= phi: rho = s; else
// rho = phi (3 s - phi) / (phi + s), rho' = (2 phi / (phi + s))^2. Bounded by 3 phi.
class DcsLoss final : public Chi2Loss {
 public:
  explicit DcsLoss(double phi) : phi_(phi) {}
  void Evaluate(double s, double rho[3]) const override;
  std::string_view name() const override { return "dcs"; }
  double threshold() const override { return phi_; }

 private:
  double phi_;
};

// Tukey's biweight with cut-off s = c2: constant beyond it.
class TukeyChi2Loss final : public Chi2Loss {
 public:
  explicit TukeyChi2Loss(double c2) : c2_(c2) {}
  void Evaluate(double s, double rho[3]) const override;
  std::string_view name() const override { return "tukey"; }
  double threshold() const override { return c2_; }

 private:
  double c2_;
};

// Huber and Cauchy with their knee at s = threshold.
class HuberChi2Loss final : public Chi2Loss {
 public:
  explicit HuberChi2Loss(double threshold) : t_(threshold) {}
  void Evaluate(double s, double rho[3]) const override;
  std::string_view name() const override { return "huber"; }
  double threshold() const override { return t_; }

 private:
  double t_;
};

class CauchyChi2Loss final : public Chi2Loss {
 public:
  explicit CauchyChi2Loss(double threshold) : t_(threshold) {}
  void Evaluate(double s, double rho[3]) const override;
  std::string_view name() const override { return "cauchy"; }
  double threshold() const override { return t_; }

 private:
  double t_;
};

// "none", "huber", "cauchy", "tukey", "dcs"; nullptr for none. Throws OptionError for another name.
std::unique_ptr<ceres::LossFunction> MakeLoss(std::string_view name, double chi2_threshold);

}  // namespace trigpoint
