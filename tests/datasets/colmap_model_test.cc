#include <gmock/gmock.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>

#include "calib/base/error.h"
#include "datasets/colmap/model.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

fs::path SharedModels() {
  const char* set = std::getenv("TRIGPOINT_SHARED_DATA");
  return fs::path(set != nullptr ? set : "../shared/data") / "colmap_models";
}

// Two cameras, three images, four points, numbers that need all their digits.
SparseModel SmallModel() {
  SparseModel model;
  model.cameras.emplace_back(
      3, Camera(CameraModel::kRadtan, 640, 480, {500.1, 501.2, 320.3, 240.4, -.1, .01, 1e-4, 2e-4}));
  model.cameras.emplace_back(7,
                             Camera(CameraModel::kKannalaBrandt, 800, 800, {300, 300, 400, 401, .1, .02, .003, .0004}));
  for (uint32_t i = 0; i < 3; ++i) {
    ModelImage image;
    image.id = 10 + i;
    image.name = "images/a b_" + std::to_string(i) + ".jpg";
    image.camera_id = i == 2 ? 7 : 3;
    image.cam_from_world = {ExpSO3({0.1 * i, -0.2, 1.0 / 3}), {i / 7.0, 1.5, -2.0 / 3}};
    for (int k = 0; k < 4; ++k) {
      image.pixels.emplace_back(100 + k / 3.0 + i, 50 - k / 7.0);
      image.points.push_back(k == 3 && i == 1 ? -1 : 100 + k);
    }
    model.images.push_back(image);
  }
  for (int k = 0; k < 4; ++k) {
    ModelPoint point;
    point.id = 100 + k;
    point.position = {k / 3.0, -k / 7.0, 5};
    point.error_px = 0.123456789012345678;
    point.rgb = {1, 2, static_cast<uint8_t>(k)};
    for (uint32_t i = 0; i < 3; ++i) {
      if (k != 3 || i != 1) point.track.emplace_back(10 + i, k);
    }
    model.points.push_back(point);
  }
  return model;
}

void ExpectEqual(const SparseModel& a, const SparseModel& b, double tolerance = 1e-12) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].first, b.cameras[i].first);
    EXPECT_EQ(a.cameras[i].second.model(), b.cameras[i].second.model());
    EXPECT_THAT(a.cameras[i].second.params(),
                testing::Pointwise(testing::DoubleNear(1e-9), b.cameras[i].second.params()));
  }
  ASSERT_EQ(a.images.size(), b.images.size());
  for (size_t i = 0; i < a.images.size(); ++i) {
    EXPECT_EQ(a.images[i].id, b.images[i].id);
    EXPECT_EQ(a.images[i].name, b.images[i].name);
    EXPECT_EQ(a.images[i].camera_id, b.images[i].camera_id);
    EXPECT_LT(a.images[i].cam_from_world.Minus(b.images[i].cam_from_world).norm(), tolerance);
    EXPECT_EQ(a.images[i].points, b.images[i].points);
    ASSERT_EQ(a.images[i].pixels.size(), b.images[i].pixels.size());
    for (size_t k = 0; k < a.images[i].pixels.size(); ++k) {
      EXPECT_LT((a.images[i].pixels[k] - b.images[i].pixels[k]).norm(), 1e-9);
    }
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t k = 0; k < a.points.size(); ++k) {
    EXPECT_EQ(a.points[k].id, b.points[k].id);
    EXPECT_LT((a.points[k].position - b.points[k].position).norm(), tolerance);
    EXPECT_EQ(a.points[k].rgb, b.points[k].rgb);
    EXPECT_NEAR(a.points[k].error_px, b.points[k].error_px, tolerance);
    EXPECT_EQ(a.points[k].track, b.points[k].track);
  }
}

std::map<std::string, std::string> Files(const fs::path& dir) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(dir)) {
    std::ifstream in(entry.path(), std::ios::binary);
    files[entry.path().filename()] = {std::istreambuf_iterator<char>(in), {}};
  }
  return files;
}

std::map<std::string, std::string> FilesOf(const SparseModel& model, ModelFormat format) {
  const TempDir dir;
  WriteColmapModel(model, dir.path(), format);
  return Files(dir.path());
}

std::string Refusal(const std::map<std::string, std::string>& files) {
  try {
    ParseColmapModel(files, "m");
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(ColmapModel, BothFormatsKeepEveryNumber) {
  const SparseModel model = SmallModel();
  for (ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
    ExpectEqual(model, ParseColmapModel(FilesOf(model, format), "m"));
  }
}

TEST(ColmapModel, ColmapItselfReadsWhatIsWritten) {
  if (std::system("command -v colmap >/dev/null 2>&1") != 0) GTEST_SKIP() << "colmap is not installed";
  SparseModel model = SmallModel();
  for (ModelImage& image : model.images) image.name.erase(8, 1);  // its own text reader ends a name at a space
  for (ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
    const TempDir dir;
    const fs::path in = dir.path() / "in", out = dir.path() / "out";
    WriteColmapModel(model, in, format);
    for (const char* type : {"BIN", "TXT"}) {
      fs::create_directories(out);
      const std::string command = "colmap model_converter --input_path '" + in.string() + "' --output_path '" +
                                  out.string() + "' --output_type " + type + " >/dev/null 2>&1";
      ASSERT_EQ(std::system(command.c_str()), 0) << command;
      SparseModel back = ReadColmapModel(out);
      std::sort(back.points.begin(), back.points.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
      std::sort(back.images.begin(), back.images.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
      std::sort(back.cameras.begin(), back.cameras.end(),
                [](const auto& a, const auto& b) { return a.first < b.first; });
      ExpectEqual(model, back, 1e-9);
      fs::remove_all(out);
    }
  }
}

TEST(ColmapModel, EveryCutIsRefusedInOneSentence) {
  const auto files = FilesOf(SmallModel(), ModelFormat::kBinary);
  for (const auto& [name, bytes] : files) {
    for (size_t size = 0; size < bytes.size(); ++size) {
      auto cut = files;
      cut[name].resize(size);
      const std::string refusal = Refusal(cut);
      ASSERT_THAT(refusal, HasSubstr("m/" + name)) << size;
      ASSERT_EQ(refusal.find('\n'), std::string::npos);
    }
  }
}

TEST(ColmapModel, HugeCountsAreRefusedAtOnce) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    for (const uint64_t count : {uint64_t{1} << 20, uint64_t{1} << 40, ~uint64_t{0}}) {
      auto files = FilesOf(SmallModel(), ModelFormat::kBinary);
      std::memcpy(files[name].data(), &count, sizeof count);
      EXPECT_THAT(Refusal(files), testing::AllOf(HasSubstr(name), HasSubstr(std::to_string(count))));
    }
  }
}

TEST(ColmapModel, DamagedBytesNeverCrash) {
  const auto files = FilesOf(SmallModel(), ModelFormat::kBinary);
  int refused = 0;
  for (const auto& [name, bytes] : files) {
    for (size_t at = 0; at < bytes.size(); ++at) {
      for (const char value : {'\x00', '\xff', '\x7f'}) {
        auto damaged = files;
        damaged[name][at] = value;
        refused += Refusal(damaged).empty() ? 0 : 1;
      }
    }
  }
  EXPECT_GT(refused, 500);
}

TEST(ColmapModel, IdsThatDoNotFitAreNamed) {
  const auto refusal = [](const std::function<void(SparseModel&)>& damage) {
    SparseModel model = SmallModel();
    damage(model);
    return Refusal(FilesOf(model, ModelFormat::kBinary));
  };
  EXPECT_THAT(refusal([](SparseModel& m) { m.images[1].camera_id = 9; }), HasSubstr("camera 9"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.images[1].id = 10; }), HasSubstr("image 10 is there twice"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.images[1].name = m.images[0].name; }), HasSubstr("is there twice"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.images[1].points[0] = 5; }), HasSubstr("point 5"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.points[1].id = 100; }), HasSubstr("point 100 is there twice"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.points[1].track[0].first = 77; }), HasSubstr("image 77"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.points[1].track[0].second = 77; }), HasSubstr("pixel 77"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.points[1].position.x() = std::nan(""); }), HasSubstr("finite"));
  EXPECT_THAT(refusal([](SparseModel& m) { m.cameras.clear(); }), HasSubstr("camera 3"));
}

TEST(ColmapModel, UnknownCameraModelsAreNamed) {
  const char* kImages = "";
  const auto refusal = [&](const std::string& camera) {
    return Refusal({{"cameras.txt", camera}, {"images.txt", kImages}, {"points3D.txt", ""}});
  };
  EXPECT_THAT(refusal("1 WARPED 640 480 1 2 3\n"), testing::AllOf(HasSubstr("cameras.txt:1"), HasSubstr("WARPED")));
  EXPECT_THAT(refusal("1 FOV 640 480 500 500 320 240 0.9\n"), HasSubstr("FOV"));
  EXPECT_THAT(refusal("1 PINHOLE 640 480 500 500 320\n"), HasSubstr("expected 4"));
  EXPECT_THAT(refusal("1 PINHOLE 0 480 500 500 320 240\n"), HasSubstr("0 x 480"));
  EXPECT_THAT(refusal("1 PINHOLE 640 480 500 x 320 240\n"), HasSubstr("'x'"));
  EXPECT_EQ(refusal("1 SIMPLE_FISHEYE 640 480 500 320 240\n"), "");
}

TEST(ColmapModel, RigsAndFramesOfColmap4) {
  std::map<std::string, std::string> files = {
      {"cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n2 PINHOLE 640 480 500 500 320 240\n"},
      {"images.txt", "1 1 0 0 0 0 0 0 1 l/0.jpg\n\n2 1 0 0 0 -0.5 0 0 2 r/0.jpg\n\n"},
      {"points3D.txt", ""},
      {"rigs.txt", "# rigs\n1 3 CAMERA 1 CAMERA 2 1 1 0 0 0 -0.5 0 0 IMU 4 0\n"},
      {"frames.txt", "5 1 1 0 0 0 0 0 0 2 CAMERA 1 1 CAMERA 2 2\n"}};
  const SparseModel model = ParseColmapModel(files, "m");
  ASSERT_EQ(model.rigs.size(), 1U);
  ASSERT_EQ(model.rigs[0].cameras.size(), 2U);
  EXPECT_DOUBLE_EQ(model.rigs[0].cameras[1].second.translation.x(), -0.5);
  ASSERT_EQ(model.frames.size(), 1U);
  EXPECT_THAT(model.frames[0].images, testing::ElementsAre(1U, 2U));

  const auto with = [&](const char* name, const char* text) {
    auto changed = files;
    changed[name] = text;
    return Refusal(changed);
  };
  EXPECT_THAT(with("frames.txt", "5 9 1 0 0 0 0 0 0 0\n"), HasSubstr("rig 9"));
  EXPECT_THAT(with("frames.txt", "5 1 1 0 0 0 1 0 0 1 CAMERA 1 1\n"), HasSubstr("pose differs"));
  EXPECT_THAT(with("frames.txt", "5 1 1 0 0 0 0 0 0 1 CAMERA 1 1\n6 1 1 0 0 0 0 0 0 1 CAMERA 1 1\n"),
              HasSubstr("two frames"));
  EXPECT_THAT(with("rigs.txt", "1 2 CAMERA 1 CAMERA 8 1 1 0 0 0 0 0 0\n"), HasSubstr("camera 8"));
  EXPECT_THAT(with("rigs.txt", "1 2 CAMERA 1 CAMERA 2 0\n"), HasSubstr("no pose"));
  EXPECT_THAT(with("rigs.txt", "1 999999999 CAMERA 1\n"), HasSubstr("rigs.txt:1"));
  EXPECT_THAT(with("rigs.txt", "1 1 LIDAR 1\n"), HasSubstr("LIDAR"));
}

TEST(ColmapModel, RealModelsOfOthersAreRead) {
  if (!fs::exists(SharedModels())) GTEST_SKIP() << "no shared data";
  const SparseModel fountain = ReadColmapModel(SharedModels() / "fountain_p11_colmap38");
  EXPECT_EQ(fountain.images.size(), 11U);
  EXPECT_EQ(fountain.points.size(), 4435U);
  const SparseModel crane = ReadColmapModel(SharedModels() / "crane_mast_8imgs_colmap_output");
  EXPECT_EQ(crane.images.size(), 8U);
  EXPECT_EQ(crane.points.size(), 2122U);
  EXPECT_EQ(ReadColmapModel(SharedModels() / "lund_door_binary/C_1/C_1_1/ba_output").images.size(), 3U);
  EXPECT_GT(ReadColmapModel(SharedModels() / "astrovision/test_2011212_opnav_022").points.size(), 0U);
}

}  // namespace
}  // namespace trigpoint
