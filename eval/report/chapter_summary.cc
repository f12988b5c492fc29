#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <tuple>

#include "eval/report/chapters.h"
#include "eval/report/verdict.h"
#include "eval/text/method_name.h"

namespace trigpoint {

std::string ChapterContext::Length(const std::optional<double>& metres, int decimals) const {
  return NumberText(metres, decimals, "", unit.metres);
}

std::string ChapterContext::LengthUnit(const std::optional<double>& metres, int decimals) const {
  return metres ? Length(metres, decimals) + " " + unit.name : "unknown";
}

TableCell ChapterContext::LengthCell(const std::optional<double>& metres, int decimals) const {
  return {Length(metres, decimals), metres};
}

std::string GroupName(const nlohmann::json& group) {
  const std::string variant = TextAt(group, "variant");
  return TextAt(group, "method") + " against " + TextAt(group, "reference") + ", " + TextAt(group, "kind") +
         (FlagAt(group, "shares_evidence") && TextAt(group, "reference") != "self" ? ", shared evidence" : "") +
         (variant.empty() ? "" : ", variant " + variant);
}

std::string GroupTitle(const nlohmann::json& group) {
  return GroupTitle(TextAt(group, "method"), TextAt(group, "reference"), TextAt(group, "kind"),
                    FlagAt(group, "shares_evidence"), TextAt(group, "variant"));
}

std::string GroupTitle(const std::string& method, const std::string& reference, const std::string& kind,
                       bool shares_evidence, const std::string& variant) {
  return MethodName(method) + " against " + ReferenceName(reference) + ", " + kind +
         (shares_evidence && reference != "self" ? ", shared evidence" : "") +
         (variant.empty() ? "" : ", variant " + variant);
}

std::vector<nlohmann::json> Groups(const ReportData& data) {
  std::vector<nlohmann::json> groups;
  for (const VariantData& variant : data.variants) {
    const auto it = variant.summary.find("groups");
    if (it == variant.summary.end() || !it->is_array()) continue;
    for (nlohmann::json group : *it) {
      if (!group.is_object()) continue;
      if (TextAt(group, "variant").empty()) group["variant"] = variant.variant;
      groups.push_back(std::move(group));
    }
  }
  std::stable_sort(groups.begin(), groups.end(), [](const nlohmann::json& a, const nlohmann::json& b) {
    const auto rank = [](const nlohmann::json& g) {
      return std::tuple(!TextAt(g, "variant").empty(), TextAt(g, "method") == "g1", TextAt(g, "kind") != "absolute",
                        FlagAt(g, "shares_evidence"));
    };
    return rank(a) < rank(b);
  });
  return groups;
}

std::string CellKey(const std::string& run, const std::string& variant, const std::string& panorama) {
  return run + "@" + variant + "/" + panorama;
}

Headline FindHeadline(const ReportData& data) {
  Headline best;
  int best_rank = -1;
  for (const VariantData& variant : data.variants) {
    const auto groups = variant.summary.find("groups");
    if (groups == variant.summary.end() || !groups->is_array()) continue;
    for (const nlohmann::json& group : *groups) {
      if (!At(group, {"error_3d", "over_answers", "median_m"})) continue;
      const bool absolute = TextAt(group, "kind") == "absolute", shared = FlagAt(group, "shares_evidence");
      const int rank = (absolute && !shared ? 16
                        : absolute          ? 2
                                            : 4) +
                       (variant.variant.empty() && TextAt(group, "variant").empty() ? 8 : 0) +
                       (TextAt(group, "method") != "g1" ? 4 : 0) + (TextAt(group, "reference") == "survey" ? 1 : 0);
      if (rank > best_rank) best_rank = rank, best = {&variant, group};
    }
  }
  return best;
}

namespace {

std::string Percent(double share) { return fmt::format("{:.0f} %", 100 * share); }

// "between 0.1 and 0.6 m (95 % confidence)".
std::string IntervalText(const ChapterContext& c, const nlohmann::json& group, const char* key, double confidence) {
  const std::optional<Interval> interval = IntervalAt(group, key);
  if (!interval) return "too few answers for an interval";
  return fmt::format("{:.0f} % interval {} to {}", 100 * confidence, c.Length(interval->low, 2),
                     c.LengthUnit(interval->high, 2));
}

void AddHeadline(const ChapterContext& c, const Headline& headline, std::vector<Block>* blocks) {
  const nlohmann::json& g = headline.group;
  const double confidence = At(headline.variant->summary, {"confidence"}).value_or(0.95);
  const auto attempts = At(g, {"attempts"}), answers = At(g, {"answers"});
  const auto median = At(g, {"error_3d", "over_answers", "median_m"});
  const auto p90 = At(g, {"error_3d", "over_answers", "p90_m"});
  const auto worst = At(g, {"error_3d", "over_answers", "max_m"});
  const bool accuracy = TextAt(g, "kind") == "absolute" && !FlagAt(g, "shares_evidence");
  const std::string word = accuracy ? "error" : "difference";
  Facts facts;
  if (attempts && answers) {
    facts.facts.push_back({"Answered", fmt::format("{:.0f} of {:.0f}", *answers, *attempts),
                           (*attempts > 0 ? Percent(*answers / *attempts) + " " : "") +
                               "of the pairs of a run and a station whose place is known",
                           *answers > 0 ? Tone::kPlain : Tone::kBad});
  }
  facts.facts.push_back(
      {"Median 3D " + word, c.LengthUnit(median, 2), IntervalText(c, g, "median_interval_m", confidence)});
  facts.facts.push_back({"90 % are within", c.LengthUnit(p90, 2), IntervalText(c, g, "p90_interval_m", confidence)});
  if (const std::optional<SigmaTest> test = SigmasOf(g)) {
    facts.facts.push_back(
        {"Stated sigmas", test->Words(),
         fmt::format("mean squared error in units of its own covariance (ANEES) {:.2f}; 1 is right, {:.0f} % bounds "
                     "{:.2f} to {:.2f}",
                     test->anees, 100 * confidence, test->low, test->high),
         test->Consistent() ? Tone::kGood : Tone::kWarning});
  }
  blocks->push_back(facts);
  std::string text = fmt::format(
      "These numbers are {}: the place of each localized panorama against the place that its {} gives, in three "
      "dimensions, over the answers that were given. The tables call this comparison \"{}\".",
      accuracy ? "accuracy against a reference that the tested runs had no part in"
               : "agreement, not accuracy: both sides use the same data, so that common errors cancel",
      TextAt(g, "reference") == "self" ? "tag, as seen by the same run's cameras, and the measured offset"
                                       : "reference and the measured offset",
      GroupTitle(g));
  if (worst) text += " The largest is " + c.LengthUnit(worst, 2) + ".";
  blocks->push_back(Paragraph{text});
  if (worst && median && *worst > 20 * *median && *worst > 1) {
    blocks->push_back(Paragraph{
        "At least one answer is wrong by far more than the others; the table of the worst cells below names it.",
        Tone::kWarning});
  }
}

// What else was held against the headline's reference: G1, other variants.
void AddOtherMethods(const ChapterContext& c, const Headline& headline, std::vector<Block>* blocks) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{
      "side_by_side",
      "The same comparison for every method and variant. Panorama (G2): one pose for the whole panorama, the final "
      "answer; view (G1): one pose for each view of it by itself; variant paper: the published method.",
      {{"method"}, {"answered"}, {"median 3D" + u, true}, {"90 % are within" + u, true}, {"largest" + u, true}},
      {}};
  for (const nlohmann::json& g : Groups(c.data)) {
    if (TextAt(g, "reference") != TextAt(headline.group, "reference") ||
        TextAt(g, "kind") != TextAt(headline.group, "kind"))
      continue;
    const auto cell = [&](const char* key) { return c.LengthCell(At(g, {"error_3d", "over_answers", key}), 2); };
    table.rows.push_back(
        {{MethodName(TextAt(g, "method"), TextAt(g, "variant"))},
         {fmt::format("{:.0f} of {:.0f}", At(g, {"answers"}).value_or(0), At(g, {"attempts"}).value_or(0)),
          At(g, {"answers"})},
         cell("median_m"),
         cell("p90_m"),
         cell("max_m")});
  }
  if (table.rows.size() > 1) blocks->push_back(table);
}

// The cells to look at first: each once, in the headline's comparison where it is one; our first variant before others,
// then those beyond a gate or their own sigmas, then by size.
std::vector<const ErrorRecord*> CellsToLookAt(const ChapterContext& c, const Headline& headline) {
  const std::string variant = headline.group.is_object() ? TextAt(headline.group, "variant") : "";
  std::vector<const ErrorRecord*> cells = WorstFirst(c.data);
  const auto in_headline = [&](const ErrorRecord* e) {
    return headline.group.is_object() && e->reference == TextAt(headline.group, "reference") &&
           e->kind == TextAt(headline.group, "kind");
  };
  std::map<std::string, const ErrorRecord*> of_cell;
  for (const ErrorRecord* e : cells) {
    const ErrorRecord*& kept = of_cell[CellKey(e->run, e->variant, e->panorama + e->station + e->method)];
    if (kept == nullptr || (in_headline(e) && !in_headline(kept))) kept = e;
  }
  std::erase_if(cells, [&](const ErrorRecord* e) {
    return of_cell[CellKey(e->run, e->variant, e->panorama + e->station + e->method)] != e;
  });
  std::stable_partition(cells.begin(), cells.end(), [&](const ErrorRecord* e) { return e->variant == variant; });
  return cells;
}

// A gate's number as the table shows it; lengths in the report's unit.
TableCell GateNumber(const ChapterContext& c, const nlohmann::json& gate, const std::optional<double>& value) {
  const std::string unit = TextAt(gate, "unit");
  if (!value) return {};
  const bool length = unit == "m";
  return {fmt::format("{:.3g} {}", length ? *value / c.unit.metres : *value, length ? c.unit.name : unit), value};
}

void AddGates(const ChapterContext& c, std::vector<Block>* blocks) {
  std::vector<std::pair<std::string, nlohmann::json>> tables = c.data.gates;
  const bool defaults = tables.empty() && c.input.default_gates.is_object();
  if (defaults) tables.emplace_back("", c.input.default_gates);
  for (const auto& [variant, all] : tables) {
    const std::string verdict = TextAt(all, "verdict");
    const std::string which = defaults ? "Default gates (trigpoint.yaml sets none; no exit code depends on them)"
                              : variant.empty() ? "Quality gates"
                                                : "Quality gates of variant " + variant;
    blocks->push_back(Paragraph{which + ": " + (verdict.empty() ? "unknown" : verdict), GateTone(verdict)});
    const auto rows = all.find("gates");
    if (rows == all.end() || !rows->is_array()) continue;
    Table table{
        "gates" + (variant.empty() ? "" : "_" + variant),
        "Each gate is decided by the confidence interval, not by the value alone: passed if all of it is within "
        "the limit, failed if all of it is beyond, else undecided, as is what was not evaluated. Complete: "
        "every item was looked at, so that the value decides.",
        {{"gate"},
         {"of", false, "the whole project"},
         {"verdict"},
         {"value", true, "not evaluated"},
         {"interval", false, "none can be computed"},
         {"limit", true},
         {"n", true},
         {"reason", false, "the numbers decide"}},
        {}};
    for (const nlohmann::json& gate : *rows) {
      const std::string its = TextAt(gate, "verdict");
      std::string interval = FlagAt(gate, "complete") ? "complete" : "";
      if (const auto ends = EndsAt(gate, "interval"); ends && (ends->low || ends->high)) {
        interval = fmt::format("{} ({:.3g} %)",
                               EndsText(GateNumber(c, gate, ends->low).text, GateNumber(c, gate, ends->high).text),
                               100 * At(gate, {"confidence"}).value_or(0));
      }
      TableCell limit = GateNumber(c, gate, At(gate, {"limit"}));
      limit.text = (TextAt(gate, "limit_is") == "least" ? ">= " : "<= ") + limit.text;
      const std::string reason = TextAt(gate, "reason"), note = TextAt(gate, "note");
      table.rows.push_back({{TextAt(gate, "gate")},
                            {TextAt(gate, "of")},
                            {its, {}, GateTone(its)},
                            GateNumber(c, gate, At(gate, {"value"})),
                            {interval},
                            limit,
                            {fmt::format("{:.0f} {}", At(gate, {"n"}).value_or(0), TextAt(gate, "n_counts"))},
                            {reason + (reason.empty() || note.empty() ? "" : "; ") + note}});
    }
    blocks->push_back(table);
  }
}

}  // namespace

std::vector<const ErrorRecord*> WorstFirst(const ReportData& data) {
  double limit = 0;
  for (const auto& [variant, table] : data.gates) {
    const auto rows = table.find("gates");
    if (rows == table.end() || !rows->is_array()) continue;
    for (const nlohmann::json& row : *rows) {
      const std::string gate = TextAt(row, "gate");
      if (gate == "evaluate.max_median_m" || gate == "evaluate.max_p90_m") limit = At(row, {"limit"}).value_or(limit);
    }
  }
  std::vector<std::pair<double, const ErrorRecord*>> ranked;
  for (const VariantData& variant : data.variants) {
    for (const ErrorRecord& e : variant.errors) {
      if (!e.Answered() || e.method == "g1") continue;
      // Cells beyond a gate or a 99.9 % NEES bound before all others, then by size.
      const bool fails = (limit > 0 && *e.error_3d_m > limit) || (e.nees && e.dof > 0 && *e.nees > 5.5 * e.dof);
      ranked.emplace_back(*e.error_3d_m + (fails ? 1e6 : 0), &e);
    }
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<const ErrorRecord*> records;
  for (const auto& [rank, record] : ranked) records.push_back(record);
  return records;
}

void AddSummary(const ChapterContext& c, std::vector<Block>* blocks) {
  const Headline headline = FindHeadline(c.data);
  AddGates(c, blocks);
  if (headline.group.is_object()) {
    AddHeadline(c, headline, blocks);
    AddOtherMethods(c, headline, blocks);
  } else if (c.data.variants.empty()) {
    blocks->push_back(Paragraph{"Nothing was evaluated: trigpoint evaluate has no result, so the accuracy is unknown.",
                                Tone::kWarning});
  } else {
    blocks->push_back(
        Paragraph{"No answer could be compared with a reference: their accuracy is unknown. The reasons are listed "
                  "with the stations.",
                  Tone::kWarning});
  }
  const std::vector<const ErrorRecord*> worst = CellsToLookAt(c, headline);
  if (!worst.empty()) {
    Table table{
        "worst_cells",
        "Where to look first: the largest differences, those beyond a gate or a 99.9 % bound of their own sigmas "
        "before the others. NEES / dof: squared error in its own sigmas, 1 on average where these are right.",
        {{"station"},
         {"panorama"},
         {"run"},
         {"method"},
         {"against"},
         {"3D (" + c.unit.name + ")", true},
         {"NEES / dof", true, "the answer has no covariance"}},
        {}};
    for (size_t i = 0; i < std::min<size_t>(8, worst.size()); ++i) {
      const ErrorRecord& e = *worst[i];
      TableCell station{e.station};
      if (const auto it = c.station_anchor.find(e.station); it != c.station_anchor.end()) station.anchor = it->second;
      TableCell nees;
      if (e.nees && e.dof > 0) nees = {fmt::format("{:.1f}", *e.nees / e.dof), *e.nees / e.dof};
      table.rows.push_back({station,
                            {std::filesystem::path(e.panorama).filename().string()},
                            {c.RunName(e.run, e.variant)},
                            {MethodName(e.method)},
                            {ReferenceName(e.reference) + ", " + e.kind},
                            c.LengthCell(e.error_3d_m),
                            nees});
    }
    blocks->push_back(table);
  }
  if (!c.data.notes.empty()) {
    blocks->push_back(
        FoldBegin{fmt::format("Notes: {} that could not be used or {} attention",
                              c.data.notes.size() == 1 ? "one thing" : std::to_string(c.data.notes.size()) + " things",
                              c.data.notes.size() == 1 ? "needs" : "need")});
    for (size_t i = 0; i < std::min<size_t>(40, c.data.notes.size()); ++i)
      blocks->push_back(Paragraph{c.data.notes[i]});
    if (c.data.notes.size() > 40)
      blocks->push_back(Paragraph{fmt::format("... and {} more.", c.data.notes.size() - 40)});
    blocks->push_back(FoldEnd{});
  }
}

}  // namespace trigpoint
