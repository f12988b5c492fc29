// Recordings of ROS: what is in them, what damage does, and the run that is made of one.
#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "datasets/import/bag_run.h"
#include "datasets/import/fast_png.h"
#include "datasets/io/camchain.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"
#include "tests/datasets/bag_writer.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr int kWidth = 40, kHeight = 30;

// body x forward, camera z forward, 0.1 m ahead and to the left of the body.
Rigid3d BodyFromCam(double left_m) { return {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.1, left_m, 0}}; }

cv::Mat Pattern(int channels) {
  cv::Mat picture(kHeight, kWidth, CV_MAKETYPE(CV_8U, channels));
  for (int k = 0; k < kHeight * kWidth * channels; ++k) picture.data[k] = static_cast<uint8_t>(37 * k % 251);
  return picture;
}

std::string ImageBytes(BagEncoding encoding, int64_t stamp_ns, const std::string& frame, const std::string& pixels,
                       const cv::Mat& picture) {
  const size_t bytes = picture.total() * picture.elemSize();
  return RosBytes(encoding)
      .Header(stamp_ns, frame)
      .Put(static_cast<uint32_t>(picture.rows))
      .Put(static_cast<uint32_t>(picture.cols))
      .Text(pixels)
      .Put(uint8_t{0})
      .Put(static_cast<uint32_t>(bytes / static_cast<size_t>(picture.rows)))
      .Block({picture.data, bytes})
      .bytes();
}

// Of a sensor `size` times as large as the pictures.
std::string InfoBytes(BagEncoding encoding, int64_t stamp_ns, double focal, uint32_t size = 1, uint32_t binning = 0) {
  RosBytes message(encoding);
  message.Header(stamp_ns, "cam").Put(size * kHeight).Put(size * kWidth).Text("plumb_bob").Put(uint32_t{5});
  message.Reals({-0.1, 0.01, 0.001, -0.002, 0}).Reals({focal, 0, 19.5, 0, focal, 14.5, 0, 0, 1});
  message.Reals({1, 0, 0, 0, 1, 0, 0, 0, 1}).Reals({focal + 5, 0, 20, 0, 0, focal + 5, 15, 0, 0, 0, 1, 0});
  return message.Put(binning)
      .Put(binning)
      .Put(uint32_t{0})
      .Put(uint32_t{0})
      .Put(uint32_t{0})
      .Put(uint32_t{0})
      .Put(uint8_t{0})
      .bytes();
}

void AddTransform(BagWriter* bag, const std::string& topic, int64_t stamp_ns, const std::string& parent,
                  const std::string& child, const Rigid3d& pose) {
  bag->Add(topic, "tf2_msgs/TFMessage", stamp_ns,
           RosBytes(bag->encoding()).Put(uint32_t{1}).Header(stamp_ns, parent).Text(child).Pose(pose).bytes());
}

// Ten moments of a stereo rig with odometry, GPS and an IMU.
void WriteDrive(BagWriter* bag) {
  const BagEncoding e = bag->encoding();
  AddTransform(bag, "/tf_static", kStart_ns, "base_link", "left_optical", BodyFromCam(0.2));
  AddTransform(bag, "/tf_static", kStart_ns, "/base_link", "/right_optical", BodyFromCam(-0.2));
  AddTransform(bag, "/tf_static", kStart_ns, "base_link", "gps", {Eigen::Quaterniond::Identity(), {0, 0, 1.5}});
  AddTransform(bag, "/tf_static", kStart_ns, "base_link", "imu", Rigid3d());
  for (int i = 0; i < 10; ++i) {
    const int64_t t = kStart_ns + i * 100'000'000, logged = t + 5'000'000;
    bag->Add("/left/image_raw", "sensor_msgs/Image", logged, ImageBytes(e, t, "left_optical", "mono8", Pattern(1)));
    bag->Add("/left/image_rect", "sensor_msgs/Image", logged, ImageBytes(e, t, "left_optical", "mono8", Pattern(1)));
    bag->Add("/left/camera_info", "sensor_msgs/CameraInfo", logged, InfoBytes(e, t, 50));
    bag->Add("/right/image_raw", "sensor_msgs/Image", logged, ImageBytes(e, t, "right_optical", "rgb8", Pattern(3)));
    bag->Add("/right/camera_info", "sensor_msgs/CameraInfo", logged, InfoBytes(e, t, 60));
    RosBytes odometry(e);
    odometry.Header(t, "odom").Text("base_link").Pose({Eigen::Quaterniond::Identity(), {0.5 * i, 0, 0}});
    bag->Add("/odom", "nav_msgs/Odometry", logged, odometry.Reals(std::vector<double>(36 + 6 + 36, 0)).bytes());
    RosBytes fix(e);
    fix.Header(t, "gps").Put(static_cast<int8_t>(i == 3 ? -1 : 0)).Put(uint16_t{1}).Reals({48 + 1e-6 * i, 7.8, 240.5});
    bag->Add("/fix", "sensor_msgs/NavSatFix", logged, fix.Reals({4, 0, 0, 0, 4, 0, 0, 0, 9}).Put(uint8_t{2}).bytes());
    RosBytes imu(e);
    imu.Header(t, "imu").Reals({0.0087265, 0, 0, 0.99996192}).Reals(std::vector<double>(9, 0.01));
    bag->Add("/imu", "sensor_msgs/Imu", logged, imu.Reals(std::vector<double>(3 + 9 + 3 + 9, 0)).bytes());
    bag->Add("/depth/image_raw", "sensor_msgs/Image", logged, ImageBytes(e, t, "left_optical", "16UC1", Pattern(2)));
    bag->Add("/chatter", "std_msgs/String", logged, RosBytes(e).Text("hello").bytes());
  }
  bag->Close();
}

ImportReport Import(const fs::path& site, const fs::path& bag, const BagRunOptions& options) {
  ProgressSink progress;
  return ImportBagRun(site, bag, options, progress, CancelToken());
}

struct Form {
  std::string name, file;
  std::function<std::unique_ptr<BagWriter>(const fs::path&)> write;
};

class Bags : public testing::TestWithParam<Form> {
 protected:
  Bags() : bag_(dir_ / GetParam().file) { WriteDrive(GetParam().write(bag_).get()); }
  TempDir dir_;
  fs::path bag_;
};

TEST_P(Bags, AreListed) {
  EXPECT_TRUE(IsBag(bag_));
  const BagContents contents = ListBag(bag_, CancelToken());
  ASSERT_EQ(contents.topics.size(), 11u);
  EXPECT_NEAR(1e-9 * static_cast<double>(contents.end_ns - contents.begin_ns), 0.9, 0.01);
  for (const BagTopic& topic : contents.topics)
    EXPECT_EQ(topic.messages, topic.name == "/tf_static" ? 4 : 10) << topic.name;
  const BagChoice choice = ChooseTopics(contents, {});
  ASSERT_EQ(choice.images.size(), 2u);
  EXPECT_EQ(choice.images[0].name, "/left/image_raw");
  EXPECT_EQ(choice.images[1].name, "/right/image_raw");
  EXPECT_EQ(choice.pose->name, "/odom");
  EXPECT_EQ(choice.problem, "");
  EXPECT_EQ(CameraInfoOf(contents, "/right/image_raw")->name, "/right/camera_info");
}

TEST_P(Bags, BecomeARun) {
  const fs::path site = dir_ / "site";
  BagRunOptions options;
  options.run = "drive";
  const ImportReport report = Import(site, bag_, options);
  EXPECT_TRUE(report.warnings.empty()) << Joined(report.warnings);
  EXPECT_THAT(Joined(report.lines), HasSubstr("cam0 looks along (1.000, 0.000, 0.000) of base_link"));
  EXPECT_THAT(Joined(report.lines), HasSubstr("z axis is 1.00 deg (median of 10)"));
  const trigpoint::Run run = ReadRun(site / "runs/drive", site);
  EXPECT_EQ(Joined(run.warnings), "");
  ASSERT_EQ(run.images.size(), 20u);
  EXPECT_EQ(run.images[3].stamp_ns, kStart_ns + 100'000'000);
  EXPECT_EQ(run.images[3].camera, 1);
  ASSERT_EQ(run.cameras.size(), 2u);
  EXPECT_EQ(run.cameras[1].camera.params(), (std::vector<double>{60, 60, 19.5, 14.5, -0.1, 0.01, 0.001, -0.002, 0}));
  EXPECT_LT(run.cameras[0].cam_from_body.Minus(BodyFromCam(0.2).Inverse()).norm(), 1e-6);
  EXPECT_LT(run.cameras[1].cam_from_body.Minus(BodyFromCam(-0.2).Inverse()).norm(), 1e-6);
  ASSERT_EQ(run.odometry.poses.size(), 10u);
  EXPECT_NEAR(run.odometry.poses[4].target_from_body.translation.x(), 2, 1e-9);
  ASSERT_EQ(run.gps.size(), 9u);
  EXPECT_NEAR(run.gps[3].position.latitude_deg, 48.000004, 1e-9);
  EXPECT_EQ(run.gps[0].sigma_h_m, 2);
  EXPECT_EQ(run.gps[0].sigma_v_m, 3);
  EXPECT_EQ(run.config.gps_lever_arm_m.z(), 1.5);
  EXPECT_EQ(run.config.date, "2023-11-14");
  // The pixels are those of the bag.
  const cv::Mat left = cv::imread(run.images[0].path.string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cv::norm(left, Pattern(1), cv::NORM_INF), 0);
  cv::Mat right = cv::imread(run.images[1].path.string(), cv::IMREAD_UNCHANGED);
  cv::cvtColor(right, right, cv::COLOR_BGR2RGB);
  EXPECT_EQ(cv::norm(right, Pattern(3), cv::NORM_INF), 0);
  EXPECT_THAT(MessageOf<InputError>([&] { Import(site, bag_, options); }), HasSubstr("is there already"));
}

TEST_P(Bags, GiveTheTopicsThatAreNamed) {
  BagRunOptions options;
  options.run = "one";
  options.topics = {"/left/image_rect"};
  options.every = 3;
  Import(dir_ / "site", bag_, options);
  const trigpoint::Run run = ReadRun(dir_ / "site/runs/one", dir_ / "site");
  EXPECT_EQ(run.images.size(), 4u);
  EXPECT_TRUE(run.odometry.poses.empty());
  // Rectified pictures have the camera of the projection matrix.
  EXPECT_EQ(run.cameras.at(0).camera.params(), (std::vector<double>{55, 55, 20, 15}));
  options.topics = {"/left/imagerect"};
  options.run = "two";
  EXPECT_THAT(MessageOf<OptionError>([&] { Import(dir_ / "site", bag_, options); }),
              HasSubstr("nearest: /left/image_rect"));
  options.topics = {"/chatter"};
  EXPECT_THAT(MessageOf<OptionError>([&] { Import(dir_ / "site", bag_, options); }),
              HasSubstr("found std_msgs/String"));
  EXPECT_FALSE(fs::exists(dir_ / "site/runs/two"));
  EXPECT_FALSE(fs::exists(dir_ / "site/runs/.import-two"));
}

// Every cut and every changed byte ends in a run or in a message; nothing else is left behind.
TEST_P(Bags, DamageIsNamed) {
  const std::string whole = [&] {
    std::ifstream in(bag_, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  }();
  BagRunOptions options;
  options.run = "damaged";
  int runs = 0, refused = 0;
  for (int k = 0; k < 24; ++k) {
    std::string broken = whole;
    const size_t at = 20 + (broken.size() - 20) * static_cast<size_t>(k) / 24;
    if (k % 2 == 0) {
      broken.resize(at);
    } else {
      for (size_t i = at; i < std::min(broken.size(), at + 8); ++i) broken[i] = static_cast<char>(0xFF - 3 * k);
    }
    const fs::path file = dir_.Write("broken" + bag_.extension().string(), broken);
    try {
      Import(dir_ / "site", file, options);
      ++runs;
      EXPECT_TRUE(fs::exists(dir_ / "site/runs/damaged/images.txt"));
      fs::remove_all(dir_ / "site");
    } catch (const Error& e) {
      ++refused;
      EXPECT_GT(std::string(e.what()).size(), 10u);
      EXPECT_FALSE(fs::exists(dir_ / "site"));
    }
  }
  EXPECT_GT(runs, 0);
  EXPECT_GT(refused, 0);
}

INSTANTIATE_TEST_SUITE_P(
    Forms, Bags,
    testing::Values(Form{"ros1", "a.bag", [](const fs::path& f) { return WriteRos1Bag(f, "none"); }},
                    Form{"ros1_bz2", "a.bag", [](const fs::path& f) { return WriteRos1Bag(f, "bz2"); }},
                    Form{"ros1_lz4", "a.bag", [](const fs::path& f) { return WriteRos1Bag(f, "lz4"); }},
                    Form{"mcap", "a.mcap", [](const fs::path& f) { return WriteMcap(f, ""); }},
                    Form{"mcap_lz4", "a.mcap", [](const fs::path& f) { return WriteMcap(f, "lz4"); }},
                    Form{"mcap_zstd", "a.mcap", [](const fs::path& f) { return WriteMcap(f, "zstd"); }},
                    Form{"mcap_ros1", "a.mcap",
                         [](const fs::path& f) { return WriteMcap(f, "zstd", BagEncoding::kRos1); }},
                    Form{"sqlite", "a.db3", [](const fs::path& f) { return WriteSqliteBag(f, false); }},
                    Form{"sqlite_zstd", "a.db3", [](const fs::path& f) { return WriteSqliteBag(f, true); }}),
    [](const auto& form) { return form.param.name; });

// A recording that was killed has no index.
TEST(Bag, IsReadAsFarAsItGoes) {
  const TempDir dir;
  {
    const auto bag = WriteMcap(dir / "whole.mcap", "");
    for (int i = 0; i < 100; ++i)
      bag->Add("/text", "std_msgs/String", i, RosBytes(bag->encoding()).Text(std::string(20000, 'x')).bytes());
    bag->Close();
  }
  fs::resize_file(dir / "whole.mcap", fs::file_size(dir / "whole.mcap") * 3 / 4);
  const BagContents contents = ListBag(dir / "whole.mcap", CancelToken());
  ASSERT_EQ(contents.topics.size(), 1u);
  EXPECT_GT(contents.topics[0].messages, 30);
  EXPECT_LT(contents.topics[0].messages, 80);
  EXPECT_THAT(Joined(contents.warnings), HasSubstr("is cut off; what lies before it is used"));
}

TEST(BagRun, LinksAreNotFollowedOut) {
  const TempDir dir;
  fs::create_directories(dir / "secret");
  WriteDrive(WriteMcap(dir / "secret/drive_0.mcap", "").get());
  fs::create_directories(dir / "real");
  fs::create_symlink("../secret/drive_0.mcap", dir / "real/drive_0.mcap");
  BagRunOptions options;
  options.run = "drive";
  EXPECT_THAT(MessageOf<InputError>([&] { Import(dir / "site", dir / "real", options); }),
              HasSubstr("real/drive_0.mcap: expected a file in"));
  EXPECT_FALSE(fs::exists(dir / "site/runs"));
  fs::remove(dir / "real/drive_0.mcap");
  fs::rename(dir / "secret/drive_0.mcap", dir / "real/all.mcap");
  fs::create_directory_symlink(dir / "real", dir / "from");  // the user may name a folder, and a file, by a link
  Import(dir / "site", dir / "from", options);
  fs::create_symlink(dir / "real/all.mcap", dir / "link.mcap");
  options.run = "again";
  Import(dir / "site", dir / "link.mcap", options);
  EXPECT_EQ(ReadRun(dir / "site/runs/again", dir / "site").images.size(), 20u);
}

TEST(Bag, StatesSizesThatAreBelieved) {
  const TempDir dir;
  // A chunk of 2^40 bytes; one that unpacks to more than it says.
  std::string mcap = "\x89MCAP0\r\n";
  mcap += '\x06' + std::string("\0\0\0\0\0\1\0\0", 8) + std::string(100, 'x');
  EXPECT_THAT(MessageOf<InputError>([&] { ListBag(dir.Write("a.mcap", mcap), CancelToken()); }),
              HasSubstr("holds no message"));
  EXPECT_THAT(MessageOf<InputError>([&] { ListBag(dir.Write("a.bag", "#ROSBAG V1.2\n"), CancelToken()); }),
              HasSubstr("version 2.0"));
  EXPECT_FALSE(IsBag(dir.Write("b.bag", "hello")));
  EXPECT_FALSE(IsBag(dir / "none"));
}

TEST(BagImages, EncodingsBecomeBgr) {
  const auto picture = [](const std::string& encoding, std::vector<uint8_t> bytes, uint32_t width, uint32_t height,
                          bool big = false) {
    RosImage image;
    image.width = width;
    image.height = height;
    image.step = static_cast<uint32_t>(bytes.size()) / height;
    image.encoding = encoding;
    image.big_endian = big;
    image.data = bytes;
    cv::Mat converted;
    return PictureOf(image, &converted).clone();
  };
  EXPECT_EQ(picture("mono16", {1, 2}, 1, 1, true).at<uint16_t>(0, 0), 0x0102);
  EXPECT_EQ(picture("mono16", {1, 2}, 1, 1).at<uint16_t>(0, 0), 0x0201);
  EXPECT_EQ(picture("rgba8", {1, 2, 3, 4}, 1, 1).at<cv::Vec3b>(0, 0), cv::Vec3b(3, 2, 1));
  // A plain red scene under each pattern.
  const std::vector<std::pair<std::string, std::vector<int>>> patterns = {{"bayer_rggb8", {1, 0, 0, 0}},
                                                                          {"bayer_bggr8", {0, 0, 0, 1}},
                                                                          {"bayer_gbrg8", {0, 0, 1, 0}},
                                                                          {"bayer_grbg8", {0, 1, 0, 0}}};
  for (const auto& [encoding, red] : patterns) {
    std::vector<uint8_t> bytes(64);
    for (size_t i = 0; i < 64; ++i) bytes[i] = static_cast<uint8_t>(200 * red[2 * (i / 8 % 2) + i % 2]);
    EXPECT_EQ(picture(encoding, bytes, 8, 8).at<cv::Vec3b>(4, 4), cv::Vec3b(0, 0, 200)) << encoding;
  }
  EXPECT_THROW(picture("32FC1", {0, 0, 0, 0}, 1, 1), InputError);
  EXPECT_THROW(picture("bgr8", {0, 0, 0, 0}, 2, 1), InputError);
  EXPECT_THROW(picture("mono8", {0, 0, 0, 0}, 1, 4'000'000'000u), InputError);
}

TEST(FastPng, LosesNothing) {
  cv::RNG random(7);
  FastPngWriter writer;  // one for all: larger, smaller, grey and colour pictures follow each other
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 1), cv::Size(3, 5), cv::Size(641, 33)}) {
    for (const int type : {CV_8UC1, CV_8UC3}) {
      for (const bool noise : {false, true}) {
        cv::Mat picture(size, type, cv::Scalar::all(77));
        if (noise) random.fill(picture, cv::RNG::UNIFORM, 0, 256);
        const std::string png(writer.Write(picture));
        const cv::Mat read = cv::imdecode(std::vector<char>(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
        ASSERT_EQ(read.size(), size);
        ASSERT_EQ(read.type(), type);
        EXPECT_EQ(cv::norm(read, picture, cv::NORM_INF), 0) << size << type << noise;
      }
    }
  }
  // A value so rare that its code would be too long: counts that grow like Fibonacci's numbers.
  std::vector<uint8_t> steep(1, 0);
  for (size_t value = 1, a = 1, b = 1; value < 26; ++value, std::swap(a, b), b += a) {
    steep.insert(steep.end(), b, static_cast<uint8_t>(steep.back()));
    for (size_t k = 0; k < b; ++k)
      steep[steep.size() - b + k] = static_cast<uint8_t>(steep[steep.size() - b + k - 1] + value);
  }
  const cv::Mat row(1, static_cast<int>(steep.size()), CV_8UC1, steep.data());
  const std::string png(writer.Write(row));
  EXPECT_EQ(cv::norm(cv::imdecode(std::vector<char>(png.begin(), png.end()), cv::IMREAD_UNCHANGED), row, cv::NORM_INF),
            0);
}

// Without calibration and without mounts.
TEST(BagRun, SaysWhatTheBagDoesNotHave) {
  const TempDir dir;
  const auto write = [&](const std::string& name, const std::vector<std::string>& topics) {
    const auto bag = WriteRos1Bag(dir / name, "none");
    for (const std::string& topic : topics) {
      for (int i = 0; i < 3; ++i)
        bag->Add(topic, "sensor_msgs/Image", i, ImageBytes(bag->encoding(), kStart_ns + i, "", "mono8", Pattern(1)));
    }
    for (const char* odometry : {"/wheel", "/visual"}) {
      bag->Add(odometry, "nav_msgs/Odometry", 1,
               RosBytes(bag->encoding()).Header(1, "odom").Text("base").Pose(Rigid3d()).bytes());
    }
    bag->Close();
    return dir / name;
  };
  const fs::path one = write("one.bag", {"/camera/image"}), two = write("two.bag", {"/a/image", "/b/image"});
  BagRunOptions options;
  options.run = "r";
  EXPECT_THAT(MessageOf<InputError>([&] { Import(dir / "site", one, options); }),
              HasSubstr("2 topics are nav_msgs/Odometry (/visual, /wheel); name all topics to be taken by --topic"));
  options.topics = {"/camera/image"};
  EXPECT_THAT(Joined(Import(dir / "site", one, options).warnings), HasSubstr("the bag has no camera_info of it"));
  EXPECT_THAT(ReadTextFile(dir / "site/runs/r/images.txt"),
              HasSubstr("1700000000.000000002 \"images/cam0/1700000000000000002.png\"\n"));
  options.run = "s";
  options.topics = {"/a/image", "/b/image"};
  EXPECT_THAT(MessageOf<InputError>([&] { Import(dir / "site", two, options); }),
              HasSubstr("no camera_info of it; calibrate the camera"));
  options.cameras = dir.Write("c.yaml",
                              "cam0: {camera_model: pinhole, intrinsics: [50, 50, 20, 15], distortion_model: none, "
                              "distortion_coeffs: [], resolution: [40, 30]}\n"
                              "cam1: {camera_model: pinhole, intrinsics: [51, 51, 20, 15], distortion_model: none, "
                              "distortion_coeffs: [], resolution: [40, 30],\n"
                              "  T_cn_cnm1: [[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}\n");
  Import(dir / "site", two, options);
  EXPECT_EQ(ReadRun(dir / "site/runs/s", dir / "site").cameras.at(1).camera.params()[0], 51);
}

// A camera_info of another size than the pictures, raw and compressed.
TEST(BagRun, CameraInfoFitsThePictures) {
  const TempDir dir;
  std::vector<uchar> jpeg;
  cv::imencode(".jpg", Pattern(1), jpeg);
  const auto cameras_of = [&](const std::string& name, bool compressed, uint32_t size, uint32_t binning,
                              std::string* warnings) {
    {
      const auto bag = WriteRos1Bag(dir / (name + ".bag"), "none");
      const BagEncoding e = bag->encoding();
      if (compressed) {
        bag->Add("/cam/image_raw/compressed", "sensor_msgs/CompressedImage", kStart_ns,
                 RosBytes(e).Header(kStart_ns, "cam").Text("jpeg").Block({jpeg.data(), jpeg.size()}).bytes());
      } else {
        bag->Add("/cam/image_raw", "sensor_msgs/Image", kStart_ns,
                 ImageBytes(e, kStart_ns, "cam", "mono8", Pattern(1)));
      }
      bag->Add("/cam/camera_info", "sensor_msgs/CameraInfo", kStart_ns, InfoBytes(e, kStart_ns, 50, size, binning));
      bag->Close();
    }
    BagRunOptions options;
    options.run = name;
    *warnings = Joined(Import(dir / "site", dir / (name + ".bag"), options).warnings);
    const fs::path camchain = dir / "site/runs" / name / "camchain.yaml";
    return fs::exists(camchain) ? ReadCamchain(camchain) : std::vector<BodyCamera>();
  };
  std::string warnings;
  EXPECT_EQ(cameras_of("same", true, 1, 0, &warnings).at(0).camera.params()[0], 50);
  for (const bool compressed : {false, true}) {
    const std::string name = compressed ? "jpeg" : "raw";
    EXPECT_TRUE(cameras_of(name, compressed, 2, 0, &warnings).empty());
    EXPECT_THAT(warnings, HasSubstr("expected a camera_info of 40 x 30 px, the size of its pictures, found 80 x 60"));
    const std::vector<BodyCamera> binned = cameras_of(name + "2", compressed, 2, 2, &warnings);
    ASSERT_EQ(binned.size(), 1u);
    EXPECT_EQ(binned[0].camera.width(), kWidth);
    // The middle between the first two of the sensor's pixels is the centre of the first of the picture's.
    EXPECT_THAT(binned[0].camera.params(), testing::ElementsAre(25, 25, 9.5, 7, -0.1, 0.01, 0.001, -0.002, 0));
  }
}

}  // namespace
}  // namespace trigpoint
