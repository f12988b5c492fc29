#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "datasets/io/text.h"
#include "eval/report/chapters.h"
#include "eval/report/charts.h"
#include "eval/report/verdict.h"
#include "eval/statistics/distributions.h"
#include "eval/text/interval_text.h"
#include "eval/text/method_name.h"

namespace trigpoint {
namespace {

constexpr const char* kCoverageRisk = "coverage_risk";  // the evaluation's table of this name has a chart
constexpr size_t kFurtherRows = 400;                    // of a further table that are shown
constexpr size_t kCurvePoints = 400;                    // of a cumulative histogram that is drawn
constexpr size_t kChartStations = 40;                   // columns of a chart; with more, the worst

std::string Slug(const std::string& text) {
  std::string slug;
  for (char ch : text) {
    const bool letter = (ch >= 'a' && ch <= 'z') || (ch >= '0' && ch <= '9');
    const bool upper = ch >= 'A' && ch <= 'Z';
    if (letter || upper) {
      slug += static_cast<char>(upper ? ch - 'A' + 'a' : ch);
    } else if (!slug.empty() && slug.back() != '-') {
      slug += '-';
    }
  }
  while (!slug.empty() && slug.back() == '-') slug.pop_back();
  return slug;
}

bool Belongs(const ErrorRecord& e, const nlohmann::json& group) {
  return e.method == TextAt(group, "method") && e.reference == TextAt(group, "reference") &&
         e.kind == TextAt(group, "kind") && e.variant == TextAt(group, "variant") &&
         (!group.contains("shares_evidence") || e.shares_evidence == FlagAt(group, "shares_evidence"));
}

// Of the evaluations' intervals.
std::string ConfidenceText(const ReportData& data) {
  std::set<double> all;
  for (const VariantData& v : data.variants) all.insert(At(v.summary, {"confidence"}).value_or(0.95));
  std::string text;
  for (const double confidence : all) text += fmt::format("{}{:.4g} %", text.empty() ? "" : " or ", 100 * confidence);
  return text;
}

void AddGroupTable(const ChapterContext& c, const std::vector<nlohmann::json>& groups, std::vector<Block>* blocks) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{"accuracy",
              "3D differences between answers and references. relative: in the run's own frame, tags seen by the same "
              "cameras, as in the paper; absolute: in site ENU, errors of the global fit included. Median, its " +
                  ConfidenceText(c.data) +
                  " interval, mean, P90 and largest are over answers; the attempts' median counts an abstention as "
                  "worse than any number. ANEES: mean squared error in units of its covariance, 1 where sigmas are "
                  "right.",
              {{"method"},
               {"against"},
               {"answers", true},
               {"attempts", true},
               {"median" + u, true},
               {"interval" + u, false, "too few answers"},
               {"mean" + u, true},
               {"P90" + u, true},
               {"largest" + u, true},
               {"median of attempts" + u, true, "more than half of the attempts have no answer"},
               {"ANEES / dof", true, "these answers have no covariance"},
               {"evidence"}},
              {}};
  for (const nlohmann::json& g : groups) {
    const auto number = [&](const char* side, const char* key) { return c.LengthCell(At(g, {"error_3d", side, key})); };
    std::string interval;
    if (const auto ends = EndsAt(g, "median_interval_m"); ends && ends->low) {
      const double low = *ends->low, high = ends->high.value_or(HUGE_VAL);
      interval = IsInformative({low, high}) ? c.Length(low) + " to " + c.Length(high) : "too few";
    }
    const std::optional<SigmaTest> sigmas = SigmasOf(g);
    const bool shared = FlagAt(g, "shares_evidence");
    table.rows.push_back({{MethodName(TextAt(g, "method"), TextAt(g, "variant"))},
                          {ReferenceName(TextAt(g, "reference")) + ", " + TextAt(g, "kind")},
                          {fmt::format("{:.0f}", At(g, {"answers"}).value_or(0)), At(g, {"answers"})},
                          {fmt::format("{:.0f}", At(g, {"attempts"}).value_or(0)), At(g, {"attempts"})},
                          number("over_answers", "median_m"),
                          {interval},
                          number("over_answers", "mean_m"),
                          number("over_answers", "p90_m"),
                          number("over_answers", "max_m"),
                          number("over_attempts", "median_m"),
                          sigmas ? TableCell{fmt::format("{:.2f}", sigmas->anees), sigmas->anees} : TableCell{},
                          {shared ? "shared: agreement" : "independent"}});
  }
  blocks->push_back(table);
}

// The station whose difference makes a step of a curve, which itself holds only shares of attempts.
std::string StationOf(const ChapterContext& c, const nlohmann::json& group, double error_m) {
  constexpr double kWritten = 1e-6;  // m, to which tables are written
  for (const VariantData& v : c.data.variants) {
    for (const ErrorRecord& e : v.errors) {
      if (e.Answered() && std::abs(*e.error_3d_m - error_m) < kWritten && Belongs(e, group)) {
        return "station:" + e.station;
      }
    }
  }
  return "";
}

// `kinds`: of which there is a chart already; another one's file has its reference in its name.
void AddCurves(const ChapterContext& c, const std::vector<nlohmann::json>& groups, std::set<std::string>* kinds,
               std::vector<Block>* blocks) {
  // A chart for each thing that answers are held against.
  std::vector<std::pair<std::string, std::string>> against;  // reference, kind
  for (const nlohmann::json& g : groups) {
    const std::pair<std::string, std::string> its(TextAt(g, "reference"), TextAt(g, "kind"));
    if (std::find(against.begin(), against.end(), its) == against.end()) against.push_back(its);
  }
  const bool pair = against.size() > 1;
  for (const auto& [reference, kind] : against) {
    std::vector<Series> series;
    double confidence = 0.95;
    bool shared = false;
    for (const nlohmann::json& g : groups) {
      const auto curve = g.find("cumulative");
      if (TextAt(g, "reference") != reference || TextAt(g, "kind") != kind || curve == g.end() || !curve->is_array() ||
          curve->empty())
        continue;
      shared = shared || FlagAt(g, "shares_evidence");
      Series s{MethodName(TextAt(g, "method"), TextAt(g, "variant")), {}};
      const size_t step = curve->size() / kCurvePoints + 1;
      for (size_t i = 0; i < curve->size(); i += step) {
        const nlohmann::json& p = (*curve)[i];
        const auto x = At(p, {"error_m"}), y = At(p, {"share"});
        if (x && y && std::isfinite(*x)) {
          s.points.push_back({*x / c.unit.metres, *y, At(p, {"low"}), At(p, {"high"}), StationOf(c, g, *x)});
        }
      }
      series.push_back(std::move(s));
    }
    if (series.empty()) continue;
    for (const VariantData& v : c.data.variants) confidence = At(v.summary, {"confidence"}).value_or(confidence);
    blocks->push_back(Figure{
        "cumulative_" + kind + (kinds->insert(kind).second ? "" : "_" + Slug(reference)),
        fmt::format(
            "Cumulative histogram of {} 3D differences from {}{}: the share of attempts with at most this difference "
            "({}, logarithmic). A curve ends where the answers end: the rest are abstentions. Band: pointwise {:.0f} % "
            "confidence of {}, resampled by station and run.",
            kind, ReferenceName(reference), shared ? ", which share data with the answers" : "", c.unit.name,
            100 * confidence, series.front().name),
        CumulativeChart(series, "3D difference (" + c.unit.name + ")", "share of attempts",
                        pair ? kHalfWidth : Drawing().width),
        false, pair});
  }
}

// Of one group: a dot per run over each station.
void AddStationChart(const ChapterContext& c, const nlohmann::json& group, std::vector<Block>* blocks) {
  std::map<std::string, std::vector<std::pair<std::string, double>>> of_station;
  std::set<std::string> runs;
  for (const VariantData& v : c.data.variants) {
    for (const ErrorRecord& e : v.errors) {
      if (!e.Answered() || !Belongs(e, group)) continue;
      of_station[e.station].emplace_back(e.run, *e.error_3d_m / c.unit.metres);
      runs.insert(e.run);
    }
  }
  if (of_station.empty()) return;
  std::vector<std::string> stations;
  for (const std::string& s : c.data.stations) {
    if (of_station.count(s) > 0) stations.push_back(s);
  }
  std::string which = "every station with an answer";
  if (stations.size() > kChartStations) {
    const auto worst = [&](const std::string& s) {
      double most = 0;
      for (const auto& [run, value] : of_station[s]) most = std::max(most, value);
      return most;
    };
    std::stable_sort(stations.begin(), stations.end(),
                     [&](const auto& a, const auto& b) { return worst(a) > worst(b); });
    stations.resize(kChartStations);
    which = fmt::format("the {} stations with the largest differences of {}", kChartStations, of_station.size());
  }
  std::vector<DotSeries> series;
  if (runs.size() <= 7) {
    for (const std::string& run : runs) series.push_back({run, {}});
  } else {
    series.push_back({fmt::format("{} runs", runs.size()), {}});
  }
  for (size_t k = 0; k < stations.size(); ++k) {
    for (const auto& [run, value] : of_station[stations[k]]) {
      const size_t i = runs.size() <= 7 ? static_cast<size_t>(std::distance(runs.begin(), runs.find(run))) : 0;
      series[i].dots.emplace_back(static_cast<int>(k), value);
    }
  }
  blocks->push_back(Figure{
      "by_station_" + Slug(GroupName(group)),
      "3D difference by station and run (" + c.unit.name + ", logarithmic), " + GroupTitle(group) + "; " + which + ".",
      DotChart(stations, series, "3D difference (" + c.unit.name + ")")});
}

void AddCharts(const ChapterContext& c, const std::vector<nlohmann::json>& groups, std::set<std::string>* kinds,
               std::vector<Block>* blocks) {
  AddCurves(c, groups, kinds, blocks);
  for (const nlohmann::json& group : groups) {
    if (TextAt(group, "method") != "g1" && TextAt(group, "variant").empty()) AddStationChart(c, group, blocks);
  }
}

// A row a run, a column a station, blank where nothing was reported: the paper's form.
void AddMatrix(const ChapterContext& c, const nlohmann::json& group, std::vector<Block>* blocks) {
  std::map<std::string, std::map<std::string, std::vector<double>>> cells;
  std::set<std::string> seen;
  for (const VariantData& v : c.data.variants) {
    for (const ErrorRecord& e : v.errors) {
      if (!Belongs(e, group)) continue;
      auto& row = cells[e.run];
      if (!e.Answered()) continue;
      row[e.station].push_back(*e.error_3d_m);
      seen.insert(e.station);
    }
  }
  if (seen.empty()) return;
  Table table{"matrix_" + Slug(GroupName(group)),
              "3D differences, " + GroupTitle(group) + ", in " + c.unit.name +
                  "; a row a station, a column a run; of several answers at a station the worst, with their number "
                  "in brackets.",
              {{"station"}},
              {}};
  for (const auto& [run, row] : cells) table.columns.push_back({run, true, "no answer, or no reference"});
  for (const std::string& station : c.data.stations) {
    if (seen.count(station) == 0) continue;
    TableCell name{station};
    if (const auto it = c.station_anchor.find(station); it != c.station_anchor.end()) name.anchor = it->second;
    std::vector<TableCell> line = {name};
    for (const auto& [run, row] : cells) {
      const auto it = row.find(station);
      if (it == row.end()) {
        line.emplace_back();
        continue;
      }
      line.push_back(c.LengthCell(*std::max_element(it->second.begin(), it->second.end()), 2));
      if (it->second.size() > 1) line.back().text += fmt::format(" ({})", it->second.size());
    }
    table.rows.push_back(std::move(line));
  }
  // On paper the tables of this program's own answers.
  blocks->push_back(FoldBegin{"Table: " + GroupTitle(group),
                              TextAt(group, "method") == "single" && TextAt(group, "variant").empty()});
  blocks->push_back(table);
  blocks->push_back(FoldEnd{});
}

// "control: 57, 59; images: run1" of ["control:57", "control:59", "images:run1"].
std::string RestsOn(const nlohmann::json& group, const char* key) {
  constexpr size_t kMost = 60;  // names of one kind
  const auto it = group.find(key);
  if (it == group.end() || !it->is_array()) return "not stated";
  std::vector<std::pair<std::string, std::vector<std::string>>> kinds;
  for (const nlohmann::json& name : *it) {
    if (!name.is_string()) continue;
    const std::string text = name.get<std::string>();
    const size_t colon = text.find(':');
    const std::string kind = colon == std::string::npos ? "" : text.substr(0, colon);
    auto at = std::find_if(kinds.begin(), kinds.end(), [&](const auto& k) { return k.first == kind; });
    if (at == kinds.end()) at = kinds.insert(kinds.end(), {kind, {}});
    at->second.push_back(colon == std::string::npos ? text : text.substr(colon + 1));
  }
  std::string text;
  for (const auto& [kind, names] : kinds) {
    text += (text.empty() ? "" : "; ") + kind + (kind.empty() ? "" : ": ");
    for (size_t i = 0; i < std::min(kMost, names.size()); ++i) text += (i > 0 ? ", " : "") + names[i];
    if (names.size() > kMost) text += fmt::format(", and {} more", names.size() - kMost);
  }
  return text.empty() ? "nothing" : text;
}

// Numbers that rest on the same things share a row.
void AddEvidence(const std::vector<nlohmann::json>& groups, std::vector<Block>* blocks) {
  Table table{"rests_on",
              "Data behind both sides of each number; images: of runs, tags: seen by runs.",
              {{"numbers"}, {"data of the answers"}, {"data of the reference"}},
              {}};
  for (const nlohmann::json& g : groups) {
    const std::string estimate = RestsOn(g, "estimate_rests_on"), reference = RestsOn(g, "reference_rests_on");
    const auto same = std::find_if(table.rows.begin(), table.rows.end(), [&](const auto& row) {
      return row[1].text == estimate && row[2].text == reference;
    });
    if (same == table.rows.end()) {
      table.rows.push_back({{GroupTitle(g)}, {estimate}, {reference}});
    } else {
      (*same)[0].text += "; " + GroupTitle(g);
    }
  }
  blocks->push_back(FoldBegin{"Data behind both sides of each number", false});
  blocks->push_back(table);
  blocks->push_back(FoldEnd{});
}

using GroupRecords = std::map<std::string, std::vector<const ErrorRecord*>>;

// The distribution of the errors in space that right sigmas would give, and the one found.
void AddTrust(const std::string& variant, const GroupRecords& of_group, std::vector<Block>* blocks) {
  std::vector<Series> trust;
  std::vector<Sample> samples;
  for (const auto& [name, records] : of_group) {
    if (records.front()->variant != variant) continue;
    Series s{name, {}};
    for (int p = 0; p <= 20; ++p) {
      const double nominal = p / 20.0;
      int inside = 0;
      for (const ErrorRecord* e : records) inside += ChiSquareCdf(*e->nees, e->dof) <= nominal;
      s.points.push_back({nominal, static_cast<double>(inside) / static_cast<double>(records.size()), {}, {}});
    }
    trust.push_back(std::move(s));
    Sample sample{fmt::format("{} (n = {})", name, records.size()), {}};
    for (const ErrorRecord* e : records) {
      sample.values.push_back(*e->nees / e->dof);
      sample.objects.push_back("station:" + e->station);
    }
    samples.push_back(std::move(sample));
  }
  const std::string suffix = variant.empty() ? "" : "_" + Slug(variant);
  const std::string of = variant.empty() ? "" : " of variant " + variant;
  blocks->push_back(Figure{"trust_curve" + suffix,
                           "Trust curve" + of +
                               ": share of the errors inside the confidence region of the stated level (NEES against "
                               "chi-square). Rows are taken as independent; few answers give coarse steps.",
                           LineChart(trust, "stated confidence", "share of errors inside", true, kHalfWidth), false,
                           true});
  Series expected{"chi-square, 3 dof", {}};
  constexpr int kBins = 16;
  constexpr double kLimit = 8;
  for (int b = 0; b < kBins; ++b) {
    const double low = kLimit * b / kBins, high = kLimit * (b + 1) / kBins;
    expected.points.push_back({0.5 * (low + high), ChiSquareCdf(3 * high, 3) - ChiSquareCdf(3 * low, 3), {}, {}});
  }
  blocks->push_back(Figure{"nees" + suffix,
                           "Normalised errors squared per degree of freedom" + of +
                               "; the last bin holds everything beyond it. Dashed: "
                               "expected if the sigmas are right.",
                           HistogramChart(samples, kBins, kLimit, "NEES / dof", &expected, kHalfWidth), false, true});
}

// The error of the kept answers against the share that is kept, those with the best supported depth first.
void AddCoverageRisk(const ChapterContext& c, std::vector<Block>* blocks) {
  std::map<std::string, std::vector<Series>> of_variant;
  for (const VariantData& v : c.data.variants) {
    for (const FurtherTable& f : v.further) {
      if (f.name != kCoverageRisk) continue;
      const auto column = [&](const char* name) {
        return static_cast<size_t>(std::find(f.columns.begin(), f.columns.end(), name) - f.columns.begin());
      };
      const size_t method = column("method"), reference = column("reference"), kind = column("kind"),
                   variant = column("variant"), coverage = column("coverage"), p90 = column("p90_m"),
                   shared = column("shares_evidence");  // older tables have none
      if (std::max({method, reference, kind, variant, coverage, p90}) >= f.columns.size()) continue;
      for (const auto& row : f.rows) {
        const auto x = ParseDouble(row[coverage]), y = ParseDouble(row[p90]);
        if (row[method] == "g1" || !x || !y || !std::isfinite(*y)) continue;
        const bool shares = shared < row.size() && row[shared] == "yes";
        const std::string name = GroupTitle(row[method], row[reference], row[kind], shares, "");
        std::vector<Series>& series = of_variant[row[variant].empty() ? v.variant : row[variant]];
        if (series.empty() || series.back().name != name) series.push_back({name, {}});
        series.back().points.push_back({*x, *y / c.unit.metres, {}, {}});
      }
    }
  }
  for (auto& [variant, series] : of_variant) {
    for (Series& s : series) {
      std::vector<CurvePoint> thinned;
      const size_t step = s.points.size() / kCurvePoints + 1;
      for (size_t i = 0; i < s.points.size(); ++i) {
        if (i % step == 0 || i + 1 == s.points.size()) thinned.push_back(s.points[i]);
      }
      s.points = std::move(thinned);
    }
    blocks->push_back(FoldBegin{"Coverage and risk" + (variant.empty() ? "" : " of variant " + variant), false});
    blocks->push_back(
        Figure{"coverage_risk" + (variant.empty() ? "" : "_" + Slug(variant)),
               "Coverage and risk" + (variant.empty() ? "" : " of variant " + variant) +
                   ": the 90th percentile of the 3D errors (" + c.unit.name +
                   ") of the share of answers with the best supported depth. Where the curve falls towards "
                   "the left, refusing the other answers reduces the error.",
               LineChart(series, "share of answers kept", "P90 of 3D error (" + c.unit.name + ")", false)});
    blocks->push_back(FoldEnd{});
  }
}

// A table of the evaluation that has no form of its own here.
void AddFurtherTable(const FurtherTable& f, const std::string& variant, std::vector<Block>* blocks) {
  const std::string name = f.name + (variant.empty() ? "" : "@" + variant);
  const size_t shown_rows = std::min(kFurtherRows, f.rows.size());
  Table table{Slug(name),
              f.comment + (shown_rows < f.rows.size() + f.left_out
                               ? fmt::format(" The first {} rows; {} more are in the evaluation's own file.",
                                             shown_rows, f.rows.size() + f.left_out - shown_rows)
                               : ""),
              {},
              {}};
  for (size_t k = 0; k < f.columns.size(); ++k) {
    const bool number = std::all_of(f.rows.begin(), f.rows.end(), [&](const auto& row) {
      return k >= row.size() || row[k].empty() || ParseDouble(row[k]).has_value();
    });
    table.columns.push_back(
        {f.columns[k], number, f.columns[k] == "variant" ? "the default results" : "the evaluation has no value"});
  }
  const auto shown = [](const std::string& text) {  // the file has all digits
    constexpr size_t kLong = 6;
    const auto number = text.size() > kLong && text.find('.') != std::string::npos ? ParseDouble(text) : std::nullopt;
    return number ? fmt::format("{:.4f}", *number) : text;
  };
  for (size_t r = 0; r < shown_rows; ++r) {
    std::vector<TableCell>& cells = table.rows.emplace_back();
    for (size_t k = 0; k < f.rows[r].size(); ++k) {
      const std::string& text = f.rows[r][k];
      cells.push_back({f.columns[k] == "method" ? MethodName(text) : shown(text)});
    }
  }
  blocks->push_back(FoldBegin{"Table: " + name, false});
  blocks->push_back(table);
  blocks->push_back(FoldEnd{});
}

}  // namespace

void AddAccuracy(const ChapterContext& c, std::vector<Block>* blocks) {
  const std::vector<nlohmann::json> groups = Groups(c.data);
  blocks->push_back(Heading{2, "Accuracy", "accuracy"});
  if (groups.empty()) {
    AddSummary(c, blocks);
    return;
  }
  AddSummary(c, blocks);
  AddGroupTable(c, groups, blocks);
  // Charts of agreement are left out on paper if there are charts of accuracy.
  std::vector<nlohmann::json> first, others;
  const bool measured = std::any_of(groups.begin(), groups.end(), [](const nlohmann::json& g) {
    return TextAt(g, "kind") == "absolute" && !FlagAt(g, "shares_evidence");
  });
  for (const nlohmann::json& g : groups) {
    const bool agreement = TextAt(g, "kind") == "absolute" && FlagAt(g, "shares_evidence");
    (measured && agreement ? others : first).push_back(g);
  }
  std::set<std::string> kinds;  // that have a chart
  AddCharts(c, first, &kinds, blocks);
  if (!others.empty()) {
    blocks->push_back(FoldBegin{"Charts of comparisons with shared evidence", false});
    AddCharts(c, others, &kinds, blocks);
    blocks->push_back(FoldEnd{});
  }
  for (const nlohmann::json& group : groups) AddMatrix(c, group, blocks);
  AddEvidence(groups, blocks);
}

void AddConsistency(const ChapterContext& c, std::vector<Block>* blocks) {
  GroupRecords of_group;
  for (const VariantData& v : c.data.variants) {
    for (const ErrorRecord& e : v.errors) {
      if (e.Answered() && e.nees && e.dof > 0) {
        // An answer that shares evidence with its reference errs less than its sigmas say: it has a curve of its own.
        of_group[GroupTitle(e.method, e.reference, e.kind, e.shares_evidence, e.variant)].push_back(&e);
      }
    }
  }
  blocks->push_back(Heading{2, "Consistency", "consistency"});
  if (of_group.empty()) {
    blocks->push_back(
        Paragraph{"No answer has both an error and a covariance, so that the stated sigmas cannot be tested here."});
  } else {
    blocks->push_back(Paragraph{
        "The normalised error squared (NEES) is the squared error in units of its own covariance. If every sigma is "
        "right, it follows a chi-square distribution, and the trust curve is the diagonal; below the diagonal the "
        "sigmas are too small."});
    // A pair of charts a variant.
    std::set<std::string> variants;
    for (const auto& [name, records] : of_group) variants.insert(records.front()->variant);
    for (const std::string& variant : variants) {
      if (!variant.empty()) blocks->push_back(FoldBegin{"Consistency of variant " + variant, false});
      AddTrust(variant, of_group, blocks);
      if (!variant.empty()) blocks->push_back(FoldEnd{});
    }
  }
  AddCoverageRisk(c, blocks);
  bool begun = false;
  for (const VariantData& v : c.data.variants) {
    for (const FurtherTable& f : v.further) {
      if (f.name == kCoverageRisk) continue;  // drawn above
      if (!begun) blocks->push_back(Heading{3, "Further tables of the evaluation", "further"});
      begun = true;
      AddFurtherTable(f, v.variant, blocks);
    }
  }
}

}  // namespace trigpoint
