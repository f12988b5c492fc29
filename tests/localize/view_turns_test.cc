// Panoramas whose views are turned against each other: found, better placed, and with sigmas that hold.
#include "localize/references/view_turns.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "calib/camera/camera.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kPixel_px = 1, kStep_m = 0.01, kTurn_rad = 0.001;

Camera OneCamera() { return Camera(CameraModel::kPinhole, 1000, 800, {500, 500, 499.5, 399.5}); }

Vector6d Normal6(double rotation, double translation, Random* random) {
  Vector6d v;
  for (int k = 0; k < 6; ++k) v(k) = (k < 3 ? rotation : translation) * random->Normal();
  return v;
}

// A street: a body with cameras to both sides drives 20 m between two fronts, past panoramas of eight views, each of
// which is turned by itself. Solved as the program does.
class Street {
 public:
  static constexpr int kBodies = 11, kPanoramas = 6, kViews = 8, kCorners = 300;

  Street(double turn_rad, Random* random) {
    for (int i = 0; i < kBodies; ++i)
      truth_.poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -2 * i));
    for (int i = 0; i < kPanoramas; ++i)
      truth_.poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(i % 2 ? 2 : -2, 0, -2 - 3.3 * i));
    for (int j = 0; j < kCorners; ++j) {
      truth_.points.emplace_back((j % 2 ? 1 : -1) * random->Uniform(7, 9), random->Uniform(-4, 2),
                                 random->Uniform(-15, 35));
    }
    for (const int side : {1, -1}) AddView(side * EIGEN_PI / 2, Vector6d::Zero());
    for (int i = 0; i < kPanoramas; ++i) {
      panoramas.push_back({kBodies + i, static_cast<int>(truth_.views.size()), kViews});
      for (int v = 0; v < kViews; ++v) AddView(v * EIGEN_PI / 4, Normal6(turn_rad, 0, random));
    }
    problem.poses = truth_.poses, problem.points = truth_.points;
    for (int j = 0; j < kCorners; ++j) {
      for (int i = 0; i < kBodies; ++i) See(j, i, 0, 2, random);
      for (const RigViews& one : panoramas) See(j, one.pose, one.first_view, kViews, random);
    }
    for (int i = 0; i + 1 < kBodies; ++i) {
      PoseFactor f;
      f.a = i, f.b = i + 1;
      f.kind = PoseFactor::Kind::kBetween;
      f.measured = Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 2}).Plus(Normal6(kTurn_rad, kStep_m, random));
      f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / kTurn_rad), Eigen::Vector3d::Constant(1 / kStep_m);
      problem.factors.push_back(f);
    }
    problem.pose_constant.assign(problem.poses.size(), false);
    problem.pose_constant.front() = true;
    problem.loss = MakeLoss("dcs", 12.0);
    Solve();
  }
  void Solve() {
    ProgressSink silent;
    BundleOptions options;
    options.relative_cost_tolerance = 1e-5;
    SolveBundle(problem, options, silent, {});
  }
  std::optional<double> Sigma() const { return FindViewTurns(panoramas, problem, 1, {}); }

  // Of the panoramas' tangents [rotation, position], from the given one on, a mean over their number.
  double MeanNees(int from) const {
    const BundleCovariance covariance(problem, 1, {});
    double sum = 0;
    for (const RigViews& one : panoramas) {
      const Eigen::VectorXd e = Error(one.pose).tail(6 - from);
      const Eigen::MatrixXd c = covariance.Joint({one.pose}).bottomRightCorner(6 - from, 6 - from);
      sum += e.dot(c.ldlt().solve(e)) / static_cast<double>(e.size() * kPanoramas);
    }
    return sum;
  }
  double SquaredPlaceErrors() const {
    double sum = 0;
    for (const RigViews& one : panoramas) sum += Error(one.pose).tail<3>().squaredNorm();
    return sum;
  }

  BundleProblem problem;
  std::vector<RigViews> panoramas;

 private:
  void AddView(double heading_rad, const Vector6d& error) {
    const Rigid3d given(Eigen::Quaterniond(Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitY())),
                        Eigen::Vector3d::Zero());
    problem.views.push_back(given.Inverse());
    truth_.views.push_back(given.Plus(error).Inverse());
  }
  void See(int j, int pose, int first, int views, Random* random) {
    const Camera camera = OneCamera();
    for (int v = first; v < first + views; ++v) {
      const Rigid3d view_from_world = truth_.views[static_cast<size_t>(v)] * truth_.poses[static_cast<size_t>(pose)];
      const auto exact = camera.Project(view_from_world * truth_.points[static_cast<size_t>(j)]);
      if (!exact || !camera.Contains(*exact)) continue;
      const Eigen::Vector2d pixel = *exact + kPixel_px * Eigen::Vector2d(random->Normal(), random->Normal());
      BearingObservation o;
      o.point = j, o.pose = pose, o.view = v;
      o.ray = camera.Unproject(pixel)->cast<float>();
      o.w = camera.BearingSqrtInfo(pixel, kPixel_px).cast<float>();
      problem.observations.push_back(o);
    }
  }
  Vector6d Error(int i) const {
    return problem.poses[static_cast<size_t>(i)].Minus(truth_.poses[static_cast<size_t>(i)]);
  }

  BundleProblem truth_;
};

TEST(ViewTurns, PanoramasWithTurnedViewsAreBetterPlacedWithSigmasThatHold) {
  constexpr double kTurned_rad = 0.004;  // two pixels, two sigmas of a point
  constexpr int kDraws = 20;
  Random random(14);
  double before = 0, after = 0, nees_before = 0, nees = 0, nees_of_places = 0, found = 0, sigmas = 0;
  for (int k = 0; k < kDraws; ++k) {
    Street street(kTurned_rad, &random);
    nees_before += street.MeanNees(3) / kDraws;
    before += street.SquaredPlaceErrors();
    const auto sigma = street.Sigma();
    ASSERT_TRUE(sigma);
    found += *sigma / kDraws;
    const std::vector<TurnedView> views = FreeViews(street.panoramas, *sigma, &street.problem);
    EXPECT_EQ(views.size(), Street::kPanoramas * Street::kViews);
    double last = *sigma;
    for (int round = 0; round < 3; ++round) {
      street.Solve();
      last = UpdateTurns(views, 1, {}, &street.problem).sigma_rad;
    }
    street.Solve();
    sigmas += last / kDraws;
    after += street.SquaredPlaceErrors();
    nees += street.MeanNees(0) / kDraws;
    nees_of_places += street.MeanNees(3) / kDraws;
  }
  // 48 views and 3 axes show their sigma to a tenth in each draw; the kernel takes the largest for outliers.
  EXPECT_NEAR(found, kTurned_rad, 0.2 * kTurned_rad);
  EXPECT_NEAR(sigmas, kTurned_rad, 0.1 * kTurned_rad);
  EXPECT_LT(after, 0.8 * before);
  EXPECT_GT(nees_before, 2);
  // The panoramas of one draw share errors: at least 20 draws of 6, or 3, degrees of freedom; 99.9 %.
  EXPECT_GT(nees, 0.63);
  EXPECT_LT(nees, 1.48);
  EXPECT_GT(nees_of_places, 0.5);
  EXPECT_LT(nees_of_places, 1.7);
}

TEST(ViewTurns, ViewsThatAreNotTurnedAreFoundSo) {
  Random random(15);
  int turned = 0;
  for (int k = 0; k < 20; ++k) turned += Street(0, &random).Sigma() ? 1 : 0;
  // One in twenty by chance; more than 4 of 20 once in 390.
  EXPECT_LE(turned, 4);
}

TEST(ViewTurns, NoPanoramaShowsNothing) {
  Random random(16);
  Street street(0.004, &random);
  street.panoramas.clear();
  EXPECT_FALSE(street.Sigma());
}

}  // namespace
}  // namespace trigpoint
