#include "datasets/io/expired_panoramas.h"

#include <chrono>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/kept_input.h"
#include "datasets/io/source_quality.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr const char* kColumn = "keep_until";

// Is `file` of a row a picture as an import names it, with nothing else of that name and no link on the way to it?
bool IsImportedOrGone(const fs::path& site, const fs::path& file) {
  std::error_code ignored;
  if (file.parent_path() != "panoramas" || !IsPictureOfAService(file.filename().string())) return false;
  const auto folder = fs::symlink_status(site / "panoramas", ignored).type();
  const auto picture = fs::symlink_status(site / file, ignored).type();
  return (folder == fs::file_type::directory || folder == fs::file_type::not_found) &&
         (picture == fs::file_type::regular || picture == fs::file_type::not_found);
}

// The table without rows that are over; their pictures go first, so that a kill leaves the rows to go on from. Pictures
// in `allowed` stay.
int ForgetInTable(const fs::path& site, const fs::path& file, const std::set<fs::path>& allowed, int64_t now_s) {
  const CsvTable table = CsvTable::Read(file, {"file"});
  size_t forgotten = 0;
  const auto is_over = [&](const CsvRow& row) {
    return IsOver(row.Text(kColumn), now_s) && IsImportedOrGone(site, row.Text("file"));
  };
  for (const CsvRow& row : table.rows()) {
    if (!is_over(row)) continue;
    ++forgotten;
    std::error_code ignored;
    if (const fs::path picture = site / row.Text("file"); allowed.count(picture) == 0) fs::remove(picture, ignored);
  }
  if (forgotten == 0) return 0;
  const std::string text = table.TextWithout(is_over);
  if (file.parent_path() == site) KeepInputFile(site, file.filename());
  if (forgotten == table.rows().size()) {
    fs::remove(file);
  } else {
    WriteFileAtomically(file, text);
  }
  return static_cast<int>(forgotten);
}

// Pictures of SITE/panoramas.csv that may be kept. Throws InputError where it cannot be read.
std::set<fs::path> AllowedPictures(const fs::path& site, int64_t now_s) {
  std::set<fs::path> allowed;
  const fs::path file = site / "panoramas.csv";
  if (!fs::exists(file)) return allowed;
  const CsvTable table = CsvTable::Read(file, {"file"});
  for (const CsvRow& row : table.rows()) {
    std::error_code ignored;  // also "./panoramas/a.jpg", and by way of a link
    if (!IsOver(row.Text(kColumn), now_s)) allowed.insert(fs::weakly_canonical(site / row.Text("file"), ignored));
  }
  return allowed;
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

int ForgetExpiredPanoramas(const fs::path& dir, int64_t now_s) {
  std::error_code none;
  const fs::path site = fs::canonical(dir, none), replaced = site / "results" / "replaced";
  if (none) return 0;
  RemoveUnfinished(site / "panoramas", ".jpg");
  RemoveUnfinished(site, "panoramas.csv");
  RemoveUnfinished(replaced, "panoramas.csv");
  std::vector<fs::path> tables;
  for (const auto& entry : fs::directory_iterator(replaced, none)) {
    if (entry.path().filename().string().ends_with("-panoramas.csv")) tables.push_back(entry.path());
  }
  // The last: the copy that is kept of it is not among the others, and is cleaned the next time.
  const fs::path present = site / "panoramas.csv";
  tables.push_back(present);
  std::set<fs::path> allowed;
  try {
    allowed = AllowedPictures(site, now_s);
  } catch (const InputError&) {
    return 0;
  }
  int forgotten = 0;
  for (const fs::path& table : tables) {
    try {
      if (!fs::exists(table) || ReadTextFile(table).find(kColumn) == std::string::npos) continue;
      const int rows = ForgetInTable(site, table, allowed, now_s);
      if (table == present) forgotten = rows;
    } catch (const InputError&) {
      continue;
    }
  }
  return forgotten;
}

}  // namespace trigpoint
