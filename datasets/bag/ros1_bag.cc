// Bags of ROS 1, version 2.0, after wiki.ros.org/Bags/Format/2.0: records of a header (fields name=value) and data.
#include "calib/base/error.h"
#include "datasets/bag/bag_formats.h"

namespace trigpoint {
namespace {

constexpr uint64_t kFirstRecord = 13;  // after "#ROSBAG V2.0\n"
enum Op : uint8_t { kMessage = 2, kBagHeader = 3, kChunk = 5, kChunkInfo = 6, kConnection = 7 };

struct Record {
  std::span<const uint8_t> header, data;
  // The value of a field; throws if it is missing.
  std::span<const uint8_t> Field(std::string_view name) const { return FieldIn(header, name); }
  static std::span<const uint8_t> FieldIn(std::span<const uint8_t> fields, std::string_view name) {
    ByteCursor cursor(fields);
    while (cursor.left() > 0) {
      const std::string_view field = cursor.Text();
      if (field.size() <= name.size() || field[name.size()] != '=' || !field.starts_with(name)) continue;
      return {reinterpret_cast<const uint8_t*>(field.data()) + name.size() + 1, field.size() - name.size() - 1};
    }
    throw InputError("expected a field '" + std::string(name) + "', found none");
  }
  template <typename T>
  T Number(std::string_view name) const {
    return ByteCursor(Field(name)).Number<T>();
  }
  std::string_view Text(std::string_view name) const {
    const std::span<const uint8_t> value = Field(name);
    return {reinterpret_cast<const char*>(value.data()), value.size()};
  }
  int64_t TimeNs(std::string_view name) const {
    ByteCursor value(Field(name));
    const int64_t seconds = value.Number<uint32_t>();
    return seconds * 1'000'000'000 + value.Number<uint32_t>();
  }
};

// Records of the file from `at` on, with the data of those that `needs_data` names. Ends at `use` returning false.
// Returns the byte of a record that is cut off, or nothing.
std::optional<uint64_t> ForEachRecord(const BagFile& file, uint64_t at, const std::function<bool(uint8_t)>& needs_data,
                                      const std::function<bool(const Record&, uint8_t, uint64_t)>& use) {
  std::vector<uint8_t> number, header, data;
  while (at < file.size()) {
    if (!file.Has(at, 4)) return at;
    const auto header_size = ByteCursor(file.Read(at, 4, &number)).Number<uint32_t>();
    if (!file.Has(at + 4, uint64_t{header_size} + 4)) return at;
    Record record;
    record.header = file.Read(at + 4, header_size, &header);
    const auto data_size = ByteCursor(file.Read(at + 4 + header_size, 4, &number)).Number<uint32_t>();
    const uint64_t data_at = at + 8 + header_size;
    if (!file.Has(data_at, data_size)) return at;
    try {
      const auto op = record.Number<uint8_t>("op");
      if (needs_data(op)) record.data = file.Read(data_at, data_size, &data);
      if (!use(record, op, data_at + data_size - at)) return std::nullopt;
    } catch (const InputError& e) {
      const std::string what = e.what();
      if (what.starts_with(file.path().string())) throw;
      file.Fail(at, what);
    }
    at = data_at + data_size;
  }
  return std::nullopt;
}

void TakeConnection(const Record& record, BagSink* sink) {
  const std::span<const uint8_t> type = Record::FieldIn(record.data, "type");
  sink->Topic(record.Number<uint32_t>("conn"), record.Text("topic"),
              {reinterpret_cast<const char*>(type.data()), type.size()}, BagEncoding::kRos1);
}

void TakeChunk(const Record& chunk, std::vector<uint8_t>* buffer, BagSink* sink) {
  ByteCursor records(Unpacked(chunk.Text("compression"), chunk.data, chunk.Number<uint32_t>("size"), buffer));
  while (records.left() > 0) {
    Record record;
    record.header = records.Block();
    record.data = records.Block();
    const auto op = record.Number<uint8_t>("op");
    if (op == kConnection) TakeConnection(record, sink);
    if (op == kMessage) sink->Message(record.Number<uint32_t>("conn"), record.TimeNs("time"), record.data);
  }
}

}  // namespace

std::optional<BagContents> IndexOfRos1(const BagFile& file) {
  uint64_t index = 0;
  ForEachRecord(
      file, kFirstRecord, [](uint8_t) { return false; },
      [&](const Record& record, uint8_t op, uint64_t) {
        if (op == kBagHeader) index = record.Number<uint64_t>("index_pos");
        return false;
      });
  if (index < kFirstRecord || index >= file.size()) return std::nullopt;
  BagContents contents;
  contents.format = "ROS 1 bag";
  std::map<uint32_t, BagTopic> topics;
  bool first = true;
  const auto take = [&](const Record& record, uint8_t op, uint64_t) {
    if (op == kConnection) {
      const std::span<const uint8_t> type = Record::FieldIn(record.data, "type");
      topics[record.Number<uint32_t>("conn")] = {std::string(record.Text("topic")),
                                                 PlainType({reinterpret_cast<const char*>(type.data()), type.size()}),
                                                 BagEncoding::kRos1, 0};
    } else if (op == kChunkInfo) {
      const int64_t begin = record.TimeNs("start_time"), end = record.TimeNs("end_time");
      contents.begin_ns = first ? begin : std::min(contents.begin_ns, begin);
      contents.end_ns = first ? end : std::max(contents.end_ns, end);
      first = false;
      ByteCursor counts(record.data);
      while (counts.left() > 0) {
        const auto connection = counts.Number<uint32_t>();
        topics[connection].messages += counts.Number<uint32_t>();
      }
    }
    return true;
  };
  if (ForEachRecord(
          file, index, [](uint8_t) { return true; }, take))
    return std::nullopt;  // cut off: read it through
  for (auto& [number, topic] : topics) contents.topics.push_back(std::move(topic));
  return contents;
}

void ScanRos1(const BagFile& file, BagSink* sink) {
  std::vector<uint8_t> buffer;
  const auto take = [&](const Record& record, uint8_t op, uint64_t size) {
    if (op == kChunk) TakeChunk(record, &buffer, sink);
    if (op == kConnection) TakeConnection(record, sink);
    sink->Advance(size);
    return true;
  };
  const auto cut = ForEachRecord(
      file, kFirstRecord, [](uint8_t op) { return op == kChunk || op == kConnection; }, take);
  if (cut) {
    sink->warnings.push_back(file.path().string() + ": the record at byte " + std::to_string(*cut) +
                             " is cut off; what lies before it is used");
  }
}

}  // namespace trigpoint
