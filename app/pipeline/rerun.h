// A release computed again from what it holds, and what comes out otherwise.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calib/base/progress.h"

namespace trigpoint {

struct RerunOptions {
  std::filesystem::path release;
  std::filesystem::path inputs;  // the folder of what the release has by hash alone; empty: the project it lies in
  std::filesystem::path out;     // a new folder for the project that is made; empty: one that is removed again
  double tolerance = 0;          // largest difference of a number that counts as none, in the number's own unit
};

// A file of a result that came out otherwise.
struct RerunDifference {
  std::string result, file;               // "survey", "tags.csv"
  std::string text;                       // what differs
  std::map<std::string, double> columns;  // largest difference of the numbers in each column, or "" for other files
  bool only_numbers = false;              // nothing but numbers, as many as before
  double largest = 0;
};

struct RerunResult {
  std::filesystem::path dir;           // the project that was made, if it is kept
  std::vector<std::string> results;    // computed again
  std::vector<std::string> taken;      // calibrations, taken over as they are
  size_t same_files = 0;               // byte for byte
  std::vector<RerunDifference> other;  // every file that is not
  std::vector<std::string> notes;      // what else differs: versions of program, libraries and stages
  bool within_tolerance = true;
};

// Throws InputError, one message, if the release is not as it was published, keeps no inputs (schema 1), or an input
// that it has by hash alone is not there with that hash; what a stage throws; Cancelled.
RerunResult Rerun(const RerunOptions& options, int threads, ProgressSink& progress, const CancelToken& cancel);

// How two texts of the same kind (CSV, TUM, JSON, Markdown) differ, number by number.
RerunDifference CompareTexts(const std::string& then, const std::string& now, bool csv);

}  // namespace trigpoint
