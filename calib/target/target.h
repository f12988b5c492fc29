// Calibration targets: flat boards with points whose places on the board are known.
//
// Frame `board`: origin, x and y as given for each kind below, z = x cross y; metres. A point's id is its index in
// BoardPoints(). The board's size sets the scale of board poses and of a rig's baselines; a single camera's intrinsics
// do not depend on it, which is also why a wrong size cannot be seen in the pictures.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace trigpoint {

enum class TargetKind {
  // Black and white squares. cols x rows inner corners, row by row; x along the columns, y along the rows.
  kCheckerboard,
  // A checkerboard with an ArUco marker in each white square: cols x rows squares; the points are its inner corners,
  // row by row from the corner that the marker with id 0 is nearest to.
  kCharuco,
  // Kalibr's grid of AprilTags (36h11): cols x rows tags, id 0 at the lower left, ids row by row upwards; points are
  // the tags' corners, 2 cols x 2 rows of them, row by row; x right, y up.
  kAprilGrid,
  // cols x rows circles whose odd rows are shifted by half: point (r, c) at ((2c + r % 2) spacing, r spacing).
  kAsymmetricCircles,
  kCircles  // cols x rows circles on a square grid
};

// "checkerboard", "charuco", "aprilgrid", "asymmetric_circles", "circles".
std::string_view TargetKindName(TargetKind kind);

struct Target {
  TargetKind kind = TargetKind::kCheckerboard;
  int cols = 0;
  int rows = 0;
  double spacing_x_m = 0;                  // checkerboard, charuco: square; aprilgrid: tag size; circles: spacing
  double spacing_y_m = 0;                  // checkerboard: along the other side; else the same
  double marker_size_m = 0;                // charuco: edge of a marker
  double tag_spacing = 0;                  // aprilgrid: gap between tags / tag size
  std::string dictionary = "DICT_4X4_50";  // charuco: OpenCV's name
  int first_id = 0;                        // charuco, aprilgrid: id of the first marker

  // What is wrong with it, one sentence each.
  std::vector<std::string> Check() const;
  // All points, board frame, z = 0.
  std::vector<Eigen::Vector3d> BoardPoints() const;
  // Points in a row of BoardPoints().
  int PointColumns() const;
  int PointRows() const;
  // Can every point be told apart when only part of the board is seen?
  bool HasIds() const { return kind == TargetKind::kCharuco || kind == TargetKind::kAprilGrid; }
  // Does the board look the same when turned by half, so that two cameras may count its points from opposite corners?
  bool LooksTheSameTurned() const;
  // "checkerboard of 9 x 6 inner corners, squares of 25 mm".
  std::string Text() const;
};

}  // namespace trigpoint
