#include "eval/gates/judge_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "calib/base/error.h"
#include "datasets/export/layer_text.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/options_json.h"
#include "eval/errors/results.h"
#include "eval/gates/measures.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// A name as it is written, in the form of the options: max-median -> max_median_m.
template <typename Known>
std::string FullName(std::string name, const Known& known) {
  std::replace(name.begin(), name.end(), '-', '_');
  for (const char* unit : {"", "_m", "_px", "_deg", "_percent"}) {
    if (known(name + unit)) return name + unit;
  }
  return name;
}

// {section: {name: limit}} of the block as it is written.
json Normalised(const json& gates, const std::string& where, std::vector<std::string>* problems) {
  std::set<std::string> sections, dotted;
  std::vector<std::string> names;
  for (const GateLimit& gate : AllGates()) {
    sections.insert(gate.section);
    dotted.insert(gate.Gate());
    names.push_back(gate.section == "evaluate" ? gate.name : gate.Gate());
  }
  json values = json::object();
  const auto add = [&](const std::string& section, const std::string& written, const json& limit) {
    const std::string name =
        FullName(written, [&](const std::string& n) { return dotted.count(section + "." + n) > 0; });
    if (dotted.count(section + "." + name) > 0) {
      if (!limit.is_null()) values[section][name] = limit;
      return;
    }
    // The same name in another section is nearer than another name.
    std::string nearest = NearestName(section == "evaluate" ? written : section + "." + written, names);
    for (const std::string& other : names) {
      if (other.substr(other.find('.') + 1) ==
          FullName(written, [&](const std::string& n) { return other.ends_with("." + n); })) {
        nearest = other;
      }
    }
    problems->push_back(fmt::format("{}: unknown gate '{}{}'{}", where, section == "evaluate" ? "" : section + ".",
                                    written, nearest.empty() ? "" : "; nearest known one: '" + nearest + "'"));
  };
  for (const auto& [key, value] : gates.items()) {
    if (key == "confidence") {
      values[key] = value;
    } else if (sections.count(key) > 0 && (value.is_object() || value.is_null())) {
      for (const auto& [name, limit] : value.items()) add(key, name, limit);
    } else if (sections.count(key) > 0) {
      problems->push_back(where + "." + key + ": expected a map of limits, found " + DumpJson(value));
    } else {
      add("evaluate", key, value);
    }
  }
  return values;
}

json ReadJsonFile(const fs::path& file) {
  if (!fs::exists(file)) return {};
  json value = json::parse(ReadTextFile(file), nullptr, false);
  if (value.is_discarded()) throw InputError(file.string() + ": expected JSON, found something else");
  return value;
}

std::vector<GateMeasure> MeasuresOf(const JudgedResult& result, const std::string& variant, double confidence) {
  std::vector<GateMeasure> measures;
  const auto add = [&](const std::vector<GateMeasure>& more) {
    measures.insert(measures.end(), more.begin(), more.end());
  };
  if (result.stage == "survey") {
    add(SurveyMeasures(ReadJsonFile(result.dir / "summary.json"), ReadTagResults(result.dir / "tags.csv"), confidence));
  } else if (result.stage == "localize") {
    add(LocalizeMeasures(result.name, ReadLocalizeResult(result.dir).panoramas, confidence));
  } else if (result.stage == "evaluate") {
    add(EvaluationMeasures(ReadJsonFile(result.dir / "summary.json"), variant, confidence));
    add(EstimateMeasures(ReadJsonFile(result.dir / "estimates.json"), variant));
  } else {
    const json manifest = ReadJsonFile(result.dir / "manifest.json");
    const json metrics = manifest.is_object() ? manifest.value("metrics", json::object()) : json::object();
    add(result.stage == "stitch" ? StitchMeasures(result.name, metrics) : CalibrationMeasures(result.name, metrics));
  }
  return measures;
}

}  // namespace

GateLimits ReadLimits(const json& gates, const std::string& where, std::vector<std::string>* problems) {
  GateLimits limits;
  if (gates.is_object()) SetOptions(Normalised(gates, where, problems), where, limits, *problems);
  GateLimits::Visit(limits, [&](const auto& section, const OptionInfo& info) {
    if constexpr (!std::is_arithmetic_v<std::decay_t<decltype(section)>>) {
      for (const std::string& p : CheckRanges(section)) problems->push_back(where + "." + info.name + ": " + p);
    }
  });
  if (!(limits.confidence >= 0.5 && limits.confidence <= 0.999)) {
    problems->push_back(fmt::format("{}: option confidence is {}, expected 0.5 to 0.999", where, limits.confidence));
  }
  return limits;
}

void LayOver(const json& values, EvaluateLimits* limits) {
  EvaluateLimits::Visit(*limits, [&](double& limit, const OptionInfo& info) {
    const auto it = values.find(info.name);
    if (it != values.end() && it->is_number() && *it > 0) limit = *it;
  });
}

std::string MeasuredBy(const std::string& section, const std::string& name) {
  if (section == "estimates" || name == "max_nees_per_dof") return "evaluate";
  return section == "calibration" ? "calibrate" : section;
}

std::set<std::string> JudgedStages(const GateLimits& limits) {
  std::set<std::string> stages;
  for (const GateLimit& limit : SetLimits(limits)) stages.insert(MeasuredBy(limit.section, limit.name));
  return stages;
}

std::vector<GateResult> JudgeResults(const std::vector<GateLimit>& limits, const std::vector<JudgedResult>& results,
                                     const std::string& variant, double confidence) {
  std::vector<GateMeasure> measures;
  for (const JudgedResult& result : results) {
    std::string problem = result.problem;
    if (problem.empty()) {
      try {
        const std::vector<GateMeasure> its = MeasuresOf(result, variant, confidence);
        measures.insert(measures.end(), its.begin(), its.end());
        continue;
      } catch (const Error& e) {
        problem = e.what();
      }
    }
    for (const GateLimit& limit : limits) {
      if (MeasuredBy(limit.section, limit.name) != result.stage) continue;
      measures.push_back({.gate = limit.Gate(), .subject = result.subject, .reason = problem});
    }
  }
  return JudgeAll(limits, measures);
}

std::string JUnitXml(const std::string& project, const std::vector<GateResult>& results) {
  std::map<std::string, std::vector<const GateResult*>> suites;
  for (const GateResult& r : results) suites[r.limit.section].push_back(&r);
  const auto count = [](const std::vector<const GateResult*>& cases, Verdict verdict) {
    return std::count_if(cases.begin(), cases.end(), [&](const GateResult* r) { return r->verdict == verdict; });
  };
  std::string body;
  int64_t failed = 0, undecided = 0;
  for (const auto& [section, cases] : suites) {
    failed += count(cases, Verdict::kFailed), undecided += count(cases, Verdict::kUndecided);
    body += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"0\">\n", section,
                        cases.size(), count(cases, Verdict::kFailed), count(cases, Verdict::kUndecided));
    for (const GateResult* r : cases) {
      const std::string of = r->measure.subject.empty() ? "" : " (" + r->measure.subject + ")";
      body += fmt::format("    <testcase classname=\"trigpoint.{}\" name=\"{}\"", section, XmlText(r->limit.name + of));
      const std::string message = XmlText(r->message);
      if (r->verdict == Verdict::kPassed) {
        body += fmt::format(">\n      <system-out>{}</system-out>\n    </testcase>\n", message);
      } else {
        const bool is_failure = r->verdict == Verdict::kFailed;
        body += fmt::format(">\n      <{0} type=\"{1}\" message=\"{2}\"/>\n    </testcase>\n",
                            is_failure ? "failure" : "error", ToString(r->verdict), message);
      }
    }
    body += "  </testsuite>\n";
  }
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"{}\" tests=\"{}\" failures=\"{}\" "
      "errors=\"{}\">\n{}</testsuites>\n",
      XmlText(project), results.size(), failed, undecided, body);
}

std::vector<json> CountedGates(const json& metrics, const std::vector<std::string>& stages) {
  const auto made = [&](const std::string& stage) {
    return std::find(stages.begin(), stages.end(), stage) != stages.end();
  };
  std::vector<json> counted;
  const json gates = metrics.value("gates", json::array());
  for (const json& gate : gates) {
    if (made("gates") || made(MeasuredBy(gate.value("stage", ""), gate.value("name", "")))) counted.push_back(gate);
  }
  return counted;
}

bool GatesPassed(const json& metrics, const std::vector<std::string>& stages) {
  const std::vector<json> counted = CountedGates(metrics, stages);
  return std::all_of(counted.begin(), counted.end(),
                     [](const json& gate) { return gate.value("verdict", "") == "passed"; });
}

}  // namespace trigpoint
