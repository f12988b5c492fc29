// Calibration from points with known truth.
#include "calib/target/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/base/error.h"
#include "calib/camera/projection.h"
#include "calib/target/quality.h"
#include "tests/calib/target_rendering.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

Target Checkerboard(int cols = 9, int rows = 6, double square = 0.03) {
  Target target;
  target.kind = TargetKind::kCheckerboard;
  target.cols = cols;
  target.rows = rows;
  target.spacing_x_m = target.spacing_y_m = square;
  return target;
}

struct Case {
  const char* model;
  Camera camera;
  double distance_m;
};

std::vector<Case> Cases() {
  return {
      {"pinhole", Camera(CameraModel::kPinhole, 640, 480, {520, 524, 318, 236}), 0.45},
      {"radtan", Camera(CameraModel::kRadtan, 640, 480, {535, 536, 330, 236, -0.27, 0.08, 1e-3, -5e-4}), 0.45},
      {"radtan5", Camera(CameraModel::kRadtan, 640, 480, {535, 536, 330, 236, -0.29, 0.11, 1e-3, -5e-4, -0.02}), 0.4},
      {"rational",
       Camera(CameraModel::kRational, 1280, 720,
              {610, 609.8, 637.6, 366.9, 0.516, -2.58, 9e-4, -1e-4, 1.45, 0.395, -2.41, 1.38}),
       0.3},
      {"kannala_brandt",
       Camera(CameraModel::kKannalaBrandt, 848, 800, {284.9, 285.9, 425.2, 398.5, -0.0073, 0.0438, -0.0415, 0.0075}),
       0.16},
      {"kannala_brandt",
       Camera(CameraModel::kKannalaBrandt, 1200, 1200, {330, 330, 599.5, 599.5, 0.01, -0.002, 0.001, -0.0001}), 0.14},
  };
}

ProgressSink progress;
CancelToken cancel;

Calibration Calibrate(const CalibrationInput& input, const std::string& model) {
  CalibrateOptions options;
  options.model = model;
  return CalibrateCameras(input, options, progress, cancel);
}

TEST(ProjectByParams, DerivativesAreThoseOfDifferences) {
  for (const Case& c : Cases()) {
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.2, -0.15, 1), Eigen::Vector3d(-0.5, 0.3, 0.9)}) {
      Eigen::Vector2d pixel, plus, minus;
      Eigen::Matrix<double, 2, 3> by_point;
      Eigen::Matrix<double, 2, Eigen::Dynamic> by_params;
      ASSERT_TRUE(ProjectByParams(c.camera.model(), c.camera.params(), point, &pixel, &by_point, &by_params));
      EXPECT_LT((pixel - c.camera.Project(point).value()).norm(), 1e-9);
      for (size_t i = 0; i < c.camera.params().size(); ++i) {
        std::vector<double> high = c.camera.params(), low = high;
        const double h = 1e-6 * std::max(1.0, std::abs(high[i]));
        high[i] += h;
        low[i] -= h;
        ProjectByParams(c.camera.model(), high, point, &plus);
        ProjectByParams(c.camera.model(), low, point, &minus);
        const Eigen::Vector2d numeric = (plus - minus) / (2 * h);
        EXPECT_LT((numeric - by_params.col(static_cast<Eigen::Index>(i))).norm(), 1e-4 * (1 + numeric.norm()))
            << c.model << " " << i;
      }
    }
  }
}

TEST(CalibrateCameras, RecoversEveryModelWithoutNoise) {
  for (const Case& c : Cases()) {
    Random random(7);
    const Target target = Checkerboard();
    const CalibrationInput input =
        MakeInput(c.camera, target, SpreadViews(c.camera, target, 25, c.distance_m, random), 0, random);
    const Calibration result = Calibrate(input, c.model);
    const std::vector<double>& found = result.cameras[0].camera.params();
    EXPECT_LT(result.cameras[0].rms_px, 1e-3) << c.model;
    for (size_t i = 0; i < 4; ++i) EXPECT_NEAR(found[i], c.camera.params()[i], 0.05) << c.model << " " << i;
    EXPECT_EQ(result.cameras[0].views_used, 25) << c.model;
  }
}

// Over redraws of the noise the errors of all intrinsics together are as large as their covariance says.
TEST(CalibrateCameras, StatedSigmasAreTrue) {
  for (const Case& c : {Cases()[1], Cases()[4]}) {
    Random random(11);
    const Target target = Checkerboard();
    const std::vector<Rigid3d> views = SpreadViews(c.camera, target, 20, c.distance_m, random);
    constexpr int kDraws = 50;
    double nees = 0, sigma = 0;
    const auto dof = static_cast<double>(c.camera.params().size());
    for (int draw = 0; draw < kDraws; ++draw) {
      const CalibrationInput input = MakeInput(c.camera, target, views, 0.2, random);
      const Calibration result = Calibrate(input, c.model);
      const Eigen::VectorXd error =
          Eigen::Map<const Eigen::VectorXd>(result.cameras[0].camera.params().data(), static_cast<Eigen::Index>(dof)) -
          Eigen::Map<const Eigen::VectorXd>(c.camera.params().data(), static_cast<Eigen::Index>(dof));
      nees += error.dot(result.cameras[0].covariance.ldlt().solve(error));
      sigma += result.cameras[0].sigma_px / kDraws;
    }
    // 95 % band of a chi-square of kDraws * dof, by its normal approximation.
    const double mean = kDraws * dof, spread = 1.96 * std::sqrt(2 * mean);
    EXPECT_GT(nees, mean - spread) << c.model;
    EXPECT_LT(nees, mean + spread) << c.model;
    EXPECT_NEAR(sigma, 0.2, 0.005) << c.model;
  }
}

TEST(CalibrateCameras, NamesOutliers) {
  const Camera camera = Cases()[1].camera;
  Random random(3);
  const Target target = Checkerboard();
  CalibrationInput input = MakeInput(camera, target, SpreadViews(camera, target, 20, 0.45, random), 0.1, random);
  for (BoardPoint& point : input.views[4].points) point.pixel.x() += (point.id / 9 % 2) * 3.0;  // rows torn apart
  input.views[7].points[10].pixel += Eigen::Vector2d(6, -4);
  const Calibration result = Calibrate(input, "radtan");
  EXPECT_FALSE(result.views[4].used);
  EXPECT_THAT(result.views[4].reason, HasSubstr("sigma off"));
  EXPECT_EQ(result.views[7].points_used, result.views[7].points - 1);
  EXPECT_NEAR(result.cameras[0].camera.params()[0], 535, 3 * result.cameras[0].Sigmas()[0] + 0.1);
}

TEST(CalibrateCameras, FindsABentBoard) {
  const Camera camera = Cases()[1].camera;
  Random random(5);
  const Target target = Checkerboard();
  std::vector<Eigen::Vector3d> board = target.BoardPoints();
  for (Eigen::Vector3d& p : board) {
    const double x = (p.x() - 0.12) / 0.12;
    p.z() += 0.002 * (1 - x * x);
  }
  CalibrationInput input = MakeInput(camera, target, {}, 0.1, random);
  for (const Rigid3d& pose : SpreadViews(camera, target, 25, 0.45, random)) {
    const int f = static_cast<int>(input.frames.size());
    input.frames.push_back(std::to_string(f));
    input.views.push_back({0, f, "image", SeePoints(camera, board, pose, 0.1, random)});
  }
  CalibrateOptions options;
  options.model = "radtan";
  options.board_shape = true;
  const Calibration bent = CalibrateCameras(input, options, progress, cancel);
  EXPECT_NEAR(bent.board.values[0], 0.002, 4 * bent.board.sigma[0]);
  EXPECT_LT(bent.board.sigma[0], 1e-4);
  EXPECT_NEAR(bent.board.values[1], 0, 4 * bent.board.sigma[1]);
  EXPECT_NEAR(bent.cameras[0].sigma_px, 0.1, 0.01);
}

TEST(CalibrateCameras, RecoversARigWhoseBoardLooksTheSameTurned) {
  const Camera left = Cases()[1].camera, right = Cases()[4].camera;
  const Rigid3d right_from_left(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.2, 1, 0).normalized())),
                                {-0.12, 0.01, 0.02});
  const Target target = Checkerboard(8, 6);
  ASSERT_TRUE(target.LooksTheSameTurned());
  Random random(9);
  CalibrationInput input = MakeInput(left, target, SpreadViews(left, target, 25, 0.45, random), 0.1, random);
  input.cameras.push_back({"cam1", right.width(), right.height()});
  Random again(9);
  const std::vector<Rigid3d> poses = SpreadViews(left, target, 25, 0.45, again);
  const int last = static_cast<int>(target.BoardPoints().size()) - 1;
  for (size_t f = 0; f < poses.size(); f += 2) {
    std::vector<BoardPoint> points = SeePoints(right, target.BoardPoints(), right_from_left * poses[f], 0.1, random);
    if (f % 3 == 0) {
      for (BoardPoint& point : points) point.id = last - point.id;  // counted from the other corner
    }
    input.views.push_back({1, static_cast<int>(f), "right", points});
  }
  const Calibration result = Calibrate(input, "radtan,kannala_brandt");
  const Vector6d error = result.cameras[1].cam_from_rig.Minus(right_from_left);
  const double nees = error.dot(result.cameras[1].cam_from_rig_covariance.ldlt().solve(error));
  EXPECT_LT(nees, 22.5);  // chi-square of 6, 99.9 %
  EXPECT_LT(error.tail<3>().norm(), 1e-3);
  EXPECT_EQ(result.cameras[1].views_used, 13);
}

TEST(CalibrateCameras, SaysWhatIsMissing) {
  const Camera camera = Cases()[0].camera;
  Random random(1);
  const Target target = Checkerboard();
  const CalibrationInput two = MakeInput(camera, target, SpreadViews(camera, target, 2, 0.45, random), 0.1, random);
  try {
    Calibrate(two, "radtan");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("at least 3 are needed"));
  }
  EXPECT_THROW(Calibrate(two, "fisheye"), OptionError);
}

Quality JudgedAs(const CalibrationInput& input, const std::string& model, Calibration* calibration = nullptr) {
  CalibrateOptions options;
  options.model = model;
  Calibration its = CalibrateCameras(input, options, progress, cancel);
  const Quality quality = JudgeCalibration(input, options, {}, progress, cancel, &its);
  if (calibration != nullptr) *calibration = its;
  return quality;
}

bool Has(const Quality& quality, const std::string& check, FindingLevel least) {
  for (const Finding& f : quality.findings) {
    if (f.check == check && f.level >= least) return true;
  }
  return false;
}

TEST(JudgeCalibration, AcceptsAGoodOneAndAlwaysSpeaksOfSize) {
  const Camera camera = Cases()[1].camera;
  Random random(2);
  const Target target = Checkerboard();
  const Quality quality =
      JudgedAs(MakeInput(camera, target, SpreadViews(camera, target, 40, 0.4, random), 0.1, random), "radtan");
  for (const Finding& f : quality.findings) EXPECT_EQ(f.level, FindingLevel::kNote) << f.reason;
  EXPECT_TRUE(Has(quality, "size", FindingLevel::kNote));
  ASSERT_TRUE(quality.halves.done);
  EXPECT_LT(quality.halves.ratio[0], 2.0);
  EXPECT_GT(quality.coverage[0].share, 0.8);
}

TEST(JudgeCalibration, RefusesABoardThatIsNeverTilted) {
  const Camera camera = Cases()[1].camera;
  Random random(2);
  const Target target = Checkerboard();
  std::vector<Rigid3d> views;
  for (int i = 0; i < 20; ++i) {
    // Parallel to the picture's plane, wherever it is.
    const Eigen::Vector3d t(random.Uniform(-0.2, 0.05), random.Uniform(-0.2, 0.05), random.Uniform(0.4, 0.6));
    views.emplace_back(Eigen::Quaterniond(Eigen::AngleAxisd(random.Uniform(-0.3, 0.3), Eigen::Vector3d::UnitZ())), t);
  }
  const Quality quality = JudgedAs(MakeInput(camera, target, views, 0.1, random), "radtan");
  EXPECT_EQ(quality.level, FindingLevel::kRefusal);
  EXPECT_TRUE(Has(quality, "tilt", FindingLevel::kRefusal));
}

TEST(JudgeCalibration, RefusesAWrongBoard) {
  const Camera camera = Cases()[1].camera;
  Random random(2);
  Target target = Checkerboard();
  CalibrationInput input = MakeInput(camera, target, SpreadViews(camera, target, 30, 0.45, random), 0.1, random);
  input.target.spacing_y_m *= 1.05;  // squares that aren't square
  const Quality quality = JudgedAs(input, "radtan");
  EXPECT_TRUE(Has(quality, "board", FindingLevel::kRefusal));
  EXPECT_EQ(quality.level, FindingLevel::kRefusal);
}

TEST(JudgeCalibration, WarnsOfPoorCoverageAndNamesTheParts) {
  const Camera camera = Cases()[1].camera;
  Random random(2);
  const Target target = Checkerboard(9, 6, 0.02);
  std::vector<Rigid3d> views;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d pixel(random.Uniform(130, 250), random.Uniform(120, 360));
    views.push_back(LookAtBoard(camera, target, pixel, 0.6, 0.6, random.Uniform(0, 6.28), 0));
  }
  const Quality quality = JudgedAs(MakeInput(camera, target, views, 0.1, random), "radtan");
  EXPECT_TRUE(Has(quality, "coverage", FindingLevel::kWarning));
  EXPECT_THAT(quality.coverage[0].poor, testing::Contains("right"));
}

TEST(JudgeCalibration, SeesThatAModelDoesNotFit) {
  const Camera camera(CameraModel::kRadtan, 640, 480, {400, 400, 320, 240, -0.3, 0.09, 0, 0});
  Random random(2);
  const Target target = Checkerboard();
  const CalibrationInput input = MakeInput(camera, target, SpreadViews(camera, target, 30, 0.35, random), 0.1, random);
  const Quality quality = JudgedAs(input, "pinhole");
  EXPECT_TRUE(Has(quality, "pattern", FindingLevel::kWarning));
}

TEST(CrossValidate, HalvesDifferAsMuchAsTheirCovariancesPredict) {
  const Camera camera(CameraModel::kPinhole, 640, 480, {400, 400, 320, 240});
  const Target target = Checkerboard();
  CalibrateOptions options;
  options.model = "pinhole";
  constexpr int kDraws = 30;
  double squares = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(static_cast<uint64_t>(draw + 1));
    const CalibrationInput input =
        MakeInput(camera, target, SpreadViews(camera, target, 20, 0.35, random), 0.2, random);
    const Calibration calibration = CalibrateCameras(input, options, progress, cancel);
    const CrossValidation halves =
        CrossValidate(input, options, calibration, {MeasureCoverage(input, calibration, 0)}, progress, cancel);
    ASSERT_TRUE(halves.done) << halves.reason;
    squares += halves.ratio[0] * halves.ratio[0];
  }
  // Two to four parameters differ: the mean of 30 squares has a sigma of 0.13 to 0.18.
  EXPECT_GT(squares / kDraws, 0.6);
  EXPECT_LT(squares / kDraws, 1.4);
}

// Points of one picture that are off together are not that many independent ones: only the halves show it.
TEST(JudgeCalibration, WidensSigmasByWhatTheHalvesDiffer) {
  const Camera camera(CameraModel::kPinhole, 640, 480, {400, 400, 320, 240});
  Random random(2);
  const Target target = Checkerboard();
  CalibrationInput input = MakeInput(camera, target, SpreadViews(camera, target, 30, 0.35, random), 0.02, random);
  for (CalibrationView& view : input.views) {
    // The board is bent anew in each.
    const double x = random.Normal() * 1.5e-5, y = random.Normal() * 1.5e-5;
    for (BoardPoint& p : view.points) {
      const Eigen::Vector2d d = p.pixel - view.points.front().pixel;
      p.pixel += Eigen::Vector2d(x * d.x() * d.x(), y * d.y() * d.y());
    }
  }
  Calibration calibration;
  const Quality quality = JudgedAs(input, "pinhole", &calibration);
  ASSERT_TRUE(quality.halves.done);
  EXPECT_GT(calibration.sigma_factor, 2);
  EXPECT_EQ(calibration.sigma_factor, quality.halves.ratio[0]);
  const CalibratedCamera& its = calibration.cameras[0];
  const double focal_sigma = its.Sigmas()[0];
  CalibrateOptions options;
  options.model = "pinhole";
  const Calibration textbook = CalibrateCameras(input, options, progress, cancel);
  EXPECT_NEAR(focal_sigma, calibration.sigma_factor * textbook.cameras[0].Sigmas()[0], 1e-9);
  EXPECT_LT(std::abs(its.camera.params()[0] - 400), 3 * focal_sigma);
}

}  // namespace
}  // namespace trigpoint
