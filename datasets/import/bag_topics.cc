#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "datasets/import/bag_run.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

// /camera/image_raw/compressed -> /camera/image_raw
std::string RawName(const std::string& topic) {
  constexpr std::string_view kEnding = "/compressed";
  return topic.ends_with(kEnding) ? topic.substr(0, topic.size() - kEnding.size()) : topic;
}

std::string ParentOf(const std::string& topic) { return topic.substr(0, topic.find_last_of('/')); }

// Forms of one camera's picture have one key; image_* in one namespace are such.
std::string CameraKey(const std::string& topic) {
  const std::string raw = RawName(topic), parent = ParentOf(raw);
  return raw.substr(std::min(raw.size(), parent.size() + 1)).starts_with("image") ? parent + "/image" : raw;
}

// Which form is best: the least.
std::array<int, 3> RankOf(const std::string& topic) {
  const auto has = [&](const char* word) { return topic.find(word) != std::string::npos ? 1 : 0; };
  return {has("rect"), topic.ends_with("/compressed") ? 1 : 0, 1 - has("raw")};
}

bool IsNoPicture(const std::string& topic) {
  static constexpr const char* kWords[] = {"epth", "isparity", "/theora"};
  return std::any_of(std::begin(kWords), std::end(kWords),
                     [&](const char* word) { return topic.find(word) != std::string::npos; });
}

std::vector<BagTopic> EachCameraOnce(const std::vector<BagTopic>& topics) {
  std::map<std::string, BagTopic> best;
  for (const BagTopic& topic : topics) {
    if (RoleOf(topic) != BagRole::kImage || topic.messages == 0 || IsNoPicture(topic.name)) continue;
    const auto [it, fresh] = best.emplace(CameraKey(topic.name), topic);
    if (!fresh && RankOf(topic.name) < RankOf(it->second.name)) it->second = topic;
  }
  std::vector<BagTopic> images;
  for (auto& [key, topic] : best) images.push_back(std::move(topic));
  return images;
}

// The only topic of a role, or of one type of it; several make a problem.
std::optional<BagTopic> OnlyOne(const std::vector<BagTopic>& topics, BagRole role, const std::string& type,
                                std::string* problem) {
  std::optional<BagTopic> found;
  std::string names;
  int count = 0;
  for (const BagTopic& topic : topics) {
    if (RoleOf(topic) != role || topic.messages == 0 || (!type.empty() && topic.type != type)) continue;
    if (!found) found = topic;
    names += (count++ > 0 ? ", " : "") + topic.name;
  }
  if (count > 1 && problem->empty()) {
    *problem = fmt::format("{} topics are {} ({}); name all topics to be taken by --topic", count, found->type, names);
  }
  return found;
}

struct PixelForm {
  const char* name;
  int type, conversion;  // conversion: to BGR, -1 none
};
constexpr PixelForm kForms[] = {
    {"mono8", CV_8UC1, -1},
    {"8UC1", CV_8UC1, -1},
    {"mono16", CV_16UC1, -1},
    {"bgr8", CV_8UC3, -1},
    {"8UC3", CV_8UC3, -1},
    {"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
    {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
    {"8UC4", CV_8UC4, cv::COLOR_BGRA2BGR},
    {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR},
    {"bgr16", CV_16UC3, -1},
    {"rgb16", CV_16UC3, cv::COLOR_RGB2BGR},
    // OpenCV names a pattern by the second row's second and third pixel.
    {"bayer_rggb8", CV_8UC1, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr8", CV_8UC1, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg8", CV_8UC1, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg8", CV_8UC1, cv::COLOR_BayerGB2BGR},
    {"bayer_rggb16", CV_16UC1, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr16", CV_16UC1, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg16", CV_16UC1, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg16", CV_16UC1, cv::COLOR_BayerGB2BGR},
    {"yuv422", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
    {"uyvy", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
    {"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2BGR_YUYV},
    {"yuyv", CV_8UC2, cv::COLOR_YUV2BGR_YUYV},
};

}  // namespace

BagChoice ChooseTopics(const BagContents& contents, const std::vector<std::string>& topics) {
  std::vector<BagTopic> candidates;
  std::vector<std::string> names;
  for (const BagTopic& topic : contents.topics) names.push_back(topic.name);
  for (const std::string& name : topics) {
    const auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end()) {
      throw OptionError("--topic " + name + ": the bag has no such topic; nearest: " + NearestName(name, names));
    }
    candidates.push_back(contents.topics[static_cast<size_t>(it - names.begin())]);
    const BagRole role = RoleOf(candidates.back());
    if (role == BagRole::kNone) {
      throw OptionError("--topic " + name + ": expected images, odometry, poses, NavSatFix or Imu, found " +
                        candidates.back().type);
    }
  }
  BagChoice choice;
  if (topics.empty()) {
    choice.images = EachCameraOnce(contents.topics);
    candidates = contents.topics;
  } else {
    for (const BagTopic& topic : candidates) {
      if (RoleOf(topic) == BagRole::kImage) choice.images.push_back(topic);
    }
  }
  // Poses of other types may be anything, such as goals: taken only by name.
  choice.pose = OnlyOne(candidates, BagRole::kPose, topics.empty() ? "nav_msgs/Odometry" : "", &choice.problem);
  choice.fix = OnlyOne(candidates, BagRole::kFix, "", &choice.problem);
  std::string several;  // it is for a check only: any will do
  choice.imu = OnlyOne(candidates, BagRole::kImu, "", &several);
  if (choice.images.empty()) choice.problem = "no topic with images is chosen; see --list";
  return choice;
}

const BagTopic* CameraInfoOf(const BagContents& contents, const std::string& image_topic) {
  const std::string wanted = ParentOf(RawName(image_topic)) + "/camera_info";
  const BagTopic* only = nullptr;
  int count = 0;
  for (const BagTopic& topic : contents.topics) {
    if (RoleOf(topic) != BagRole::kCameraInfo) continue;
    if (topic.name == wanted) return &topic;
    only = &topic;
    ++count;
  }
  const bool one_camera = EachCameraOnce(contents.topics).size() == 1;
  return count == 1 && one_camera ? only : nullptr;
}

cv::Mat PictureOf(const RosImage& image, cv::Mat* converted) {
  const auto form = std::find_if(std::begin(kForms), std::end(kForms),
                                 [&](const PixelForm& known) { return image.encoding == known.name; });
  if (form == std::end(kForms))
    throw InputError("the encoding '" + Excerpt(image.encoding) + "' is not one of a picture");
  constexpr uint32_t kLongest = 65'500;  // px, of what can be written
  const uint64_t row = uint64_t{image.width} * CV_ELEM_SIZE(form->type);
  if (image.width == 0 || image.height == 0 || image.width > kLongest || image.height > kLongest || image.step < row ||
      image.data.size() < uint64_t{image.step} * (image.height - 1) + row) {
    throw InputError(fmt::format("expected {} x {} px of {}, found {} bytes in rows of {}", image.width, image.height,
                                 image.encoding, image.data.size(), image.step));
  }
  // OpenCV takes what it only reads as not const.
  cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width), form->type,
                 const_cast<uint8_t*>(image.data.data()), image.step);
  if (image.big_endian && CV_ELEM_SIZE1(form->type) == 2) {
    pixels = pixels.clone();
    for (int v = 0; v < pixels.rows; ++v) {
      auto* values = pixels.ptr<uint16_t>(v);
      for (int k = 0; k < pixels.cols * pixels.channels(); ++k) values[k] = __builtin_bswap16(values[k]);
    }
  }
  if (form->conversion < 0) return pixels;
  cv::cvtColor(pixels, *converted, form->conversion);
  return *converted;
}

}  // namespace trigpoint
