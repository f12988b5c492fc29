#include "datasets/bag/bag.h"

#include <bzlib.h>
#include <fcntl.h>
#include <lz4frame.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "calib/base/error.h"
#include "datasets/bag/bag_formats.h"
#include "datasets/io/readable.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

enum class Format { kNone, kRos1, kMcap, kSqlite };

Format FormatOf(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return Format::kNone;
  const BagFile file(path);
  std::vector<uint8_t> buffer;
  const std::span<const uint8_t> bytes = file.Read(0, std::min<uint64_t>(file.size(), 16), &buffer);
  const std::string_view begin(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (begin.starts_with("#ROSBAG V2.0")) return Format::kRos1;
  if (begin.starts_with("\x89MCAP0\r\n")) return Format::kMcap;
  if (begin.starts_with("SQLite format 3") && path.extension() == ".db3") return Format::kSqlite;
  if (begin.starts_with("#ROSBAG")) {
    throw InputError(path.string() + ": expected a bag of version 2.0, found '" +
                     Excerpt(begin.substr(0, begin.find('\n'))) + "'; convert it with `rosbag fix`");
  }
  return Format::kNone;
}

// The parts of a bag, in the order of their numbers.
std::vector<fs::path> FilesOf(const fs::path& path) {
  if (!fs::is_directory(path)) return {path};
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".mcap" || extension == ".db3") files.push_back(entry.path());
    if (extension == ".zstd") {
      throw InputError(entry.path().string() + ": the file as a whole is compressed; unpack it with `zstd -d`");
    }
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    const std::string x = a.string(), y = b.string();
    return std::pair(x.size(), x) < std::pair(y.size(), y);  // bag_9 before bag_10
  });
  return files;
}

void Add(const BagContents& part, BagContents* all) {
  if (!part.topics.empty()) {
    all->begin_ns = all->topics.empty() ? part.begin_ns : std::min(all->begin_ns, part.begin_ns);
    all->end_ns = all->topics.empty() ? part.end_ns : std::max(all->end_ns, part.end_ns);
  }
  all->format = part.format;
  all->warnings.insert(all->warnings.end(), part.warnings.begin(), part.warnings.end());
  for (const BagTopic& topic : part.topics) {
    const auto same = std::find_if(all->topics.begin(), all->topics.end(), [&](const BagTopic& other) {
      return other.name == topic.name && other.type == topic.type && other.encoding == topic.encoding;
    });
    if (same == all->topics.end()) {
      all->topics.push_back(topic);
    } else {
      same->messages += topic.messages;
    }
  }
}

// For a bag without an index: every message is counted.
BagContents CountByReading(const fs::path& path, Format format, const CancelToken& cancel) {
  BagContents contents;
  contents.format = format == Format::kRos1 ? "ROS 1 bag" : "MCAP";
  contents.begin_ns = std::numeric_limits<int64_t>::max();
  const auto all = [](const BagTopic&) { return true; };
  const auto count = [&](const BagTopic& topic, const BagMessage& message) {
    const auto same = std::find_if(contents.topics.begin(), contents.topics.end(),
                                   [&](const BagTopic& other) { return other.name == topic.name; });
    BagTopic& counted = same != contents.topics.end() ? *same : contents.topics.emplace_back(topic);
    ++counted.messages;
    contents.begin_ns = std::min(contents.begin_ns, message.logged_ns);
    contents.end_ns = std::max(contents.end_ns, message.logged_ns);
  };
  ProgressSink progress;
  contents.warnings = ReadBag(path, all, count, progress, cancel);
  return contents;
}

std::span<const uint8_t> UnpackedLz4(std::span<const uint8_t> packed, std::vector<uint8_t>* buffer) {
  LZ4F_dctx* raw = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION)) != 0) throw IoError("lz4: no memory");
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(raw,
                                                                                     &LZ4F_freeDecompressionContext);
  size_t from = 0, to = 0, hint = 1;
  while (hint != 0) {
    size_t taken = packed.size() - from, given = buffer->size() - to;
    hint = LZ4F_decompress(raw, buffer->data() + to, &given, packed.data() + from, &taken, nullptr);
    if (LZ4F_isError(hint) != 0) throw InputError(std::string("damaged lz4 data: ") + LZ4F_getErrorName(hint));
    from += taken;
    to += given;
    if (taken == 0 && given == 0 && hint != 0) throw InputError("lz4 data of another size than stated");
  }
  return {buffer->data(), to};
}

}  // namespace

BagFile::BagFile(const fs::path& path) : path_(path), fd_(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat status {};
  if (fd_ < 0 || fstat(fd_, &status) != 0) throw InputError(path.string() + ": cannot be read: " + strerror(errno));
  size_ = static_cast<uint64_t>(status.st_size);
}

BagFile::~BagFile() { close(fd_); }

std::span<const uint8_t> BagFile::Read(uint64_t at, uint64_t count, std::vector<uint8_t>* buffer) const {
  if (count > kMostChunkBytes || !Has(at, count)) {
    Fail(at, "expected " + std::to_string(count) + " bytes, found " + std::to_string(size_ - std::min(at, size_)) +
                 "; at most " + std::to_string(kMostChunkBytes) + " are read at once");
  }
  if (buffer->size() < count) buffer->resize(count);
  for (uint64_t done = 0; done < count;) {
    const ssize_t got = pread(fd_, buffer->data() + done, count - done, static_cast<off_t>(at + done));
    if (got <= 0) Fail(at + done, "cannot be read");
    done += static_cast<uint64_t>(got);
  }
  return {buffer->data(), count};
}

void BagFile::Fail(uint64_t at, const std::string& what) const {
  throw InputError(path_.string() + ": byte " + std::to_string(at) + ": " + what);
}

void BagSink::Topic(uint64_t number, std::string_view name, std::string_view type, BagEncoding encoding) {
  Entry entry{{std::string(name), PlainType(type), encoding, 0}};
  entry.wanted = is_wanted_(entry.topic);
  topics_[number] = std::move(entry);
}

bool BagSink::Wants(uint64_t number) const {
  const auto it = topics_.find(number);
  return it != topics_.end() && it->second.wanted;
}

void BagSink::Message(uint64_t number, int64_t logged_ns, std::span<const uint8_t> bytes) {
  if (!Wants(number)) return;
  cancel_.ThrowIfCancelled();
  use_(topics_.at(number).topic, {logged_ns, bytes});
}

void BagSink::Advance(uint64_t bytes) {
  cancel_.ThrowIfCancelled();
  progress_.Advance(static_cast<int64_t>(bytes));
}

std::span<const uint8_t> Unpacked(std::string_view kind, std::span<const uint8_t> packed, uint64_t size,
                                  std::vector<uint8_t>* buffer) {
  std::span<const uint8_t> bytes = packed;
  if (size > kMostChunkBytes) {
    throw InputError("expected a chunk of at most " + std::to_string(kMostChunkBytes) + " bytes, found " +
                     std::to_string(size));
  }
  const bool plain = kind.empty() || kind == "none";
  if (!plain) buffer->resize(size);
  if (kind == "lz4") {
    bytes = UnpackedLz4(packed, buffer);
  } else if (kind == "zstd") {
    const size_t got = ZSTD_decompress(buffer->data(), size, packed.data(), packed.size());
    if (ZSTD_isError(got) != 0) throw InputError(std::string("damaged zstd data: ") + ZSTD_getErrorName(got));
    bytes = {buffer->data(), got};
  } else if (kind == "bz2") {
    auto got = static_cast<unsigned>(size);
    // The library takes what it only reads as not const.
    char* from = const_cast<char*>(reinterpret_cast<const char*>(packed.data()));
    const int code = BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(buffer->data()), &got, from,
                                                static_cast<unsigned>(packed.size()), 0, 0);
    if (code != BZ_OK) throw InputError("damaged bz2 data (code " + std::to_string(code) + ")");
    bytes = {buffer->data(), got};
  } else if (!plain) {
    throw InputError("expected compression none, bz2, lz4 or zstd, found '" + Excerpt(kind) + "'");
  }
  if (bytes.size() != size) {
    throw InputError("expected " + std::to_string(size) + " bytes in a chunk, found " + std::to_string(bytes.size()));
  }
  return bytes;
}

uint64_t ZstdSize(std::span<const uint8_t> packed) {
  const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR) {
    throw InputError("damaged zstd data: its size is missing");
  }
  return size;
}

std::string PlainType(std::string_view type) {
  std::string text(type);
  if (const size_t at = text.find("/msg/"); at != std::string::npos) text.erase(at, 4);
  return text;
}

bool IsBag(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return FormatOf(path) != Format::kNone;
  const std::vector<fs::path> files = FilesOf(path);
  return !files.empty() && FormatOf(files.front()) != Format::kNone;
}

BagContents ListBag(const fs::path& path, const CancelToken& cancel) {
  BagContents all;
  for (const fs::path& name : FilesOf(path)) {
    const Format format = FormatOf(name);
    std::optional<BagContents> part;
    if (format == Format::kSqlite) {
      part = IndexOfSqlite(name);
    } else if (format != Format::kNone) {
      const BagFile file(name);
      part = format == Format::kRos1 ? IndexOfRos1(file) : IndexOfMcap(file);
      if (!part) part = CountByReading(name, format, cancel);
    } else {
      throw InputError(name.string() + ": expected a bag of ROS 1 (version 2.0), SQLite (.db3) or MCAP");
    }
    Add(*part, &all);
  }
  if (all.topics.empty()) throw InputError(path.string() + ": the bag holds no message");
  std::sort(all.topics.begin(), all.topics.end(), [](const BagTopic& a, const BagTopic& b) { return a.name < b.name; });
  return all;
}

std::vector<std::string> ReadBag(const fs::path& path, const std::function<bool(const BagTopic&)>& is_wanted,
                                 const std::function<void(const BagTopic&, const BagMessage&)>& use,
                                 ProgressSink& progress, const CancelToken& cancel) {
  std::vector<std::string> warnings;
  const std::vector<fs::path> files = FilesOf(path);
  uint64_t bytes = 0;
  for (const fs::path& file : files) bytes += fs::file_size(file);
  progress.Begin("bag", static_cast<int64_t>(bytes));
  for (const fs::path& name : files) {
    BagSink sink(is_wanted, use, progress, cancel);
    const Format format = FormatOf(name);
    if (format == Format::kSqlite) {
      ScanSqlite(name, &sink);
    } else if (format == Format::kRos1) {
      ScanRos1(BagFile(name), &sink);
    } else if (format == Format::kMcap) {
      ScanMcap(BagFile(name), &sink);
    } else {
      throw InputError(name.string() + ": expected a bag of ROS 1 (version 2.0), SQLite (.db3) or MCAP");
    }
    warnings.insert(warnings.end(), sink.warnings.begin(), sink.warnings.end());
  }
  return warnings;
}

}  // namespace trigpoint
