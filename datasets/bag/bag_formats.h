// What the readers of the three formats share.
#pragma once

#include <map>
#include <memory>

#include "datasets/bag/bag.h"
#include "datasets/io/byte_cursor.h"

namespace trigpoint {

// No chunk or message with more is believed.
constexpr uint64_t kMostChunkBytes = 128u << 20;

// A file read at any place.
class BagFile {
 public:
  explicit BagFile(const std::filesystem::path& path);
  ~BagFile();
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;
  uint64_t size() const { return size_; }
  const std::filesystem::path& path() const { return path_; }
  bool Has(uint64_t at, uint64_t count) const { return at <= size_ && count <= size_ - at; }
  // Throws InputError beyond the end and for more than kMostChunkBytes.
  std::span<const uint8_t> Read(uint64_t at, uint64_t count, std::vector<uint8_t>* buffer) const;
  [[noreturn]] void Fail(uint64_t at, const std::string& what) const;

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  uint64_t size_ = 0;
};

// One reading: the topics by the number they have in the file, and who wants them.
class BagSink {
 public:
  BagSink(const std::function<bool(const BagTopic&)>& is_wanted,
          const std::function<void(const BagTopic&, const BagMessage&)>& use, ProgressSink& progress,
          const CancelToken& cancel)
      : is_wanted_(is_wanted), use_(use), progress_(progress), cancel_(cancel) {}
  void Topic(uint64_t number, std::string_view name, std::string_view type, BagEncoding encoding);
  // Is the number that of a wanted topic?
  bool Wants(uint64_t number) const;
  void Message(uint64_t number, int64_t logged_ns, std::span<const uint8_t> bytes);
  void Advance(uint64_t bytes);
  std::vector<std::string> warnings;

 private:
  struct Entry {
    BagTopic topic;
    bool wanted = false;
  };
  const std::function<bool(const BagTopic&)>& is_wanted_;
  const std::function<void(const BagTopic&, const BagMessage&)>& use_;
  ProgressSink& progress_;
  const CancelToken& cancel_;
  std::map<uint64_t, Entry> topics_;
};

// `packed` as `size` bytes; kind: "none" or "", "lz4" (frames), "zstd", "bz2". Throws InputError for another kind,
// other sizes, more than kMostChunkBytes, and damage.
std::span<const uint8_t> Unpacked(std::string_view kind, std::span<const uint8_t> packed, uint64_t size,
                                  std::vector<uint8_t>* buffer);

// What a frame of zstd says it unpacks to; throws InputError if it doesn't.
uint64_t ZstdSize(std::span<const uint8_t> packed);

// Contents from the file's index; nothing if it has none.
std::optional<BagContents> IndexOfRos1(const BagFile& file);
std::optional<BagContents> IndexOfMcap(const BagFile& file);
BagContents IndexOfSqlite(const std::filesystem::path& file);
void ScanRos1(const BagFile& file, BagSink* sink);
void ScanMcap(const BagFile& file, BagSink* sink);
void ScanSqlite(const std::filesystem::path& file, BagSink* sink);

// Without ROS 2's "/msg".
std::string PlainType(std::string_view type);

}  // namespace trigpoint
