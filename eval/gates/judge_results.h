// Results of stages judged by the limits of a project.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "eval/gates/gate.h"
#include "eval/gates/limits.h"

namespace trigpoint {

// The limits of a `gates:` block. Names may lack their unit (`max_median: 0.2`), and the gates of `evaluate` may stand
// at the top. What is wrong is added to `problems`, one sentence each that begins with `where`; an unknown name with
// the nearest known one.
GateLimits ReadLimits(const nlohmann::json& gates, const std::string& where, std::vector<std::string>* problems);
// Limits among the option values of `evaluate` go before.
void LayOver(const nlohmann::json& values, EvaluateLimits* limits);

// The stage whose results measure a gate: that of its section, but for consistency and other systems' trajectories.
std::string MeasuredBy(const std::string& section, const std::string& name);
// Those of all limits that are set.
std::set<std::string> JudgedStages(const GateLimits& limits);

// A result that has limits, and where it lies.
struct JudgedResult {
  std::string stage, name;  // name: run@variant, photo set, ...
  std::string subject;
  std::filesystem::path dir;
  std::string problem;  // why it cannot be judged
};

// `variant`: of the answers and cameras that are judged. A result with a problem, or that cannot be read, is undecided.
std::vector<GateResult> JudgeResults(const std::vector<GateLimit>& limits, const std::vector<JudgedResult>& results,
                                     const std::string& variant, double confidence);

// gates.xml: a test case for each verdict; an undecided one is an error, so that no pipeline takes it for passed.
std::string JUnitXml(const std::string& project, const std::vector<GateResult>& results);

// Verdicts that count for a command that made `stages`, of a manifest's metrics of `gates`. A command that asks for
// `gates` itself (run, gates) counts all of them.
std::vector<nlohmann::json> CountedGates(const nlohmann::json& metrics, const std::vector<std::string>& stages);
bool GatesPassed(const nlohmann::json& metrics, const std::vector<std::string>& stages);

}  // namespace trigpoint
