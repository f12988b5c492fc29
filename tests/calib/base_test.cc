#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <random>
#include <thread>
#include <tuple>
#include <vector>

#include "calib/base/nearest_rows.h"
#include "calib/base/option.h"
#include "calib/base/parallel.h"
#include "calib/base/union_find.h"

namespace trigpoint {
namespace {

TEST(UnionFind, RootsAreTheSmallestMembersInAnyOrder) {
  std::vector<std::pair<int, int>> pairs = {{7, 3}, {3, 9}, {1, 2}, {9, 5}, {4, 4}, {2, 1}};
  std::mt19937 random(1);
  for (int round = 0; round < 20; ++round) {
    UnionFind sets(10);
    for (const auto& [a, b] : pairs) sets.Join(a, b);
    const std::vector<int> expected = {0, 1, 1, 3, 4, 3, 6, 3, 8, 3};
    for (int i = 0; i < 10; ++i) EXPECT_EQ(sets.Root(i), expected[static_cast<size_t>(i)]) << i;
    std::shuffle(pairs.begin(), pairs.end(), random);
    for (auto& [a, b] : pairs) std::swap(a, b);
  }
}

TEST(ParallelFor, VisitsEveryIndexOnce) {
  for (const int threads : {1, 2, 7, 0}) {
    std::vector<std::atomic<int>> visits(1000);
    ParallelFor(1000, threads, CancelToken(), [&](int64_t i) { ++visits[i]; });
    for (const auto& count : visits) EXPECT_EQ(count, 1);
  }
  ParallelFor(0, 4, CancelToken(), [](int64_t) { FAIL(); });
}

TEST(ParallelFor, CarriesAnExceptionToTheCaller) {
  EXPECT_THROW(ParallelFor(100, 3, CancelToken(),
                           [](int64_t i) {
                             if (i == 40) throw NumericError("40");
                           }),
               NumericError);
}

TEST(ParallelFor, StopsWhenCancelled) {
  CancelToken cancel;
  std::atomic<int> done = 0;
  EXPECT_THROW(ParallelFor(1000000, 2, cancel,
                           [&](int64_t) {
                             if (++done == 10) cancel.Cancel();
                           }),
               Cancelled);
  EXPECT_LT(done, 100);
}

TEST(ParallelInOrder, UsesInOrderAndKeepsFewWaiting) {
  for (const int threads : {1, 2, 7}) {
    std::vector<int64_t> used;
    std::atomic<int64_t> waiting = 0, most = 0;
    ParallelInOrder(
        500, threads, 5, CancelToken(),
        [&](int64_t i) {
          const int64_t now = ++waiting;
          int64_t before = most;
          while (before < now && !most.compare_exchange_weak(before, now)) {
          }
          if (i % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the others run ahead
        },
        [&](int64_t i) {
          used.push_back(i);
          --waiting;
        });
    ASSERT_EQ(used.size(), 500U);
    for (int64_t i = 0; i < 500; ++i) EXPECT_EQ(used[static_cast<size_t>(i)], i);
    EXPECT_LE(most, 5);
  }
}

TEST(ParallelInOrder, CarriesExceptionsOfBothAndStopsWhenCancelled) {
  const auto nothing = [](int64_t) {};
  const auto fails = [](int64_t i) {
    if (i == 40) throw NumericError("40");
  };
  for (const int threads : {1, 3}) {
    EXPECT_THROW(ParallelInOrder(100, threads, 4, CancelToken(), fails, nothing), NumericError);
    EXPECT_THROW(ParallelInOrder(100, threads, 4, CancelToken(), nothing, fails), NumericError);
    CancelToken cancel;
    EXPECT_THROW(ParallelInOrder(
                     1000000, threads, 4, cancel,
                     [&](int64_t i) {
                       if (i == 10) cancel.Cancel();
                     },
                     nothing),
                 Cancelled);
  }
}

struct InnerOptions {
  double depth_m = 1;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.depth_m, {"depth_m", "m", 0, 10, "depth"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct OuterOptions {
  int count = 5;
  double ratio = 0.8;
  bool on = true;
  std::string name = "x";
  InnerOptions inner;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.count, {"count", "", 1, 9, "how many"});
    visit(self.ratio, {"ratio", "", 0.01, 1, "a ratio"});
    visit(self.on, {"on", "", 0, 0, "a switch has no range"});
    visit(self.name, {"name", "", 0, 0, "nor has a name"});
    visit(self.inner, {"inner", "", 0, 0, "a group"});
  }
};

TEST(CheckRanges, NamesEveryViolation) {
  EXPECT_TRUE(CheckRanges(OuterOptions()).empty());
  OuterOptions options;
  options.count = 12;
  options.ratio = std::nan("");
  options.inner.depth_m = -1;
  const auto problems = CheckRanges(options);
  ASSERT_EQ(problems.size(), 3U);
  EXPECT_NE(problems[0].find("count is 12, expected 1 to 9"), std::string::npos) << problems[0];
  EXPECT_NE(problems[1].find("ratio"), std::string::npos);
  EXPECT_NE(problems[2].find("inner: option depth_m is -1"), std::string::npos) << problems[2];
}

TEST(Errors, HaveTheExitCodesOfTheCommandLine) {
  EXPECT_EQ(InputError("x").ExitCode(), 1);
  EXPECT_EQ(OptionError("x").ExitCode(), 2);
  EXPECT_EQ(Cancelled().ExitCode(), 130);
  EXPECT_STREQ(InputError("a\nb\x1b[1m \xc3\xa4").what(), "a b [1m \xc3\xa4") << "one line, umlauts kept";
}

// Rows of small numbers, many of them alike, as descriptors never are: equals must not change places either.
TEST(FindNearestBothWays, IsExhaustiveSearch) {
  std::mt19937 random(1);
  const auto rows = [&](int n, int most) {
    std::vector<int16_t> values;
    for (int i = 0; i < n * kDescriptorDim; ++i) values.push_back(static_cast<int16_t>(random() % (most + 1)));
    for (int i = 2; i < n; i += 3) {
      std::copy_n(values.begin() + (i - 2) * kDescriptorDim, kDescriptorDim, values.begin() + i * kDescriptorDim);
    }
    return values;
  };
  const auto norms = [](const std::vector<int16_t>& values) {
    std::vector<int> out(values.size() / kDescriptorDim, 0);
    for (size_t i = 0; i < values.size(); ++i) out[i / kDescriptorDim] += values[i] * values[i];
    return out;
  };
  for (const auto& [n, m, most] : std::vector<std::tuple<int, int, int>>{{0, 0, 1},
                                                                         {0, 3, 1},
                                                                         {5, 0, 1},
                                                                         {1, 1, 255},
                                                                         {3, 17, 1},
                                                                         {17, 3, 2},
                                                                         {16, 4, 255},
                                                                         {100, 63, 1},
                                                                         {65, 130, 255}}) {
    const std::vector<int16_t> a = rows(n, most), b = rows(m, most);
    const std::vector<int> norms_a = norms(a), norms_b = norms(b);
    std::vector<NearestTwo> of_a, of_b, expected_a(n), expected_b(m);
    FindNearestBothWays({a.data(), norms_a.data(), n}, {b.data(), norms_b.data(), m}, &of_a, &of_b);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < m; ++j) {
        int d = 0;
        for (int c = 0; c < kDescriptorDim; ++c) {
          const int off = a[static_cast<size_t>(i) * kDescriptorDim + static_cast<size_t>(c)] -
                          b[static_cast<size_t>(j) * kDescriptorDim + static_cast<size_t>(c)];
          d += off * off;
        }
        expected_a[static_cast<size_t>(i)].Offer(d, j);
        expected_b[static_cast<size_t>(j)].Offer(d, i);
      }
    }
    const auto same = [](const NearestTwo& x, const NearestTwo& y) {
      return x.best == y.best && x.second == y.second && x.index == y.index;
    };
    EXPECT_TRUE(std::equal(of_a.begin(), of_a.end(), expected_a.begin(), expected_a.end(), same)) << n << " " << m;
    EXPECT_TRUE(std::equal(of_b.begin(), of_b.end(), expected_b.begin(), expected_b.end(), same)) << n << " " << m;
  }
}

}  // namespace
}  // namespace trigpoint
