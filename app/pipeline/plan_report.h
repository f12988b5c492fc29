// What `plan` found: tables, a map, a page.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "app/pipeline/plan_layout.h"
#include "eval/report/drawing.h"

namespace trigpoint {

struct PlanGain {
  std::string what;        // "control on tag 12", "pass monday once more", "a tag at place A"
  double rms_after_m = 0;  // RMS sigma of the tags that are there without it
  std::optional<Eigen::Vector3d> world_m;
  std::optional<double> heading_rad;  // of a tag
};

struct PlanGate {
  std::string gate;  // "3D sigma of the weakest tag <= 0.02 m"
  double value = 0;
  bool passed = false;
};

struct PlanFindings {
  PlanLayout layout;
  NetworkPrediction prediction;
  std::vector<PanoramaPrediction> panoramas;
  std::map<int, int> images_needed;   // of each tag that is tied, for the sigma wanted; none: more pictures do not help
  std::vector<PlanGain> gains;        // ranked, one more of each kind
  std::vector<PlanGain> suggestions;  // as asked for, one after the other
  std::string suggestion_note;        // how good they are among all choices
  std::vector<PlanGate> gates;
};

// 3D sigmas.
double TagSigma(const TagPrediction& tag);
double BodySigma(const BodyPrediction& body);
double Percentile(std::vector<double> values, double share);

// tags.csv, cameras.csv, stations.csv, observations.csv, known_points.csv, gains.csv, suggestions.csv, summary.json,
// map.svg, map.png, index.html
void WritePlan(const PlanFindings& findings, const std::filesystem::path& folder);
// The site from above with its ellipses, and numbers where suggestions are.
Drawing PlanMap(const PlanFindings& findings);
// At most 12 lines.
std::string PlanSummary(const nlohmann::json& summary, const DisplayUnit& unit);

}  // namespace trigpoint
