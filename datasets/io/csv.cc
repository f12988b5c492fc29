#include "datasets/io/csv.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <set>
#include <stdexcept>

#include "calib/base/counted.h"
#include "datasets/io/csv_dialect.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {
namespace {

// Spreadsheets compute cells that begin so. Text like that is written behind an apostrophe, as they do it, and read
// without it.
bool BeginsLikeAFormula(std::string_view text) {
  return !text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos &&
         !ParseDouble(text);
}

bool IsGuardedFormula(std::string_view text) {
  const size_t first = text.find_first_not_of('\'');
  return first != 0 && first != std::string_view::npos && BeginsLikeAFormula(text.substr(first));
}

struct Record {
  std::vector<std::string> cells;
  int line = 0;  // where it begins
};

constexpr size_t kLongestCell = 1'000'000;

// Cuts the text into records, at the delimiter of the first; comments are collected apart.
std::vector<Record> SplitRecords(const std::filesystem::path& file, std::string_view text, char* delimiter,
                                 std::vector<std::string>* comments) {
  std::vector<Record> records;
  std::string ends = ",\n";
  int line = 1;
  size_t at = 0;
  while (at < text.size()) {
    size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view whole = Trim(text.substr(at, end - at));
    if (whole.empty() || whole.starts_with('#')) {
      if (!whole.empty()) comments->emplace_back(Trim(whole.substr(1)));
      at = end + 1;
      ++line;
      continue;
    }
    if (records.empty()) ends[0] = *delimiter = DelimiterOf(whole);
    Record record{{}, line};
    for (bool more = true; more;) {
      std::string cell;
      while (at < text.size() && text[at] != *delimiter && (text[at] == ' ' || text[at] == '\t')) ++at;
      if (at < text.size() && text[at] == '"') {
        const int opened = line;
        for (++at;; ++at) {
          if (at >= text.size()) throw InputError(FileLine(file, opened) + ": a quote is opened and never closed");
          if (text[at] == '\n') ++line;
          if (text[at] != '"') {
            cell += text[at];
          } else if (at + 1 < text.size() && text[at + 1] == '"') {
            cell += '"';
            ++at;
          } else {
            ++at;
            break;
          }
        }
        end = std::min(text.find_first_of(ends, at), text.size());
        if (!Trim(text.substr(at, end - at)).empty()) {
          throw InputError(FileLine(file, line) + ": text follows a closing quote; expected a '" + ends.substr(0, 1) +
                           "' or the line's end " + "(a quote inside a quoted cell is written twice)");
        }
      } else {
        end = std::min(text.find_first_of(ends, at), text.size());
        cell = Trim(text.substr(at, end - at));
      }
      if (cell.size() > kLongestCell) {
        throw InputError(FileLine(file, record.line) + ": expected cells of at most " + std::to_string(kLongestCell) +
                         " bytes, found one of " + std::to_string(cell.size()));
      }
      if (IsGuardedFormula(cell)) cell.erase(0, 1);
      record.cells.push_back(std::move(cell));
      more = end < text.size() && text[end] == *delimiter;
      at = end + 1;
    }
    ++line;
    records.push_back(std::move(record));
  }
  return records;
}

// How the cells of a column are written.
struct NumberForms {
  size_t points = 0, commas = 0, texts = 0;
  bool thousands = true;  // "1,234" and the like alone
};

NumberForms FormsOf(const std::vector<Record>& records, size_t column) {
  NumberForms forms;
  for (size_t i = 1; i < records.size(); ++i) {
    if (column >= records[i].cells.size() || records[i].cells[column].empty()) continue;
    const std::string& cell = records[i].cells[column];
    if (IsNumberWith('.', cell)) {
      ++forms.points;
    } else if (IsNumberWith(',', cell)) {
      ++forms.commas;
      forms.thousands = forms.thousands && cell.size() - cell.find(',') == 4;
    } else if (!ParseDouble(cell)) {
      ++forms.texts;
    }
  }
  return forms;
}

// Decimal commas to decimal points in each of the columns that has no decimal point and no text that outweighs them.
// Where another one has points, commas stay as they are that may part thousands, or stand in a quoted cell between
// commas. Is there a column that had decimal commas?
bool MendDecimalCommas(const std::vector<bool>& is_read, char delimiter, std::vector<Record>* records) {
  std::vector<NumberForms> forms(is_read.size());
  bool points = false, mended = false;
  for (size_t k = 0; k < is_read.size(); ++k) {
    if (is_read[k]) forms[k] = FormsOf(*records, k);
    points = points || forms[k].points > forms[k].texts;
  }
  for (size_t k = 0; k < is_read.size(); ++k) {
    const NumberForms& form = forms[k];
    if (form.commas == 0 || form.points > 0 || form.texts > form.commas ||
        (points && (form.thousands || delimiter == ',')))
      continue;
    mended = true;
    for (size_t i = 1; i < records->size(); ++i) {
      if (k >= (*records)[i].cells.size()) continue;
      std::string& cell = (*records)[i].cells[k];
      if (IsNumberWith(',', cell)) cell[cell.find(',')] = '.';
    }
  }
  return mended;
}

std::string NameOf(char delimiter) {
  return delimiter == ';' ? "semicolons" : delimiter == '\t' ? "tabs" : delimiter == '|' ? "bars" : "commas";
}

// What of a table is not as documented and how it was taken; "" if all is.
std::string Understood(const std::vector<std::string>& columns, char delimiter, bool decimal_comma) {
  std::string text;
  for (const std::string& column : columns) text += (text.empty() ? "" : ", ") + column;
  if (delimiter != ',') text += (text.empty() ? "" : "; ") + ("cells separated by " + NameOf(delimiter));
  if (decimal_comma) text += std::string(text.empty() ? "" : "; ") + "decimal commas";
  return text;
}

}  // namespace

const std::string* CsvRow::Cell(std::string_view column) const {
  const auto& columns = header_->columns;
  const auto it = std::find(columns.begin(), columns.end(), column);
  if (it == columns.end()) return nullptr;
  if (cells_.size() != columns.size()) {
    Fail("expected " + std::to_string(columns.size()) + " cells, found " + std::to_string(cells_.size()));
  }
  return &cells_[static_cast<size_t>(it - columns.begin())];
}

bool CsvRow::Has(std::string_view column) const {
  const std::string* cell = Cell(column);
  return cell != nullptr && !cell->empty();
}

const std::string& CsvRow::Text(std::string_view column) const {
  static const std::string empty;
  const std::string* cell = Cell(column);
  return cell == nullptr ? empty : *cell;
}

double CsvRow::Number(std::string_view column) const {
  const std::optional<double> value = ParseDouble(Text(column));
  if (!value || !std::isfinite(*value)) {
    throw InputError(Where(column) + ": expected a number, found '" + Excerpt(Text(column)) + "'");
  }
  return *value;
}

double CsvRow::Number(std::string_view column, double missing) const { return Has(column) ? Number(column) : missing; }

int64_t CsvRow::Integer(std::string_view column) const {
  const std::optional<int64_t> value = ParseInt(Text(column));
  if (!value) throw InputError(Where(column) + ": expected a whole number, found '" + Excerpt(Text(column)) + "'");
  return *value;
}

int64_t CsvRow::Integer(std::string_view column, int64_t missing) const {
  return Has(column) ? Integer(column) : missing;
}

int64_t CsvRow::StampNs(std::string_view column) const {
  try {
    return ParseSecondsToNs(Text(column));
  } catch (const InputError& e) {
    throw InputError(Where(column) + ": " + e.what());
  }
}

std::string CsvRow::Where() const { return FileLine(header_->file, line_); }

std::string CsvRow::Where(std::string_view column) const { return Where() + ": column " + std::string(column); }

void CsvRow::Fail(const std::string& what) const { throw InputError(Where() + ": " + what); }

CsvTable CsvTable::Read(const std::filesystem::path& file, const std::vector<std::string>& required,
                        const std::vector<std::string>& optional) {
  CsvTable table;
  char delimiter = ',';
  std::vector<Record> records = SplitRecords(file, ReadTextFile(file), &delimiter, &table.comments_);
  if (records.empty()) throw InputError(file.string() + ": the table is empty; expected a header row");
  auto header = std::make_shared<CsvRow::Header>();
  header->file = file;
  header->columns = std::move(records.front().cells);
  const int header_line = records.front().line;
  for (auto it = header->columns.begin(); it != header->columns.end(); ++it) {
    if (std::find(header->columns.begin(), it, *it) != it) {
      throw InputError(FileLine(file, header_line) + ": column '" + *it + "' stands twice in the header row");
    }
  }
  const auto known = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  std::vector<std::string> all = required;
  all.insert(all.end(), optional.begin(), optional.end());
  const std::vector<std::string> renamed = UseKnownColumns(all, &header->columns);
  std::vector<bool> is_read;
  for (const std::string& column : header->columns) is_read.push_back(known(all, column));
  const std::string understood = Understood(renamed, delimiter, MendDecimalCommas(is_read, delimiter, &records));
  if (!understood.empty()) table.warnings_.push_back(FileLine(file, header_line) + ": understood as " + understood);
  std::vector<std::string> spare;  // columns nobody asked for, candidates for a slip of the pen
  for (const std::string& column : header->columns) {
    if (!known(required, column) && !known(optional, column)) spare.push_back(column);
  }
  for (const std::string& column : required) {
    if (known(header->columns, column)) continue;
    const std::string nearest = NearestName(column, spare);
    throw InputError(FileLine(file, header_line) + ": column '" + column + "' is missing in the header row" +
                     (nearest.empty() ? "" : "; nearest column found: '" + Excerpt(nearest) + "'") +
                     (understood.empty() ? "" : " (understood: " + Excerpt(understood) + ")"));
  }
  if (!optional.empty()) {
    for (const std::string& column : spare) {
      if (column.empty()) continue;
      table.warnings_.push_back(FileLine(file, header_line) + ": column '" + Excerpt(column) +
                                "' is not known and not used; nearest known column: '" + NearestName(column, all) +
                                "'");
    }
  }
  table.header_ = header;
  table.rows_.reserve(records.size() - 1);
  for (size_t i = 1; i < records.size(); ++i) {
    CsvRow row;
    row.header_ = table.header_;
    row.cells_ = std::move(records[i].cells);
    row.line_ = records[i].line;
    table.rows_.push_back(std::move(row));
  }
  return table;
}

bool CsvTable::HasColumn(std::string_view column) const {
  return std::find(columns().begin(), columns().end(), column) != columns().end();
}

std::string CsvTable::TextWithout(const std::function<bool(const CsvRow&)>& leave_out) const {
  std::set<int> out;
  for (const CsvRow& row : rows_) {
    if (!leave_out(row)) continue;
    int line = row.line();
    out.insert(line);
    for (const std::string& column : columns()) {  // a quoted cell may go on in the next lines
      const std::string& cell = row.Text(column);
      for (auto ends = std::count(cell.begin(), cell.end(), '\n'); ends > 0; --ends) out.insert(++line);
    }
  }
  const std::string text = ReadTextFile(header_->file);
  std::string kept;
  int line = 0;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    if (out.count(++line) == 0) kept += text.substr(at, end - at);
    at = end;
  }
  return kept;
}

void CsvTable::ForEachUsable(std::vector<std::string>* warnings, const std::function<void(const CsvRow&)>& use) const {
  constexpr size_t kNamed = 10;
  std::optional<InputError> first;
  size_t skipped = 0;
  std::vector<std::string> unsaid;  // the stage that reads the table says it
  if (warnings == nullptr) warnings = &unsaid;
  for (const CsvRow& row : rows_) {
    try {
      use(row);
    } catch (const PathError&) {
      throw;
    } catch (const InputError& e) {
      if (!first) first = e;
      if (++skipped <= kNamed) warnings->push_back(std::string(e.what()) + "; the row is skipped");
    }
  }
  if (first && skipped == rows_.size()) throw *first;
  if (skipped > kNamed) {
    warnings->push_back(header_->file.string() + ": skipped " + Counted(skipped - kNamed, "more row"));
  }
}

CsvWriter::CsvWriter(std::vector<std::string> columns, const std::vector<std::string>& comments)
    : columns_(std::move(columns)) {
  for (std::string comment : comments) {
    std::replace_if(
        comment.begin(), comment.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
    text_ += "# " + comment + "\n";
  }
  for (const std::string& column : columns_) Text(column);
  EndRow();
}

void CsvWriter::Separate() {
  if (cell_++ > 0) text_ += ',';
}

CsvWriter& CsvWriter::Text(std::string_view value) {
  const bool first = cell_ == 0;
  Separate();
  const std::string guard = BeginsLikeAFormula(value) || IsGuardedFormula(value) ? "'" : "";
  const bool quote = value.find_first_of(",\"\n\r") != std::string_view::npos || value != Trim(value) ||
                     (first && value.starts_with('#'));
  if (!quote) {
    text_.append(guard).append(value);
    return *this;
  }
  text_.append("\"").append(guard);
  for (char c : value) {
    if (c == '"') text_ += '"';
    text_ += c;
  }
  text_ += '"';
  return *this;
}

CsvWriter& CsvWriter::Number(double value, int decimals) {
  Separate();
  if (!std::isfinite(value)) return *this;
  char buffer[400];
  std::snprintf(buffer, sizeof(buffer), "%.*f", decimals, value);
  std::string_view number(buffer);
  if (number.starts_with('-') && number.find_first_of("123456789") == std::string_view::npos) number.remove_prefix(1);
  text_ += number;
  return *this;
}

CsvWriter& CsvWriter::Integer(int64_t value) {
  Separate();
  text_ += std::to_string(value);
  return *this;
}

CsvWriter& CsvWriter::Stamp(int64_t stamp_ns, int decimals) {
  Separate();
  text_ += FormatNsAsSeconds(stamp_ns, decimals);
  return *this;
}

CsvWriter& CsvWriter::Empty(int cells) {
  for (int i = 0; i < cells; ++i) Separate();
  return *this;
}

void CsvWriter::EndRow() {
  if (cell_ != columns_.size()) {
    throw std::logic_error("a table row has " + std::to_string(cell_) + " cells for " +
                           std::to_string(columns_.size()) + " columns, beginning with " + columns_.front());
  }
  text_ += '\n';
  cell_ = 0;
}

void CsvWriter::Save(const std::filesystem::path& file) const { WriteFileAtomically(file, text_); }

}  // namespace trigpoint
