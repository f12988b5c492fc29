// Whole sites and runs, as brought: complete, odd, and broken.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <exiv2/exiv2.hpp>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "datasets/io/capture_date.h"
#include "datasets/io/expired_panoramas.h"
#include "datasets/io/gps.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"
#include "datasets/io/path_error.h"
#include "datasets/io/picture_parts.h"
#include "datasets/io/site.h"
#include "datasets/io/site_inputs.h"
#include "datasets/io/site_sketch.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr int64_t kSecond = 1'000'000'000;

const char kCamera[] =
    "  camera_model: pinhole\n  intrinsics: [60, 60, 31.5, 23.5]\n  resolution: [64, 48]\n"
    "  T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]\n";

// A site with one run of four images at 1, 2, 3, 4 s.
class SiteTest : public testing::Test {
 protected:
  SiteTest() {
    AddRun("run1");
    Write("tags.yaml", "size_m: 0.5\n");
  }
  void AddRun(const std::string& name) {
    const std::string run = "runs/" + name + "/";
    Write(run + "camchain.yaml", std::string("cam0:\n") + kCamera);
    std::string list, odometry;
    for (int i = 1; i <= 4; ++i) {
      const std::string n = std::to_string(i);
      Picture(run + "images/" + n + ".png");
      list += n + " images/" + n + ".png\n";
      odometry += n + " " + n + " 0 0 0 0 0 1\n";
    }
    Write(run + "images.txt", list);
    Write(run + "odometry.tum", odometry);
  }
  std::filesystem::path Write(const std::string& name, const std::string& text) { return dir_.Write(name, text); }
  void Picture(const std::string& name, int width = 64, int height = 48) {
    std::filesystem::create_directories((dir_ / name).parent_path());
    cv::imwrite((dir_ / name).string(), cv::Mat(height, width, CV_8U, cv::Scalar(100)));
  }
  void Exif(const std::string& name, const std::vector<std::pair<std::string, std::string>>& values) {
    const auto image = Exiv2::ImageFactory::open((dir_ / name).string());
    image->readMetadata();
    for (const auto& [key, value] : values) image->exifData()[key] = value;
    image->writeMetadata();
  }
  Site Read() { return ReadSite(dir_.path()); }
  trigpoint::Run ReadOne(const std::string& name = "run1") { return ReadRun(dir_ / ("runs/" + name), dir_.path()); }
  std::string Refusal() {
    return MessageOf<InputError>([&] { Read(); });
  }
  std::string Warnings(const trigpoint::Run& run) { return Joined(run.warnings); }

  TempDir dir_;
};

TEST_F(SiteTest, ReadsAPlainRun) {
  const Site site = Read();
  ASSERT_EQ(site.runs.size(), 1u);
  EXPECT_EQ(Joined(site.warnings) + Joined(site.runs[0].warnings), "");
  EXPECT_EQ(site.runs[0].images.size(), 4u);
  EXPECT_EQ(site.runs[0].images[1].stamp_ns, 2 * kSecond);
  EXPECT_EQ(site.runs[0].images[1].path, dir_ / "runs/run1/images/2.png");
  EXPECT_EQ(site.runs[0].config.role, "both");
  EXPECT_EQ(site.runs[0].config.odometry_scale_sigma, 0.01);
}

TEST_F(SiteTest, SkipsBadImagesAndCountsThem) {
  Write("runs/run1/images/empty.png", "");
  Write("runs/run1/images.txt",
        "# time file\n3 images/3.png\n1 images/1.png\n2 images/2.png\n2 images/4.png\n5 images/gone.png\n"
        "6 images/empty.png\nx images/4.png\n7\n");
  const trigpoint::Run run = ReadOne();
  ASSERT_EQ(run.images.size(), 2u);
  EXPECT_EQ(run.images[0].file, "images/1.png");
  EXPECT_EQ(run.images[1].file, "images/3.png");
  const std::string warnings = Warnings(run);
  EXPECT_THAT(warnings, HasSubstr("images.txt:6: there is no file"));
  EXPECT_THAT(warnings, HasSubstr("images.txt:7: the file"));
  EXPECT_THAT(warnings, HasSubstr("is empty (0 bytes); the image is skipped"));
  EXPECT_THAT(warnings, HasSubstr("images.txt:8: expected a time"));
  EXPECT_THAT(warnings, HasSubstr("images.txt:9: expected 'timestamp file [camera]'"));
  EXPECT_THAT(warnings, HasSubstr("timestamps are out of order"));
  EXPECT_THAT(warnings,
              HasSubstr("left out 2 images with the time of another image of the same camera ('images/2.png'"));
  EXPECT_THAT(warnings, HasSubstr("all times are whole seconds: give them to a millisecond"));
}

TEST_F(SiteTest, TakesNamesAsTheyAre) {
  const std::string umlaut = "images/H\xC3\xA4user am Platz.png", quoted = "images/it's \"2\".png";
  Picture("runs/run1/" + umlaut);
  Picture("runs/run1/" + quoted);
  Picture("runs/run1/images/cam0 x.png");
  Picture("runs/run1/images/\xC3\xA4 2.png");
  Write("runs/run1/images.txt",
        "\xEF\xBB\xBF"
        "1 " +
            umlaut + "\r\n2 \"images/\xC3\xA4 2.png\" cam0\r\n3 " + quoted +
            "\r\n4\timages/cam0 x.png cam0\r\n5,images/1.png\r\n");
  const trigpoint::Run run = ReadOne();
  EXPECT_EQ(Warnings(run).find("skipped"), std::string::npos) << Warnings(run);
  ASSERT_EQ(run.images.size(), 5u);
  EXPECT_EQ(run.images[0].file, umlaut);
  EXPECT_EQ(run.images[1].file, "images/\xC3\xA4 2.png");
  EXPECT_EQ(run.images[2].file, quoted);
  EXPECT_EQ(run.images[3].file, "images/cam0 x.png");
}

TEST_F(SiteTest, ADecimalCommaOfATimeIsNamed) {
  Write("runs/run1/images.txt", "1,500000 images/1.png\n2 images/2.png\n");
  EXPECT_THAT(Warnings(ReadOne()),
              HasSubstr("images.txt:1: found the time '1,500000' with a decimal comma; expected a dot"));
}

TEST_F(SiteTest, LeavesOutAnImageThatIsListedAtTwoTimes) {
  Write("runs/run1/images.txt", "1 images/1.png\n2 images/2.png\n3 ./images/1.png\n3 images/3.png\n3 images/3.png\n");
  const trigpoint::Run run = ReadOne();
  ASSERT_EQ(run.images.size(), 2u);
  EXPECT_EQ(run.images[0].file, "images/2.png");
  EXPECT_EQ(run.images[1].file, "images/3.png");
  EXPECT_THAT(Warnings(run),
              HasSubstr("images.txt:3: the image 'images/1.png' is listed at another time or camera in line 1"));
  Write("runs/run1/images.txt", "1 images/1.png\n3 images/1.png\n");
  EXPECT_THAT(Refusal(), HasSubstr("none of the listed images is usable"));
}

TEST_F(SiteTest, SortsSeveralCameras) {
  Write("runs/run1/camchain.yaml", std::string("cam0:\n") + kCamera + "left:\n" + kCamera);
  Write("runs/run1/images.txt", "1 images/1.png left\n1 images/2.png cam0\n2 images/3.png\n2 images/4.png left\n");
  const trigpoint::Run run = ReadOne();
  ASSERT_EQ(run.images.size(), 4u);
  EXPECT_EQ(run.images[0].file, "images/2.png");
  EXPECT_EQ(run.images[1].camera, 1);
  EXPECT_EQ(Warnings(run), "");
  Write("runs/run1/images.txt", "1 \"images/1.png\" lefd\n");
  EXPECT_THAT(Refusal(), HasSubstr("images.txt:1: there is no camera 'lefd' in camchain.yaml; nearest: 'left'"));
  Write("runs/run1/images.txt", "1 images/1.png lefd\n");
  EXPECT_THAT(Refusal(), HasSubstr("images.txt:1: there is no camera 'lefd' in camchain.yaml; nearest: 'left'"));
}

TEST_F(SiteTest, RefusesPathsThatClimbOut) {
  const auto refusal = [&] { return MessageOf<PathError>([&] { Read(); }); };
  Write("runs/run1/images.txt", "1 images/1.png\n2 ../../../secret.png\n");
  EXPECT_THAT(refusal(), HasSubstr("images.txt:2: the path '../../../secret.png' leaves the project"));
  Write("runs/run1/images.txt", "1 images/1.png\n2 /etc/passwd\n");
  EXPECT_THAT(refusal(), HasSubstr("images.txt:2: the path '/etc/passwd' leaves the project"));
  Write("runs/run1/images.txt", "1 images/1.png\n2 ../../runs/run1/images/2.png\n");
  EXPECT_EQ(refusal(), "");
  Write("panoramas.csv", "file,station\n../x.jpg,S1\n");
  EXPECT_THAT(refusal(), HasSubstr("panoramas.csv:2: the path '../x.jpg' leaves the project"));
  std::filesystem::remove(dir_ / "panoramas.csv");
  Picture("references/a.png");
  Write("photos.csv", "file,camera\nreferences/a.png,../camchain.yaml\n");
  EXPECT_THAT(refusal(), HasSubstr("photos.csv:2: column camera: the path '../camchain.yaml' leaves"));
  std::filesystem::remove(dir_ / "photos.csv");
  Write("runs/run1/run.yaml", "masks:\n  cam0: ../../../mask.png\n");
  EXPECT_THAT(refusal(), HasSubstr("run.yaml: key 'masks': the path '../../../mask.png' leaves"));
  Write("runs/run1/run.yaml", "camera: ../../../../x\n");
  EXPECT_THAT(refusal(), HasSubstr("run.yaml: key 'camera': the path"));
}

TEST_F(SiteTest, RefusesABadRunYaml) {
  const auto with = [&](const std::string& text) {
    Write("runs/run1/run.yaml", text);
    return Refusal();
  };
  EXPECT_THAT(with("mirored: true\n"), HasSubstr("run.yaml:1: unknown key 'mirored'; nearest known key: 'mirrored'"));
  EXPECT_THAT(with("odometry:\n  scale_sgma: 1\n"), HasSubstr("nearest known key: 'odometry.scale_sigma'"));
  EXPECT_THAT(with("mirrored: 3\n"), HasSubstr("run.yaml:1: key 'mirrored': expected true or false, found '3'"));
  EXPECT_THAT(with("gps:\n\ttime_offset_s: 3\n"), HasSubstr("run.yaml:2: the line is indented with a tab"));
  EXPECT_THAT(with("gps:\n  lever_arm_m: [0, 1]\n"), HasSubstr("expected a list of 3 numbers, found a list of 2"));
  EXPECT_THAT(with("role: servey\n"),
              HasSubstr("expected survey, evaluation or both, found 'servey'; nearest: 'survey'"));
  EXPECT_THAT(with("date: yesterday\n"), HasSubstr("expected a date as 2026-05-12"));
  EXPECT_THAT(with("time_zero_utc: noon\n"), HasSubstr("expected a time as 2026-05-12T09:43:20Z"));
  EXPECT_THAT(with("camera: wide\n"), HasSubstr("there is no calibration 'wide'"));
  EXPECT_THAT(with("masks: none.png\n"), HasSubstr("there is no file"));
  Picture("runs/run1/mask.png");
  EXPECT_THAT(with("masks:\n  cam1: mask.png\n"), HasSubstr("there is no camera 'cam1'; nearest: 'cam0'"));
  EXPECT_EQ(with("masks: mask.png\n"), "");
  EXPECT_EQ(ReadOne().cameras[0].mask.pictures, std::vector{dir_ / "runs/run1/mask.png"});
}

TEST_F(SiteTest, ReadsListsOfMasksAndBoxes) {
  Picture("runs/run1/mask.png");
  Write("runs/run1/run.yaml", "masks: {cam0: [mask.png, images, [0, 40, 63.5, 47]]}\n");
  const CameraMask mask = ReadOne().cameras[0].mask;
  EXPECT_EQ(mask.pictures, std::vector{dir_ / "runs/run1/mask.png"});
  EXPECT_EQ(mask.folders, std::vector{dir_ / "runs/run1/images"});
  EXPECT_EQ(mask.boxes_px, (std::vector<Eigen::Vector4d>{{0, 40, 63.5, 47}}));
  for (const char* wrong : {"[[0, 40, 63]]", "[[0, 40, x, 47]]", "[{u: 3}]"}) {
    Write("runs/run1/run.yaml", std::string("masks: ") + wrong + "\n");
    EXPECT_THAT(Refusal(), HasSubstr("key 'masks': expected the name of a mask or of a folder of masks"));
  }
  Write("runs/run1/run.yaml", "masks: {cam0: [[5, 0, 4, 9]]}\n");
  EXPECT_THAT(Refusal(), HasSubstr("key 'masks.cam0': expected a box [u0, v0, u1, v1] with u0 <= u1"));
}

TEST_F(SiteTest, MasksAmongTheImagesAreNoImages) {
  std::filesystem::remove(dir_ / "runs/run1/images.txt");
  for (const bool guessed : {false, true}) {
    if (guessed) std::filesystem::remove(dir_ / "runs/run1/camchain.yaml");
    const std::filesystem::path mask = dir_ / "runs/run1/images/mask.png",
                                of_second = dir_ / "runs/run1/images/2.png.png";
    Picture("runs/run1/images/mask.png");
    Write("runs/run1/run.yaml", "masks: images/mask.png\n");
    trigpoint::Run run = ReadOne();
    EXPECT_EQ(run.images.size(), 4u) << guessed;
    EXPECT_EQ(run.cameras.at(0).mask.pictures, std::vector{mask});
    std::filesystem::rename(mask, of_second);
    Write("runs/run1/run.yaml", "masks: images\n");
    run = ReadOne();
    ASSERT_EQ(run.images.size(), 4u) << guessed;
    EXPECT_TRUE(RunMasks(run).Of(run.images[0]).empty()) << "an image is not its own mask";
    EXPECT_FALSE(RunMasks(run).Of(run.images[1]).empty());
    EXPECT_EQ(MaskFiles(run), std::vector{of_second});
    std::filesystem::remove(of_second);
  }
}

TEST_F(SiteTest, ASketchOfMistakesIsRefused) {
  const std::string header = "kind,name,east_m,north_m,up_m,latitude_deg,longitude_deg,heading_deg,size_mm\n";
  const std::string tag = "tag,7,1,2,1,,,90,160\n";
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {"tag,07,5,2,1,,,90,160\n", "plan.csv:3: tag 07 is there already"},
      {"control,7,,,,,,,\ncheck,7,,,,,,,\n", "plan.csv:4: check 7 is there already"},
      {"path,a,0,0,1,,,,\npath,b,0,0,1,,,,\npath,a,9,0,1,,,,\n", "corners of a path follow each other"},
      {"tag,8,1,2,1,,,90,0.16\n", "size_mm 0.16: expected 5 to 5000 mm"},
      {"tag,8,1,90000,1,,,90,160\n", "is 90 km from tag 7"},
      {"tag,8,,,,148,7,90,160\n", "latitude within -90 to 90"},
      {"path,a,,,,48,7,,\npath,a,,,,7,48,,\n", "swapped columns"},
  };
  for (const auto& [rows, expected] : mistakes) {
    try {
      ReadSiteSketch(Write("plan.csv", header + tag + rows));
      ADD_FAILURE() << rows;
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr(expected));
    }
  }
  for (const auto& [features, expected] : std::map<std::string, std::string>{
           {"1", "feature 0: expected a GeoJSON Feature, found 1"},
           {R"({"properties": 7})", "feature 0: properties: expected an object, found 7"},
           {R"({"geometry": []})", "feature 0: geometry: expected an object, found []"},
           {R"({"geometry": {"type": 5}})", "feature 0: geometry '5': expected a Point"}}) {
    const auto file = Write("odd.geojson", "{\"features\": [" + features + "]}");
    EXPECT_THAT(MessageOf<InputError>([&] { ReadSiteSketch(file); }), HasSubstr(expected));
  }
  const std::string lines =
      R"({"features": [{"properties": {"kind": "path"}, "geometry": {"type": "LineString",
          "coordinates": [[7.8, 48], [7.8001, 48]]}}, {"properties": {"kind": "path"}, "geometry": {"type":
          "LineString", "coordinates": [[7.8, 48.0001], [7.8001, 48.0001]]}}]})";
  const std::vector<SketchItem> read = ReadSiteSketch(Write("lines.geojson", lines));
  ASSERT_EQ(read.size(), 4U);
  EXPECT_NE(read[0].name, read[2].name);
}

TEST_F(SiteTest, WritesASketchAsItReadsIt) {
  const auto file =
      Write("plan.csv",
            "kind,name,east_m,north_m,up_m,latitude_deg,longitude_deg,heading_deg,size_mm,sigma_h_m,tag_id\n"
            "tag,7,1.5,-2.25,1,,,90,160,,\n"
            "control,7,,,,,,,,0.004,\n"
            "station,\"S, 1\",,,,48.5,9.25,,,,7\n"
            "path,a,0,0,1.5,,,,,,\n"
            "path,a,5,0,1.5,,,,,,\n");
  const std::vector<SketchItem> read = ReadSiteSketch(file);
  const std::vector<SketchItem> again = ReadSiteSketch(Write("again.csv", SiteSketchCsv(read)));
  ASSERT_EQ(again.size(), read.size());
  for (size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(again[i].kind, read[i].kind);
    EXPECT_EQ(again[i].name, read[i].name);
    EXPECT_EQ(again[i].tag_id, read[i].tag_id);
    EXPECT_EQ(again[i].size_m, read[i].size_m);
    EXPECT_EQ(again[i].sigma_h_m, read[i].sigma_h_m);
    EXPECT_EQ(again[i].sigma_v_m, read[i].sigma_v_m);
    EXPECT_EQ(again[i].local_m, read[i].local_m);
    EXPECT_EQ(again[i].heading_rad, read[i].heading_rad);
    ASSERT_EQ(again[i].geodetic.has_value(), read[i].geodetic.has_value());
    if (read[i].geodetic) {
      EXPECT_EQ(again[i].geodetic->latitude_deg, read[i].geodetic->latitude_deg);
    }
  }
}

TEST_F(SiteTest, RefusesAMaskOfAnotherSizeAndAScaleWithoutSigma) {
  Picture("runs/run1/mask.png", 10, 10);
  Write("runs/run1/run.yaml", "masks: mask.png\n");
  EXPECT_THAT(Refusal(), HasSubstr("key 'masks': expected a mask of 64 x 48 px as camera 'cam0', found"));
  for (const char* sigma : {"0", "-1"}) {
    Write("runs/run1/run.yaml", std::string("odometry: {scale_sigma: ") + sigma + "}\n");
    EXPECT_THAT(Refusal(), HasSubstr("key 'odometry.scale_sigma': expected more than 0"));
  }
}

TEST_F(SiteTest, WarnsOfCamerasThatNobodyHas) {
  const auto with = [&](const std::string& intrinsics, const std::string& distortion = "") {
    Write("runs/run1/camchain.yaml",
          "cam0:\n  camera_model: pinhole\n  intrinsics: " + intrinsics + "\n  resolution: [64, 48]\n" + distortion);
    return Warnings(ReadOne());
  };
  EXPECT_EQ(with("[60, 60, 31.5, 23.5]"), "");
  EXPECT_EQ(with("[60, 60, 31.5, 23.5]", "  distortion_model: radtan\n  distortion_coeffs: [-0.3, 0.1, 0, 0]\n"), "");
  EXPECT_EQ(with("[60, 60, 31.5, 23.5]", "  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0.001, -0.002]\n"),
            "");
  EXPECT_THAT(
      with("[60, 60, 31.5, 23.5]", "  distortion_model: radtan\n  distortion_coeffs: [-0.2, 0.05, -0.006, 0]\n"),
      HasSubstr("decentring -0.006, 0 moves pixels in the corners by 1.2 %"));
  EXPECT_THAT(with("[4.2, 4.2, 31.5, 23.5]"), HasSubstr("camera 'cam0': focal length 4.2"));
  EXPECT_THAT(with("[60, 90, 31.5, 23.5]"), HasSubstr("expected nearly square pixels"));
  EXPECT_THAT(with("[60, 60, 479.5, 23.5]"), HasSubstr("principal point 479.5"));
  EXPECT_THAT(with("[60, 60, 31.5, 23.5]", "  distortion_model: radtan\n  distortion_coeffs: [-0.9, 0, 0, 0]\n"),
              HasSubstr("folds the picture over"));
}

TEST_F(SiteTest, NamesTheLineOfAJump) {
  Write("runs/run1/odometry.tum",
        "# t\n1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n2.5 10001 0 0 0 0 0 1\n4 10003 0 0 0 0 0 1\n");
  EXPECT_THAT(Refusal(), HasSubstr("odometry.tum:4: jumps 10000.0 m in 0.500 s; expected a continuous motion"));
  Write("runs/run1/odometry.tum", "1 0 0 0 0 0 0 1\n2 1400 0 0 0 0 0 1\n3 2800 0 0 0 0 0 1\n4 4200 0 0 0 0 0 1\n");
  EXPECT_THAT(Refusal(), HasSubstr("odometry.tum: moves at 1400 m/s in the median; expected positions in metres"));
}

TEST(Time, EndsWhereNanosecondsDo) {
  EXPECT_TRUE(ParseUtcToNs("2262-01-01T00:00:00Z"));
  EXPECT_FALSE(ParseUtcToNs("4052-05-12T09:30:00Z"));
}

TEST_F(SiteTest, SkipsImagesWithNamesThatNoFileHas) {
  Write("runs/run1/images.txt", "1 images/1.png\n2 images/" + std::string(300, 'a') + ".png x\n3 images/3.png\n");
  const auto run = ReadOne();
  EXPECT_EQ(run.images.size(), 2u);
  EXPECT_THAT(Warnings(run), HasSubstr("images.txt:2: there is no file"));
}

TEST_F(SiteTest, RefusesPositionsInWholeMetres) {
  Write("runs/run1/odometry.tum",
        "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0.1 0.995\n3 2 0 0 0 0 0.2 0.98\n4 3 1 0 0 0 0.3 0.954\n");
  EXPECT_THAT(Refusal(), HasSubstr("odometry.tum: all positions are whole metres"));
}

TEST_F(SiteTest, CountsOdometryFromNearItsFirstPose) {
  Write("runs/run1/odometry.tum",
        "1 412345.25 5318234 240 0 0 0 1\n2 412346.25 5318234 240 0 0 0 1\n4 412348.5 5318234 240 0 0 0 1\n");
  const auto run = ReadOne();
  EXPECT_THAT(Warnings(run), HasSubstr("odometry.tum: begins 5334 km from its origin; (412345, 5318234, 240) m is"));
  EXPECT_EQ(run.odometry.poses.front().target_from_body.translation, Eigen::Vector3d(0.25, 0, 0));
  EXPECT_EQ(run.odometry.poses.back().target_from_body.translation, Eigen::Vector3d(3.5, 0, 0));
}

// One kind of places and the origin: either may be wrong.
TEST_F(SiteTest, LeavesOutPlacesThatOnlyTheOriginContradicts) {
  Picture("a.png", 64, 32);
  Picture("b.png", 64, 32);
  const std::string header = "file,latitude_deg,longitude_deg,height_m\n";
  const auto used = [](const Site& site, bool heights) {
    return std::count_if(site.references.begin(), site.references.end(),
                         [&](const Reference& r) { return heights ? r.geotag.has_height : r.geotag.has_position; });
  };
  const auto read = [&](const std::string& a, const std::string& b) {
    Write("panoramas.csv", header + "a.png," + a + "\nb.png," + b + "\n");
    return Read();
  };
  Write("origin.json", "{\"lat\": 48.0, \"lon\": 7.8, \"alt\": 240}");
  Site site = read("48.001,7.8,250", "48.0011,7.8,250");
  EXPECT_EQ(used(site, false), 2);
  EXPECT_EQ(used(site, true), 2);
  EXPECT_EQ(Joined(site.warnings), "");
  site = read("48.045,7.8,240", "48.0451,7.8,240");
  EXPECT_EQ(used(site, false), 0);
  EXPECT_THAT(Joined(site.warnings), HasSubstr("lie at least 5.0 km from origin.json"));
  EXPECT_EQ(used(read("48.045,7.8,240", "48.1,7.8,240"), false), 2) << "a site that is 6 km long";
  for (const auto& [height, said] : {std::pair("0", "all are 0"), std::pair("787.4", "in feet"),
                                     std::pair("192", "above the sea"), std::pair("2400", "expected metres above")}) {
    site = read(std::string("48.0001,7.8,") + height, std::string("48.0002,7.8,") + height);
    EXPECT_EQ(used(site, true), 0) << height;
    EXPECT_EQ(used(site, false), 2) << height;
    EXPECT_THAT(Joined(site.warnings), HasSubstr(said));
  }
  Write("control_points.csv", "tag_id,latitude_deg,longitude_deg,height_m\n1,48.045,7.8,192\n");
  site = read("48.045,7.8,192", "48.0451,7.8,192");
  EXPECT_EQ(used(site, true), 2) << "control agrees with the geotags";
}

TEST_F(SiteTest, SaysThatAnAerialImageHasNoPlace) {
  Write("aerial.tif", "garbage");
  EXPECT_THAT(Joined(Read().warnings), HasSubstr("aerial.tif: expected a georeferenced TIFF"));
  EXPECT_TRUE(Read().aerial.empty());
  Picture("aerial.tif");
  EXPECT_THAT(Joined(Read().warnings), HasSubstr("aerial.tif: expected a georeferenced TIFF"));
}

TEST_F(SiteTest, AppliesTimeOffsets) {
  Write("runs/run1/gps.csv", "timestamp_s,latitude_deg,longitude_deg,height_m\n1,48,8,240\n2,48,8,240\n");
  Write("runs/run1/run.yaml",
        "date: 2026-05-12\nrole: survey\nmirrored: true\ntime_zero_utc: 2026-05-12T09:43:20Z\n"
        "gps: {lever_arm_m: [0.1, 0.2, 1.3], time_offset_s: 0.25}\n"
        "odometry: {levelled: true, scale_sigma: 0.02, time_offset_s: -0.5}\n");
  const trigpoint::Run run = ReadOne();
  EXPECT_EQ(run.odometry.poses[0].stamp_ns, kSecond / 2);
  EXPECT_EQ(run.gps[0].stamp_ns, 5 * kSecond / 4);
  EXPECT_TRUE(run.config.mirrored && run.config.odometry_levelled);
  EXPECT_EQ(run.config.gps_lever_arm_m, Eigen::Vector3d(0.1, 0.2, 1.3));
  EXPECT_EQ(run.config.odometry_scale_sigma, 0.02);
  EXPECT_EQ(run.config.role, "survey");
  EXPECT_EQ(run.config.time_zero_utc_ns, 1'778'579'000 * kSecond);
}

TEST_F(SiteTest, SaysWhereOdometryAndGpsDoNotReach) {
  Write("runs/run1/odometry.tum", "1 0 0 0 0 0 0 1\n2.5 1 0 0 0 0 0 1\n");
  EXPECT_THAT(Warnings(ReadOne()),
              HasSubstr("odometry covers 2 of 4 images (odometry 1.000 to 2.500 s, images 1.000 to "
                        "4.000 s)"));
  Write("runs/run1/odometry.tum", "1 5 0 0 0 0 0 1\n4 5 0 0 0 0 0 1\n");
  EXPECT_THAT(Warnings(ReadOne()), HasSubstr("all 2 poses are the same"));
  Write("runs/run1/gps.csv", "timestamp_s,latitude_deg,longitude_deg\n7201,48,8\n7202,48,8\n");
  EXPECT_THAT(Warnings(ReadOne()), HasSubstr("no GPS fix falls into the images' time"));
  Write("runs/run1/gps.csv", "when,latitude_deg,longitude_deg\n1,48,8\n");
  const trigpoint::Run run = ReadOne();
  EXPECT_TRUE(run.gps.empty());
  EXPECT_THAT(Warnings(run),
              HasSubstr("column 'timestamp_s' is missing in the header row; nearest column found: 'when'; "
                        "the run goes on without GPS"));
}

TEST_F(SiteTest, LeavesABrokenRunOut) {
  AddRun("run2");
  Write("runs/run1/odometry.tum", "1 nan 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n");
  const Site site = Read();
  ASSERT_EQ(site.runs.size(), 1u);
  EXPECT_EQ(site.runs[0].name, "run2");
  EXPECT_THAT(site.broken_runs.at("run1"),
              HasSubstr("odometry.tum:1: the pose holds 'nan'; no row of the file is usable"));
  EXPECT_THAT(Joined(site.warnings), HasSubstr("run 'run1' is left out"));
  std::filesystem::remove_all(dir_ / "runs/run2");
  EXPECT_THAT(Refusal(), HasSubstr("no row of the file is usable"));
  std::filesystem::create_directories(dir_ / "runs/run2");
  Write("runs/run2/camchain.yaml", std::string("cam0:\n") + kCamera);
  EXPECT_THAT(MessageOf<InputError>([&] { ReadOne("run2"); }), HasSubstr("run2: no images; expected images.txt"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadSite(dir_ / "nowhere"); }), HasSubstr("there is no such folder"));
}

// To be looked at, a site with broken settings is still a site.
TEST_F(SiteTest, ReadsWhatIsNotBroken) {
  AddRun("run2");
  Write("runs/run1/run.yaml", "rolee: both\n");
  Write("tags.yaml", "family: [");
  EXPECT_THAT(Refusal(), HasSubstr("tags.yaml"));
  std::vector<std::string> problems;
  const Site site = ReadSiteTolerant(dir_.path(), &problems);
  ASSERT_EQ(site.runs.size(), 1u);
  EXPECT_EQ(site.runs[0].name, "run2");
  EXPECT_THAT(site.broken_runs.at("run1"), HasSubstr("unknown key 'rolee'"));
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems[0], HasSubstr("tags.yaml"));
}

TEST_F(SiteTest, TakesDetectionsInPlaceOfImages) {
  Write("runs/run1/detections.csv", "timestamp,image\n");
  std::filesystem::remove(dir_ / "runs/run1/images.txt");
  const trigpoint::Run run = ReadOne();
  EXPECT_TRUE(run.images.empty());
  EXPECT_EQ(run.detections, dir_ / "runs/run1/detections.csv");
}

TEST_F(SiteTest, ReadsBareFoldersOfImages) {
  const std::string run = "runs/bare/";
  Write(run + "camchain.yaml", std::string("cam0:\n") + kCamera + "cam1:\n" + kCamera);
  Picture(run + "cam0/data/1403636579763555584.png");
  Picture(run + "cam1/data/1403636579763555584.png");
  Picture(run + "cam0/data/1403636579813555456.png");
  trigpoint::Run read = ReadOne("bare");
  EXPECT_EQ(Warnings(read), "");
  ASSERT_EQ(read.images.size(), 3u);
  EXPECT_EQ(read.images[0].stamp_ns, 1'403'636'579'763'555'584);
  EXPECT_EQ(read.images[1].camera, 1);
  EXPECT_EQ(read.images[2].stamp_ns, 1'403'636'579'813'555'456);

  std::filesystem::remove_all(dir_ / (run + "cam0"));
  std::filesystem::remove_all(dir_ / (run + "cam1"));
  for (const char* name : {"1311868164.363181.png", "1311868164.399026.png"}) Picture(run + "images/" + name);
  EXPECT_EQ(ReadOne("bare").images[1].stamp_ns, 1'311'868'164'399'026'000);

  std::filesystem::remove_all(dir_ / (run + "images"));
  for (const char* name : {"IMG_2.jpg", "IMG_10.jpg"}) Picture(run + name);
  read = ReadOne("bare");
  ASSERT_EQ(read.images.size(), 2u);
  EXPECT_EQ(read.images[1].file, "IMG_10.jpg");
  EXPECT_EQ(read.images[1].stamp_ns, kSecond);
  EXPECT_THAT(Warnings(read), HasSubstr("neither the names nor the EXIF of the images have a time"));

  Exif(run + "IMG_2.jpg", {{"Exif.Photo.DateTimeOriginal", "2026:05:12 09:43:22"}});
  Exif(run + "IMG_10.jpg", {{"Exif.Photo.DateTimeOriginal", "2026:05:12 09:43:21"}});
  Write(run + "run.yaml", "time_zero_utc: 2026-05-12T09:43:20Z\n");
  read = ReadOne("bare");
  ASSERT_EQ(read.images.size(), 2u);
  EXPECT_EQ(read.images[0].file, "IMG_10.jpg");
  EXPECT_EQ(read.images[0].stamp_ns, kSecond);
  EXPECT_THAT(Warnings(read), HasSubstr("without a time zone"));
}

// A camera without sub-seconds took several pictures in one second: the others keep their times.
TEST_F(SiteTest, PutsImagesOfOneSecondIntoIt) {
  const std::string run = "runs/burst/";
  Write(run + "camchain.yaml", std::string("cam0:\n") + kCamera);
  Write(run + "run.yaml", "time_zero_utc: 2026-05-12T09:43:20Z\n");
  const auto take = [&](const std::string& name, const std::string& second) {
    Picture(run + name);
    if (!second.empty()) Exif(run + name, {{"Exif.Photo.DateTimeOriginal", "2026:05:12 09:43:" + second}});
  };
  take("IMG_1.jpg", "21"), take("IMG_2.jpg", "21"), take("IMG_3.jpg", "22"), take("IMG_10.jpg", "21");
  trigpoint::Run read = ReadOne("burst");
  ASSERT_EQ(read.images.size(), 4u);
  const char* const order[] = {"IMG_1.jpg", "IMG_2.jpg", "IMG_10.jpg", "IMG_3.jpg"};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(read.images[i].file, order[i]);
    EXPECT_EQ(read.images[i].stamp_ns, kSecond + static_cast<int64_t>(i) * kSecond / 3);
  }
  EXPECT_THAT(Warnings(read), HasSubstr("the same time for several images (2 images beyond the first of each time)"));
  take("IMG_3.jpg", "21");
  read = ReadOne("burst");
  EXPECT_EQ(read.images.at(3).stamp_ns, 3 * kSecond);
  EXPECT_THAT(Warnings(read),
              HasSubstr("a time for each of them (all state the same); they are numbered one a second"));
  take("IMG_3.jpg", "");
  EXPECT_THAT(Warnings(ReadOne("burst")), HasSubstr("a time for each of them (IMG_3.jpg states none)"));

  // Ten digits that begin with 0 are a counter, as of KITTI's recordings.
  Write("runs/counted/camchain.yaml", std::string("cam0:\n") + kCamera);
  for (const char* name : {"0000000007.png", "0000000009.png"}) Picture(std::string("runs/counted/images/") + name);
  read = ReadOne("counted");
  EXPECT_EQ(read.images.at(1).stamp_ns, kSecond);
  EXPECT_THAT(Warnings(read), HasSubstr("(images/0000000007.png states none)"));
}

TEST_F(SiteTest, GuessesTheCameraOfMostPictures) {
  std::filesystem::remove(dir_ / "runs/run1/camchain.yaml");
  const std::string images = "runs/run1/images/";
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) Picture(images + name);
  Picture(images + "small.jpg", 32, 24);
  Write(images + "broken.jpg", "no");
  Exif(images + "a.jpg", {{"Exif.Image.Orientation", "6"}, {"Exif.Photo.FocalLengthIn35mmFilm", "36"}});
  Write("runs/run1/images.txt",
        "0 images/broken.jpg\n1 images/small.jpg\n2 images/a.jpg\n3 images/b.jpg\n4 images/c.jpg\n");
  // One upright, two across: all fit a camera of the pictures as stored.
  trigpoint::Run run = ReadOne();
  EXPECT_EQ(run.cameras.at(0).camera.params(), (std::vector<double>{64, 64, 31.5, 23.5}));
  EXPECT_EQ(LoadGrey(run, run.images.at(2)).size(), cv::Size(64, 48));
  EXPECT_EQ(TopOf(run, run.images[2]), Eigen::Vector3d(-1, 0, 0));
  EXPECT_EQ(TopOf(run, run.images[3]), Eigen::Vector3d(0, -1, 0));
  EXPECT_EQ(Warnings(run).find("EXIF states focal lengths"), std::string::npos);
  run.config.mirrored = true;
  EXPECT_EQ(TopOf(run, run.images[2]), Eigen::Vector3d(1, 0, 0));
  // All upright: as shown. Another lens of the same phone has the same size.
  Exif(images + "b.jpg", {{"Exif.Image.Orientation", "6"}, {"Exif.Photo.FocalLengthIn35mmFilm", "18"}});
  Exif(images + "c.jpg", {{"Exif.Image.Orientation", "8"}, {"Exif.Photo.FocalLengthIn35mmFilm", "36"}});
  run = ReadOne();
  EXPECT_EQ(run.cameras.at(0).camera.params(), (std::vector<double>{64, 64, 23.5, 31.5}));
  EXPECT_EQ(LoadGrey(run, run.images.at(4)).size(), cv::Size(48, 64));
  EXPECT_EQ(TopOf(run, run.images[4]), Eigen::Vector3d(0, -1, 0));
  EXPECT_THAT(Warnings(run),
              HasSubstr("EXIF states focal lengths from 32 px (images/b.jpg) to 64 px (images/c.jpg), but one lens"));
}

TEST_F(SiteTest, TakesTheCameraFromExifOrACalibration) {
  std::filesystem::remove(dir_ / "runs/run1/camchain.yaml");
  const BodyCamera guess = ReadOne().cameras.at(0);  // the images say better later
  EXPECT_EQ(guess.camera.params(), (std::vector<double>{0.8 * 64, 0.8 * 64, 31.5, 23.5}));
  EXPECT_EQ(guess.focal_sigma_share, 0.4);
  for (int i = 1; i <= 2; ++i) Picture("runs/run1/images/" + std::to_string(i) + ".jpg");
  Exif("runs/run1/images/1.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", "36"}});
  Write("runs/run1/images.txt", "1 images/1.jpg\n2 images/2.jpg\n");
  trigpoint::Run run = ReadOne();
  EXPECT_EQ(run.cameras.at(0).camera.params(), (std::vector<double>{64, 64, 31.5, 23.5}));
  EXPECT_FALSE(run.cameras[0].has_extrinsics);
  EXPECT_THAT(Warnings(run), HasSubstr("the focal length begins with the EXIF of 1.jpg"));
  // A calibration of the project has the lens, the run's own file says where the camera sits.
  Write("runs/run1/camchain.yaml", std::string("cam0:\n") + kCamera + "  readout_s: 0.02\n");
  Write("runs/run1/run.yaml", "camera: wide\n");
  Write("results/calibrate/wide/camchain.yaml",
        "cam0:\n  camera_model: pinhole\n  intrinsics: [70, 70, 31, 23]\n  resolution: [64, 48]\n");
  run = ReadOne();
  EXPECT_EQ(run.cameras.at(0).camera.params()[0], 70);
  EXPECT_TRUE(run.cameras[0].has_extrinsics);
  EXPECT_EQ(run.cameras[0].readout_s, 0.02);
}

TEST_F(SiteTest, SeesA360CameraAsItsViews) {
  for (int i = 1; i <= 4; ++i) Picture("runs/run1/images/" + std::to_string(i) + ".png", 64, 32);
  Write("runs/run1/camchain.yaml",
        "cam0:\n  camera_model: equirectangular\n  resolution: [64, 32]\n"
        "  T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1]]\n");
  Picture("runs/run1/mask.png", 64, 32);
  cv::Mat mask(32, 64, CV_8U, cv::Scalar(255));
  mask.colRange(28, 36).setTo(0);  // what is straight ahead
  cv::imwrite((dir_ / "runs/run1/mask.png").string(), mask);
  Write("runs/run1/run.yaml", "masks: mask.png\n");
  const trigpoint::Run run = ReadOne();
  EXPECT_EQ(Warnings(run), "");
  ASSERT_EQ(run.cameras.size(), 5u);
  ASSERT_EQ(run.images.size(), 20u);
  EXPECT_EQ(run.images[0].file, "images/1.png");
  EXPECT_EQ(run.images[2].file, "images/1.png#cam0_144");
  EXPECT_EQ(PictureOf(run, run.images[2]), "images/1.png");
  const Eigen::Vector3d ahead = run.cameras[0].cam_from_body.Inverse() * Eigen::Vector3d(0, 0, 1);
  EXPECT_LT((ahead - Eigen::Vector3d(1, 0, 1.5)).norm(), 1e-12);
  for (int k = 0; k < 5; ++k) {
    const BodyCamera& view = run.cameras[static_cast<size_t>(k)];
    EXPECT_EQ(view.camera.model(), CameraModel::kPinhole);
    EXPECT_EQ(view.IsFurtherView(), k > 0);
    const Rigid3d body_from_view = view.cam_from_body.Inverse();
    EXPECT_LT((body_from_view.translation - Eigen::Vector3d(0, 0, 1.5)).norm(), 1e-12) << "one centre";
    // To the right is clockwise.
    const double heading = -72 * k * kDegToRad;
    const Eigen::Vector3d axis = body_from_view.rotation * Eigen::Vector3d::UnitZ();
    EXPECT_LT((axis - Eigen::Vector3d(std::cos(heading), std::sin(heading), 0)).norm(), 1e-12) << k;
    const cv::Mat picture = LoadGrey(run, run.images[static_cast<size_t>(k)]);
    EXPECT_EQ(picture.cols, view.camera.width());
    const int ignored = cv::countNonZero(RunMasks(run).Of(run.images[static_cast<size_t>(k)]) == 0);
    EXPECT_EQ(ignored > 0, k == 0) << k;
  }
  EXPECT_EQ(LoadColour(run, run.images[1]).channels(), 3);
  Picture("runs/run1/images/1.png", 80, 40);
  EXPECT_THAT(MessageOf<InputError>([&] { LoadGrey(run, run.images[1]); }), HasSubstr("expected a picture of 64 x 32"));
}

TEST_F(SiteTest, Knows360PicturesByWhatTheyState) {
  std::filesystem::remove(dir_ / "runs/run1/camchain.yaml");
  for (int i = 1; i <= 2; ++i) Picture("runs/run1/images/" + std::to_string(i) + ".jpg", 64, 32);
  Write("runs/run1/images.txt", "1 images/1.jpg\n2 images/2.jpg\n");
  trigpoint::Run run = ReadOne();
  EXPECT_EQ(run.cameras.size(), 1u);
  EXPECT_THAT(Warnings(run), HasSubstr("write 'camera: equirectangular' into run.yaml"));
  Write("runs/run1/run.yaml", "camera: equirectangular\n");
  run = ReadOne();
  EXPECT_EQ(Warnings(run), "");
  EXPECT_EQ(run.cameras.size(), 5u);
  EXPECT_EQ(run.cameras[0].focal_sigma_share, 0) << "a 360 picture is calibrated by its kind";
  Write("runs/run1/run.yaml", "");
  const auto image = Exiv2::ImageFactory::open((dir_ / "runs/run1/images/1.jpg").string());
  image->readMetadata();
  image->xmpData()["Xmp.GPano.ProjectionType"] = "equirectangular";
  image->writeMetadata();
  EXPECT_EQ(ReadOne().cameras.size(), 5u);
  Write("runs/run1/camchain.yaml", std::string("cam0:\n") + kCamera);
  Write("runs/run1/run.yaml", "camera: equirectangular\n");
  EXPECT_THAT(MessageOf<InputError>([&] { ReadOne(); }), HasSubstr("camchain.yaml has camera 'cam0' of another model"));
  Write("runs/run1/camchain.yaml", "cam0:\n  camera_model: equirectangular\n  resolution: [64, 48]\n");
  EXPECT_THAT(MessageOf<InputError>([&] { ReadOne(); }), HasSubstr("twice as wide as high"));
}

TEST_F(SiteTest, APictureBelongsToOneReference) {
  Picture("panoramas/a.jpg", 64, 32);
  Write("panoramas.csv", "file\npanoramas/a.jpg\npanoramas/../panoramas/a.jpg\n");
  const Site site = ReadSite(dir_.path());
  ASSERT_EQ(site.references.size(), 1u);
  EXPECT_EQ(site.references[0].name, "panoramas/a.jpg");
  EXPECT_THAT(Joined(site.warnings), AllOf(HasSubstr("is listed twice"), HasSubstr("'panoramas/a.jpg'")));
}

TEST_F(SiteTest, TakesTheCirclesOfADualFisheyeForTwoCameras) {
  const std::string lens =
      "  camera_model: pinhole\n  intrinsics: [15, 15, 23.5, 23.5]\n  distortion_model: equidistant\n"
      "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [48, 48]\n"
      "  T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]\n";
  Write("runs/run1/camchain.yaml",
        "front:\n" + lens + "  crop: [0, 0, 48, 48]\nback:\n" + lens + "  crop: [48, 0, 48, 48]\n");
  for (int i = 1; i <= 4; ++i) {
    cv::Mat both(48, 96, CV_8U, cv::Scalar(50));
    both.colRange(48, 96).setTo(200);
    cv::imwrite((dir_ / ("runs/run1/images/" + std::to_string(i) + ".png")).string(), both);
  }
  const trigpoint::Run run = ReadOne();
  EXPECT_EQ(Warnings(run), "");
  ASSERT_EQ(run.images.size(), 8u);
  EXPECT_EQ(run.images[0].file, "images/1.png");
  EXPECT_EQ(run.images[1].file, "images/1.png#back");
  EXPECT_EQ(run.images[1].camera, 1);
  EXPECT_FALSE(run.cameras[1].IsFurtherView()) << "a lens has a pose of its own";
  EXPECT_EQ(cv::mean(LoadGrey(run, run.images[0]))[0], 50);
  EXPECT_EQ(cv::mean(LoadGrey(run, run.images[1]))[0], 200);
  const cv::Mat mask = RunMasks(run).Of(run.images[1]);
  EXPECT_EQ(mask.at<uint8_t>(0, 0), 0) << "outside the circle";
  EXPECT_EQ(mask.at<uint8_t>(24, 24), 255);
  Picture("runs/run1/masks/1.png", 48, 48);
  Write("runs/run1/run.yaml", "masks: {back: masks}\n");
  EXPECT_EQ(Warnings(ReadOne()), "") << "both lenses see every picture";
  Write("runs/run1/run.yaml", "");
  Picture("runs/run1/images/1.png");
  EXPECT_THAT(MessageOf<InputError>([&] { LoadGrey(run, run.images[1]); }),
              HasSubstr("expected a picture of at least 96 x 48 for the crop of camera 'back', found 64 x 48"));
  Write("runs/run1/camchain.yaml", "front:\n" + lens + "  crop: [0, 0, 40, 48]\n");
  EXPECT_THAT(MessageOf<InputError>([&] { ReadOne(); }), HasSubstr("with the size of resolution, 48 x 48"));
}

TEST_F(SiteTest, ReadsPanoramasFromTheTable) {
  Picture("panoramas/a.jpg", 64, 32);
  Picture("panoramas/b \xC3\xBC.jpg", 64, 32);
  Write("panoramas/zero.jpg", "");
  Write("panoramas.csv",
        "file,station,latitude_deg,longitude_deg,height_m,heading_deg,pitch_deg,roll_deg,sigma_h_m,sigma_tilt_deg\n"
        "panoramas/a.jpg,S1,-48,170,,90,,,0.3,\n"  // another continent is none of the reader's business
        "\"panoramas/b \xC3\xBC.jpg\",,,,,,,,,\n"
        "panoramas/a.jpg,S2,48,8,240,0,0,0,1,1\npanoramas/none.jpg,S3,48,8,240,0,0,0,1,1\n"
        "panoramas/zero.jpg,S3,48,8,240,0,0,0,1,1\npanoramas/a.jpg,S1,48,,240,0,0,0,1,1\n"
        "panoramas/a.jpg,S1,97,8,240,0,0,0,1,1\npanoramas/a.jpg,S1,48,8,240,0,0,0,0,1\n");
  const Site site = Read();
  ASSERT_EQ(site.references.size(), 2u);
  const GeoTag& tag = site.references[0].geotag;
  EXPECT_TRUE(tag.has_position && !tag.has_height && tag.has_heading && !tag.has_tilt);
  EXPECT_EQ(tag.position.latitude_deg, -48);
  EXPECT_EQ(tag.sigma_h_m, 0.3);
  EXPECT_EQ(tag.sigma_v_m, GeoTag().sigma_v_m);
  EXPECT_NEAR(tag.attitude.heading_rad, M_PI / 2, 1e-12);
  EXPECT_EQ(site.references[1].station, "panoramas/b \xC3\xBC.jpg");
  EXPECT_FALSE(site.references[1].geotag.has_position);
  const std::string warnings = Joined(site.warnings);
  EXPECT_THAT(warnings, HasSubstr("no geotag, neither in a table nor in its EXIF"));
  EXPECT_THAT(warnings, HasSubstr("panoramas.csv:4: panorama 'panoramas/a.jpg' stands in the table twice"));
  EXPECT_THAT(warnings, HasSubstr("panoramas.csv:5: there is no file"));
  EXPECT_THAT(warnings, HasSubstr("zero.jpg is empty (0 bytes)"));
  EXPECT_THAT(warnings, HasSubstr("panoramas.csv:7: expected both latitude_deg and longitude_deg"));
  EXPECT_THAT(warnings, HasSubstr("panoramas.csv:8: expected a latitude"));
  EXPECT_THAT(warnings, HasSubstr("panoramas.csv:9: column sigma_h_m: expected a sigma above 0"));
}

TEST_F(SiteTest, ReadsPanoramasFromTheirFiles) {
  Picture("panoramas/a.jpg", 64, 32);
  Picture("panoramas/b.jpg", 64, 32);
  Write("panoramas/broken.jpg", "x");
  Exif("panoramas/a.jpg", {{"Exif.GPSInfo.GPSLatitude", "48/1 0/1 36/1"},
                           {"Exif.GPSInfo.GPSLatitudeRef", "N"},
                           {"Exif.GPSInfo.GPSLongitude", "7/1 30/1 0/1"},
                           {"Exif.GPSInfo.GPSLongitudeRef", "E"}});
  const Site site = Read();
  ASSERT_EQ(site.references.size(), 2u);
  EXPECT_EQ(site.references[0].name, "panoramas/a.jpg");
  EXPECT_EQ(site.references[0].station, "a");
  EXPECT_NEAR(site.references[0].geotag.position.latitude_deg, 48.01, 1e-12);
  EXPECT_FALSE(site.references[0].geotag.has_height);
  EXPECT_THAT(Joined(site.warnings), HasSubstr("broken.jpg"));
}

TEST_F(SiteTest, ReadsPhotosAndSets) {
  Picture("references/a.png");
  Picture("references/b.jpg");
  Picture("references/c.png");
  Exif("references/b.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", "36"}});
  Write("photos.csv",
        "file,camera,latitude_deg,longitude_deg,heading_deg\nreferences/a.png,runs/run1/camchain.yaml,48,8,10\n"
        "references/b.jpg,,48,8,20\nreferences/c.png,,48,8,30\nreferences/a.png,runs/none.yaml,48,8,10\n");
  for (int i : {10, 9}) Picture("photos/around/IMG_" + std::to_string(i) + ".jpg");
  Picture("photos/lonely/IMG_1.jpg");
  Exif("photos/around/IMG_9.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", "27"}});
  const Site site = Read();
  ASSERT_EQ(site.references.size(), 3u);
  EXPECT_EQ(site.references[0].kind, ReferenceKind::kPhoto);
  EXPECT_EQ(site.references[0].camera->params()[0], 60);
  EXPECT_EQ(site.references[1].camera->params()[0], 64);
  EXPECT_EQ(site.references[2].kind, ReferenceKind::kPhotoSet);
  EXPECT_EQ(site.references[2].name, "around");
  EXPECT_THAT(site.references[2].files,
              ElementsAre(dir_ / "photos/around/IMG_9.jpg", dir_ / "photos/around/IMG_10.jpg"));
  EXPECT_EQ(site.references[2].camera->params()[0], 48);
  const std::string warnings = Joined(site.warnings);
  EXPECT_THAT(warnings, HasSubstr("photos.csv:4: no camera is given and the photo's EXIF states no focal length"));
  EXPECT_THAT(warnings, HasSubstr("photos.csv:5: column camera: "));
  EXPECT_THAT(warnings, HasSubstr("none.yaml: there is no such file"));
  EXPECT_THAT(warnings, HasSubstr("lonely: a hand-held set needs at least two photos, found 1"));
}

TEST_F(SiteTest, LeavesOutPlacesFarFromTheSite) {
  Picture("a.png", 64, 32);
  Picture("b.png", 64, 32);
  Picture("c.png", 64, 32);
  const std::string header = "file,latitude_deg,longitude_deg,height_m\n";
  const std::string right = "a.png,48.01,7.83,240\nb.png,48.0101,7.8301,240\n";
  const auto positions = [](const Site& site) {
    return std::count_if(site.references.begin(), site.references.end(),
                         [](const Reference& reference) { return reference.geotag.has_position; });
  };
  Write("panoramas.csv", header + right + "c.png,7.83,48.01,240\n");
  Site site = Read();
  EXPECT_EQ(positions(site), 2) << "the one that differs from the others";
  EXPECT_THAT(Joined(site.warnings), HasSubstr("1 of 3 geotags of panoramas and photos are not used"));
  EXPECT_THAT(Joined(site.warnings), HasSubstr("exchange the two columns"));
  Write("panoramas.csv", header + "a.png,7.83,48.01,240\nb.png,7.8301,48.0101,240\n");
  EXPECT_EQ(positions(Read()), 2) << "nothing to compare with";
  Write("origin.json", "{\"lat\": 48.0, \"lon\": 7.8, \"alt\": 240}");
  site = Read();
  EXPECT_EQ(positions(site), 0);
  EXPECT_THAT(Joined(site.warnings), HasSubstr("km from origin.json"));
  EXPECT_THAT(Joined(site.warnings), HasSubstr("exchange the two columns"));
  Write("panoramas.csv", header + right + "c.png,0,0,0\n");
  Write("runs/run1/gps.csv", "timestamp_s,latitude_deg,longitude_deg\n1,0,0\n2,48.01,7.83\n3,12,7.83\n");
  Write("control_points.csv", "tag_id,latitude_deg,longitude_deg,height_m\n1,48.01,7.83,240\n2,7.83,48.01,240\n");
  site = Read();
  EXPECT_EQ(positions(site), 2);
  EXPECT_EQ(site.runs[0].gps.size(), 1u);
  EXPECT_EQ(site.control_points.size(), 1u);
  EXPECT_THAT(Joined(site.warnings), HasSubstr("1 of 3 geotags of panoramas and photos state latitude 0, longitude 0"));
  EXPECT_THAT(Warnings(site.runs[0]), HasSubstr("1 of 3 GPS fixes of run run1 state latitude 0, longitude 0"));
  EXPECT_THAT(Warnings(site.runs[0]), HasSubstr("1 of 2 GPS fixes of run run1 are not used"));
}

TEST_F(SiteTest, ReadsStationsInBothForms) {
  Write("stations.csv",
        "station,tag_id,east_m,north_m,up_m,right_m,out_m,sigma_m\nA,5,1,2,3,,,0.02\nB,6,,,3,1,2,\n"
        "C,7,1,2,3,1,2,\nD,-8,1,2,3,,,\nA,9,1,2,3,,,\nE,9,1,,3,,,\n");
  const Site site = Read();
  ASSERT_EQ(site.stations.size(), 2u);
  EXPECT_FALSE(site.stations[0].in_tag_frame);
  EXPECT_TRUE(site.stations[1].in_tag_frame);
  EXPECT_EQ(site.stations[1].offset_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(site.stations[0].sigma_m, 0.02);
  EXPECT_EQ(site.stations[1].sigma_m, 0.01);
  EXPECT_EQ(site.warnings.size(), 4u);
}

TEST_F(SiteTest, ReadsControlInUtmOnEtrs89) {
  Write("control_points.csv",
        "tag_id,role,crs,easting_m,northing_m,height_m\n6,check,EPSG:25832,412733.5,5318057.3,240\n");
  const Site site = Read();
  ASSERT_EQ(site.control_points.size(), 1u);
  const Utm utm = UtmFromGeodetic(*site.control_points[0].geodetic, 32);
  EXPECT_NEAR(utm.easting_m, 412733.5, 1e-3);
  EXPECT_NEAR(utm.northing_m, 5318057.3, 1e-3);
}

TEST_F(SiteTest, ReadsControlPointsInEveryForm) {
  Write("control_points.csv",
        "tag_id,corner,point,role,latitude_deg,longitude_deg,height_m,crs,easting_m,northing_m,x_m,y_m,z_m,sigma_h_m,"
        "height_system\n"
        "5,,,control,48.01,7.83,240,,,,,,,0.008,\n"
        "6,3,,check,,,240,EPSG:32632,412733.5,5318057.3,,,,,\n"
        ",,bench,control,,,,,,,1,2,3,,\n"
        "7,,,control,,,240,EPSG:4326,7.83,48.01,,,,,\n"
        "8,,,control,,,240,EPSG:99999,3412733,5318057,,,,,\n"
        "9,,,control,48,8,,,,,,,,,\n"
        "9,,x,control,48,8,1,,,,,,,,\n"
        "9,4,,control,48,8,1,,,,,,,,\n"
        "9,,,contrl,48,8,1,,,,,,,,\n"
        "9,,,control,48,8,1,,,,1,2,3,,\n"
        "5,,,check,48.01,7.83,240,,,,,,,0.008,\n");
  const Site site = Read();
  ASSERT_EQ(site.control_points.size(), 4u);
  EXPECT_TRUE(site.control_points[0].control);
  EXPECT_EQ(site.control_points[0].sigma_h_m, 0.008);
  EXPECT_EQ(site.control_points[1].corner, 3);
  EXPECT_FALSE(site.control_points[1].control);
  const Utm utm = UtmFromGeodetic(*site.control_points[1].geodetic, 32);
  EXPECT_NEAR(utm.easting_m, 412733.5, 1e-6);
  EXPECT_NEAR(utm.northing_m, 5318057.3, 1e-6);
  EXPECT_EQ(site.control_points[2].point, "bench");
  EXPECT_EQ(*site.control_points[2].local_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(site.control_points[3].geodetic->latitude_deg, 48.01);
  const std::string warnings = Joined(site.warnings);
  EXPECT_THAT(warnings, HasSubstr("control_points.csv:6: column crs: expected a coordinate reference system"));
  EXPECT_THAT(warnings, HasSubstr("control_points.csv:7: column height_m: expected a number, found ''"));
  EXPECT_THAT(warnings, HasSubstr("control_points.csv:8: expected either a tag_id or a point"));
  EXPECT_THAT(warnings, HasSubstr("control_points.csv:10: column role: expected control or check, found 'contrl'"));
  EXPECT_THAT(warnings, HasSubstr("control_points.csv:11: expected one position"));
  EXPECT_THAT(warnings, HasSubstr("control_points.csv:12: the same point as at "));
}

TEST_F(SiteTest, ReadsControlInAnySystemAndUnit) {
  // LV95's origin is the old observatory in Bern: 46 57 03.898 N, 7 26 19.077 E of WGS 84 (swisstopo's own formulas).
  // State plane coordinates in US survey feet and the same in metres are one place.
  Write("control_points.csv",
        "tag_id,role,crs,easting_m,northing_m,height_m,unit,height_unit,x_m,y_m,z_m\n"
        "1,control,EPSG:2056,2600000,1200000,500,,,,,\n"
        "2,control,2263,987654.3,212345.6,100,us-ft,,,,\n"
        "3,control,EPSG:2263,301037.632715,64723.068326,30.48006096,m,,,,\n"
        "4,control,EPSG:2263,301037.632715,64723.068326,30.48006096,,,,,\n"
        "5,control,EPSG:2263,987654.3,212345.6,30.48006096,us-ft,m,,,\n"
        "6,control,+proj=utm +zone=32 +datum=WGS84 +units=ft,1354110.236,17447693.57,240,ft,m,,,\n"
        "7,control,,,,,ft,,10,20,30\n"
        "8,control,EPSG:2056,2600000,1200000,500,yd,,,,\n"
        "9,control,nonsense,2600000,1200000,500,,,,,\n");
  std::vector<std::string> warnings;
  const std::vector<ControlPoint> points = ReadControlPoints(dir_ / "control_points.csv", &warnings);
  const std::string told = Joined(warnings);
  ASSERT_EQ(points.size(), 6u) << told;
  EXPECT_NEAR(points[0].geodetic->latitude_deg, 46 + 57 / 60.0 + 3.898 / 3600, 2e-6);
  EXPECT_NEAR(points[0].geodetic->longitude_deg, 7 + 26 / 60.0 + 19.077 / 3600, 2e-6);
  EXPECT_NEAR(points[0].geodetic->height_m, 500, 1e-6);  // above the ellipsoid of WGS 84, not above Bessel's
  for (const size_t other : {2u, 3u}) {
    EXPECT_LT((EcefFromGeodetic(*points[1].geodetic) - EcefFromGeodetic(*points[other].geodetic)).norm(), 1e-4);
  }
  EXPECT_NEAR(points[1].geodetic->height_m, 100 * 1200.0 / 3937.0, 1e-6);
  const Utm utm = UtmFromGeodetic(*points[4].geodetic, 32);
  EXPECT_NEAR(utm.easting_m, 1354110.236 * 0.3048, 1e-4);
  EXPECT_NEAR(utm.northing_m, 17447693.57 * 0.3048, 1e-4);
  EXPECT_NEAR((*points[5].local_m - Eigen::Vector3d(3.048, 6.096, 9.144)).norm(), 0, 1e-12);
  EXPECT_THAT(
      told, HasSubstr("EPSG:2263 (NAD83 / New York Long Island (ftUS)): its transformation to WGS 84 is good to 4 m"));
  EXPECT_THAT(told, HasSubstr("control_points.csv:5: the unit of EPSG:2263"));
  EXPECT_THAT(told, HasSubstr("column unit: expected m, ft or us-ft, found 'yd'"));
  EXPECT_THAT(told, HasSubstr("found 'nonsense', which PROJ does not know"));
}

// A grid of PROJ's own form over latitude 47 to 49, longitude 7 to 9: the geoid rises by 1 m a degree to the north.
std::string SmallGrid() {
  std::string grid;
  const auto big_endian = [&](const auto value) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    std::reverse(bytes.begin(), bytes.end());
    grid += bytes;
  };
  for (const double header : {47.0, 7.0, 1.0, 1.0}) big_endian(header);
  for (const int32_t size : {3, 3}) big_endian(size);
  for (const float undulation : {47.f, 47.f, 47.f, 48.f, 48.f, 48.f, 49.f, 49.f, 49.f}) big_endian(undulation);
  return grid;
}

TEST_F(SiteTest, ConvertsHeightsAboveAGeoidThatIsThere) {
  Write("small.gtx", SmallGrid());
  Write("control_points.csv",
        "tag_id,role,latitude_deg,longitude_deg,height_m,crs,easting_m,northing_m,height_system\n"
        "1,control,48.25,7.83,240,,,,small.gtx\n"
        "2,control,48.25,7.83,240,,,,\n"
        "3,control,,,240,EPSG:32632,412733.5,5344057.3,small.gtx\n"
        "4,control,51,7.83,240,,,,small.gtx\n"
        "5,control,,,240,EPSG:4326+5773,7.83,48.25,small.gtx\n");
  std::vector<std::string> warnings;
  const std::vector<ControlPoint> points = ReadControlPoints(dir_ / "control_points.csv", &warnings);
  const std::string told = Joined(warnings);
  ASSERT_EQ(points.size(), 3u) << told;
  EXPECT_NEAR(points[0].geodetic->height_m, 240 + 48.25, 1e-6);
  EXPECT_EQ(points[0].height_system, "small.gtx");
  EXPECT_EQ(points[1].geodetic->height_m, 240);
  EXPECT_NEAR(points[2].geodetic->height_m, 240 + points[2].geodetic->latitude_deg, 1e-6);
  EXPECT_THAT(told, HasSubstr("lies outside the grid small.gtx"));
  EXPECT_THAT(told, HasSubstr("contradicts the crs, which has heights of its own"));
}

TEST_F(SiteTest, HeightsAboveWhatIsNotKnownAreNotMixedWithOthers) {
  const std::string header = "tag_id,role,latitude_deg,longitude_deg,height_m,height_system\n";
  const std::string alike = "1,control,48.01,7.83,240,DHHN2016\n2,control,48.01,7.831,241,DHHN2016\n";
  Write("control_points.csv", header + alike);
  std::vector<std::string> warnings;
  std::vector<ControlPoint> points = ReadControlPoints(dir_ / "control_points.csv", &warnings);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].geodetic->height_m, 240);
  EXPECT_THAT(Joined(warnings), HasSubstr("heights above 'DHHN2016' are kept as they are: the geoid is not known"));
  Write("control_points.csv", header + alike + "3,control,48.01,7.832,288,\n4,control,48.01,7.83,240,no_such.gtx\n");
  warnings.clear();
  points = ReadControlPoints(dir_ / "control_points.csv", &warnings);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].tag_id, 3);
  EXPECT_THAT(Joined(warnings), HasSubstr("3 points are skipped: their height_system is not known"));
  EXPECT_THAT(Joined(warnings), HasSubstr("projsync --file no_such.gtx"));
}

TEST_F(SiteTest, ReadsTagsAndOrigin) {
  Write("tags.yaml", "family: tag36h11\nsize_m: 0.5\nsizes_m: {7: 0.25}\n");
  Write("origin.json", "{\"lat\": 48.5, \"lon\": 8, \"alt\": 240}");
  const Site site = Read();
  EXPECT_EQ(site.tags.SizeOf(7), 0.25);
  EXPECT_EQ(site.tags.SizeOf(8), 0.5);
  EXPECT_EQ(site.origin->latitude_deg, 48.5);
  const auto with = [&](const std::string& name, const std::string& text) {
    Write(name, text);
    return Refusal();
  };
  EXPECT_THAT(with("origin.json", "{\"lat\": \"48\", \"lon\": 8}"),
              HasSubstr("key 'lat': expected a number, found \"48\""));
  EXPECT_THAT(with("origin.json", "{\"lat\": 48, \"lone\": 8}"),
              HasSubstr("unknown key 'lone'; nearest known key: 'lon'"));
  EXPECT_THAT(with("origin.json", "{\"lat\": 48, \"latitude\": 8, \"lon\": 8}"), HasSubstr("keep one"));
  Write("origin.json", "{\"latitude\": 48.5, \"lng\": 8, \"altitude\": 240}");
  EXPECT_EQ(Read().origin->height_m, 240);
  EXPECT_THAT(with("origin.json", "{lat: 48"), HasSubstr("expected JSON"));
  EXPECT_THAT(with("origin.json", "{\"lat\": 98, \"lon\": 8}"), HasSubstr("expected a latitude"));
  std::filesystem::remove(dir_ / "origin.json");
  Write("tags.yaml", "family: tag36h11\nfamilies: {7: tag16h5, 9: tag25h9}\nsize_m: 0.5\n");
  EXPECT_EQ(Read().tags.family, "tag36h11,tag16h5:7,tag25h9:9");
  EXPECT_THAT(with("tags.yaml", "families: {7: tag16h6}\n"), HasSubstr("nearest known: 'tag16h5'"));
  EXPECT_THAT(with("tags.yaml", "families:\n  7: tag16h5\n  07: tag25h9\n"),
              AllOf(HasSubstr("tags.yaml:3: "), HasSubstr("tag 7 is listed on line 2, too")));
  EXPECT_THAT(with("tags.yaml", "families:\n  7: tag16h5\n  8: tag16h5\n  7: tag25h9\n"),
              AllOf(HasSubstr("tags.yaml:4: "), HasSubstr("stands twice, first on line 2")));
  EXPECT_THAT(with("tags.yaml", "families: {x: tag16h5}\n"), HasSubstr("expected 'ID: FAMILY'"));
  EXPECT_THAT(with("tags.yaml", "family: tag36h12\n"), HasSubstr("nearest known: 'tag36h11'"));
  EXPECT_THAT(with("tags.yaml", "size_m: big\n"), HasSubstr("tags.yaml:1: key 'size_m': expected a number"));
  EXPECT_THAT(with("tags.yaml", "sizes_m: {x: 1}\n"), HasSubstr("expected 'ID: SIZE'"));
  EXPECT_THAT(with("tags.yaml", "size: 1\n"), HasSubstr("nearest known key: 'size_m'"));
}

TEST_F(SiteTest, PanoramasThatMustNotBeKeptAreForgotten) {
  const std::string header = "# mine\nfile,latitude_deg,longitude_deg,keep_until\n";
  const std::string own = "panoramas/a.jpg,48.01,7.83,\n",
                    later = "panoramas/google-b.jpg,48.01,7.83,2026-05-12T10:00:00Z\n",
                    over = "panoramas/google-c.jpg,48.01,7.83,2026-05-12T09:00:00Z\n";
  for (const char* name : {"panoramas/a.jpg", "panoramas/google-b.jpg", "panoramas/google-c.jpg"}) Write(name, "x");
  Write("panoramas.csv", header + own + later + over);
  Write("results/replaced/2026-panoramas.csv", header + over);
  const int64_t half_past_nine = *ParseUtcToNs("2026-05-12T09:30:00Z") / 1'000'000'000;
  // What kills left of pictures being written; one is being written now.
  const std::vector<const char*> old = {"panoramas/.google-c.jpg.12-3-4", "panoramas/.mine.jpg.bak",
                                        ".panoramas.csv.12-3-6", "results/replaced/.2026-panoramas.csv.12-3-7"};
  Write("panoramas/.google-b.jpg.12-3-5", "x");
  for (const char* name : old) {
    Write(name, "x");
    std::filesystem::last_write_time(dir_ / name,
                                     std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  }
  EXPECT_EQ(ForgetExpiredPanoramas(dir_ / ".", half_past_nine - 3600), 0);
  for (const char* name : {old[0], old[2], old[3]}) EXPECT_FALSE(std::filesystem::exists(dir_ / name)) << name;
  EXPECT_TRUE(std::filesystem::exists(dir_ / "panoramas/.google-b.jpg.12-3-5"));
  EXPECT_TRUE(std::filesystem::exists(dir_ / "panoramas/.mine.jpg.bak"));
  EXPECT_EQ(ForgetExpiredPanoramas(dir_ / ".", half_past_nine), 1);
  EXPECT_EQ(ReadTextFile(dir_ / "panoramas.csv"), header + own + later);
  EXPECT_TRUE(std::filesystem::exists(dir_ / "panoramas/google-b.jpg"));
  EXPECT_FALSE(std::filesystem::exists(dir_ / "panoramas/google-c.jpg"));
  EXPECT_FALSE(std::filesystem::exists(dir_ / "results/replaced/2026-panoramas.csv"));
  const auto kept = [&] {
    std::string text;
    for (const auto& entry : std::filesystem::directory_iterator(dir_ / "results/replaced")) {
      text += ReadTextFile(entry.path());
    }
    return text;
  };
  EXPECT_EQ(kept(), header + own + later + over);
  EXPECT_EQ(ForgetExpiredPanoramas(dir_ / ".", half_past_nine), 0);
  EXPECT_EQ(kept(), header + own + later);
  EXPECT_FALSE(IsOver("9999-12-31T23:59:59Z"));
  EXPECT_FALSE(IsOver("soon"));
  // A table of others, and one that cannot be read, are left as they are.
  Write("panoramas.csv", "keep_until\nx\n");
  EXPECT_EQ(ForgetExpiredPanoramas(dir_ / ".", half_past_nine), 0);
  EXPECT_EQ(ReadTextFile(dir_ / "panoramas.csv"), "keep_until\nx\n");
}

// Rows may name any file, as others may have made the table.
TEST_F(SiteTest, OnlyPicturesOfAnImportAreForgotten) {
  const std::filesystem::path outside = dir_ / "outside";
  std::filesystem::create_directories(outside);
  Write("outside/google-a.jpg", "theirs");
  Write("panoramas/google-kept.jpg", "x");
  std::filesystem::create_directory_symlink(outside, dir_ / "link");
  std::filesystem::create_symlink(outside / "google-a.jpg", dir_ / "panoramas/google-link.jpg");
  for (const char* name :
       {"trigpoint.yaml", "panoramas/mine.jpg", "panoramas/google-kept.jpg", "panoramas/sub/google-d.jpg"}) {
    Write(name, "x");
  }
  const std::string over = ",2026-05-12T09:00:00Z\n", header = "file,keep_until\n";
  std::string table = header;
  for (const char* name : {"trigpoint.yaml", "link/google-a.jpg", "panoramas/google-link.jpg", "panoramas/mine.jpg",
                           "panoramas/sub/google-d.jpg", "panoramas/../trigpoint.yaml"}) {
    table += name + over;
  }
  table += "./panoramas/google-kept.jpg,2099-05-12T09:00:00Z\n";
  Write("panoramas.csv", table);
  Write("results/replaced/2025-panoramas.csv", header + "panoramas/google-kept.jpg" + over);
  EXPECT_EQ(ForgetExpiredPanoramas(dir_ / "."), 0);
  EXPECT_EQ(ReadTextFile(dir_ / "panoramas.csv"), table);
  EXPECT_FALSE(std::filesystem::exists(dir_ / "results/replaced/2025-panoramas.csv"));
  for (const char* name : {"outside/google-a.jpg", "trigpoint.yaml", "panoramas/google-link.jpg", "panoramas/mine.jpg",
                           "panoramas/google-kept.jpg", "panoramas/sub/google-d.jpg"}) {
    EXPECT_TRUE(std::filesystem::exists(dir_ / name)) << name;
  }
  // A folder of panoramas that is linked in is its owner's.
  std::filesystem::remove_all(dir_ / "panoramas");
  std::filesystem::create_directory_symlink(outside, dir_ / "panoramas");
  Write("panoramas.csv", header + "panoramas/google-a.jpg" + over);
  EXPECT_EQ(ForgetExpiredPanoramas(dir_ / "."), 0);
  EXPECT_TRUE(std::filesystem::exists(outside / "google-a.jpg"));
}

TEST(CaptureDate, GapsAreExplained) {
  EXPECT_EQ(ExplainGap("2019-01", "2026-05-12"), "taken 2019-01, 7.3 years before the run, in another season");
  EXPECT_EQ(ExplainGap("2026-05-01T10:00:00Z", "2026-05-12"), "");
  EXPECT_EQ(ExplainGap("2026-01-05", "2026-05-12"), "taken 2026-01, in another season");
  EXPECT_EQ(ExplainGap("2028-05", "2026-05-12"), "taken 2028-05, 2.0 years after the run");
  for (const char* unknown : {"", "2019", "soon", "2019-99"})
    EXPECT_EQ(ExplainGap(unknown, "2026-05-12"), "") << unknown;
  // The turn of the year lies within a season.
  EXPECT_NEAR(GapBetween("2025-12-25", "2026-01-04")->season_days, 10, 1e-6);
  trigpoint::Run run;
  EXPECT_EQ(DateOfRun(run), "");
  run.images.resize(1);
  run.images[0].stamp_ns = 5'000'000'000;
  EXPECT_EQ(DateOfRun(run), "");
  run.config.time_zero_utc_ns = *ParseUtcToNs("2026-05-12T23:59:58Z");
  EXPECT_EQ(DateOfRun(run), "2026-05-13");
  run.config.date = "2026-05-12";
  EXPECT_EQ(DateOfRun(run), "2026-05-12");
}

TEST_F(SiteTest, GpsHeightsThatCannotBeRight) {
  Write("origin.json", "{\"lat\": 48.0, \"lon\": 7.8, \"alt\": 240}");
  const auto with = [&](const std::string& height) {
    const std::string column = height.empty() ? "" : ",height_m,sigma_v_m",
                      row = height.empty() ? "" : "," + height + ",2";
    Write("runs/run1/gps.csv",
          "timestamp_s,latitude_deg,longitude_deg" + column + "\n1,48.0001,7.8" + row + "\n3,48.0002,7.8" + row + "\n");
    const Site site = Read();
    return GpsHeightContradiction(site, site.runs.at(0));
  };
  EXPECT_EQ(with("243"), "");
  EXPECT_EQ(with(""), "") << "no heights";
  EXPECT_THAT(with("192"), HasSubstr("the heights of GPS fixes of run run1 (median 192 m) differ from that of origin"));
  EXPECT_THAT(with("192"), HasSubstr("above the sea"));
  Write("control_points.csv", "tag_id,latitude_deg,longitude_deg,height_m\n1,48.0001,7.8,195\n");
  EXPECT_EQ(with("192"), "") << "control is nearer than the origin";
  Write("control_points.csv", "tag_id,latitude_deg,longitude_deg,height_m\n1,48.0001,7.8,240\n");
  EXPECT_THAT(with("192"), HasSubstr("differ from that of control points (240 m)"));
  Picture("a.png");
  Write("panoramas.csv", "file,latitude_deg,longitude_deg,height_m\na.png,48.0001,7.8,240\n");
  EXPECT_EQ(with("192"), "") << "localize compares geotags with GPS";
}

TEST_F(SiteTest, FixesThatAReceiverRepeatsAreLeftOut) {
  const auto read = [&](const std::string& sigma, const std::string& last) {
    std::string text = "timestamp_s,latitude_deg,longitude_deg,height_m,sigma_h_m\n";
    for (const char* time : {"1", "2", "3"}) text += std::string(time) + ",48.0001,7.8,240," + sigma + "\n";
    Write("runs/run1/gps.csv", text + "4,48.0002,7.8," + last + "," + sigma + "\n");
    return ReadOne();
  };
  const trigpoint::Run held = read("0.5", "240");  // odometry moves by 1 m a second
  EXPECT_EQ(held.gps.size(), 4U) << "2 m may be noise";
  std::string odometry;
  for (int i = 1; i <= 4; ++i) odometry += std::to_string(i) + " " + std::to_string(2 * i) + " 0 0 0 0 0 1\n";
  Write("runs/run1/odometry.tum", odometry);
  const trigpoint::Run moved = read("0.5", "240");
  EXPECT_EQ(moved.gps.size(), 2U);
  EXPECT_THAT(Warnings(moved), HasSubstr("2 fixes of GPS repeat the one before"));
  EXPECT_EQ(read("3", "240").gps.size(), 4U) << "within the fixes' noise";
}

TEST_F(SiteTest, UsesNothingOfATableWithoutAGoodRow) {
  Write("stations.csv", "station,tag_id,east_m,north_m,up_m\nA,x,1,2,3\n");
  Write("control_points.csv", "plate,up,down\n1,2,3\n");
  const Site site = Read();
  EXPECT_TRUE(site.stations.empty() && site.control_points.empty());
  EXPECT_THAT(Joined(site.warnings), HasSubstr("stations.csv:2: column tag_id: expected a whole number, found 'x'"));
  EXPECT_THAT(Joined(site.warnings), HasSubstr("control_points.csv:2: expected either a tag_id or a point"));
  EXPECT_EQ(UnusedTables(dir_.path()).size(), 2u);
  Write("stations.csv", "station,tag_id,east_m,north_m,up_m\nA,1,1,2,3\n");
  Write("control_points.csv", "tag_id,x_m,y_m,z_m\n");
  Write("panoramas.csv", "files;station\np.jpg;A\n");
  Write("photos.csv", "");
  const std::string unused = Joined(UnusedTables(dir_.path()));
  EXPECT_THAT(unused, HasSubstr("control_points.csv: expected rows below the header, found none"));
  EXPECT_THAT(unused, HasSubstr("panoramas.csv:1: column 'file' is missing"));
  EXPECT_THAT(unused, HasSubstr("photos.csv: the table is empty"));
  EXPECT_EQ(unused.find("stations"), std::string::npos);
  Write("distances.csv", "from,to,distance_m\n");
  Write("control_observations.csv", "point,image,u,v\n");  // what is left where the last mark was removed
  Write("runs/a/gps.csv", "");
  Write("runs/b/gps.csv", "timestamp_s,latitude_deg,longitude_deg\n");
  Write("runs/c/gps.nmea", "not what a receiver says\n");
  const std::string more = Joined(UnusedTables(dir_.path(), {"a", "b", "c"}));
  EXPECT_THAT(more, HasSubstr("c/gps.nmea"));
  for (const char* why :
       {"distances.csv: expected rows", "a/gps.csv: the table is empty", "b/gps.csv: no usable GPS fix"}) {
    EXPECT_THAT(more, HasSubstr(why));
  }
  EXPECT_EQ(more.find("control_observations"), std::string::npos);
}

}  // namespace
}  // namespace trigpoint
