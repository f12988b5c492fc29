// ROS 2 bags as SQLite: tables topics (id, name, type, serialization_format) and messages (topic_id, timestamp, data).
#include <cstring>

#include "datasets/bag/bag_formats.h"
#include "datasets/io/sqlite_statement.h"

namespace trigpoint {
namespace {

class SqliteBag {
 public:
  explicit SqliteBag(const std::filesystem::path& file) : name_(file.string()) {
    if (sqlite3_open_v2(name_.c_str(), &db_, SQLITE_OPEN_READONLY, nullptr) != SQLITE_OK) {
      const std::string why = sqlite3_errmsg(db_);
      sqlite3_close(db_);
      throw InputError(name_ + ": cannot be read: " + why);
    }
    sqlite3_limit(db_, SQLITE_LIMIT_LENGTH, static_cast<int>(kMostChunkBytes));
    sqlite3_db_config(db_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  }
  ~SqliteBag() { sqlite3_close(db_); }
  SqliteBag(const SqliteBag&) = delete;
  SqliteBag& operator=(const SqliteBag&) = delete;
  Statement Query(const char* sql) const { return {db_, sql, name_}; }

 private:
  std::string name_;
  sqlite3* db_ = nullptr;
};

std::map<int64_t, BagTopic> TopicsOf(const SqliteBag& bag) {
  std::map<int64_t, BagTopic> topics;
  Statement rows = bag.Query("SELECT id, name, type, serialization_format FROM topics");
  while (rows.Step()) {
    topics[rows.ColumnInt(0)] = {rows.ColumnText(1), PlainType(rows.ColumnText(2)),
                                 rows.ColumnText(3) == "cdr" ? BagEncoding::kCdr : BagEncoding::kOther, 0};
  }
  return topics;
}

// Messages may be compressed one by one; CDR begins with a zero, so zstd's first bytes tell them apart.
std::span<const uint8_t> PlainMessage(std::span<const uint8_t> bytes, std::vector<uint8_t>* buffer) {
  static constexpr uint8_t kZstd[] = {0x28, 0xB5, 0x2F, 0xFD};
  if (bytes.size() < 6 || std::memcmp(bytes.data(), kZstd, 4) != 0) return bytes;
  return Unpacked("zstd", bytes, ZstdSize(bytes), buffer);
}

}  // namespace

BagContents IndexOfSqlite(const std::filesystem::path& file) {
  const SqliteBag bag(file);
  BagContents contents;
  contents.format = "ROS 2 SQLite";
  std::map<int64_t, BagTopic> topics = TopicsOf(bag);
  Statement rows =
      bag.Query("SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id");
  bool first = true;
  while (rows.Step()) {
    topics[rows.ColumnInt(0)].messages = rows.ColumnInt(1);
    contents.begin_ns = first ? rows.ColumnInt(2) : std::min(contents.begin_ns, rows.ColumnInt(2));
    contents.end_ns = first ? rows.ColumnInt(3) : std::max(contents.end_ns, rows.ColumnInt(3));
    first = false;
  }
  for (auto& [id, topic] : topics) contents.topics.push_back(std::move(topic));
  return contents;
}

void ScanSqlite(const std::filesystem::path& file, BagSink* sink) {
  const SqliteBag bag(file);
  for (const auto& [id, topic] : TopicsOf(bag)) {
    sink->Topic(static_cast<uint64_t>(id), topic.name, topic.type, topic.encoding);
  }
  std::vector<uint8_t> buffer;
  // As recorded: without ORDER BY, which would sort on the disk.
  Statement rows = bag.Query("SELECT topic_id, timestamp, data FROM messages");
  while (rows.Step()) {
    const auto topic = static_cast<uint64_t>(rows.ColumnInt(0));
    if (!sink->Wants(topic)) continue;
    const auto* data = static_cast<const uint8_t*>(rows.ColumnBlob(2));
    const std::span<const uint8_t> bytes(data, data == nullptr ? 0 : rows.ColumnBytes(2));
    sink->Message(topic, rows.ColumnInt(1), PlainMessage(bytes, &buffer));
    sink->Advance(bytes.size());
  }
}

}  // namespace trigpoint
