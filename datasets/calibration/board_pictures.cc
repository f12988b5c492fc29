#include "datasets/calibration/board_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "calib/base/error.h"
#include "calib/target/detect.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

cv::Mat LoadBoardPicture(const fs::path& file, bool mirrored, const SizeCheck& check = {}) {
  cv::Mat grey = LoadPicture(file, true, check);
  if (mirrored) cv::flip(grey, grey, 1);
  return grey;
}

std::string OtherSize(const std::pair<int, int>& most, const std::string& camera, int width, int height) {
  return fmt::format("expected a picture of {} x {} as the other pictures of {}, found {} x {}", most.first,
                     most.second, camera, width, height);
}

using Sizes = std::map<std::pair<int, int>, int>;  // how many pictures have it
std::pair<int, int> MostFrequent(const Sizes& sizes) {
  const auto most =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == sizes.end() ? std::pair(0, 0) : most->first;
}

// Of most of a camera's pictures, as their headers state it; 0 x 0: unknown.
std::pair<int, int> StatedSize(const CalibrationImages& camera) {
  Sizes sizes;
  for (const fs::path& file : camera.files) {
    try {
      const PhotoMetadata metadata = ReadPhotoMetadata(file);
      if (metadata.width > 0) ++sizes[{metadata.width, metadata.height}];
    } catch (const InputError&) {  // said where it is read
    }
  }
  return MostFrequent(sizes);
}

// Refuses a picture that is larger than most, whose pixels would take gigabytes; others are compared once they are
// read.
SizeCheck NotLarger(const fs::path& file, const std::pair<int, int>& most, const std::string& camera) {
  return [=](const cv::Size& stored) {
    if (most.first == 0 || int64_t{stored.width} * stored.height <= int64_t{most.first} * most.second) return;
    throw InputError(file.string() + ": " + OtherSize(most, camera, stored.width, stored.height));
  };
}

// Pictures of another size than most are left out and named.
void RequireOneSize(const std::vector<CalibrationImages>& cameras, std::vector<std::vector<BoardView>>* found) {
  for (size_t c = 0; c < cameras.size(); ++c) {
    Sizes sizes;
    for (const BoardView& view : (*found)[c]) {
      if (view.width > 0) ++sizes[{view.width, view.height}];
    }
    const std::pair<int, int> most = MostFrequent(sizes);
    for (BoardView& view : (*found)[c]) {
      if (view.width == 0 || std::pair(view.width, view.height) == most) continue;
      view.problem = OtherSize(most, cameras[c].camera, view.width, view.height);
      view.usable = false;
    }
  }
}

// No board in any picture: is there another one?
void ThrowNoBoard(bool mirrored, const Target& target, const std::vector<CalibrationImages>& cameras,
                  const std::string& first_problem) {
  std::string text = "the " + target.Text() + " was found in none of the pictures; the first: " + first_problem;
  if (target.kind == TargetKind::kCheckerboard) {
    constexpr size_t kTried = 3;
    for (size_t i = 0; i < std::min(kTried, cameras.front().files.size()); ++i) {
      try {
        const fs::path& file = cameras.front().files[i];
        const auto [cols, rows] = OtherCheckerboardIn(LoadBoardPicture(file, mirrored), target);
        if (cols == 0) continue;
        text += fmt::format(
            "; {} shows a checkerboard of {} x {} inner corners: correct the target, whose numbers count the corners "
            "between squares, not the squares",
            file.filename().string(), cols, rows);
        break;
      } catch (const InputError&) {  // the picture is already reported as unusable
      }
    }
  }
  throw InputError(text);
}

// A target described with too few corners is found as part of the larger board. Throws InputError then.
void RequireWholeBoard(bool mirrored, const Target& target, const std::vector<fs::path>& pictures) {
  if (target.kind != TargetKind::kCheckerboard) return;
  constexpr size_t kTried = 5;
  std::map<std::pair<int, int>, int> larger;
  for (size_t k = 0; k < std::min(kTried, pictures.size()); ++k) {
    const fs::path& file = pictures[k * pictures.size() / std::min(kTried, pictures.size())];
    const auto [cols, rows] = OtherCheckerboardIn(LoadBoardPicture(file, mirrored), target);
    if (cols < target.cols || rows < target.rows || (cols == target.cols && rows == target.rows)) continue;
    if (++larger[{cols, rows}] < 2) continue;
    throw InputError(
        fmt::format("the pictures, {} for example, show a checkerboard of {} x {} inner corners, of which the {} is a "
                    "part: correct the target, whose numbers count the corners between squares, not the squares",
                    file.filename().string(), cols, rows, target.Text()));
  }
}

// The views of each camera's pictures.
std::vector<std::vector<BoardView>> ViewsOf(const Target& target, const std::vector<CalibrationImages>& cameras,
                                            bool mirrored, int threads, ProgressSink& progress,
                                            const CancelToken& cancel) {
  struct Picture {
    size_t camera, index;
  };
  std::vector<Picture> pictures;
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (size_t i = 0; i < cameras[c].files.size(); ++i) pictures.push_back({c, i});
  }
  const auto file = [&](const Picture& p) -> const fs::path& { return cameras[p.camera].files[p.index]; };
  std::vector<std::pair<int, int>> stated;
  for (const CalibrationImages& camera : cameras) stated.push_back(StatedSize(camera));
  const auto load = [&](int64_t i) {
    const Picture& p = pictures[static_cast<size_t>(i)];
    const SizeCheck check = NotLarger(file(p), stated[p.camera], cameras[p.camera].camera);
    return LoadBoardPicture(file(p), mirrored, check);
  };
  const std::vector<BoardView> all =
      DetectBoards(static_cast<int64_t>(pictures.size()), load, target, threads, progress, cancel);
  std::vector<std::vector<BoardView>> found(cameras.size());
  for (size_t i = 0; i < pictures.size(); ++i) found[pictures[i].camera].push_back(all[i]);
  RequireOneSize(cameras, &found);
  return found;
}

}  // namespace

FoundBoards FindBoards(const Target& target, std::vector<CalibrationImages> cameras, bool mirrored,
                       const fs::path& base, int threads, ProgressSink& progress, const CancelToken& cancel) {
  const std::vector<std::vector<BoardView>> found = ViewsOf(target, cameras, mirrored, threads, progress, cancel);
  FoundBoards boards;
  CalibrationInput& input = boards.input;
  for (const CalibrationImages& camera : cameras) boards.pictures += camera.files.size();
  input.target = target;
  input.frames = PairFrames(&cameras);
  std::vector<LeftOutPicture>& left_out = boards.left_out;
  std::vector<fs::path> used;
  for (size_t c = 0; c < cameras.size(); ++c) {
    CalibrationInput::CameraSize size;
    size.name = cameras[c].camera;
    for (size_t i = 0; i < found[c].size(); ++i) {
      const BoardView& view = found[c][i];
      const std::string name = RelativeTo(base, cameras[c].files[i]);
      if (!view.usable) {
        left_out.push_back({size.name, name, view.problem});
        continue;
      }
      size.width = view.width;
      size.height = view.height;
      input.views.push_back({static_cast<int>(c), cameras[c].frame_of[i], name, view.points});
      used.push_back(cameras[c].files[i]);
    }
    input.cameras.push_back(size);
  }
  for (const LeftOutPicture& picture : left_out) {
    progress.Log(LogLevel::kWarning, picture.image + ": " + picture.reason);
  }
  if (input.views.empty())
    ThrowNoBoard(mirrored, target, cameras, left_out.front().image + ": " + left_out.front().reason);
  RequireWholeBoard(mirrored, target, used);
  return boards;
}

}  // namespace trigpoint
