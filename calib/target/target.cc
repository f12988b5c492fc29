#include "calib/target/target.h"

#include <fmt/format.h>

namespace trigpoint {

std::string_view TargetKindName(TargetKind kind) {
  switch (kind) {
    case TargetKind::kCheckerboard: return "checkerboard";
    case TargetKind::kCharuco: return "charuco";
    case TargetKind::kAprilGrid: return "aprilgrid";
    case TargetKind::kAsymmetricCircles: return "asymmetric_circles";
    case TargetKind::kCircles: return "circles";
  }
  return "unknown";
}

std::vector<std::string> Target::Check() const {
  std::vector<std::string> problems;
  const bool tags = kind == TargetKind::kAprilGrid;
  const int least = tags ? 1 : kind == TargetKind::kCharuco ? 3 : 2;
  const char* unit = tags ? "tags" : kind == TargetKind::kCharuco ? "squares" : "points";
  if (cols < least || rows < least || cols > 200 || rows > 200) {
    problems.push_back(fmt::format("expected {} to 200 {} in each direction, found {} x {}", least, unit, cols, rows));
  }
  if (!(spacing_x_m > 0 && spacing_x_m < 100) || !(spacing_y_m > 0 && spacing_y_m < 100)) {
    problems.push_back(fmt::format("expected a size in metres above 0, found {}", std::min(spacing_x_m, spacing_y_m)));
  }
  if (tags && !(tag_spacing > 0 && tag_spacing < 10)) {
    problems.push_back(fmt::format(
        "expected tagSpacing, the gap between tags as a part of the tag size (0.3), found {}", tag_spacing));
  }
  if (kind == TargetKind::kCharuco && !(marker_size_m > 0 && marker_size_m < spacing_x_m)) {
    problems.push_back(fmt::format("expected a marker size above 0 and below the square size {}, found {}", spacing_x_m,
                                   marker_size_m));
  }
  return problems;
}

int Target::PointColumns() const {
  if (kind == TargetKind::kAprilGrid) return 2 * cols;
  return kind == TargetKind::kCharuco ? cols - 1 : cols;
}

int Target::PointRows() const {
  if (kind == TargetKind::kAprilGrid) return 2 * rows;
  return kind == TargetKind::kCharuco ? rows - 1 : rows;
}

std::vector<Eigen::Vector3d> Target::BoardPoints() const {
  std::vector<Eigen::Vector3d> points;
  for (int r = 0; r < PointRows(); ++r) {
    for (int c = 0; c < PointColumns(); ++c) {
      double x = c, y = r;
      if (kind == TargetKind::kAprilGrid) {
        const int column = c / 2, row = r / 2;  // of the tag
        x = column * (1 + tag_spacing) + c % 2;
        y = row * (1 + tag_spacing) + r % 2;
      } else if (kind == TargetKind::kAsymmetricCircles) {
        x = 2 * c + r % 2;
      }
      points.emplace_back(x * spacing_x_m, y * spacing_y_m, 0);
    }
  }
  return points;
}

bool Target::LooksTheSameTurned() const {
  switch (kind) {
    case TargetKind::kCheckerboard: return cols % 2 == rows % 2;
    case TargetKind::kCircles: return true;
    case TargetKind::kAsymmetricCircles: return rows % 2 == 0;
    default: return false;
  }
}

std::string Target::Text() const {
  switch (kind) {
    case TargetKind::kCheckerboard:
      if (spacing_x_m == spacing_y_m) {
        return fmt::format("checkerboard of {} x {} inner corners, squares of {:g} mm", cols, rows, 1e3 * spacing_x_m);
      }
      return fmt::format("checkerboard of {} x {} inner corners, squares of {:g} x {:g} mm", cols, rows,
                         1e3 * spacing_x_m, 1e3 * spacing_y_m);
    case TargetKind::kCharuco:
      return fmt::format("ChArUco board of {} x {} squares of {:g} mm, {} markers of {:g} mm", cols, rows,
                         1e3 * spacing_x_m, dictionary, 1e3 * marker_size_m);
    case TargetKind::kAprilGrid:
      return fmt::format("AprilGrid of {} x {} tags of {:g} mm, gaps of {:g} mm", cols, rows, 1e3 * spacing_x_m,
                         1e3 * spacing_x_m * tag_spacing);
    case TargetKind::kAsymmetricCircles:
      return fmt::format("asymmetric grid of {} x {} circles, spacing {:g} mm", cols, rows, 1e3 * spacing_x_m);
    case TargetKind::kCircles:
      return fmt::format("grid of {} x {} circles, spacing {:g} mm", cols, rows, 1e3 * spacing_x_m);
  }
  return "unknown target";
}

}  // namespace trigpoint
