// Photos and rigs that are not known exactly: where they are placed, and how well, over redraws of their errors.
#include "localize/references/view_errors.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr int kImages = 8, kPoints = 150, kRedraws = 100;
constexpr double kPixel_px = 1, kStep_m = 0.01, kTurn_rad = 0.001;
constexpr double kFocal_px = 500;

Camera CameraOf(double focal_px) {
  return Camera(CameraModel::kPinhole, 1000, 800, {focal_px, focal_px, 499.5, 399.5});
}

Vector6d Normal6(double rotation, double translation, Random* random) {
  Vector6d v;
  for (int k = 0; k < 6; ++k) v(k) = (k < 3 ? rotation : translation) * random->Normal();
  return v;
}

// Eight images in a row, 1 m apart, that look at points 6 to 14 m before them, with odometry. The last pose is the
// reference's, 1 m behind their row.
struct Scene {
  BundleProblem truth;
  Scene() {
    Random random(5);
    for (int i = 0; i < kImages; ++i)
      truth.poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-i, 0, 0));
    truth.poses.push_back(Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.3, 1, 0.2).normalized())),
                                  Eigen::Vector3d(3, 0.3, -1))
                              .Inverse());
    for (int j = 0; j < kPoints; ++j) {
      truth.points.emplace_back(random.Uniform(-5, 12), random.Uniform(-3, 3), random.Uniform(6, 14));
    }
  }
};

// Point j in a view, if it is seen there: the pixel that the true camera and view show, as the assumed camera has it.
void See(const BundleProblem& truth, int j, int pose, int view, const Camera& shown, Random* random, BundleProblem* p) {
  const Camera assumed = CameraOf(kFocal_px);
  const Rigid3d view_from_world = truth.views[static_cast<size_t>(view)] * truth.poses[static_cast<size_t>(pose)];
  const auto exact = shown.Project(view_from_world * truth.points[static_cast<size_t>(j)]);
  if (!exact || !shown.Contains(*exact)) return;
  const Eigen::Vector2d pixel = *exact + kPixel_px * Eigen::Vector2d(random->Normal(), random->Normal());
  BearingObservation o;
  o.point = j, o.pose = pose, o.view = view;
  o.ray = assumed.Unproject(pixel)->cast<float>();
  o.w = assumed.BearingSqrtInfo(pixel, kPixel_px).cast<float>();
  p->observations.push_back(o);
}

// Normalised squared errors of the reference's pose, with what its views leave open and without, and the number of
// columns that this takes.
struct Nees {
  double with = 0, without = 0;
  Eigen::Index columns = 0;
};

// One redraw of all noise, solved. `truth` has the views as they are, `errors` of those of `views`, which are assumed;
// the first of them is that of the images. `shown`: the reference's camera as it is.
Nees Redraw(BundleProblem truth, const std::vector<Rigid3d>& views, const Camera& shown, const ViewErrors& errors,
            Random* random) {
  BundleProblem p = truth;
  p.views = views;
  for (int j = 0; j < kPoints; ++j) {
    for (int i = 0; i < kImages; ++i) See(truth, j, i, 0, CameraOf(kFocal_px), random, &p);
    for (int v = 1; v < static_cast<int>(views.size()); ++v) See(truth, j, kImages, v, shown, random, &p);
  }
  for (int i = 0; i + 1 < kImages; ++i) {
    PoseFactor f;
    f.kind = PoseFactor::Kind::kBetween;
    f.a = i, f.b = i + 1;
    f.measured = (truth.poses[static_cast<size_t>(i)] * truth.poses[static_cast<size_t>(i) + 1].Inverse())
                     .Plus(Normal6(kTurn_rad, kStep_m, random));
    f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / kTurn_rad), Eigen::Vector3d::Constant(1 / kStep_m);
    p.factors.push_back(f);
  }
  p.pose_constant.assign(kImages + 1, false);
  p.pose_constant.front() = true;
  ProgressSink silent;
  const CancelToken cancel;
  BundleOptions options;
  options.distance_tolerance = 1e-10;
  SolveBundle(p, options, silent, cancel);
  const Vector6d e = p.poses.back().Minus(truth.poses.back());
  const auto nees = [&] {
    const Eigen::MatrixXd c = BundleCovariance(p, 1, cancel).Joint({kImages});
    return e.dot(c.ldlt().solve(e)) / 6;
  };
  Nees out;
  out.without = nees();
  p.pose_shifts = PoseShiftsByViews({{kImages, 1, kFocal_px, errors}}, p, 1, cancel);
  out.columns = p.pose_shifts.cols();
  out.with = nees();
  return out;
}

// Mean over redraws; chi-square with 600 degrees of freedom has a 99.9 % band of 0.82 to 1.20.
void ExpectRight(const Nees& sum) {
  EXPECT_GT(sum.with / kRedraws, 0.82);
  EXPECT_LT(sum.with / kRedraws, 1.2);
  EXPECT_GT(sum.without / kRedraws, 3);
}

TEST(PoseShiftsByViews, APhotosPlaceIsAsGoodAsItsFocalLengthAllows) {
  constexpr double kShare = 0.02;
  Random random(11);
  Scene scene;
  scene.truth.views = {Rigid3d(), Rigid3d()};
  ViewErrors errors;
  errors.focal_share = kShare;
  Nees sum;
  for (int k = 0; k < kRedraws; ++k) {
    const Camera shown = CameraOf(kFocal_px / (1 + kShare * random.Normal()));
    const Nees one = Redraw(scene.truth, scene.truth.views, shown, errors, &random);
    sum.with += one.with, sum.without += one.without;
    EXPECT_EQ(one.columns, 1);
  }
  ExpectRight(sum);
}

// A ring of photos that look outwards. Those that look at the points are all before its middle: a ring that is assumed
// too large is placed too far back.
TEST(PoseShiftsByViews, ARigsPlaceIsAsGoodAsItsShapeAndSizeAllow) {
  constexpr int kPhotos = 8;
  constexpr double kRadius_m = 0.3, kSize = 0.2, kPhotoTurn_rad = 0.001, kPhotoPlace_m = 0.004;
  std::vector<Rigid3d> rig_from_view;
  ViewErrors errors;
  errors.poses = Eigen::MatrixXd::Zero(6 * kPhotos, 6 * kPhotos);
  Eigen::VectorXd by_size = Eigen::VectorXd::Zero(6 * kPhotos);
  for (int v = 0; v < kPhotos; ++v) {
    const double a = 2 * EIGEN_PI * v / kPhotos;
    rig_from_view.emplace_back(Eigen::Quaterniond(Eigen::AngleAxisd(a, Eigen::Vector3d::UnitY())),
                               kRadius_m * Eigen::Vector3d(std::sin(a), 0, std::cos(a)));
    by_size.segment<3>(6 * v + 3) = kSize * rig_from_view.back().translation;
    errors.poses.diagonal().segment<3>(6 * v).setConstant(kPhotoTurn_rad * kPhotoTurn_rad);
    errors.poses.diagonal().segment<3>(6 * v + 3).setConstant(kPhotoPlace_m * kPhotoPlace_m);
  }
  errors.poses += by_size * by_size.transpose();
  Random random(12);
  Scene scene;
  Nees sum;
  Eigen::Index columns = 0;
  for (int k = 0; k < kRedraws; ++k) {
    std::vector<Rigid3d> assumed = {Rigid3d()};
    scene.truth.views = assumed;
    const double size = random.Normal();
    for (int v = 0; v < kPhotos; ++v) {
      const Rigid3d& held = rig_from_view[static_cast<size_t>(v)];
      const Vector6d error = size * by_size.segment<6>(6 * v) + Normal6(kPhotoTurn_rad, kPhotoPlace_m, &random);
      assumed.push_back(held.Inverse());
      scene.truth.views.push_back(held.Plus(-error).Inverse());
    }
    const Nees one = Redraw(scene.truth, assumed, CameraOf(kFocal_px), errors, &random);
    sum.with += one.with, sum.without += one.without;
    columns = std::max(columns, one.columns);
  }
  ExpectRight(sum);
  EXPECT_GT(columns, 1);
  EXPECT_LT(columns, 6 * kPhotos);  // photos that see no point move nothing
}

TEST(PoseShiftsByViews, ExactViewsMoveNothing) {
  Scene scene;
  scene.truth.views = {Rigid3d(), Rigid3d()};
  EXPECT_EQ(PoseShiftsByViews({{kImages, 1, kFocal_px, {}}}, scene.truth, 1, {}).size(), 0);
}

// Photos of one focal length err alike, and the others independently.
TEST(PoseShiftsByViews, PhotosOfOneFocalLengthShareItsError) {
  Random random(13);
  Scene scene;
  BundleProblem p = scene.truth;
  p.views.assign(4, Rigid3d());
  p.poses.insert(p.poses.end(), 2, p.poses.back());
  scene.truth = p;
  for (int j = 0; j < kPoints; ++j) {
    for (int v = 1; v <= 3; ++v) {
      See(scene.truth, j, kImages + v - 1, v, CameraOf(kFocal_px), &random, &p);
    }
  }
  p.points_constant = true;
  p.pose_constant.assign(p.poses.size(), true);
  std::fill(p.pose_constant.begin() + kImages, p.pose_constant.end(), false);
  ViewErrors errors;
  errors.focal_share = 0.05;
  const Eigen::MatrixXd shifts = PoseShiftsByViews(
      {{kImages, 1, 500, errors}, {kImages + 1, 2, 500, errors}, {kImages + 2, 3, 700, errors}}, p, 1, {});
  ASSERT_EQ(shifts.cols(), 2);
  const auto depth = [&](int photo, int column) { return std::abs(shifts(6 * (kImages + photo) + 5, column)); };
  // 5 % of distances of 10 m
  EXPECT_NEAR(depth(0, 0), 0.5, 0.15);
  EXPECT_NEAR(depth(1, 0), depth(0, 0), 0.05);
  EXPECT_EQ(depth(2, 0), 0);
  EXPECT_EQ(depth(0, 1), 0);
  EXPECT_NEAR(depth(2, 1), depth(0, 0), 0.05);
}

}  // namespace
}  // namespace trigpoint
