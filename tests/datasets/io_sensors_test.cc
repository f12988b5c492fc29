// Cameras, GPS, and whether the clocks agree.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "datasets/io/camchain.h"
#include "datasets/io/gopro_gps.h"
#include "datasets/io/gps.h"
#include "datasets/io/time_check.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

constexpr int64_t kSecond = 1'000'000'000;

std::string CameraText(const std::string& name, const std::string& more) {
  return name + ":\n  camera_model: pinhole\n  intrinsics: [400, 401, 319.5, 239.5]\n  resolution: [640, 480]\n" + more;
}

const char kRadtan[] = "  distortion_model: radtan\n  distortion_coeffs: [-0.1, 0.01, 1e-3, -1e-3]\n";
const char kFisheye[] = "  distortion_model: equidistant\n  distortion_coeffs: [0.1, 0, 0, 0]\n";

TEST(Camchain, ChainsCamerasToTheBody) {
  const TempDir dir;
  const auto file = dir.Write(
      "camchain.yaml",
      CameraText("cam0",
                 std::string(kRadtan) +
                     "  T_cam_imu:\n  - [0, -1, 0, 0.1]\n  - [0, 0, -1, 0.2]\n  - [1, 0, 0, 0.3]\n  - [0, 0, 0, "
                     "1]\n  timeshift_cam_imu: 0.005\n  rostopic: /cam0\n  cam_overlaps: [1]\n") +
          CameraText("cam1", std::string(kFisheye) + "  T_cn_cnm1: [[1, 0, 0, -0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, "
                                                     "0, 0, 1]]\n"));
  const std::vector<BodyCamera> cameras = ReadCamchain(file);
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].camera.model(), CameraModel::kRadtan);
  EXPECT_EQ(cameras[0].time_offset_s, 0.005);
  EXPECT_EQ(cameras[1].camera.model(), CameraModel::kKannalaBrandt);
  EXPECT_TRUE(cameras[1].has_extrinsics);
  // A point 2 m ahead of the body: 2 m along cam0's axis, half a metre further left for cam1.
  const Eigen::Vector3d ahead(2, 0, 0);
  EXPECT_LT((cameras[0].cam_from_body * ahead - Eigen::Vector3d(0.1, 0.2, 2.3)).norm(), 1e-12);
  EXPECT_LT((cameras[1].cam_from_body * ahead - Eigen::Vector3d(-0.4, 0.2, 2.3)).norm(), 1e-12);

  WriteCamchain(dir / "copy.yaml", cameras, {"a copy"});
  const std::vector<BodyCamera> copy = ReadCamchain(dir / "copy.yaml");
  ASSERT_EQ(copy.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(copy[i].camera.params(), cameras[i].camera.params());
    EXPECT_EQ(copy[i].camera.model(), cameras[i].camera.model());
    EXPECT_EQ(copy[i].time_offset_s, cameras[i].time_offset_s);
    EXPECT_LT(copy[i].cam_from_body.Minus(cameras[i].cam_from_body).norm(), 1e-12);
  }
}

// A run without a calibration has a guessed lens in its files; who looks at its images again needs the one found.
TEST(Camchain, LensesAreTakenByTheNamesOfCameras) {
  std::vector<BodyCamera> found(3);
  for (size_t c = 0; c < 3; ++c) {
    found[c].name = "cam" + std::to_string(c);
    found[c].camera = Camera::FromFieldOfView(640, 480, 1.2 + 0.1 * static_cast<double>(c));
  }
  found[2].camera = Camera(CameraModel::kEquirectangular, 640, 320, {});
  std::vector<BodyCamera> cameras(found.rbegin(), found.rend());  // in another order
  for (BodyCamera& camera : cameras) {
    camera.camera = Camera::FromFieldOfView(640, 480, 1.0);
    camera.focal_sigma_share = 0.05;
    camera.cam_from_body.translation.x() = 1;
  }
  cameras.emplace_back(cameras[2]).name = "another";
  const std::vector<double> guessed = cameras[0].camera.params();
  TakeLenses(found, &cameras);
  EXPECT_EQ(cameras[2].camera.params(), found[0].camera.params());
  EXPECT_EQ(cameras[1].camera.params(), found[1].camera.params());
  EXPECT_EQ(cameras[1].focal_sigma_share, 0);
  EXPECT_EQ(cameras[1].cam_from_body.translation.x(), 1) << "the lens alone";
  EXPECT_EQ(cameras[0].camera.params(), guessed) << "a view of a 360 camera";
  EXPECT_EQ(cameras[3].camera.params(), guessed);
}

TEST(Camchain, WithoutExtrinsicsLooksAhead) {
  const TempDir dir;
  const auto cameras = ReadCamchain(dir.Write("c.yaml", CameraText("cam0", kRadtan)));
  EXPECT_FALSE(cameras[0].has_extrinsics);
  EXPECT_LT((cameras[0].cam_from_body * Eigen::Vector3d(1, -2, 3) - Eigen::Vector3d(2, -3, 1)).norm(), 1e-12);
  const auto inverse = ReadCamchain(dir.Write(
      "i.yaml", CameraText("cam0", std::string(kRadtan) +
                                       "  T_imu_cam: [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n")));
  EXPECT_LT((inverse[0].cam_from_body.translation - Eigen::Vector3d(-5, 0, 0)).norm(), 1e-12);
}

TEST(Camchain, RefusesWhatItCannotMean) {
  const TempDir dir;
  const auto message = [&](const std::string& text) {
    return MessageOf<InputError>([&] { ReadCamchain(dir.Write("c.yaml", text)); });
  };
  EXPECT_THAT(message("cam0:\n  camera_model: omni\n  intrinsics: [1, 2, 3, 4, 5]\n"),
              HasSubstr("c.yaml:2: key 'cam0.camera_model': expected pinhole or equirectangular, found 'omni'"));
  EXPECT_THAT(message(CameraText("cam0", "  distortion_model: fov\n  distortion_coeffs: [0.9]\n")), HasSubstr("'fov'"));
  EXPECT_THAT(message(CameraText("cam0", "  distortion_model: radtan\n  distortion_coeffs: [0.9]\n")),
              HasSubstr("expected 4, 5 or 8 coefficients for radtan, found 1"));
  EXPECT_THAT(message(CameraText("cam0", "  distortion_models: radtan\n")),
              HasSubstr("c.yaml:5: unknown key 'cam0.distortion_models'; nearest known key: 'cam0.distortion_model'"));
  EXPECT_THAT(message(CameraText("cam0", std::string(kRadtan) + "  T_cam_imu: [[2, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, "
                                                                "0], [0, 0, 0, 1]]\n")),
              HasSubstr("no rigid motion"));
  EXPECT_THAT(message(CameraText("cam0", kRadtan) + CameraText("cam1", kRadtan)),
              HasSubstr("camera 'cam1' has neither T_cam_imu nor T_cn_cnm1"));
  EXPECT_THAT(message("cam0:\n  camera_model: pinhole\n  intrinsics: [-1, 2, 3, 4]\n  resolution: [4, 4]\n"),
              HasSubstr("focal lengths must be positive"));
  EXPECT_THAT(message("a: 1\n"), HasSubstr("is this a Kalibr camchain?"));
  EXPECT_THAT(message(""), HasSubstr("no camera"));
}

TEST(Camchain, ReadsReadoutTimes) {
  const TempDir dir;
  const std::vector<BodyCamera> cameras =
      ReadCamchain(dir.Write("c.yaml", CameraText("cam0", std::string(kRadtan) + "  readout_s: -0.0215\n")));
  EXPECT_EQ(cameras[0].readout_s, -0.0215);
  WriteCamchain(dir / "copy.yaml", cameras, {});
  EXPECT_EQ(ReadCamchain(dir / "copy.yaml")[0].readout_s, -0.0215);
  const auto message = [&](const std::string& text) {
    return MessageOf<InputError>([&] { ReadCamchain(dir.Write("c.yaml", text)); });
  };
  EXPECT_THAT(message(CameraText("cam0", std::string(kRadtan) + "  readout_s: 21.5\n")),
              HasSubstr("expected seconds from the first row to the last, at most 0.2, found 21.5"));
  EXPECT_THAT(message("cam0:\n  camera_model: equirectangular\n  resolution: [512, 256]\n  readout_s: 0.02\n"),
              HasSubstr("a 360 camera or a crop does not have the rows of a sensor"));
}

TEST(GpsCsv, SkipsBadRowsAndSorts) {
  const TempDir dir;
  const GpsTrack track =
      ReadGpsCsv(dir.Write("gps.csv",
                           "timestamp_s,latitude_deg,longitude_deg,height_m,sigma_h_m\n"
                           "2,48,8,240,0.5\n1,48,8,,\n3,148,8,240,1\n2,48,8,240,1\n4,48,8,240,-1\n"));
  ASSERT_EQ(track.fixes.size(), 2u);
  EXPECT_EQ(track.fixes[0].stamp_ns, kSecond);
  EXPECT_EQ(track.fixes[0].sigma_v_m, kUnknownHeightSigma);
  EXPECT_EQ(track.fixes[0].sigma_h_m, GpsFix().sigma_h_m);
  EXPECT_EQ(track.fixes[1].sigma_h_m, 0.5);
  const std::string warnings = Joined(track.warnings);
  EXPECT_THAT(warnings, HasSubstr("gps.csv:4: expected a latitude"));
  EXPECT_THAT(warnings, HasSubstr("gps.csv:6: expected positive sigmas"));
  EXPECT_THAT(warnings, HasSubstr("out of order"));
  EXPECT_THAT(warnings, HasSubstr("seen before"));
}

std::string Nmea(const std::string& body) {
  unsigned char sum = 0;
  for (char c : body) sum = static_cast<unsigned char>(sum ^ static_cast<unsigned char>(c));
  char end[8];
  std::snprintf(end, sizeof(end), "*%02X\r\n", sum);
  return "$" + body + end;
}

TEST(NmeaTrack, CrossesMidnightWithItsDate) {
  const TempDir dir;
  const auto file = dir.Write("track.nmea", Nmea("GNGGA,235959.00,4800.6,N,00730.0,W,1,09,1.1,190.1,M,47.8,M,,") +
                                                Nmea("GNRMC,235959.00,A,4800.6,N,00730.0,W,0.5,90.0,120526,,,A") +
                                                Nmea("GNGST,000000.50,1,1,1,1,0.3,0.4,0.9") +
                                                Nmea("GNGGA,000000.50,4800.6,N,00730.0,W,4,09,1.1,190.1,M,47.8,M,,") +
                                                Nmea("GNRMC,000000.50,A,4800.6,N,00730.0,W,0.5,90.0,130526,,,A") +
                                                Nmea("GNGGA,000001.50,4800.6,N,00730.0,W,4,09,1.1,190.1,M,,M,,"));
  RunClock clock;
  clock.time_zero_utc_ns = 1'778'630'399 * kSecond;  // 2026-05-12T23:59:59Z
  const GpsTrack track = ReadNmea(file, clock);
  ASSERT_EQ(track.fixes.size(), 3u);
  EXPECT_EQ(track.fixes[0].stamp_ns, 0);
  EXPECT_EQ(track.fixes[1].stamp_ns, 3 * kSecond / 2);
  EXPECT_NEAR(track.fixes[0].position.latitude_deg, 48.01, 1e-12);
  EXPECT_NEAR(track.fixes[0].position.longitude_deg, -7.5, 1e-12);
  EXPECT_NEAR(track.fixes[0].position.height_m, 237.9, 1e-9);
  EXPECT_EQ(track.fixes[0].sigma_h_m, GpsFix().sigma_h_m);
  EXPECT_NEAR(track.fixes[1].sigma_h_m, std::sqrt((0.09 + 0.16) / 2), 1e-12);
  EXPECT_EQ(track.fixes[1].sigma_v_m, 0.9);
  EXPECT_EQ(track.fixes[1].sigma_sea_m, 0);
  EXPECT_EQ(track.fixes[2].sigma_h_m, 0.02);
  EXPECT_EQ(track.fixes[2].sigma_sea_m, kUnknownGeoidSigma);
  EXPECT_NEAR(OwnHeightSigma(track.fixes[2].sigma_v_m, kUnknownGeoidSigma), 0.04, 1e-9);
  EXPECT_THAT(Joined(track.warnings), HasSubstr("1 fix without geoid separation"));
}

TEST(NmeaTrack, CountsWhatItSkips) {
  const TempDir dir;
  const std::string good = Nmea("GPGGA,100000.00,4800.6,N,00730.0,E,1,09,1.1,190.1,M,47.8,M,,");
  std::string wrong = Nmea("GPGGA,100001.00,4800.6,N,00730.0,E,1,09,1.1,190.1,M,47.8,M,,");
  wrong[10] = '7';
  const std::string text = "noise\r\n" + good + wrong + Nmea("GPGGA,100002.00,,,,,0,00,,,M,,M,,") +
                           Nmea("GPGGA,100003.00,x,N,00730.0,E,1,09,1.1,1,M,1,M,,") + Nmea("GPVTG,1,T") +
                           "$GPGGA,100004.00,4800.6,N,00730.0,E,1,09,1.1,190.1,M,47.8,M,,\r\n" + "$GPGGA\r\n$\r\n";
  const auto file = dir.Write("t.nmea", text);
  const GpsTrack track = ReadNmea(file, {std::nullopt, "2026-05-14"});
  ASSERT_EQ(track.fixes.size(), 2u);
  EXPECT_EQ(track.fixes[0].stamp_ns, (1'778'716'800 + 36'000) * kSecond);
  const std::string warnings = Joined(track.warnings);
  EXPECT_THAT(warnings, HasSubstr("1 sentence with a wrong checksum skipped, the first on line 3"));
  EXPECT_THAT(warnings, HasSubstr("1 GGA sentence without a fix"));
  EXPECT_THAT(warnings, HasSubstr("1 GGA sentence without a readable time"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadNmea(file, {}); }),
              HasSubstr("give 'date: YYYY-MM-DD' (UTC) in run.yaml"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadNmea(dir.Write("n.nmea", "hello\n"), {}); }),
              HasSubstr("no NMEA sentence"));
}

TEST(NmeaTrack, FollowsDatesOverAPause) {
  const TempDir dir;
  std::string text;
  for (const char* day : {"120526", "150526"}) {
    text += Nmea("GPGGA,100000.00,4800.6,N,00730.0,E,1,09,1.1,190.1,M,47.8,M,,");
    text += Nmea(std::string("GPRMC,100000.00,A,4800.6,N,00730.0,E,0.5,90.0,") + day + ",,,A");
  }
  const GpsTrack track = ReadNmea(dir.Write("t.nmea", text), {});
  ASSERT_EQ(track.fixes.size(), 2u);
  EXPECT_EQ(track.fixes[1].stamp_ns - track.fixes[0].stamp_ns, 3 * 86400 * kSecond);
}

TEST(GpxTrack, ReadsTimedPoints) {
  const TempDir dir;
  const std::string head = "<?xml version=\"1.0\"?>\n<gpx version=\"1.1\"><trk><name>a &amp; b</name><trkseg>\n";
  const std::string text =
      head +
      "<trkpt lat=\"48.01\" lon=\"-7.5\"><ele>190.1</ele><time>2026-05-12T09:43:21Z</time><geoidheight>47.8"
      "</geoidheight></trkpt>\n<trkpt lat=\"48.02\" lon=\"7.5\"><ele>190</ele><time>2026-05-12T09:43:22.5Z</time>"
      "</trkpt>\n<trkpt lat=\"48.02\" lon=\"7.5\"/>\n<trkpt lat=\"98\" lon=\"7\"><time>2026-05-12T09:43:23Z</time>"
      "</trkpt>\n";
  RunClock clock;
  clock.time_zero_utc_ns = 1'778'579'000 * kSecond;
  const GpsTrack track = ReadGpx(dir.Write("t.gpx", text + "</trkseg></trk></gpx>\n"), clock);
  ASSERT_EQ(track.fixes.size(), 2u);
  EXPECT_EQ(track.fixes[0].stamp_ns, kSecond);
  EXPECT_EQ(track.fixes[1].stamp_ns, 5 * kSecond / 2);
  EXPECT_NEAR(track.fixes[0].position.height_m, 237.9, 1e-9);
  EXPECT_EQ(track.fixes[1].sigma_sea_m, kUnknownGeoidSigma);
  const std::string warnings = Joined(track.warnings);
  EXPECT_THAT(warnings, HasSubstr("1 track point without a time"));
  EXPECT_THAT(warnings,
              HasSubstr("t.gpx:6: expected lat and lon in degrees, found '98, 7'; 1 such track point skipped"));
  EXPECT_THAT(Joined(ReadGpx(dir.Write("cut.gpx", text), clock).warnings), HasSubstr("not valid XML"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadGpx(dir.Write("x.gpx", "<kml/>"), clock); }),
              HasSubstr("expected a GPX"));
  const auto problem = [&](const std::string& whole) {
    return MessageOf<InputError>([&] { ReadGpx(dir.Write("e.gpx", whole), clock); });
  };
  EXPECT_THAT(problem(head + "</trkseg></trk></gpx>"), HasSubstr("expected track points (trkpt), found none"));
  EXPECT_THAT(problem("<gpx><wpt lat=\"1\" lon=\"2\"/></gpx>"), HasSubstr("but 1 way or route point"));
  EXPECT_THAT(problem("\n"), HasSubstr("e.gpx: expected a GPX file, found an empty one"));
  EXPECT_THAT(problem("<gpx>\n<trkpt lat=\"1\" lon=\"2\"><time>12.05.2026 9:43</time></trkpt></gpx>"),
              HasSubstr("e.gpx:2: expected a time as 2026-05-12T09:43:20Z, found '12.05.2026 9:43'"));
  // Prefixes and case as other programs write them.
  const GpsTrack other =
      ReadGpx(dir.Write("p.gpx",
                        "<gpx:GPX xmlns:gpx=\"http://www.topografix.com/GPX/1/1\"><gpx:trkPt LAT=\"48\" Lon=\"7\">"
                        "<gpx:Ele>3</gpx:Ele><gpx:TIME>2026-05-12T09:43:21Z</gpx:TIME></gpx:trkPt></gpx:GPX>"),
              clock);
  ASSERT_EQ(other.fixes.size(), 1u);
  EXPECT_EQ(other.fixes[0].position.height_m, 3);
}

// A drive with turns at 5 m/s, odometry at 10 Hz with noise, GPS at 1 Hz.
trigpoint::Run Drive(double gps_sigma_m, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  trigpoint::Run run;
  run.dir = "runs/run1";
  const LocalFrame frame({48, 8, 200});
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double heading = 0;
  for (int i = 0; i <= 3000; ++i) {
    const double t = 0.1 * i;
    heading += 0.1 * 0.4 * std::sin(0.3 * t) * std::cos(0.05 * t);
    position += 0.5 * Eigen::Vector3d(std::cos(heading), std::sin(heading), 0);
    const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
    run.odometry.poses.push_back({i * kSecond / 10, {ExpSO3({0, 0, heading}), position + 0.01 * noise}});
    if (i % 10 != 0) continue;
    GpsFix fix;
    fix.stamp_ns = i * kSecond / 10;
    const Eigen::Vector3d error(normal(random), normal(random), normal(random));
    fix.position = frame.GeodeticFromEnu(ExpSO3({0, 0, 1}) * position + gps_sigma_m * error);
    run.gps.push_back(fix);
  }
  return run;
}

TEST(TimeCheck, FindsTheGpsOffsetAndStaysQuietWithout) {
  for (uint64_t seed : {1, 2, 3, 4, 5}) {
    trigpoint::Run run = Drive(0.5, seed);
    const TimeOffset none = CheckGpsTime(run);
    EXPECT_TRUE(none.observable);
    EXPECT_FALSE(none.warning) << *none.warning;
    EXPECT_LT(std::abs(none.offset_s), 3 * none.sigma_s);
    run.config.gps_time_offset_s = 1.25;
    for (GpsFix& fix : run.gps) fix.stamp_ns -= 18 * kSecond;
    const TimeOffset leap = CheckGpsTime(run);
    EXPECT_NEAR(leap.offset_s, 18, 3 * leap.sigma_s);
    ASSERT_TRUE(leap.warning);
    EXPECT_THAT(*leap.warning, HasSubstr("runs/run1/run.yaml: the GPS contradicts the declared time offset"));
    EXPECT_THAT(*leap.warning, HasSubstr("set gps.time_offset_s: 19."));
  }
}

TEST(TimeCheck, SaysNothingOnAStraightEvenDrive) {
  trigpoint::Run run = Drive(0.5, 1);
  const LocalFrame frame({48, 8, 200});
  for (TimedPose& pose : run.odometry.poses) {
    pose.target_from_body = {Eigen::Quaterniond::Identity(), {5e-9 * static_cast<double>(pose.stamp_ns), 0, 0}};
  }
  for (GpsFix& fix : run.gps) fix.position = frame.GeodeticFromEnu({5e-9 * static_cast<double>(fix.stamp_ns), 0, 0});
  EXPECT_FALSE(CheckGpsTime(run).warning);
  run.gps.clear();
  EXPECT_FALSE(CheckGpsTime(run).observable);
  EXPECT_FALSE(CheckGpsTime(trigpoint::Run()).observable);
}

TEST(TimeCheck, FindsTheOdometryOffset) {
  trigpoint::Run run = Drive(0.5, 1);
  // Cameras see the truth at 3 Hz from a camera mounted askew; the odometry's rotations are noisy.
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal(0, 0.002);
  const Eigen::Quaterniond body_from_cam = ExpSO3({0.3, -1.2, 0.5});
  Trajectory cameras;
  for (int64_t stamp = 0; stamp < 300 * kSecond; stamp += kSecond / 3) {
    const Rigid3d body = run.odometry.At(stamp, kSecond).value();
    cameras.poses.push_back({stamp, {body.rotation * body_from_cam, body.translation}});
  }
  for (TimedPose& pose : run.odometry.poses) {
    const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
    pose.target_from_body.rotation = ExpSO3(noise) * pose.target_from_body.rotation;
  }
  EXPECT_FALSE(CheckOdometryTime(run, cameras).warning);
  for (const double shift : {-0.7, 0.4, 12.0}) {
    trigpoint::Run shifted = run;
    for (TimedPose& pose : shifted.odometry.poses) pose.stamp_ns -= std::llround(shift * 1e9);
    const TimeOffset offset = CheckOdometryTime(shifted, cameras);
    EXPECT_NEAR(offset.offset_s, shift, 0.05);
    ASSERT_TRUE(offset.warning) << shift;
    EXPECT_THAT(*offset.warning, HasSubstr("set odometry.time_offset_s"));
  }
}

// Big-endian pieces of an MP4 with a track of telemetry, after the formats' public descriptions.
std::string Big(uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i));
  return text;
}
std::string Box(const std::string& type, const std::string& content) {
  return Big(content.size() + 8, 4) + type + content;
}
std::string Klv(const std::string& key, char type, size_t size, const std::string& value) {
  const std::string padding((4 - value.size() % 4) % 4, '\0');
  return key + type + Big(size, 1) + Big(size == 0 ? 0 : value.size() / size, 2) + value + padding;
}
std::string Container(const std::string& key, const std::string& value) { return Klv(key, '\0', 4, value); }

// Two payloads of one second each, `fixes` positions in each.
std::string GoProVideo(const std::string& describe, const std::function<std::string(int)>& fix, const std::string& key,
                       char type, size_t size, int fixes) {
  std::string payloads[2];
  int number = 0;
  for (std::string& payload : payloads) {
    std::string values;
    for (int k = 0; k < fixes; ++k) values += fix(number++);
    payload =
        Container("DEVC", Klv("DVNM", 'c', 1, "Camera") + Container("STRM", describe + Klv(key, type, size, values)));
  }
  const std::string file = Box("ftyp", "mp42");
  const uint64_t at = file.size() + 8;
  const std::string zero(4, '\0');
  const std::string stbl =
      Box("stsd", zero + Big(1, 4) + Box("gpmd", std::string(8, '\0'))) +
      Box("stts", zero + Big(1, 4) + Big(2, 4) + Big(1000, 4)) +
      Box("stsz", zero + Big(0, 4) + Big(2, 4) + Big(payloads[0].size(), 4) + Big(payloads[1].size(), 4)) +
      Box("stsc", zero + Big(1, 4) + Big(1, 4) + Big(2, 4) + Big(1, 4)) + Box("stco", zero + Big(1, 4) + Big(at, 4));
  const std::string mdia =
      Box("mdhd", zero + zero + zero + Big(1000, 4) + Big(2000, 4) + zero) + Box("minf", Box("stbl", stbl));
  return file + Box("mdat", payloads[0] + payloads[1]) +
         Box("moov", Box("mvhd", std::string(100, '\0')) + Box("trak", Box("mdia", mdia)));
}

TEST(GoPro, TheTrackIsReadFromTheVideo) {
  const TempDir dir;
  const auto scale =
      Klv("SCAL", 'l', 4, Big(10000000, 4) + Big(10000000, 4) + Big(1000, 4) + Big(1000, 4) + Big(100, 4));
  const auto gps5 = [](int i) {
    return Big(480000000 + static_cast<uint64_t>(i), 4) + Big(static_cast<uint32_t>(-78000000), 4) + Big(240500, 4) +
           Big(0, 8);
  };
  const auto video =
      GoProVideo(Klv("GPSF", 'L', 4, Big(3, 4)) + Klv("GPSP", 'S', 2, Big(250, 2)) + scale, gps5, "GPS5", 'l', 20, 4);
  const GpsTrack track = ReadGoProGps(dir.Write("a.mp4", video));
  ASSERT_EQ(track.fixes.size(), 8u);
  EXPECT_NEAR(track.fixes[3].position.latitude_deg, 48.0000003, 1e-12);
  EXPECT_NEAR(track.fixes[3].position.longitude_deg, -7.8, 1e-12);
  EXPECT_NEAR(track.fixes[3].position.height_m, 240.5, 1e-12);
  EXPECT_EQ(track.fixes[5].stamp_ns, kSecond * 5 / 4);
  // Without a lock, with heights above the sea, of another maker.
  EXPECT_TRUE(
      ReadGoProGps(dir.Write("b.mp4", GoProVideo(Klv("GPSF", 'L', 4, Big(0, 4)) + scale, gps5, "GPS5", 'l', 20, 4)))
          .fixes.empty());
  EXPECT_EQ(ReadGoProGps(dir.Write("c.mp4", GoProVideo(Klv("GPSA", 'F', 4, "MSLV") + scale, gps5, "GPS5", 'l', 20, 4)))
                .fixes.at(0)
                .sigma_sea_m,
            kUnknownGeoidSigma);
  EXPECT_TRUE(ReadGoProGps(dir.Write("d.mp4", Box("ftyp", "isom") + Box("moov", Box("trak", "")))).fixes.empty());
  EXPECT_TRUE(ReadGoProGps(dir.Write("e.avi", "RIFF....AVI LIST........")).fixes.empty());
}

TEST(SphericalVideo, IsKnownByWhatTheFileStates) {
  const TempDir dir;
  const auto video = [&](const std::string& track) {
    return dir.Write("v.mp4",
                     Box("ftyp", "isom") + Box("moov", Box("mvhd", std::string(100, '\0')) + Box("trak", track)));
  };
  const std::string head = "<rdf:SphericalVideo><GSpherical:Spherical>true</GSpherical:Spherical>";
  EXPECT_TRUE(IsSphericalVideo(
      video(Box("uuid", std::string(16, '\1') + head +
                            "<GSpherical:ProjectionType>equirectangular</GSpherical:ProjectionType>"))));
  const auto described = [&](const std::string& projection) {
    const std::string sample = Box("avc1", std::string(78, '\0') + Box("sv3d", Box("proj", Box(projection, "1234"))));
    return video(Box("mdia", Box("minf", Box("stbl", Box("stsd", std::string(8, '\0') + sample)))));
  };
  EXPECT_TRUE(IsSphericalVideo(described("equi")));
  EXPECT_FALSE(IsSphericalVideo(described("cbmp")));
  EXPECT_FALSE(IsSphericalVideo(video("")));
  EXPECT_FALSE(IsSphericalVideo(dir.Write("e.avi", "RIFF....AVI LIST........")));
}

TEST(GoPro, NewerCamerasStateFixAndDopOfEach) {
  const TempDir dir;
  std::string scales;
  for (uint64_t s : {10000000, 10000000, 1000, 1000, 100, 1, 1000, 100, 1}) scales += Big(s, 4);
  const auto gps9 = [](int i) {
    return Big(480000000, 4) + Big(78000000, 4) + Big(240500, 4) + Big(0, 8) + Big(8700, 4) +
           Big(1000 * static_cast<uint64_t>(i), 4) + Big(i == 1 ? 900 : 150, 2) + Big(i == 2 ? 2 : 3, 2);
  };
  const auto video =
      GoProVideo(Klv("TYPE", 'c', 1, "lllllllSS") + Klv("SCAL", 'l', 4, scales), gps9, "GPS9", '?', 32, 2);
  const GpsTrack track = ReadGoProGps(dir.Write("a.mp4", video));
  ASSERT_EQ(track.fixes.size(), 2u);
  EXPECT_THAT(Joined(track.warnings), HasSubstr("2 GPS fixes of the video"));
  // Every cut ends in a track or in a message.
  for (size_t size = 0; size < video.size(); size += 7) {
    try {
      ReadGoProGps(dir.Write("cut.mp4", video.substr(0, size)));
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr("cut.mp4"));
    }
  }
}

}  // namespace
}  // namespace trigpoint
