#include "eval/errors/changed_errors.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "calib/base/error.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;

bool ReviewedError::WithinSigma() const {
  return status_before == status_after && before_m && after_m && sigma_m && std::abs(*before_m - *after_m) <= *sigma_m;
}

std::vector<ReviewedError> ChangedErrors(const std::vector<ErrorRow>& before, const std::vector<ErrorRow>& after,
                                         double least_m) {
  std::map<std::tuple<std::string, std::string, std::string, std::string, std::string>, ReviewedError> rows;
  const auto at = [&](const ErrorRow& row) -> ReviewedError& {
    ReviewedError& r = rows[{row.reference, row.method, row.run, row.station, row.panorama}];
    r.reference = row.reference, r.method = row.method, r.run = row.run, r.station = row.station;
    r.panorama = row.panorama;
    return r;
  };
  const auto widen = [](const ErrorRow& row, ReviewedError* r) {
    if (!row.covariance_m2) return;
    r->sigma_m = std::max(r->sigma_m.value_or(0), std::sqrt(row.covariance_m2->trace()));
  };
  for (const ErrorRow& row : before) {
    ReviewedError& r = at(row);
    r.status_before = row.status, r.before_m = row.error_3d_m;
    widen(row, &r);
  }
  for (const ErrorRow& row : after) {
    ReviewedError& r = at(row);
    r.status_after = row.status, r.after_m = row.error_3d_m;
    widen(row, &r);
  }
  std::vector<ReviewedError> changed;
  for (const auto& [key, r] : rows) {
    const bool same = r.before_m && r.after_m ? std::abs(*r.before_m - *r.after_m) <= least_m
                                              : r.before_m.has_value() == r.after_m.has_value();
    if (!same || r.status_before != r.status_after) changed.push_back(r);
  }
  return changed;
}

std::vector<ErrorRow> ErrorsOf(const Project& project, const std::string& variant) {
  const std::string at = variant.empty() ? "" : "@" + variant;
  std::vector<ErrorRow> rows;
  const fs::path errors = project.ResultDir("evaluate", at) / "errors.csv";
  try {
    if (fs::exists(errors)) rows = ReadErrors(errors);
  } catch (const InputError&) {  // of another version: nothing to compare with
  }
  const nlohmann::json summary = ReadJsonOrNothing(project.ResultDir("survey", at) / "summary.json");
  if (!summary.contains("points")) return rows;
  for (const nlohmann::json& point : summary.at("points")) {
    ErrorRow row;
    row.reference = "survey";
    row.method = "map";
    row.station = point.value("name", "");
    row.status = point.value("role", "");
    const auto d = point.value("map_minus_stated_m", std::vector<double>());
    // What a point that was used disagrees by is no accuracy.
    if (row.status == "check" && d.size() == 3) row.error_3d_m = std::hypot(d[0], d[1], d[2]);
    if (row.status == "check" || row.status == "control") rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace trigpoint
