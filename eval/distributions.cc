#include "eval/distributions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

// Root of an increasing function between two bounds, by halving to the last bit.
template <typename Function>
double Bisect(double low, double high, const Function& too_low) {
  for (int i = 0; i < 200 && high > low; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (too_low(middle) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

double NormalCdf(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

double NormalQuantile(double p) {
  if (!(p > 0 && p < 1)) throw NumericError("normal quantile: the probability must lie between 0 and 1");
  return Bisect(-40, 40, [&](double z) { return NormalCdf(z) < p; });
}

// Regularised lower incomplete gamma function P(a, x): its series below a + 1, Lentz' continued fraction of the
// complement above (Abramowitz and Stegun 6.5.29 and 6.5.31).
double ChiSquareCdf(double x, double dof) {
  if (!(x > 0)) return 0;
  const double a = 0.5 * dof, y = 0.5 * x;
  const double scale = std::exp(a * std::log(y) - y - std::lgamma(a));
  if (y < a + 1) {
    double term = 1 / a, sum = term;
    for (int k = 1; k < 100000 && term > 1e-16 * sum; ++k) {
      term *= y / (a + k);
      sum += term;
    }
    return std::min(1.0, scale * sum);
  }
  double b = y + 1 - a, c = 1e300, d = 1 / b, fraction = d;
  for (int k = 1; k < 100000; ++k) {
    const double numerator = -k * (k - a);
    b += 2;
    d = 1 / (numerator * d + b);
    c = b + numerator / c;
    fraction *= c * d;
    if (std::abs(c * d - 1) < 1e-15) break;
  }
  return std::clamp(1 - scale * fraction, 0.0, 1.0);
}

double ChiSquareQuantile(double p, double dof) {
  if (!(p > 0 && p < 1) || !(dof > 0)) {
    throw NumericError("chi-square quantile: the probability must lie between 0 and 1, the degrees of freedom above 0");
  }
  // Newton's steps, halving wherever one would leave the bracket, until nothing changes.
  double low = 0, high = dof + 10;
  while (ChiSquareCdf(high, dof) < p) high *= 2;
  const double a = 0.5 * dof, log_scale = -std::lgamma(a) - a * std::numbers::ln2;
  double x = std::min(dof, 0.5 * high);
  for (int i = 0; i < 400; ++i) {
    const double excess = ChiSquareCdf(x, dof) - p;
    (excess < 0 ? low : high) = x;
    const double density = std::exp(log_scale + (a - 1) * std::log(x) - 0.5 * x);
    double next = x - excess / density;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - x) <= 1e-12 * x) return next;
    x = next;
  }
  return x;
}

double BinomialCdf(int k, int n, double p) {
  if (k < 0) return 0;
  if (k >= n) return 1;
  double sum = 0;
  for (int i = 0; i <= k; ++i) {
    sum += std::exp(std::lgamma(n + 1.0) - std::lgamma(i + 1.0) - std::lgamma(n - i + 1.0) + i * std::log(p) +
                    (n - i) * std::log1p(-p));
  }
  return std::min(1.0, sum);
}

}  // namespace trigpoint
