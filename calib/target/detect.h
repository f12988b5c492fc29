// Targets found in pictures: the points of a board, to a few hundredths of a pixel.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "calib/target/target.h"

namespace trigpoint {

struct BoardPoint {
  int id = 0;  // index into Target::BoardPoints()
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

// One picture.
struct BoardView {
  bool usable = false;  // false: not read, or no board in it; `problem` says why
  std::string problem;
  int width = 0, height = 0;       // px; 0: not read
  std::vector<BoardPoint> points;  // ascending id
};

// Gives the grey 8-bit picture of an index; called from several threads at once. An InputError makes that picture
// unusable, anything else ends the detection.
using BoardPictureSource = std::function<cv::Mat(int64_t)>;

// Finds the target in `count` pictures on `threads` workers (0: all cores). What a board leaves open in one picture is
// decided over all of them: how its tags are turned and counted (AprilGrid), which of its squares are black (ChArUco).
//   checkerboard  cv::findChessboardCornersSB (Duda and Frese, "Accurate detection and localization of checkerboard
//                 corners for calibration", BMVC 2018), else the classic search with corners refined by gradients;
//                 the whole board must be seen
//   charuco       ArUco markers, then the inner corners where their neighbours say, refined by gradients
//   aprilgrid     AprilTag 36h11 with one or two border bits, corners refined by gradients
//   circles       cv::findCirclesGrid on dark or bright blobs
// The result does not depend on the number of threads. Throws InputError if the target itself is wrong (Target::Check),
// Cancelled.
std::vector<BoardView> DetectBoards(int64_t count, const BoardPictureSource& picture, const Target& target, int threads,
                                    ProgressSink& progress, const CancelToken& cancel);

// For a checkerboard that was not found: inner corners (cols x rows) of one that is there in the picture, found by
// trying sizes near the target's; {0, 0} if none.
std::pair<int, int> OtherCheckerboardIn(const cv::Mat& grey, const Target& target);

}  // namespace trigpoint
