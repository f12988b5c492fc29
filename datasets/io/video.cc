#include "datasets/io/video.h"

#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "calib/base/error.h"
#include "datasets/io/run_parts.h"

namespace trigpoint {
namespace {

cv::VideoCapture Open(const std::filesystem::path& file) {
  // OpenCV tries its backends one after the other and complains about each; our message says it once.
  static const auto quiet = cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  static_cast<void>(quiet);
  cv::VideoCapture video(file.string());
  if (!video.isOpened()) throw InputError(file.string() + ": the video cannot be opened; convert it to MP4 (H.264)");
  return video;
}

// One open video: frames in order, grey or BGR, the last few kept, as several threads ask for neighbours.
class OpenVideo {
 public:
  OpenVideo(std::filesystem::path file, bool grey)
      : file_(std::move(file)), grey_(grey), most_kept_(grey ? 16 : 5), video_(Open(file_)) {}

  cv::Mat Frame(int index) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [kept_index, kept] : kept_) {
      if (kept_index == index) return kept.clone();
    }
    if (index < next_) {  // seeking is not exact in all containers: begin again
      video_ = Open(file_);
      next_ = 0;
    }
    cv::Mat frame, wanted;
    for (; next_ <= index; ++next_) {
      if (!video_.grab()) {
        throw InputError(file_.string() + ": frame " + std::to_string(next_) + " cannot be read; the video is damaged");
      }
      if (next_ + most_kept_ <= index) continue;
      if (!video_.retrieve(frame) || frame.empty()) {
        throw InputError(file_.string() + ": frame " + std::to_string(next_) + " cannot be decoded");
      }
      if ((frame.channels() == 1) == grey_) {
        wanted = frame;
      } else {
        cv::cvtColor(frame, wanted, grey_ ? cv::COLOR_BGR2GRAY : cv::COLOR_GRAY2BGR);
      }
      kept_.emplace_back(next_, wanted.clone());
      if (kept_.size() > static_cast<size_t>(most_kept_)) kept_.pop_front();
    }
    return kept_.back().second.clone();
  }

 private:
  const std::filesystem::path file_;
  const bool grey_;
  const int most_kept_;  // frames, about as many bytes of both kinds
  std::mutex mutex_;
  cv::VideoCapture video_;
  int next_ = 0;
  std::deque<std::pair<int, cv::Mat>> kept_;
};

// A folder that is watched is read again and again: what did not change is not opened again.
struct FileVersion {
  std::uintmax_t size = 0;
  std::filesystem::file_time_type changed;
  bool operator==(const FileVersion&) const = default;
};

FileVersion VersionOf(const std::filesystem::path& file) {
  std::error_code ignored;  // opening the file says what is wrong
  return {std::filesystem::file_size(file, ignored), std::filesystem::last_write_time(file, ignored)};
}

constexpr size_t kProbed = 60;

// Is frame count - 1 the last one, and at this time?
bool EndsAt(const std::filesystem::path& file, int64_t count, double last_ms) {
  cv::VideoCapture video = Open(file);
  if (!video.set(cv::CAP_PROP_POS_FRAMES, static_cast<double>(count - 1)) || !video.grab()) return false;
  return std::abs(video.get(cv::CAP_PROP_POS_MSEC) - last_ms) < 1.5 && !video.grab();
}

cv::Mat ReadVideoFrame(const std::filesystem::path& file, int index, bool grey) {
  static std::mutex mutex;
  static std::map<std::pair<std::filesystem::path, bool>, std::pair<FileVersion, std::shared_ptr<OpenVideo>>> open;
  std::shared_ptr<OpenVideo> video;
  {
    const FileVersion version = VersionOf(file);
    const std::lock_guard<std::mutex> lock(mutex);
    auto& [known, slot] = open[{file, grey}];
    if (!slot || known != version) slot = std::make_shared<OpenVideo>(file, grey), known = version;
    video = slot;
  }
  return video->Frame(index);
}

std::vector<int64_t> ReadFrameTimes(const std::filesystem::path& file) {
  cv::VideoCapture video = Open(file);
  const double fps = video.get(cv::CAP_PROP_FPS);
  const auto count = static_cast<int64_t>(video.get(cv::CAP_PROP_FRAME_COUNT));
  const auto regular = [&](int64_t index) { return std::llround(static_cast<double>(index) * 1e9 / fps); };
  std::vector<int64_t> times;
  double first_ms = 0;
  bool even = fps > 0;
  while (video.grab()) {
    const double ms = video.get(cv::CAP_PROP_POS_MSEC);
    if (times.empty()) first_ms = ms;
    int64_t ns = std::llround((ms - first_ms) * 1e6);
    // Some containers hold no times: fall back to the rate.
    if (!times.empty() && ns <= times.back()) {
      if (fps <= 0) throw InputError(file.string() + ": the video states neither frame times nor a frame rate");
      ns = times.back() + std::llround(1e9 / fps);
    }
    even = even && std::abs(ns - regular(static_cast<int64_t>(times.size()))) < 1'500'000;
    times.push_back(ns);
    // Decoding a long video only to learn that its frames come evenly would take minutes: a good start and the right
    // end will do.
    if (times.size() == kProbed && even && count > 2 * static_cast<int64_t>(kProbed) &&
        EndsAt(file, count, first_ms + 1e-6 * static_cast<double>(regular(count - 1)))) {
      for (int64_t i = static_cast<int64_t>(kProbed); i < count; ++i) times.push_back(regular(i));
      return times;
    }
  }
  if (times.empty()) throw InputError(file.string() + ": no frame of the video can be read");
  return times;
}

}  // namespace

cv::Mat ReadVideoFrameGrey(const std::filesystem::path& file, int index) { return ReadVideoFrame(file, index, true); }

cv::Mat ReadVideoFrameColour(const std::filesystem::path& file, int index) {
  return ReadVideoFrame(file, index, false);
}

std::vector<int64_t> VideoFrameTimes(const std::filesystem::path& file) {
  static std::mutex mutex;
  static std::map<std::filesystem::path, std::pair<FileVersion, std::vector<int64_t>>> known;
  const FileVersion version = VersionOf(file);
  {
    const std::lock_guard<std::mutex> lock(mutex);
    const auto it = known.find(file);
    if (it != known.end() && it->second.first == version) return it->second.second;
  }
  std::vector<int64_t> times = ReadFrameTimes(file);
  const std::lock_guard<std::mutex> lock(mutex);
  known[file] = {version, times};
  return times;
}

}  // namespace trigpoint
