#include "datasets/project/review.h"

#include <gmock/gmock.h>

#include <thread>

#include "datasets/project/project.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;
using testing::UnorderedElementsAre;

class ReviewTest : public testing::Test {
 protected:
  ReviewTest() { folder_.Write("stations.csv", "station,tag_id,east_m,north_m,up_m\nS1,1,0,0,-1\nS2,2,0,0,-1\n"); }
  Project Open() const { return Project::Open(folder_.dir()); }
  ReviewEntry Do(const std::string& action, const std::string& object, const std::string& role = "") const {
    return AppendReview(Open(), {action, object, role, "because", "anna"});
  }
  ProjectFolder folder_;
};

TEST_F(ReviewTest, ExcludesRestoresAndTakesBack) {
  EXPECT_EQ(Do("exclude", "S1").object, "station:S1");
  EXPECT_TRUE(Open().review().ExcludesStation("S1"));
  EXPECT_FALSE(Open().review().ExcludesStation("S2"));
  EXPECT_EQ(Do("restore", "station:S1").number, 2);
  EXPECT_FALSE(Open().review().ExcludesStation("S1"));
  const ReviewEntry undo = Do("undo", "last");
  EXPECT_EQ(undo.undoes, 2);
  EXPECT_TRUE(Open().review().ExcludesStation("S1"));
  EXPECT_EQ(Do("undo", "S1").undoes, 1);
  EXPECT_FALSE(Open().review().ExcludesStation("S1"));
  EXPECT_THAT(MessageOf<InputError>([&] { Do("undo", "S1"); }), HasSubstr("nothing to undo"));
  const auto entries = Open().review().entries();
  ASSERT_EQ(entries.size(), 4u);
  EXPECT_EQ(entries[0].user, "anna");
  EXPECT_EQ(entries[0].reason, "because");
  EXPECT_THAT(entries[0].time, testing::MatchesRegex("20..-..-..T..:..:..Z"));
  EXPECT_FALSE(entries[0].in_force);
}

TEST_F(ReviewTest, DetectionsGoWithTheirImageAndTheirTag) {
  Do("exclude", "run1/@1.000000000#1");
  EXPECT_TRUE(Open().review().ExcludesDetection("run1", "", 1'000'000'000, 1));
  EXPECT_FALSE(Open().review().ExcludesDetection("run2", "", 1'000'000'000, 1));
  Do("undo", "1");
  EXPECT_FALSE(Open().review().ExcludesDetection("run1", "", 1'000'000'000, 1));
  Do("exclude", "image:run1/@1.000000000");
  EXPECT_TRUE(Open().review().ExcludesDetection("run1", "", 1'000'000'000, 1));
  Do("undo", "last");
  Do("exclude", "tag:1");
  EXPECT_TRUE(Open().review().ExcludesDetection("run2", "", 1'000'000'000, 1));
}

// Whoever reads the table names the rows.
TEST_F(ReviewTest, BadRowsOfDetectionsAreLeftOut) {
  folder_.Write("runs/run1/detections.csv",
                "timestamp,tag_id,u0,v0,u1,v1,u2,v2,u3,v3\n1.0,1,10,20,20,20,20,10,10,10\n"
                "2.0,x,10,20,20,20,20,10,10,10\n3.0,7\n");
  EXPECT_EQ(Do("exclude", "run1/@1.000000000#1").object, "detection:run1/@1.000000000#1");
  EXPECT_THROW(Do("exclude", "run1/@3.000000000#7"), InputError);
}

TEST_F(ReviewTest, RolesChangeTheControlPoints) {
  ASSERT_TRUE(Open().site().control_points[0].control);
  EXPECT_EQ(Do("role", "1").role, "check");
  EXPECT_FALSE(Open().site().control_points[0].control);
  EXPECT_THAT(MessageOf<InputError>([&] { Do("role", "control:1", "check"); }), HasSubstr("check point already"));
  EXPECT_EQ(Do("role", "tag:2", "control").object, "control:2");
  Do("undo", "control:1");
  EXPECT_TRUE(Open().site().control_points[0].control);
}

TEST_F(ReviewTest, WhatHoldsIsSaidPerRunAndKind) {
  EXPECT_TRUE(Open().review().InForce(ReviewKinds(), "").is_null());
  Do("exclude", "image:run1/@1.000000000");
  Do("exclude", "S2");
  const Review review = Open().review();
  EXPECT_EQ(review.InForce({"image", "panorama"}, "run1")["excluded"].size(), 1u);
  EXPECT_TRUE(review.InForce({"image", "panorama"}, "run2").is_null());
  EXPECT_EQ(review.InForce(ReviewKinds(), "")["excluded"].size(), 2u);
}

TEST_F(ReviewTest, BadRequestsAreRefusedAndWriteNothing) {
  EXPECT_THAT(MessageOf<InputError>([&] { Do("exclude", "station:S3"); }), HasSubstr("nearest: 'station:S"));
  EXPECT_THAT(MessageOf<InputError>([&] { Do("restore", "S1"); }), HasSubstr("not excluded"));
  EXPECT_THAT(MessageOf<InputError>([&] { Do("role", "S1"); }), HasSubstr("there is no 'S1'"));
  EXPECT_THAT(MessageOf<OptionError>([&] { Do("remove", "S1"); }), HasSubstr("unknown review action"));
  EXPECT_THAT(MessageOf<OptionError>([&] { Do("role", "1", "boss"); }), HasSubstr("control or check"));
  EXPECT_THAT(MessageOf<OptionError>([&] {
                AppendReview(Open(), {"exclude", "S1", "", " ", ""});
              }),
              HasSubstr("reason"));
  EXPECT_TRUE(Open().review().entries().empty());
}

TEST_F(ReviewTest, DamagedLinesAreNamedAndTheRestHolds) {
  Do("exclude", "S1");
  folder_.Write("review.jsonl", "not json\n" + folder_.Read("review.jsonl") + "{\"action\": \"exclude\", \"obj");
  const Project project = Open();
  EXPECT_TRUE(project.review().ExcludesStation("S1"));
  EXPECT_THAT(project.warnings(), testing::Contains(HasSubstr("review.jsonl:1: expected a JSON object")));
  EXPECT_THAT(project.warnings(), testing::Contains(HasSubstr("review.jsonl:3: ")));
  EXPECT_EQ(Do("exclude", "S2").number, 4);  // after the half line, which keeps its number
  EXPECT_TRUE(Open().review().ExcludesStation("S2"));
  EXPECT_EQ(Open().review().entries().back().number, 4);
}

TEST_F(ReviewTest, WritersAtTheSameTimeLoseNothing) {
  const Project project = Open();
  std::vector<std::thread> threads;
  for (const char* object : {"station:S1", "station:S2", "tag:1", "tag:2"}) {
    threads.emplace_back([&project, object] { AppendReview(project, {"exclude", object, "", "x", "y"}); });
  }
  for (std::thread& thread : threads) thread.join();
  std::set<int> numbers;
  const Project reopened = Open();
  for (const ReviewEntry& entry : reopened.review().entries()) numbers.insert(entry.number);
  EXPECT_EQ(numbers, (std::set<int>{1, 2, 3, 4}));
  EXPECT_THAT(Open().review().excluded(), UnorderedElementsAre("station:S1", "station:S2", "tag:1", "tag:2"));
}

}  // namespace
}  // namespace trigpoint
