// The review laid over what stages read, and what a decision changed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/pipeline/jobs.h"
#include "datasets/project/review.h"
#include "eval/errors/evaluation_files.h"
#include "survey/tags/excluded_detections.h"

namespace trigpoint {

// A row of evaluate's errors.csv, before and after.
struct ReviewedError {
  std::string run, station, panorama, method, reference;
  std::string status_before, status_after;  // empty: no such row
  std::optional<double> before_m, after_m;  // 3D error
  std::optional<double> sigma_m;            // of it, 1 sigma in space; the larger of the two
  // A change that the errors' own uncertainty hides; false where no sigma is known or the status changed.
  bool WithinSigma() const;
};

// What re-solving changed at stations and check points: rows that differ by more than `least_m` or in status.
std::vector<ReviewedError> ChangedErrors(const std::vector<ErrorRow>& before, const std::vector<ErrorRow>& after,
                                         double least_m = 1e-6);
// What makes every result anew that rests on the review.
JobQuery ReviewQuery(const std::string& variant);
// errors.csv of a variant, and the check points of its tag map (reference survey; the status is the point's role).
// Empty where there is nothing that can be read.
std::vector<ErrorRow> ErrorsOf(const Project& project, const std::string& variant);

}  // namespace trigpoint
