#include <gmock/gmock.h>

#include <cstdlib>
#include <exiv2/exiv2.hpp>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "datasets/import/colmap_run.h"
#include "datasets/import/panorama_provider.h"
#include "datasets/import/phone_files.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

cv::Mat Gradient(int width) {
  cv::Mat picture(width / 2, width, CV_8UC3);
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < width; ++u) {
      picture.at<cv::Vec3b>(v, u) = {cv::saturate_cast<uchar>(255.0 * u / width),
                                     cv::saturate_cast<uchar>(510.0 * v / width), 60};
    }
  }
  return picture;
}

double MeanDifference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

TEST(ImportPanoramas, WholeTilesAndFacesBecomeOneTable) {
  const TempDir dir;
  const fs::path from = dir / "street", site = dir / "site";
  fs::create_directories(from / "tiled");
  fs::create_directories(from / "cube");
  const cv::Mat whole = Gradient(512);
  cv::imwrite((from / "whole.png").string(), whole);
  cv::Mat padded = cv::Mat::zeros(300, 600, CV_8UC3);
  whole.copyTo(padded(cv::Rect(0, 0, 512, 256)));
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 4; ++x) {
      cv::imwrite((from / "tiled" / (std::to_string(x) + "_" + std::to_string(y) + ".png")).string(),
                  padded(cv::Rect(150 * x, 150 * y, 150, 150)));
    }
  }
  int grey = 20;
  for (const char* face : {"front", "right", "back", "left", "up", "down"}) {
    cv::imwrite((from / "cube" / (std::string(face) + ".png")).string(),
                cv::Mat(64, 64, CV_8UC3, cv::Scalar::all(grey)));
    grey += 40;
  }
  dir.Write("street/whole.json",
            R"({"pano_id": "whole", "location": {"lat": 48.01, "lng": 7.83}, "heading": 123.5, "date": "2024-06"})");
  dir.Write("street/more.json", R"([{"id": "tiled", "latitude": "48.0101", "longitude": 7.8301, "tilt": 91.5},
    {"id": "cube", "latitude": 48.0102, "longitude": 7.8302}, {"id": "far", "latitude": 49, "longitude": 8},
    {"id": "missing", "latitude": 48.0102, "longitude": 7.8302}, {"id": "nowhere"}, {"id": "../x", "latitude": 48, "longitude": 7}])");
  PanoramaImportOptions options;
  options.area = {{{48.01, 7.83, 0}}, 500};
  ProgressSink progress;
  const ImportReport report = ImportPanoramas(site, *OpenPanoramaFolder(from), options, progress, CancelToken());
  const std::string warnings = Joined(report.warnings);
  EXPECT_THAT(warnings, HasSubstr("nowhere has no latitude"));
  EXPECT_THAT(warnings, HasSubstr("../x"));
  EXPECT_THAT(warnings, HasSubstr("no picture of panorama missing"));
  const std::string table = ReadTextFile(site / "panoramas.csv");
  EXPECT_THAT(table, HasSubstr("panoramas/whole.jpg,whole,48.010000000,7.830000000,,123.5000,,,"));
  EXPECT_THAT(table, HasSubstr("panoramas/tiled.jpg,tiled,48.010100000,7.830100000,,,1.5000,,"));
  EXPECT_THAT(table, testing::Not(HasSubstr("far")));
  EXPECT_LT(MeanDifference(cv::imread((site / "panoramas/whole.jpg").string()), whole), 3);
  const cv::Mat tiled = cv::imread((site / "panoramas/tiled.jpg").string());
  ASSERT_EQ(tiled.cols, 600);
  EXPECT_LT(MeanDifference(tiled(cv::Rect(0, 0, 500, 250)), whole(cv::Rect(0, 0, 500, 250))), 3);
  const cv::Mat cube = cv::imread((site / "panoramas/cube.jpg").string());
  ASSERT_EQ(cube.cols, 256);
  const auto at = [&](int v, int u) { return static_cast<int>(cube.at<cv::Vec3b>(v, u)[0]); };
  EXPECT_NEAR(at(64, 128), 20, 4);    // straight ahead: the image's centre
  EXPECT_NEAR(at(64, 192), 60, 4);    // to the right
  EXPECT_NEAR(at(64, 2), 100, 4);     // behind
  EXPECT_NEAR(at(64, 64), 140, 4);    // to the left
  EXPECT_NEAR(at(2, 100), 180, 4);    // up
  EXPECT_NEAR(at(125, 100), 220, 4);  // down
  // Once more changes nothing.
  const ImportReport again = ImportPanoramas(site, *OpenPanoramaFolder(from), options, progress, CancelToken());
  EXPECT_THAT(Joined(again.lines), HasSubstr("3 of 4 panoramas, 3 of them were there already"));
  EXPECT_EQ(ReadTextFile(site / "panoramas.csv"), table);
}

// A killed import of a folder leaves pictures without a table; the next one fills their rows.
TEST(ImportPanoramas, PicturesWithoutATableGetTheirRows) {
  const TempDir dir;
  fs::create_directories(dir / "street");
  fs::create_directories(dir / "site/panoramas");
  dir.Write("street/one.json", R"({"id": "one", "lat": 48, "lng": 7, "heading": -10, "pitch": 120, "altitude": 1e7,
      "license": "CC0", "copyright": "Ann"})");
  for (const char* file : {"street/one.jpg", "site/panoramas/one.jpg"})
    cv::imwrite((dir / file).string(), Gradient(64));
  ProgressSink progress;
  const ImportReport report =
      ImportPanoramas(dir / "site", *OpenPanoramaFolder(dir / "street"), {}, progress, CancelToken());
  EXPECT_THAT(Joined(report.lines), HasSubstr("1 of them were there already"));
  EXPECT_THAT(Joined(report.warnings), HasSubstr("2 values of heading, pitch"));
  EXPECT_THAT(ReadTextFile(dir / "site/panoramas.csv"),
              AllOf(HasSubstr("panoramas/one.jpg,one,48.000000000,7.000000000,,350.0000,,,"), HasSubstr(",CC0,Ann,")));
}

// Services state the size of the picture beside its place.
TEST(ImportPanoramas, ThePicturesHeightIsNoAltitude) {
  const TempDir dir;
  fs::create_directories(dir / "street");
  dir.Write("street/list.json", R"([{"id": "size", "lat": 48, "lon": 7, "width": 8192, "height": 4096},
    {"id": "both", "lat": 48, "lon": 7, "width": 8192, "height": 4096, "height_m": 240.5},
    {"id": "place", "location": {"lat": 48, "lon": 7, "height": 241.5}, "width": 8192, "height": 4096},
    {"id": "plain", "lat": 48, "lon": 7, "height": 242.5}])");
  std::map<std::string, std::optional<double>> heights;
  for (const PanoramaRecord& record : OpenPanoramaFolder(dir / "street")->Find({{{48, 7, 0}}, 500}, CancelToken())) {
    heights[record.id] = record.has_height ? std::optional(record.position.height_m) : std::nullopt;
  }
  const std::map<std::string, std::optional<double>> expected = {
      {"size", std::nullopt}, {"both", 240.5}, {"place", 241.5}, {"plain", 242.5}};
  EXPECT_EQ(heights, expected);
}

// A failed import leaves the place as it was: not even a folder.
TEST(ImportFailures, LeaveNothing) {
  const TempDir dir;
  const fs::path site = dir / "new/site", from = dir / "street";
  ProgressSink progress;
  fs::create_directories(from / "one");
  dir.Write("street/one.json", R"({"id": "one", "latitude": 48, "longitude": 7})");
  PanoramaImportOptions options;
  EXPECT_THROW(ImportPanoramas(site, *OpenPanoramaFolder(from), options, progress, CancelToken()), InputError);
  options.area = {{{10, 10, 0}}, 1000};
  EXPECT_THROW(ImportPanoramas(site, *OpenPanoramaFolder(from), options, progress, CancelToken()), InputError);
  dir.Write("phone/a.heic", "no picture");
  EXPECT_THROW(ImportPhotos(site, dir / "phone", "corner", progress, CancelToken()), InputError);
  EXPECT_THROW(ImportOpenSfmGcp(site, dir.Write("gcp_list.txt", "WGS84\n"), from), InputError);
  EXPECT_FALSE(fs::exists(dir / "new"));
  // Ctrl-C on the way, with one picture written.
  cv::imwrite((from / "one.jpg").string(), Gradient(64));
  dir.Write("street/two.json", R"({"id": "two", "latitude": 48, "longitude": 7})");
  struct CancelAtSecond : ProgressSink {
    void Advance(int64_t) override {
      if (++steps == 2) token->Cancel();
    }
    int steps = 0;
    CancelToken* token = nullptr;
  } cancelling;
  CancelToken token;
  cancelling.token = &token;
  cv::imwrite((from / "two.jpg").string(), Gradient(64));
  dir.Write("street/x.json", R"({"id": "x", "latitude": 48, "longitude": 7})");
  EXPECT_THROW(ImportPanoramas(site, *OpenPanoramaFolder(from), {}, cancelling, token), Cancelled);
  EXPECT_FALSE(fs::exists(dir / "new"));
}

// A picture cut into faces by rays and put together again is the picture.
TEST(ImportPanoramas, FacesGoBackToTheirPlaces) {
  std::vector<cv::Mat> faces;
  const auto colour = [](const Eigen::Vector3d& d) {
    return cv::Vec3b(cv::saturate_cast<uchar>(128 + 100 * d.x()), cv::saturate_cast<uchar>(128 + 100 * d.y()),
                     cv::saturate_cast<uchar>(128 + 100 * d.z()));
  };
  const Eigen::Vector3d forward[] = {{0, 0, 1}, {1, 0, 0}, {0, 0, -1}, {-1, 0, 0}, {0, -1, 0}, {0, 1, 0}};
  const Eigen::Vector3d right[] = {{1, 0, 0}, {0, 0, -1}, {-1, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 0, 0}};
  const int n = 200;
  for (int f = 0; f < 6; ++f) {
    cv::Mat face(n, n, CV_8UC3);
    const Eigen::Vector3d down = forward[f].cross(right[f]);
    for (int v = 0; v < n; ++v) {
      for (int u = 0; u < n; ++u) {
        const Eigen::Vector3d ray = forward[f] + (2 * (u + 0.5) / n - 1) * right[f] + (2 * (v + 0.5) / n - 1) * down;
        face.at<cv::Vec3b>(v, u) = colour(ray.normalized());
      }
    }
    faces.push_back(face);
  }
  const cv::Mat panorama = AssembleFaces(faces, 800);
  const Camera camera = Camera::Equirectangular(800, 400);
  double worst = 0;
  for (int v = 0; v < 400; v += 7) {
    for (int u = 0; u < 800; u += 7) {
      const cv::Vec3b expected = colour(*camera.Unproject({double(u), double(v)}));
      for (int k = 0; k < 3; ++k)
        worst = std::max(worst, std::abs(double(expected[k]) - panorama.at<cv::Vec3b>(v, u)[k]));
    }
  }
  EXPECT_LE(worst, 4);
}

TEST(ImportPhotos, HeicBecomesJpegWithItsExif) {
  if (std::system("command -v heif-enc >/dev/null 2>&1") != 0) GTEST_SKIP() << "heif-enc is not installed";
  const TempDir dir;
  fs::create_directories(dir / "phone");
  const cv::Mat picture = Gradient(256);
  cv::imwrite((dir / "p.jpg").string(), picture, {cv::IMWRITE_JPEG_QUALITY, 98});
  {
    const auto image = Exiv2::ImageFactory::open((dir / "p.jpg").string());
    image->readMetadata();
    Exiv2::ExifData& exif = image->exifData();
    exif["Exif.Photo.FocalLengthIn35mmFilm"] = uint16_t{26};
    exif["Exif.GPSInfo.GPSLatitudeRef"] = "N";
    exif["Exif.GPSInfo.GPSLatitude"] = "48/1 0/1 36/1";
    exif["Exif.GPSInfo.GPSLongitudeRef"] = "E";
    exif["Exif.GPSInfo.GPSLongitude"] = "7/1 30/1 0/1";
    image->writeMetadata();
  }
  for (const char* name : {"IMG_1.HEIC", "IMG_2.heic"}) {
    const std::string command = "heif-enc -q 95 '" + (dir / "p.jpg").string() + "' -o '" +
                                (dir / "phone" / name).string() + "' >/dev/null 2>&1";
    if (std::system(command.c_str()) != 0) GTEST_SKIP() << "no HEVC encoder";
  }
  dir.Write("phone/IMG_3.HEIC", "no picture at all");
  ProgressSink progress;
  const ImportReport report = ImportPhotos(dir / "site", dir / "phone", "corner", progress, CancelToken());
  EXPECT_EQ(report.files.size(), 2U);
  EXPECT_THAT(Joined(report.warnings), HasSubstr("IMG_3"));
  const fs::path jpeg = dir / "site/photos/corner/IMG_1.jpg";
  EXPECT_LT(MeanDifference(cv::imread(jpeg.string()), picture), 4);
  const PhotoMetadata metadata = ReadPhotoMetadata(jpeg);
  ASSERT_TRUE(metadata.position.has_value());
  EXPECT_NEAR(metadata.position->latitude_deg, 48.01, 1e-9);
  ASSERT_TRUE(metadata.focal_px.has_value());
  EXPECT_NEAR(*metadata.focal_px, 26.0 / 36 * 256, 0.5);
}

// Phones export a photo as HEIC and as JPEG.
TEST(ImportPhotos, OfHeicAndJpegOfOneNameTheJpegIsUsed) {
  const TempDir dir;
  fs::create_directories(dir / "phone");
  for (const char* jpeg : {"IMG_1.jpg", "IMG_2.JPG", "IMG_3.jpg"})
    cv::imwrite((dir / "phone" / jpeg).string(), Gradient(64));
  for (const char* heic : {"IMG_1.HEIC", "IMG_2.heic"}) dir.Write(std::string("phone/") + heic, "not read");
  const ImportReport report = ImportPhotos(dir / "site", dir / "phone", "set", *std::make_unique<ProgressSink>(), {});
  EXPECT_THAT(report.files,
              testing::UnorderedElementsAre(dir / "site/photos/set/IMG_1.jpg", dir / "site/photos/set/IMG_2.JPG",
                                            dir / "site/photos/set/IMG_3.jpg"));
  for (const fs::path& file : report.files) {
    EXPECT_EQ(ReadTextFile(file), ReadTextFile(dir / "phone" / file.filename()));
  }
  ASSERT_EQ(report.warnings.size(), 1U);
  EXPECT_THAT(report.warnings[0], AllOf(HasSubstr("2 HEIC pictures left out"), HasSubstr("the first: IMG_1.HEIC")));
}

TEST(ImportPhotos, LinksAreNotFollowedOut) {
  const TempDir dir;
  fs::create_directories(dir / "from");
  cv::imwrite((dir / "elsewhere.jpg").string(), Gradient(64));
  cv::imwrite((dir / "from/a.jpg").string(), Gradient(64));
  fs::create_symlink(dir / "elsewhere.jpg", dir / "from/b.jpg");
  const ImportReport report = ImportPhotos(dir / "site", dir / "from", "set", *std::make_unique<ProgressSink>(), {});
  EXPECT_TRUE(fs::exists(dir / "site/photos/set/a.jpg"));
  EXPECT_FALSE(fs::exists(dir / "site/photos/set/b.jpg"));
  EXPECT_THAT(Joined(report.warnings), HasSubstr("b.jpg: is a link"));
}

TEST(ImportPanoramas, LinksAreNotFollowedOut) {
  const TempDir dir;
  for (const char* folder : {"secret/tiles", "real/cube"}) fs::create_directories(dir / folder);
  cv::imwrite((dir / "secret/private.jpg").string(), Gradient(64));
  cv::imwrite((dir / "secret/tiles/0_0.jpg").string(), Gradient(64));
  cv::imwrite((dir / "real/own.jpg").string(), Gradient(64));
  fs::create_symlink("../secret/private.jpg", dir / "real/p1.jpg");
  fs::create_directory_symlink(dir / "secret/tiles", dir / "real/p2");
  fs::create_symlink(dir / "secret/private.jpg", dir / "real/cube/front.jpg");
  fs::create_symlink("own.jpg", dir / "real/again.jpg");
  std::string list;
  for (const char* id : {"own", "again", "p1", "p2", "cube"}) {
    list += std::string(list.empty() ? "[" : ",") + "{\"id\": \"" + id + "\", \"lat\": 48.0, \"lon\": 7.8}";
  }
  dir.Write("real/list.json", list + "]");
  fs::create_directory_symlink(dir / "real", dir / "from");  // the user may name a folder by a link
  ProgressSink progress;
  const ImportReport report = ImportPanoramas(dir / "site", *OpenPanoramaFolder(dir / "from"), {}, progress, {});
  for (const char* name : {"own", "again"}) {
    EXPECT_TRUE(fs::exists(dir / "site/panoramas" / (std::string(name) + ".jpg"))) << name;
  }
  for (const char* name : {"p1", "p2", "cube"}) {
    EXPECT_FALSE(fs::exists(dir / "site/panoramas" / (std::string(name) + ".jpg"))) << name;
  }
  EXPECT_THAT(Joined(report.warnings),
              AllOf(HasSubstr("p1.jpg: expected a file in"), HasSubstr("found a link out of it"),
                    HasSubstr("0_0.jpg: expected"), HasSubstr("front.jpg: expected")));
  fs::create_symlink(dir / "secret/list.json", dir / "real/other.json");
  dir.Write("secret/list.json", "[]");
  EXPECT_THAT(MessageOf<InputError>([&] { OpenPanoramaFolder(dir / "from"); }), HasSubstr("other.json: expected"));
}

TEST(ImportPanoramas, KeepsColumnsWithAnyName) {
  const TempDir dir;
  fs::create_directories(dir / "from");
  fs::create_directories(dir / "site/panoramas");
  cv::imwrite((dir / "from/p.jpg").string(), Gradient(64));
  cv::imwrite((dir / "site/panoramas/mine.jpg").string(), Gradient(64));
  dir.Write("from/p.json", R"({"id": "p", "lat": 48.0, "lon": 7.8})");
  const std::string before = "file,\"note, mine\",=1+1\npanoramas/mine.jpg,a,b\n";
  dir.Write("site/panoramas.csv", before);
  ProgressSink progress;
  const ImportReport report = ImportPanoramas(dir / "site", *OpenPanoramaFolder(dir / "from"), {}, progress, {});
  EXPECT_EQ(ReadTextFile(report.kept), before);
  const CsvTable table = CsvTable::Read(dir / "site/panoramas.csv", {"file"});
  ASSERT_EQ(table.rows().size(), 2u);
  EXPECT_EQ(table.rows()[0].Text("note, mine"), "a");
  EXPECT_EQ(table.rows()[0].Text("=1+1"), "b");
  EXPECT_EQ(table.rows()[1].Text("file"), "panoramas/p.jpg");
}

TEST(ImportColmap, NamesThatClimbOutAreRefused) {
  const TempDir dir;
  fs::create_directories(dir / "images");
  cv::imwrite((dir / "secret.jpg").string(), Gradient(64));
  dir.Write("model/cameras.txt", "1 PINHOLE 64 32 50 50 32 16\n");
  dir.Write("model/images.txt", "1 1 0 0 0 0 0 0 1 sub/../../secret.jpg\n\n");
  dir.Write("model/points3D.txt", "");
  ColmapRunOptions options;
  options.run = "run1";
  options.images = dir / "images";
  EXPECT_THAT(MessageOf<InputError>([&] { ImportColmapRun(dir / "site", dir / "model", options); }),
              HasSubstr("names an image 'sub/../../secret.jpg'; expected names below"));
  fs::create_symlink(dir / "secret.jpg", dir / "images/a.jpg");
  dir.Write("model/images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n");
  EXPECT_THAT(MessageOf<InputError>([&] { ImportColmapRun(dir / "site", dir / "model", options); }),
              HasSubstr("a.jpg: expected a file in"));
  EXPECT_FALSE(fs::exists(dir / "site/runs"));
}

TEST(ImportColmap, LinksAreNotFollowedOut) {
  const TempDir dir;
  fs::create_directories(dir / "images");
  cv::imwrite((dir / "images/a.jpg").string(), Gradient(64));
  dir.Write("secret/cameras.txt", "1 PINHOLE 64 32 50 50 32 16\n");
  dir.Write("model/images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n");
  dir.Write("model/points3D.txt", "");
  fs::create_symlink("../secret/cameras.txt", dir / "model/cameras.txt");
  fs::create_directory_symlink(dir / "images", dir / "model/images");  // nothing of it is read
  ColmapRunOptions options;
  options.run = "run1";
  options.images = dir / "images";
  options.scale = 1;
  EXPECT_THAT(MessageOf<InputError>([&] { ImportColmapRun(dir / "site", dir / "model", options); }),
              HasSubstr("model/cameras.txt: expected a file in"));
  EXPECT_FALSE(fs::exists(dir / "site/runs"));
  fs::remove(dir / "model/cameras.txt");
  fs::rename(dir / "secret/cameras.txt", dir / "model/own.txt");
  fs::create_symlink("own.txt", dir / "model/cameras.txt");
  fs::create_directory_symlink(dir / "model", dir / "from");  // the user may name a folder by a link
  EXPECT_EQ(ImportColmapRun(dir / "site", dir / "from", options).warnings.size(), 0u);
}

TEST(ImportMapillary, TheDescriptionIsRead) {
  const TempDir dir;
  cv::imwrite((dir / "m.jpg").string(), Gradient(64));
  const auto image = Exiv2::ImageFactory::open((dir / "m.jpg").string());
  image->readMetadata();
  image->exifData()["Exif.Image.ImageDescription"] =
      R"({"MAPLatitude": 48.0125, "MAPLongitude": 7.8322, "MAPAltitude": 240.5, "MAPCompassHeading": {"TrueHeading": 271.5, "MagneticHeading": 269}, "MAPCaptureTime": "2024_05_12_09_43_20_500", "MAPGPSAccuracyMeters": 4})";
  image->writeMetadata();
  const PhotoMetadata metadata = ReadPhotoMetadata(dir / "m.jpg");
  ASSERT_TRUE(metadata.position.has_value());
  EXPECT_DOUBLE_EQ(metadata.position->longitude_deg, 7.8322);
  EXPECT_DOUBLE_EQ(metadata.heading_deg.value_or(0), 271.5);
  EXPECT_DOUBLE_EQ(metadata.sigma_h_m.value_or(0), 4);
  EXPECT_EQ(metadata.taken_utc_ns.value_or(0), *ParseUtcToNs("2024-05-12T09:43:20.5Z"));
}

TEST(ImportOpenSfmGcp, CheckPointsStayCheckPoints) {
  const TempDir dir;
  dir.Write("gcp_list.txt", "EPSG:4326\n13.4 52.5 40 10 20 a.jpg gcp01\n13.5 52.6 40 10 20 a.jpg CHK-1\n");
  fs::create_directories(dir / "images");
  cv::imwrite((dir / "images/a.jpg").string(), cv::Mat(48, 64, CV_8U, cv::Scalar(100)));
  ImportOpenSfmGcp(dir.path(), dir / "gcp_list.txt", dir / "images");
  const std::string points = ReadTextFile(dir / "control_points.csv");
  EXPECT_THAT(points, HasSubstr("gcp01,control,52.5"));
  EXPECT_THAT(points, HasSubstr("CHK-1,check,52.6"));
}

TEST(ImportOpenSfmGcp, BerlinHasItsPoints) {
  const char* set = std::getenv("TRIGPOINT_SHARED_DATA");
  const fs::path berlin = fs::path(set != nullptr ? set : "../shared/data") / "berlin_gcp";
  if (!fs::exists(berlin)) GTEST_SKIP() << "no shared data";
  const TempDir dir;
  const ImportReport report = ImportOpenSfmGcp(dir.path(), berlin / "ground_control_points.json", berlin / "images");
  EXPECT_THAT(Joined(report.warnings), HasSubstr("2 marks of points without a position"));
  EXPECT_THAT(ReadTextFile(dir / "control_points.csv"), HasSubstr("0,control,52.5192683440,13.4007036311,14.9461"));
  // -0.015689 * 3264 + 1631.5, -0.0625362 * 3264 + 1223.5.
  EXPECT_THAT(ReadTextFile(dir / "control_observations.csv"), HasSubstr("0,02.jpg,1580.291,1019.382"));
}

}  // namespace
}  // namespace trigpoint
