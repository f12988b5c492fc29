#include "calib/target/board_ink.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <opencv2/aruco.hpp>

#include "calib/base/error.h"
#include "calib/target/dictionary.h"

namespace trigpoint {
namespace {

// The black squares of a board of cols x rows squares whose first one is black.
void AddSquares(int cols, int rows, double width, double height, BoardInk* ink) {
  for (int r = 0; r < rows; ++r) {
    for (int c = r % 2; c < cols; c += 2) ink->boxes.push_back({c * width, r * height, width, height});
  }
  ink->width_m = cols * width;
  ink->height_m = rows * height;
}

void RequireMarkers(const Target& target, int needed, int there, const std::string& of) {
  if (target.first_id < 0 || target.first_id + needed > there) {
    throw InputError(target.Text() + ": needs the markers " + std::to_string(target.first_id) + " to " +
                     std::to_string(target.first_id + needed - 1) + ", " + of + " has 0 to " +
                     std::to_string(there - 1));
  }
}

void AddCharuco(const Target& target, BoardInk* ink) {
  const double s = target.spacing_x_m;
  AddSquares(target.cols, target.rows, s, s, ink);
  ink->quiet_m = 0.5 * s;
  const int index = DictionaryNamed(target.dictionary);
  if (index < 0) throw InputError(target.Text() + ": OpenCV has no such dictionary");
  const cv::Ptr<cv::aruco::Dictionary> dictionary = cv::aruco::getPredefinedDictionary(index);
  RequireMarkers(target, target.cols * target.rows / 2, dictionary->bytesList.rows, target.dictionary);
  const int bits = dictionary->markerSize, cells = bits + 2;
  const double cell = target.marker_size_m / cells, inset = 0.5 * (s - target.marker_size_m);
  int id = target.first_id;
  for (int r = 0; r < target.rows; ++r) {
    for (int c = 1 - r % 2; c < target.cols; c += 2, ++id) {
      const cv::Mat code = cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.rowRange(id, id + 1), bits);
      for (int i = 0; i < cells; ++i) {
        for (int j = 0; j < cells; ++j) {
          const bool border = i == 0 || j == 0 || i == cells - 1 || j == cells - 1;
          if (!border && code.at<unsigned char>(i - 1, j - 1) != 0) continue;
          ink->boxes.push_back({c * s + inset + j * cell, r * s + inset + i * cell, cell, cell});
        }
      }
    }
  }
  for (const Eigen::Vector3d& p : target.BoardPoints()) ink->points.emplace_back(p.x() + s, p.y() + s);
}

void AddAprilGrid(const Target& target, BoardInk* ink) {
  const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)> family(tag36h11_create(), tag36h11_destroy);
  RequireMarkers(target, target.cols * target.rows, static_cast<int>(family->ncodes), "36h11");
  const double size = target.spacing_x_m, gap = size * target.tag_spacing, pitch = size + gap;
  constexpr int kCells = 10;  // six of data, two of border on each side
  const double cell = size / kCells;
  ink->width_m = target.cols * pitch + gap;
  ink->height_m = target.rows * pitch + gap;
  ink->quiet_m = gap;
  for (int r = 0; r <= target.rows; ++r) {
    for (int c = 0; c <= target.cols; ++c) ink->boxes.push_back({c * pitch, r * pitch, gap, gap});
  }
  for (int k = 0; k < target.cols * target.rows; ++k) {
    const double x = gap + (k % target.cols) * pitch;
    const double y = ink->height_m - pitch - (k / target.cols) * pitch;  // ids count upwards
    std::array<bool, kCells * kCells> white{};
    const uint64_t code = family->codes[target.first_id + k];
    for (uint32_t bit = 0; bit < family->nbits; ++bit) {
      const uint32_t at = (family->bit_y[bit] + 1) * kCells + family->bit_x[bit] + 1;
      white[at] = (code >> (family->nbits - 1 - bit) & 1U) != 0;
    }
    for (int i = 0; i < kCells; ++i) {
      for (int j = 0; j < kCells; ++j) {
        if (!white[static_cast<size_t>(i * kCells + j)]) ink->boxes.push_back({x + j * cell, y + i * cell, cell, cell});
      }
    }
  }
  for (const Eigen::Vector3d& p : target.BoardPoints())
    ink->points.emplace_back(p.x() + gap, ink->height_m - gap - p.y());
}

void AddCircles(const Target& target, BoardInk* ink) {
  const std::vector<Eigen::Vector3d> points = target.BoardPoints();
  const bool shifted = target.kind == TargetKind::kAsymmetricCircles;
  const double radius = 0.3 * target.spacing_x_m * (shifted ? std::sqrt(2.0) : 1);
  Eigen::Vector2d high(0, 0);
  for (const Eigen::Vector3d& p : points) {
    const Eigen::Vector2d at(p.x() + radius, p.y() + radius);
    ink->points.push_back(at);
    ink->circles.push_back({at.x(), at.y(), radius});
    high = high.cwiseMax(at);
  }
  ink->width_m = high.x() + radius;
  ink->height_m = high.y() + radius;
  ink->quiet_m = target.spacing_x_m;
}

}  // namespace

BoardInk InkOfBoard(const Target& target) {
  const std::vector<std::string> problems = target.Check();
  if (!problems.empty()) throw InputError(problems.front());
  BoardInk ink;
  switch (target.kind) {
    case TargetKind::kCheckerboard:
      AddSquares(target.cols + 1, target.rows + 1, target.spacing_x_m, target.spacing_y_m, &ink);
      ink.quiet_m = 0.5 * std::min(target.spacing_x_m, target.spacing_y_m);
      for (const Eigen::Vector3d& p : target.BoardPoints()) {
        ink.points.emplace_back(p.x() + target.spacing_x_m, p.y() + target.spacing_y_m);
      }
      break;
    case TargetKind::kCharuco: AddCharuco(target, &ink); break;
    case TargetKind::kAprilGrid: AddAprilGrid(target, &ink); break;
    case TargetKind::kAsymmetricCircles:
    case TargetKind::kCircles: AddCircles(target, &ink); break;
  }
  return ink;
}

}  // namespace trigpoint
