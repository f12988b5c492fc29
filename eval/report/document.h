// What a report says, apart from how it is set: the same blocks become HTML, PDF and Markdown.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "eval/report/drawing.h"
#include "eval/text/number_text.h"

namespace trigpoint {

enum class Tone { kPlain, kGood, kWarning, kBad };

struct Heading {
  int level = 2;  // 2: a chapter, in the table of contents; 3: a section
  std::string text;
  std::string anchor;  // unique, [a-z0-9-]
};

struct Paragraph {
  std::string text;
  Tone tone = Tone::kPlain;
  std::string anchor;  // of a heading it leads to
};

// Few numbers, large.
struct Fact {
  std::string label, value, detail;
  Tone tone = Tone::kPlain;
  std::string anchor;  // of a heading it leads to
};
struct Facts {
  std::vector<Fact> facts;
};

struct TableCell {
  std::string text;
  std::optional<double> sort;  // by which a column is sorted, else its text
  Tone tone = Tone::kPlain;
  std::string anchor;  // of a heading it leads to
  std::string link;    // of a file, relative to the report
};
// A number that may be missing, by which its column is sorted.
inline TableCell NumberCell(const std::optional<double>& value, int decimals, Tone tone = Tone::kPlain) {
  return {NumberText(value, decimals), value, tone};
}
struct TableColumn {
  std::string name;  // with its unit
  bool number = false;
  std::string missing;  // why a cell is empty
};
struct Table {
  std::string name;  // of the CSV file beside the report; empty: none
  std::string caption;
  std::vector<TableColumn> columns;
  std::vector<std::vector<TableCell>> rows;
};

// The caption, and for columns with empty cells why they are: "... "-": NEES: no covariance."
std::string CaptionOf(const Table& table);

// JPEG or PNG as it is stored.
struct Picture {
  std::string bytes;
  bool jpeg = true;
  int width = 0, height = 0;
};
struct Figure {
  std::string name;  // of the file in figures/, without extension
  std::string caption;
  std::variant<Drawing, Picture> content;
  bool thumbnail = false;  // small on the screen, large when it is pressed; on paper two in a row
  bool half = false;       // two in a row on the screen and on paper; a chart of kHalfWidth
};

// What stands between the two can be opened and closed on a screen; on paper it is open, or left to the tables beside
// the report.
struct FoldBegin {
  std::string title;
  bool on_paper = true;
};
struct FoldEnd {};

// Two columns on a wide screen: kBegin, the left one, kNext, the right one, kEnd. On paper one follows the other.
enum class Columns { kBegin, kNext, kEnd };

// What stands between the two is an appendix on paper, with its own heading behind everything else; elsewhere it stays
// where it is, without that heading.
struct AppendixBegin {
  std::string title;   // "stations": "Appendix: stations"
  std::string anchor;  // as a heading's
};
struct AppendixEnd {};

using Block =
    std::variant<Heading, Paragraph, Facts, Table, Figure, FoldBegin, FoldEnd, Columns, AppendixBegin, AppendixEnd>;

struct Document {
  std::string title, subtitle;
  std::string date;  // 2026-05-12T09:43:20Z, of the newest input: the PDF's date; empty: none is known
  std::string footer;
  std::vector<Block> blocks;
};

// One file that opens offline: no request leaves it, its one script sorts tables, every text is escaped.
std::string HtmlOf(const Document& document);

// CommonMark with tables; figures are links into figures/.
std::string MarkdownOf(const Document& document);

// The rows of a table as CSV, with the caption as a comment.
std::string CsvOf(const Table& table);

enum class Paper { kA4, kLetter };
// Set with Cairo and Pango. Figures may go to the next page, so that text fills this one. Returns how far down each
// page is filled, from 0 to 1. Throws IoError naming the file.
std::vector<double> WritePdf(const Document& document, Paper paper, const std::string& file);

// A chart as PNG, `scale` pixels a unit.
std::string PngOf(const Drawing& drawing, double scale);

}  // namespace trigpoint
