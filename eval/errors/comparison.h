// Which comparison of an evaluation is shown where there is room for one. Report, scene, plan and window take the same.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

// Answers of a method against a reference.
struct Comparison {
  std::string variant, method, reference, kind;  // kind: absolute, relative
  bool shares_evidence = false;                  // reference and answers come of the same observations
  int answers = 0;
  // "tags seen by the same run's cameras", "surveyed control", "the tag map".
  std::string Against() const;
  // "absolute, against surveyed control".
  std::string Words() const { return kind + ", against " + Against(); }
};

// Whether `a` is shown before `b`: absolute before relative, no shared evidence before shared, the most answers, then
// control before maps.
bool IsBetter(const Comparison& a, const Comparison& b);

// The best of a variant's final answers; nothing: none was compared.
std::optional<Comparison> BestComparison(const std::vector<Comparison>& all, const std::string& variant);

}  // namespace trigpoint
