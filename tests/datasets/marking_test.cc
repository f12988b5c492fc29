// Marks of points: names of images as files shorten them, several programs that write at the same time.
#include "datasets/project/marking.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "datasets/io/text.h"
#include "datasets/project/project.h"
#include "tests/support/project_folder.h"
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

TEST(PointMarks, OfShortenedNamesAreThoseOfTheFullOnes) {
  const ProjectFolder folder;
  const std::filesystem::path dir = folder.dir().parent_path() / "marked";
  WriteResultsSite(dir, {});
  const std::filesystem::path file = dir / "control_observations.csv";
  std::ofstream(file) << "point,image,u,v\nA,000000.jpg,3,4\nB,images/000000.jpg,5,6\nC,elsewhere.jpg,7,8\n";
  const Project project = Project::Open(dir);
  const std::string full = "runs/run1/images/000000.jpg";
  const std::vector<PointMark> marks = ReadPointMarks(project);
  ASSERT_EQ(marks.size(), 3u);
  EXPECT_EQ(marks[0].image, full);
  EXPECT_EQ(marks[1].image, full);
  EXPECT_EQ(marks[2].image, "elsewhere.jpg");
  SavePointMark(project, "A", full, {9, 9});  // moves it
  RemovePointMark(project, "B", "run1/images/000000.jpg");
  EXPECT_EQ(ReadTextFile(file), "point,image,u,v\nC,elsewhere.jpg,7,8\nA,runs/run1/images/000000.jpg,9.000,9.000\n");
}

TEST(PointMarks, LastOneTakesItsFileAlong) {
  const ProjectFolder folder;
  const std::filesystem::path dir = folder.dir().parent_path() / "marked";
  WriteResultsSite(dir, {});
  const Project project = Project::Open(dir);
  const std::filesystem::path file = dir / "control_observations.csv";
  for (const char* point : {"A", "B"}) SavePointMark(project, point, "run1/images/000000.jpg", {3, 4});
  RemovePointMark(project, "A", "run1/images/000000.jpg");
  EXPECT_TRUE(std::filesystem::exists(file));
  RemovePointMark(project, "B", "run1/images/000000.jpg");
  EXPECT_FALSE(std::filesystem::exists(file));
  std::ofstream(file) << "# mine\npoint,image,u,v\nA,000000.jpg,3,4\n";
  RemovePointMark(project, "A", "run1/images/000000.jpg");
  EXPECT_EQ(ReadTextFile(file), "# mine\npoint,image,u,v\n");
}

}  // namespace
}  // namespace trigpoint
