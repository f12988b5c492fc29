// MCAP, after mcap.dev/spec: records of an opcode, a 64-bit length and their content.
#include "calib/base/error.h"
#include "datasets/bag/bag_formats.h"

namespace trigpoint {
namespace {

constexpr uint64_t kMagicBytes = 8;
enum Op : uint8_t { kFooter = 2, kSchema = 3, kChannel = 4, kMessage = 5, kChunk = 6, kStatistics = 0x0B };

// Schemas come before the channels that name them.
struct Schemas {
  std::map<uint16_t, std::string> types;
  void Take(ByteCursor content) {
    const auto id = content.Number<uint16_t>();
    types[id] = content.Text();
  }
};

struct Channel {
  uint16_t id = 0;
  BagTopic topic;
};

Channel ChannelOf(ByteCursor content, const Schemas& schemas) {
  Channel channel;
  channel.id = content.Number<uint16_t>();
  const auto schema = content.Number<uint16_t>();
  channel.topic.name = content.Text();
  const std::string_view encoding = content.Text();
  channel.topic.encoding = encoding == "cdr"    ? BagEncoding::kCdr
                           : encoding == "ros1" ? BagEncoding::kRos1
                                                : BagEncoding::kOther;
  const auto type = schemas.types.find(schema);
  channel.topic.type = type != schemas.types.end() ? PlainType(type->second) : std::string(encoding);
  return channel;
}

void TakeRecord(uint8_t op, std::span<const uint8_t> bytes, Schemas* schemas, BagSink* sink) {
  ByteCursor content(bytes);
  if (op == kSchema) {
    schemas->Take(content);
  } else if (op == kChannel) {
    const Channel channel = ChannelOf(content, *schemas);
    sink->Topic(channel.id, channel.topic.name, channel.topic.type, channel.topic.encoding);
  } else if (op == kMessage) {
    const auto id = content.Number<uint16_t>();
    content.Number<uint32_t>();  // its number
    const auto logged = content.Number<uint64_t>();
    content.Number<uint64_t>();  // when it was published
    sink->Message(id, static_cast<int64_t>(logged), content.Bytes(content.left()));
  }
}

void TakeChunk(std::span<const uint8_t> bytes, std::vector<uint8_t>* buffer, Schemas* schemas, BagSink* sink) {
  ByteCursor chunk(bytes);
  chunk.Bytes(16);  // first and last time
  const auto size = chunk.Number<uint64_t>();
  chunk.Number<uint32_t>();  // CRC
  const std::string_view compression = chunk.Text();
  const auto packed = chunk.Bytes(chunk.Number<uint64_t>());
  ByteCursor records(Unpacked(compression, packed, size, buffer));
  while (records.left() > 0) {
    const auto op = records.Number<uint8_t>();
    TakeRecord(op, records.Bytes(records.Number<uint64_t>()), schemas, sink);
  }
}

bool HasContent(uint8_t op) { return op >= kFooter && op <= kChunk; }

// Records from `at` to the footer. Returns the byte of one that is cut off, or nothing.
std::optional<uint64_t> ForEachRecord(const BagFile& file, uint64_t at,
                                      const std::function<void(uint8_t, std::span<const uint8_t>, uint64_t)>& use) {
  std::vector<uint8_t> head, content;
  while (true) {
    if (!file.Has(at, 9)) return at;
    ByteCursor cursor(file.Read(at, 9, &head));
    const auto op = cursor.Number<uint8_t>();
    const auto size = cursor.Number<uint64_t>();
    if (!file.Has(at + 9, size)) return at;
    if (op == kFooter) return std::nullopt;
    try {
      const bool read = HasContent(op) || op == kStatistics;
      use(op, read ? file.Read(at + 9, size, &content) : std::span<const uint8_t>(), 9 + size);
    } catch (const InputError& e) {
      const std::string what = e.what();
      if (what.starts_with(file.path().string())) throw;
      file.Fail(at, what);
    }
    at += 9 + size;
  }
}

}  // namespace

std::optional<BagContents> IndexOfMcap(const BagFile& file) {
  constexpr uint64_t kFooterBytes = 9 + 20;
  if (file.size() < kFooterBytes + 2 * kMagicBytes) return std::nullopt;
  std::vector<uint8_t> buffer;
  ByteCursor footer(file.Read(file.size() - kMagicBytes - kFooterBytes, kFooterBytes, &buffer));
  if (footer.Number<uint8_t>() != kFooter || footer.Number<uint64_t>() != 20) return std::nullopt;
  const auto summary = footer.Number<uint64_t>();
  if (summary < kMagicBytes || summary >= file.size()) return std::nullopt;
  BagContents contents;
  contents.format = "MCAP";
  Schemas schemas;
  std::map<uint16_t, BagTopic> topics;
  bool counted = false;
  ForEachRecord(file, summary, [&](uint8_t op, std::span<const uint8_t> bytes, uint64_t) {
    ByteCursor content(bytes);
    if (op == kSchema) schemas.Take(content);
    if (op == kChannel) {
      Channel channel = ChannelOf(content, schemas);
      topics[channel.id] = std::move(channel.topic);
    }
    if (op != kStatistics) return;
    counted = true;
    content.Bytes(8 + 2 + 4 * 4);  // numbers of messages, schemas, channels, attachments, metadata and chunks
    contents.begin_ns = static_cast<int64_t>(content.Number<uint64_t>());
    contents.end_ns = static_cast<int64_t>(content.Number<uint64_t>());
    ByteCursor counts(content.Block());
    while (counts.left() > 0) {
      const auto id = counts.Number<uint16_t>();
      const auto messages = counts.Number<uint64_t>();
      if (messages > file.size()) {
        throw InputError("states " + std::to_string(messages) + " messages, more than the file has bytes");
      }
      topics[id].messages = static_cast<int64_t>(messages);
    }
  });
  if (!counted || topics.empty()) return std::nullopt;
  for (auto& [id, topic] : topics) contents.topics.push_back(std::move(topic));
  return contents;
}

void ScanMcap(const BagFile& file, BagSink* sink) {
  std::vector<uint8_t> buffer;
  Schemas schemas;
  const auto cut = ForEachRecord(file, kMagicBytes, [&](uint8_t op, std::span<const uint8_t> bytes, uint64_t size) {
    if (op == kChunk) {
      TakeChunk(bytes, &buffer, &schemas, sink);
    } else {
      TakeRecord(op, bytes, &schemas, sink);
    }
    sink->Advance(size);
  });
  if (cut) {
    sink->warnings.push_back(file.path().string() + ": the record at byte " + std::to_string(*cut) +
                             " is cut off; what lies before it is used");
  }
}

}  // namespace trigpoint
