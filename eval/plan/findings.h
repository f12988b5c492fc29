// What `plan` finds: the accuracy of a layout, what one thing more would gain, suggestions, gates.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "eval/plan/layout.h"

namespace trigpoint {

struct SceneAerial;

struct PlanGain {
  std::string what;        // "control on tag 12", "pass monday once more", "a tag at place A"
  double rms_after_m = 0;  // RMS sigma of the tags that are there without it; infinite: not determined
  std::optional<Eigen::Vector3d> world_m;
  std::optional<double> heading_rad;        // of a tag
  bool in_world = true;                     // rms_after_m; else it is relative to the first camera
  std::string kind = {};                    // control, path or tags, as --suggest names them
  std::vector<Eigen::Vector3d> way_m = {};  // of a pass, in its direction; world
  // RMS before it, of the same frame; infinite: nothing held the plan in the world.
  double Before(const NetworkPrediction& plan) const;
  bool Helps(const NetworkPrediction& plan) const;
};

struct PlanGate {
  std::string gate;  // "3D sigma of the weakest tag <= 0.02 m"
  double value = 0;
  bool passed = false;
  bool undecided = false;  // nothing holds the plan in the world
};

struct PlanFindings {
  PlanLayout layout;
  NetworkPrediction prediction;
  std::vector<PanoramaPrediction> panoramas;
  std::map<int, int> images_needed;   // of each tag that is tied, for the sigma wanted; none: more pictures do not help
  std::map<int, std::string> unseen;  // tags without a prediction, and why
  std::vector<PlanGain> gains;        // ranked, one more of each kind
  std::vector<PlanGain> suggestions;  // as asked for, one after the other
  std::string suggestion_note;        // how good they are among all choices
  std::vector<PlanGate> gates;
  std::shared_ptr<const SceneAerial> aerial;  // under the map; none: white
};

// Of an RMS, so much or more left of it is no gain.
inline constexpr double kSameRms = 1 - 1e-4;

// 3D sigmas.
double TagSigma(const TagPrediction& tag);
double BodySigma(const BodyPrediction& body);
double Percentile(std::vector<double> values, double share);

// Predicts what the layout gives, one thing more of each kind, and what the options ask for.
PlanFindings FindPlan(const PlanOptions& options, PlanLayout layout, StageContext& context);

}  // namespace trigpoint
