// A run among surveyed tags, control points and GPS: where it is said to be, and how well, over redraws of all noise.
#include "localize/georegistration/world_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "calib/camera/camera.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "tests/localize/world_tags.h"

namespace trigpoint {
namespace {

using test::CamFromBody;
using test::FacingTheRun;
using test::Normal3;
using test::OdometryFactor;
using test::SightedTag;

constexpr int kPoses = 40;
constexpr double kStep_m = 1, kPixel_px = 0.3;
constexpr double kStepSigma_m = 0.02, kTurnSigma_rad = 0.002, kScaleSigma = 0.01;
constexpr double kCommon_m = 0.05, kOwn_m = 0.004, kOwn_rad = 0.01;  // errors of the map: its datum's, a tag's

// A run along a bend past tags, with everything that is measured drawn anew.
struct Drive {
  LocalizeInput input;
  BundleProblem problem;
  WorldEvidence evidence;
  GeoStart start;
  std::vector<GpsPlace> gps;
  std::vector<Rigid3d> world_from_body;  // truth
  Rigid3d world_from_odom;
};

Rigid3d Truth(int i) {
  const double a = 0.02 * i;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(50 * std::sin(a), 50 * (1 - std::cos(a)), 0.3 * std::sin(0.3 * i))};
}

void AddOdometry(Random* random, Drive* drive) {
  const double scale = 1 + kScaleSigma * random->Normal();
  Rigid3d odom_from_body;
  drive->world_from_odom = Truth(0);
  for (int i = 0; i < kPoses; ++i) {
    drive->world_from_body.push_back(Truth(i));
    drive->input.images.push_back({int64_t{i} * 1'000'000'000, std::to_string(i), 0, i});
    if (i > 0) {
      Rigid3d step = Truth(i - 1).Inverse() * Truth(i);
      step.rotation = ExpSO3(Normal3(random, kTurnSigma_rad)) * step.rotation;
      step.translation = step.translation / scale + Normal3(random, kStepSigma_m);
      odom_from_body = odom_from_body * step;
      drive->problem.factors.push_back(OdometryFactor(i, step, kTurnSigma_rad, kStepSigma_m));
    }
    drive->problem.poses.push_back(odom_from_body.Inverse());
    drive->problem.pose_constant.push_back(i == 0);
  }
  drive->problem.views = {CamFromBody()};
  drive->input.scale_sigma = kScaleSigma;
}

// Tag `id` left of pose `at`, as the images around it show it.
WorldTag SeenTag(int id, int at, Random* random) {
  const Rigid3d world_from_tag = Truth(at) * Rigid3d(FacingTheRun(), Eigen::Vector3d(0, 4, 0.5));
  WorldTag tag = SightedTag(id, world_from_tag, at, kPoses, kPixel_px, Truth, random);
  tag.world_from_tag = world_from_tag;
  return tag;
}

// Tags all along the run; `mapped`: with their places, whose errors have a part in common.
void AddTags(bool mapped, Random* random, Drive* drive) {
  const Eigen::Vector3d common = Normal3(random, kCommon_m);
  for (int at = 3; at < kPoses; at += 8) {
    WorldTag tag = SeenTag(at, at, random);
    if (mapped) {
      Vector6d error;
      error << Normal3(random, kOwn_rad), Normal3(random, kOwn_m) + common;
      tag.world_from_tag = tag.world_from_tag->Plus(error);
    } else {
      TagControl control;
      control.position = tag.world_from_tag->translation + Normal3(random, 0.01);
      tag.control.push_back(control);
      tag.world_from_tag.reset();
    }
    drive->evidence.tags.push_back(tag);
  }
  if (!mapped) return;
  const auto n = 6 * static_cast<Eigen::Index>(drive->evidence.tags.size());
  Eigen::MatrixXd& c = drive->evidence.map_covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index a = 0; a < n; a += 6) {
    c.block<3, 3>(a, a).diagonal().setConstant(kOwn_rad * kOwn_rad);
    c.block<3, 3>(a + 3, a + 3).diagonal().setConstant(kOwn_m * kOwn_m);
    for (Eigen::Index b = 0; b < n; b += 6) c.block<3, 3>(a + 3, b + 3).diagonal().array() += kCommon_m * kCommon_m;
  }
}

// Fixes every second, whose errors wander: one part in exp(-1/15) stays, so that 30 s count as one.
void AddGps(Random* random, Drive* drive) {
  constexpr double kSigma_m = 0.5, kStays = 0.9355;
  Eigen::Vector3d error = Normal3(random, kSigma_m);
  for (int i = 0; i < kPoses; ++i) {
    GpsPlace g;
    g.pose = i;
    g.arm_m = Eigen::Vector3d(0, 0, 1.3);
    g.position = Truth(i) * g.arm_m + error;
    g.sigma_h_m = g.sigma_v_m = kSigma_m;
    g.stamp_ns = int64_t{i} * 1'000'000'000;
    drive->gps.push_back(g);
    error = kStays * error + Normal3(random, kSigma_m * std::sqrt(1 - kStays * kStays));
  }
  drive->evidence.gps = true;
}

struct Outcome {
  WorldFit fit;
  double nees = 0, error_m = 0;  // of the positions of three poses in world, jointly (9) and root mean square
};

Outcome Fit(Drive* drive) {
  Outcome outcome;
  ProgressSink progress;
  const CancelToken cancel;
  BundleOptions bundle;
  bundle.threads = 1;
  BundleSummary summary;
  GeoRegistrationOptions options;
  BundleProblem& p = drive->problem;
  outcome.fit = FitWorld(drive->input, drive->start, drive->gps, drive->evidence, options, bundle, &p, &summary,
                         progress, cancel);
  if (!outcome.fit.solved) return outcome;
  const BundleCovariance covariance(p, 1, cancel);
  const Rigid3d& frame = p.poses[static_cast<size_t>(outcome.fit.frame)];
  const std::vector<int> poses = {2, kPoses / 2, kPoses - 1, outcome.fit.frame};
  const Eigen::MatrixXd c = covariance.Joint(poses);
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(9, 24);
  Eigen::VectorXd e(9);
  for (int k = 0; k < 3; ++k) {
    const Rigid3d& body = p.poses[static_cast<size_t>(poses[static_cast<size_t>(k)])];
    Matrix6d by_body, by_frame;
    RelativeJacobians(frame, body, &by_frame, &by_body);
    j.block<3, 6>(3 * k, 6 * k) = by_body.bottomRows<3>();
    j.block<3, 6>(3 * k, 18) = by_frame.bottomRows<3>();
    e.segment<3>(3 * k) = (frame * body.Inverse()).translation - Truth(poses[static_cast<size_t>(k)]).translation;
  }
  outcome.nees = e.dot((j * c * j.transpose()).ldlt().solve(e));
  outcome.error_m = e.norm() / std::sqrt(3.0);
  return outcome;
}

Drive MakeDrive(uint64_t seed) {
  Random random(seed);
  Drive drive;
  AddOdometry(&random, &drive);
  return drive;
}

TEST(WorldFit, MapHoldsTheRunAndItsDatumErrorIsCommon) {
  constexpr int kDraws = 100;
  double nees = 0, square = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(1000 + static_cast<uint64_t>(draw));
    Drive drive = MakeDrive(static_cast<uint64_t>(draw));
    AddTags(true, &random, &drive);
    const Outcome outcome = Fit(&drive);
    ASSERT_TRUE(outcome.fit.solved) << outcome.fit.reason;
    EXPECT_EQ(outcome.fit.map_tags.size(), 5u);
    nees += outcome.nees / kDraws;
    square += outcome.error_m * outcome.error_m / kDraws;
  }
  // The sum of 100 chi-squares of 9 degrees: standard deviation 0.42 of the mean.
  EXPECT_NEAR(nees, 9, 3 * 0.42);
  // The datum's error stays, 0.05 m an axis; odometry's drift does not.
  EXPECT_LT(std::sqrt(square), 0.12);
  EXPECT_GT(std::sqrt(square), 0.06);
}

TEST(WorldFit, ControlOnTags) {
  constexpr int kDraws = 60;
  double nees = 0, square = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(2000 + static_cast<uint64_t>(draw));
    Drive drive = MakeDrive(static_cast<uint64_t>(draw));
    AddTags(false, &random, &drive);
    const Outcome outcome = Fit(&drive);
    ASSERT_TRUE(outcome.fit.solved) << outcome.fit.reason;
    EXPECT_EQ(outcome.fit.control_tags.size(), 5u);
    EXPECT_TRUE(outcome.fit.map_tags.empty());
    nees += outcome.nees / kDraws;
    square += outcome.error_m * outcome.error_m / kDraws;
  }
  // The points lie nearly on a line, about which odometry's tilt alone holds the run.
  EXPECT_LT(std::sqrt(square), 0.2);
  EXPECT_NEAR(nees, 9, 3 * std::sqrt(18.0 / kDraws));
}

TEST(WorldFit, GpsThatWanders) {
  constexpr int kDraws = 100;
  double nees = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Random random(3000 + static_cast<uint64_t>(draw));
    Drive drive = MakeDrive(static_cast<uint64_t>(draw));
    AddGps(&random, &drive);
    drive.start.registration.solved = true;  // as a fit to some of the fixes leaves it
    drive.start.registration.world_from_odom =
        Sim3d{1, Truth(0).rotation, Truth(0).translation + Normal3(&random, 0.5)};
    const Outcome outcome = Fit(&drive);
    ASSERT_TRUE(outcome.fit.solved);
    EXPECT_TRUE(outcome.fit.gps);
    nees += outcome.nees / kDraws;
  }
  // A run is hardly longer than the errors last: what they share beyond the time that counts as one is not modelled.
  EXPECT_LT(nees, 13);
  EXPECT_GT(nees, 4);
}

// However many fixes there are, they do not show how far the sea lies from the ellipsoid.
TEST(WorldFit, HeightsAboveTheSeaCountOnce) {
  constexpr double kSea_m = 50;
  Random random(9);
  Drive drive = MakeDrive(9);
  AddGps(&random, &drive);
  for (GpsPlace& g : drive.gps) {
    g.position.z() += 41;
    g.sigma_v_m = std::hypot(g.sigma_v_m, kSea_m), g.sigma_sea_m = kSea_m;
  }
  drive.start.registration.solved = true;
  drive.start.registration.world_from_odom = Sim3d{1, Truth(0).rotation, Truth(0).translation};
  const Outcome outcome = Fit(&drive);
  ASSERT_TRUE(outcome.fit.solved);
  const BundleCovariance covariance(drive.problem, 1, CancelToken());
  const Eigen::MatrixXd of_frame = covariance.Joint({outcome.fit.frame});
  EXPECT_NEAR(std::sqrt(of_frame(5, 5)), kSea_m, 0.1 * kSea_m);
}

TEST(WorldFit, TagThatWasMovedIsLeftOut) {
  Random random(7);
  Drive drive = MakeDrive(7);
  AddTags(true, &random, &drive);
  drive.evidence.tags[2].world_from_tag->translation += Eigen::Vector3d(0.2, 0, 0);
  const Outcome outcome = Fit(&drive);
  ASSERT_TRUE(outcome.fit.solved);
  EXPECT_EQ(outcome.fit.left_out, std::vector<int>{drive.evidence.tags[2].id});
  EXPECT_EQ(outcome.fit.warnings.size(), 1u);
  EXPECT_LT(outcome.nees, 33);  // 99.99 % of 9
}

TEST(GeotagsOf, PhotosOfAHandHeldSetStateOneGeotag) {
  LocalizeInput input;
  input.frame = LocalFrame({48, 11, 500});
  for (const int set : {-1, 7, 7, 7, 8, -1}) {
    ReferenceViews& photo = input.references.emplace_back();
    photo.set = set;
    photo.geotag.has_position = true;
    photo.geotag.position = {48, 11, 500};
  }
  BundleProblem problem;
  problem.poses.resize(5);
  // The first photo of set 7 is not localized.
  const GeoStart start = GeotagsOf(input, {0, -1, 1, 2, 3, 4}, problem);
  EXPECT_EQ(start.references, (std::vector<int>{0, 2, 4, 5}));
  EXPECT_EQ(start.poses, (std::vector<int>{0, 1, 3, 4}));
  EXPECT_EQ(start.observations.size(), 4u);
}

TEST(WorldFit, AMapOfElsewhereIsRefused) {
  Random random(8);
  Drive drive = MakeDrive(8);
  AddTags(true, &random, &drive);
  for (size_t i = 0; i < drive.evidence.tags.size(); ++i)
    drive.evidence.tags[i].world_from_tag->translation *= 1 + 0.5 * static_cast<double>(i);
  const size_t poses = drive.problem.poses.size(), factors = drive.problem.factors.size();
  const Outcome outcome = Fit(&drive);
  EXPECT_FALSE(outcome.fit.solved);
  EXPECT_NE(outcome.fit.reason.find("contradict"), std::string::npos) << outcome.fit.reason;
  EXPECT_EQ(drive.problem.poses.size(), poses);
  EXPECT_EQ(drive.problem.factors.size(), factors);
}

}  // namespace
}  // namespace trigpoint
