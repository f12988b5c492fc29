// Markdown and CSV.
#include <fmt/format.h>

#include <algorithm>

#include "datasets/io/csv.h"
#include "eval/report/document.h"

namespace trigpoint {
namespace {

// Text that Markdown shows as it is.
std::string Plain(const std::string& text) {
  std::string plain;
  for (char c : CleanText(text)) {
    if (std::string_view("\\`*_[]<>|#").find(c) != std::string_view::npos) plain += '\\';
    plain += c;
  }
  return plain;
}

class MarkdownWriter {
 public:
  explicit MarkdownWriter(std::string* text) : text_(*text) {}
  void operator()(const Heading& h) const {
    text_ += std::string(static_cast<size_t>(h.level), '#') + " " + Plain(h.text) + "\n\n";
  }
  void operator()(const Paragraph& p) const { text_ += Plain(p.text) + "\n\n"; }
  void operator()(const Facts& facts) const {
    for (const Fact& f : facts.facts) {
      text_ += "- " + Plain(f.label) + ": **" + Plain(f.value) + "**" +
               (f.detail.empty() ? "" : ", " + Plain(f.detail)) + "\n";
    }
    text_ += "\n";
  }
  void operator()(const Table& table) const {
    if (const std::string caption = CaptionOf(table); !caption.empty()) text_ += Plain(caption) + "\n\n";
    std::string rule;
    for (const TableColumn& c : table.columns) {
      text_ += "| " + Plain(c.name) + " ";
      rule += c.number ? "|---:" : "|---";
    }
    text_ += "|\n" + rule + "|\n";
    for (const auto& row : table.rows) {
      for (const TableCell& cell : row) text_ += "| " + (cell.text.empty() ? "-" : Plain(cell.text)) + " ";
      text_ += "|\n";
    }
    text_ += "\n";
  }
  void operator()(const Figure& figure) const {
    text_ += "![" + Plain(figure.caption) + "](figures/" + figure.name + ".png)\n\n" + Plain(figure.caption) + "\n\n";
  }
  void operator()(const FoldBegin& fold) const { text_ += "**" + Plain(fold.title) + "**\n\n"; }
  void operator()(const AppendixBegin&) const {}
  void operator()(const AppendixEnd&) const {}
  void operator()(const FoldEnd&) const {}
  void operator()(const Columns&) const {}

 private:
  std::string& text_;
};

}  // namespace

std::string CaptionOf(const Table& table) {
  std::string text = table.caption;
  std::vector<std::pair<std::string, std::string>> reasons;  // and the columns they are for
  for (size_t k = 0; k < table.columns.size(); ++k) {
    const TableColumn& column = table.columns[k];
    const bool any = std::any_of(table.rows.begin(), table.rows.end(),
                                 [&](const auto& row) { return k < row.size() && row[k].text.empty(); });
    if (!any || column.missing.empty()) continue;
    const auto same =
        std::find_if(reasons.begin(), reasons.end(), [&](const auto& r) { return r.first == column.missing; });
    if (same == reasons.end()) {
      reasons.emplace_back(column.missing, column.name);
    } else {
      same->second += ", " + column.name;
    }
  }
  for (const auto& [reason, columns] : reasons) text += " - under " + columns + ": " + reason + ".";
  return text;
}

std::string MarkdownOf(const Document& document) {
  std::string text = "# " + Plain(document.title) + "\n\n" + Plain(document.subtitle) + "\n\n";
  const MarkdownWriter writer(&text);
  for (const Block& block : document.blocks) std::visit(writer, block);
  return text + Plain(document.footer) + "\n";
}

std::string CsvOf(const Table& table) {
  std::vector<std::string> columns;
  for (const TableColumn& column : table.columns) columns.push_back(column.name);
  CsvWriter csv(columns, {"trigpoint report table 1; " + CleanText(table.caption)});
  for (const auto& row : table.rows) {
    for (size_t k = 0; k < columns.size(); ++k) csv.Text(k < row.size() ? CleanText(row[k].text) : "");
    csv.EndRow();
  }
  return csv.text();
}

}  // namespace trigpoint
