// What gates compare with their limits, from the results of each stage. Everything is read leniently: what a result
// does not hold gives no measure, and its gate is undecided.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/errors/results.h"
#include "eval/gates/gate.h"

namespace trigpoint {

// evaluate.*, and localize.max_nees_per_dof, from summary.json of `evaluate`. Judged are the answers of `variant` (not
// single views, G1): against the references the runs had no part in; only where there is none, against those that share
// evidence with them. The intervals are the evaluation's, clustered by station and run.
std::vector<GateMeasure> EvaluationMeasures(const nlohmann::json& summary, const std::string& variant,
                                            double confidence);

// survey.*, from summary.json and tags.csv of `survey`.
std::vector<GateMeasure> SurveyMeasures(const nlohmann::json& summary, const std::vector<TagResult>& tags,
                                        double confidence);

// localize.min_answered and localize.max_sigma_m of one run.
std::vector<GateMeasure> LocalizeMeasures(const std::string& run, const std::vector<PanoramaResult>& panoramas,
                                          double confidence);

// estimates.*, from estimates.json of `evaluate`: of the cameras of `variant`, and of other systems. The first
// evaluation also shows the cameras of all variants: each is judged by gates of its own.
std::vector<GateMeasure> EstimateMeasures(const nlohmann::json& estimates, const std::string& variant);

// stitch.* of one photo set, and calibration.* of one calibration, from their manifests' metrics.
std::vector<GateMeasure> StitchMeasures(const std::string& set, const nlohmann::json& metrics);
std::vector<GateMeasure> CalibrationMeasures(const std::string& name, const nlohmann::json& metrics);

}  // namespace trigpoint
