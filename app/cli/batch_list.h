// What a batch is made of, and what became of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/cli/ending.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

struct BatchEntry {
  std::string name;  // unique: the folder as written, with its options
  std::filesystem::path dir;
  std::vector<std::string> arguments;  // of `trigpoint run`, behind the folder
};

// A list file (one project a line, options of `run` behind it, '#' comments, "..." around names with spaces; folders
// relative to the file; * and ? match), or a pattern of folders. Throws InputError naming file and line.
std::vector<BatchEntry> ReadBatchList(const std::string& list);

// status: done, gate (done, but a gate is not passed), failed, cancelled, running, waiting.
struct BatchResult {
  BatchEntry entry;
  std::string status = "waiting";
  std::string error;  // one line
  int exit_code = 0;
  int attempts = 0;                     // at one task; more than one where memory ran out
  double seconds = 0, cpu_seconds = 0;  // of all attempts at its tasks
  int64_t peak_memory_bytes = 0;
  // As `run --json` gives them, with attempts, wall_seconds, cpu_seconds and peak_memory_bytes of each.
  nlohmann::json stages = nlohmann::json::array();
};

// For people.
inline double Mebibytes(int64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

// Throws InputError unless `folder` is new, empty, or holds the summary of a batch, and if a project reads it.
void RequireBatchFolder(const std::filesystem::path& folder);
// summary.json, summary.csv, summary.md in `folder`.
void WriteBatchSummary(const std::vector<BatchResult>& results, const std::filesystem::path& folder);
// `headline` with the counts; failed and not passed, the median of the projects' medians with the best and the worst,
// what the stages cost. Lengths in `unit`.
Ending BatchEnding(const std::vector<BatchResult>& results, const std::string& headline, const DisplayUnit& unit);
std::string FormatBatch(const std::vector<BatchResult>& results, const DisplayUnit& unit = {});
nlohmann::json BatchJson(const std::vector<BatchResult>& results);

}  // namespace trigpoint
