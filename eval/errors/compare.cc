#include "eval/errors/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "eval/text/json_values.h"
#include "eval/text/markdown.h"
#include "eval/text/number_text.h"

namespace trigpoint {
namespace {

using Key = std::tuple<std::string, std::string, std::string>;

std::map<Key, std::vector<ErrorRow>> Grouped(const std::vector<ErrorRow>& rows) {
  std::map<Key, std::vector<ErrorRow>> groups;
  for (const ErrorRow& row : rows) {
    groups[{row.method == "g1" ? "view" : "panorama", row.reference, row.kind}].push_back(row);
  }
  return groups;
}

// Rows that are no attempt are neither answers nor abstentions.
ErrorStatistics StatisticsOfRows(const std::vector<ErrorRow>& rows) {
  std::vector<double> errors;
  int abstentions = 0;
  for (const ErrorRow& row : rows) {
    if (row.error_3d_m) {
      errors.push_back(*row.error_3d_m);
    } else {
      abstentions += row.attempt;
    }
  }
  return Summarize(errors, abstentions);
}

nlohmann::json Json(const std::string& method, const ErrorStatistics& s) {
  return {{"method", method},
          {"answers", s.answers},
          {"attempts", s.attempts},
          {"median_m", OrNull(s.median)},
          {"p90_m", OrNull(s.p90)}};
}

}  // namespace

std::vector<ComparedGroup> CompareErrors(const std::vector<ErrorRow>& a, const std::vector<ErrorRow>& b,
                                         const BootstrapOptions& options) {
  std::vector<ComparedGroup> compared;
  const auto groups_a = Grouped(a), groups_b = Grouped(b);
  for (const auto& [key, rows_a] : groups_a) {
    const auto it = groups_b.find(key);
    if (it == groups_b.end()) continue;
    const auto& [answer, reference, kind] = key;
    compared.push_back({.answer = answer,
                        .reference = reference,
                        .kind = kind,
                        .method_a = rows_a.front().method,
                        .method_b = it->second.front().method,
                        .a = StatisticsOfRows(rows_a),
                        .b = StatisticsOfRows(it->second),
                        .paired = ComparePaired(rows_a, it->second, options)});
  }
  return compared;
}

std::vector<NamedComparison> CompareWithin(const Evaluation& evaluation) {
  std::vector<std::string> variants;
  std::map<std::string, std::vector<ErrorRow>> own, views;
  for (const ErrorRow& row : evaluation.rows) {
    if (std::find(variants.begin(), variants.end(), row.variant) == variants.end()) variants.push_back(row.variant);
    (row.method == "g1" ? views : own)[row.variant].push_back(row);
  }
  const BootstrapOptions options{.samples = evaluation.options.bootstrap_samples,
                                 .confidence = evaluation.options.confidence};
  const auto name = [](const std::string& variant) { return variant.empty() ? std::string("default") : variant; };
  std::vector<NamedComparison> all;
  const auto add = [&](const std::string& a, const std::string& b, const std::vector<ErrorRow>& rows_a,
                       const std::vector<ErrorRow>& rows_b) {
    for (ComparedGroup& group : CompareErrors(rows_a, rows_b, options)) all.push_back({a, b, std::move(group)});
  };
  for (size_t i = 1; i < variants.size(); ++i) {
    for (const auto* rows : {&own, &views}) {
      if (rows->count(variants[0]) == 0 || rows->count(variants[i]) == 0) continue;
      add(name(variants[0]), name(variants[i]), rows->at(variants[0]), rows->at(variants[i]));
    }
  }
  for (const std::string& variant : variants) {
    if (views.count(variant) == 0 || own.count(variant) == 0) continue;
    std::vector<ErrorRow> as_panoramas = views.at(variant);
    const std::string method = own.at(variant).front().method;
    for (ErrorRow& row : as_panoramas) row.method = method;
    const size_t first = all.size();
    add(name(variant) + " g1", name(variant) + " " + method, as_panoramas, own.at(variant));
    for (size_t i = first; i < all.size(); ++i) all[i].group.method_a = "g1";
  }
  return all;
}

std::string FormatComparison(const std::vector<ComparedGroup>& groups, const std::string& a, const std::string& b,
                             const std::string& unit, double metres_per_unit) {
  if (groups.empty()) return fmt::format("{} and {} have no group of errors in common\n", a, b);
  std::vector<std::vector<std::string>> lines{
      {"errors [" + unit + "]", "who", "method", "answers", "attempts", "median", "P90", "max"}};
  std::string sentences;
  const auto cell = [&](const std::optional<double>& metres) { return NumberText(metres, 3, "-", metres_per_unit); };
  for (const ComparedGroup& g : groups) {
    const std::string name = fmt::format("{}, {}, {}", g.answer, g.kind, g.reference);
    const auto line = [&](const std::string& who, const std::string& method, const ErrorStatistics& s) {
      lines.push_back({name, who, method, std::to_string(s.answers), std::to_string(s.attempts), cell(s.median),
                       cell(s.p90), cell(s.max)});
    };
    line(a, g.method_a, g.a);
    line(b, g.method_b, g.b);
    sentences += fmt::format("- {}: {}\n", name, Describe(g.paired, a, b, unit, metres_per_unit));
  }
  return AlignMarkdown(lines) + "\n" + sentences;
}

nlohmann::json PairedJson(const ComparedGroup& group) {
  const PairedComparison& p = group.paired;
  return {{"answer", group.answer},
          {"reference", group.reference},
          {"kind", group.kind},
          {"pairs", p.pairs},
          {"stations", p.stations},
          {"a_better", p.a_better},
          {"b_better", p.b_better},
          {"only_a", p.only_a},
          {"only_b", p.only_b},
          {"median_difference_m", OrNull(p.median_difference_m)},
          {"difference_interval_m", OrNull(p.difference_interval_m)},
          {"confidence", p.confidence},
          {"sign_p", p.sign_p},
          {"wilcoxon_p", p.wilcoxon_p}};
}

nlohmann::json ComparisonJson(const std::vector<ComparedGroup>& groups, const std::string& a, const std::string& b) {
  nlohmann::json list = nlohmann::json::array();
  for (const ComparedGroup& g : groups) {
    list.push_back(PairedJson(g));
    list.back().update({{"a", Json(g.method_a, g.a)}, {"b", Json(g.method_b, g.b)}});
  }
  return {{"schema", "trigpoint compare 1"}, {"a", a}, {"b", b}, {"groups", list}};
}

}  // namespace trigpoint
