// Values out of bytes that strangers wrote.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "calib/base/error.h"

namespace trigpoint {

// Reads forward, and never beyond the end: throws InputError there. Numbers are little-endian unless `swapped`. With
// `alignment` more than 1, a number of n bytes begins at a multiple of min(n, alignment) from the first byte.
class ByteCursor {
 public:
  explicit ByteCursor(std::span<const uint8_t> bytes, size_t alignment = 1, bool swapped = false)
      : bytes_(bytes), alignment_(alignment), swapped_(swapped) {}

  template <typename T>
  T Number() {
    static_assert(std::is_arithmetic_v<T>);
    const size_t step = std::min(sizeof(T), alignment_);
    Bytes((step - at_ % step) % step);
    uint8_t raw[sizeof(T)];
    std::memcpy(raw, Bytes(sizeof(T)).data(), sizeof(T));
    if (swapped_) std::reverse(raw, raw + sizeof(T));
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }
  std::span<const uint8_t> Bytes(uint64_t count) {
    if (count > left()) {
      throw InputError("expected " + std::to_string(count) + " more bytes, found " + std::to_string(left()));
    }
    at_ += count;
    return bytes_.subspan(at_ - count, count);
  }
  // A 32-bit length, and so many bytes.
  std::span<const uint8_t> Block() { return Bytes(Number<uint32_t>()); }
  std::string_view Text() {
    const std::span<const uint8_t> text = Block();
    return {reinterpret_cast<const char*>(text.data()), text.size()};
  }
  size_t left() const { return bytes_.size() - at_; }

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = 0, alignment_;
  bool swapped_;
};

}  // namespace trigpoint
