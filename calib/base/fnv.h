// FNV-1a, 64 bits: tells contents apart, and is the same on every machine. Not against people who mean harm.
#pragma once

#include <cstddef>
#include <cstdint>

namespace trigpoint {

constexpr uint64_t kFnvBasis = 0xcbf29ce484222325U;

// Of `size` bytes; `hash`: of what comes before them.
inline uint64_t Fnv1a(const void* data, size_t size, uint64_t hash = kFnvBasis) {
  for (const auto* byte = static_cast<const unsigned char*>(data); size > 0; --size, ++byte)
    hash = (hash ^ *byte) * 0x100000001b3U;
  return hash;
}

}  // namespace trigpoint
