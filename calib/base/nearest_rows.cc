#include "calib/base/nearest_rows.h"

#include <algorithm>
#include <cstring>

#include "calib/base/wide.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#endif

namespace trigpoint {
namespace {

constexpr int kTile = 16;     // rows of a that are compared at once
constexpr int kTogether = 4;  // with so many rows of b: what is loaded of a serves them all
constexpr int kPairs = kDescriptorDim / 2;

// The numbers of up to kTile rows, two dimensions of all rows together: the products of a row of b with all of them
// are sums of neighbours, with nothing to add up across a register at the end.
struct Tile {
  alignas(64) int16_t values[kPairs * kTile * 2];
  void Fill(const int16_t* rows, int count) {
    std::memset(values, 0, sizeof values);
    for (int r = 0; r < count; ++r) {
      for (int p = 0; p < kPairs; ++p) std::memcpy(values + 2 * (p * kTile + r), rows + r * kDescriptorDim + 2 * p, 4);
    }
  }
};

// Products of kTogether rows of b with the tile's: out[k * kTile + r].
using Products = void (*)(const Tile& tile, const int16_t* b, int* out);

void PlainProducts(const Tile& tile, const int16_t* b, int* out) {
  std::fill(out, out + kTogether * kTile, 0);
  for (int k = 0; k < kTogether; ++k) {
    const int16_t* row = b + k * kDescriptorDim;
    int* sums = out + k * kTile;
    for (int p = 0; p < kPairs; ++p) {
      const int16_t* values = tile.values + 2 * p * kTile;
      for (int r = 0; r < kTile; ++r) sums[r] += values[2 * r] * row[2 * p] + values[2 * r + 1] * row[2 * p + 1];
    }
  }
}

#if defined(__x86_64__) && defined(__GNUC__)
int TwoOf(const int16_t* values) {
  int two = 0;
  std::memcpy(&two, values, 4);
  return two;
}

__attribute__((target("avx2"))) void Products256(const Tile& tile, const int16_t* b, int* out) {
  __m256i low[kTogether], high[kTogether];
  for (int k = 0; k < kTogether; ++k) low[k] = high[k] = _mm256_setzero_si256();
  for (int p = 0; p < kPairs; ++p) {
    const __m256i* values = reinterpret_cast<const __m256i*>(tile.values + 2 * p * kTile);
    const __m256i first = _mm256_load_si256(values), second = _mm256_load_si256(values + 1);
    for (int k = 0; k < kTogether; ++k) {
      const __m256i row = _mm256_set1_epi32(TwoOf(b + k * kDescriptorDim + 2 * p));
      low[k] = _mm256_add_epi32(low[k], _mm256_madd_epi16(first, row));
      high[k] = _mm256_add_epi32(high[k], _mm256_madd_epi16(second, row));
    }
  }
  for (int k = 0; k < kTogether; ++k) {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + k * kTile), low[k]);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + k * kTile + kTile / 2), high[k]);
  }
}

__attribute__((target("avx512f,avx512bw"))) void Products512(const Tile& tile, const int16_t* b, int* out) {
  __m512i sums[kTogether];
  for (int k = 0; k < kTogether; ++k) sums[k] = _mm512_setzero_si512();
  for (int p = 0; p < kPairs; ++p) {
    const __m512i values = _mm512_load_si512(tile.values + 2 * p * kTile);
    for (int k = 0; k < kTogether; ++k) {
      const __m512i row = _mm512_set1_epi32(TwoOf(b + k * kDescriptorDim + 2 * p));
      sums[k] = _mm512_add_epi32(sums[k], _mm512_madd_epi16(values, row));
    }
  }
  for (int k = 0; k < kTogether; ++k) _mm512_storeu_si512(out + k * kTile, sums[k]);
}

__attribute__((target("avx512f,avx512bw,avx512vnni"))) void Products512Vnni(const Tile& tile, const int16_t* b,
                                                                            int* out) {
  __m512i sums[kTogether];
  for (int k = 0; k < kTogether; ++k) sums[k] = _mm512_setzero_si512();
  for (int p = 0; p < kPairs; ++p) {
    const __m512i values = _mm512_load_si512(tile.values + 2 * p * kTile);
    for (int k = 0; k < kTogether; ++k) {
      sums[k] = _mm512_dpwssd_epi32(sums[k], values, _mm512_set1_epi32(TwoOf(b + k * kDescriptorDim + 2 * p)));
    }
  }
  for (int k = 0; k < kTogether; ++k) _mm512_storeu_si512(out + k * kTile, sums[k]);
}
#endif

Products BestProducts() {
#if defined(__x86_64__) && defined(__GNUC__)
  if (__builtin_cpu_supports("avx512bw") != 0) {
    return __builtin_cpu_supports("avx512vnni") != 0 ? Products512Vnni : Products512;
  }
  if (__builtin_cpu_supports("avx2") != 0) return Products256;
#endif
  return PlainProducts;
}

// What the tile's rows have found so far, one number a lane.
struct TileNearest {
  int best[kTile], second[kTile], index[kTile];
};

// Some rows of b, the first of them number j, against the tile's `count` from number `begin` on.
TRIGPOINT_WIDE
void Offer(const int* dots, const int* norms_a, int begin, int count, const int* norms_b, int j, int rows,
           TileNearest* tile, NearestTwo* of_b) {
  constexpr int kFar = std::numeric_limits<int>::max();
  for (int k = 0; k < rows; ++k, ++j) {
    int distance[kTile];
    for (int r = 0; r < kTile; ++r) distance[r] = norms_a[r] + norms_b[k] - 2 * dots[k * kTile + r];
    for (int r = count; r < kTile; ++r) distance[r] = kFar;
    int least = kFar;
    for (int r = 0; r < kTile; ++r) {
      const int d = distance[r];
      tile->second[r] = std::min(tile->second[r], std::max(tile->best[r], d));
      tile->index[r] = d < tile->best[r] ? j : tile->index[r];
      tile->best[r] = std::min(tile->best[r], d);
      least = std::min(least, d);
    }
    if (least >= of_b[k].second) continue;
    for (int r = 0; r < count; ++r) of_b[k].Offer(distance[r], begin + r);
  }
}

}  // namespace

void FindNearestBothWays(const DescriptorRows& a, const DescriptorRows& b, std::vector<NearestTwo>* of_a,
                         std::vector<NearestTwo>* of_b) {
  static const Products products = BestProducts();
  constexpr int kFar = std::numeric_limits<int>::max();
  of_a->assign(static_cast<size_t>(a.size), {});
  of_b->assign(static_cast<size_t>(b.size), {});
  Tile tile;
  for (int begin = 0; begin < a.size; begin += kTile) {
    const int count = std::min(kTile, a.size - begin);
    tile.Fill(a.values + static_cast<std::ptrdiff_t>(begin) * kDescriptorDim, count);
    int norms_a[kTile] = {};
    std::copy(a.squared_norms + begin, a.squared_norms + begin + count, norms_a);
    TileNearest nearest;
    std::fill(nearest.best, nearest.best + kTile, kFar);
    std::fill(nearest.second, nearest.second + kTile, kFar);
    std::fill(nearest.index, nearest.index + kTile, -1);
    for (int first = 0; first < b.size; first += kTogether) {
      const int rows = std::min(kTogether, b.size - first);
      const int16_t* from = b.values + static_cast<std::ptrdiff_t>(first) * kDescriptorDim;
      int16_t rest[kTogether * kDescriptorDim];
      if (rows < kTogether) {  // the last ones; what follows them isn't ours
        std::fill(rest, rest + kTogether * kDescriptorDim, int16_t{0});
        std::copy(from, from + rows * kDescriptorDim, rest);
        from = rest;
      }
      int dots[kTogether * kTile];
      products(tile, from, dots);
      Offer(dots, norms_a, begin, count, b.squared_norms + first, first, rows, &nearest, of_b->data() + first);
    }
    NearestTwo* found = of_a->data() + begin;
    for (int r = 0; r < count; ++r) found[r] = {nearest.best[r], nearest.second[r], nearest.index[r]};
  }
}

}  // namespace trigpoint
