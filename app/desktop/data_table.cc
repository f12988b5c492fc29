#include "app/desktop/data_table.h"

#include <algorithm>
#include <numeric>

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

// Which object a row is about, by the columns it has; a row about two is the first one's.
std::string ObjectOf(const CsvRow& row, const CsvTable& table, const DataTableSource& source) {
  const auto text = [&](const char* column) {
    return table.HasColumn(column) && row.Has(column) ? row.Text(column) : std::string();
  };
  const auto first_of = [&](const char* column, const char* or_else) {
    return text(column).empty() ? text(or_else) : text(column);
  };
  const std::string run = text("run").empty() ? source.run : text("run");
  std::string image = first_of("image", "image_a");
  if (image.empty() && table.HasColumn("image") && !text("timestamp").empty()) {
    image = ReviewImageName("", row.StampNs("timestamp"));
  }
  if (!run.empty() && !image.empty()) {
    image.insert(0, run + "/");
    return text("tag_id").empty() ? "image:" + image : "detection:" + image + "#" + text("tag_id");
  }
  if (!text("station").empty()) return "station:" + text("station");
  const std::string panorama = first_of("panorama", "panorama_a"), tag = first_of("tag_id", "tag_a");
  if (!panorama.empty()) return "panorama:" + panorama;
  if (!tag.empty()) return "tag:" + tag;
  return source.set.empty() ? "" : "panorama:" + source.set;
}

// Final answers before those of views, as the files' other readers have them.
void PutViewsLast(DataTable* table) {
  const auto method = std::find(table->columns.begin(), table->columns.end(), "method");
  if (method == table->columns.end()) return;
  const auto column = static_cast<size_t>(method - table->columns.begin());
  std::vector<size_t> order(table->rows.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_partition(order.begin(), order.end(), [&](size_t row) { return table->rows[row][column] != "g1"; });
  DataTable sorted = *table;
  for (size_t i = 0; i < order.size(); ++i) {
    sorted.rows[i] = table->rows[order[i]];
    sorted.objects[i] = table->objects[order[i]];
  }
  *table = std::move(sorted);
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
      const std::string stage = relative.begin()->string(), name = std::next(relative.begin())->string();
      if (stage == "stitch") source.set = name.substr(0, name.find('@'));
      // Calibrations and the report's tables have names of their own.
      if (stage != "stitch" && stage != "calibrate" && stage != "report") source.run = name.substr(0, name.find('@'));
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
    std::string object = ObjectOf(row, csv, source);
    table.rows.push_back(std::move(cells));
    table.objects.push_back(std::move(object));
  });
  PutViewsLast(&table);
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
