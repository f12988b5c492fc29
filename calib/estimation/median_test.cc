#include "calib/estimation/median_test.h"

#include <boost/math/distributions/binomial.hpp>
#include <boost/math/special_functions/gamma.hpp>

#include "calib/base/median.h"

namespace trigpoint {

bool IsMedianTooLarge(double median, size_t count, size_t components) {
  constexpr double kChance = 0.001;
  if (count == 0 || !(median > 0)) return false;
  const double chi2 = median * kMediansOfChi2[components];
  const double above = boost::math::gamma_q(0.5 * static_cast<double>(components), 0.5 * chi2);
  const boost::math::binomial many(static_cast<double>(count), above);
  return boost::math::cdf(boost::math::complement(many, static_cast<double>(count - count / 2 - 1))) < kChance;
}

}  // namespace trigpoint
