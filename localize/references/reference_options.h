// What the features and visual words of the references are made with.
#pragma once

#include <string>
#include <vector>

#include "localize/reconstruct/kept_features.h"
#include "localize/references/vocabulary.h"

namespace trigpoint {

struct ReferenceOptions : FeatureStageOptions {
  CodebookOptions codebook;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    FeatureStageOptions::Visit(self, visit);
    visit(self.codebook, {"codebook", "", 0, 0, "visual words of the views"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

}  // namespace trigpoint
