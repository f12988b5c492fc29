// Distribution functions that tests and intervals need. Accurate to about 1e-10 relative.
#pragma once

namespace trigpoint {

double NormalCdf(double z);
// Throws NumericError unless 0 < p < 1.
double NormalQuantile(double p);
// P(X <= x) of chi-square with `dof` > 0 degrees of freedom (need not be whole).
double ChiSquareCdf(double x, double dof);
// Throws NumericError unless 0 < p < 1 and dof > 0.
double ChiSquareQuantile(double p, double dof);
// Throws NumericError unless 0 < p < 1 and both parameters are above 0.
double BetaQuantile(double p, double a, double b);
// P(X <= k) of n trials with success probability p.
double BinomialCdf(int k, int n, double p);

}  // namespace trigpoint
