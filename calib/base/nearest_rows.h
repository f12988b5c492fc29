// Exact nearest neighbours between two sets of descriptors.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace trigpoint {

inline constexpr int kDescriptorDim = 128;

// Rows of kDescriptorDim numbers that follow one another, with the sums of their squares.
struct DescriptorRows {
  const int16_t* values = nullptr;
  const int* squared_norms = nullptr;
  int size = 0;
};

// The nearest and the second nearest of the rows that were offered: squared distances. Of equals the first counts.
struct NearestTwo {
  int best = std::numeric_limits<int>::max();
  int second = std::numeric_limits<int>::max();
  int index = -1;
  void Offer(int squared_distance, int i) {
    if (squared_distance < best) {
      second = best;
      best = squared_distance;
      index = i;
    } else if (squared_distance < second) {
      second = squared_distance;
    }
  }
};

// Of every row of a among those of b, and of every row of b among those of a. Sums must stay within 31 bits (values to
// 255 do). The same on every processor: there is no rounding.
void FindNearestBothWays(const DescriptorRows& a, const DescriptorRows& b, std::vector<NearestTwo>* of_a,
                         std::vector<NearestTwo>* of_b);

}  // namespace trigpoint
