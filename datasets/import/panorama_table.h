// panoramas.csv, to which imports add rows.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace trigpoint {

// Columns that are not about the place: where a picture is from and what must be written beside it.
inline const std::vector<std::string> kCreditColumns = {"source", "captured_at", "licence", "attribution",
                                                        "keep_until"};

class PanoramaTable {
 public:
  // Reads SITE/panoramas.csv, if it is there. Without it the pictures in SITE/panoramas/, which are used without a
  // table, become its first rows. Throws InputError if the table cannot be read.
  explicit PanoramaTable(const std::filesystem::path& site);

  bool Has(const std::string& file) const { return files_.count(file) > 0; }
  // Is its row made here from the picture alone, so that nothing is known of the place?
  bool IsBare(const std::string& file) const { return bare_.count(file) > 0; }
  // Adds a row by its columns, or replaces the one of the same file; columns that are not named stay empty.
  void Put(std::map<std::string, std::string> row);
  // Sets the time until which a row's picture may be kept, and leaves what else the row states.
  void SetEnd(const std::string& file, const std::string& keep_until);
  // Undoes what was done last.
  void TakeBack();
  bool Changed() const { return changed_; }
  // Writes the table; what was there before the first time is kept in SITE/results/replaced/. Returns the file. Throws
  // IoError.
  std::filesystem::path Save();
  // That copy; empty: there was no table, or nothing is saved yet.
  const std::filesystem::path& kept() const { return kept_; }

 private:
  std::filesystem::path site_, file_, kept_;
  std::vector<std::string> columns_, comments_;
  std::vector<std::map<std::string, std::string>> rows_;
  std::map<std::string, size_t> files_;  // to their rows
  std::set<std::string> bare_;
  std::string last_;                                          // file of the row that was changed last
  std::optional<std::map<std::string, std::string>> before_;  // that row before; none: it is new
  bool changed_ = false, saved_ = false;
};

}  // namespace trigpoint
