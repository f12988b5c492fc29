#include "calib/estimation/loss.h"

#include <cmath>
#include <string>

#include "calib/base/error.h"

namespace trigpoint {

void DcsLoss::Evaluate(double s, double rho[3]) const {
  if (s <= phi_) {
    rho[0] = s, rho[1] = 1, rho[2] = 0;
    return;
  }
  const double sum = phi_ + s, ratio = 2 * phi_ / sum;
  rho[0] = phi_ * (3 * s - phi_) / sum;
  rho[1] = ratio * ratio;
  rho[2] = -2 * rho[1] / sum;
}

void TukeyChi2Loss::Evaluate(double s, double rho[3]) const {
  if (s >= c2_) {
    rho[0] = c2_ / 3, rho[1] = rho[2] = 0;
    return;
  }
  const double v = 1 - s / c2_;
  rho[0] = c2_ / 3 * (1 - v * v * v);
  rho[1] = v * v;
  rho[2] = -2 * v / c2_;
}

void HuberChi2Loss::Evaluate(double s, double rho[3]) const {
  if (s <= t_) {
    rho[0] = s, rho[1] = 1, rho[2] = 0;
    return;
  }
  const double r = std::sqrt(s), d = std::sqrt(t_);
  rho[0] = 2 * d * r - t_;
  rho[1] = d / r;
  rho[2] = -rho[1] / (2 * s);
}

void CauchyChi2Loss::Evaluate(double s, double rho[3]) const {
  const double sum = 1 + s / t_;
  rho[0] = t_ * std::log(sum);
  rho[1] = 1 / sum;
  rho[2] = -rho[1] * rho[1] / t_;
}

std::unique_ptr<ceres::LossFunction> MakeLoss(std::string_view name, double chi2_threshold) {
  if (name == "none") return nullptr;
  if (name == "huber") return std::make_unique<HuberChi2Loss>(chi2_threshold);
  if (name == "cauchy") return std::make_unique<CauchyChi2Loss>(chi2_threshold);
  if (name == "tukey") return std::make_unique<TukeyChi2Loss>(chi2_threshold);
  if (name == "dcs") return std::make_unique<DcsLoss>(chi2_threshold);
  throw OptionError("loss '" + std::string(name) + "' is not known: use none, huber, cauchy, tukey or dcs");
}

}  // namespace trigpoint
