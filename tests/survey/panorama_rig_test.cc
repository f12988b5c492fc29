// The rig itself: bundle adjustment against truth, refinement against known points, files.
#include <ceres/gradient_checker.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "calib/base/error.h"
#include "calib/geometry/so3.h"
#include "datasets/io/exif.h"
#include "datasets/io/image.h"
#include "datasets/io/panorama_writer.h"
#include "datasets/io/rig_file.h"
#include "localize/references/refine_rig.h"
#include "survey/panorama/rig_costs.h"
#include "survey/panorama/rig_files.h"
#include "survey/panorama/rig_report.h"
#include "tests/support/temp_dir.h"
#include "tests/survey/panorama_scene.h"

namespace trigpoint {
namespace {

constexpr int kWidth = 1600, kHeight = 1200;
constexpr double kFocal = 1300;

// 16 photos on a circle of `radius`, off it by a quarter; points on the ground 1.5 m below and on walls.
struct World {
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<Eigen::Vector3d> centres;
  std::vector<Eigen::Vector3d> points;
};

World MakeWorld(uint64_t seed, double radius, int points) {
  World w;
  Random random(seed);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int i = 0; i < 16; ++i) {
    const double h = 22.5 * i + random.Uniform(-2, 2);
    w.cam_from_world.push_back(CamFromWorld(h, random.Uniform(-2, 2) - 5, random.Uniform(-1.5, 1.5)));
    const Eigen::Vector3d out(std::sin(h * kDegToRad), 0, std::cos(h * kDegToRad));
    w.centres.push_back(radius * (out + 0.2 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal())));
    mean += w.centres.back() / 16;
  }
  for (Eigen::Vector3d& c : w.centres) c -= mean;
  while (static_cast<int>(w.points.size()) < points) {
    const double a = random.Uniform(-std::numbers::pi, std::numbers::pi), r = random.Uniform(3, 25);
    const bool ground = random.Uniform() < 0.3;
    w.points.emplace_back(r * std::sin(a), ground ? 1.5 : random.Uniform(-6, 1.4), r * std::cos(a));
  }
  return w;
}

bool See(const World& w, int photo, const Eigen::Vector3d& point, Eigen::Vector2d* pixel) {
  const size_t i = static_cast<size_t>(photo);
  const Eigen::Vector3d p = w.cam_from_world[i] * (point - w.centres[i]);
  if (p.z() < 0.3) return false;
  *pixel = kFocal * p.head<2>() / p.z() + Eigen::Vector2d(0.5 * (kWidth - 1), 0.5 * (kHeight - 1));
  return pixel->x() > 0 && pixel->y() > 0 && pixel->x() < kWidth - 1 && pixel->y() < kHeight - 1;
}

// Observations as a stitched rig has them, everything else at its start.
StitchedRig Observed(const World& w, double noise_px, uint64_t seed) {
  StitchedRig rig;
  Random random(seed);
  rig.features.resize(16);
  for (int i = 0; i < 16; ++i) {
    Photo photo;
    photo.name = std::string("p").append(std::to_string(i)).append(".jpg");
    photo.width = kWidth, photo.height = kHeight;
    rig.photos.push_back(photo);
    rig.reason.emplace_back();
    rig.views.push_back({kWidth, kHeight, nullptr});
    RigPhoto p;
    p.placed = true;
    const Eigen::Vector3d off(random.Normal(), random.Normal(), random.Normal());
    p.cam_from_rig = ExpSO3(0.01 * off) * w.cam_from_world[static_cast<size_t>(i)];
    rig.state.photos.push_back(p);
  }
  rig.placed = 16;
  rig.state.lenses = {{1.03 * kFocal, 0, 0}};
  rig.state.lens_priors = {{0, 0.1}};
  for (const Eigen::Vector3d& at : w.points) {
    RigPoint point;
    point.direction = at.normalized();
    for (int i = 0; i < 16; ++i) {
      Eigen::Vector2d pixel;
      if (!See(w, i, at, &pixel)) continue;
      point.observations.push_back({i, 0, pixel + noise_px * Eigen::Vector2d(random.Normal(), random.Normal())});
    }
    if (point.observations.size() >= 2) rig.state.points.push_back(point);
  }
  return rig;
}

TEST(RigObservationCost, DerivativesAreThoseOfItsResiduals) {
  PairView view{kWidth, kHeight, nullptr, std::nullopt};
  view.orientation = 6;
  const Eigen::Matrix2d sqrt_info = (Eigen::Matrix2d() << 1.5, 0.2, -0.1, 0.9).finished();
  Random random(7);
  for (const bool fisheye : {false, true}) {
    // On the axis, about it, at the edge, and for a fisheye behind.
    for (const double theta : {0.0, 0.4, 0.7, fisheye ? 1.7 : 0.8}) {
      const double azimuth = random.Uniform(0, 6);
      const Eigen::Vector3d in_cam(std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth),
                                   std::cos(theta));
      const Eigen::Quaterniond cam_from_rig = ExpSO3({0.3, -0.8, 0.1});
      const RigObservationCost cost(view, fisheye, cam_from_rig, cam_from_rig.conjugate() * in_cam, {400, 300},
                                    sqrt_info);
      const std::vector<std::vector<double>> blocks = {
          {0.01, -0.02, 0.005}, {0.1, -0.05, 0.12}, {kFocal, -0.04, 0.01, 0.002, -0.003}, {0.002, -0.001, 0.3}};
      std::vector<const double*> parameters;
      for (const auto& block : blocks) parameters.push_back(block.data());
      const std::vector<const ceres::Manifold*> none(4, nullptr);
      const ceres::GradientChecker checker(&cost, &none, ceres::NumericDiffOptions());
      ceres::GradientChecker::ProbeResults results;
      EXPECT_TRUE(checker.Probe(parameters.data(), 1e-5, &results)) << fisheye << theta << results.error_log;
      if (fisheye) continue;  // these have no decentring
      const double none_moved[3] = {0, 0, 0};
      const double* const start[] = {none_moved, none_moved, blocks[2].data(), none_moved};
      Eigen::Vector2d residual, pixel;
      ASSERT_TRUE(cost.Evaluate(start, residual.data(), nullptr));
      ASSERT_TRUE(PixelOfRay(view, {kFocal, -0.04, 0.01, false, 0.002, -0.003}, in_cam, &pixel));
      EXPECT_LT((residual - sqrt_info * (pixel - Eigen::Vector2d(400, 300))).norm(), 1e-8) << theta;
    }
  }
}

TEST(RigBundle, RecoversTurnsFocalLengthAndTheShapeOfTheRig) {
  const World w = MakeWorld(1, 0.12, 1500);
  StitchedRig rig = Observed(w, 0.4, 2);
  CancelToken cancel;
  RigBundleOptions o;
  o.sigma_px = 0.4;
  o.radius_m = 0.12;
  o.up = -Eigen::Vector3d::UnitY();
  SolveRig(rig.views, o, false, cancel, &rig.state);
  const double central = SolveRig(rig.views, o, false, cancel, &rig.state).rms_px;
  o.centres = true;
  for (RigPhoto& p : rig.state.photos) {
    const Eigen::Vector3d look = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    p.centre = 0.12 * Eigen::Vector3d(look.x(), 0, look.z()).normalized();
  }
  rig.bundle = SolveRig(rig.views, o, true, cancel, &rig.state);
  CentreRig(&rig);
  EXPECT_LT(rig.bundle.rms_px, 0.45);
  EXPECT_GT(central, 2);  // one centre for all does not explain the photos
  EXPECT_NEAR(rig.state.lenses[0].focal_px / kFocal, 1, 0.001);
  double scale_up = 0, scale_down = 0;
  const Eigen::Quaterniond align = w.cam_from_world[0].conjugate() * rig.state.photos[0].cam_from_rig;
  for (size_t i = 0; i < 16; ++i) {
    const Eigen::Quaterniond found = rig.state.photos[i].cam_from_rig * rig.state.photos[0].cam_from_rig.conjugate();
    const Eigen::Quaterniond right = w.cam_from_world[i] * w.cam_from_world[0].conjugate();
    EXPECT_LT(found.angularDistance(right) * kRadToDeg, 0.05);
    scale_up += w.centres[i].dot(align * rig.state.photos[i].centre);
    scale_down += rig.state.photos[i].centre.squaredNorm();
  }
  const double scale = scale_up / scale_down;
  for (size_t i = 0; i < 16; ++i) {
    EXPECT_LT((scale * (align * rig.state.photos[i].centre) - w.centres[i]).norm(), 0.01) << i;
  }
  // Photos alone do not tell the size: what is said about it must be the prior's.
  EXPECT_GT(rig.bundle.radius_log_sigma, 0.3);
  EXPECT_EQ(rig.bundle.shape_covariance.rows(), 96);
  const double shape = std::sqrt(rig.bundle.shape_covariance(9, 9)), whole = std::sqrt(rig.bundle.covariance(9, 9));
  EXPECT_LT(shape, 0.5 * whole);
}

// Over redraws of the noise the photos' turns and centres are as far off as the covariance of the shape says: in all
// directions but those of the frame (turn, place, size), which photos leave open.
TEST(RigBundle, ShapeIsAsGoodAsItsCovarianceSays) {
  constexpr int kDraws = 20;
  double nees = 0;
  CancelToken cancel;
  for (uint64_t draw = 0; draw < kDraws; ++draw) {
    const World w = MakeWorld(40 + draw, 0.12, 700);
    StitchedRig rig = Observed(w, 0.3, 70 + draw);
    RigBundleOptions o;
    o.sigma_px = 0.3;
    o.huber_px = 0;
    o.tukey_px = 1.4;
    o.radius_m = 0.12;
    o.centres = true;
    o.max_iterations = 60;
    o.up = -Eigen::Vector3d::UnitY();
    for (size_t i = 0; i < 16; ++i) {
      rig.state.photos[i].cam_from_rig = w.cam_from_world[i];
      rig.state.photos[i].centre = w.centres[i];
    }
    rig.state.lenses[0].focal_px = kFocal;
    for (size_t j = 0, k = 0; j < w.points.size() && k < rig.state.points.size(); ++j) {
      if (rig.state.points[k].direction.dot(w.points[j].normalized()) < 1 - 1e-12) continue;
      rig.state.points[k++].inverse_distance = 1 / w.points[j].norm();
    }
    rig.bundle = SolveRig(rig.views, o, true, cancel, &rig.state);
    CentreRig(&rig);
    // Centres in units of a decimetre, about as far as turns are off in rad.
    constexpr double kUnit = 0.1;
    Eigen::VectorXd error(96), unit = Eigen::VectorXd::Ones(96);
    Eigen::MatrixXd frame = Eigen::MatrixXd::Zero(96, 7);
    for (int i = 0; i < 16; ++i) {
      const RigPhoto& p = rig.state.photos[static_cast<size_t>(i)];
      error.segment<3>(6 * i) = LogSO3(p.cam_from_rig * w.cam_from_world[static_cast<size_t>(i)].conjugate());
      error.segment<3>(6 * i + 3) = p.centre - w.centres[static_cast<size_t>(i)];
      unit.segment<3>(6 * i + 3).setConstant(1 / kUnit);
      frame.block<3, 3>(6 * i, 0) = -p.cam_from_rig.toRotationMatrix();
      frame.block<3, 3>(6 * i + 3, 0) = -Skew(p.centre) / kUnit;
      frame.block<3, 3>(6 * i + 3, 3).setIdentity();
      frame.block<3, 1>(6 * i + 3, 6) = p.centre / kUnit;
    }
    const Eigen::MatrixXd keep =
        Eigen::MatrixXd::Identity(96, 96) - frame * (frame.transpose() * frame).ldlt().solve(frame.transpose());
    const Eigen::MatrixXd whole = unit.asDiagonal() * rig.bundle.shape_covariance * unit.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(keep * whole * keep.transpose());
    const Eigen::VectorXd along = eigen.eigenvectors().transpose() * (keep * unit.asDiagonal() * error);
    nees += (along.tail(89).array().square() / eigen.eigenvalues().tail(89).array()).mean() / kDraws;
    EXPECT_LT(rig.bundle.shared_errors, 1.3);
  }
  // 1780 degrees of freedom: 0.89 to 1.11 in 99.9 % of cases; where the sandwich finds nothing it takes nothing away.
  EXPECT_GT(nees, 0.85);
  EXPECT_LT(nees, 1.15);
}

TEST(RigBundle, MovingTheOriginChangesNoPixel) {
  const World w = MakeWorld(3, 0.2, 50);
  StitchedRig rig = Observed(w, 0, 2);
  for (size_t i = 0; i < 16; ++i) rig.state.photos[i].centre = w.centres[i];
  for (RigPoint& p : rig.state.points) p.inverse_distance = 0.2;
  Eigen::Vector2d before, after;
  ASSERT_TRUE(
      ProjectRigPoint(rig.views, rig.state, rig.state.points[0], rig.state.points[0].observations[0].photo, &before));
  MoveRigOrigin({0.1, -0.05, 0.07}, &rig.state);
  TurnRig(CamFromWorld(30, 10, 5), &rig.state);
  ASSERT_TRUE(
      ProjectRigPoint(rig.views, rig.state, rig.state.points[0], rig.state.points[0].observations[0].photo, &after));
  EXPECT_LT((before - after).norm(), 1e-9);
}

// Photo i of the world as a view, without distortion.
View ViewOf(const World& w, int i) {
  View v;
  v.name = std::to_string(i);
  v.camera = Camera(CameraModel::kPinhole, kWidth, kHeight, {kFocal, kFocal, 0.5 * (kWidth - 1), 0.5 * (kHeight - 1)});
  v.rig_from_view = {w.cam_from_world[static_cast<size_t>(i)].conjugate(), w.centres[static_cast<size_t>(i)]};
  return v;
}

// A rig of half the right size, seeing known points on one side only, as beside a run: what a central treatment makes
// of it, and what refinement does.
TEST(RefineRig, CentreIsAtMostHalfAsFarOffAsWithOneCentre) {
  double central2 = 0, refined2 = 0, places2 = 0;
  int needless = 0;
  for (uint64_t redraw = 0; redraw < 10; ++redraw) {
    const World w = MakeWorld(100 + redraw, 0.12, 600);
    Random random(redraw);
    RefineRigInput in;
    in.shape_covariance = Eigen::MatrixXd::Zero(96, 96);
    for (int i = 0; i < 16; ++i) {
      View v = ViewOf(w, i);
      const Eigen::Vector3d off(random.Normal(), random.Normal(), random.Normal());
      v.rig_from_view.translation = 0.5 * v.rig_from_view.translation + 0.004 * off;
      in.rig.views.push_back(v);
      in.shape_covariance.block<3, 3>(6 * i + 3, 6 * i + 3) = Eigen::Matrix3d::Identity() * 0.004 * 0.004;
      in.shape_covariance.block<3, 3>(6 * i, 6 * i) = Eigen::Matrix3d::Identity() * 3e-4 * 3e-4;
    }
    const Rigid3d rig_from_world(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY())), {3, 1, -2});
    for (const Eigen::Vector3d& at : w.points) {
      if (at.z() < 0) continue;
      for (int i = 0; i < 16; ++i) {
        Eigen::Vector2d pixel;
        if (!See(w, i, at, &pixel)) continue;
        const Eigen::Vector3d noise(random.Normal(), random.Normal(), random.Normal());
        in.points.push_back({i, pixel + 0.7 * Eigen::Vector2d(random.Normal(), random.Normal()),
                             rig_from_world.Inverse() * (at + 0.02 * noise)});
      }
    }
    in.rig_from_world = rig_from_world.Plus(0.02 * Vector6d::Ones());
    RefineRigInput one_centre = in;
    for (View& v : one_centre.rig.views) v.rig_from_view.translation.setZero();
    const Eigen::Vector3d truth = rig_from_world.TargetOriginInSource();
    const RefinedRig central = RefineRig(one_centre, RigFreedom::kFixed);
    const RefinedRig refined = RefineRig(in, RigFreedom::kPrior);
    central2 += (central.rig_from_world.TargetOriginInSource() - truth).squaredNorm();
    refined2 += (refined.rig_from_world.TargetOriginInSource() - truth).squaredNorm();
    EXPECT_NEAR(refined.scale, 2, 0.15);
    for (size_t i = 0; i < 16; ++i) {
      places2 += (refined.rig.views[i].rig_from_view.translation - w.centres[i]).squaredNorm() / 16;
    }
    // Photos that stand where the rig says need no freedom: what chance gains with it is not taken for one.
    RefineRigInput exact = in;
    for (int i = 0; i < 16; ++i) exact.rig.views[static_cast<size_t>(i)] = ViewOf(w, i);
    const RigFreedom chosen = ChooseFreedom(exact, nullptr);
    needless += chosen == RigFreedom::kPrior || chosen == RigFreedom::kFree ? 1 : 0;
    if (redraw == 0) {
      std::vector<double> errors;
      EXPECT_NE(ChooseFreedom(in, &errors), RigFreedom::kFixed);
      ASSERT_EQ(errors.size(), 4U);
      EXPECT_LT(errors[2], errors[0]);
    }
  }
  RecordProperty("central_rms_m", std::to_string(std::sqrt(central2 / 10)));
  RecordProperty("refined_rms_m", std::to_string(std::sqrt(refined2 / 10)));
  EXPECT_LT(std::sqrt(refined2), 0.5 * std::sqrt(central2));
  EXPECT_LT(std::sqrt(places2 / 10), 0.03);
  EXPECT_LE(needless, 1);  // of ten
}

// A point as a run that passes 4 m beside knows it: off by `about` m in every direction and `along` m along its ray.
KnownPoint KnownFromRun(const Eigen::Vector3d& at, double about, double along, Random* random) {
  const Eigen::Vector3d ray = (at - Eigen::Vector3d(4, 0, -1)).normalized();
  const Eigen::Vector3d noise(random->Normal(), random->Normal(), random->Normal());
  return {0, Eigen::Vector2d::Zero(), at + about * noise + along * random->Normal() * ray,
          about * about * Eigen::Matrix3d::Identity() + along * along * ray * ray.transpose()};
}

// Half of the points are known badly along the rays of a run that passes 4 m beside: told so, the rig's pose is better
// and as good as it says.
TEST(RefineRig, PointsThatAreUncertainInDepthCountForLess) {
  double blind2 = 0, told2 = 0, nees = 0;
  constexpr int kRedraws = 20;
  for (uint64_t redraw = 0; redraw < kRedraws; ++redraw) {
    const World w = MakeWorld(300 + redraw, 0.12, 300);
    Random random(redraw);
    RefineRigInput in;
    in.shape_covariance = Eigen::MatrixXd::Zero(96, 96);
    for (int i = 0; i < 16; ++i) in.rig.views.push_back(ViewOf(w, i));
    for (size_t k = 0; k < w.points.size(); ++k) {
      const KnownPoint known = KnownFromRun(w.points[k], 0.005, k % 2 == 0 ? 0.3 : 0.005, &random);
      for (int i = 0; i < 16; ++i) {
        Eigen::Vector2d pixel;
        if (!See(w, i, w.points[k], &pixel)) continue;
        pixel += 0.7 * Eigen::Vector2d(random.Normal(), random.Normal());
        in.points.push_back({i, pixel, known.point, known.covariance});
        break;  // a point is seen by one photo: its error is counted once
      }
    }
    in.sigma_px = 0.7;
    in.rig_from_world = Rigid3d().Plus(0.01 * Vector6d::Ones());
    const RefinedRig told = RefineRig(in, RigFreedom::kFixed);
    for (KnownPoint& p : in.points) p.covariance.setZero();
    const RefinedRig blind = RefineRig(in, RigFreedom::kFixed);
    blind2 += blind.rig_from_world.TargetOriginInSource().squaredNorm();
    told2 += told.rig_from_world.TargetOriginInSource().squaredNorm();
    Vector6d error;
    error << told.rig_from_world.rotation.vec() * 2, told.rig_from_world.translation;
    nees += error.dot(told.covariance.ldlt().solve(error)) / (6 * kRedraws);
  }
  EXPECT_LT(told2, 0.7 * blind2);  // the robust loss alone takes some of it
  EXPECT_GT(nees, 0.6);
  EXPECT_LT(nees, 1.5);
}

// Points that a run saw from afar, known to 0.3 m along its rays, are off for all photos alike: what is between the
// photos shows the size, and it is as good as it says.
TEST(RefineRig, ParallaxShowsTheSizeThoughPointsAreUncertain) {
  double square = 0, nees = 0;
  constexpr int kRedraws = 20;
  for (uint64_t redraw = 0; redraw < kRedraws; ++redraw) {
    const World w = MakeWorld(500 + redraw, 0.12, 300);
    Random random(redraw);
    RefineRigInput in;
    in.shape_covariance = Eigen::MatrixXd::Zero(96, 96);
    for (int i = 0; i < 16; ++i) {
      in.rig.views.push_back(ViewOf(w, i));
      in.rig.views.back().rig_from_view.translation *= 1.5;
    }
    for (const Eigen::Vector3d& at : w.points) {
      const KnownPoint known = KnownFromRun(at, 0.03, 0.3, &random);
      for (int i = 0; i < 16; ++i) {
        Eigen::Vector2d pixel;
        if (!See(w, i, at, &pixel)) continue;
        pixel += 0.7 * Eigen::Vector2d(random.Normal(), random.Normal());
        in.points.push_back({i, pixel, known.point, known.covariance});
      }
    }
    in.sigma_px = 0.7;
    in.rig_from_world = Rigid3d().Plus(0.01 * Vector6d::Ones());
    const RefinedRig refined = RefineRig(in, RigFreedom::kScaled);
    const double off = refined.scale * 1.5 - 1;
    square += off * off / kRedraws;
    nees += std::pow(off / (1.5 * refined.scale_sigma), 2) / kRedraws;
  }
  EXPECT_LT(std::sqrt(square), 0.02);
  // Chi-square with 20 dof: 0.35 to 2.1 in 99.8 % of cases.
  EXPECT_GT(nees, 0.35);
  EXPECT_LT(nees, 2.1);
}

// A rig whose stitched centres are far off, all alike and each by itself: where its mean is shows as well as it says,
// although the photos' common shift and the rig's pose cannot be told apart.
TEST(RefineRig, AFreeRigIsAsGoodAboutItsOriginAsItSays) {
  constexpr int kRedraws = 20;
  constexpr double kTurn = 1.7e-4, kPoint_m = 0.02;  // rad: what RefineRig adds to the stitched turns
  double of_pose = 0, of_views = 0;
  for (uint64_t redraw = 0; redraw < kRedraws; ++redraw) {
    const World w = MakeWorld(700 + redraw, 0.12, 600);
    Random random(redraw);
    const auto noise = [&](double sigma) {
      const double x = random.Normal(), y = random.Normal(), z = random.Normal();
      return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
    };
    RefineRigInput in;
    in.shape_covariance = Eigen::MatrixXd::Zero(96, 96);
    for (int i = 0; i < 16; ++i) {
      View v = ViewOf(w, i);
      v.rig_from_view.rotation = v.rig_from_view.rotation * ExpSO3(noise(kTurn));
      v.rig_from_view.translation += Eigen::Vector3d(0.1, -0.05, 0.2) + noise(0.05);
      in.rig.views.push_back(v);
    }
    for (const Eigen::Vector3d& at : w.points) {
      std::vector<std::pair<int, Eigen::Vector2d>> seen;
      for (int i = 0; i < 16; ++i) {
        Eigen::Vector2d pixel;
        if (See(w, i, at, &pixel)) seen.emplace_back(i, pixel);
      }
      if (seen.empty()) continue;
      const auto& [i, pixel] = seen[random.Below(seen.size())];
      in.points.push_back({i, pixel + 0.7 * Eigen::Vector2d(random.Normal(), random.Normal()), at + noise(kPoint_m),
                           kPoint_m * kPoint_m * Eigen::Matrix3d::Identity()});
    }
    in.sigma_px = 0.7;
    in.rig_from_world = Rigid3d().Plus(0.01 * Vector6d::Ones());
    const RefinedRig refined = RefineRig(in, RigFreedom::kFree);
    const auto nees = [](const Eigen::Vector3d& e, const Matrix6d& covariance) {
      return e.dot(Eigen::Matrix3d(covariance.bottomRightCorner<3, 3>()).ldlt().solve(e));
    };
    of_pose += nees(refined.rig_from_world.translation, refined.covariance) / (3 * kRedraws);
    for (size_t i = 0; i < 16; ++i) {
      const View& view = refined.rig.views[i];
      of_views += nees(view.rig_from_view.translation - w.centres[i], view.covariance) / (3 * 16 * kRedraws);
    }
  }
  // Chi-square with 60 dof: 0.53 to 1.66 in 99.8 % of cases; the robust loss gives a little for normal noise.
  EXPECT_GT(of_pose, 0.45);
  EXPECT_LT(of_pose, 1.7);
  EXPECT_GT(of_views, 0.45);
  EXPECT_LT(of_views, 1.7);
}

// A rig whose stitched photos are off by what its covariance states: held as stitched but for the size, it is where it
// says, which is less certain than the points alone would make it.
TEST(RefineRig, AScaledRigIsAsGoodAsItsShapeAllows) {
  constexpr int kRedraws = 20;
  constexpr double kTurn = 1e-3, kPlace_m = 0.004, kPoint_m = 0.02;
  double of_pose = 0, of_views = 0;
  for (uint64_t redraw = 0; redraw < kRedraws; ++redraw) {
    const World w = MakeWorld(900 + redraw, 0.12, 600);
    Random random(redraw);
    const auto noise = [&](double sigma) {
      const double x = random.Normal(), y = random.Normal(), z = random.Normal();
      return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
    };
    RefineRigInput in;
    in.shape_covariance = Eigen::MatrixXd::Zero(96, 96);
    for (int i = 0; i < 16; ++i) {
      View v = ViewOf(w, i);
      v.rig_from_view.rotation = v.rig_from_view.rotation * ExpSO3(noise(kTurn));
      v.rig_from_view.translation = (v.rig_from_view.translation + noise(kPlace_m)) / 1.5;
      in.rig.views.push_back(v);
      in.shape_covariance.diagonal().segment<3>(6 * i).setConstant(kTurn * kTurn);
      in.shape_covariance.diagonal().segment<3>(6 * i + 3).setConstant(std::pow(kPlace_m / 1.5, 2));
    }
    for (const Eigen::Vector3d& at : w.points) {
      const Eigen::Vector3d known = at + noise(kPoint_m);
      for (int i = 0; i < 16; ++i) {
        Eigen::Vector2d pixel;
        if (!See(w, i, at, &pixel)) continue;
        pixel += 0.7 * Eigen::Vector2d(random.Normal(), random.Normal());
        in.points.push_back({i, pixel, known, kPoint_m * kPoint_m * Eigen::Matrix3d::Identity()});
        break;
      }
    }
    in.sigma_px = 0.7;
    in.rig_from_world = Rigid3d().Plus(0.01 * Vector6d::Ones());
    const RefinedRig refined = RefineRig(in, RigFreedom::kScaled);
    ASSERT_EQ(refined.view_covariance.rows(), 96);
    const Vector6d error = refined.rig_from_world.Minus(Rigid3d());
    of_pose += error.dot(refined.covariance.ldlt().solve(error)) / (6 * kRedraws);
    for (size_t i = 0; i < 16; ++i) {
      const View& view = refined.rig.views[i];
      EXPECT_EQ(view.covariance,
                (refined.view_covariance.block<6, 6>(6 * static_cast<int>(i), 6 * static_cast<int>(i))));
      const Vector6d off = view.rig_from_view.Minus(ViewOf(w, static_cast<int>(i)).rig_from_view);
      of_views += off.dot(view.covariance.ldlt().solve(off)) / (6 * 16 * kRedraws);
    }
  }
  // Chi-square with 120 dof: 0.65 to 1.44 in 99.8 % of cases; the robust loss gives a little for normal noise.
  EXPECT_GT(of_pose, 0.5);
  EXPECT_LT(of_pose, 1.5);
  EXPECT_GT(of_views, 0.8);
  EXPECT_LT(of_views, 1.2);
}

TEST(RefineRig, AStitchedRigIsAsUncertainAsItsShapeAndItsSize) {
  constexpr double kPlace_m = 0.01, kSize = 0.7, kAdded_m = 1e-3;  // what RefineRig adds to the stitched places
  const World w = MakeWorld(1, 0.12, 10);
  RefineRigInput in;
  for (int i = 0; i < 16; ++i) in.rig.views.push_back(ViewOf(w, i));
  in.shape_covariance = kPlace_m * kPlace_m * Eigen::MatrixXd::Identity(96, 96);
  in.log_scale_sigma = kSize;
  const Eigen::MatrixXd c = StitchedViewCovariance(in);
  ASSERT_EQ(c.rows(), 96);
  // About the mean of the centres.
  const double own = kPlace_m * kPlace_m + kAdded_m * kAdded_m;
  const Eigen::Matrix3d same =
      own * 15 / 16 * Eigen::Matrix3d::Identity() + kSize * kSize * w.centres[2] * w.centres[2].transpose();
  const Eigen::Matrix3d other =
      -own / 16 * Eigen::Matrix3d::Identity() + kSize * kSize * w.centres[2] * w.centres[5].transpose();
  EXPECT_TRUE((c.block<3, 3>(15, 15).isApprox(same, 1e-9)));
  EXPECT_TRUE((c.block<3, 3>(15, 33).isApprox(other, 1e-9)));
}

TEST(RefineRig, TooFewPointsAreRefused) {
  RefineRigInput in;
  in.rig.views.resize(2);
  EXPECT_THROW(RefineRig(in, RigFreedom::kPrior), NumericError);
}

class Folder : public testing::Test {
 protected:
  TempDir dir_;
};

using RigFilesTest = Folder;
using PanoramaFileTest = Folder;
using PhotoSetTest = Folder;

TEST_F(RigFilesTest, WhatIsWrittenIsRead) {
  const World w = MakeWorld(1, 0.12, 300);
  StitchedRig rig = Observed(w, 0.4, 2);
  CancelToken cancel;
  RigBundleOptions o;
  o.centres = true;
  rig.bundle = SolveRig(rig.views, o, true, cancel, &rig.state);
  CentreRig(&rig);
  rig.state.photos[5].placed = false;
  rig.reason[5] = "does not belong";
  rig.state.lenses[0].p1 = 0.0006, rig.state.lenses[0].p2 = -0.0004;
  rig.views[6].orientation = 8;
  // One photo less has one block less.
  WriteRigFiles(rig, nullptr, dir_);
  const RigFile file = ReadRigFiles(dir_);
  ASSERT_EQ(file.rig.views.size(), 15U);
  EXPECT_EQ(file.rig.views[5].name, "p6.jpg");
  const Rigid3d right = RigFromCam(rig.state.photos[6]);
  EXPECT_LT((file.rig.views[5].rig_from_view.translation - right.translation).norm(), 1e-6);
  EXPECT_LT(file.rig.views[5].rig_from_view.rotation.angularDistance(right.rotation), 1e-7);
  const std::vector<double> lens = CameraOf(rig, 6).params(), read = file.rig.views[5].camera.params();
  ASSERT_EQ(read.size(), lens.size());
  for (size_t k = 0; k < lens.size(); ++k) EXPECT_NEAR(read[k], lens[k], 1e-3 * std::abs(lens[k]));
  EXPECT_NEAR(file.radius_log_sigma, rig.bundle.radius_log_sigma, 1e-9);
}

TEST_F(RigFilesTest, DamageIsNamed) {
  EXPECT_THROW(ReadRigFiles(dir_), InputError);
  std::ofstream(dir_ / "rig.json") << "{\"photos\": 3";
  try {
    ReadRigFiles(dir_);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("rig.json"));
  }
}

TEST_F(PanoramaFileTest, JpegAndTiffCarryWhatViewersNeed) {
  for (const char* name : {"panorama.jpg", "panorama.tif"}) {
    const std::filesystem::path file = dir_ / name;
    cv::Mat rows(128, 512, CV_8UC4, cv::Scalar(10, 120, 230, 255));
    rows(cv::Rect(0, 0, 512, 20)).setTo(cv::Scalar(9, 9, 9, 0));
    PanoramaWriter writer(file, 512, 256, 95);
    writer.Write(rows);
    writer.Write(rows);
    writer.Finish();
    PanoramaMetadata m;
    m.width = 512, m.height = 256;
    m.heading_deg = 123.25;
    const bool levelled = name == std::string("panorama.jpg");
    if (levelled) m.pitch_deg = m.roll_deg = 0;
    m.photos = 24;
    m.position = Geodetic{-33.8567844, 151.2152967, 41.25};
    m.has_height = true;
    m.height_above_sea = name == std::string("panorama.tif");
    m.sigma_h_m = 2.5;
    m.first_utc_ns = 1'700'000'000'000'000'000;
    WritePanoramaMetadata(file, m);
    const PhotoMetadata read = ReadPhotoMetadata(file);
    ASSERT_TRUE(read.gpano) << name;
    EXPECT_EQ(read.gpano->projection, "equirectangular");
    EXPECT_EQ(read.gpano->full_width, 512);
    EXPECT_EQ(read.gpano->crop_height, 256);
    EXPECT_NEAR(*read.gpano->heading_deg, 123.25, 1e-4);
    std::vector<std::string> warnings;
    EXPECT_EQ(GeoTagFromMetadata(read, file, &warnings).has_tilt, levelled);
    ASSERT_TRUE(read.position);
    EXPECT_NEAR(read.position->latitude_deg, -33.8567844, 1e-7);
    EXPECT_NEAR(read.position->longitude_deg, 151.2152967, 1e-7);
    EXPECT_NEAR(read.position->height_m, 41.25, 1e-3);
    EXPECT_EQ(read.height_above_sea, m.height_above_sea);
    EXPECT_NEAR(*read.sigma_h_m, 2.5, 1e-3);
    const cv::Mat picture = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(picture.cols, 512);
    ASSERT_EQ(picture.rows, 256);
    if (picture.channels() == 4) {
      EXPECT_EQ(picture.at<cv::Vec4b>(5, 5)[3], 0);
      EXPECT_EQ(picture.at<cv::Vec4b>(100, 5), cv::Vec4b(10, 120, 230, 255));
    } else {
      EXPECT_NEAR(picture.at<cv::Vec3b>(100, 5)[2], 230, 4);
      EXPECT_LT(picture.at<cv::Vec3b>(4, 5)[2], 10);
    }
    EXPECT_EQ(LoadPanorama(file, true).cols, 512);
  }
  EXPECT_THROW(PanoramaWriter(dir_ / "panorama.png", 8, 4, 90), InputError);
  EXPECT_THROW(PanoramaWriter(dir_ / "none" / "panorama.jpg", 8, 4, 90), IoError);
}

TEST_F(PhotoSetTest, NamesWhatCannotBeUsed) {
  cv::imwrite((dir_ / "a.jpg").string(), cv::Mat(300, 400, CV_8UC3, cv::Scalar(1, 2, 3)));
  cv::imwrite((dir_ / "wide.jpg").string(), cv::Mat(100, 800, CV_8UC3, cv::Scalar(1, 2, 3)));
  std::ofstream(dir_ / "damaged.jpg") << "no picture";
  std::ofstream(dir_ / "empty.jpg").flush();
  const PhotoSet set = ReadPhotoSet(dir_, "x");
  ASSERT_EQ(set.photos.size(), 1U);
  ASSERT_EQ(set.left_out.size(), 3U);
  EXPECT_THAT(set.left_out[0].reason, testing::HasSubstr("damaged.jpg"));
  EXPECT_THAT(set.left_out[1].reason, testing::HasSubstr("empty"));
  EXPECT_THAT(set.left_out[2].reason, testing::HasSubstr("is a panorama itself"));
  std::filesystem::create_directories(dir_ / "none");
  EXPECT_THROW(ReadPhotoSet(dir_ / "none", "none"), InputError);
}

}  // namespace
}  // namespace trigpoint
