#include "datasets/import/fast_png.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <queue>
#include <span>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace trigpoint {
namespace {

constexpr int kSymbols = 257;  // bytes and the end of the block
constexpr int kEndOfBlock = 256;
constexpr int kLongest = 15;  // bits of a code

// Writes the bytes of a file into a buffer that is large enough.
class ByteWriter {
 public:
  explicit ByteWriter(uint8_t* at) : at_(at) {}
  uint8_t* at() const { return at_; }
  void SetEnd(uint8_t* at) { at_ = at; }
  void BigEndian(uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) *at_++ = static_cast<uint8_t>(value >> shift);
  }
  void Bytes(std::string_view bytes) { at_ = std::copy(bytes.begin(), bytes.end(), at_); }
  // A chunk: its size is written by EndChunk.
  void BeginChunk(std::string_view type) {
    at_ += 4;
    chunk_ = at_;
    Bytes(type);
  }
  void EndChunk() {
    const auto size = static_cast<uint32_t>(at_ - chunk_);  // with the type
    ByteWriter(chunk_ - 4).BigEndian(size - 4);
    BigEndian(static_cast<uint32_t>(crc32(crc32(0, nullptr, 0), chunk_, size)));
  }

 private:
  uint8_t* at_;
  uint8_t* chunk_ = nullptr;
};

// At least `size` bytes; a buffer that is larger is used as it is.
uint8_t* Room(size_t size, std::vector<uint8_t>* buffer) {
  if (buffer->size() < size) {
    buffer->clear();
    buffer->resize(size);
  }
  return buffer->data();
}

// Rows as PNG's filter "sub" has them: its number, then each byte less that of the pixel before.
template <size_t channels>
std::span<const uint8_t> FilteredRows(const cv::Mat& picture, std::vector<uint8_t>* rows, std::vector<uint8_t>* line) {
  const size_t row = static_cast<size_t>(picture.cols) * channels, size = (row + 1) * static_cast<size_t>(picture.rows);
  uint8_t* out = Room(size, rows);
  uint8_t* rgb = Room(row, line);
  for (int y = 0; y < picture.rows; ++y) {
    const uint8_t* pixels = picture.ptr(y);
    if constexpr (channels == 3) {
      for (size_t k = 0; k < row; k += 3) rgb[k] = pixels[k + 2], rgb[k + 1] = pixels[k + 1], rgb[k + 2] = pixels[k];
      pixels = rgb;
    }
    *out++ = 1;
    std::copy_n(pixels, channels, out);
    for (size_t k = channels; k < row; ++k) out[k] = static_cast<uint8_t>(pixels[k] - pixels[k - channels]);
    out += row;
  }
  return {rows->data(), size};
}

// Lengths of a Huffman code, 0 for symbols that do not occur. Counts are flattened until no code is too long.
std::array<int, kSymbols> CodeLengths(std::array<uint64_t, kSymbols> counts) {
  for (;; std::for_each(counts.begin(), counts.end(), [](uint64_t& c) { c = (c + 1) / 2; })) {
    struct Node {
      uint64_t count;
      int index, left, right;  // -1: a symbol
      bool operator<(const Node& other) const { return std::pair(count, index) > std::pair(other.count, other.index); }
    };
    std::vector<Node> nodes;
    std::priority_queue<Node> queue;
    std::vector<int> symbol;
    for (int s = 0; s < kSymbols; ++s) {
      if (counts[static_cast<size_t>(s)] == 0) continue;
      nodes.push_back({counts[static_cast<size_t>(s)], static_cast<int>(nodes.size()), -1, -1});
      symbol.push_back(s);
      queue.push(nodes.back());
    }
    while (queue.size() > 1) {
      const Node a = queue.top();
      queue.pop();
      const Node b = queue.top();
      queue.pop();
      nodes.push_back({a.count + b.count, static_cast<int>(nodes.size()), a.index, b.index});
      queue.push(nodes.back());
    }
    std::array<int, kSymbols> lengths{};
    std::vector<int> depth(nodes.size(), 0);
    int longest = 0;
    for (size_t n = nodes.size(); n-- > 0;) {
      if (nodes[n].left < 0) {
        lengths[static_cast<size_t>(symbol[n])] = std::max(1, depth[n]);
        longest = std::max(longest, depth[n]);
        continue;
      }
      for (int child : {nodes[n].left, nodes[n].right}) depth[static_cast<size_t>(child)] = depth[n] + 1;
    }
    if (longest <= kLongest) return lengths;
  }
}

// Bits, the lowest first. Eight bytes are written at a time: so many beyond the end must be there.
class BitWriter {
 public:
  explicit BitWriter(uint8_t* at) : at_(at) {}
  // Up to kMostHeld bits before the next Flush.
  static constexpr int kMostHeld = 56;
  void Hold(uint64_t bits, int count) {
    held_ |= bits << count_;
    count_ += count;
  }
  void Flush() {
    for (int k = 0; k < 8; ++k) at_[k] = static_cast<uint8_t>(held_ >> 8 * k);  // one store where bytes lie that way
    at_ += count_ >> 3;
    held_ >>= count_ & ~7;
    count_ &= 7;
  }
  void Put(uint64_t bits, int count) {
    Hold(bits, count);
    Flush();
  }
  uint8_t* End() { return at_ + (count_ > 0 ? 1 : 0); }

 private:
  uint8_t* at_;
  uint64_t held_ = 0;
  int count_ = 0;
};

// Canonical codes of lengths (RFC 1951, 3.2.2), the first bit lowest.
std::array<uint32_t, kSymbols> Codes(const std::array<int, kSymbols>& lengths) {
  std::array<uint32_t, kSymbols> codes{};
  uint32_t code = 0;
  for (int length = 1; length <= kLongest; ++length, code <<= 1) {
    for (size_t s = 0; s < kSymbols; ++s) {
      if (lengths[s] != length) continue;
      for (int bit = 0; bit < length; ++bit) codes[s] |= (code >> bit & 1) << (length - 1 - bit);
      ++code;
    }
  }
  return codes;
}

// A zlib stream's code for bytes.
struct ByteCode {
  std::array<int, kSymbols> lengths;
  std::array<uint32_t, kSymbols> codes;
  uint64_t bits = 0;  // of all bytes together and the end
};

ByteCode CodeOf(std::span<const uint8_t> bytes) {
  std::array<uint64_t, kSymbols> counts{};
  // Four tables: neighbours are often alike, and a count waits for the one before.
  std::array<std::array<uint32_t, 256>, 4> parts{};
  for (size_t i = 0; i < bytes.size(); ++i) ++parts[i & 3][bytes[i]];
  for (size_t b = 0; b < 256; ++b) counts[b] = uint64_t{parts[0][b]} + parts[1][b] + parts[2][b] + parts[3][b];
  counts[kEndOfBlock] = 1;
  ByteCode code{CodeLengths(counts), {}, 0};
  code.codes = Codes(code.lengths);
  for (size_t s = 0; s < kSymbols; ++s) code.bits += counts[s] * static_cast<uint64_t>(code.lengths[s]);
  return code;
}

// What comes before the codes of the bytes: 3 + 14 + 57 + 258 * 4 bits, behind two bytes of zlib.
constexpr size_t kBlockHead = 2 + (3 + 14 + 57 + 258 * 4) / 8 + 1;

uint8_t* Deflate(std::span<const uint8_t> bytes, const ByteCode& code, uint8_t* out) {
  *out++ = 0x78;
  *out++ = 0x01;
  BitWriter bits(out);
  bits.Put(1, 1), bits.Put(2, 2);                   // the last block, of a dynamic code
  bits.Put(0, 5), bits.Put(0, 5), bits.Put(15, 4);  // 257 lengths, one distance, 19 lengths of lengths
  // Lengths 0 to 15 are coded by four bits each; the codes for repetitions, the first three, are not used.
  for (int k = 0; k < 19; ++k) bits.Put(k < 3 ? 0 : 4, 3);
  const auto put_length = [&](int length) {
    uint32_t reversed = 0;
    for (int bit = 0; bit < 4; ++bit) reversed |= (static_cast<uint32_t>(length) >> bit & 1) << (3 - bit);
    bits.Put(reversed, 4);
  };
  for (const int length : code.lengths) put_length(length);
  put_length(0);  // no distance is used
  const auto hold = [&](size_t symbol) { bits.Hold(code.codes[symbol], code.lengths[symbol]); };
  constexpr size_t kAtOnce = 3;  // beside seven bits that are left
  static_assert(kAtOnce * kLongest + 7 <= BitWriter::kMostHeld);
  size_t k = 0;
  for (; k + kAtOnce <= bytes.size(); k += kAtOnce) {
    for (size_t i = 0; i < kAtOnce; ++i) hold(bytes[k + i]);
    bits.Flush();
  }
  for (; k < bytes.size(); ++k) hold(bytes[k]), bits.Flush();
  hold(kEndOfBlock);
  bits.Flush();
  return bits.End();
}

}  // namespace

std::string_view FastPngWriter::Write(const cv::Mat& picture) {
  const bool colour = picture.type() == CV_8UC3;
  if (!colour && picture.type() != CV_8UC1) throw std::logic_error("FastPngWriter: expected 8-bit grey or BGR");
  const std::span<const uint8_t> rows =
      colour ? FilteredRows<3>(picture, &rows_, &line_) : FilteredRows<1>(picture, &rows_, &line_);
  const ByteCode code = CodeOf(rows);
  constexpr size_t kChunks = 100;  // signature, header, sizes and sums, and what BitWriter writes beyond
  uint8_t* begin = Room(kChunks + kBlockHead + code.bits / 8, &file_);
  ByteWriter out(begin);
  out.Bytes("\x89PNG\r\n\x1a\n");
  out.BeginChunk("IHDR");
  out.BigEndian(static_cast<uint32_t>(picture.cols));
  out.BigEndian(static_cast<uint32_t>(picture.rows));
  out.Bytes({colour ? "\x08\x02\0\0\0" : "\x08\0\0\0\0", 5});
  out.EndChunk();
  out.BeginChunk("IDAT");
  out.SetEnd(Deflate(rows, code, out.at()));
  out.BigEndian(static_cast<uint32_t>(adler32(adler32(0, nullptr, 0), rows.data(), static_cast<uInt>(rows.size()))));
  out.EndChunk();
  out.BeginChunk("IEND");
  out.EndChunk();
  return {reinterpret_cast<const char*>(begin), static_cast<size_t>(out.at() - begin)};
}

}  // namespace trigpoint
