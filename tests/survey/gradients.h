// Exact derivatives of a cost against numeric ones.
#pragma once

#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include <vector>

namespace trigpoint {

// Against the size of the whole derivative: single entries may be zero.
inline void ExpectDerivatives(const ceres::CostFunction& cost, const std::vector<const ceres::Manifold*>& manifolds,
                              const std::vector<const double*>& parameters,
                              const ceres::NumericDiffOptions& options = {}) {
  const ceres::GradientChecker checker(&cost, &manifolds, options);
  ceres::GradientChecker::ProbeResults results;
  checker.Probe(parameters.data(), 1e-6, &results);
  ASSERT_TRUE(results.return_value);
  for (size_t i = 0; i < parameters.size(); ++i) {
    const auto &exact = results.local_jacobians[i], &numeric = results.local_numeric_jacobians[i];
    EXPECT_LT((exact - numeric).norm(), 2e-6 * (1e-3 + exact.norm())) << results.error_log;
  }
}

}  // namespace trigpoint
