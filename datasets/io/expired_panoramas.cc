#include "datasets/io/expired_panoramas.h"

#include <chrono>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr const char* kColumn = "keep_until";

// The table without rows that are over; their pictures go first, so that a kill leaves the rows to go on from.
int ForgetInTable(const fs::path& site, const fs::path& file, int64_t now_s) {
  const CsvTable table = CsvTable::Read(file, {"file"});
  CsvWriter csv(table.columns(), table.comments());
  int forgotten = 0;
  for (const CsvRow& row : table.rows()) {
    if (table.HasColumn(kColumn) && IsOver(row.Text(kColumn), now_s)) {
      std::error_code ignored;
      fs::remove(ResolveInside(site, site, row.Text("file"), row.Where()), ignored);
      ++forgotten;
      continue;
    }
    for (const std::string& column : table.columns()) csv.Text(row.Text(column));
    csv.EndRow();
  }
  if (forgotten == static_cast<int>(table.rows().size())) {
    fs::remove(file);
  } else if (forgotten > 0) {
    csv.Save(file);
  }
  return forgotten;
}

// Removes what a kill left of files being written (".google-ID.jpg.123-45-6", ".panoramas.csv.123-45-6"), among them
// some that must not be kept.
void RemoveUnfinished(const fs::path& folder, const std::string& ending) {
  constexpr auto kLongestWrite = std::chrono::minutes(1);
  std::vector<fs::path> left;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    const std::string name = entry.path().filename().string();
    const size_t end = name.rfind(ending + ".");
    if (!name.starts_with('.') || end == std::string::npos) continue;
    const std::string number = name.substr(end + ending.size() + 1);
    if (number.empty() || number.find_first_not_of("0123456789-") != std::string::npos) continue;
    std::error_code gone;
    const auto written = entry.last_write_time(gone);
    if (!gone && written < fs::file_time_type::clock::now() - kLongestWrite) left.push_back(entry.path());
  }
  for (const fs::path& file : left) fs::remove(file, none);
}

}  // namespace

bool IsOver(const std::string& keep_until, int64_t now_s) {
  if (keep_until > "2200") return false;  // nanoseconds since 1970 end in 2262
  const auto end = ParseUtcToNs(keep_until);
  return end && *end / 1'000'000'000 <= now_s;
}

int64_t NowUtc_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

int ForgetExpiredPanoramas(const fs::path& site, int64_t now_s) {
  const fs::path replaced = site / "results" / "replaced";
  RemoveUnfinished(site / "panoramas", ".jpg");
  RemoveUnfinished(site, "panoramas.csv");
  RemoveUnfinished(replaced, "panoramas.csv");
  std::vector<fs::path> tables = {site / "panoramas.csv"};
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(replaced, none)) {
    if (entry.path().filename().string().ends_with("-panoramas.csv")) tables.push_back(entry.path());
  }
  int forgotten = 0;
  for (const fs::path& table : tables) {
    try {
      if (!fs::exists(table) || ReadTextFile(table).find(kColumn) == std::string::npos) continue;
      const int rows = ForgetInTable(site, table, now_s);
      if (table == tables.front()) forgotten = rows;
    } catch (const InputError&) {
      continue;
    }
  }
  return forgotten;
}

}  // namespace trigpoint
