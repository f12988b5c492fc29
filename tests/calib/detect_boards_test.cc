// Boards found in rendered pictures: the right points, where they really are.
#include <apriltag/tag36h11.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/aruco.hpp>

#include "calib/base/error.h"
#include "calib/target/detect.h"
#include "tests/calib/target_rendering.h"

namespace trigpoint {
namespace {

constexpr double kTexels = 4000;  // a metre
ProgressSink progress;
CancelToken cancel;

struct Board {
  Target target;
  cv::Mat texture;
  Eigen::Vector2d origin;  // of the board's frame, texels
  bool y_up = false;
};

// A texture with room for `low` to `high` (board frame, m), white.
Board Blank(const Target& target, double margin_m, bool y_up) {
  Board board;
  board.target = target;
  board.y_up = y_up;
  Eigen::Vector2d high(0, 0);
  for (const Eigen::Vector3d& p : target.BoardPoints()) high = high.cwiseMax(p.head<2>());
  const Eigen::Vector2d size = (high + Eigen::Vector2d(2 * margin_m, 2 * margin_m)) * kTexels;
  board.texture = cv::Mat(static_cast<int>(size.y()), static_cast<int>(size.x()), CV_8U, cv::Scalar(235));
  board.origin = {margin_m * kTexels, y_up ? size.y() - margin_m * kTexels : margin_m * kTexels};
  return board;
}

// A dark rectangle with its lower-left (y up) or upper-left corner at (x, y), m.
void Fill(Board& board, double x, double y, double w, double h) {
  const double top = board.y_up ? board.origin.y() - (y + h) * kTexels : board.origin.y() + y * kTexels;
  cv::rectangle(
      board.texture,
      cv::Rect(static_cast<int>(std::lround(board.origin.x() + x * kTexels)), static_cast<int>(std::lround(top)),
               static_cast<int>(std::lround(w * kTexels)), static_cast<int>(std::lround(h * kTexels))),
      cv::Scalar(20), cv::FILLED);
}

Board MakeCheckerboard() {
  Target target;
  target.cols = 7;
  target.rows = 5;
  target.spacing_x_m = target.spacing_y_m = 0.03;
  Board board = Blank(target, 0.06, false);
  for (int r = -1; r < target.rows; ++r) {
    for (int c = -1; c < target.cols; ++c) {
      if ((r + c) % 2 == 0) Fill(board, 0.03 * c, 0.03 * r, 0.03, 0.03);
    }
  }
  return board;
}

Board MakeCircles() {
  Target target;
  target.kind = TargetKind::kAsymmetricCircles;
  target.cols = 4;
  target.rows = 11;
  target.spacing_x_m = target.spacing_y_m = 0.016;
  Board board = Blank(target, 0.03, false);
  for (const Eigen::Vector3d& p : target.BoardPoints()) {
    const auto fixed = [](double texels) { return static_cast<int>(std::lround(256 * texels)); };  // eight bits
    cv::circle(
        board.texture,
        cv::Point(fixed(board.origin.x() + p.x() * kTexels - 0.5), fixed(board.origin.y() + p.y() * kTexels - 0.5)),
        fixed(0.006 * kTexels), cv::Scalar(20), cv::FILLED, cv::LINE_8, 8);
  }
  return board;
}

// As Kalibr prints it: `border` dark cells around the code, small dark squares at the corners; `turn` quarter turns.
Board MakeAprilGrid(int border, int turn) {
  Target target;
  target.kind = TargetKind::kAprilGrid;
  target.cols = 4;
  target.rows = 3;
  target.spacing_x_m = target.spacing_y_m = 0.05;
  target.tag_spacing = 0.3;
  Board board = Blank(target, 0.03, true);
  apriltag_family_t* family = tag36h11_create();
  const double cell = 0.05 / (6 + 2 * border), gap = 0.015;
  for (int tag = 0; tag < 12; ++tag) {
    const double x = (tag % 4) * 0.065, y = (tag / 4) * 0.065;
    Fill(board, x, y, 0.05, 0.05);
    for (const auto& [dx, dy] :
         {std::pair(-gap, -gap), std::pair(0.05, -gap), std::pair(0.05, 0.05), std::pair(-gap, 0.05)}) {
      Fill(board, x + dx, y + dy, gap, gap);
    }
    for (uint32_t bit = 0; bit < family->nbits; ++bit) {
      if ((family->codes[tag] >> (family->nbits - 1 - bit) & 1) == 0) continue;
      int c = static_cast<int>(family->bit_x[bit]) - 1, r = static_cast<int>(family->bit_y[bit]) - 1;
      for (int i = 0; i < turn; ++i) {
        const int old = c;
        c = 5 - r;
        r = old;
      }
      // Light cell; rows count downwards in the code.
      const double left = board.origin.x() + (x + (c + border) * cell) * kTexels;
      const double top = board.origin.y() - (y + 0.05 - (r + border) * cell) * kTexels;
      cv::rectangle(board.texture, cv::Point(static_cast<int>(std::lround(left)), static_cast<int>(std::lround(top))),
                    cv::Point(static_cast<int>(std::lround(left + cell * kTexels)) - 1,
                              static_cast<int>(std::lround(top + cell * kTexels)) - 1),
                    cv::Scalar(235), cv::FILLED);
    }
  }
  tag36h11_destroy(family);
  return board;
}

Board MakeCharuco(bool first_white) {
  Target target;
  target.kind = TargetKind::kCharuco;
  target.cols = 7;
  target.rows = 6;
  target.spacing_x_m = target.spacing_y_m = 0.03;
  target.marker_size_m = 0.021;
  target.dictionary = "DICT_4X4_50";
  Board board = Blank(target, 0.05, false);
  const cv::Ptr<cv::aruco::Dictionary> dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
  int id = 0;
  for (int r = 0; r < target.rows; ++r) {
    for (int c = 0; c < target.cols; ++c) {
      const double x = 0.03 * (c - 1), y = 0.03 * (r - 1);
      if (((r + c) % 2 == 0) != first_white) {
        Fill(board, x, y, 0.03, 0.03);
        continue;
      }
      cv::Mat marker;
      cv::aruco::drawMarker(dictionary, id++, 84, marker);
      marker.copyTo(
          board.texture(cv::Rect(static_cast<int>(std::lround(board.origin.x() + (x + 0.0045) * kTexels)),
                                 static_cast<int>(std::lround(board.origin.y() + (y + 0.0045) * kTexels)), 84, 84)));
    }
  }
  return board;
}

const Camera kCamera(CameraModel::kRadtan, 640, 480, {600, 600, 320, 240, -0.1, 0.02, 0, 0});

struct Found {
  double rms = 0, most = 0;
  size_t points = 0;
};

// The board in four pictures, against truth.
Found Compare(const Board& board, double distance_m, const Camera& camera = kCamera) {
  std::vector<Rigid3d> poses;
  std::vector<cv::Mat> pictures;
  for (int i = 0; i < 4; ++i) {
    Rigid3d pose = LookAtBoard(camera, board.target, {300 + 15.0 * i, 240}, distance_m, 0.15 * i, i, 0.1 * i);
    if (board.y_up) {  // upright in the picture: the board's y points up, its z at the camera
      pose = LookAtBoard(camera, board.target, {300 + 15.0 * i, 240}, distance_m, 0.15 * i, i, 0.1 * i);
      const Eigen::Quaterniond flip(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
      const std::vector<Eigen::Vector3d> points = board.target.BoardPoints();
      const Eigen::Vector3d middle = 0.5 * (points.front() + points.back());
      pose = pose * Rigid3d(flip, middle - flip * middle);
    }
    poses.push_back(pose);
    pictures.push_back(RenderBoard(camera, pose, board.texture, kTexels, board.origin, board.y_up));
  }
  const std::vector<BoardView> views = DetectBoards(
      4, [&](int64_t i) { return pictures[static_cast<size_t>(i)]; }, board.target, 2, progress, cancel);
  Found found;
  const std::vector<Eigen::Vector3d> points = board.target.BoardPoints();
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_TRUE(views[i].usable) << views[i].problem;
    for (const BoardPoint& point : views[i].points) {
      const double error =
          (point.pixel - camera.Project(poses[i] * points[static_cast<size_t>(point.id)]).value()).norm();
      found.rms += error * error;
      found.most = std::max(found.most, error);
      ++found.points;
    }
  }
  found.rms = std::sqrt(found.rms / std::max<double>(1, static_cast<double>(found.points)));
  return found;
}

TEST(DetectBoards, Checkerboard) {
  const Found found = Compare(MakeCheckerboard(), 0.4);
  EXPECT_EQ(found.points, 4 * 35);
  EXPECT_LT(found.rms, 0.06);
  EXPECT_LT(found.most, 0.3);
}

TEST(DetectBoards, AsymmetricCircles) {
  const Found found = Compare(MakeCircles(), 0.4);
  EXPECT_EQ(found.points, 4 * 44);
  EXPECT_LT(found.rms, 0.15);  // the middle of a circle's picture is not the picture of its middle
}

TEST(DetectBoards, AprilGridWithEitherBorderHoweverTurned) {
  for (const auto& [border, turn] : {std::pair(1, 0), std::pair(2, 0), std::pair(2, 2), std::pair(2, 1)}) {
    const Found found = Compare(MakeAprilGrid(border, turn), 0.4);
    EXPECT_GT(found.points, 4 * 44) << border << " " << turn;
    EXPECT_LT(found.rms, 0.08) << border << " " << turn;
    EXPECT_LT(found.most, 0.5) << border << " " << turn;
  }
}

TEST(DetectBoards, CharucoWithEitherFirstSquare) {
  for (const bool first_white : {false, true}) {
    const Found found = Compare(MakeCharuco(first_white), 0.4);
    EXPECT_GT(found.points, 4 * 26) << first_white;
    EXPECT_LT(found.rms, 0.08) << first_white;
    EXPECT_LT(found.most, 0.4) << first_white;
  }
}

TEST(DetectBoards, NamesPicturesWithoutABoard) {
  const Board board = MakeCheckerboard();
  const std::vector<BoardView> views = DetectBoards(
      3,
      [&](int64_t i) -> cv::Mat {
        if (i == 1) throw InputError("b.jpg: the picture is cut off");
        return cv::Mat(480, 640, CV_8U, cv::Scalar(90));
      },
      board.target, 1, progress, cancel);
  EXPECT_THAT(views[0].problem, testing::HasSubstr("seen as a whole"));
  EXPECT_EQ(views[1].problem, "b.jpg: the picture is cut off");
  Target wrong = board.target;
  wrong.spacing_x_m = -1;
  EXPECT_THROW(DetectBoards(0, nullptr, wrong, 1, progress, cancel), InputError);
}

TEST(OtherCheckerboardIn, SaysWhichBoardIsThere) {
  const Board board = MakeCheckerboard();
  const cv::Mat picture = RenderBoard(kCamera, LookAtBoard(kCamera, board.target, {320, 240}, 0.4, 0.1, 0, 0),
                                      board.texture, kTexels, board.origin, false);
  Target wrong = board.target;
  wrong.cols = 9;
  wrong.rows = 6;
  EXPECT_EQ(OtherCheckerboardIn(picture, wrong), std::pair(7, 5));
}

}  // namespace
}  // namespace trigpoint
