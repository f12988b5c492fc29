#include <gtest/gtest.h>

#include <atomic>

#include "calib/base/option.h"
#include "calib/base/parallel.h"

namespace trigpoint {
namespace {

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

}  // namespace
}  // namespace trigpoint
