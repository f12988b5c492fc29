#include "eval/errors/paper_tables.h"

namespace trigpoint {

const std::array<PaperTable, 2>& PaperTables() {
  constexpr std::nullopt_t kNone = std::nullopt;
  static const std::array<PaperTable, 2> tables{{
      {"g1",
       "Agarwal, Burgard, Spinello (2015), table I: views of a panorama by themselves (G1)",
       {{{6.00, 3.14, 0.99, 1.65, 5.36, 2.94, 1.22, 0.53, 1.29},
         {0.72, 1.07, kNone, 9.62, 4.91, 2.00, 5.53, 0.70, 1.28},
         {kNone, kNone, kNone, kNone, kNone, 3.35, 0.74, 1.07, 4.03},
         {kNone, kNone, 0.37, 1.03, 3.92, 5.34, 2.07, 0.39, 1.07},
         {kNone, 0.47, 0.58, 0.37, 12.38, 5.89, 1.53, 0.55, 2.59}}}},
      {"g2",
       "Agarwal, Burgard, Spinello (2015), table II: views of a panorama connected (G2)",
       {{{10.11, 3.14, 1.09, 1.65, 3.44, 3.61, 1.22, 0.36, 1.29},
         {0.72, 1.07, kNone, 5.80, 3.27, 0.80, 1.51, 0.68, 1.28},
         {kNone, kNone, kNone, kNone, kNone, 3.35, 0.70, 1.07, 0.90},
         {kNone, kNone, 0.37, 1.03, 2.84, 5.34, 2.07, 0.60, 1.07},
         {kNone, 0.47, 0.59, 0.42, 3.75, 5.88, 1.53, 0.55, 3.39}}}},
  }};
  return tables;
}

}  // namespace trigpoint
