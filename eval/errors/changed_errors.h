// What a decision of the review changed in the errors at stations and check points.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/project/project.h"
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
// errors.csv of a variant, and the check points of its tag map (reference survey; the status is the point's role).
// Empty where there is nothing that can be read.
std::vector<ErrorRow> ErrorsOf(const Project& project, const std::string& variant);

}  // namespace trigpoint
