// Tasks of a batch hold a project together, each its result alone; who has the project alone keeps all of them out.
#include "datasets/project/task_lock.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class TaskLockTest : public testing::Test {
 protected:
  std::string Refused(const std::string& result) const {
    return MessageOf<IoError>([&] { const TaskLock lock(results_, result, 0); });
  }

  ProjectFolder folder_;
  fs::path results_ = folder_ / "results";
};

TEST_F(TaskLockTest, TasksMakeDifferentResultsTogether) {
  const TaskLock first(results_, "localize/run1", 0), second(results_, "localize/run2", 0), third(results_, "gates", 0);
  for (const char* result : {"localize/run1", "localize/run2", "gates"}) {
    EXPECT_TRUE(TaskLock::IsHeld(results_, result)) << result;
  }
  EXPECT_FALSE(TaskLock::IsHeld(results_, "localize/run3"));
  EXPECT_FALSE(TaskLock::IsHeld(results_, "localize"));
}

TEST_F(TaskLockTest, NobodyElseMakesTheSameResult) {
  const TaskLock lock(results_, "localize/run1@paper", 0);
  EXPECT_THAT(Refused("localize/run1@paper"), AllOf(HasSubstr("in use by process " + std::to_string(getpid())),
                                                    HasSubstr(HostName()), HasSubstr("(making localize/run1@paper)")));
  const TaskLock other(results_, "localize/run1", 0);  // the same run's other result
}

TEST_F(TaskLockTest, TasksAndOneWhoHasTheProjectAloneKeepEachOtherOut) {
  {
    const TaskLock task(results_, "features/run1", 0);
    EXPECT_THAT(MessageOf<IoError>([&] { const ProjectLock alone(results_); }), HasSubstr("(making features/run1)"));
    ASSERT_TRUE(ProjectLock::Holder(results_));
    EXPECT_EQ(ProjectLock::Holder(results_)->stage, "features/run1");
  }
  EXPECT_FALSE(ProjectLock::Holder(results_));
  ProjectLock alone(results_);
  alone.Announce("survey");
  EXPECT_THAT(Refused("features/run1"), HasSubstr("(making survey)"));
  EXPECT_FALSE(TaskLock::IsHeld(results_, "features/run1"));
}

TEST_F(TaskLockTest, OnceRefusedNothingStaysHeld) {
  auto lock = std::make_unique<TaskLock>(results_, "gates", 0);
  Refused("gates");
  lock.reset();
  EXPECT_FALSE(TaskLock::IsHeld(results_, "gates"));
  const ProjectLock alone(results_);
}

TEST_F(TaskLockTest, ATaskWaitsForTheOtherMaker) {
  auto lock = std::make_unique<TaskLock>(results_, "gates", 0);
  std::thread ends([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    lock.reset();
  });
  const TaskLock waits(results_, "gates", 60);
  ends.join();
  EXPECT_TRUE(TaskLock::IsHeld(results_, "gates"));
}

TEST_F(TaskLockTest, AKilledTaskHoldsNothingAndItsOldResultComesBack) {
  // Killed between the two steps of a replacement: the old results had been moved aside.
  folder_.Write("results/localize/.old-run1/manifest.json", "old");
  folder_.Write("results/localize/.old-run2/manifest.json", "of another task");
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const TaskLock lock(results_, "survey", 0);
    [[maybe_unused]] const auto written = write(ready[1], "x", 1);
    while (true) pause();
  }
  char byte;
  EXPECT_EQ(read(ready[0], &byte, 1), 1);
  EXPECT_TRUE(TaskLock::IsHeld(results_, "survey"));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  for (const int end : ready) close(end);
  EXPECT_FALSE(TaskLock::IsHeld(results_, "survey"));
  const TaskLock survey(results_, "survey", 0), run1(results_, "localize/run1", 0);
  EXPECT_EQ(folder_.Read("results/localize/run1/manifest.json"), "old");
  EXPECT_FALSE(fs::exists(results_ / "localize/.old-run1"));
  EXPECT_TRUE(fs::exists(results_ / "localize/.old-run2"));  // its maker may be at work
}

TEST_F(TaskLockTest, AskingCreatesNothing) {
  EXPECT_FALSE(TaskLock::IsHeld(results_, "gates"));
  EXPECT_FALSE(fs::exists(results_));
}

TEST_F(TaskLockTest, OneAtATimeHasABatch) {
  const fs::path batch = folder_ / "sites-batch";
  EXPECT_FALSE(BatchLock::Holder(batch));
  EXPECT_FALSE(fs::exists(batch));
  auto lock = std::make_unique<BatchLock>(batch);
  ASSERT_TRUE(BatchLock::Holder(batch));
  EXPECT_EQ(BatchLock::Holder(batch)->process, getpid());
  EXPECT_THAT(MessageOf<IoError>([&] { const BatchLock second(batch); }),
              AllOf(HasSubstr("batch " + batch.string() + " is in use by process " + std::to_string(getpid()) + " of "),
                    HasSubstr("`trigpoint batch status` works meanwhile")));
  const TaskLock task(results_, "gates", 0);  // tasks do not need it
  lock.reset();
  EXPECT_FALSE(BatchLock::Holder(batch));
  const BatchLock again(batch);
}

TEST_F(TaskLockTest, AFolderThatCannotBeWrittenIsNamed) {
  folder_.Write("results", "a file");
  EXPECT_THAT(Refused("gates"), HasSubstr(results_.string()));
}

}  // namespace
}  // namespace trigpoint
