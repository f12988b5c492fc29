#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/grid.h"
#include "calib/target/detect_boards.h"

namespace trigpoint {
namespace {

constexpr double kMaxSaddleMovePx = 1.5;  // from the detector's corner to the saddle point; more is a glint or a shadow

std::vector<Eigen::Vector2d> ToEigen(const std::vector<cv::Point2f>& points) {
  std::vector<Eigen::Vector2d> out;
  for (const cv::Point2f& p : points) out.emplace_back(p.x, p.y);
  return out;
}

std::vector<BoardPoint> Numbered(const std::vector<Eigen::Vector2d>& corners) {
  std::vector<BoardPoint> points;
  for (size_t i = 0; i < corners.size(); ++i) points.push_back({static_cast<int>(i), corners[i]});
  return points;
}

// Counts the corners so that the board's z points into it (as seen in a picture that isn't mirrored) and, where the
// board can be told from itself turned by half, its first square is dark; else its first corner is the upper left one.
void Order(const cv::Mat& grey, int cols, int rows, std::vector<Eigen::Vector2d>* corners) {
  const auto at = [&](int c, int r) -> Eigen::Vector2d& { return (*corners)[CellIndex(r, c, cols)]; };
  const Eigen::Vector2d x = at(cols - 1, 0) - at(0, 0), y = at(0, rows - 1) - at(0, 0);
  if (x.x() * y.y() - x.y() * y.x() < 0) {
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < cols / 2; ++c) std::swap(at(c, r), at(cols - 1 - c, r));
    }
  }
  if (cols % 2 == rows % 2) {
    const Eigen::Vector2d across = at(cols - 1, rows - 1) - at(0, 0);
    if (across.x() + across.y() < 0) std::reverse(corners->begin(), corners->end());
    return;
  }
  double first = 0;  // brightness of the first square's colour less the other's
  for (int r = 0; r + 1 < rows; ++r) {
    for (int c = 0; c + 1 < cols; ++c) {
      const Eigen::Vector2d centre = 0.25 * (at(c, r) + at(c + 1, r) + at(c, r + 1) + at(c + 1, r + 1));
      const int u = std::clamp(static_cast<int>(std::lround(centre.x())), 0, grey.cols - 1);
      const int v = std::clamp(static_cast<int>(std::lround(centre.y())), 0, grey.rows - 1);
      first += ((c + r) % 2 == 0 ? 1 : -1) * grey.at<uchar>(v, u);
    }
  }
  if (first > 0) std::reverse(corners->begin(), corners->end());
}

// Half of the largest window around each corner that stays within the four squares that meet there.
std::vector<double> Windows(const std::vector<Eigen::Vector2d>& corners, int cols, int rows) {
  std::vector<double> half;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < cols; ++c) {
      const Eigen::Vector2d& here = corners[CellIndex(r, c, cols)];
      double nearest = 1e9;
      for (const auto& [dc, dr] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
        if (c + dc < 0 || c + dc >= cols || r + dr < 0 || r + dr >= rows) continue;
        nearest = std::min(nearest, (corners[CellIndex(r + dr, c + dc, cols)] - here).norm());
      }
      half.push_back(0.4 * nearest);
    }
  }
  return half;
}

cv::Ptr<cv::FeatureDetector> BlobDetector(const cv::Mat& grey, bool bright) {
  cv::SimpleBlobDetector::Params params;
  params.filterByColor = true;
  params.blobColor = bright ? 255 : 0;
  params.minArea = 20;
  params.maxArea = 0.02F * static_cast<float>(grey.total());
  params.minDistBetweenBlobs = 5;
  return cv::SimpleBlobDetector::create(params);
}

}  // namespace

std::vector<BoardPoint> FindCheckerboard(const cv::Mat& grey, const Target& target) {
  const cv::Size size(target.cols, target.rows);
  std::vector<cv::Point2f> found;
  bool there = cv::findChessboardCornersSB(grey, size, found, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY);
  if (!there) {
    there = cv::findChessboardCornersSB(grey, size, found,
                                        cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY | cv::CALIB_CB_EXHAUSTIVE);
  }
  std::vector<Eigen::Vector2d> corners;
  if (there) {
    corners = ToEigen(found);
    RefineSaddles(grey, Windows(corners, size.width, size.height), kMaxSaddleMovePx, &corners);
  } else if (cv::findChessboardCorners(grey, size, found,
                                       cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE)) {
    corners = ToEigen(found);
    RefineSaddles(grey, Windows(corners, size.width, size.height), 1e9, &corners);
  }
  if (corners.size() != static_cast<size_t>(size.area())) return {};
  Order(grey, size.width, size.height, &corners);
  return Numbered(corners);
}

std::pair<int, int> OtherCheckerboardIn(const cv::Mat& grey, const Target& target) {
  std::vector<cv::Point2f> corners;
  cv::Mat meta;
  try {
    // The smallest pattern, and whatever it is a part of.
    if (!cv::findChessboardCornersSB(grey, {3, 3}, corners, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER, meta)) {
      return {0, 0};
    }
  } catch (const cv::Exception&) {  // some pictures are too small for it: the same to the caller
    return {0, 0};
  }
  const bool wide = target.cols >= target.rows;
  const int most = std::max(meta.cols, meta.rows), least = std::min(meta.cols, meta.rows);
  return wide ? std::pair(most, least) : std::pair(least, most);
}

std::vector<BoardPoint> FindCircles(const cv::Mat& grey, const Target& target) {
  const cv::Size size(target.cols, target.rows);
  const int grid =
      target.kind == TargetKind::kAsymmetricCircles ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  std::vector<cv::Point2f> centres;
  for (const int extra : {0, static_cast<int>(cv::CALIB_CB_CLUSTERING)}) {
    for (const bool bright : {false, true}) {
      if (cv::findCirclesGrid(grey, size, centres, grid | extra, BlobDetector(grey, bright)) &&
          centres.size() == static_cast<size_t>(size.area())) {
        return Numbered(ToEigen(centres));
      }
    }
  }
  return {};
}

}  // namespace trigpoint
