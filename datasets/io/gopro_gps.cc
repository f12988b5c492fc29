// MP4 after ISO/IEC 14496-12: boxes of size, type and content, big-endian. GPMF after github.com/gopro/gpmf-parser's
// description: keys of four letters, a type, the size of an element, their number, the content padded to four bytes.
#include "datasets/io/gopro_gps.h"

#include <cmath>
#include <fstream>
#include <initializer_list>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/byte_cursor.h"

namespace trigpoint {
namespace {

using Bytes = std::span<const uint8_t>;

ByteCursor BigEndian(Bytes bytes) { return ByteCursor(bytes, 1, true); }

std::string_view Letters(Bytes bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

// Calls use(type, content) for the boxes in `content`.
template <typename Use>
void ForEachBox(Bytes content, const Use& use) {
  ByteCursor cursor = BigEndian(content);
  while (cursor.left() >= 8) {
    uint64_t size = cursor.Number<uint32_t>();
    const std::string_view type = Letters(cursor.Bytes(4));
    if (size == 1) {
      size = cursor.Number<uint64_t>() - 8;
    } else if (size == 0) {
      size = cursor.left() + 8;
    }
    if (size < 8) throw InputError("a box of " + std::to_string(size) + " bytes");
    use(type, cursor.Bytes(size - 8));
  }
}

// The box at a path of types below `content`; empty if there is none.
Bytes BoxAt(Bytes content, std::initializer_list<std::string_view> path) {
  for (std::string_view wanted : path) {
    Bytes found;
    ForEachBox(content, [&](std::string_view type, Bytes inner) {
      if (type == wanted && found.empty()) found = inner;
    });
    content = found;
  }
  return content;
}

// A file read in pieces of bounded size.
class Pieces {
 public:
  explicit Pieces(const std::filesystem::path& file)
      : in_(file, std::ios::binary), size_(std::filesystem::file_size(file)) {}
  std::vector<uint8_t> Read(uint64_t at, uint64_t count) {
    constexpr uint64_t kMost = 64u << 20;
    if (count > kMost || at > size_ || count > size_ - at)
      throw InputError("expected " + std::to_string(count) + " bytes at " + std::to_string(at));
    std::vector<uint8_t> bytes(count);
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(at));
    if (!in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count)))
      throw InputError("cannot be read");
    return bytes;
  }
  uint64_t size() const { return size_; }

 private:
  std::ifstream in_;
  uint64_t size_;
};

// The content of the top-level box moov; empty if the file has none.
std::vector<uint8_t> MovieBox(Pieces* file) {
  for (uint64_t at = 0; at + 16 <= file->size();) {
    const std::vector<uint8_t> head = file->Read(at, 16);
    ByteCursor cursor = BigEndian(head);
    uint64_t size = cursor.Number<uint32_t>(), header = 8;
    const std::string type(Letters(cursor.Bytes(4)));
    if (at == 0 && type != "ftyp") return {};
    if (size == 1) {
      size = cursor.Number<uint64_t>();
      header = 16;
    }
    if (size == 0) size = file->size() - at;
    if (size < header) return {};
    if (type == "moov") return file->Read(at + header, size - header);
    if (size > file->size() - at) return {};
    at += size;
  }
  return {};
}

struct Sample {
  uint64_t at = 0;
  uint32_t size = 0;
  double begin_s = 0, length_s = 0;
};

// Where the samples of a track are, from its tables.
std::vector<Sample> SamplesOf(Bytes track) {
  constexpr uint32_t kMost = 1'000'000;
  const auto table = [&](std::string_view name) {
    ByteCursor cursor = BigEndian(BoxAt(track, {"mdia", "minf", "stbl", name}));
    if (cursor.left() > 0) cursor.Bytes(4);  // version and flags
    return cursor;
  };
  ByteCursor sizes = table("stsz");
  const auto same = sizes.Number<uint32_t>(), count = sizes.Number<uint32_t>();
  if (count > kMost) throw InputError(std::to_string(count) + " samples of telemetry");
  std::vector<Sample> samples(count);
  for (Sample& sample : samples) sample.size = same != 0 ? same : sizes.Number<uint32_t>();
  ByteCursor header = BigEndian(BoxAt(track, {"mdia", "mdhd"}));
  const bool wide = header.Number<uint32_t>() >> 24 == 1;
  header.Bytes(wide ? 16 : 8);
  const double scale = std::max<uint32_t>(1, header.Number<uint32_t>());
  ByteCursor times = table("stts");
  double t = 0;
  size_t i = 0;
  for (auto left = times.Number<uint32_t>(); left > 0; --left) {
    const auto number = times.Number<uint32_t>();
    const double length = times.Number<uint32_t>() / scale;
    for (uint32_t k = 0; k < number && i < samples.size(); ++k, ++i, t += length) {
      samples[i].begin_s = t;
      samples[i].length_s = length;
    }
  }
  const bool far = !BoxAt(track, {"mdia", "minf", "stbl", "co64"}).empty();
  ByteCursor offsets = table(far ? "co64" : "stco"), chunks = table("stsc");
  const auto chunk_count = offsets.Number<uint32_t>();
  // First chunk, and samples in it and those behind.
  std::vector<std::pair<uint32_t, uint32_t>> runs;
  for (auto left = chunks.Number<uint32_t>(); left > 0; --left) {
    const auto first = chunks.Number<uint32_t>(), each = chunks.Number<uint32_t>();
    chunks.Number<uint32_t>();
    runs.emplace_back(first, each);
  }
  i = 0;
  size_t run = 0;
  for (uint32_t chunk = 1; chunk <= chunk_count && i < samples.size() && !runs.empty(); ++chunk) {
    while (run + 1 < runs.size() && chunk >= runs[run + 1].first) ++run;
    uint64_t at = far ? offsets.Number<uint64_t>() : offsets.Number<uint32_t>();
    for (uint32_t k = 0; k < runs[run].second && i < samples.size(); ++k, ++i) {
      samples[i].at = at;
      at += samples[i].size;
    }
  }
  samples.resize(i);
  return samples;
}

// Numbers of a GPMF value, by its letters of types; other types are left out.
double Number(char type, ByteCursor* cursor) {
  switch (type) {
    case 'l': return cursor->Number<int32_t>();
    case 'L': return cursor->Number<uint32_t>();
    case 's': return cursor->Number<int16_t>();
    case 'S': return cursor->Number<uint16_t>();
    default: throw InputError(std::string("a GPS value of type '") + type + "'");
  }
}

// What one stream says of its fixes; it is there before them.
struct GpsStream {
  std::vector<double> scale;
  std::string types;  // of GPS9's elements
  double fix = 3, dop = 0;
  bool above_sea = false;
};

class Telemetry {
 public:
  // Reads one payload, `depth` containers deep.
  void Read(Bytes bytes, const Sample& sample, int depth = 0) {
    constexpr int kDeepest = 8;
    GpsStream stream;
    ByteCursor cursor = BigEndian(bytes);
    while (depth < kDeepest && cursor.left() >= 8) {
      const std::string_view key = Letters(cursor.Bytes(4));
      const char type = static_cast<char>(cursor.Number<uint8_t>());
      const size_t size = cursor.Number<uint8_t>(), count = cursor.Number<uint16_t>();
      const Bytes value = cursor.Bytes(size * count);
      cursor.Bytes(std::min<size_t>(cursor.left(), (4 - size * count % 4) % 4));
      if (type == '\0' && (key == "DEVC" || key == "STRM")) {
        Read(value, sample, depth + 1);
      } else if (key == "GPS5" || key == "GPS9") {
        TakeFixes(key == "GPS9", value, size, stream, sample);
      } else if (!value.empty()) {
        Describe(key, type, value, size, &stream);
      }
    }
  }
  GpsTrack Finish(const std::filesystem::path& video) {
    if (skipped_ > 0)
      track_.warnings.push_back(video.string() + ": skipped " + Counted(skipped_, "GPS fix", "GPS fixes") +
                                " of the video without 3D or with a DOP above 5");
    return std::move(track_);
  }

 private:
  static void Describe(std::string_view key, char type, Bytes value, size_t size, GpsStream* stream) {
    ByteCursor cursor = BigEndian(value);
    if (key == "SCAL") {
      stream->scale.clear();
      const size_t each = type == 's' || type == 'S' ? 2 : 4;
      while (cursor.left() >= each) stream->scale.push_back(Number(type, &cursor));
    } else if (key == "TYPE") {
      stream->types = Letters(value);
    } else if (key == "GPSF" && size == 4) {
      stream->fix = Number(type, &cursor);
    } else if (key == "GPSP" && size == 2) {
      stream->dop = Number(type, &cursor) / 100;
    } else if (key == "GPSA") {
      stream->above_sea = Letters(value).starts_with("MSL");
    }
  }

  void TakeFixes(bool nine, Bytes value, size_t size, const GpsStream& stream, const Sample& sample) {
    const std::string types = nine ? (stream.types.empty() ? "lllllllSS" : stream.types) : "lllll";
    if (types.size() != (nine ? 9u : 5u) || stream.scale.size() < types.size() || size == 0)
      throw InputError("GPS without its scales");
    const size_t count = value.size() / size;
    for (size_t k = 0; k < count; ++k) {
      ByteCursor cursor = BigEndian(value.subspan(k * size, size));
      std::vector<double> v;
      for (size_t i = 0; i < types.size(); ++i)
        v.push_back(Number(types[i], &cursor) / (stream.scale[i] != 0 ? stream.scale[i] : 1));
      const double fix = nine ? v[8] : stream.fix, dop = nine ? v[7] : stream.dop;
      constexpr double kMostDop = 5;
      if (fix < 3 || dop > kMostDop || std::abs(v[0]) > 90 || std::abs(v[1]) > 180 || (v[0] == 0 && v[1] == 0)) {
        ++skipped_;
        continue;
      }
      GpsFix found;
      found.stamp_ns =
          std::llround(1e9 * (sample.begin_s + sample.length_s * static_cast<double>(k) / static_cast<double>(count)));
      found.position = {v[0], v[1], v[2]};
      if (stream.above_sea) CountFromSea(&found);
      if (track_.fixes.empty() || found.stamp_ns > track_.fixes.back().stamp_ns) track_.fixes.push_back(found);
    }
  }

  GpsTrack track_;
  int64_t skipped_ = 0;
};

}  // namespace

GpsTrack ReadGoProGps(const std::filesystem::path& video) {
  Telemetry telemetry;
  try {
    Pieces file(video);
    const std::vector<uint8_t> movie = MovieBox(&file);
    ForEachBox(movie, [&](std::string_view type, Bytes track) {
      if (type != "trak") return;
      const Bytes entries = BoxAt(track, {"mdia", "minf", "stbl", "stsd"});
      if (entries.size() < 16 || Letters(entries.subspan(12, 4)) != "gpmd") return;
      for (const Sample& sample : SamplesOf(track)) {
        const std::vector<uint8_t> payload = file.Read(sample.at, sample.size);
        telemetry.Read(payload, sample);
      }
    });
  } catch (const InputError& e) {
    throw InputError(video.string() + ": its telemetry is damaged: " + e.what());
  }
  return telemetry.Finish(video);
}

std::optional<int64_t> VideoCreationUtcNs(const std::filesystem::path& video) {
  try {
    Pieces file(video);
    const std::vector<uint8_t> movie = MovieBox(&file);
    ByteCursor header = BigEndian(BoxAt(movie, {"mvhd"}));
    const bool wide = header.Number<uint32_t>() >> 24 == 1;
    const uint64_t since_1904 = wide ? header.Number<uint64_t>() : header.Number<uint32_t>();
    constexpr uint64_t kUnix = 2'082'844'800, kYear2100 = 4'102'444'800;  // s: 1904 to 1970, 1970 to 2100
    if (since_1904 <= kUnix || since_1904 - kUnix > kYear2100) return std::nullopt;
    return static_cast<int64_t>(since_1904 - kUnix) * 1'000'000'000;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

bool IsSphericalVideo(const std::filesystem::path& video) {
  try {
    Pieces file(video);
    const std::vector<uint8_t> movie = MovieBox(&file);
    bool stated = false;
    ForEachBox(movie, [&](std::string_view type, Bytes track) {
      if (type != "trak") return;
      ForEachBox(track, [&](std::string_view inner, Bytes content) {
        const std::string_view xml = Letters(content);
        stated |= inner == "uuid" && xml.find("GSpherical:ProjectionType>equirectangular") != xml.npos;
      });
      const std::string_view samples = Letters(BoxAt(track, {"mdia", "minf", "stbl", "stsd"}));
      const size_t sphere = samples.find("sv3d");
      stated |= sphere != samples.npos && samples.find("equi", sphere) != samples.npos;
    });
    return stated;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace trigpoint
