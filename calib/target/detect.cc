#include "calib/target/detect.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/base/grid.h"
#include "calib/base/parallel.h"
#include "calib/target/detect_boards.h"

namespace trigpoint {
namespace {

constexpr size_t kLeastFound = 6;  // of a board in one picture, to say anything about its pose

// The layout of the markers that fits all pictures best. With too little to decide, the first one.
MarkerLayout ChooseLayout(const Target& target, const std::vector<std::vector<BoardMarker>>& pictures) {
  std::map<int, size_t> seen;  // markers by border bits
  for (const auto& markers : pictures) {
    for (const BoardMarker& marker : markers) ++seen[marker.border_bits];
  }
  const int border_bits = seen[2] > seen[1] ? 2 : 1;
  MarkerLayout best;
  double least = std::numeric_limits<double>::infinity();
  for (MarkerLayout layout : PossibleLayouts(target)) {
    layout.border_bits = border_bits;
    const double error = LayoutError(target, layout, pictures);
    if (error < least) {
      least = error;
      best = layout;
    }
  }
  return best;
}

std::string WhyNothing(const Target& target, size_t markers, size_t points) {
  if (target.HasIds()) {
    if (markers == 0) return "none of the board's markers was found";
    return fmt::format("{} of the board's markers but only {} of its points were found", markers, points);
  }
  return "the board was not found; it must be seen as a whole";
}

}  // namespace

std::vector<BoardView> DetectBoards(int64_t count, const BoardPictureSource& picture, const Target& target, int threads,
                                    ProgressSink& progress, const CancelToken& cancel) {
  const std::vector<std::string> problems = target.Check();
  if (!problems.empty()) throw InputError("calibration target: " + problems.front());
  std::vector<BoardView> views(static_cast<size_t>(count));
  std::vector<std::vector<BoardMarker>> markers(views.size());
  const auto each = [&](const char* task, const std::function<void(const cv::Mat&, size_t)>& use) {
    progress.Begin(task, count);
    ParallelFor(count, threads, cancel, [&](int64_t i) {
      BoardView& view = views[static_cast<size_t>(i)];
      if (view.problem.empty()) {
        try {
          const cv::Mat grey = picture(i);
          view.width = grey.cols;
          view.height = grey.rows;
          use(grey, static_cast<size_t>(i));
        } catch (const InputError& e) {
          view.problem = e.what();
        } catch (const cv::Exception& e) {
          view.problem = "the search for the board failed: " + e.err;
        }
      }
      progress.Advance(1);
    });
  };
  if (target.HasIds()) {
    each("looking for markers", [&](const cv::Mat& grey, size_t i) {
      markers[i] = target.kind == TargetKind::kAprilGrid ? FindAprilTags(grey, CellCount(target.rows, target.cols))
                                                         : FindArucoMarkers(grey, target);
    });
    const MarkerLayout layout = ChooseLayout(target, markers);
    each("measuring the board's points", [&](const cv::Mat& grey, size_t i) {
      views[i].points = target.kind == TargetKind::kAprilGrid ? AprilGridPoints(grey, target, layout, markers[i])
                                                              : CharucoPoints(grey, target, layout, markers[i]);
    });
  } else {
    each("looking for the board", [&](const cv::Mat& grey, size_t i) {
      views[i].points =
          target.kind == TargetKind::kCheckerboard ? FindCheckerboard(grey, target) : FindCircles(grey, target);
    });
  }
  for (size_t i = 0; i < views.size(); ++i) {
    if (!views[i].problem.empty()) continue;
    views[i].usable = views[i].points.size() >= kLeastFound;
    if (!views[i].usable) views[i].problem = WhyNothing(target, markers[i].size(), views[i].points.size());
  }
  return views;
}

std::vector<bool> RefineSaddles(const cv::Mat& grey, const std::vector<double>& half_window, double max_move_px,
                                std::vector<Eigen::Vector2d>* corners) {
  std::vector<bool> good(corners->size(), false);
  for (size_t i = 0; i < corners->size(); ++i) {
    Eigen::Vector2d& corner = (*corners)[i];
    const int half = std::clamp(static_cast<int>(std::lround(half_window[i])), 2, 12);
    if (corner.x() < half + 1 || corner.y() < half + 1 || corner.x() > grey.cols - half - 2 ||
        corner.y() > grey.rows - half - 2) {
      continue;
    }
    std::vector<cv::Point2f> point = {{static_cast<float>(corner.x()), static_cast<float>(corner.y())}};
    cv::cornerSubPix(grey, point, {half, half}, {-1, -1}, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 1e-3});
    const Eigen::Vector2d refined(point[0].x, point[0].y);
    good[i] = refined.allFinite() && (refined - corner).norm() <= max_move_px;
    if (good[i]) corner = refined;
  }
  return good;
}

}  // namespace trigpoint
