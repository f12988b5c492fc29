// A bag as large as wanted, of a camera, odometry and a topic that nobody takes.
#include <CLI/CLI.hpp>
#include <random>

#include "tests/datasets/bag_writer.h"

using namespace trigpoint;

namespace {

// Smooth shading with noise of 2 grey levels, as a camera's pictures compress.
std::vector<uint8_t> Pixels(size_t width, size_t height, size_t channels, std::mt19937* random) {
  std::vector<uint8_t> pixels(width * height * channels);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t x = i / channels % width, y = i / (width * channels);
    pixels[i] = static_cast<uint8_t>(60 + (x / 8 + y / 4) % 120 + ((*random)() & 3));
  }
  return pixels;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Writes a bag.");
  std::string file, compression, encoding = "mono8";
  double megabytes = 2000;
  app.add_option("FILE", file, "*.bag, *.mcap or *.db3")->required();
  app.add_option("--compression", compression, "of its chunks");
  app.add_option("--encoding", encoding, "of its pictures: mono8, rgb8 or bayer_rggb8");
  app.add_option("--megabytes", megabytes, "of pictures");
  CLI11_PARSE(app, argc, argv);
  const std::string ending = file.substr(file.find_last_of('.'));
  const auto bag = ending == ".bag"    ? WriteRos1Bag(file, compression.empty() ? "none" : compression)
                   : ending == ".mcap" ? WriteMcap(file, compression)
                                       : WriteSqliteBag(file, !compression.empty());
  constexpr size_t kWidth = 1280, kHeight = 800;
  const size_t channels = encoding == "rgb8" ? 3 : 1;
  std::mt19937 random(7);
  std::vector<std::vector<uint8_t>> pictures;
  for (int i = 0; i < 4; ++i) pictures.push_back(Pixels(kWidth, kHeight, channels, &random));
  int64_t t = 1'700'000'000'000'000'000;
  size_t number = 0;
  for (double written = 0; written < megabytes;
       written += 1e-6 * static_cast<double>(pictures[0].size()), t += 50'000'000) {
    RosBytes image(bag->encoding());
    image.Header(t, "camera").Put(static_cast<uint32_t>(kHeight)).Put(static_cast<uint32_t>(kWidth)).Text(encoding);
    image.Put(uint8_t{0}).Put(static_cast<uint32_t>(kWidth * channels)).Block(pictures[number++ % pictures.size()]);
    bag->Add("/camera/image_raw", "sensor_msgs/Image", t, image.bytes());
    for (int k = 0; k < 5; ++k) {
      RosBytes odometry(bag->encoding());
      odometry.Header(t + k * 10'000'000, "odom")
          .Text("base_link")
          .Pose({Eigen::Quaterniond::Identity(), {1e-3 * static_cast<double>(number), 0, 0}});
      bag->Add("/odom", "nav_msgs/Odometry", t + k * 10'000'000, odometry.Reals(std::vector<double>(78, 0)).bytes());
    }
  }
  bag->Close();
}
