// Layouts of tags of WPILib and Limelight.
#include "datasets/io/tag_layout.h"

#include <gmock/gmock.h>

#include "datasets/import/tag_layout_control.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

const char* const kWpilib = R"({"tags": [
  {"ID": 1, "pose": {"translation": {"x": 5, "y": 2, "z": 1.5}, "rotation": {"quaternion": {"W": 1, "X": 0, "Y": 0, "Z": 0}}}},
  {"ID": 2, "pose": {"translation": {"x": 0, "y": 0, "z": 1}, "rotation": {"quaternion": {"W": 0.7071067811865476, "X": 0, "Y": 0, "Z": 0.7071067811865476}}}}],
  "field": {"length": 16.54, "width": 8.21}})";

// A tag without rotation looks along x: who stands before it has y to the right.
TEST(TagLayout, AxesAreThoseOfWpilib) {
  const TempDir dir;
  const std::vector<LayoutTag> tags = ReadTagLayout(dir.Write("field.json", kWpilib));
  ASSERT_EQ(tags.size(), 2u);
  const Eigen::Matrix3d r = tags[0].world_from_tag.rotation.toRotationMatrix();
  EXPECT_LT((r.col(0) - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
  EXPECT_LT((r.col(1) - Eigen::Vector3d(0, 0, -1)).norm(), 1e-12);
  EXPECT_LT((r.col(2) - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-12);
  // Turned by 90 deg it looks along y.
  EXPECT_LT((tags[1].world_from_tag.rotation * Eigen::Vector3d(0, 0, -1) - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
}

TEST(TagLayout, ComesBackAsItWasWritten) {
  const TempDir dir;
  std::vector<LayoutTag> tags = ReadTagLayout(dir.Write("field.json", kWpilib));
  EXPECT_THAT(MessageOf<InputError>([&] { WriteFmap(dir / "a.fmap", tags); }), HasSubstr("an fmap states sizes"));
  for (LayoutTag& tag : tags) tag.size_m = 0.1651;
  WriteFmap(dir / "a.fmap", tags);
  WriteWpilibLayout(dir / "a.json", tags);
  EXPECT_THAT(ReadTextFile(dir / "a.fmap"), HasSubstr("apriltag3_36h11_classic"));
  for (const char* name : {"a.fmap", "a.json"}) {
    EXPECT_TRUE(IsTagLayout(dir / name));
    const std::vector<LayoutTag> again = ReadTagLayout(dir / name);
    ASSERT_EQ(again.size(), 2u);
    for (size_t i = 0; i < 2; ++i) {
      EXPECT_LT(again[i].world_from_tag.Minus(tags[i].world_from_tag).norm(), 1e-9);
      EXPECT_NEAR(again[i].size_m, name[2] == 'f' ? 0.1651 : 0, 1e-12);
    }
  }
}

TEST(TagLayout, BecomesControl) {
  const TempDir dir;
  const std::filesystem::path file = dir.Write("field.json", kWpilib), site = dir / "site";
  EXPECT_THAT(MessageOf<InputError>([&] { ImportTagLayout(site, file, 0); }), HasSubstr("--tag-size"));
  EXPECT_FALSE(std::filesystem::exists(site));
  ImportTagLayout(site, file, 0.2);
  std::vector<std::string> warnings;
  const std::vector<ControlPoint> points = ReadControlPoints(site / "control_points.csv", &warnings);
  EXPECT_EQ(Joined(warnings), "");
  ASSERT_EQ(points.size(), 8u);
  // Bottom-left of the tag that looks along x: less y, below.
  EXPECT_LT((*points[0].local_m - Eigen::Vector3d(5, 1.9, 1.4)).norm(), 1e-9);
  EXPECT_LT((*points[2].local_m - Eigen::Vector3d(5, 2.1, 1.6)).norm(), 1e-9);
  EXPECT_EQ(ReadTagSizes(site / "tags.yaml").SizeOf(2), 0.2);
  EXPECT_THAT(MessageOf<InputError>([&] { ImportTagLayout(site, file, 0.2); }), HasSubstr("is there already"));
}

TEST(TagLayout, FamiliesAreMixed) {
  const TempDir dir;
  std::vector<LayoutTag> tags(2);
  tags[0].id = 3, tags[0].family = "tag36h11", tags[0].size_m = 0.2;
  tags[1].id = 4, tags[1].family = "tag16h5", tags[1].size_m = 0.1;
  WriteFmap(dir / "mixed.fmap", tags);
  const ImportReport report = ImportTagLayout(dir / "site", dir / "mixed.fmap", 0);
  EXPECT_THAT(Joined(report.lines), HasSubstr("2 tags of tag16h5, tag36h11"));
  const TagSizes sizes = ReadTagSizes(dir / "site/tags.yaml");
  EXPECT_EQ(sizes.family, "tag36h11,tag16h5:4");
  EXPECT_EQ(sizes.SizeOf(4), 0.1);
}

TEST(TagLayout, DamageIsNamed) {
  const TempDir dir;
  const auto message = [&](const std::string& text) {
    return MessageOf<InputError>([&] { ReadTagLayout(dir.Write("x.json", text)); });
  };
  EXPECT_THAT(message("[1]"), HasSubstr("expected a field layout"));
  EXPECT_THAT(message(R"({"tags": [{"ID": 1, "pose": {}}]})"), HasSubstr("tag 1 of the list: expected ID and pose"));
  EXPECT_THAT(message(R"({"fiducials": [{"id": 1, "family": "aruco", "size": 1, "transform": []}]})"),
              HasSubstr("expected a family"));
  EXPECT_THAT(
      message(
          R"({"fiducials": [{"id": 1, "family": "apriltag3_36h11_classic", "size": 165.1, "transform": [2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1]}]})"),
      HasSubstr("holds no rotation"));
  // Values of no site: a number beyond any field, a size in metres where fmap states millimetres.
  for (const auto& [size, x] : {std::pair{"165.1", "1e300"}, std::pair{"0.1651", "1"}, std::pair{"1e9", "1"}}) {
    const std::string text = R"({"fiducials": [{"id": 1, "family": "apriltag3_36h11_classic", "size": )" +
                             std::string(size) + R"(, "transform": [1,0,0,)" + x + "," +
                             R"(0,1,0,0,0,0,1,0,0,0,0,1]}]})";
    EXPECT_THAT(MessageOf<InputError>([&] { ImportTagLayout(dir / "site", dir.Write("far.fmap", text), 0); }),
                HasSubstr("expected an edge from 0.001 to 100 m (an fmap states mm) and coordinates up to 100000 m"));
    EXPECT_FALSE(std::filesystem::exists(dir / "site/control_points.csv"));
  }
}

}  // namespace
}  // namespace trigpoint
