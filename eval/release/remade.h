// A release's project put together again from what it holds, and what comes out otherwise.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/release_files.h"

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

// The record of a release that can be made again. Throws InputError, one message, if it is not as it was published or
// keeps no inputs (schema 1).
ReleaseRecord ReadWholeRelease(const std::filesystem::path& release, int threads, const CancelToken& cancel);

// An input as the release records it.
struct ReleasedInput {
  std::string path, sha256;
  uintmax_t bytes = 0;
  bool copied = false;
};
std::vector<ReleasedInput> ReadInputs(const RerunOptions& options, const ReleaseRecord& record);

// The folder in which the project is made again; removed with the object unless the user named it.
class WorkFolder {
 public:
  // `asked`: empty for a temporary one, in which the project has the folder `name`. Throws InputError if it holds
  // files, IoError.
  WorkFolder(const std::filesystem::path& asked, const std::string& name);
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  const std::filesystem::path& project() const { return project_; }
  bool keep() const { return keep_; }

 private:
  bool keep_;
  std::filesystem::path root_, project_;
};

// Puts the project together in `project`. What the release has by hash alone must be there, and unchanged. Throws
// InputError, IoError.
void GatherInputs(const RerunOptions& options, const std::vector<ReleasedInput>& inputs,
                  const std::filesystem::path& project, ProgressSink& progress, const CancelToken& cancel);

// A result as the release records it.
struct RecordedResult {
  std::string key;
  nlohmann::json record;  // its `stage`, `name`, `options` and `files` are of the right types
  std::string run, at;    // of the name "run@at"
  std::string copied_to;
};
// That of a member of the record's `order`. Throws InputError.
RecordedResult ReadRecorded(const RerunOptions& options, const ReleaseRecord& record, const nlohmann::json& key);

// Compares a result made again, in `dir`, with what the release records and has of it.
void CompareResult(const RerunOptions& options, const RecordedResult& then, const nlohmann::json& manifest,
                   const std::filesystem::path& dir, RerunResult* result);
// A note for each version of the program that differs.
void CompareVersions(const ReleaseRecord& record, std::vector<std::string>* notes);

// How two texts of the same kind (CSV, TUM, JSON, Markdown) differ, number by number.
RerunDifference CompareTexts(const std::string& then, const std::string& now, bool csv);

}  // namespace trigpoint
