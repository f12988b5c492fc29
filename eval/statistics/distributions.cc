#include "eval/statistics/distributions.h"

#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

namespace policies = boost::math::policies;
// In double throughout, as long double is slower and more exact than anything here; what is not a number stays so.
using Policy = policies::policy<policies::promote_double<false>, policies::domain_error<policies::ignore_error>>;
using Normal = boost::math::normal_distribution<double, Policy>;
using ChiSquare = boost::math::chi_squared_distribution<double, Policy>;
using Beta = boost::math::beta_distribution<double, Policy>;
using Binomial = boost::math::binomial_distribution<double, Policy>;

}  // namespace

double NormalCdf(double z) { return boost::math::cdf(Normal(), z); }

double NormalQuantile(double p) {
  if (!(p > 0 && p < 1)) throw NumericError("normal quantile: the probability must lie between 0 and 1");
  return boost::math::quantile(Normal(), p);
}

double ChiSquareCdf(double x, double dof) { return x > 0 ? boost::math::cdf(ChiSquare(dof), x) : 0; }

double ChiSquareQuantile(double p, double dof) {
  if (!(p > 0 && p < 1) || !(dof > 0)) {
    throw NumericError("chi-square quantile: the probability must lie between 0 and 1, the degrees of freedom above 0");
  }
  return boost::math::quantile(ChiSquare(dof), p);
}

double BetaQuantile(double p, double a, double b) {
  if (!(p > 0 && p < 1) || !(a > 0) || !(b > 0)) {
    throw NumericError("beta quantile: the probability must lie between 0 and 1, the parameters above 0");
  }
  return boost::math::quantile(Beta(a, b), p);
}

double BinomialCdf(int k, int n, double p) {
  if (k < 0) return 0;
  if (k >= n) return 1;
  return boost::math::cdf(Binomial(n, p), k);
}

}  // namespace trigpoint
