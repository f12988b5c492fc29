#include "eval/errors/evaluation_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "eval/errors/paper_tables.h"
#include "eval/text/interval_text.h"
#include "eval/text/json_values.h"
#include "eval/text/markdown.h"
#include "eval/text/number_text.h"

namespace trigpoint {
namespace {

constexpr int kDecimals = 9;

std::string InUnit(const std::optional<double>& metres, const TableOptions& options, const char* missing = "-") {
  return NumberText(metres, options.decimals, missing, options.unit.metres);
}

std::string Title(const ErrorGroup& g) {
  return fmt::format("{}, {}, reference = {}{}{}", g.method, g.kind, g.reference,
                     g.variant.empty() ? "" : ", variant " + g.variant,
                     g.shares_evidence && g.reference != "self" ? " (shares evidence with the run)" : "");
}

std::string FileStem(const ErrorGroup& g) {
  std::string stem = fmt::format("table_{}_{}_{}{}{}", g.method, g.reference, g.kind,
                                 g.shares_evidence && g.reference != "self" ? "_shared" : "",
                                 g.variant.empty() ? "" : "@" + g.variant);
  std::replace_if(
      stem.begin(), stem.end(), [](char c) { return c == '/' || c == '\\'; }, '_');
  return stem;
}

ErrorTable TableOf(const PaperTable& paper) {
  ErrorTable table{.title = paper.caption};
  for (size_t tag = 0; tag < paper.error_m[0].size(); ++tag) table.columns.push_back(std::to_string(tag + 1));
  for (size_t run = 0; run < paper.error_m.size(); ++run) {
    table.rows.push_back("run " + std::to_string(run + 1));
    table.cells.emplace_back(paper.error_m[run].begin(), paper.error_m[run].end());
  }
  return table;
}

std::string Percent(double share) { return fmt::format("{:.1f} %", 100 * share); }

std::string FormatStatistics(const std::string& what, const ErrorStatistics& s, const TableOptions& o) {
  return fmt::format(
      "{}: {} answers of {} attempts; over answers median {}, mean {}, P90 {}, max {}; over attempts "
      "median {}, P90 {} {}\n",
      what, s.answers, s.attempts, InUnit(s.median, o), InUnit(s.mean, o), InUnit(s.p90, o), InUnit(s.max, o),
      InUnit(s.median_attempts, o), InUnit(s.p90_attempts, o), o.unit.name);
}

std::string FormatShares(const ErrorStatistics& s) {
  return fmt::format("Within 1.0 m: {} of answers, {} of attempts; within 1.5 m: {} and {}\n", Percent(s.within_1m),
                     Percent(s.within_1m_attempts), Percent(s.within_1m5), Percent(s.within_1m5_attempts));
}

std::string FormatPaperTable(const PaperTable& paper, const TableOptions& options) {
  std::vector<double> errors;
  int blanks = 0;
  for (const auto& run : paper.error_m) {
    for (const auto& cell : run) cell ? errors.push_back(*cell) : void(++blanks);
  }
  const ErrorStatistics s = Summarize(errors, blanks);
  return FormatMarkdown(TableOf(paper), options) + "\n" + FormatStatistics("3D", s, options) + FormatShares(s);
}

nlohmann::json Json(const std::vector<CumulativePoint>& curve) {
  nlohmann::json points = nlohmann::json::array();
  for (const CumulativePoint& p : curve) {
    points.push_back({{"error_m", p.error}, {"share", p.share}, {"low", p.low}, {"high", p.high}});
  }
  return points;
}

// Blank percentiles are null with the reason beside them in `answers` and `attempts`.
nlohmann::json Json(const ErrorStatistics& s) {
  return {{"answers", s.answers},
          {"attempts", s.attempts},
          {"over_answers",
           {{"median_m", OrNull(s.median)},
            {"p90_m", OrNull(s.p90)},
            {"mean_m", OrNull(s.mean)},
            {"rmse_m", OrNull(s.rmse)},
            {"max_m", OrNull(s.max)},
            {"within_1m", s.within_1m},
            {"within_1m5", s.within_1m5}}},
          {"over_attempts",
           {{"median_m", OrNull(s.median_attempts)},
            {"p90_m", OrNull(s.p90_attempts)},
            {"within_1m", s.within_1m_attempts},
            {"within_1m5", s.within_1m5_attempts}}}};
}

const std::vector<std::string>& ErrorColumns() {
  static const std::vector<std::string> columns{
      "run",           "variant",   "method",     "station",   "panorama",  "tag_id", "reference", "kind",
      "status",        "reason",    "error_3d_m", "error_h_m", "error_v_m", "de_m",   "dn_m",      "du_m",
      "error_rot_deg", "sigma_e_m", "sigma_n_m",  "sigma_u_m", "nees",      "dof"};
  return columns;
}

// Beyond what every version has had.
const std::vector<std::string>& FurtherColumns() {
  static const std::vector<std::string> columns{
      "nees_h",        "nees_v",       "sigma_tag_map_m", "sigma_offset_m", "sigma_stitch_m", "sigma_localization_m",
      "dominant",      "parallax_deg", "structure_m",     "depth_sigma_m",  "trusted",        "shares_evidence",
      "sigma_rot_deg", "attempt"};
  return columns;
}

void WriteErrors(const Evaluation& evaluation, const std::filesystem::path& file) {
  std::vector<std::string> columns = ErrorColumns();
  columns.insert(columns.end(), FurtherColumns().begin(), FurtherColumns().end());
  CsvWriter csv(columns, {"trigpoint errors 1; unit=m; axes=enu; sigma=1"});
  const auto number = [&](const std::optional<double>& v) { v ? csv.Number(*v, kDecimals) : csv.Empty(); };
  for (const ErrorRow& row : evaluation.rows) {
    csv.Text(row.run).Text(row.variant).Text(row.method).Text(row.station).Text(row.panorama);
    row.tag_id >= 0 ? csv.Integer(row.tag_id) : csv.Empty();
    csv.Text(row.reference).Text(row.kind).Text(row.status).Text(row.reason);
    number(row.error_3d_m);
    number(row.error_h_m);
    number(row.error_v_m);
    for (int i = 0; i < 3; ++i) row.error_enu_m ? csv.Number((*row.error_enu_m)[i], kDecimals) : csv.Empty();
    number(row.error_rot_deg);
    for (int i = 0; i < 3; ++i) {
      row.covariance_m2 ? csv.Number(std::sqrt((*row.covariance_m2)(i, i)), kDecimals) : csv.Empty();
    }
    number(row.nees);
    row.nees ? csv.Integer(row.dof) : csv.Empty();
    number(row.nees_h);
    number(row.nees_v);
    number(row.sigma_tag_map_m);
    number(row.sigma_station_offset_m);
    number(row.sigma_stitch_m);
    number(row.sigma_localization_m);
    csv.Text(row.dominant);
    row.depth
        ? csv.Number(row.depth->parallax_deg, 4).Number(row.depth->structure_m, 4).Number(row.depth->depth_sigma_m, 6)
        : csv.Empty(3);
    row.trusted ? csv.Text(*row.trusted ? "yes" : "no") : csv.Empty();
    csv.Text(row.shares_evidence ? "yes" : "no");
    number(row.sigma_rot_deg);
    csv.Text(row.attempt ? "yes" : "no").EndRow();
  }
  csv.Save(file);
}

void PutGroup(const ErrorGroup& g, CsvWriter* csv) {
  csv->Text(g.variant).Text(g.method).Text(g.reference).Text(g.kind).Text(g.shares_evidence ? "yes" : "no");
}

void WriteCurves(const Evaluation& evaluation, const std::filesystem::path& folder) {
  CsvWriter histogram({"variant", "method", "reference", "kind", "shares_evidence", "error_m", "share", "low", "high"},
                      {fmt::format("trigpoint histogram 1; share of attempts with at most this 3D error; pointwise "
                                   "{:.0f} % band by station and run",
                                   100 * evaluation.options.confidence)});
  CsvWriter risk({"variant", "method", "reference", "kind", "shares_evidence", "coverage", "depth_sigma_m", "median_m",
                  "p90_m", "max_m"},
                 {"trigpoint coverage_risk 1; 3D errors of the share of answers with the best supported depth"});
  for (const GroupSummary& g : evaluation.groups) {
    for (const CumulativePoint& p : g.cumulative) {
      PutGroup(g.group, &histogram);
      histogram.Number(p.error, kDecimals).Number(p.share, 6).Number(p.low, 6).Number(p.high, 6).EndRow();
    }
    for (const RiskPoint& p : g.coverage_risk) {
      PutGroup(g.group, &risk);
      risk.Number(p.coverage, 6).Number(p.threshold, 6).Number(p.median_m, kDecimals).Number(p.p90_m, kDecimals);
      risk.Number(p.max_m, kDecimals).EndRow();
    }
  }
  histogram.Save(folder / "histogram.csv");
  risk.Save(folder / "coverage_risk.csv");
}

std::string FormatIntervals(const std::string& what, const PercentileIntervals& i, double confidence,
                            const TableOptions& o) {
  std::string text;
  const auto add = [&](const char* name, const std::optional<Interval>& interval) {
    if (!interval) return;
    text += fmt::format("{}{} ", text.empty() ? "" : ", ", name);
    text += IsInformative(*interval) ? InUnit(interval->low, o) + " to " + InUnit(interval->high, o) : "too few";
  };
  add("median", i.median);
  add("P90", i.p90);
  add("median over attempts", i.median_attempts);
  add("P90 over attempts", i.p90_attempts);
  if (text.empty()) return "";
  return fmt::format("{} {:.0f} % interval by station and run: {} {}\n", what, 100 * confidence, text, o.unit.name);
}

std::string FormatNees(const std::string& what, const NeesSummary& n, double confidence) {
  if (n.dof < 1) return "";
  const Interval bounds = n.Bounds(confidence);
  return fmt::format("{}: {:.2f}, {} {:.2f} to {:.2f} (n = {})\n", what, n.PerDof(),
                     n.Inside(confidence) ? "within" : "outside", bounds.low, bounds.high, n.rows);
}

std::string FormatConsistency(const GroupSummary& g, double confidence, const TableOptions& o) {
  std::string text;
  text += FormatNees("ANEES per degree of freedom, horizontal", g.nees_h, confidence);
  text += FormatNees("ANEES per degree of freedom, vertical", g.nees_v, confidence);
  if (g.nees_joint) text += FormatNees("NEES per degree of freedom with joint covariance", *g.nees_joint, confidence);
  for (const auto* groups : {&g.nees_by_run, &g.nees_by_station}) {
    for (const auto& [name, n] : *groups) {
      if (!n.Inside(confidence)) text += "- " + FormatNees(name + " ANEES", n, confidence);
    }
  }
  if (!g.budget_m.empty()) {
    std::string parts;
    for (const auto& [name, sigma] : g.budget_m) {
      parts += fmt::format("{}{} {}", parts.empty() ? "" : ", ", name, InUnit(sigma, o));
    }
    text += fmt::format("Error budget, 1 sigma in space, {}: {}; {} dominates\n", o.unit.name, parts, g.dominant);
  }
  if (!g.coverage_risk.empty()) {
    text += fmt::format("Depth rule: {} of {} answers not to be trusted", g.untrusted, g.coverage_risk.size());
    if (g.error_untrusted.median && g.error_trusted.median) {
      text += fmt::format(", their median {} against {} {} of the others", InUnit(g.error_untrusted.median, o),
                          InUnit(g.error_trusted.median, o), o.unit.name);
    }
    text += "\n";
  }
  return text;
}

std::string FormatExtras(const EvaluationExtras& extras, const TableOptions& options) {
  std::string text;
  if (!extras.comparisons.empty()) {
    text += "### Paired comparisons\n\n";
    for (const NamedComparison& c : extras.comparisons) {
      text += fmt::format("- {}, {} against {}: {}\n", c.group.answer, c.group.kind, c.group.reference,
                          Describe(c.group.paired, c.a, c.b, options.unit.name, options.unit.metres));
    }
    text += "\n";
  }
  for (const std::string& note : extras.notes) text += note + "\n";
  return text;
}

nlohmann::json Json(const NeesSummary& n, double confidence) {
  const Interval bounds = n.Bounds(confidence);
  return {{"count", n.rows},
          {"dof", n.dof},
          {"mean_per_dof", n.PerDof()},
          {"bounds", {bounds.low, bounds.high}},
          {"inside", n.Inside(confidence)}};
}

nlohmann::json Json(const std::map<std::string, NeesSummary>& groups, double confidence) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, n] : groups) json[name] = Json(n, confidence);
  return json;
}

nlohmann::json Json(const PercentileIntervals& i) {
  return {{"over_answers", {{"median_m", OrNull(i.median)}, {"p90_m", OrNull(i.p90)}}},
          {"over_attempts", {{"median_m", OrNull(i.median_attempts)}, {"p90_m", OrNull(i.p90_attempts)}}}};
}

nlohmann::json Json(const EvaluationExtras& extras) {
  nlohmann::json comparisons = nlohmann::json::array();
  for (const NamedComparison& c : extras.comparisons) {
    comparisons.push_back(PairedJson(c.group));
    comparisons.back().update({{"a", c.a}, {"b", c.b}});
  }
  return {{"comparisons", comparisons}};
}

}  // namespace

std::vector<ErrorTable> ErrorTables(const Evaluation& evaluation) {
  std::vector<ErrorTable> tables;
  for (const GroupSummary& group : evaluation.groups) {
    ErrorTable table{.title = Title(group.group)};
    // Columns: stations in their order; each panorama of a station that has several.
    std::map<std::string, std::vector<std::string>> panoramas;
    std::map<std::string, std::map<std::pair<std::string, std::string>, std::optional<double>>> by_run;
    for (const ErrorRow& row : evaluation.rows) {
      if (ErrorGroup{row.variant, row.method, row.reference, row.kind, row.shares_evidence} != group.group) continue;
      std::vector<std::string>& names = panoramas[row.station];
      if (!row.panorama.empty() && std::find(names.begin(), names.end(), row.panorama) == names.end()) {
        names.push_back(row.panorama);
      }
      by_run[row.run][{row.station, row.panorama}] = row.error_3d_m;
    }
    std::vector<std::pair<std::string, std::string>> keys;
    for (const std::string& station : evaluation.stations) {
      const std::vector<std::string>& names = panoramas[station];
      if (names.empty()) keys.emplace_back(station, "");
      for (const std::string& name : names) keys.emplace_back(station, name);
      if (names.size() < 2) {
        table.columns.push_back(station);
      } else {
        for (const std::string& name : names) table.columns.push_back(fmt::format("{} / {}", station, name));
      }
    }
    for (const auto& [run, cells] : by_run) {
      table.rows.push_back(run);
      table.cells.emplace_back();
      for (const auto& key : keys) {
        const auto it = cells.find(key);
        table.cells.back().push_back(it == cells.end() ? std::nullopt : it->second);
      }
    }
    tables.push_back(std::move(table));
  }
  return tables;
}

std::string FormatMarkdown(const ErrorTable& table, const TableOptions& options) {
  std::vector<std::vector<std::string>> lines{{"run"}};
  lines[0].insert(lines[0].end(), table.columns.begin(), table.columns.end());
  for (size_t r = 0; r < table.rows.size(); ++r) {
    lines.push_back({table.rows[r]});
    for (const auto& cell : table.cells[r]) lines.back().push_back(InUnit(cell, options));
  }
  return fmt::format("### {} [{}]\n\n{}", table.title, options.unit.name, AlignMarkdown(lines));
}

std::string FormatCsv(const ErrorTable& table) {
  std::vector<std::string> columns{"run"};
  columns.insert(columns.end(), table.columns.begin(), table.columns.end());
  CsvWriter csv(columns, {"trigpoint table 1; unit=m; " + table.title});
  for (size_t r = 0; r < table.rows.size(); ++r) {
    csv.Text(table.rows[r]);
    for (const auto& cell : table.cells[r]) cell ? csv.Number(*cell, kDecimals) : csv.Empty();
    csv.EndRow();
  }
  return csv.text();
}

std::string FormatEvaluation(const Evaluation& evaluation, const TableOptions& options,
                             const EvaluationExtras& extras) {
  std::string text;
  const std::vector<ErrorTable> tables = ErrorTables(evaluation);
  for (size_t i = 0; i < tables.size(); ++i) {
    const GroupSummary& g = evaluation.groups[i];
    text += FormatMarkdown(tables[i], options) + "\n";
    text += FormatStatistics("3D", g.error_3d, options);
    const double confidence = evaluation.options.confidence;
    text += FormatIntervals("3D", g.intervals_3d, confidence, options);
    if (g.error_h.answers > 0) text += FormatStatistics("Horizontal", g.error_h, options);
    text += FormatIntervals("Horizontal", g.intervals_h, confidence, options);
    if (g.error_v.answers > 0) text += FormatStatistics("Vertical", g.error_v, options);
    text += FormatIntervals("Vertical", g.intervals_v, confidence, options);
    text += FormatShares(g.error_3d);
    text += fmt::format("Stations passed within {:g} m: {} answers of {}\n", evaluation.options.passed_radius_m,
                        g.passed_answers, g.passed);
    if (g.anees_per_dof && g.anees_bounds) {
      const bool inside = *g.anees_per_dof >= g.anees_bounds->low && *g.anees_per_dof <= g.anees_bounds->high;
      text += fmt::format("ANEES per degree of freedom: {:.2f}, {} {:.2f} to {:.2f} (n = {})\n", *g.anees_per_dof,
                          inside ? "within" : "outside", g.anees_bounds->low, g.anees_bounds->high, g.nees_count);
    }
    text += FormatConsistency(g, confidence, options);
    if (g.unscored > 0) text += fmt::format("Localized but without reference: {}\n", g.unscored);
    for (const auto& [reason, count] : g.reasons) text += fmt::format("- {} x {}\n", count, reason);
    text +=
        fmt::format("{}: estimate from {}; reference from {}\n\n",
                    g.group.shares_evidence ? "Agreement (both sides share evidence)" : "Accuracy (no evidence shared)",
                    fmt::join(g.estimate_rests_on, ", "), fmt::join(g.reference_rests_on, ", "));
  }
  if (options.paper_tables) {
    for (const PaperTable& paper : PaperTables()) text += FormatPaperTable(paper, options) + "\n";
  }
  text += FormatExtras(extras, options);
  for (const std::string& warning : evaluation.warnings) text += "Note: " + warning + "\n";
  return text;
}

nlohmann::json SummaryJson(const Evaluation& evaluation, const EvaluationExtras& extras) {
  const double confidence = evaluation.options.confidence;
  nlohmann::json groups = nlohmann::json::array();
  for (const GroupSummary& g : evaluation.groups) {
    groups.push_back(
        {{"variant", g.group.variant},
         {"method", g.group.method},
         {"reference", g.group.reference},
         {"kind", g.group.kind},
         {"shares_evidence", g.group.shares_evidence},
         {"estimate_rests_on", g.estimate_rests_on},
         {"reference_rests_on", g.reference_rests_on},
         {"runs", g.runs},
         {"stations", g.stations},
         {"attempts", g.attempts},
         {"answers", g.answers},
         {"without_reference", g.unscored},
         {"passed", {{"attempts", g.passed}, {"answers", g.passed_answers}}},
         {"reasons", g.reasons},
         {"cumulative", Json(g.cumulative)},
         {"error_3d", Json(g.error_3d)},
         {"error_h", Json(g.error_h)},
         {"error_v", Json(g.error_v)},
         {"median_interval_m", OrNull(g.median_interval)},
         {"p90_interval_m", OrNull(g.p90_interval)},
         {"intervals", {{"3d", Json(g.intervals_3d)}, {"h", Json(g.intervals_h)}, {"v", Json(g.intervals_v)}}},
         {"variance_shares", {{"station", g.station_share}, {"run", g.run_share}}},
         {"error_budget_sigma_m", g.budget_m},
         {"dominant", g.dominant},
         {"depth_rule",
          {{"limit_m", evaluation.options.trust_depth_sigma_m},
           {"answers", g.coverage_risk.size()},
           {"untrusted", g.untrusted},
           {"median_trusted_m", OrNull(g.error_trusted.median)},
           {"median_untrusted_m", OrNull(g.error_untrusted.median)}}},
         {"nees",
          {{"count", g.nees_count},
           {"mean_per_dof", OrNull(g.anees_per_dof)},
           {"bounds", OrNull(g.anees_bounds)},
           {"horizontal", Json(g.nees_h, confidence)},
           {"vertical", Json(g.nees_v, confidence)},
           {"joint", g.nees_joint ? Json(*g.nees_joint, confidence) : nlohmann::json()},
           {"by_run", Json(g.nees_by_run, confidence)},
           {"by_station", Json(g.nees_by_station, confidence)}}}});
  }
  nlohmann::json beside = Json(extras);
  nlohmann::json summary = {{"schema", "trigpoint evaluate 1"},
                            {"unit", "m"},
                            {"passed_radius_m", evaluation.options.passed_radius_m},
                            {"confidence", confidence},
                            {"stations", evaluation.stations},
                            {"groups", groups},
                            {"warnings", evaluation.warnings}};
  summary.update(beside);
  return summary;
}

void WriteEvaluation(const Evaluation& evaluation, const std::filesystem::path& folder, const TableOptions& options,
                     const EvaluationExtras& extras) {
  WriteErrors(evaluation, folder / "errors.csv");
  WriteCurves(evaluation, folder);
  WriteFileAtomically(folder / "summary.json", SummaryJson(evaluation, extras).dump(2) + "\n");
  WriteFileAtomically(folder / "tables.md", FormatEvaluation(evaluation, options, extras));
  const std::vector<ErrorTable> tables = ErrorTables(evaluation);
  for (size_t i = 0; i < tables.size(); ++i) {
    WriteFileAtomically(folder / (FileStem(evaluation.groups[i].group) + ".csv"), FormatCsv(tables[i]));
  }
}

std::vector<ErrorRow> ReadErrors(const std::filesystem::path& errors_csv) {
  std::vector<ErrorRow> rows;
  const CsvTable table = CsvTable::Read(errors_csv, ErrorColumns());
  const auto number = [](const CsvRow& row, const char* column) {
    return row.Has(column) ? std::optional<double>(row.Number(column)) : std::nullopt;
  };
  for (const CsvRow& cells : table.rows()) {
    ErrorRow row{.run = cells.Text("run"),
                 .variant = cells.Text("variant"),
                 .method = cells.Text("method"),
                 .station = cells.Text("station"),
                 .panorama = cells.Text("panorama"),
                 .tag_id = static_cast<int>(cells.Integer("tag_id", -1)),
                 .reference = cells.Text("reference"),
                 .kind = cells.Text("kind"),
                 .status = cells.Text("status"),
                 .reason = cells.Text("reason"),
                 .error_3d_m = number(cells, "error_3d_m"),
                 .error_h_m = number(cells, "error_h_m"),
                 .error_v_m = number(cells, "error_v_m"),
                 .error_rot_deg = number(cells, "error_rot_deg"),
                 .nees = number(cells, "nees"),
                 .dof = static_cast<int>(cells.Integer("dof", 0))};
    row.shares_evidence =
        cells.Has("shares_evidence") ? cells.Text("shares_evidence") == "yes" : row.reference == "self";
    row.attempt = cells.Has("attempt") ? cells.Text("attempt") == "yes" : row.status != "no_reference";
    if (cells.Has("de_m") && cells.Has("dn_m") && cells.Has("du_m")) {
      row.error_enu_m = {cells.Number("de_m"), cells.Number("dn_m"), cells.Number("du_m")};
    }
    if (cells.Has("sigma_e_m") && cells.Has("sigma_n_m") && cells.Has("sigma_u_m")) {
      const Eigen::Vector3d sigma(cells.Number("sigma_e_m"), cells.Number("sigma_n_m"), cells.Number("sigma_u_m"));
      row.covariance_m2 = sigma.cwiseAbs2().asDiagonal();
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

nlohmann::json EvaluationMetrics(const Evaluation& evaluation, const std::string& variant) {
  nlohmann::json metrics;
  nlohmann::json groups = nlohmann::json::array();
  int best = 0;
  for (const GroupSummary& group : evaluation.groups) {
    nlohmann::json entry = {{"variant", group.group.variant},
                            {"method", group.group.method},
                            {"reference", group.group.reference},
                            {"kind", group.group.kind},
                            {"attempts", group.attempts},
                            {"answers", group.answers},
                            {"median_m", OrNull(group.error_3d.median)}};
    // The one number that status and batch show: our own answers against a reference that shares nothing with them,
    // else against the run's own tags, else the first there is; never the more flattering where there is a better one.
    const bool independent = group.group.kind == "absolute" && !group.group.shares_evidence;
    const int rank = independent ? 3 : group.group.reference == "self" ? 2 : 1;
    if (group.error_3d.median && group.group.variant == variant && group.group.method != "g1" && rank > best) {
      best = rank;
      metrics["median_m"] = *group.error_3d.median;
      metrics["median_against"] = group.group.reference + ", " + group.group.kind;
    }
    groups.push_back(std::move(entry));
  }
  metrics["groups"] = groups;
  return metrics;
}

}  // namespace trigpoint
