#include "datasets/io/video.h"

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "calib/base/error.h"
#include "datasets/io/run_parts.h"

namespace trigpoint {
namespace {

cv::VideoCapture Open(const std::filesystem::path& file) {
  cv::VideoCapture video(file.string());
  if (!video.isOpened()) throw InputError(file.string() + ": the video cannot be opened; convert it to MP4 (H.264)");
  return video;
}

// One open video: frames in order, the last few kept, as several threads ask for neighbours.
class OpenVideo {
 public:
  explicit OpenVideo(std::filesystem::path file) : file_(std::move(file)), video_(Open(file_)) {}

  cv::Mat Frame(int index) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [kept_index, kept] : kept_) {
      if (kept_index == index) return kept.clone();
    }
    if (index < next_) {  // seeking is not exact in all containers: begin again
      video_ = Open(file_);
      next_ = 0;
    }
    cv::Mat frame, grey;
    for (; next_ <= index; ++next_) {
      if (!video_.grab()) {
        throw InputError(file_.string() + ": frame " + std::to_string(next_) + " cannot be read; the video is damaged");
      }
      if (next_ + kKept <= index) continue;
      if (!video_.retrieve(frame) || frame.empty()) {
        throw InputError(file_.string() + ": frame " + std::to_string(next_) + " cannot be decoded");
      }
      if (frame.channels() == 1) {
        grey = frame.clone();
      } else {
        cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
      }
      kept_.emplace_back(next_, grey.clone());
      if (kept_.size() > static_cast<size_t>(kKept)) kept_.pop_front();
    }
    return kept_.back().second.clone();
  }

 private:
  static constexpr int kKept = 16;
  std::filesystem::path file_;
  std::mutex mutex_;
  cv::VideoCapture video_;
  int next_ = 0;
  std::deque<std::pair<int, cv::Mat>> kept_;
};

}  // namespace

cv::Mat ReadVideoFrameGrey(const std::filesystem::path& file, int index) {
  static std::mutex mutex;
  static std::map<std::filesystem::path, std::shared_ptr<OpenVideo>> open;
  std::shared_ptr<OpenVideo> video;
  {
    const std::lock_guard<std::mutex> lock(mutex);
    auto& slot = open[file];
    if (!slot) slot = std::make_shared<OpenVideo>(file);
    video = slot;
  }
  return video->Frame(index);
}

std::vector<int64_t> VideoFrameTimes(const std::filesystem::path& file) {
  cv::VideoCapture video = Open(file);
  std::vector<int64_t> times;
  const double fps = video.get(cv::CAP_PROP_FPS);
  double first_ms = 0;
  while (video.grab()) {
    double ms = video.get(cv::CAP_PROP_POS_MSEC);
    if (times.empty()) first_ms = ms;
    int64_t ns = std::llround((ms - first_ms) * 1e6);
    // Some containers hold no times: fall back to the rate.
    if (!times.empty() && ns <= times.back()) {
      if (fps <= 0) throw InputError(file.string() + ": the video states neither frame times nor a frame rate");
      ns = times.back() + std::llround(1e9 / fps);
    }
    times.push_back(ns);
  }
  if (times.empty()) throw InputError(file.string() + ": no frame of the video can be read");
  return times;
}

}  // namespace trigpoint
