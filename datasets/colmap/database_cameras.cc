#include "datasets/colmap/database_cameras.h"

#include <sqlite3.h>

#include <cstring>
#include <memory>

#include "calib/base/error.h"
#include "datasets/colmap/camera_models.h"

namespace trigpoint {

std::vector<std::pair<uint32_t, Camera>> ReadDatabaseCameras(const std::filesystem::path& file) {
  sqlite3* raw = nullptr;
  const int opened = sqlite3_open_v2(file.c_str(), &raw, SQLITE_OPEN_READONLY, nullptr);
  const std::unique_ptr<sqlite3, decltype(&sqlite3_close)> db(raw, sqlite3_close);
  if (opened != SQLITE_OK) throw IoError("database " + file.string() + ": cannot be opened");
  sqlite3_busy_timeout(raw, 2000);
  sqlite3_stmt* prepared = nullptr;
  const int code = sqlite3_prepare_v2(
      raw, "SELECT camera_id, model, width, height, params FROM cameras ORDER BY camera_id", -1, &prepared, nullptr);
  const std::unique_ptr<sqlite3_stmt, decltype(&sqlite3_finalize)> statement(prepared, sqlite3_finalize);
  if (code != SQLITE_OK) throw IoError("database " + file.string() + ": " + sqlite3_errmsg(raw));
  std::vector<std::pair<uint32_t, Camera>> cameras;
  int step = sqlite3_step(prepared);
  for (; step == SQLITE_ROW; step = sqlite3_step(prepared)) {
    const int64_t id = sqlite3_column_int64(prepared, 0), width = sqlite3_column_int64(prepared, 2),
                  height = sqlite3_column_int64(prepared, 3);
    const auto fail = [&](const std::string& what) {
      return InputError("database " + file.string() + ": camera " + std::to_string(id) + ": " + what);
    };
    if (width < 1 || height < 1 || width > 1'000'000 || height > 1'000'000) {
      throw fail("its size is " + std::to_string(width) + " x " + std::to_string(height) + " px");
    }
    ColmapCamera c;
    c.model_id = sqlite3_column_int(prepared, 1);
    c.model_name = std::to_string(c.model_id);
    c.width = static_cast<int>(width), c.height = static_cast<int>(height);
    const void* params = sqlite3_column_blob(prepared, 4);
    c.params.resize(static_cast<size_t>(sqlite3_column_bytes(prepared, 4)) / sizeof(double));
    if (!c.params.empty()) std::memcpy(c.params.data(), params, c.params.size() * sizeof(double));
    try {
      cameras.emplace_back(static_cast<uint32_t>(id), FromColmap(c));
    } catch (const Error& e) {
      throw fail(e.what());
    }
  }
  if (step != SQLITE_DONE) throw IoError("database " + file.string() + ": " + sqlite3_errmsg(raw));
  return cameras;
}

}  // namespace trigpoint
