#include "tests/datasets/bag_writer.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zstd.h>

#include <fstream>
#include <map>
#include <stdexcept>

namespace trigpoint {
namespace {

constexpr size_t kChunkBytes = 768 << 10;

std::string Packed(const std::string& kind, const std::string& plain) {
  if (kind.empty() || kind == "none") return plain;
  std::string packed(
      LZ4F_compressFrameBound(plain.size(), nullptr) + ZSTD_compressBound(plain.size()) + plain.size() / 50 + 1000,
      '\0');
  if (kind == "lz4") {
    packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), plain.data(), plain.size(), nullptr));
  } else if (kind == "zstd") {
    packed.resize(ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), 1));
  } else {
    auto size = static_cast<unsigned>(packed.size());
    BZ2_bzBuffToBuffCompress(packed.data(), &size, const_cast<char*>(plain.data()), static_cast<unsigned>(plain.size()),
                             9, 0, 0);
    packed.resize(size);
  }
  return packed;
}

// Little-endian pieces put together.
class Pieces {
 public:
  template <typename T>
  Pieces& Put(T value) {
    text_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  Pieces& Raw(const std::string& bytes) {
    text_ += bytes;
    return *this;
  }
  Pieces& Block(const std::string& bytes) { return Put(static_cast<uint32_t>(bytes.size())).Raw(bytes); }
  template <typename T>
  Pieces& Field(const std::string& name, T value) {
    return Block(name + "=" + Pieces().Put(value).text());
  }
  Pieces& Field(const std::string& name, const std::string& value) { return Block(name + "=" + value); }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

uint64_t RosTime(int64_t ns) {
  return static_cast<uint64_t>(ns / 1'000'000'000) | (static_cast<uint64_t>(ns % 1'000'000'000) << 32);
}

class Ros1Writer final : public BagWriter {
 public:
  Ros1Writer(const std::filesystem::path& file, std::string compression)
      : BagWriter(BagEncoding::kRos1), compression_(std::move(compression)), out_(file, std::ios::binary) {
    out_ << "#ROSBAG V2.0\n";
    WriteBagHeader(0);
  }
  void Add(const std::string& topic, const std::string& type, int64_t logged_ns, const std::string& bytes) override {
    const auto [it, fresh] = connections_.emplace(topic, static_cast<uint32_t>(connections_.size()));
    if (fresh) {
      const std::string record =
          Record(Pieces().Field("op", uint8_t{7}).Field("conn", it->second).Field("topic", topic).text(),
                 Pieces()
                     .Field("topic", topic)
                     .Field("type", type)
                     .Field("md5sum", std::string(32, '0'))
                     .Field("message_definition", std::string("none"))
                     .text());
      chunk_ += record;
      records_ += record;
    }
    if (chunk_counts_.empty()) begin_ns_ = logged_ns;
    end_ns_ = logged_ns;
    ++chunk_counts_[it->second];
    chunk_ += Record(
        Pieces().Field("op", uint8_t{2}).Field("conn", it->second).Field("time", RosTime(logged_ns)).text(), bytes);
    if (chunk_.size() >= kChunkBytes) Flush();
  }
  void Close() override {
    Flush();
    const auto index = static_cast<uint64_t>(out_.tellp());
    out_ << records_ << infos_;
    out_.seekp(13);
    WriteBagHeader(index);
    out_.close();
  }

 private:
  static std::string Record(const std::string& header, const std::string& data) {
    return Pieces().Block(header).Block(data).text();
  }
  void WriteBagHeader(uint64_t index) {
    const std::string header = Pieces()
                                   .Field("op", uint8_t{3})
                                   .Field("index_pos", index)
                                   .Field("conn_count", static_cast<uint32_t>(connections_.size()))
                                   .Field("chunk_count", chunks_)
                                   .text();
    out_ << Record(header, std::string(4096 - header.size() - 8, ' '));
  }
  void Flush() {
    if (chunk_counts_.empty()) return;
    const auto at = static_cast<uint64_t>(out_.tellp());
    out_ << Record(Pieces()
                       .Field("op", uint8_t{5})
                       .Field("compression", compression_)
                       .Field("size", static_cast<uint32_t>(chunk_.size()))
                       .text(),
                   Packed(compression_, chunk_));
    Pieces counts;
    for (const auto& [connection, count] : chunk_counts_) {
      counts.Put(connection).Put(count);
      // Index data, without its entries.
      out_ << Record(Pieces()
                         .Field("op", uint8_t{4})
                         .Field("ver", uint32_t{1})
                         .Field("conn", connection)
                         .Field("count", uint32_t{0})
                         .text(),
                     "");
    }
    infos_ += Record(Pieces()
                         .Field("op", uint8_t{6})
                         .Field("ver", uint32_t{1})
                         .Field("chunk_pos", at)
                         .Field("start_time", RosTime(begin_ns_))
                         .Field("end_time", RosTime(end_ns_))
                         .Field("count", static_cast<uint32_t>(chunk_counts_.size()))
                         .text(),
                     counts.text());
    ++chunks_;
    chunk_.clear();
    chunk_counts_.clear();
  }

  std::string compression_, chunk_, records_, infos_;
  std::ofstream out_;
  std::map<std::string, uint32_t> connections_;
  std::map<uint32_t, uint32_t> chunk_counts_;
  uint32_t chunks_ = 0;
  int64_t begin_ns_ = 0, end_ns_ = 0;
};

std::string Ros2Type(const std::string& type) {
  std::string text = type;
  return text.insert(text.find('/'), "/msg");
}

class McapWriter final : public BagWriter {
 public:
  McapWriter(const std::filesystem::path& file, std::string compression, BagEncoding encoding)
      : BagWriter(encoding), compression_(std::move(compression)), out_(file, std::ios::binary) {
    out_ << kMagic << Record(1, Pieces().Block(encoding == BagEncoding::kCdr ? "ros2" : "ros1").Block("test").text());
  }
  void Add(const std::string& topic, const std::string& type, int64_t logged_ns, const std::string& bytes) override {
    const auto [it, fresh] = channels_.emplace(topic, static_cast<uint16_t>(channels_.size() + 1));
    if (fresh) {
      const bool cdr = encoding_ == BagEncoding::kCdr;
      const std::string records =
          Record(3, Pieces()
                        .Put(it->second)
                        .Block(cdr ? Ros2Type(type) : type)
                        .Block(cdr ? "ros2msg" : "ros1msg")
                        .Block("none")
                        .text()) +
          Record(4, Pieces().Put(it->second).Put(it->second).Block(topic).Block(cdr ? "cdr" : "ros1").Block("").text());
      chunk_ += records;
      summary_ += records;
    }
    if (counts_.empty()) begin_ns_ = logged_ns;
    end_ns_ = logged_ns;
    ++counts_[it->second];
    chunk_ += Record(5, Pieces().Put(it->second).Put(uint32_t{0}).Put(logged_ns).Put(logged_ns).Raw(bytes).text());
    if (chunk_.size() >= kChunkBytes) Flush();
  }
  void Close() override {
    Flush();
    out_ << Record(0x0F, Pieces().Put(uint32_t{0}).text());
    const auto summary = static_cast<uint64_t>(out_.tellp());
    Pieces counts;
    uint64_t all = 0;
    for (const auto& [channel, count] : counts_) {
      counts.Put(channel).Put(count);
      all += count;
    }
    const auto topics = static_cast<uint32_t>(channels_.size());
    out_ << summary_
         << Record(0x0B, Pieces()
                             .Put(all)
                             .Put(static_cast<uint16_t>(topics))
                             .Put(topics)
                             .Put(uint32_t{0})
                             .Put(uint32_t{0})
                             .Put(chunks_)
                             .Put(begin_ns_)
                             .Put(end_ns_)
                             .Block(counts.text())
                             .text());
    out_ << Record(2, Pieces().Put(summary).Put(uint64_t{0}).Put(uint32_t{0}).text()) << kMagic;
    out_.close();
  }

 private:
  static constexpr const char* kMagic = "\x89MCAP0\r\n";
  static std::string Record(uint8_t op, const std::string& content) {
    return Pieces().Put(op).Put(uint64_t{content.size()}).Raw(content).text();
  }
  void Flush() {
    if (chunk_.empty()) return;
    const std::string packed = Packed(compression_, chunk_);
    out_ << Record(6, Pieces()
                          .Put(begin_ns_)
                          .Put(end_ns_)
                          .Put(uint64_t{chunk_.size()})
                          .Put(uint32_t{0})
                          .Block(compression_)
                          .Put(uint64_t{packed.size()})
                          .Raw(packed)
                          .text());
    ++chunks_;
    chunk_.clear();
  }

  std::string compression_, chunk_, summary_;
  std::ofstream out_;
  std::map<std::string, uint16_t> channels_;
  std::map<uint16_t, uint64_t> counts_;
  uint32_t chunks_ = 0;
  int64_t begin_ns_ = 0, end_ns_ = 0;
};

class SqliteWriter final : public BagWriter {
 public:
  SqliteWriter(const std::filesystem::path& file, bool compressed)
      : BagWriter(BagEncoding::kCdr), compressed_(compressed) {
    if (sqlite3_open(file.c_str(), &db_) != SQLITE_OK) throw std::runtime_error("cannot open " + file.string());
    Run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
        "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data "
        "BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC); BEGIN;");
  }
  ~SqliteWriter() override { sqlite3_close(db_); }
  void Add(const std::string& topic, const std::string& type, int64_t logged_ns, const std::string& bytes) override {
    const auto [it, fresh] = topics_.emplace(topic, static_cast<int>(topics_.size() + 1));
    if (fresh)
      Run("INSERT INTO topics VALUES(" + std::to_string(it->second) + ", '" + topic + "', '" + Ros2Type(type) +
          "', 'cdr', '')");
    const std::string data = compressed_ ? Packed("zstd", bytes) : bytes;
    sqlite3_stmt* row = nullptr;
    sqlite3_prepare_v2(db_, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &row, nullptr);
    sqlite3_bind_int(row, 1, it->second);
    sqlite3_bind_int64(row, 2, logged_ns);
    sqlite3_bind_blob64(row, 3, data.data(), data.size(), SQLITE_STATIC);
    sqlite3_step(row);
    sqlite3_finalize(row);
  }
  void Close() override { Run("COMMIT"); }

 private:
  void Run(const std::string& sql) {
    if (sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
      throw std::runtime_error(sqlite3_errmsg(db_));
  }
  bool compressed_;
  sqlite3* db_ = nullptr;
  std::map<std::string, int> topics_;
};

}  // namespace

std::unique_ptr<BagWriter> WriteRos1Bag(const std::filesystem::path& file, const std::string& compression) {
  return std::make_unique<Ros1Writer>(file, compression);
}

std::unique_ptr<BagWriter> WriteMcap(const std::filesystem::path& file, const std::string& compression,
                                     BagEncoding encoding) {
  return std::make_unique<McapWriter>(file, compression, encoding);
}

std::unique_ptr<BagWriter> WriteSqliteBag(const std::filesystem::path& file, bool compressed) {
  return std::make_unique<SqliteWriter>(file, compressed);
}

}  // namespace trigpoint
