// RANSAC with its own seed: the same data and seed give the same answer on any number of threads.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "calib/base/option.h"
#include "calib/estimation/random.h"

namespace trigpoint {

struct RansacOptions {
  int max_iterations = 1000;   // upper bound on samples, 1 to 1e6
  int min_iterations = 30;     // samples drawn even when the confidence is reached
  double confidence = 0.9999;  // probability that one sample was free of outliers, in (0, 1)
  double threshold = 1.0;      // largest residual of an inlier, unit of the model's residual
  uint64_t seed = 1;
};

template <typename Model>
struct RansacResult {
  bool found = false;
  Model model{};
  std::vector<int> inliers;  // ascending
  double score = 0;          // sum of (1 - r^2/threshold^2) over inliers (MSAC)
  int iterations = 0;
};

// sample(indices) -> std::vector<Model>; residual(model, i) -> double (>= 0, same unit as the threshold).
template <typename Model, int kSample, typename SampleFn, typename ResidualFn>
RansacResult<Model> Ransac(int n, const RansacOptions& options, SampleFn&& sample, ResidualFn&& residual,
                           const std::vector<Model>& first_guesses = {}) {
  RansacResult<Model> best;
  if (n < kSample) return best;
  Random random(options.seed);
  const double t2 = options.threshold * options.threshold;
  const auto score_of = [&](const Model& model, int* count) {
    double score = 0;
    *count = 0;
    for (int i = 0; i < n; ++i) {
      const double r = residual(model, i);
      if (r < options.threshold) {
        score += 1 - r * r / t2;
        ++*count;
      }
    }
    return score;
  };
  int needed = options.max_iterations;
  const auto consider = [&](const Model& model) {
    int count = 0;
    const double score = score_of(model, &count);
    if (score <= best.score) return;
    best.found = true;
    best.score = score;
    best.model = model;
    const double good = std::pow(static_cast<double>(count) / n, kSample);
    if (good > 1 - 1e-12) {
      needed = 0;
    } else if (good > 1e-12) {
      const double wanted = std::log(1 - options.confidence) / std::log1p(-good);
      if (wanted < needed) needed = static_cast<int>(std::ceil(wanted));
    }
  };
  for (const Model& guess : first_guesses) consider(guess);
  std::vector<int> indices(kSample);
  for (int it = 0; it < options.max_iterations && (it < needed || it < options.min_iterations); ++it) {
    for (int k = 0; k < kSample; ++k) {
      bool fresh = false;
      while (!fresh) {
        indices[k] = static_cast<int>(random.Below(n));
        fresh = true;
        for (int j = 0; j < k; ++j) fresh = fresh && indices[j] != indices[k];
      }
    }
    for (const Model& model : sample(indices)) consider(model);
    best.iterations = it + 1;
  }
  if (best.found) {
    for (int i = 0; i < n; ++i) {
      if (residual(best.model, i) < options.threshold) best.inliers.push_back(i);
    }
  }
  return best;
}

}  // namespace trigpoint
