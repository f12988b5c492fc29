#include "eval/gates/gate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "eval/gates/more_data.h"
#include "eval/text/json_values.h"
#include "eval/text/markdown.h"

namespace trigpoint {
namespace {

std::string Number(double value, const GateLimit& limit, const std::string& unit, double metres) {
  const bool length = limit.unit == "m";
  const std::string name = length ? unit : limit.unit;
  return fmt::format("{:.3g}{}", length ? value / metres : value, name.empty() ? "" : " " + name);
}

bool IsOpen(const Interval& interval) { return !std::isfinite(interval.low) || !std::isfinite(interval.high); }

std::string Ends(const Interval& interval, const GateLimit& limit, const std::string& unit, double metres) {
  const auto end = [&](double x) { return std::isfinite(x) ? Number(x, limit, unit, metres) : ""; };
  return EndsText(end(interval.low), end(interval.high));
}

std::string Range(const GateResult& r, const std::string& unit, double metres) {
  if (r.measure.complete && r.measure.value) return "complete";
  if (!r.measure.interval) return "-";
  return fmt::format("{} ({:.3g} %)", Ends(*r.measure.interval, r.limit, unit, metres), 100 * r.measure.confidence);
}

std::string Hint(const GateResult& r) {
  const auto about = [](int n, const char* what) {
    return fmt::format("about {} more {}{}", n, what, n > 1 ? "s" : "");
  };
  if (r.more_stations && r.more_runs) {
    return fmt::format("; {}, or {} past the same ones, would decide", about(*r.more_stations, "station"),
                       about(*r.more_runs, "run"));
  }
  if (r.more_stations) return "; " + about(*r.more_stations, "station") + " would decide";
  if (r.more_runs) return "; " + about(*r.more_runs, "run") + " would decide";
  return "; the value is too near the limit for more stations or runs to decide";
}

std::string Message(const GateResult& r) {
  const GateMeasure& m = r.measure;
  std::string text = ToString(r.verdict) + ": " + r.Text();
  if (!m.subject.empty()) text += " (" + m.subject + ")";
  if (!m.value) return text + ": " + (m.reason.empty() ? "not evaluated" : m.reason);
  text += ": " + Number(*m.value, r.limit, "m", 1);
  if (m.interval) {
    // The unit once.
    text += fmt::format(", {:.3g} % interval {}", 100 * m.confidence,
                        IsOpen(*m.interval)
                            ? Ends(*m.interval, r.limit, "m", 1)
                            : fmt::format("{:.3g} to {}", m.interval->low, Number(m.interval->high, r.limit, "m", 1)));
  }
  if (m.n > 0) text += fmt::format(", n = {} {}", m.n, m.counted);
  if (!m.reason.empty()) text += "; " + m.reason;
  if (!m.note.empty()) text += "; " + m.note;
  if (r.verdict == Verdict::kUndecided && m.interval && !IsOpen(*m.interval) && m.design) text += Hint(r);
  return text;
}

}  // namespace

std::string ToString(Verdict verdict) {
  return verdict == Verdict::kPassed ? "passed" : verdict == Verdict::kFailed ? "failed" : "undecided";
}

std::string GateResult::Text() const {
  return fmt::format("{} {} {:g}{}", limit.Gate(), limit.upper ? "<=" : ">=", limit.limit,
                     limit.unit.empty() ? "" : " " + limit.unit);
}

GateResult Judge(const GateLimit& limit, const GateMeasure& measure) {
  GateResult r{.limit = limit, .measure = measure};
  if (measure.value && (measure.complete || measure.interval)) {
    const Interval range = measure.complete ? Interval{*measure.value, *measure.value} : *measure.interval;
    const bool within = limit.upper ? range.high <= limit.limit : range.low >= limit.limit;
    const bool beyond = limit.upper ? range.low > limit.limit : range.high < limit.limit;
    r.verdict = within ? Verdict::kPassed : beyond ? Verdict::kFailed : Verdict::kUndecided;
  }
  if (r.verdict == Verdict::kUndecided && measure.value && measure.interval && measure.design) MoreData(&r);
  r.message = Message(r);
  return r;
}

std::vector<GateResult> JudgeAll(const std::vector<GateLimit>& limits, const std::vector<GateMeasure>& measures) {
  std::vector<GateResult> results;
  for (const GateLimit& limit : limits) {
    const size_t before = results.size();
    for (const GateMeasure& measure : measures) {
      if (measure.gate == limit.Gate()) results.push_back(Judge(limit, measure));
    }
    if (results.size() == before) results.push_back(Judge(limit, {.gate = limit.Gate()}));
  }
  return results;
}

Verdict OverallVerdict(const std::vector<GateResult>& results) {
  const auto any = [&](Verdict verdict) {
    return std::any_of(results.begin(), results.end(), [&](const GateResult& r) { return r.verdict == verdict; });
  };
  if (any(Verdict::kFailed)) return Verdict::kFailed;
  return results.empty() || any(Verdict::kUndecided) ? Verdict::kUndecided : Verdict::kPassed;
}

std::string FormatGates(const std::vector<GateResult>& results, const std::string& unit, double metres_per_unit) {
  std::vector<std::vector<std::string>> lines{{"gate", "of", "verdict", "value", "interval", "limit", "n"}};
  std::string messages;
  for (const GateResult& r : results) {
    const GateMeasure& m = r.measure;
    lines.push_back({r.limit.Gate(), m.subject.empty() ? "-" : m.subject, ToString(r.verdict),
                     m.value ? Number(*m.value, r.limit, unit, metres_per_unit) : "-", Range(r, unit, metres_per_unit),
                     (r.limit.upper ? "<= " : ">= ") + Number(r.limit.limit, r.limit, unit, metres_per_unit),
                     m.n > 0 ? fmt::format("{} {}", m.n, m.counted) : "-"});
    if (r.verdict != Verdict::kPassed) messages += "- " + r.message + "\n";
  }
  return fmt::format("### Gates: {}\n\n{}{}", ToString(OverallVerdict(results)), AlignMarkdown(lines),
                     messages.empty() ? "" : "\n" + messages);
}

nlohmann::json GateJson(const GateResult& r) {
  const GateMeasure& m = r.measure;
  return {{"gate", r.limit.Gate()},
          {"stage", r.limit.section},
          {"name", r.limit.name},
          {"of", m.subject},
          {"verdict", ToString(r.verdict)},
          {"limit", r.limit.limit},
          {"limit_is", r.limit.upper ? "most" : "least"},
          {"unit", r.limit.unit},
          {"value", OrNull(m.value)},
          {"complete", m.complete},
          {"interval", OrNull(m.interval)},
          {"confidence", m.interval ? nlohmann::json(m.confidence) : nlohmann::json()},
          {"n", m.n},
          {"n_counts", m.counted},
          {"reason", m.reason},
          {"note", m.note},
          {"more_stations", OrNull(r.more_stations)},
          {"more_runs", OrNull(r.more_runs)},
          {"message", r.message}};
}

nlohmann::json GatesJson(const std::vector<GateResult>& results) {
  nlohmann::json rows = nlohmann::json::array();
  for (const GateResult& r : results) rows.push_back(GateJson(r));
  return {{"schema", "trigpoint gates 1"}, {"verdict", ToString(OverallVerdict(results))}, {"gates", rows}};
}

}  // namespace trigpoint
