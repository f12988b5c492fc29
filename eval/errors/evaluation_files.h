// Tables of an evaluation, for people (Markdown), programs (CSV) and the results folder.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/errors/compare.h"
#include "eval/errors/evaluate.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

struct TableOptions {
  DisplayUnit unit;
  int decimals = 2;           // as in the paper
  bool paper_tables = false;  // print the paper's own two tables beside ours
};

// A table in the form of the paper's: a row per run, a column per station, 3D error in metres, unset where nothing was
// reported.
struct ErrorTable {
  std::string title;
  std::vector<std::string> columns;  // stations
  std::vector<std::string> rows;     // runs
  std::vector<std::vector<std::optional<double>>> cells;
};

// One per group of the evaluation, in its order. A station with several panoramas has a column each
// ("station / panorama").
std::vector<ErrorTable> ErrorTables(const Evaluation& evaluation);

// Tables I and II of the paper (G1, G2): see eval/errors/paper_tables.h.
std::string FormatMarkdown(const ErrorTable& table, const TableOptions& options = {});
std::string FormatCsv(const ErrorTable& table);  // metres, empty cells where nothing was reported

// What stands beside the tables. `notes` are paragraphs of Markdown that end the text.
struct EvaluationExtras {
  std::vector<NamedComparison> comparisons;
  std::vector<std::string> notes;
};

// All tables with their medians, percentiles, counts and reasons: what `evaluate` prints and tables.md holds.
std::string FormatEvaluation(const Evaluation& evaluation, const TableOptions& options = {},
                             const EvaluationExtras& extras = {});

// summary.json.
nlohmann::json SummaryJson(const Evaluation& evaluation, const EvaluationExtras& extras = {});

// Writes errors.csv, histogram.csv, coverage_risk.csv, summary.json, tables.md and
// table_<method>_<reference>_<kind>[@variant].csv into an existing folder. Throws IoError naming the file.
void WriteEvaluation(const Evaluation& evaluation, const std::filesystem::path& folder,
                     const TableOptions& options = {}, const EvaluationExtras& extras = {});

// Reads errors.csv back (for comparisons); of covariances it has the diagonal. Throws InputError naming file and line.
std::vector<ErrorRow> ReadErrors(const std::filesystem::path& errors_csv);

// For the manifest: median_m of our own answers of a variant, against the best reference there is, and every group.
nlohmann::json EvaluationMetrics(const Evaluation& evaluation, const std::string& variant);

}  // namespace trigpoint
