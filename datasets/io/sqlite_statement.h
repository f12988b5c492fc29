// SQLite's statements, for whoever links it.
#pragma once

#include <sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "calib/base/error.h"

namespace trigpoint {

// A prepared statement that finalises itself.
class Statement {
 public:
  Statement(sqlite3* db, const char* sql, const std::string& file) : db_(db), file_(file) {
    if (sqlite3_prepare_v2(db, sql, -1, &statement_, nullptr) != SQLITE_OK) Fail();
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  void Int(int i, int64_t v) { sqlite3_bind_int64(statement_, i, v); }
  void Text(int i, const std::string& v) { sqlite3_bind_text(statement_, i, v.c_str(), -1, SQLITE_TRANSIENT); }
  void Blob(int i, const void* data, size_t bytes) {
    sqlite3_bind_blob64(statement_, i, data, bytes, SQLITE_TRANSIENT);
  }
  bool Step() {
    const int code = sqlite3_step(statement_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) Fail();
    return code == SQLITE_ROW;
  }
  int64_t ColumnInt(int i) const { return sqlite3_column_int64(statement_, i); }
  std::string ColumnText(int i) const {
    const unsigned char* text = sqlite3_column_text(statement_, i);
    return text == nullptr ? std::string() : reinterpret_cast<const char*>(text);
  }
  const void* ColumnBlob(int i) const { return sqlite3_column_blob(statement_, i); }
  size_t ColumnBytes(int i) const { return static_cast<size_t>(sqlite3_column_bytes(statement_, i)); }

 private:
  [[noreturn]] void Fail() const { throw IoError("database " + file_ + ": " + sqlite3_errmsg(db_)); }
  sqlite3* db_;
  std::string file_;
  sqlite3_stmt* statement_ = nullptr;
};

}  // namespace trigpoint
