// The lens of a camera, from a reconstruction that was made with a guess or a calibration of it.
#include "localize/reconstruct/self_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "calib/geometry/so3.h"
#include "localize/reconstruct/lens_check.h"
#include "localize/reconstruct/lens_shift.h"

namespace trigpoint {
namespace {

constexpr double kNoise = 0.3;  // px

Camera TrueCamera() { return {CameraModel::kRadtan, 640, 480, {500, 500, 324, 236, -0.1, 0.02, 0, 0}}; }

// Cameras about a heap of points, from all sides and turned about their axes; rays as the guessed camera sees them.
struct Scene {
  LocalizeInput input;
  Reconstruction reconstruction;
};

// `stretch`: 1 sigma of the share by which each picture's rows lie too far apart, as where it moves while they are
// read.
Scene MakeScene(uint64_t seed, const Camera& used = {CameraModel::kPinhole, 640, 480, {530, 530, 319.5, 239.5}},
                double stretch = 0) {
  Scene scene;
  Random random(seed);
  BodyCamera guess;
  guess.camera = used;
  guess.focal_sigma_share = 0.1;
  guess.guessed_focal_px = 530;
  scene.input.cameras = {guess};
  BundleProblem& p = scene.reconstruction.problem;
  p.views = {Rigid3d()};
  for (int i = 0; i < 16; ++i) {
    const Eigen::Quaterniond turn = ExpSO3({0.3 * random.Normal(), 0.4 * i, 0}) * ExpSO3({0, 0, 0.5 * random.Normal()});
    p.poses.push_back({turn.conjugate(), Eigen::Vector3d(0, 0, 6)});
    scene.input.images.push_back({i, std::to_string(i), 0, i});
  }
  const Camera truth = TrueCamera();
  std::vector<double> rows(16, 1);
  for (double& row : rows) row += stretch > 0 ? stretch * random.Normal() : 0;
  for (int j = 0; j < 400; ++j) {
    const Eigen::Vector3d y(1.5 * random.Normal(), 1.5 * random.Normal(), 1.5 * random.Normal());
    for (int i = 0; i < 16; ++i) {
      auto pixel = truth.Project(p.poses[static_cast<size_t>(i)] * y);
      if (!pixel) continue;
      *pixel += kNoise * Eigen::Vector2d(random.Normal(), random.Normal());
      pixel->y() = 240 + (pixel->y() - 240) * rows[static_cast<size_t>(i)];
      const auto ray = guess.camera.Unproject(*pixel);
      if (!truth.Contains(*pixel) || !ray) continue;
      BearingObservation o;
      o.point = static_cast<int>(p.points.size());
      o.pose = i;
      o.w = guess.camera.BearingSqrtInfo(*pixel, kNoise).cast<float>();
      o.ray = ray->cast<float>();
      p.observations.push_back(o);
      scene.reconstruction.image_of.push_back(i);
    }
    p.points.push_back(y);
  }
  scene.reconstruction.point_valid.assign(p.points.size(), true);
  scene.reconstruction.sigma_px = kNoise;
  // Of the length of it all nothing else knows.
  PoseFactor gauge;
  gauge.kind = PoseFactor::Kind::kBetween;
  gauge.a = 0, gauge.b = 4;
  gauge.measured = p.poses[0] * p.poses[4].Inverse();
  gauge.sqrt_info = 0.1 * Matrix6d::Identity();
  p.factors = {gauge};
  return scene;
}

TEST(SelfCalibrate, FindsFocalLengthPrincipalPointAndDistortionWithinItsSigmas) {
  double chi2 = 0;
  constexpr int kDraws = 10;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    const Scene scene = MakeScene(seed);
    const std::vector<SelfCalibration> found = SelfCalibrate(scene.input, scene.reconstruction);
    ASSERT_EQ(found.size(), 1U);
    const std::vector<double>& p = found[0].found.params();
    EXPECT_NEAR(p[0], 500, 4 * found[0].sigma_focal_px);
    EXPECT_LT(found[0].sigma_focal_px, 1);
    EXPECT_NEAR(p[2], 324, 4 * found[0].sigma_centre_px);
    EXPECT_NEAR(p[4], -0.1, 4 * found[0].sigma_k1);
    EXPECT_GT(found[0].shift_px, 10);
    chi2 += std::pow((p[0] - 500) / found[0].sigma_focal_px, 2);
  }
  // 10 squares of unit normals: 3.2 to 20.5 in 95 % of all cases.
  EXPECT_GT(chi2, 2);
  EXPECT_LT(chi2, 25);
}

// Errors that all points of a picture share do not average out by their number.
TEST(SelfCalibrate, KnowsWhatPicturesThatErrAlikeLeaveUnknown) {
  double chi2 = 0;
  constexpr int kDraws = 10;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    const Scene scene = MakeScene(seed, {CameraModel::kPinhole, 640, 480, {530, 530, 319.5, 239.5}}, 0.01);
    const std::vector<SelfCalibration> found = SelfCalibrate(scene.input, scene.reconstruction);
    ASSERT_EQ(found.size(), 1U);
    chi2 += std::pow((found[0].found.params()[0] - 500) / found[0].sigma_focal_px, 2);
  }
  // 10 squares of unit normals: 3.2 to 20.5 in 95 % of all cases; 48 where every point counts for itself.
  EXPECT_LT(chi2, 25);
}

TEST(SelfCalibrate, LeavesCalibratedCamerasAlone) {
  Scene scene = MakeScene(1);
  scene.input.cameras[0].focal_sigma_share = 0;
  EXPECT_TRUE(SelfCalibrate(scene.input, scene.reconstruction).empty());
}

// Of 503 px and 326 px, which are 500 px and 324 px.
TEST(ReviseLenses, FindsWhatIsOffAboutACalibration) {
  const Camera off(CameraModel::kRadtan, 640, 480, {503, 503, 326, 236, -0.1, 0.02, 0, 0});
  for (const bool right : {true, false}) {
    SCOPED_TRACE(right);
    double chi2 = 0;
    constexpr int kDraws = 10;
    for (uint64_t seed = 1; seed <= kDraws; ++seed) {
      Scene scene = MakeScene(seed, right ? TrueCamera() : off);
      scene.input.cameras[0].focal_sigma_share = 0;
      const auto found = ReviseLenses(scene.input, scene.reconstruction, scene.input.cameras);
      ASSERT_EQ(found.size(), 1U);
      const std::vector<double>& p = found[0].found.params();
      EXPECT_NEAR(p[2], 324, 4 * found[0].sigma_centre_px);
      chi2 += std::pow((p[0] - 500) / found[0].sigma_focal_px, 2);
      EXPECT_EQ(found[0].sigmas < 4, right) << found[0].sigmas;
    }
    // 10 squares of unit normals: 3.2 to 20.5 in 95 % of all cases.
    EXPECT_GT(chi2, 2);
    EXPECT_LT(chi2, 25);
  }
}

TEST(ReviseLenses, KeepsDecentringAndTheRatioOfFocalLengths) {
  const Camera used(CameraModel::kRadtan, 640, 480, {500, 505, 324, 236, -0.1, 0.02, 0.001, -0.002});
  Scene scene = MakeScene(1, used);
  scene.input.cameras[0].focal_sigma_share = 0;
  const auto found = ReviseLenses(scene.input, scene.reconstruction, scene.input.cameras);
  ASSERT_EQ(found.size(), 1U);
  const std::vector<double>& p = found[0].found.params();
  EXPECT_NEAR(p[1] / p[0], 505. / 500, 1e-9);
  EXPECT_EQ(p[6], 0.001);
  EXPECT_EQ(p[7], -0.002);
}

TEST(ReviseLenses, LeavesOtherModelsAlone) {
  Scene scene = MakeScene(1);
  scene.input.cameras[0].camera = Camera(CameraModel::kKannalaBrandt, 640, 480, {300, 300, 320, 240, 0, 0, 0, 0});
  EXPECT_TRUE(ReviseLenses(scene.input, scene.reconstruction, scene.input.cameras).empty());
}

TEST(CheckLenses, ACalibrationThatFitsIsNotContradicted) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const Scene scene = MakeScene(seed, TrueCamera());
    const LensCheck check = CheckLenses(scene.input, scene.reconstruction);
    ASSERT_EQ(check.errors.size(), 1U);
    EXPECT_LT(check.better, 0.01);
    EXPECT_FALSE(Contradiction(scene.input, check).has_value());
  }
}

// The bundle with the true motion as odometry of 0.2 rad and 0.2 m a step, 1 sigma.
void SolveAlong(const std::vector<Rigid3d>& truth, BundleProblem* p) {
  p->pose_constant.assign(truth.size(), false);
  p->pose_constant[0] = true;
  p->loss = MakeLoss("dcs", 3);
  for (int i = 0; i + 1 < static_cast<int>(truth.size()); ++i) {
    PoseFactor& step = p->factors.emplace_back();
    step.kind = PoseFactor::Kind::kBetween;
    step.a = i, step.b = i + 1;
    step.measured = truth[static_cast<size_t>(i)] * truth[static_cast<size_t>(i) + 1].Inverse();
    step.sqrt_info = 5 * Matrix6d::Identity();
  }
  ProgressSink silent;
  BundleOptions options;
  options.max_iterations = 100;
  options.relative_cost_tolerance = 1e-9;
  SolveBundle(*p, options, silent, {});
}

// The mean of all poses, per degree of freedom.
double MeanNees(const std::vector<Rigid3d>& truth, const BundleProblem& p) {
  const BundleCovariance covariance(p, 1, {});
  double sum = 0;
  for (size_t i = 1; i < truth.size(); ++i) {
    const Vector6d e = p.poses[i].Minus(truth[i]);
    const Matrix6d c = covariance.Joint({static_cast<int>(i)});
    sum += e.dot(c.ldlt().solve(e)) / 6;
  }
  return sum / static_cast<double>(truth.size() - 1);
}

// A lens that is off by what its covariance says.
TEST(LensRoots, PosesUnderALensWithKnownErrorsAreWithinTheirSigmas) {
  constexpr int kDraws = 20;
  SelfCalibration known;
  known.covariance.diagonal() << 5e-7, 0.03, 0.03, 1e-7, 1e-7;
  known.covariance(0, 3) = known.covariance(3, 0) = 1e-7;
  const Eigen::Matrix<double, 5, 5> root = known.covariance.llt().matrixL();
  const double corner = HalfDiagonal(TrueCamera()) / 500;
  Random random(5);
  double nees = 0, without = 0;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    Eigen::Matrix<double, 5, 1> e;
    for (double& value : e) value = random.Normal();
    e = (root * e).eval();
    const double focal = 500 * (1 + e(0));
    Scene scene = MakeScene(seed, {CameraModel::kRadtan,
                                   640,
                                   480,
                                   {focal, focal, 324 + e(1), 236 + e(2), -0.1 + e(3) / std::pow(corner, 2),
                                    0.02 + e(4) / std::pow(corner, 4), 0, 0}});
    const std::vector<Rigid3d> truth = scene.reconstruction.problem.poses;
    Reconstruction& r = scene.reconstruction;
    SolveAlong(truth, &r.problem);
    without += MeanNees(truth, r.problem) / kDraws;
    r.lens_roots = LensRoots(scene.input, {known}, 0);
    ASSERT_EQ(r.lens_roots.size(), 5U);
    r.problem.pose_shifts = PoseShiftsByLenses(scene.input, r, 1, {});
    nees += MeanNees(truth, r.problem) / kDraws;
  }
  // Five errors of the lens, which the poses of a draw share: 1 sigma of the mean over 20 draws is 0.14.
  EXPECT_GT(nees, 0.58);
  EXPECT_LT(nees, 1.42);
  EXPECT_GT(without, 2);
}

// Errors of a lens move points by many of their sigmas; a kernel that leaves outliers out must not hide that.
TEST(PoseShiftsByLenses, AreThoseOfABundleUnderTheOtherLens) {
  const std::vector<Rigid3d> truth = MakeScene(3).reconstruction.problem.poses;
  const auto scene_with = [&](double centre) {
    Scene scene = MakeScene(3, {CameraModel::kRadtan, 640, 480, {500, 500, centre, 236, -0.1, 0.02, 0, 0}});
    SolveAlong(truth, &scene.reconstruction.problem);
    return scene;
  };
  Scene scene = scene_with(324);
  const Scene other = scene_with(325);
  Reconstruction& r = scene.reconstruction;
  r.lens_roots.assign(5, LensParameters{});
  r.lens_roots[0] = {0, 1, 0, 0, 0};
  const Eigen::MatrixXd shifts = PoseShiftsByLenses(scene.input, r, 1, {});
  ASSERT_EQ(shifts.cols(), 1);
  Eigen::VectorXd moved(shifts.rows());
  for (size_t i = 0; i < truth.size(); ++i) {
    moved.segment<6>(6 * static_cast<Eigen::Index>(i)) =
        other.reconstruction.problem.poses[i].Minus(r.problem.poses[i]);
  }
  const double off = std::min((shifts.col(0) - moved).norm(), (shifts.col(0) + moved).norm());
  EXPECT_LT(off, 0.2 * moved.norm()) << shifts.col(0).norm();
}

// A bundle under a lens that is a little off, which bends it; what the images ask for bends it back.
TEST(LensErrors, ShowWhereThePosesWouldBe) {
  const std::vector<Rigid3d> truth = MakeScene(3).reconstruction.problem.poses;
  Scene scene = MakeScene(3, {CameraModel::kRadtan, 640, 480, {502, 502, 325, 236, -0.095, 0.02, 0, 0}});
  Reconstruction& r = scene.reconstruction;
  const CancelToken cancel;
  SolveAlong(truth, &r.problem);
  EXPECT_EQ(PoseShiftsByLenses(scene.input, r, 1, cancel).size(), 0) << "no other lens is known of";
  r.lens_errors = LensErrors(scene.input, r);
  ASSERT_EQ(r.lens_errors.size(), 1U);
  EXPECT_NEAR(r.lens_errors[0][0], 500.0 / 502 - 1, 0.002);
  EXPECT_NEAR(r.lens_errors[0][1], -1, 0.5);
  const Eigen::MatrixXd shifts = PoseShiftsByLenses(scene.input, r, 1, cancel);
  ASSERT_EQ(shifts.rows(), static_cast<Eigen::Index>(6 * truth.size()));
  ASSERT_EQ(shifts.cols(), 6) << "five of a usual calibration, one of these images";
  double before = 0, after = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    before += r.problem.poses[i].Minus(truth[i]).squaredNorm();
    after += r.problem.poses[i]
                 .Plus(shifts.col(5).segment<6>(6 * static_cast<Eigen::Index>(i)))
                 .Minus(truth[i])
                 .squaredNorm();
  }
  EXPECT_LT(after, 0.1 * before);
}

TEST(CheckLenses, AnotherLensIsNamed) {
  const auto check_of = [](std::vector<double> params, LensCheck* check) {
    Scene scene = MakeScene(1, {CameraModel::kRadtan, 640, 480, std::move(params)});
    scene.input.cameras[0].name = "cam7";
    *check = CheckLenses(scene.input, scene.reconstruction);
    return Contradiction(scene.input, *check).value_or("");
  };
  LensCheck check;
  EXPECT_THAT(check_of({515, 515, 324, 236, -0.1, 0.02, 0, 0}, &check), testing::HasSubstr("cam7: focal length about"));
  EXPECT_NEAR(check.errors[0].focal, 500.0 / 515 - 1, 0.005);
  EXPECT_THAT(check_of({500, 500, 344, 236, -0.1, 0.02, 0, 0}, &check), testing::HasSubstr("principal point -"));
  EXPECT_NEAR(check.errors[0].centre_px.x(), -20, 2);
  EXPECT_NE(check_of({500, 500, 324, 236, -0.3, 0.09, 0, 0}, &check), "");
}

}  // namespace
}  // namespace trigpoint
