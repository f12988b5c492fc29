// A table of the results as the desktop shows it: text cells, and which object each row is about. No Qt here.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

struct DataTable {
  std::string title;  // "localize/run1/panoramas"
  std::filesystem::path file;
  std::vector<std::string> columns;
  std::string comment;  // of the file: frame, datum, what its values mean
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> objects;   // of each row, as the review names objects; empty: none
  std::vector<std::string> warnings;  // rows that could not be read
};

// Where a table of the results lies.
struct DataTableSource {
  std::string title;
  std::filesystem::path file;
  std::string run;  // empty: of all runs, or of none
  std::string set;  // the photo set whose photos the rows are about; empty: none
};

// Every CSV table below results/, those people look at first in front.
std::vector<DataTableSource> FindTables(const std::filesystem::path& results);
// Throws InputError naming file and line.
DataTable LoadDataTable(const DataTableSource& source);
// The rows given (in that order) as CSV; files are in metres whatever unit is shown. Throws IoError.
void ExportDataTable(const DataTable& table, const std::vector<int>& rows, const std::filesystem::path& file);

}  // namespace trigpoint
