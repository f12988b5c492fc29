// Real pictures against published references and against OpenCV's own calibration of the same corners.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "calib/base/error.h"
#include "calib/target/calibrate.h"
#include "tests/eval/shared_data.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

ProgressSink progress;
CancelToken cancel;

Target BoardOf(TargetKind kind, int cols, int rows, double size) {
  Target target;
  target.kind = kind;
  target.cols = cols;
  target.rows = rows;
  target.spacing_x_m = target.spacing_y_m = size;
  return target;
}

CalibrationInput Detected(const fs::path& dir, const std::string& begin, const Target& target) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(dir)) {
    const std::string name = entry.path().filename().string(), ending = entry.path().extension().string();
    if (name.starts_with(begin) && (ending == ".jpg" || ending == ".png")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  const std::vector<BoardView> views = DetectBoards(
      static_cast<int64_t>(files.size()),
      [&](int64_t i) { return cv::imread(files[static_cast<size_t>(i)].string(), cv::IMREAD_GRAYSCALE); }, target, 2,
      progress, cancel);
  CalibrationInput input;
  input.target = target;
  input.cameras.push_back({"cam0", views.front().width, views.front().height});
  for (size_t i = 0; i < files.size(); ++i) {
    if (!views[i].usable) continue;
    const int f = static_cast<int>(input.frames.size());
    input.frames.push_back(files[i].stem().string());
    input.views.push_back({0, f, files[i].filename().string(), views[i].points});
  }
  return input;
}

// "filename x y level": all corners of a board, row by row.
CalibrationInput FromMrgingham(const fs::path& file, const Target& target, int width, int height) {
  CalibrationInput input;
  input.target = target;
  input.cameras.push_back({"cam0", width, height});
  std::ifstream in(file);
  std::map<std::string, std::vector<BoardPoint>> boards;
  for (std::string line; std::getline(in, line);) {
    std::istringstream fields(line);
    std::string name;
    double x = 0, y = 0;
    if (line.starts_with("#") || !(fields >> name >> x >> y)) continue;
    auto& points = boards[name];
    points.push_back({static_cast<int>(points.size()), {x, y}});
  }
  for (const auto& [name, points] : boards) {
    if (points.size() != target.BoardPoints().size()) continue;
    const int f = static_cast<int>(input.frames.size());
    input.frames.push_back(name);
    input.views.push_back({0, f, name, points});
  }
  return input;
}

struct Comparison {
  double focal = 0, sigma = 0, rms = 0, cv_focal = 0, cv_rms = 0;
  std::vector<std::string> outliers;
  int views = 0;
};

// Plain least squares on both sides, then ours with its outliers left out.
Comparison Compare(const char* name, const CalibrationInput& input, const std::string& model, int flags, bool square) {
  Comparison result;
  CalibrateOptions options;
  options.model = model;
  options.square_pixels = square;
  options.reject = false;
  const Calibration all = CalibrateCameras(input, options, progress, cancel);
  options.reject = true;
  const Calibration robust = CalibrateCameras(input, options, progress, cancel);
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> image;
  const std::vector<Eigen::Vector3d> points = input.target.BoardPoints();
  for (const CalibrationView& view : input.views) {
    board.emplace_back();
    image.emplace_back();
    for (const BoardPoint& p : view.points) {
      const Eigen::Vector3d& b = points[static_cast<size_t>(p.id)];
      board.back().emplace_back(static_cast<float>(b.x()), static_cast<float>(b.y()), 0.0F);
      image.back().emplace_back(static_cast<float>(p.pixel.x()), static_cast<float>(p.pixel.y()));
    }
  }
  cv::Mat k = cv::Mat::eye(3, 3, CV_64F), d;
  std::vector<cv::Mat> r, t;
  if (square) flags |= cv::CALIB_FIX_ASPECT_RATIO;
  result.cv_rms = cv::calibrateCamera(board, image, {input.cameras[0].width, input.cameras[0].height}, k, d, r, t,
                                      flags, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 300, 1e-12});
  const CalibratedCamera& ours = all.cameras[0];
  result.views = static_cast<int>(input.views.size());
  result.focal = ours.camera.params()[0];
  result.sigma = ours.Sigmas()[0];
  result.rms = ours.rms_px;
  result.cv_focal = k.at<double>(0, 0);
  for (size_t v = 0; v < input.views.size(); ++v) {
    if (!robust.views[v].used) result.outliers.push_back(input.views[v].image);
  }
  fmt::print("{}: {} views; all points: fx {:.3f} +- {:.3f}, rms {:.4f} px; OpenCV: fx {:.3f}, rms {:.4f} px\n", name,
             result.views, result.focal, result.sigma, result.rms, result.cv_focal, result.cv_rms);
  const CalibratedCamera& best = robust.cameras[0];
  fmt::print("  outliers left out ({} of {} points, {} of {} views used): fx {:.3f} +- {:.3f}, rms {:.4f} px\n",
             best.points_used, best.points, best.views_used, best.views, best.camera.params()[0], best.Sigmas()[0],
             best.rms_px);
  return result;
}

void ExpectAgreement(const Comparison& c) {
  EXPECT_LT(std::abs(c.focal - c.cv_focal), 0.2 * c.sigma);  // OpenCV keeps corners as floats
  EXPECT_LT(c.rms, c.cv_rms * 1.0005);
}

// The corners behind left_intrinsics.yml, found again as its programme finds them. In 11 px windows two near pictures
// take wrong corners along (per-view rms 1.18 and 0.38 px there), which is why its focal length is 3 px above ours.
CalibrationInput ReferenceCorners(const fs::path& dir) {
  CalibrationInput input;
  input.target = BoardOf(TargetKind::kCheckerboard, 9, 6, 0.025);
  for (int i = 1; i <= 14; ++i) {
    const fs::path file = dir / fmt::format("left{:02d}.jpg", i);
    if (!fs::exists(file)) continue;
    const cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    std::vector<cv::Point2f> corners;
    EXPECT_TRUE(cv::findChessboardCorners(
        image, {9, 6}, corners, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_FAST_CHECK | cv::CALIB_CB_NORMALIZE_IMAGE));
    cv::cornerSubPix(image, corners, {11, 11}, {-1, -1}, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 0.1});
    std::vector<BoardPoint> points;
    for (const cv::Point2f& c : corners) points.push_back({static_cast<int>(points.size()), {c.x, c.y}});
    if (input.cameras.empty()) input.cameras.push_back({"cam0", image.cols, image.rows});
    const int f = static_cast<int>(input.frames.size());
    input.frames.push_back(file.stem().string());
    input.views.push_back({0, f, file.filename().string(), points});
  }
  return input;
}

TEST(CalibrateAgainstOpenCv, StereoLeftFromTheReferencesCorners) {
  const auto data = SharedData("calibration/stereo_checkerboard");
  if (!data) GTEST_SKIP() << "no shared data";
  const CalibrationInput input = ReferenceCorners(*data);
  ASSERT_EQ(input.views.size(), 13u);
  const Comparison c = Compare("stereo left, the reference's corners", input, "radtan5", 0, true);
  ExpectAgreement(c);
  EXPECT_NEAR(c.focal, 535.91573, 2 * c.sigma);  // left_intrinsics.yml
  EXPECT_LE(c.rms, 0.39260);
}

TEST(CalibrateAgainstOpenCv, StereoLeft) {
  const auto data = SharedData("calibration/stereo_checkerboard");
  if (!data) GTEST_SKIP() << "no shared data";
  const CalibrationInput all = Detected(*data, "left", BoardOf(TargetKind::kCheckerboard, 9, 6, 0.025));
  EXPECT_EQ(all.views.size(), 13u);
  const Comparison c = Compare("stereo left", all, "radtan5", 0, true);
  ExpectAgreement(c);
  EXPECT_LE(c.rms, 0.39259);  // of left_intrinsics.yml
}

TEST(CalibrateAgainstOpenCv, LifecamChessboardFromGivenCorners) {
  const auto data = SharedData("calibration/lifecam");
  if (!data) GTEST_SKIP() << "no shared data";
  const CalibrationInput input = FromMrgingham(*data / "mrgingham_corners_chessboard_1280.vnl",
                                               BoardOf(TargetKind::kCheckerboard, 10, 10, 0.03), 1280, 720);
  ASSERT_GE(input.views.size(), 10u);
  ExpectAgreement(Compare("lifecam chessboard, mrgingham's corners", input, "radtan", cv::CALIB_FIX_K3, false));
}

TEST(CalibrateAgainstOpenCv, LifecamChessboard) {
  const auto data = SharedData("calibration/lifecam");
  if (!data) GTEST_SKIP() << "no shared data";
  const CalibrationInput input =
      Detected(*data / "chessboard_1280", "img", BoardOf(TargetKind::kCheckerboard, 10, 10, 0.03));
  ASSERT_GE(input.views.size(), 10u);
  ExpectAgreement(Compare("lifecam chessboard", input, "radtan", cv::CALIB_FIX_K3, false));
}

TEST(CalibrateAgainstOpenCv, LifecamCharuco) {
  const auto data = SharedData("calibration/lifecam");
  if (!data) GTEST_SKIP() << "no shared data";
  Target target = BoardOf(TargetKind::kCharuco, 8, 8, 0.0254);
  target.marker_size_m = 0.01905;
  target.dictionary = "DICT_4X4_1000";
  const CalibrationInput input = Detected(*data / "charuco_1280", "Micro", target);
  ASSERT_GE(input.views.size(), 14u);
  const Comparison c = Compare("lifecam charuco", input, "radtan", cv::CALIB_FIX_K3, false);
  ExpectAgreement(c);
  EXPECT_NEAR(c.focal, 1130.5, 2 * std::hypot(c.sigma, 3.0));  // SOURCE.md, which states no sigma
  EXPECT_LE(c.rms, 0.30);
}

}  // namespace
}  // namespace trigpoint
