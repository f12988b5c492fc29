// Tables and pictures as people have them: other names of columns, other separators, positions in EXIF.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <thread>

#include "datasets/io/csv.h"
#include "datasets/io/csv_dialect.h"
#include "datasets/io/exif_positions.h"
#include "datasets/io/gps.h"
#include "datasets/io/photo_tilt.h"
#include "datasets/io/tables.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const std::vector<std::string> kGeo = {"latitude_deg", "longitude_deg", "height_m"};

TEST(Columns, AreKnownByTheNamesPeopleUse) {
  for (const char* name :
       {"lat", "Latitude", "LAT", "lat_deg", "latitude [deg]", "Latitude (\xC2\xB0)", "GPS Latitude"}) {
    EXPECT_EQ(KnownColumn(name, kGeo, false), "latitude_deg") << name;
  }
  for (const char* name : {"lon", "lng", "long", "Longitude", "lon_deg", "lng_deg"}) {
    EXPECT_EQ(KnownColumn(name, kGeo, false), "longitude_deg") << name;
  }
  for (const char* name : {"alt", "altitude", "alt_m", "Height (m)", "elevation"}) {
    EXPECT_EQ(KnownColumn(name, kGeo, false), "height_m") << name;
  }
  // Another unit is another thing, and so is a name of something else.
  for (const char* name : {"height_ft", "lat_m", "alt_deg", "heading", "plateau", ""}) {
    EXPECT_EQ(KnownColumn(name, kGeo, false), "") << name;
  }
  EXPECT_EQ(KnownColumn("east", {"east_m", "north_m"}, false), "east_m");
  EXPECT_EQ(KnownColumn("easting", {"easting_m", "northing_m"}, false), "easting_m");
  // x is metres in a local frame where the table knows those, and has no coordinate system.
  const std::vector<std::string> control = {"x_m", "y_m", "z_m", "easting_m", "northing_m", "height_m", "crs"};
  EXPECT_EQ(KnownColumn("x", control, false), "x_m");
  EXPECT_EQ(KnownColumn("x", control, true), "easting_m");
  std::vector<std::string> columns = {"EPSG", "X", "Y", "Z"};
  UseKnownColumns(control, &columns);
  EXPECT_THAT(columns, ElementsAre("crs", "easting_m", "northing_m", "height_m"));
  // The most telling name is taken, once; what is known is left alone.
  columns = {"y", "lat", "latitude_deg", "lng", "lon"};
  EXPECT_THAT(UseKnownColumns(kGeo, &columns), ElementsAre("longitude_deg from 'lon'"));
  EXPECT_THAT(columns, ElementsAre("y", "lat", "latitude_deg", "lng", "longitude_deg"));
}

TEST(Columns, ReadsASpreadsheetOfThisPartOfTheWorld) {
  const TempDir dir;
  const auto file = dir.Write("t.csv", "Latitude;lng;alt;Note\n48,0125;7,8322;242,5;\"a;b\"\n-48,5;;1;c, d\n");
  const CsvTable table = CsvTable::Read(file, {"latitude_deg", "longitude_deg"}, {"height_m"});
  ASSERT_EQ(table.rows().size(), 2u);
  EXPECT_EQ(table.rows()[0].Number("latitude_deg"), 48.0125);
  EXPECT_EQ(table.rows()[0].Number("height_m"), 242.5);
  EXPECT_EQ(table.rows()[0].Text("Note"), "a;b");
  EXPECT_EQ(table.rows()[1].Text("Note"), "c, d");
  EXPECT_EQ(table.rows()[1].Number("latitude_deg"), -48.5);
  EXPECT_FALSE(table.rows()[1].Has("longitude_deg"));
  EXPECT_THAT(table.warnings().front(),
              HasSubstr("t.csv:1: understood as latitude_deg from 'Latitude', longitude_deg from 'lng', height_m from "
                        "'alt' (metres above the WGS 84 ellipsoid); cells separated by semicolons; decimal commas"));
  EXPECT_THAT(MessageOf<InputError>([&] {
                CsvTable::Read(file, {"latitude_deg", "sigma_h_m"});
              }),
              HasSubstr("column 'sigma_h_m' is missing in the header row; nearest column found: 'lng' (understood: "
                        "latitude_deg from 'Latitude'"));
}

// What is written in a column that nobody reads, or beside a name, says nothing of the others.
TEST(Columns, DecimalCommasAreDecidedByColumn) {
  const TempDir dir;
  const auto file = dir.Write(
      "t.csv", "file;Lat (deg);LONG;Alt [m];version;note\n1.1;48,0125;7,8322;242,5;3.25;a,b\n1.2;48,5;7,25;;3.5;1.5\n");
  const CsvTable table = CsvTable::Read(file, {"file", "latitude_deg", "longitude_deg"}, {"height_m"});
  EXPECT_EQ(table.rows()[0].Text("file"), "1.1");
  EXPECT_EQ(table.rows()[0].Number("latitude_deg"), 48.0125);
  EXPECT_EQ(table.rows()[1].Number("longitude_deg"), 7.25);
  EXPECT_EQ(table.rows()[0].Number("height_m"), 242.5);
  EXPECT_EQ(table.rows()[0].Text("note"), "a,b");
  EXPECT_THAT(table.warnings().front(), HasSubstr("longitude_deg from 'LONG'"));
  // One bad cell does not hide how the others are written.
  const CsvTable bad = CsvTable::Read(dir.Write("b.csv", "a;b\n1,25;2\nnone;3\n1,5;4\n"), {"a", "b"});
  EXPECT_EQ(bad.rows()[0].Number("a"), 1.25);
  const CsvTable names = CsvTable::Read(dir.Write("n.csv", "station,b\n\"1,25\",2.5\n"), {"station", "b"});
  EXPECT_EQ(names.rows()[0].Text("station"), "1,25");
}

// In any case, with units in brackets.
TEST(Columns, NamesInAnyCase) {
  const std::vector<std::string> geo = {"latitude_deg", "longitude_deg", "height_m", "crs", "easting_m", "northing_m"};
  const std::vector<std::pair<std::string, std::string>> meant = {{"Lat (deg)", "latitude_deg"},
                                                                  {"lat_deg", "latitude_deg"},
                                                                  {"LATITUDE", "latitude_deg"},
                                                                  {"Latitude [°]", "latitude_deg"},
                                                                  {"lat", "latitude_deg"},
                                                                  {"Lng", "longitude_deg"},
                                                                  {"long", "longitude_deg"},
                                                                  {"Lon [deg]", "longitude_deg"},
                                                                  {"Longitude (decimal degrees)", "longitude_deg"},
                                                                  {"Alt (m)", "height_m"},
                                                                  {"Altitude [metres]", "height_m"},
                                                                  {"Easting (m)", "easting_m"},
                                                                  {"NORTHING", "northing_m"},
                                                                  {"X", "easting_m"},
                                                                  {"y [m]", "northing_m"}};
  for (const auto& [column, known] : meant) EXPECT_EQ(KnownColumn(column, geo, true), known) << column;
}

TEST(Columns, SeparatedByTabsAndBars) {
  const TempDir dir;
  const CsvTable tabs = CsvTable::Read(dir.Write("t.csv", "a\tb\tc\n1\t\t3,5\n\t2\t4,5\n"), {"a", "b", "c"});
  EXPECT_FALSE(tabs.rows()[0].Has("b"));
  EXPECT_EQ(tabs.rows()[0].Number("c"), 3.5);
  EXPECT_FALSE(tabs.rows()[1].Has("a"));
  EXPECT_EQ(tabs.rows()[1].Number("b"), 2);
  const CsvTable bars = CsvTable::Read(dir.Write("b.csv", "a | b\n1 | 2.5\n"), {"a", "b"});
  EXPECT_EQ(bars.rows()[0].Number("b"), 2.5);
}

TEST(Columns, ACommaBesideDecimalPointsIsNone) {
  const TempDir dir;
  const CsvTable table = CsvTable::Read(dir.Write("t.csv", "a;b\n1,234;48.5\n"), {"a", "b"});
  EXPECT_THAT(MessageOf<InputError>([&] { table.rows()[0].Number("a"); }),
              HasSubstr("expected a number, found '1,234'"));
  // Quoted cells of a table with commas.
  const CsvTable quoted = CsvTable::Read(dir.Write("q.csv", "a,b\n\"1,25\",2\n"), {"a", "b"});
  EXPECT_EQ(quoted.rows()[0].Number("a"), 1.25);
  EXPECT_THAT(Joined(quoted.warnings()), HasSubstr("understood as decimal commas"));
  const CsvTable plain = CsvTable::Read(dir.Write("p.csv", "a,b\n1.25,\"x, y\"\n"), {"a", "b"});
  EXPECT_EQ(Joined(plain.warnings()), "");
}

TEST(Columns, PositionsInEveryTableMayBeProjected) {
  const TempDir dir;
  dir.Write("a.jpg", "x");
  const auto read = [&](const std::string& text) {
    std::vector<std::string> warnings;
    return ReadPanoramaTable(dir.Write("panoramas.csv", text), dir.path(), &warnings).at(0).geotag;
  };
  // UTM 32 north of 48.0125518 N, 7.8322567 E.
  const GeoTag utm = read("file,crs,easting,northing,height\na.jpg,EPSG:32632,412955.0,5318456.0,240\n");
  ASSERT_TRUE(utm.has_position && utm.has_height);
  EXPECT_NEAR(utm.position.latitude_deg, 48.0125, 2e-3);
  EXPECT_NEAR(utm.position.longitude_deg, 7.8322, 2e-3);
  // What geographic programs write: x is the longitude.
  const GeoTag gis = read("file,X,Y\na.jpg,7.8322567,48.0125518\n");
  EXPECT_EQ(gis.position.latitude_deg, 48.0125518);
  EXPECT_EQ(gis.position.longitude_deg, 7.8322567);
  EXPECT_FALSE(gis.has_height);
  // Metres of somebody's own are no degrees.
  EXPECT_THAT(MessageOf<InputError>([&] { read("file,x,y\na.jpg,7.83,48.01\n"); }),
              HasSubstr("column crs: expected the system of easting and northing"));
  EXPECT_THAT(MessageOf<InputError>([&] { read("file,lat,lon,x,y\na.jpg,1,2,3,4\n"); }), HasSubstr("found both"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadGpsCsv(dir.Write("gps.csv", "time,speed\n1,2\n")); }),
              HasSubstr("column 'latitude_deg' is missing"));
  const GpsTrack track = ReadGpsCsv(dir.Write("gps.csv", "time;lat;long;alt\n1,5;48,01;7,83;240,0\n"));
  EXPECT_EQ(track.fixes.at(0).stamp_ns, 1'500'000'000);
  EXPECT_EQ(track.fixes.at(0).position.longitude_deg, 7.83);
}

// Pictures in runs/walk/images/ (numbered one a second) at the given metres north of 48 deg, and a camera.
class ExifPositions : public testing::Test {
 protected:
  void Picture(const std::string& name, double north_m, const std::string& error_m = "") {
    std::filesystem::create_directories((dir_ / name).parent_path());
    cv::imwrite((dir_ / name).string(), cv::Mat(48, 64, CV_8U, cv::Scalar(100)));
    const auto image = Exiv2::ImageFactory::open((dir_ / name).string());
    image->readMetadata();
    Exiv2::ExifData& exif = image->exifData();
    exif["Exif.Photo.FocalLengthIn35mmFilm"] = "28";
    if (north_m >= 0) {
      exif["Exif.GPSInfo.GPSLatitude"] = fmt::format("48/1 0/1 {:.0f}/100000", 1e5 * north_m / 30.887);
      exif["Exif.GPSInfo.GPSLatitudeRef"] = "N";
      exif["Exif.GPSInfo.GPSLongitude"] = "7/1 50/1 0/1";
      exif["Exif.GPSInfo.GPSLongitudeRef"] = "E";
      exif["Exif.GPSInfo.GPSAltitude"] = "240/1";
      exif["Exif.GPSInfo.GPSAltitudeRef"] = "0";
    }
    if (!error_m.empty()) exif["Exif.GPSInfo.GPSHPositioningError"] = error_m;
    image->writeMetadata();
  }
  std::vector<PhotoMetadata> Set(const std::vector<double>& north_m, const std::string& error_m = "") {
    std::vector<PhotoMetadata> photos;
    for (size_t i = 0; i < north_m.size(); ++i) {
      const std::string name = "set/" + std::to_string(i) + ".jpg";
      Picture(name, north_m[i], error_m);
      photos.push_back(ReadPhotoMetadata(dir_ / name));
    }
    return photos;
  }
  TempDir dir_;
};

TEST_F(ExifPositions, OfARunAreItsTrack) {
  // The second position is repeated, one picture has none, one states its error.
  const double north_m[] = {0, 10, 10, -1, 30, 40};
  for (int i = 0; i < 6; ++i) Picture(fmt::format("runs/walk/images/{}.jpg", i), north_m[i], i == 4 ? "2/1" : "");
  const trigpoint::Run run = ReadRun(dir_ / "runs/walk", dir_.path());
  ASSERT_EQ(run.images.size(), 6u);
  ASSERT_EQ(run.gps.size(), 4u);
  for (const auto& [fix, image] : {std::pair<size_t, size_t>{0, 0}, {1, 1}, {2, 4}, {3, 5}}) {
    EXPECT_EQ(run.gps[fix].stamp_ns, run.images[image].stamp_ns);
    EXPECT_NEAR(run.gps[fix].position.latitude_deg, 48 + north_m[image] / 30.887 / 3600, 1e-8);
    EXPECT_EQ(run.gps[fix].sigma_h_m, image == 4 ? 2 : kExifPositionSigma_m);
    EXPECT_EQ(run.gps[fix].sigma_sea_m, kUnknownGeoidSigma);
    EXPECT_NEAR(OwnHeightSigma(run.gps[fix].sigma_v_m, kUnknownGeoidSigma), 10, 1e-9);
  }
  EXPECT_THAT(Joined(run.warnings), HasSubstr("walk: no GPS file; 4 positions are from the EXIF of the images, 1 with "
                                              "the error stated there, else 5 m (1 sigma)"));
  // A receiver's track goes before.
  dir_.Write("runs/walk/gps.csv", "timestamp_s,latitude_deg,longitude_deg\n1,48,7.8\n");
  EXPECT_EQ(ReadRun(dir_ / "runs/walk", dir_.path()).gps.size(), 1u);
}

// Images without a position stay without; those that have one may be any.
TEST_F(ExifPositions, AreReadOfAllImages) {
  for (int i = 0; i < 8; ++i) Picture(fmt::format("runs/walk/images/{}.jpg", i), i == 2 || i == 5 ? 10 * i : -1);
  const trigpoint::Run run = ReadRun(dir_ / "runs/walk", dir_.path());
  ASSERT_EQ(run.gps.size(), 2u);
  EXPECT_EQ(run.gps[1].stamp_ns, run.images[5].stamp_ns);
  // A dilution of precision widens what is not stated otherwise.
  const std::string file = dir_ / "runs/walk/images/5.jpg";
  const auto image = Exiv2::ImageFactory::open(file);
  image->readMetadata();
  image->exifData()["Exif.GPSInfo.GPSDOP"] = "3/1";
  image->writeMetadata();
  const trigpoint::Run diluted = ReadRun(dir_ / "runs/walk", dir_.path());
  ASSERT_EQ(diluted.gps.size(), 2u);
  EXPECT_EQ(diluted.gps[1].sigma_h_m, 3 * kExifPositionSigma_m);
  EXPECT_EQ(diluted.gps[0].sigma_h_m, kExifPositionSigma_m);
  EXPECT_FALSE(ReadPhotoMetadata(file).sigma_h_m);
}

// Of errors with the stated sigma that are correlated over any time, few look like a walk.
TEST(OneSpot, IsSeldomRefused) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr int kSets = 1000;
  for (const size_t n : {size_t{6}, size_t{29}}) {
    for (const double time : {0.01, 0.2, 0.4, 1.0, 4.0}) {  // of correlation, as a share of the set's
      const double kept = std::exp(-1 / (time * static_cast<double>(n)));
      int refused = 0;
      for (int k = 0; k < kSets; ++k) {
        std::vector<PhotoMetadata> photos(n);
        Eigen::Vector2d error(normal(random), normal(random));
        for (PhotoMetadata& photo : photos) {
          photo.sigma_h_m = 4;
          photo.position = {48 + 4 * error.y() / 111195, 7.8 + 4 * error.x() / 74500, 0};
          error = kept * error + std::sqrt(1 - kept * kept) * Eigen::Vector2d(normal(random), normal(random));
        }
        refused += WhyNotFromOneSpot(photos).empty() ? 0 : 1;
      }
      EXPECT_LE(refused, kSets * 2 / 100) << n << " " << time;
    }
  }
}

TEST_F(ExifPositions, ShowThatPhotosOfAWalkAreNoSet) {
  std::vector<double> walk, spot;
  for (int i = 0; i < 29; ++i) {
    walk.push_back(76.0 * i / 28);
    spot.push_back(20 + 3 * std::sin(i));  // a receiver's errors
  }
  spot.back() = 300;  // and a wrong fix
  EXPECT_THAT(WhyNotFromOneSpot(Set(walk)),
              HasSubstr("the EXIF positions of 29 photos span 76 m, and half of them lie more than 19.0 m from the "
                        "middle; expected photos from one spot"));
  EXPECT_EQ(WhyNotFromOneSpot(Set(spot)), "");
  // Shorter walks show by their order, in a straight line; wherever the photographer stood, 8 m are within the error.
  std::vector<double> eighteen, eight, disordered;
  for (int i = 0; i < 29; ++i) {
    eighteen.push_back(20 + 18.0 * i / 28 + 0.5 * std::sin(5 * i));
    eight.push_back(20 + 8.0 * i / 28);
    disordered.push_back(20 + 18.0 * (11 * i % 29) / 28);
  }
  EXPECT_THAT(WhyNotFromOneSpot(Set(eighteen)), HasSubstr("they move on by 18"));
  EXPECT_EQ(WhyNotFromOneSpot(Set(eight)), "");
  EXPECT_THAT(WhyNotFromOneSpot(Set(eight, "2/1")), HasSubstr("they move on by 8.0 m from the first to the last"));
  EXPECT_EQ(WhyNotFromOneSpot(Set(disordered)), "");
  eighteen[28] = 300;
  EXPECT_NE(WhyNotFromOneSpot(Set(eighteen)), "");
  // A poor receiver says so; too few positions say nothing.
  EXPECT_EQ(WhyNotFromOneSpot(Set(walk, "30/1")), "");
  EXPECT_THAT(WhyNotFromOneSpot(Set(walk, "20/1")), HasSubstr("they move on by 76"));
  EXPECT_EQ(WhyNotFromOneSpot(Set({0, 30, 60})), "");
  std::vector<std::string> warnings;
  for (int i = 0; i < 29; ++i) Picture(fmt::format("photos/walk/{}.jpg", i), walk[static_cast<size_t>(i)]);
  EXPECT_TRUE(ReadPhotoSets(dir_ / "photos", &warnings).empty());
  EXPECT_THAT(Joined(warnings), HasSubstr("photos/walk: the EXIF positions of 29 photos span 76 m"));
}

// As file managers leave them: ".thumbnails", "._1.jpg".
TEST_F(ExifPositions, HiddenFoldersAndFilesAreNoPhotoSets) {
  for (const char* folder : {"spot", ".thumbnails"}) {
    for (int i = 0; i < 3; ++i) Picture(fmt::format("photos/{}/{}.jpg", folder, i), 0.1 * i);
  }
  Picture("photos/spot/._1.jpg", 0);
  std::vector<std::string> warnings;
  const std::vector<Reference> sets = ReadPhotoSets(dir_ / "photos", &warnings);
  ASSERT_EQ(sets.size(), 1u);
  EXPECT_EQ(sets[0].name, "spot");
  EXPECT_EQ(sets[0].files.size(), 3u);
  EXPECT_THAT(Joined(warnings), testing::Not(HasSubstr(".thumbnails")));
}

// Exiv2's XMP parser has global state.
TEST_F(ExifPositions, AreReadBesideTilts) {
  Picture("tilted.jpg", 10);
  const std::string file = dir_ / "tilted.jpg";
  const auto image = Exiv2::ImageFactory::open(file);
  image->readMetadata();
  image->xmpData()["Xmp.GPano.PosePitchDegrees"] = "2.5";
  image->writeMetadata();
  std::atomic<int> right = 0;
  std::vector<std::thread> threads;
  for (int k = 0; k < 4; ++k) {
    threads.emplace_back([&, tilt = k % 2 == 0] {
      for (int i = 0; i < 50; ++i) {
        right += tilt ? ReadPhotoTilt(file).pitch_deg == 2.5 : ReadPhotoMetadata(file).position.has_value();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right.load(), 200);
}

}  // namespace
}  // namespace trigpoint
