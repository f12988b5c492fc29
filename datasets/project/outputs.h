// Files that a command writes where its user asked for them: never onto a file that Trigpoint did not write.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace trigpoint {

// What Trigpoint has written into a folder, kept there in `.trigpoint-outputs` (the format of sha256sum).
constexpr const char* kOutputRecord = ".trigpoint-outputs";

// Throws InputError if `file` is a place that a project reads input from, or that belongs to its stages: runs/,
// panoramas.csv, results/localize/, ... of the project that the file would lie in. Symbolic links are resolved.
void RequireOutputPlace(const std::filesystem::path& file);

// Writes a set of files completely or not at all. They are made in a hidden folder at their place (`staging`), and
// moved by Publish().
class OutputFiles {
 public:
  // Makes `folder`. `force`: replace files of an earlier output that were edited since.
  explicit OutputFiles(std::filesystem::path folder, bool force = false);
  OutputFiles(const OutputFiles&) = delete;
  OutputFiles& operator=(const OutputFiles&) = delete;
  ~OutputFiles();  // removes what was not published

  const std::filesystem::path& staging() const { return staging_; }
  // The final place of a file below staging().
  std::filesystem::path Final(const std::filesystem::path& staged) const;
  // Checks every file made against what is at its place, then moves them all and records them. A file at a place is
  // replaced if the record names it and it is unchanged since (or `force`). Throws InputError naming the first file
  // that is not ours; then nothing is written. Returns the files.
  std::vector<std::filesystem::path> Publish();

 private:
  void CheckReplaceable(const std::filesystem::path& file, const std::map<std::string, std::string>& record) const;

  std::filesystem::path folder_, staging_;
  bool force_ = false;
  bool made_folder_ = false;
};

}  // namespace trigpoint
