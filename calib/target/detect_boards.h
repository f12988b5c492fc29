// The search for each kind of target in one picture; DetectBoards joins them. Private to this folder.
#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/target/detect.h"

namespace trigpoint {

std::vector<BoardPoint> FindCheckerboard(const cv::Mat& grey, const Target& target);
std::vector<BoardPoint> FindCircles(const cv::Mat& grey, const Target& target);

// A marker of a board with ids, as detected: corners in the detector's order, our pixels.
struct BoardMarker {
  int id = 0;
  int border_bits = 1;  // AprilGrid
  std::array<Eigen::Vector2d, 4> corners;
};
// 36h11 with either border; a second, slower search is made where fewer than `expected` are found.
std::vector<BoardMarker> FindAprilTags(const cv::Mat& grey, size_t expected);
std::vector<BoardMarker> FindArucoMarkers(const cv::Mat& grey, const Target& target);

// How markers lie on the board, which a board's description leaves open.
struct MarkerLayout {
  int turn = 0;           // detected corner k is the board's corner (k + turn) % 4
  bool from_top = false;  // AprilGrid: ids count downwards; ChArUco: the first square is white
  int border_bits = 1;    // AprilGrid
};
std::vector<MarkerLayout> PossibleLayouts(const Target& target);
// The board's points of a marker's corners (AprilGrid: ids >= 0), and where these lie in the board's frame.
// False: no such marker on the board.
bool MarkerOnBoard(const Target& target, const MarkerLayout& layout, int marker_id, std::array<int, 4>* ids,
                   std::array<Eigen::Vector3d, 4>* places);
// Mean distance, as part of a marker's side, between markers' corners and where the others of the same picture say
// they are, over all pictures; large for a wrong layout.
double LayoutError(const Target& target, const MarkerLayout& layout,
                   const std::vector<std::vector<BoardMarker>>& pictures);

std::vector<BoardPoint> AprilGridPoints(const cv::Mat& grey, const Target& target, const MarkerLayout& layout,
                                        const std::vector<BoardMarker>& markers);
std::vector<BoardPoint> CharucoPoints(const cv::Mat& grey, const Target& target, const MarkerLayout& layout,
                                      const std::vector<BoardMarker>& markers);

// Refines saddle points by the gradients around them (cv::cornerSubPix); one that moves by more than `max_move_px` or
// leaves the picture is false in the result. `half_window` per corner, px.
std::vector<bool> RefineSaddles(const cv::Mat& grey, const std::vector<double>& half_window, double max_move_px,
                                std::vector<Eigen::Vector2d>* corners);

}  // namespace trigpoint
