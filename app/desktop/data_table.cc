#include "app/desktop/data_table.h"

#include <algorithm>

#include "datasets/io/csv.h"
#include "datasets/project/review.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr const char* kFirst[] = {"evaluate", "survey", "localize", "detect"};

size_t Rank(const DataTableSource& source) {
  size_t rank = 0;
  while (rank < std::size(kFirst) && !source.title.starts_with(kFirst[rank])) ++rank;
  return 2 * rank + (source.title.ends_with("/errors") ? 0 : 1);
}

// Which object a row is about, by the columns it has.
std::string ObjectOf(const CsvRow& row, const CsvTable& table, const std::string& run_of_table) {
  const auto text = [&](const char* column) {
    return table.HasColumn(column) && row.Has(column) ? row.Text(column) : std::string();
  };
  const std::string run = text("run").empty() ? run_of_table : text("run");
  const bool in_image = !run.empty() && table.HasColumn("image");
  if (in_image) {
    const std::string image = run + "/" + ReviewImageName(text("image"), row.StampNs("timestamp"));
    return text("tag_id").empty() ? "image:" + image : "detection:" + image + "#" + text("tag_id");
  }
  if (!text("station").empty()) return "station:" + text("station");
  if (!text("panorama").empty()) return "panorama:" + text("panorama");
  if (!text("tag_id").empty()) return "tag:" + text("tag_id");
  return "";
}

}  // namespace

std::vector<DataTableSource> FindTables(const fs::path& results) {
  std::vector<DataTableSource> tables;
  std::error_code ignored;
  for (fs::recursive_directory_iterator it(results, ignored), end; it != end; it.increment(ignored)) {
    const fs::path& path = it->path();
    if (path.filename().string().starts_with('.')) {
      it.disable_recursion_pending();
      continue;
    }
    if (path.extension() != ".csv" || !it->is_regular_file(ignored)) continue;
    DataTableSource source;
    source.file = path;
    const fs::path relative = path.lexically_relative(results);
    source.title = (relative.parent_path() / relative.stem()).generic_string();
    if (std::distance(relative.begin(), relative.end()) == 3) {  // stage/run@variant/table.csv
      const std::string name = std::next(relative.begin())->string();
      source.run = name.substr(0, name.find('@'));
    }
    tables.push_back(std::move(source));
  }
  std::sort(tables.begin(), tables.end(), [](const DataTableSource& a, const DataTableSource& b) {
    return std::make_pair(Rank(a), a.title) < std::make_pair(Rank(b), b.title);
  });
  return tables;
}

DataTable LoadDataTable(const DataTableSource& source) {
  const CsvTable csv = CsvTable::Read(source.file, {});
  DataTable table;
  table.title = source.title;
  table.file = source.file;
  table.columns = csv.columns();
  if (!csv.comments().empty()) table.comment = csv.comments().front();
  csv.ForEachUsable(&table.warnings, [&](const CsvRow& row) {
    std::vector<std::string> cells;
    cells.reserve(table.columns.size());
    for (const std::string& column : table.columns) cells.push_back(row.Text(column));
    std::string object = ObjectOf(row, csv, source.run);
    table.rows.push_back(std::move(cells));
    table.objects.push_back(std::move(object));
  });
  return table;
}

void ExportDataTable(const DataTable& table, const std::vector<int>& rows, const fs::path& file) {
  CsvWriter csv(table.columns, {"trigpoint " + table.title + " 1; a selection of " + std::to_string(rows.size()) +
                                " of " + std::to_string(table.rows.size()) + " rows"});
  for (const int row : rows) {
    for (const std::string& cell : table.rows[static_cast<size_t>(row)]) csv.Text(cell);
    csv.EndRow();
  }
  csv.Save(file);
}

}  // namespace trigpoint
