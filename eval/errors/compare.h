// Two evaluations side by side: projects, releases or variants, paired station by station.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/errors/paired.h"

namespace trigpoint {

struct ComparedGroup {
  std::string answer;  // "view" (g1) or "panorama" (g2, single): what is comparable across modes
  std::string reference, kind;
  std::string method_a, method_b;
  ErrorStatistics a, b;
  PairedComparison paired;
};

// Rows of two errors.csv, matched by kind of answer, reference and kind of error; variants may differ, that is the
// point. What only one side has is left out. Ordered by answer, reference, kind.
std::vector<ComparedGroup> CompareErrors(const std::vector<ErrorRow>& a, const std::vector<ErrorRow>& b,
                                         const BootstrapOptions& options = {});

// Inside one evaluation: every variant against the first one, and in each variant the views alone (G1) against the
// panoramas.
struct NamedComparison {
  std::string a, b;
  ComparedGroup group;
};
std::vector<NamedComparison> CompareWithin(const Evaluation& evaluation);

// What a group is and its paired differences (metres), without its sides.
nlohmann::json PairedJson(const ComparedGroup& group);

// A Markdown table and a sentence a group; the same as JSON (metres) with a schema.
std::string FormatComparison(const std::vector<ComparedGroup>& groups, const std::string& a, const std::string& b,
                             const std::string& unit = "m", double metres_per_unit = 1);
nlohmann::json ComparisonJson(const std::vector<ComparedGroup>& groups, const std::string& a, const std::string& b);

}  // namespace trigpoint
