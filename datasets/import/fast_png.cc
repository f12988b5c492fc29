#include "datasets/import/fast_png.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <queue>
#include <stdexcept>
#include <vector>

namespace trigpoint {
namespace {

constexpr int kSymbols = 257;  // bytes and the end of the block
constexpr int kEndOfBlock = 256;
constexpr int kLongest = 15;  // bits of a code

void PutBigEndian(uint32_t value, std::string* out) {
  for (int shift = 24; shift >= 0; shift -= 8) out->push_back(static_cast<char>(value >> shift));
}

void PutChunk(const char* type, const std::string& data, std::string* out) {
  PutBigEndian(static_cast<uint32_t>(data.size()), out);
  const size_t begin = out->size();
  *out += type;
  *out += data;
  const auto* bytes = reinterpret_cast<const Bytef*>(out->data() + begin);
  PutBigEndian(static_cast<uint32_t>(crc32(crc32(0, nullptr, 0), bytes, static_cast<uInt>(data.size() + 4))), out);
}

// Rows as PNG's filter "sub" has them: its number, then each byte less that of the pixel before.
template <size_t channels>
std::vector<uint8_t> FilteredRows(const cv::Mat& picture) {
  const size_t row = static_cast<size_t>(picture.cols) * channels;
  std::vector<uint8_t> rows((row + 1) * static_cast<size_t>(picture.rows));
  std::vector<uint8_t> rgb(row);
  for (int y = 0; y < picture.rows; ++y) {
    const uint8_t* pixels = picture.ptr(y);
    if constexpr (channels == 3) {
      for (size_t k = 0; k < row; k += 3) rgb[k] = pixels[k + 2], rgb[k + 1] = pixels[k + 1], rgb[k + 2] = pixels[k];
      pixels = rgb.data();
    }
    uint8_t* out = &rows[static_cast<size_t>(y) * (row + 1)];
    *out++ = 1;
    std::copy_n(pixels, channels, out);
    for (size_t k = channels; k < row; ++k) out[k] = static_cast<uint8_t>(pixels[k] - pixels[k - channels]);
  }
  return rows;
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

// Bits, the lowest first.
class BitWriter {
 public:
  explicit BitWriter(std::string* out) : out_(out) {}
  void Put(uint32_t bits, int count) {
    held_ |= uint64_t{bits} << count_;
    count_ += count;
    if (count_ < 32) return;
    const char bytes[4] = {static_cast<char>(held_), static_cast<char>(held_ >> 8), static_cast<char>(held_ >> 16),
                           static_cast<char>(held_ >> 24)};
    out_->append(bytes, 4);
    held_ >>= 32;
    count_ -= 32;
  }
  void Finish() {
    for (; count_ > 0; count_ -= 8, held_ >>= 8) out_->push_back(static_cast<char>(held_));
  }

 private:
  std::string* out_;
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

std::string Deflated(const std::vector<uint8_t>& bytes) {
  std::array<uint64_t, kSymbols> counts{};
  // Four tables: neighbours are often alike, and a count waits for the one before.
  std::array<std::array<uint32_t, 256>, 4> parts{};
  for (size_t i = 0; i < bytes.size(); ++i) ++parts[i & 3][bytes[i]];
  for (size_t b = 0; b < 256; ++b) counts[b] = uint64_t{parts[0][b]} + parts[1][b] + parts[2][b] + parts[3][b];
  counts[kEndOfBlock] = 1;
  const std::array<int, kSymbols> lengths = CodeLengths(counts);
  const std::array<uint32_t, kSymbols> codes = Codes(lengths);
  std::string out("\x78\x01", 2);
  out.reserve(bytes.size());
  BitWriter bits(&out);
  bits.Put(1, 1), bits.Put(2, 2);                   // the last block, of a dynamic code
  bits.Put(0, 5), bits.Put(0, 5), bits.Put(15, 4);  // 257 lengths, one distance, 19 lengths of lengths
  // Lengths 0 to 15 are coded by four bits each; the codes for repetitions, the first three, are not used.
  for (int k = 0; k < 19; ++k) bits.Put(k < 3 ? 0 : 4, 3);
  const auto put_length = [&](int length) {
    uint32_t reversed = 0;
    for (int bit = 0; bit < 4; ++bit) reversed |= (static_cast<uint32_t>(length) >> bit & 1) << (3 - bit);
    bits.Put(reversed, 4);
  };
  for (const int length : lengths) put_length(length);
  put_length(0);  // no distance is used
  // Two at a time: no two codes are longer than 30 bits.
  size_t k = 0;
  for (; k + 1 < bytes.size(); k += 2) {
    const uint8_t a = bytes[k], b = bytes[k + 1];
    bits.Put(codes[a] | codes[b] << lengths[a], lengths[a] + lengths[b]);
  }
  if (k < bytes.size()) bits.Put(codes[bytes[k]], lengths[bytes[k]]);
  bits.Put(codes[kEndOfBlock], lengths[kEndOfBlock]);
  bits.Finish();
  PutBigEndian(static_cast<uint32_t>(adler32(adler32(0, nullptr, 0), bytes.data(), static_cast<uInt>(bytes.size()))),
               &out);
  return out;
}

}  // namespace

std::string FastPng(const cv::Mat& picture) {
  const bool colour = picture.type() == CV_8UC3;
  if (!colour && picture.type() != CV_8UC1) throw std::logic_error("FastPng: expected 8-bit grey or BGR");
  std::string out("\x89PNG\r\n\x1a\n", 8), header;
  PutBigEndian(static_cast<uint32_t>(picture.cols), &header);
  PutBigEndian(static_cast<uint32_t>(picture.rows), &header);
  header += {8, static_cast<char>(colour ? 2 : 0), 0, 0, 0};
  PutChunk("IHDR", header, &out);
  PutChunk("IDAT", Deflated(colour ? FilteredRows<3>(picture) : FilteredRows<1>(picture)), &out);
  PutChunk("IEND", "", &out);
  return out;
}

}  // namespace trigpoint
