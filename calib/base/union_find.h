#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

namespace trigpoint {

// Disjoint sets of 0 .. n - 1, joined pair by pair; almost constant time each. A set's root is its smallest member, in
// whatever order it was joined.
class UnionFind {
 public:
  explicit UnionFind(int n) : parent_(static_cast<size_t>(n)) { std::iota(parent_.begin(), parent_.end(), 0); }

  int Root(int i) {
    while (At(i) != i) i = At(i) = At(At(i));
    return i;
  }
  void Join(int a, int b) {
    a = Root(a), b = Root(b);
    At(std::max(a, b)) = std::min(a, b);
  }

 private:
  int& At(int i) { return parent_[static_cast<size_t>(i)]; }

  std::vector<int> parent_;
};

}  // namespace trigpoint
