// Every reader, given files damaged at random: a clear refusal or a result, never anything else.
#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/gps.h"
#include "datasets/io/image.h"
#include "datasets/io/site.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

// Cuts, doubles, swaps and overwrites pieces.
std::string Damage(std::string text, std::mt19937_64* random) {
  const auto pick = [&](size_t n) { return n == 0 ? size_t{0} : static_cast<size_t>((*random)() % n); };
  const std::vector<std::string> pieces = {",",
                                           "\"",
                                           "\n",
                                           "\t",
                                           "nan",
                                           "-",
                                           "1e999",
                                           ":",
                                           "[",
                                           "]",
                                           "{",
                                           "..",
                                           "\xFF",
                                           "$",
                                           std::string(1, '\0'),
                                           "99999999999999999999",
                                           "<",
                                           "&",
                                           "*",
                                           "#"};
  for (size_t i = 0, n = 1 + pick(4); i < n; ++i) {
    const size_t at = pick(text.size()), length = pick(20);
    switch (pick(5)) {
      case 0: text.erase(std::min(at, text.size()), length); break;
      case 1: text.insert(std::min(at, text.size()), pieces[pick(pieces.size())]); break;
      case 2: text.resize(at); break;
      case 3: text.insert(std::min(at, text.size()), text.substr(pick(text.size()), length)); break;
      default:
        if (!text.empty()) text[at] = static_cast<char>(pick(256));
    }
  }
  return text;
}

void Try(const std::string& name, const std::string& whole, int times,
         const std::function<void(const std::filesystem::path&)>& read) {
  const TempDir dir;
  ASSERT_NO_THROW(read(dir.Write(name, whole)));
  std::mt19937_64 random(7);
  int refused = 0;
  for (int i = 0; i < times; ++i) {
    const std::string damaged = Damage(whole, &random);
    try {
      read(dir.Write(name, damaged));
    } catch (const Error& e) {
      ++refused;
      EXPECT_NE(std::string(e.what()).find(name), std::string::npos) << e.what();
    } catch (const std::exception& e) {
      ADD_FAILURE() << name << ", damage " << i << ": " << e.what() << "\n" << damaged.substr(0, 500);
    }
  }
  EXPECT_GT(refused, 0);
}

TEST(Damaged, Text) {
  Try("t.csv", "# c\nfile,x\n\"a, b\",1.5\nc,2\n", 250, [](const std::filesystem::path& file) {
    const CsvTable table = CsvTable::Read(file, {"file", "x"});
    std::vector<std::string> warnings;
    table.ForEachUsable(&warnings, [](const CsvRow& row) { row.Number("x"); });
  });
  Try("t.tum", "# t\n1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0 0 0 1\n", 250,
      [](const std::filesystem::path& file) { ReadTrajectory(file); });
  Try("camchain.yaml",
      "cam0:\n  camera_model: pinhole\n  intrinsics: [60, 60, 31.5, 23.5]\n  distortion_model: radtan\n"
      "  distortion_coeffs: [0.1, 0, 0, 0]\n  resolution: [64, 48]\n  T_cam_imu:\n  - [0, -1, 0, 0]\n"
      "  - [0, 0, -1, 0]\n  - [1, 0, 0, 0]\n  - [0, 0, 0, 1]\n",
      250, [](const std::filesystem::path& file) { ReadCamchain(file); });
  Try("t.nmea",
      "$GPGGA,100000.00,4800.7459712,N,00749.9240948,E,1,09,1.1,190.1,M,47.8,M,,\n"
      "$GPRMC,100000.00,A,4800.6,N,00730.0,E,0.5,90.0,120526,,,A\n$GPGST,100000.00,1,1,1,1,0.3,0.4,0.9\n",
      250, [](const std::filesystem::path& file) { ReadNmea(file, {}); });
  Try("t.gpx",
      "<gpx><trk><trkseg><trkpt lat=\"48\" lon=\"8\"><ele>1</ele><time>2026-05-12T09:43:21Z</time></trkpt>"
      "</trkseg></trk></gpx>",
      250, [](const std::filesystem::path& file) { ReadGpx(file, {}); });
}

TEST(Damaged, Pictures) {
  const TempDir dir;
  cv::Mat picture(48, 64, CV_8UC3);
  cv::randu(picture, 0, 255);
  for (const std::string name : {"p.jpg", "p.png", "p.tif"}) {
    cv::imwrite((dir / name).string(), picture);
    const std::string whole = ReadTextFile(dir / name);
    Try(name, whole, 80, [](const std::filesystem::path& file) { LoadPicture(file, true); });
    Try(name, whole, 80, [](const std::filesystem::path& file) { ReadPhotoMetadata(file); });
  }
}

// A whole folder with one file damaged at a time.
TEST(Damaged, Sites) {
  const TempDir dir;
  const std::vector<std::pair<std::string, std::string>> files = {
      {"runs/run1/images.txt", "1 images/1.png\n2 \"images/2.png\" cam0\n"},
      {"runs/run1/run.yaml", "date: 2026-05-12\nmirrored: true\ngps: {lever_arm_m: [0, 0, 1.3], time_offset_s: 1}\n"},
      {"runs/run1/gps.csv", "timestamp_s,latitude_deg,longitude_deg,height_m\n1,48,8,240\n2,48,8,240\n"},
      {"stations.csv", "station,tag_id,east_m,north_m,up_m\nA,5,1,2,3\n"},
      {"control_points.csv",
       "tag_id,role,crs,easting_m,northing_m,height_m\n6,check,EPSG:32632,412733.5,5318057.3,2\n"},
      {"panoramas.csv", "file,station,latitude_deg,longitude_deg,heading_deg\npanoramas/a.jpg,S1,48,8,90\n"},
      {"tags.yaml", "family: tag36h11\nsize_m: 0.5\nsizes_m: {7: 0.25}\n"},
      {"origin.json", "{\"lat\": 48.5, \"lon\": 8, \"alt\": 240}"}};
  for (const auto& [name, text] : files) dir.Write(name, text);
  dir.Write("runs/run1/camchain.yaml",
            "cam0:\n  camera_model: pinhole\n  intrinsics: [60, 60, 31.5, 23.5]\n  resolution: [64, 48]\n");
  dir.Write("runs/run1/images/1.png", "x");
  dir.Write("runs/run1/images/2.png", "x");
  dir.Write("panoramas/a.jpg", "x");
  ASSERT_EQ(ReadSite(dir.path()).runs.size(), 1u);
  std::mt19937_64 random(11);
  for (const auto& [name, text] : files) {
    for (int i = 0; i < 50; ++i) {
      const std::string damaged = Damage(text, &random);
      dir.Write(name, damaged);
      try {
        ReadSite(dir.path());
      } catch (const Error&) {
      } catch (const std::exception& e) {
        ADD_FAILURE() << name << ", damage " << i << ": " << e.what() << "\n" << damaged;
      }
    }
    dir.Write(name, text);
  }
}

}  // namespace
}  // namespace trigpoint
