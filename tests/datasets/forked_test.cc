// A computation in a process of its own: its result, progress, errors and death arrive.
#include "datasets/project/forked.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "calib/base/memory.h"
#include "calib/base/parallel.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

struct Recorder final : ProgressSink {
  void Begin(std::string_view task, int64_t total) override { text += std::string(task) + std::to_string(total) + ";"; }
  void Advance(int64_t steps) override { advanced += steps; }
  void Log(LogLevel, std::string_view line) override { text += std::string(line) + ";"; }
  std::string text;
  int64_t advanced = 0;
};

TEST(RunForked, GivesWhatTheBodyGives) {
  Recorder recorder;
  const CancelToken cancel;
  const std::string large(3'000'000, 'x');
  int here = 0;
  const ForkedResult result = RunForked(
      "work",
      [&](ProgressSink& progress) {
        progress.Begin("counting", 100);
        ParallelFor(100, 4, cancel, [&](int64_t) { progress.Advance(1); });
        progress.Log(LogLevel::kWarning, "odd");
        here = 1;  // of the child
        return large;
      },
      recorder, cancel);
  EXPECT_EQ(result.bytes, large);
  EXPECT_GT(result.peak_memory_bytes, 1 << 20);
  EXPECT_EQ(recorder.text, "counting100;odd;");
  EXPECT_EQ(recorder.advanced, 100);
  EXPECT_EQ(here, 0);
}

// As where a lock was held during the fork: the first child waits for ever.
TEST(RunForked, AChildThatSleepsForEverIsBegunAnew) {
  auto* children = static_cast<std::atomic<int>*>(
      mmap(nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(children, MAP_FAILED);
  ProgressSink progress;
  const ForkedResult result = RunForked(
      "work",
      [&](ProgressSink&) {
        while (children->fetch_add(1) == 0) pause();
        return std::string("done");
      },
      progress, CancelToken(), std::chrono::milliseconds(300));
  EXPECT_EQ(result.bytes, "done");
  EXPECT_EQ(children->load(), 2);
  munmap(children, sizeof(std::atomic<int>));
}

TEST(RunForked, ErrorsAndDeathArrive) {
  ProgressSink progress;
  const CancelToken cancel;
  const auto run = [&](const std::function<void()>& body) {
    RunForked(
        "work",
        [&](ProgressSink&) {
          body();
          return std::string();
        },
        progress, cancel);
  };
  EXPECT_EQ(MessageOf<InputError>([&] { run([] { throw InputError("bad input"); }); }), "bad input");
  EXPECT_EQ(MessageOf<NumericError>([&] { run([] { throw NumericError("singular"); }); }), "singular");
  EXPECT_THROW(run([] { throw std::bad_alloc(); }), std::bad_alloc);
  EXPECT_THROW(run([] { throw std::system_error(EAGAIN, std::generic_category()); }), std::bad_alloc);
  EXPECT_THAT(MessageOf<Error>([&] { run([] { throw std::runtime_error("x"); }); }), HasSubstr("unexpected error: x"));
  const std::string died = MessageOf<Error>([&] {
    run([] {
      signal(SIGSEGV, SIG_DFL);  // a sanitizer would report it instead
      raise(SIGSEGV);
    });
  });
  EXPECT_THAT(died, HasSubstr("work: its process ended (Segmentation fault), most likely for lack of memory"));
  EXPECT_THAT(MessageOf<Error>([&] { run([] { _exit(0); }); }), HasSubstr("without a result"));
}

TEST(RunForked, IsEndedWhenCancelled) {
  ProgressSink progress;
  CancelToken cancel;
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    cancel.Cancel();
  });
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_THROW(RunForked(
                   "work",
                   [](ProgressSink&) {
                     std::this_thread::sleep_for(std::chrono::seconds(60));
                     return std::string();
                   },
                   progress, cancel),
               Cancelled);
  other.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(10));
}

TEST(AvailableMemory, IsBelowTheProcessLimit) {
  EXPECT_GT(AvailableMemoryBytes(), 1 << 20);
  ProgressSink progress;
  const ForkedResult result =
      RunForked("work",
                [](ProgressSink&) {
                  const rlimit limit{int64_t{1} << 20, int64_t{1} << 20};  // less than it has already
                  setrlimit(RLIMIT_DATA, &limit);
                  return std::to_string(AvailableMemoryBytes());
                },
                progress, {});
  EXPECT_EQ(result.bytes, "0");
}

}  // namespace
}  // namespace trigpoint
