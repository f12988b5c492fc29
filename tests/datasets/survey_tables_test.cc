#include "datasets/io/survey_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;

TEST(SurveyTables, DistancesWithRoles) {
  const TempDir dir;
  WriteFileAtomically(dir.path() / "distances.csv",
                      "from,to,distance_m,sigma_m,role\n1,2,3.25,0.003,check\n2,3,4,,\n3,3,1,,\n4,5,-1,,\n");
  std::vector<std::string> warnings;
  const auto distances = ReadDistances(dir.path() / "distances.csv", &warnings);
  ASSERT_EQ(distances.size(), 2U);
  EXPECT_TRUE(distances[0].check);
  EXPECT_EQ(distances[0].distance_m, 3.25);
  EXPECT_FALSE(distances[1].check);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_THAT(warnings[0], HasSubstr("found tag 3 twice"));
  EXPECT_THAT(warnings[1], HasSubstr(":5: column distance_m"));
}

TEST(SurveyTables, MarksOfPoints) {
  const TempDir dir;
  WriteFileAtomically(dir.path() / "control_observations.csv", "point,image,u,v\nA,x.jpg,1.5,2\n,x.jpg,1,2\n");
  std::vector<std::string> warnings;
  const auto marks = ReadControlObservations(dir.path() / "control_observations.csv", &warnings);
  ASSERT_EQ(marks.size(), 1U);
  EXPECT_EQ(marks[0].pixel, Eigen::Vector2d(1.5, 2));
  EXPECT_EQ(warnings.size(), 1U);
}

TEST(SurveyTables, OpenSfmBothForms) {
  const TempDir dir;
  WriteFileAtomically(dir.path() / "g.json",
                      R"({"points": [{"id": "0", "position": {"latitude": 52.5, "longitude": 13.4, "altitude": 14},
      "observations": [{"shot_id": "02.jpg", "projection": [-0.01, 0.06]}]}, {"id": 1, "observations": []}, {}]})");
  std::vector<std::string> warnings;
  const OpenSfmControl json = ReadOpenSfmJson(dir.path() / "g.json", &warnings);
  ASSERT_EQ(json.points.size(), 1U);
  EXPECT_EQ(json.points[0].point, "0");
  EXPECT_FALSE(json.points[0].has_role);
  ASSERT_EQ(json.marks.size(), 1U);
  EXPECT_TRUE(json.marks[0].normalised);
  EXPECT_EQ(warnings.size(), 1U);
  WriteFileAtomically(
      dir.path() / "gcp_list.txt",
      "WGS84 UTM 32N\n412733.5 5318057.3 200 10 20 a.jpg P1\n412733.5 5318057.3 200 30 40 b.jpg P1\nbad\n");
  warnings.clear();
  const OpenSfmControl list = ReadOpenSfmList(dir.path() / "gcp_list.txt", &warnings);
  ASSERT_EQ(list.points.size(), 1U);
  EXPECT_NEAR(list.points[0].geodetic->latitude_deg, 48.01, 0.01);
  EXPECT_EQ(list.marks.size(), 2U);
  EXPECT_EQ(warnings.size(), 1U);
  WriteFileAtomically(dir.path() / "gcp_list.txt", "no system\n1 2 3 4 5 a.jpg\n");
  EXPECT_THROW(ReadOpenSfmList(dir.path() / "gcp_list.txt", &warnings), InputError);
}

TEST(SurveyTables, ReadsListsInAnySystemWithCheckPoints) {
  const TempDir dir;
  WriteFileAtomically(dir.path() / "gcp_list.txt",
                      "+proj=utm +zone=32 +datum=WGS84 +units=us-ft +no_defs\n"
                      "1354107.5278 17447658.674 787.4 10 20 a.jpg gcp01\n"
                      "1354107.5278 17447658.674 787.4 30 40 b.jpg gcp01\n"
                      "1354117 17447600 787.4 10 20 a.jpg CHK-1\n"
                      "1354127 17447600 787.4 10 20 a.jpg p7 chk\n"
                      "1354137 17447600 787.4 10 20 a.jpg checked\n");
  std::vector<std::string> warnings;
  const OpenSfmControl list = ReadOpenSfmList(dir.path() / "gcp_list.txt", &warnings);
  EXPECT_TRUE(warnings.empty()) << warnings.front();
  ASSERT_EQ(list.points.size(), 4U);
  const Utm utm = UtmFromGeodetic(*list.points[0].geodetic, 32);
  EXPECT_NEAR(utm.easting_m, 1354107.5278 * 1200 / 3937, 1e-4);
  EXPECT_NEAR(utm.northing_m, 17447658.674 * 1200 / 3937, 1e-4);
  EXPECT_EQ(list.marks.size(), 5U);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(list.points[i].has_role);
    EXPECT_EQ(list.points[i].control, i == 0 || i == 3) << list.points[i].point;
  }
  // Swiss coordinates, and the same with easting and northing swapped: no place in Switzerland.
  WriteFileAtomically(dir.path() / "gcp_list.txt", "EPSG:2056\n2600000 1200000 500 10 20 a.jpg bern\n");
  const OpenSfmControl swiss = ReadOpenSfmList(dir.path() / "gcp_list.txt", &warnings);
  ASSERT_EQ(swiss.points.size(), 1U);
  EXPECT_FALSE(swiss.points[0].has_role);
  EXPECT_NEAR(swiss.points[0].geodetic->latitude_deg, 46.95108, 1e-5);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("its transformation to WGS 84 is not exact"), std::string::npos);
}

TEST(SurveyTables, MarksHaveTheirOwnSigma) {
  const TempDir dir;
  WriteFileAtomically(dir.path() / "o.csv", "point,image,u,v,sigma_px\nP,a.jpg,1,2,0.3\nP,b.jpg,1,2,\nP,c.jpg,1,2,0\n");
  std::vector<std::string> warnings;
  const std::vector<PointMark> marks = ReadControlObservations(dir.path() / "o.csv", &warnings);
  ASSERT_EQ(marks.size(), 2U);
  EXPECT_EQ(marks[0].sigma_px, 0.3);
  EXPECT_EQ(marks[1].sigma_px, 1);
  EXPECT_EQ(warnings.size(), 1U);
}

}  // namespace
}  // namespace trigpoint
