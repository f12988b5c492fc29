// review, mark, inspect: from outside.
#include <gmock/gmock.h>

#include "datasets/io/text.h"
#include "tests/support/program.h"
#include "tests/support/results_site.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ReviewCli : public testing::Test {
 protected:
  ReviewCli() {
    ResultsSiteSize size;
    size.images = 12, size.points = 300;
    WriteResultsSite(dir_, size);
  }
  Finished Review(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"review", dir_.string()});
    return Trigpoint(arguments);
  }
  std::string States() const { return Trigpoint({"status", dir_.string(), "--json"}).out; }

  TempDir dir_;
};

TEST_F(ReviewCli, WritesWhatTheDesktopWrites) {
  EXPECT_THAT(Review({"list"}).out, HasSubstr("No decisions yet\n"));
  const Finished done = Review({"exclude", "S1", "--reason", "tag was moved", "--user", "anna", "--json"});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(done.Json()["object"], "station:S1");
  EXPECT_EQ(Review({"role", "control:0", "--to", "check", "--reason", "held back"}).exit_code, 0);
  EXPECT_EQ(Review({"exclude", "run1/images/000006.jpg#2", "--reason", "blurred"}).exit_code, 0);
  EXPECT_EQ(Review({"undo", "last", "--reason", "was sharp"}).exit_code, 0);
  const auto list = Review({"list", "--json"}).Json();
  ASSERT_EQ(list["entries"].size(), 4u);
  EXPECT_EQ(list["entries"][0]["user"], "anna");
  EXPECT_EQ(list["entries"][2]["in_force"], false);
  EXPECT_EQ(list["in_force"]["excluded"].size(), 1u);
  EXPECT_EQ(list["in_force"]["roles"]["control:0"], "check");
  const std::string text = Review({"list"}).out;
  for (const char* part : {"anna excludes station:S1: tag was moved", "undoes entry 3", "(taken back)"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
}

TEST_F(ReviewCli, BadRequestsAreOneLineAndWriteNothing) {
  const struct {
    std::vector<std::string> arguments;
    int exit_code;
    const char* part;
  } kRequests[] = {
      {{"exclude", "S1"}, 2, "--reason"},
      {{"exclude", "--reason", "x"}, 2, "OBJECT"},
      {{"remove", "S1", "--reason", "x"}, 2, "remove"},
      {{"exclude", "S9", "--reason", "x"}, 1, "nearest"},
      {{"exclude", "run1/images/000006.jpg#77", "--reason", "x"}, 1, "nearest"},
      {{"restore", "S1", "--reason", "x"}, 1, "not excluded"},
      {{"undo", "S1", "--reason", "x"}, 1, "nothing to undo"},
      {{"role", "S1", "--reason", "x"}, 1, "control"},
  };
  for (const auto& request : kRequests) {
    const Finished finished = Review(request.arguments);
    EXPECT_EQ(finished.exit_code, request.exit_code) << finished.err;
    EXPECT_THAT(finished.err, HasSubstr(request.part));
    EXPECT_EQ(std::count(finished.err.begin(), finished.err.end(), '\n'), 1) << finished.err;
  }
  EXPECT_FALSE(fs::exists(dir_ / "review.jsonl") && fs::file_size(dir_ / "review.jsonl") > 0);
}

TEST_F(ReviewCli, MarksPredictTheOtherImages) {
  // 10 m ahead of the first camera, 1 m to the right; f = 256 px, 0.3 m between images.
  const auto at = [](int image) { return std::to_string(159.5 + 256 / (10 - 0.3 * image)) + ",119.5"; };
  const Finished first =
      Trigpoint({"mark", dir_.string(), "P1", "--image", "run1/images/000000.jpg", "--at", at(0), "--json"});
  EXPECT_EQ(first.exit_code, 0) << first.err;
  EXPECT_TRUE(first.Json()["predicted"].is_null());
  const Finished second =
      Trigpoint({"mark", dir_.string(), "P1", "--image", "run1/images/000008.jpg", "--at", at(8), "--json"});
  ASSERT_EQ(second.exit_code, 0) << second.err;
  const auto summary = second.Json();
  EXPECT_NEAR(summary["world_m"][0].get<double>(), 10, 1e-2);
  EXPECT_NEAR(summary["world_m"][1].get<double>(), -1, 1e-3);
  EXPECT_NEAR(summary["world_m"][2].get<double>(), 1.5, 1e-3);
  EXPECT_EQ(summary["images"].size(), 12u);
  for (const auto& image : summary["images"]) EXPECT_GT(image["sigma_px"].get<double>(), 0);
  EXPECT_THAT(ReadTextFile(dir_ / "control_observations.csv"), HasSubstr("P1,runs/run1/images/000008.jpg,"));
  EXPECT_EQ(Trigpoint({"mark", dir_.string(), "P1", "--image", "run1/images/000000.jpg", "--at", "5000,5"}).exit_code,
            1);
  EXPECT_EQ(Trigpoint({"mark", dir_.string(), "P1", "--image", "run1/images/000000.jpg", "--at", "5"}).exit_code, 2);
}

TEST_F(ReviewCli, InspectSaysWhatTheSolutionSaysOfAnImage) {
  const Finished finished =
      Trigpoint({"inspect", dir_.string(), "--run", "run1", "--image", "images/000003.jpg", "--json"});
  ASSERT_EQ(finished.exit_code, 0) << finished.err;
  const auto summary = finished.Json();
  EXPECT_EQ(summary["tags"].size(), 1u);
  EXPECT_GT(summary["points"].size(), 10u);
  EXPECT_NEAR(summary["rms_px"].get<double>(), 0.41, 0.1);  // two axes, each evenly within half a pixel
  EXPECT_EQ(Trigpoint({"inspect", dir_.string(), "--run", "run1", "--image", "none.jpg"}).exit_code, 1);
}

}  // namespace
}  // namespace trigpoint
