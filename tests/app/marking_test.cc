// Marks of points that several programs write at the same time.
#include "app/pipeline/marking.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "datasets/project/project.h"
#include "tests/datasets/project_folder.h"
#include "tests/support/results_site.h"

namespace trigpoint {
namespace {

TEST(PointMarks, OfTwoProgramsAtTheSameTimeAreAllKept) {
  constexpr int kMarks = 25;
  const ProjectFolder folder;
  const std::filesystem::path dir = folder.dir().parent_path() / "marked";
  WriteResultsSite(dir, {});
  const Project project = Project::Open(dir);
  const auto write = [&](const std::string& who) {
    for (int i = 0; i < kMarks; ++i) SavePointMark(project, who + std::to_string(i), "run1/images/000000.jpg", {9, 9});
  };
  const pid_t other = fork();
  ASSERT_GE(other, 0);
  if (other == 0) {
    try {
      write("theirs");
    } catch (const Error&) {
      _exit(1);
    }
    _exit(0);
  }
  write("ours");
  int status = 1;
  ASSERT_EQ(waitpid(other, &status, 0), other);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(ReadPointMarks(project).size(), 2u * kMarks);
}

}  // namespace
}  // namespace trigpoint
