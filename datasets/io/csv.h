// Comma-separated tables, read and written: every table of a project and of its results goes through here.
//
// Read: UTF-8 (a byte order mark is fine), LF or CRLF, '#' comment lines and empty lines anywhere, one header row,
// cells quoted with "..." where needed ("" is one quote), dot decimal; also what csv_dialect.h recognises, with a
// warning.
//
//   const CsvTable table = CsvTable::Read(file, {"tag_id", "x", "y"}, {"role"});
//   for (const CsvRow& row : table.rows()) {
//     tag.id = static_cast<int>(row.Integer("tag_id"));     // throws InputError "file:line: column tag_id: ..."
//     tag.x = row.Number("x");                              // finite, or InputError
//     if (row.Has("role")) tag.role = row.Text("role");     // column there and cell not empty
//   }
//
// Written (atomically, on Save):
//
//   CsvWriter csv({"tag_id", "x", "status"}, {"trigpoint tags 1; frame=enu; datum=control; sigma=1"});
//   csv.Integer(57).Number(1.25, 6).Text("ok").EndRow();
//   csv.Save(dir / "tags.csv");
#pragma once

#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/io/path_error.h"

namespace trigpoint {

class CsvTable;

// One row; valid as long as its table's copy or original lives. Asking for a column that is neither in the header nor
// optional is a programmer's slip and throws InputError all the same.
class CsvRow {
 public:
  // Is the column there and its cell not empty?
  bool Has(std::string_view column) const;
  // The cell, "" where an optional column is missing.
  const std::string& Text(std::string_view column) const;
  // A finite number; throws InputError naming file, line and column for anything else.
  double Number(std::string_view column) const;
  double Number(std::string_view column, double missing) const;  // `missing` for an empty cell or missing column
  int64_t Integer(std::string_view column) const;
  int64_t Integer(std::string_view column, int64_t missing) const;
  int64_t StampNs(std::string_view column) const;  // decimal seconds or integer nanoseconds, exact

  int line() const { return line_; }
  std::string Where() const;                              // "file:line"
  std::string Where(std::string_view column) const;       // "file:line: column c"
  [[noreturn]] void Fail(const std::string& what) const;  // throws InputError "file:line: what"

 private:
  friend class CsvTable;
  struct Header {
    std::filesystem::path file;
    std::vector<std::string> columns;
  };
  const std::string* Cell(std::string_view column) const;  // null: no such column

  std::shared_ptr<const Header> header_;
  std::vector<std::string> cells_;
  int line_ = 0;
};

class CsvTable {
 public:
  // Throws InputError if the file is missing, has no header row, a column twice, or lacks a required column (the
  // nearest one found is named). A row with too few or too many cells fails when it is asked for a cell, so that the
  // others stay readable. Columns neither required nor optional are kept and listed in warnings() with the nearest
  // known name - if `optional` is given at all.
  static CsvTable Read(const std::filesystem::path& file, const std::vector<std::string>& required,
                       const std::vector<std::string>& optional = {});

  const std::vector<CsvRow>& rows() const { return rows_; }
  const std::vector<std::string>& columns() const { return header_->columns; }
  bool HasColumn(std::string_view column) const;
  const std::vector<std::string>& comments() const { return comments_; }  // without '#' and outer spaces
  const std::vector<std::string>& warnings() const { return warnings_; }

  // The file's text without the lines of some rows; all others stay as they were written. Reads the file again.
  std::string TextWithout(const std::function<bool(const CsvRow&)>& leave_out) const;

  // Calls `use` for each row; a row that throws InputError is skipped and named in `warnings` (the first ten; a
  // PathError goes on). Throws the first of them if no row was usable but some were there.
  void ForEachUsable(std::vector<std::string>* warnings, const std::function<void(const CsvRow&)>& use) const;

 private:
  std::shared_ptr<const CsvRow::Header> header_;
  std::vector<CsvRow> rows_;
  std::vector<std::string> comments_;
  std::vector<std::string> warnings_;
};

// Builds a table cell by cell, row by row. The first comment names the table: "trigpoint tags 1; frame=enu; ...".
// Names of columns are written as cells are, line breaks in comments as spaces.
class CsvWriter {
 public:
  explicit CsvWriter(std::vector<std::string> columns, const std::vector<std::string>& comments = {});
  CsvWriter& Text(std::string_view value);
  // Fixed decimals, "-0.000" written as "0.000"; a value that is not finite becomes an empty cell.
  CsvWriter& Number(double value, int decimals);
  CsvWriter& Integer(int64_t value);
  CsvWriter& Stamp(int64_t stamp_ns, int decimals = 9);  // seconds
  CsvWriter& Empty(int cells = 1);
  void EndRow();  // throws std::logic_error unless every column got its cell

  const std::string& text() const { return text_; }
  void Save(const std::filesystem::path& file) const;  // throws IoError

 private:
  void Separate();

  std::vector<std::string> columns_;
  size_t cell_ = 0;
  std::string text_;
};

}  // namespace trigpoint
