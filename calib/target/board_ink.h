// What is black on a calibration target, for printing it.
#pragma once

#include <vector>

#include "calib/target/target.h"

namespace trigpoint {

struct InkBox {
  double x = 0, y = 0, width = 0, height = 0;
};
struct InkCircle {
  double x = 0, y = 0, radius = 0;
};

// Sheet frame: origin at the upper left corner of all ink, x right, y down; metres.
struct BoardInk {
  double width_m = 0, height_m = 0;
  double quiet_m = 0;  // white that the ink needs around it
  std::vector<InkBox> boxes;
  std::vector<InkCircle> circles;
  std::vector<Eigen::Vector2d> points;  // Target::BoardPoints() in the sheet frame
};

// Checkerboard: the upper left square is black. ChArUco: the same, markers in the white squares, id first_id in the
// first of them. AprilGrid: 36h11 with a border of two cells, and small squares in the gaps, as Kalibr prints it.
// Circles: radius 0.3 of the least distance of two. Throws InputError if the target is wrong (Target::Check) or its
// dictionary or family has fewer markers than the board.
BoardInk InkOfBoard(const Target& target);

}  // namespace trigpoint
