#include "eval/errors/comparison.h"

#include <tuple>

#include "eval/text/method_name.h"

namespace trigpoint {

std::string Comparison::Against() const { return ReferenceName(reference); }

bool IsBetter(const Comparison& a, const Comparison& b) {
  const auto rank = [](const Comparison& c) {
    return std::tuple(c.kind == "absolute", !c.shares_evidence, c.answers, c.reference == "control");
  };
  return rank(a) > rank(b);
}

std::optional<Comparison> BestComparison(const std::vector<Comparison>& all, const std::string& variant) {
  std::optional<Comparison> best;
  for (const Comparison& c : all) {
    if (c.variant != variant || c.method == "g1" || c.answers == 0) continue;
    if (!best || IsBetter(c, *best)) best = c;
  }
  return best;
}

}  // namespace trigpoint
