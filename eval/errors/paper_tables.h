// The two published tables: error in metres between panorama and tag for five runs and nine tags on a parking lot,
// from P. Agarwal, W. Burgard, L. Spinello, "Metric Localization using Google Street View", 2015
// (arXiv:1503.04287), tables I and II. Blanks are stations for which nothing was reported.
#pragma once

#include <array>
#include <optional>
#include <string>

namespace trigpoint {

struct PaperTable {
  std::string method;  // g1: views independent (table I); g2: views of a panorama connected (table II)
  std::string caption;
  std::array<std::array<std::optional<double>, 9>, 5> error_m;  // [run][tag]
};

const std::array<PaperTable, 2>& PaperTables();

}  // namespace trigpoint
