// panoramas.csv, to which imports add rows.
#pragma once

#include <filesystem>
#include <map>
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
  // A row by its columns; those not named stay empty.
  void Add(std::map<std::string, std::string> row);
  bool Changed() const { return changed_; }
  // Writes the table; what was there before is kept in SITE/results/replaced/. Returns the file. Throws IoError.
  std::filesystem::path Save();

 private:
  std::filesystem::path site_, file_;
  std::vector<std::string> columns_, comments_;
  std::vector<std::map<std::string, std::string>> rows_;
  std::map<std::string, size_t> files_;  // to their rows
  bool changed_ = false;
};

}  // namespace trigpoint
