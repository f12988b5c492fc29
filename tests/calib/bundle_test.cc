// The bundle adjustment: recovers truth, states a covariance that redraws of the noise confirm, follows the gauge.
#include "calib/estimation/bundle.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "calib/camera/camera.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

struct Scene {
  BundleProblem truth;
  Camera camera = Camera::FromFieldOfView(800, 600, 1.5);
};

// Twelve poses along a line, sixty points abreast, odometry between the poses.
Scene MakeScene() {
  Scene s;
  Random random(3);
  s.truth.views = {Rigid3d()};
  for (int i = 0; i < 12; ++i) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.02 * i, Eigen::Vector3d::UnitY()));
    s.truth.poses.push_back({turn, -(turn * Eigen::Vector3d(0.5 * i, 0, 0.1 * i))});
  }
  s.truth.pose_constant.assign(12, false);
  s.truth.pose_constant[0] = true;
  for (int j = 0; j < 60; ++j) {
    s.truth.points.emplace_back(random.Uniform(-4, 9), random.Uniform(-3, 3), random.Uniform(6, 20));
    for (int i = 0; i < 12; ++i) {
      const auto pixel = s.camera.Project(s.truth.poses[static_cast<size_t>(i)] * s.truth.points.back());
      if (!pixel || !s.camera.Contains(*pixel)) continue;
      BearingObservation o;
      o.point = j;
      o.pose = i;
      o.w.setZero();
      o.ray.setZero();
      s.truth.observations.push_back(o);
    }
  }
  return s;
}

constexpr double kSigmaPx = 0.5, kSigmaRotation = 0.002, kSigmaTranslation = 0.01;

// A redraw of all noise; noise 0: exact observations from a start that is off.
BundleProblem Redraw(const Scene& s, uint64_t seed, double noise) {
  BundleProblem p = s.truth;
  Random random(seed);
  const auto normal3 = [&](double sigma) {
    return Eigen::Vector3d(sigma * random.Normal(), sigma * random.Normal(), sigma * random.Normal());
  };
  for (BearingObservation& o : p.observations) {
    const Eigen::Vector3d in_cam = p.poses[static_cast<size_t>(o.pose)] * p.points[static_cast<size_t>(o.point)];
    const Eigen::Vector2d pixel =
        *s.camera.Project(in_cam) + noise * kSigmaPx * Eigen::Vector2d(random.Normal(), random.Normal());
    o.ray = s.camera.Unproject(pixel)->cast<float>();
    o.w = s.camera.BearingSqrtInfo(pixel, kSigmaPx).cast<float>();
  }
  for (int i = 0; i + 1 < 12; ++i) {
    PoseFactor f;
    f.kind = PoseFactor::Kind::kBetween;
    f.a = i, f.b = i + 1;
    const Rigid3d exact = p.poses[static_cast<size_t>(i)] * p.poses[static_cast<size_t>(i + 1)].Inverse();
    Vector6d error;
    error << normal3(noise * kSigmaRotation), normal3(noise * kSigmaTranslation);
    f.measured = exact.Plus(error);
    f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / kSigmaRotation),
        Eigen::Vector3d::Constant(1 / kSigmaTranslation);
    p.factors.push_back(f);
  }
  for (size_t i = 1; i < p.poses.size(); ++i) {
    Vector6d off;
    off << normal3(0.01), normal3(0.05);
    p.poses[i] = p.poses[i].Plus(off);
  }
  for (Eigen::Vector3d& y : p.points) y += normal3(0.3);
  return p;
}

TEST(Bundle, RecoversTruthFromAPoorStart) {
  const Scene scene = MakeScene();
  BundleProblem p = Redraw(scene, 1, 0);
  ProgressSink progress;
  const CancelToken cancel;
  BundleOptions options;
  options.max_iterations = 50;
  options.distance_tolerance = 1e-12;
  const BundleSummary summary = SolveBundle(p, options, progress, cancel);
  EXPECT_LT(summary.final_cost, 1e-4);  // observations are kept in single precision
  for (size_t i = 0; i < p.poses.size(); ++i) {
    EXPECT_LT(p.poses[i].Minus(scene.truth.poses[i]).norm(), 1e-4) << i;
  }
}

TEST(Bundle, ThreadsDoNotChangeTheAnswer) {
  const Scene scene = MakeScene();
  ProgressSink progress;
  const CancelToken cancel;
  BundleProblem a = Redraw(scene, 5, 1), b = a;
  BundleOptions one, many;
  one.threads = 1;
  many.threads = 4;
  SolveBundle(a, one, progress, cancel);
  SolveBundle(b, many, progress, cancel);
  for (size_t i = 0; i < a.poses.size(); ++i) EXPECT_EQ(a.poses[i].Minus(b.poses[i]).norm(), 0) << i;
}

// A drive of 600 m past points on both sides, each seen from up to four poses in turn. Observations have a noise of
// kSigmaPx; odometry is exact, with a stated noise of 0.05 deg and 1 cm a step. The start is bent into an arc of 30
// deg, as a heading that drifts bends it, and the points stand where these poses see them.
BundleProblem BentDrive(const Camera& camera, std::vector<Rigid3d>* truth) {
  constexpr int kPoses = 300, kPointsAStep = 8;
  constexpr double kStep_m = 2, kBend_rad = EIGEN_PI / 6 / kPoses;
  BundleProblem p;
  Random random(11);
  p.views = {Rigid3d()};
  Rigid3d bent;
  for (int i = 0; i < kPoses; ++i) {
    truth->push_back({Eigen::Quaterniond::Identity(), {0, 0, -kStep_m * i}});
    if (i > 0) {
      const Rigid3d step = truth->back() * (*truth)[static_cast<size_t>(i) - 1].Inverse();
      bent = Rigid3d(ExpSO3({0, kBend_rad, 0}), Eigen::Vector3d::Zero()) * step * bent;
      PoseFactor f;
      f.kind = PoseFactor::Kind::kBetween;
      f.a = i - 1, f.b = i;
      f.measured = step.Inverse();
      f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / 9e-4), Eigen::Vector3d::Constant(1 / 0.01);
      p.factors.push_back(f);
    }
    p.poses.push_back(bent);
  }
  p.pose_constant.assign(kPoses, false);
  p.pose_constant[0] = true;
  for (int i = 0; i < kPoses; ++i) {
    for (int k = 0; k < kPointsAStep; ++k) {
      const Eigen::Vector3d y((k % 2 ? 1 : -1) * random.Uniform(3, 8), random.Uniform(-2, 2),
                              kStep_m * i + random.Uniform(9, 15));
      for (int at = std::max(0, i - 1); at < std::min(kPoses, i + 3); ++at) {
        const Eigen::Vector2d pixel = *camera.Project((*truth)[static_cast<size_t>(at)] * y) +
                                      kSigmaPx * Eigen::Vector2d(random.Normal(), random.Normal());
        BearingObservation o;
        o.point = static_cast<int>(p.points.size());
        o.pose = at;
        o.ray = camera.Unproject(pixel)->cast<float>();
        o.w = camera.BearingSqrtInfo(pixel, kSigmaPx).cast<float>();
        p.observations.push_back(o);
      }
      p.points.push_back(p.poses[static_cast<size_t>(i)].Inverse() * ((*truth)[static_cast<size_t>(i)] * y));
    }
  }
  return p;
}

// With points that move along tangents, 50 iterations do not straighten the drive: the chi-square of its end is 1234.
TEST(Bundle, ABentDriveIsStraightened) {
  const Camera camera = Camera::FromFieldOfView(800, 600, 1.5);
  std::vector<Rigid3d> truth;
  BundleProblem p = BentDrive(camera, &truth);
  p.loss = MakeLoss("dcs", 3);
  const double off_m = (p.poses.back().TargetOriginInSource() - truth.back().TargetOriginInSource()).norm();
  ASSERT_GT(off_m, 150);
  ProgressSink silent;
  const BundleSummary summary = SolveBundle(p, {}, silent, {});
  EXPECT_TRUE(summary.converged);
  const Matrix6d c = BundleCovariance(p, 1, {}).Joint({299});
  const Vector6d e = p.poses.back().Minus(truth.back());
  EXPECT_LT(e.dot(c.ldlt().solve(e)), 22.5);  // chi-square, 6 dof, 99.9 %
  BundleProblem tight = p;
  SolveBundle(tight, {.distance_tolerance = 1e-8}, silent, {});
  const Vector6d left = p.poses.back().Minus(tight.poses.back());
  EXPECT_LT(left.dot(c.ldlt().solve(left)), 0.1);  // of a squared sigma
}

// Mean NEES of the last pose over 200 redraws: chi-square with 1,200 dof gives a 99.9 % band of 0.87 to 1.14.
TEST(Bundle, CovarianceIsThatOfRedraws) {
  const Scene scene = MakeScene();
  ProgressSink progress;
  const CancelToken cancel;
  double sum = 0;
  constexpr int kRedraws = 200;
  for (int k = 0; k < kRedraws; ++k) {
    BundleProblem p = Redraw(scene, 100 + static_cast<uint64_t>(k) * 7919, 1);
    SolveBundle(p, {}, progress, cancel);
    BundleCovariance covariance(p, 1, cancel);
    const Matrix6d c = covariance.Joint({11});
    std::vector<Matrix6d> diagonal, unused;
    std::move(covariance).PoseBlocks({}, &diagonal, &unused);
    // Selected inversion and plain solves agree.
    EXPECT_LT((diagonal[11] - c).norm(), 1e-9 * c.norm());
    const Vector6d e = p.poses[11].Minus(scene.truth.poses[11]);
    sum += e.dot(c.ldlt().solve(e)) / 6;
  }
  EXPECT_GT(sum / kRedraws, 0.87);
  EXPECT_LT(sum / kRedraws, 1.14);
}

TEST(Bundle, CovariancesContainTheErrorThatObservationsShare) {
  BundleProblem p = Redraw(MakeScene(), 3, 1);
  ProgressSink silent;
  const CancelToken cancel;
  SolveBundle(p, {}, silent, cancel);
  const std::vector<int> some = {2, 11};
  const Eigen::MatrixXd alone = BundleCovariance(p, 1, cancel).Joint(some);
  p.pose_shifts.resize(72, 2);
  for (Eigen::Index i = 0; i < 72; ++i) p.pose_shifts.row(i) << 0.01 * static_cast<double>(i), (i % 2 ? -0.02 : 0.01);
  Eigen::MatrixXd shifts(12, 2);
  shifts << p.pose_shifts.middleRows<6>(12), p.pose_shifts.middleRows<6>(66);
  const Eigen::MatrixXd expected = alone + shifts * shifts.transpose();
  BundleCovariance covariance(p, 1, cancel);
  EXPECT_TRUE(covariance.Joint(some).isApprox(expected, 1e-9));
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(72, 12);
  columns.middleRows<6>(12).leftCols<6>().setIdentity();
  columns.middleRows<6>(66).rightCols<6>().setIdentity();
  columns = covariance.Times(columns);
  EXPECT_TRUE((columns.middleRows<6>(12).isApprox(expected.topRows<6>(), 1e-9)));
  EXPECT_TRUE((columns.middleRows<6>(66).isApprox(expected.bottomRows<6>(), 1e-9)));
  std::vector<Matrix6d> diagonal, with_next;
  std::vector<int> next(12, -1);
  next[2] = 11;
  std::move(covariance).PoseBlocks(next, &diagonal, &with_next);
  EXPECT_TRUE((diagonal[11].isApprox(expected.bottomRightCorner<6, 6>(), 1e-9)));
  EXPECT_TRUE((with_next[2].isApprox(expected.topRightCorner<6, 6>(), 1e-9)));
}

}  // namespace
}  // namespace trigpoint
