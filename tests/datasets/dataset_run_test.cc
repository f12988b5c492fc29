// Folders of public data sets as runs.
#include "datasets/import/dataset_run.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "datasets/io/site.h"
#include "datasets/io/text.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

void WritePicture(const fs::path& file, int width, int height) {
  fs::create_directories(file.parent_path());
  cv::imwrite(file.string(), cv::Mat(height, width, CV_8UC1, cv::Scalar(90)));
}

// A camera at the body's origin that looks ahead.
Rigid3d Forward() { return {Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Eigen::Vector3d::Zero()}; }

TEST(DatasetRun, Euroc) {
  const TempDir dir;
  for (int i = 0; i < 2; ++i) {
    const std::string cam = "MH_01/mav0/cam" + std::to_string(i);
    dir.Write(cam + "/sensor.yaml",
              "%YAML:1.0\n# rig\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, 0, 1, 0.1,\n   -1, 0, "
              "0, 0.2,\n   0, -1, 0, " +
                  std::to_string(i) +
                  ",\n   0, 0, 0, 1]\n"
                  "rate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458.654, 457.296, 367.215, "
                  "248.375]\n"
                  "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1.7e-05]\n");
    std::string rows = "#timestamp [ns],filename\r\n";
    for (int k = 0; k < 4; ++k) {
      const std::string stamp = "140363657976355558" + std::to_string(k);
      rows += stamp + "," + stamp + ".png\r\n";
      WritePicture(dir / (cam + "/data/" + stamp + ".png"), 752, 480);
    }
    dir.Write(cam + "/data.csv", rows);
  }
  dir.Write("MH_01/mav0/state_groundtruth_estimate0/data.csv",
            "#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, "
            "q_z\n1403636579763555580,1,2,3,1,0,0,0\n1403636580763555580,2,2,3,1,0,0,0\n");
  EXPECT_EQ(DatasetKind(dir / "MH_01"), "euroc");
  const fs::path site = dir / "site";
  const ImportReport report =
      ImportDatasetRun(site, dir / "MH_01", {"mh1", dir / "MH_01/mav0/state_groundtruth_estimate0/data.csv", "", 2});
  EXPECT_THAT(Joined(report.lines), HasSubstr("euroc: 4 images of 2 cameras"));
  const trigpoint::Run run = ReadRun(site / "runs/mh1", site);
  ASSERT_EQ(run.images.size(), 4u);
  EXPECT_EQ(run.images[2].stamp_ns, 1403636579763555582);
  ASSERT_EQ(run.cameras.size(), 2u);
  EXPECT_EQ(run.cameras[1].camera.params()[4], -0.28);
  EXPECT_LT((run.cameras[1].cam_from_body.TargetOriginInSource() - Eigen::Vector3d(0.1, 0.2, 1)).norm(), 1e-9);
  EXPECT_EQ(run.odometry.poses.at(1).target_from_body.translation, Eigen::Vector3d(2, 2, 3));
  // Transforms that are no motion: mirrored, twice as large, nothing.
  const std::string file = "MH_01/mav0/cam1/sensor.yaml", good = ReadTextFile(dir / file);
  const size_t at = good.find('['), end = good.find(']');
  for (const char* data : {"[0, 0, 1, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1",
                           "[0, 0, 2, 0, -2, 0, 0, 0, 0, -2, 0, 0, 0, 0, 0, 1", "[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0"}) {
    dir.Write(file, good.substr(0, at) + data + good.substr(end));
    EXPECT_THAT(MessageOf<InputError>([&] { DescribeDataset(dir / "MH_01"); }),
                AllOf(HasSubstr("cam1/sensor.yaml:"), HasSubstr("T_BS"), HasSubstr("no rigid motion")))
        << data;
  }
  dir.Write(file, good);
  fs::create_directories(dir / "secret");
  fs::create_symlink(dir / "secret", dir / "MH_01/mav0/cam1/data/more");
  EXPECT_THAT(MessageOf<InputError>([&] { DescribeDataset(dir / "MH_01"); }), HasSubstr("found a link out of it"));
}

TEST(DatasetRun, TumRgbd) {
  const TempDir dir;
  const std::string from = "rgbd_dataset_freiburg1_desk";
  dir.Write(from + "/rgb.txt",
            "# color images\n# timestamp filename\n1305031452.791720 rgb/1305031452.791720.png\n1305031452.823674 "
            "rgb/1305031452.823674.png\n");
  for (const char* name : {"1305031452.791720", "1305031452.823674"})
    WritePicture(dir / (from + "/rgb/" + name + ".png"), 640, 480);
  const fs::path poses = dir.Write("vo.txt", "1305031452.79 1 2 3 0 0 0 1\n1305031452.83 1 2 4 0 0 0 1\n"),
                 site = dir / "site";
  EXPECT_EQ(DatasetKind(dir / from), "tum-rgbd");
  ImportDatasetRun(site, dir / from, {"desk", poses, "", 1});
  const trigpoint::Run run = ReadRun(site / "runs/desk", site);
  ASSERT_EQ(run.images.size(), 2u);
  EXPECT_EQ(run.images[0].stamp_ns, 1305031452791720000);
  EXPECT_EQ(run.cameras.at(0).camera.params()[0], 517.3);
  // The file has the camera's poses: the camera is where it says.
  const Rigid3d odom_from_cam = run.odometry.poses.at(1).target_from_body * run.cameras[0].cam_from_body.Inverse();
  EXPECT_LT(odom_from_cam.Minus({Eigen::Quaterniond::Identity(), {1, 2, 4}}).norm(), 1e-9);
  // An unknown camera needs a calibration.
  fs::rename(dir / from, dir / "desk");
  EXPECT_THAT(Joined(ImportDatasetRun(site, dir / "desk", {"desk2", "", "", 1}).warnings),
              HasSubstr("name one by --cameras"));
  dir.Write("desk/rgb.txt", "1.0 ../../etc/passwd\n");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportDatasetRun(site, dir / "desk", {"desk3", "", "", 1});
              }),
              HasSubstr("rgb.txt:1: expected 'time file'"));
  EXPECT_FALSE(fs::exists(site / "runs/desk3"));
}

TEST(DatasetRun, KittiOdometry) {
  const TempDir dir;
  dir.Write("00/calib.txt", "P0: 700 0 600 0 0 710 180 0 0 0 1 0\nP1: 700 0 600 -378 0 710 180 0 0 0 1 0\nTr: 1 0\n");
  dir.Write("00/times.txt", "0.000000e+00\n1.036224e-01\n2.072e-01\n");
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 3; ++k)
      WritePicture(dir / ("00/image_" + std::to_string(i) + "/00000" + std::to_string(k) + ".png"), 1241, 376);
  }
  const fs::path poses = dir.Write("poses/00.txt",
                                   "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 0.9\n1 0 0 0 0 1 0 0 0 0 1 1.8\n"),
                 site = dir / "site";
  EXPECT_EQ(DescribeDataset(dir / "00"),
            "kitti: 6 images of 2 cameras, 2 calibrated; odometry: none in it, name a file of poses by --odometry");
  EXPECT_THAT(MessageOf<InputError>([&] { DescribeDataset(dir / "poses"); }), HasSubstr("expected a folder of EuRoC"));
  const std::string good = ReadTextFile(dir / "00/calib.txt");
  dir.Write("00/calib.txt", "P0: 700 0 600 0 0 710 180 0 0 0 1 0\nP1: 700 0 600 -37B 0 710 180 0 0 0 1 0\n");
  EXPECT_THAT(MessageOf<InputError>([&] { DescribeDataset(dir / "00"); }),
              HasSubstr("calib.txt:2: row 'P1': expected 12 numbers, found '-37B'"));
  dir.Write("00/calib.txt", good);
  ImportDatasetRun(site, dir / "00", {"k0", poses, "", 1});
  const trigpoint::Run run = ReadRun(site / "runs/k0", site);
  ASSERT_EQ(run.images.size(), 6u);
  EXPECT_EQ(run.images[2].stamp_ns, 103622400);
  ASSERT_EQ(run.cameras.size(), 2u);
  EXPECT_EQ(run.cameras[0].camera.params(), (std::vector<double>{700, 710, 600, 180}));
  // The right camera is 0.54 m to the right of the left one, which looks ahead and moves ahead.
  EXPECT_LT(run.cameras[0].cam_from_body.Minus(Forward()).norm(), 1e-9);
  EXPECT_LT((run.cameras[1].cam_from_body.TargetOriginInSource() - Eigen::Vector3d(0, -0.54, 0)).norm(), 1e-9);
  const Rigid3d moved = run.odometry.poses.at(0).target_from_body.Inverse() * run.odometry.poses.at(2).target_from_body;
  EXPECT_LT((moved.translation - Eigen::Vector3d(1.8, 0, 0)).norm(), 1e-9);
  dir.Write("poses/00.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportDatasetRun(site, dir / "00", {"k1", poses, "", 1});
              }),
              HasSubstr("expected one time for each pose"));
  EXPECT_FALSE(fs::exists(site / "runs/k1"));
}

// The colour pair: calib.txt's P2 and P3 lie beside camera 0, whose poses the file gives.
TEST(DatasetRun, KittiColourPairStandsBesideTheGreyOne) {
  const TempDir dir;
  dir.Write("01/calib.txt",
            "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -378 0 700 180 0 0 0 1 0\n"
            "P2: 700 0 600 42 0 700 180 -7 0 0 1 0\nP3: 700 0 600 -336 0 700 180 -7 0 0 1 0\n");
  dir.Write("01/times.txt", "0\n1\n");
  for (int i = 2; i < 4; ++i) {
    for (int k = 0; k < 2; ++k)
      WritePicture(dir / ("01/image_" + std::to_string(i) + "/00000" + std::to_string(k) + ".png"), 1241, 376);
  }
  // Camera 0 turns by 90 deg to the right where it stands: a body whose origin is elsewhere would move.
  const fs::path poses = dir.Write("poses/01.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 0 0 1 0 0 -1 0 0 0\n"),
                 site = dir / "site";
  ImportDatasetRun(site, dir / "01", {"k", poses, "", 1});
  const trigpoint::Run run = ReadRun(site / "runs/k", site);
  ASSERT_EQ(run.cameras.size(), 2u);
  // K t = (42, -7, 0): camera 0 is 0.06 m to the right and 0.01 m above in camera 2, 0.48 m to its left in camera 3.
  EXPECT_LT((run.cameras[0].cam_from_body * Eigen::Vector3d::Zero() - Eigen::Vector3d(0.06, -0.01, 0)).norm(), 1e-9);
  EXPECT_LT((run.cameras[1].cam_from_body * Eigen::Vector3d::Zero() - Eigen::Vector3d(-0.48, -0.01, 0)).norm(), 1e-9);
  const Rigid3d turned =
      run.odometry.poses.at(0).target_from_body.Inverse() * run.odometry.poses.at(1).target_from_body;
  EXPECT_LT(turned.translation.norm(), 1e-9);
  EXPECT_LT((turned.rotation * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitY()).norm(), 1e-9);
}

// KITTI's own files in a run's folder.
TEST(RunFolder, KittiPosesAreOdometry) {
  const TempDir dir;
  for (int k = 0; k < 3; ++k) WritePicture(dir / ("site/runs/k/images/" + std::to_string(k) + ".png"), 64, 48);
  dir.Write("site/runs/k/images.txt", "0 images/0.png\n0.5 images/1.png\n1 images/2.png\n");
  dir.Write(
      "site/runs/k/camchain.yaml",
      "cam0: {camera_model: pinhole, intrinsics: [50, 50, 32, 24], distortion_model: none, distortion_coeffs: [], "
      "resolution: [64, 48]}\n");
  dir.Write("site/runs/k/odometry.txt",
            "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 0.9\n1 0 0 0 0 1 0 0.1 0 0 1 1.8\n");
  EXPECT_THAT(MessageOf<InputError>([&] { ReadRun(dir / "site/runs/k", dir / "site"); }),
              HasSubstr("odometry.txt: expected times.txt beside it"));
  dir.Write("site/runs/k/times.txt", "0.000000e+00\n5.0e-01\n1.0\n");
  const trigpoint::Run run = ReadRun(dir / "site/runs/k", dir / "site");
  ASSERT_EQ(run.odometry.poses.size(), 3u);
  EXPECT_EQ(run.odometry.poses[1].stamp_ns, 500'000'000);
  // Ahead is the body's x, the camera's down its -z.
  const Rigid3d moved = run.odometry.poses[0].target_from_body.Inverse() * run.odometry.poses[2].target_from_body;
  EXPECT_LT((moved.translation - Eigen::Vector3d(1.8, 0, -0.1)).norm(), 1e-9);
  // The first camera looks to the left, 1 m ahead of the body's origin: its way ahead is the body's y.
  dir.Write(
      "site/runs/k/camchain.yaml",
      "cam0: {camera_model: pinhole, intrinsics: [50, 50, 32, 24], distortion_model: none, distortion_coeffs: [], "
      "resolution: [64, 48], T_cam_imu: [[1, 0, 0, -1], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]}\n");
  const trigpoint::Run sideways = ReadRun(dir / "site/runs/k", dir / "site");
  const Rigid3d left =
      sideways.odometry.poses[0].target_from_body.Inverse() * sideways.odometry.poses[2].target_from_body;
  EXPECT_LT((left.translation - Eigen::Vector3d(0, 1.8, -0.1)).norm(), 1e-9) << left.translation.transpose();
  dir.Write("site/runs/k/times.txt", "0\n0.5\n");
  EXPECT_THAT(MessageOf<InputError>([&] { ReadRun(dir / "site/runs/k", dir / "site"); }),
              HasSubstr("expected one time for each pose"));
  // Twelve words are not twelve numbers.
  dir.Write("site/runs/k/odometry.txt",
            "timestamp [s], tx [m], ty [m], tz [m], qx, qy, qz, qw\n0, 0, 0, 0, 0, 0, 0, 1\n1, 2, 0, 0, 0, 0, 0, 1\n");
  EXPECT_EQ(ReadRun(dir / "site/runs/k", dir / "site").odometry.poses.size(), 2u);
}

// A phone that looks along the world's -z (ARKit's forward) and moves there by a metre, y up.
TEST(DatasetRun, Record3d) {
  const TempDir dir;
  dir.Write("walk/metadata", R"({"h": 480, "w": 640, "K": [500, 0, 0, 0, 501, 0, 320, 240, 1], "fps": 60,
    "poses": [[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0.5, -1]], "frameTimestamps": [7.5, 8.25]})");
  for (const char* name : {"0.jpg", "1.jpg"}) WritePicture(dir / (std::string("walk/rgbd/") + name), 640, 480);
  const fs::path site = dir / "site";
  EXPECT_EQ(DatasetKind(dir / "walk"), "record3d");
  EXPECT_EQ(DescribeDataset(dir / "walk"), "record3d: 2 images of 1 camera, 1 calibrated; odometry: 2 poses");
  ImportDatasetRun(site, dir / "walk", {"walk", "", "", 1});
  const trigpoint::Run run = ReadRun(site / "runs/walk", site);
  ASSERT_EQ(run.images.size(), 2u);
  EXPECT_EQ(run.images[1].stamp_ns, 8'250'000'000);
  EXPECT_EQ(run.cameras.at(0).camera.params(), (std::vector<double>{500, 501, 320, 240}));
  EXPECT_TRUE(run.config.odometry_levelled);
  ASSERT_EQ(run.odometry.poses.size(), 2u);
  // z is up in the odometry's frame, and the body's x is forward.
  const Rigid3d& first = run.odometry.poses[0].target_from_body;
  const Rigid3d& second = run.odometry.poses[1].target_from_body;
  EXPECT_LT((first.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_LT(((first.Inverse() * second).translation - Eigen::Vector3d(1, 0, 0.5)).norm(), 1e-9);
  const auto problem = [&](const std::string& poses, const std::string& times) {
    dir.Write("walk/metadata", R"({"h": 480, "w": 640, "K": [500, 0, 0, 0, 501, 0, 320, 240, 1], "poses": )" + poses +
                                   R"(, "frameTimestamps": )" + times + "}");
    return MessageOf<InputError>([&] { ImportDatasetRun(site, dir / "walk", {"w3", "", "", 1}); });
  };
  EXPECT_THAT(problem("[[0, 0, 0, 1, 0, 0, 0]]", "[7.5]"), HasSubstr("1 poses, but "));
  EXPECT_THAT(problem("[[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 2, 0, 0, 0]]", "[7.5, 8]"),
              HasSubstr("pose 1 of 2: expected a unit quaternion, found one of length 2"));
  EXPECT_THAT(problem("[[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0, 0]]", "[7.5, 7.25]"),
              HasSubstr("pose 1 of 2: expected a time not before"));
  // Recordings of early versions have a rate in place of times.
  const std::string early = R"({"h": 480, "w": 640, "K": [500, 0, 0, 0, 501, 0, 320, 240, 1],
    "poses": [[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0.5, -1]], "fps": )";
  dir.Write("walk/metadata", early + "4}");
  ImportDatasetRun(site, dir / "walk", {"early", "", "", 1});
  EXPECT_EQ(ReadRun(site / "runs/early", site).images.at(1).stamp_ns, 250'000'000);
  dir.Write("walk/metadata", early + "0}");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportDatasetRun(site, dir / "walk", {"w4", "", "", 1});
              }),
              HasSubstr("expected fps above 0, found 0"));
  dir.Write("walk/metadata", R"({"K": [1]})");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportDatasetRun(site, dir / "walk", {"w2", "", "", 1});
              }),
              HasSubstr("expected Record3D's metadata"));
}

// Two seconds.
void WriteVideo(const fs::path& file) {
  cv::VideoWriter video(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, {64, 48});
  ASSERT_TRUE(video.isOpened());
  for (int i = 0; i < 20; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(10 * i)));
}

// The same walk as the loggers of ARCore and ARKit write it.
TEST(VideoRun, PhoneLogsAreOdometry) {
  const TempDir dir;
  WriteVideo(dir / "walk.avi");
  const fs::path arcore = dir.Write("ARCore_sensor_pose.txt",
                                    "52345678901234, 0, 0, 0, 1, 3, 0, 0\n52346678901234, 0, 0, 0, 1, 3, 0.5, -1\n");
  const fs::path arkit = dir.Write("ARKit_camera_pose.txt",
                                   "52345678901234, 1, 0, 0, 3, 0, 1, 0, 0, 0, 0, 1, 0\n"
                                   "52346678901234, 1, 0, 0, 3, 0, 1, 0, 0.5, 0, 0, 1, -1\n");
  const fs::path site = dir / "site";
  for (const auto& [name, log] : {std::pair{"arcore", arcore}, std::pair{"arkit", arkit}}) {
    const ImportReport report = ImportVideoRun(site, dir / "walk.avi", {name, log, "", 1});
    EXPECT_THAT(Joined(report.warnings), HasSubstr("is on the phone's own clock"));
    const trigpoint::Run run = ReadRun(site / "runs" / name, site);
    EXPECT_TRUE(run.config.odometry_levelled);
    ASSERT_EQ(run.odometry.poses.size(), 2u);
    EXPECT_EQ(run.odometry.poses[0].stamp_ns, 0);
    EXPECT_NEAR(1e-9 * static_cast<double>(run.odometry.poses[1].stamp_ns), 1, 1e-6);
    const Rigid3d moved = run.odometry.poses[0].target_from_body.Inverse() * run.odometry.poses[1].target_from_body;
    EXPECT_LT((moved.translation - Eigen::Vector3d(1, 0, 0.5)).norm(), 1e-9);
  }
  const auto problem = [&](const std::string& name, const std::string& text) {
    const fs::path log = dir.Write(name, text);
    return MessageOf<InputError>([&] { ImportVideoRun(site, dir / "walk.avi", {"c", log, "", 1}); });
  };
  EXPECT_THAT(problem("c_ARCore_sensor_pose.txt", "1, 0, 0, 0, 1, 3, 0, 0\n2, 0, 0, 0.5, 1, 3, 0, 0\n"),
              HasSubstr("c_ARCore_sensor_pose.txt:2: expected a unit quaternion, found one of length 1.118"));
  EXPECT_THAT(problem("c_ARCore_sensor_pose.txt", "9, 0, 0, 0, 1, 3, 0, 0\n2, 0, 0, 0, 1, 3, 0, 0\n"),
              HasSubstr("c_ARCore_sensor_pose.txt:2: expected a time not before"));
  EXPECT_THAT(problem("c_ARKit_camera_pose.txt", "1, 1, 0, 0, 3, 0, 2, 0, 0, 0, 0, 1, 0\n"),
              HasSubstr("c_ARKit_camera_pose.txt:1: expected the rows of [R | t]"));
  const fs::path broken = dir.Write("b_ARCore_sensor_pose.txt", "1, 2, 3\n");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportVideoRun(site, dir / "walk.avi", {"b", broken, "", 1});
              }),
              HasSubstr("b_ARCore_sensor_pose.txt:1: expected a time in ns"));
}

// Two unrelated cameras are no rig of a video or of a folder.
TEST(DatasetRun, UnrelatedCamerasAreRefused) {
  const TempDir dir;
  const fs::path site = dir / "site", video = dir.Write("VID_1.mp4", "x");
  const fs::path cameras =
      dir.Write("cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n2 PINHOLE 640 480 600 600 320 240\n");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportVideoRun(site, video, {"a", "", cameras, 1});
              }),
              HasSubstr("expected 1 camera, as a video has, found 2 (cam0, cam1)"));
  dir.Write("00/calib.txt", "P0: 700 0 600 0 0 710 180 0 0 0 1 0\nP1: 700 0 600 -378 0 710 180 0 0 0 1 0\n");
  dir.Write("00/times.txt", "0.0\n");
  for (const char* file : {"00/image_0/000000.png", "00/image_1/000000.png"}) WritePicture(dir / file, 640, 480);
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportDatasetRun(site, dir / "00", {"b", "", cameras, 1});
              }),
              HasSubstr("expected how its cameras cam0, cam1 sit to each other"));
  EXPECT_FALSE(fs::exists(site / "runs/b"));
}

TEST(VideoRun, Insta360IsNotRead) {
  const TempDir dir;
  const fs::path site = dir / "site", own = dir.Write("VID_1.insv", "x");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportVideoRun(site, own, {"a", "", "", 1});
              }),
              HasSubstr("in a form that is not published"));
  EXPECT_THAT(MessageOf<InputError>([&] { DescribeVideo(own); }), HasSubstr("in a form that is not published"));
  const fs::path exported = dir.Write("VID_1.mp4", "xxxx8db42d694ccc418790edff439fe026bf");
  EXPECT_THAT(Joined(ImportVideoRun(site, exported, {"b", "", "", 1}).warnings),
              HasSubstr("is not read; export the GPX"));
  EXPECT_EQ(DescribeVideo(exported), "video, no track of its name beside it");
  dir.Write("VID_1.gpx", "<gpx/>");
  EXPECT_EQ(DescribeVideo(exported), "video, track VID_1.gpx");
}

TEST(VideoRun, TakesTheTrackBesideIt) {
  const TempDir dir;
  WriteVideo(dir / "drive.avi");
  dir.Write(
      "drive.gpx",
      "<gpx version=\"1.1\"><trk><trkseg><trkpt lat=\"48\" lon=\"7.8\"><time>2026-05-12T09:43:20.5Z</time></trkpt>"
      "<trkpt lat=\"48.00001\" lon=\"7.8\"><time>2026-05-12T09:43:21.5Z</time></trkpt></trkseg></trk></gpx>");
  const fs::path cameras = dir.Write("c.yaml",
                                     "cam0: {camera_model: pinhole, intrinsics: [50, 50, 32, 24], distortion_model: "
                                     "none, distortion_coeffs: [], resolution: [64, 48]}\n");
  const fs::path site = dir / "site";
  const ImportReport report = ImportVideoRun(site, dir / "drive.avi", {"drive", "", cameras, 2});
  EXPECT_THAT(Joined(report.warnings),
              HasSubstr("states no start time that fits drive.gpx (within 1 h): taken as its first time"));
  const trigpoint::Run run = ReadRun(site / "runs/drive", site);
  EXPECT_EQ(run.images.size(), 10u);
  ASSERT_EQ(run.gps.size(), 2u);
  EXPECT_EQ(run.gps[0].stamp_ns, 0);
  EXPECT_EQ(run.gps[1].stamp_ns, 1'000'000'000);
  fs::create_directories(dir / "secret");
  fs::rename(dir / "drive.gpx", dir / "secret/track.gpx");
  fs::create_symlink("secret/track.gpx", dir / "drive.gpx");
  EXPECT_NO_THROW(DescribeVideo(dir / "drive.avi"));
  fs::create_directories(dir / "from");
  fs::rename(dir / "drive.avi", dir / "from/drive.avi");
  fs::create_symlink("../secret/track.gpx", dir / "from/drive.gpx");
  EXPECT_THAT(MessageOf<InputError>([&] {
                ImportVideoRun(site, dir / "from/drive.avi", {"second", "", cameras, 2});
              }),
              HasSubstr("drive.gpx: expected a file in"));
  EXPECT_FALSE(fs::exists(site / "runs/second"));
}

}  // namespace
}  // namespace trigpoint
