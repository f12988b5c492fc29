// Tables of solution.db: each column is described once, by where its value lies in memory, and both written and read by
// that. Columns have no declared type, so that SQLite keeps every number as it is.
#pragma once

#include <sqlite3.h>

#include <Eigen/Core>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "datasets/project/hash.h"

namespace trigpoint::solution_table {

// The hash of all values in order: of each piece with the hash of those before it.
class HashChain {
 public:
  void Add(const void* data, size_t size) {
    piece_.append(static_cast<const char*>(data), size);
    if (piece_.size() >= kPiece) piece_ = Sha256(piece_);
  }
  std::string Hex() const { return Sha256(piece_); }

 private:
  static constexpr size_t kPiece = 1 << 20;
  std::string piece_;
};

// What is bound or read; all of it is hashed.
class Cells {
 public:
  Cells(sqlite3_stmt* statement, HashChain* hash) : statement_(statement), hash_(hash) {}

  void PutInteger(int column, int64_t value) {
    Hash(&value, sizeof value);
    sqlite3_bind_int64(statement_, column + 1, value);
  }
  void PutReal(int column, double value) {
    Hash(&value, std::isnan(value) ? 0 : sizeof value);  // SQLite has one NaN: NULL
    sqlite3_bind_double(statement_, column + 1, value);
  }
  void PutText(int column, const std::string& value) {
    HashSized(value.data(), value.size());
    sqlite3_bind_text(statement_, column + 1, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT);
  }
  void PutBlob(int column, const void* data, size_t size) {
    HashSized(data, size);
    sqlite3_bind_blob64(statement_, column + 1, size == 0 ? "" : data, size, SQLITE_TRANSIENT);
  }

  // False: the cell holds something else.
  bool GetInteger(int column, int64_t* value) {
    if (sqlite3_column_type(statement_, column) != SQLITE_INTEGER) return false;
    *value = sqlite3_column_int64(statement_, column);
    Hash(value, sizeof *value);
    return true;
  }
  bool GetReal(int column, double* value) {
    const int type = sqlite3_column_type(statement_, column);
    if (type != SQLITE_FLOAT && type != SQLITE_NULL) return false;
    *value = type == SQLITE_NULL ? std::numeric_limits<double>::quiet_NaN() : sqlite3_column_double(statement_, column);
    Hash(value, type == SQLITE_NULL ? 0 : sizeof *value);
    return true;
  }
  bool GetText(int column, std::string* value) {
    if (sqlite3_column_type(statement_, column) != SQLITE_TEXT) return false;
    const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    value->assign(text, static_cast<size_t>(sqlite3_column_bytes(statement_, column)));
    HashSized(value->data(), value->size());
    return true;
  }
  // Of `size` bytes; any size for `size` < 0.
  bool GetBlob(int column, std::string* value, int64_t size) {
    if (sqlite3_column_type(statement_, column) != SQLITE_BLOB) return false;
    const auto bytes = static_cast<size_t>(sqlite3_column_bytes(statement_, column));
    if (size >= 0 && bytes != static_cast<size_t>(size)) return false;
    value->assign(static_cast<const char*>(sqlite3_column_blob(statement_, column)), bytes);
    HashSized(value->data(), value->size());
    return true;
  }

 private:
  void HashSized(const void* data, size_t size) {
    const uint64_t length = size;
    Hash(&length, sizeof length);
    Hash(data, size);
  }
  void Hash(const void* data, size_t size) { hash_->Add(data, size); }
  sqlite3_stmt* statement_;
  HashChain* hash_;
};

inline void Put(Cells& cells, int column, int64_t v) { cells.PutInteger(column, v); }
inline void Put(Cells& cells, int column, int v) { cells.PutInteger(column, v); }
inline void Put(Cells& cells, int column, bool v) { cells.PutInteger(column, v ? 1 : 0); }
inline void Put(Cells& cells, int column, double v) { cells.PutReal(column, v); }
inline void Put(Cells& cells, int column, const std::string& v) { cells.PutText(column, v); }
inline void Put(Cells& cells, int column, const std::vector<double>& v) {
  cells.PutBlob(column, v.data(), v.size() * sizeof(double));
}
template <typename T, int kRows, int kColumns>
void Put(Cells& cells, int column, const Eigen::Matrix<T, kRows, kColumns>& v) {
  cells.PutBlob(column, v.data(), sizeof(T) * static_cast<size_t>(v.size()));
}

inline bool Get(Cells& cells, int column, int64_t* v) { return cells.GetInteger(column, v); }
inline bool Get(Cells& cells, int column, int* v) {
  int64_t wide = 0;
  if (!cells.GetInteger(column, &wide) || wide != static_cast<int>(wide)) return false;
  *v = static_cast<int>(wide);
  return true;
}
inline bool Get(Cells& cells, int column, bool* v) {
  int64_t wide = 0;
  if (!cells.GetInteger(column, &wide) || (wide != 0 && wide != 1)) return false;
  *v = wide == 1;
  return true;
}
inline bool Get(Cells& cells, int column, double* v) { return cells.GetReal(column, v); }
inline bool Get(Cells& cells, int column, std::string* v) { return cells.GetText(column, v); }
inline bool Get(Cells& cells, int column, std::vector<double>* v) {
  std::string bytes;
  if (!cells.GetBlob(column, &bytes, -1) || bytes.size() % sizeof(double) != 0) return false;
  v->resize(bytes.size() / sizeof(double));
  if (!bytes.empty()) std::memcpy(v->data(), bytes.data(), bytes.size());
  return true;
}
template <typename T, int kRows, int kColumns>
bool Get(Cells& cells, int column, Eigen::Matrix<T, kRows, kColumns>* v) {
  std::string bytes;
  if (!cells.GetBlob(column, &bytes, static_cast<int64_t>(sizeof(T)) * v->size())) return false;
  std::memcpy(v->data(), bytes.data(), bytes.size());
  return true;
}

struct Column {
  std::string name;
  std::function<void(Cells& cells, int column, size_t row)> put;
  std::function<bool(Cells& cells, int column, size_t row)> get;
};

struct Table {
  std::string name;
  size_t rows = 0;                     // to be written
  std::function<void(size_t)> resize;  // makes room for those to be read
  std::vector<Column> columns;

  // `at(row)`: a reference to the value, written from there and read to there.
  template <typename F>
  Table& Add(const std::string& column, F at) {
    Column c;
    c.name = column;
    if constexpr (std::is_same_v<std::invoke_result_t<F, size_t>, std::vector<bool>::reference>) {
      c.put = [at](Cells& cells, int k, size_t row) { Put(cells, k, static_cast<bool>(at(row))); };
      c.get = [at](Cells& cells, int k, size_t row) {
        bool value = false;
        const bool good = Get(cells, k, &value);
        at(row) = value;
        return good;
      };
    } else {
      c.put = [at](Cells& cells, int k, size_t row) { Put(cells, k, std::as_const(at(row))); };
      c.get = [at](Cells& cells, int k, size_t row) { return Get(cells, k, &at(row)); };
    }
    columns.push_back(std::move(c));
    return *this;
  }
  // Elements of a vector, or a member of each; it must outlive the table.
  template <typename T>
  Table& Add(const std::string& column, std::vector<T>& of) {
    return Add(column, [&of](size_t row) -> T& { return of[row]; });
  }
  template <typename T, typename M, typename Of>
  Table& Add(const std::string& column, std::vector<T>& of, M Of::*member) {
    return Add(column, [&of, member](size_t row) -> M& { return of[row].*member; });
  }
  // Of a table of one row.
  template <typename T>
  Table& AddOne(const std::string& column, T& value) {
    return Add(column, [&value](size_t) -> T& { return value; });
  }
  // A value that stands for something else in memory: `get(row)` makes it, `set(row, value)` takes it and is false for
  // one that makes no sense.
  template <typename G, typename F>
  Table& AddMade(const std::string& column, G get, F set) {
    using T = std::invoke_result_t<G, size_t>;
    columns.push_back({column, [get](Cells& cells, int k, size_t row) { Put(cells, k, get(row)); },
                       [set](Cells& cells, int k, size_t row) {
                         T value{};
                         return Get(cells, k, &value) && set(row, std::move(value));
                       }});
    return *this;
  }
  // A rigid transform in seven columns.
  template <typename F>
  Table& AddRigid(const std::string& prefix, F at) {
    const char* const kNames[] = {"qx", "qy", "qz", "qw", "tx", "ty", "tz"};
    for (int k = 0; k < 7; ++k) {
      Add(prefix + kNames[k],
          [at, k](size_t row) -> double& { return k < 4 ? at(row).rotation.coeffs()[k] : at(row).translation[k - 4]; });
    }
    return *this;
  }
};

}  // namespace trigpoint::solution_table
