// Reference poses from a tag map, trajectories scored against them, and tags that moved: on made data of known noise.
#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/epoch.h"
#include "eval/trajectory/estimates.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kSize = 0.5, kPixelSigma = 0.2, kTagSigma = 0.01, kTagRotSigma = 0.002;
constexpr double kMotionRotDeg = 0.3, kMotionM = 0.02;

// A camera that drives along a wall of tags, with a stretch that sees none.
class Drive {
 public:
  explicit Drive(uint64_t seed) : random_(seed) {
    BodyCamera camera;
    camera.name = "cam0";
    camera.camera = Camera::FromFieldOfView(960, 600, 1.6);
    Eigen::Matrix3d r;  // looks to the left of the body
    r << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    camera.cam_from_body = Rigid3d(Eigen::Quaterniond(r), {0.1, 0.2, -0.1});
    camera.has_extrinsics = true;
    input.cameras = {camera};
    input.sizes.size_m = kSize;
    for (int i = 0; i < 80; ++i) {
      const double s = 0.4 * i;
      truth.emplace_back(ExpSO3({0, 0, 0.15 * std::sin(0.4 * s)}), Eigen::Vector3d(s, 0.5 * std::sin(0.3 * s), 0));
      ImageEntry image;
      image.stamp_ns = int64_t{i} * 500'000'000;
      image.file = "image" + std::to_string(i);
      input.images.push_back(image);
    }
    // On a wall at y = 5, none between x = 12 and 21.
    int id = 0;
    for (const double x : {0.0, 4.0, 8.0, 11.5, 21.5, 25.0, 29.0, 32.0}) {
      Eigen::Matrix3d axes;  // x right for a reader who looks north, y down, z into the wall
      axes << 1, 0, 0, 0, 0, 1, 0, -1, 0;
      true_tags.emplace_back(Eigen::Quaterniond(axes), Eigen::Vector3d(x, 5, 0.3 * (id % 3)));
      TagResult tag;
      tag.tag_id = id++;
      tag.size_m = kSize;
      Vector6d noise;
      for (int k = 0; k < 6; ++k) noise[k] = (k < 3 ? kTagRotSigma : kTagSigma) * random_.Normal();
      tag.map_from_tag = true_tags.back().Plus(noise);
      Vector6d sigma;
      sigma << kTagRotSigma, kTagRotSigma, kTagRotSigma, kTagSigma, kTagSigma, kTagSigma;
      tag.covariance = Matrix6d(sigma.cwiseAbs2().asDiagonal());
      input.tags.push_back(tag);
    }
    Detect();
    Move();
  }
  Rigid3d TrueCamera(size_t i) const { return truth[i] * input.cameras[0].cam_from_body.Inverse(); }

  ReferencePoseInput input;
  std::vector<Rigid3d> truth, true_tags;

 private:
  void Detect() {
    for (size_t i = 0; i < truth.size(); ++i) {
      ImageDetections image;
      image.stamp_ns = input.images[i].stamp_ns;
      image.camera = "cam0";
      for (size_t t = 0; t < true_tags.size(); ++t) {
        TagDetection d;
        d.id = static_cast<int>(t);
        bool seen = true;
        for (int k = 0; k < 4; ++k) {
          const Eigen::Vector3d p = TrueCamera(i).Inverse() * (true_tags[t] * TagCorner(kSize, k));
          const auto pixel = p.z() > 0.5 && p.norm() < 6.5 ? input.cameras[0].camera.Project(p) : std::nullopt;
          seen = seen && pixel && input.cameras[0].camera.Contains(*pixel);
          if (!seen) break;
          d.corners[static_cast<size_t>(k)] =
              *pixel + kPixelSigma * Eigen::Vector2d(random_.Normal(), random_.Normal());
        }
        d.corner_sigma_px.fill(kPixelSigma);
        if (seen) image.detections.push_back(d);
      }
      if (!image.detections.empty()) input.detections.push_back(image);
    }
  }
  void Move() {
    Rigid3d odom;
    for (size_t i = 0; i < truth.size(); ++i) {
      if (i > 0) {
        Rigid3d step = truth[i - 1].Inverse() * truth[i];
        const double root = std::sqrt(step.translation.norm() + 0.01 * 0.5);
        const auto normal = [&] { return Eigen::Vector3d(random_.Normal(), random_.Normal(), random_.Normal()); };
        step.rotation = step.rotation * ExpSO3(kMotionRotDeg * kDegToRad * root * normal());
        step.translation = step.translation / 1.005 + kMotionM * root * normal();
        odom = odom * step;
      }
      input.motion.poses.push_back({input.images[i].stamp_ns, odom});
    }
  }
  Random random_;
};

ReferencePoses Estimate(const Drive& drive, ReferencePoseOptions options = {}) {
  options.extra_sigma_px = 0;
  ProgressSink progress;
  return EstimateReferencePoses(drive.input, options, progress, CancelToken());
}

// The motion is that of the body, on its clock; images are on the clock of their camera.
TEST(ReferencePoses, TheMotionIsTakenWhenTheImagesWereTaken) {
  const Drive drive(1);
  Drive shifted(1);
  constexpr double kShift_s = 0.2;  // of half a second between images
  shifted.input.cameras[0].time_offset_s = kShift_s;
  for (TimedPose& pose : shifted.input.motion.poses) pose.stamp_ns += std::llround(1e9 * kShift_s);
  const ReferencePoses expected = Estimate(drive), result = Estimate(shifted);
  ASSERT_EQ(result.poses.size(), expected.poses.size());
  for (size_t i = 0; i < result.poses.size(); ++i) {
    EXPECT_EQ(result.poses[i].stamp_ns, expected.poses[i].stamp_ns);
    EXPECT_EQ(result.poses[i].status, expected.poses[i].status);
    ASSERT_EQ(result.poses[i].world_from_cam.has_value(), expected.poses[i].world_from_cam.has_value());
    if (!result.poses[i].world_from_cam) continue;
    const Rigid3d &a = *result.poses[i].world_from_cam, &b = *expected.poses[i].world_from_cam;
    EXPECT_LT((a.translation - b.translation).norm(), 1e-9);
  }
}

TEST(ReferencePoses, GiveEveryImageAPoseAndSayWhichAreBridged) {
  const Drive drive(1);
  const ReferencePoses result = Estimate(drive);
  ASSERT_EQ(result.poses.size(), drive.truth.size());
  int bridged = 0;
  double sigma_tags = 0, sigma_bridged = 0;
  for (size_t i = 0; i < result.poses.size(); ++i) {
    const ReferencePose& p = result.poses[i];
    ASSERT_TRUE(p.world_from_cam) << p.reason;
    EXPECT_LT((p.world_from_cam->translation - drive.TrueCamera(i).translation).norm(), 0.15) << i;
    const double sigma = std::sqrt(p.covariance.bottomRightCorner<3, 3>().trace());
    (p.status == "bridged" ? sigma_bridged : sigma_tags) =
        std::max(p.status == "bridged" ? sigma_bridged : sigma_tags, sigma);
    if (p.status == "bridged") {
      ++bridged;
      EXPECT_THAT(p.reason, HasSubstr("no tag in it"));
      EXPECT_GT(p.bridged_m, 0);
    }
  }
  EXPECT_GT(bridged, 5);
  EXPECT_GT(sigma_bridged, 1.2 * sigma_tags);
  EXPECT_NEAR(result.scale, 1.005, 3 * result.scale_sigma + 1e-3);
}

// New noise in tags, corners and motion each time: normalised errors of tagged and bridged images lie in the band.
TEST(ReferencePoses, NormalisedErrorsLieInTheirBand) {
  constexpr int kRedraws = 40;
  const size_t images[] = {4, 25, 40, 60, 76};  // the third is in the middle of the bridge
  std::array<double, 5> nees{};
  for (int redraw = 0; redraw < kRedraws; ++redraw) {
    const Drive drive(static_cast<uint64_t>(100 + redraw));
    const ReferencePoses result = Estimate(drive);
    for (size_t k = 0; k < 5; ++k) {
      const ReferencePose& p = result.poses[images[k]];
      const Vector6d e = p.world_from_cam->Minus(drive.TrueCamera(images[k]));
      nees[k] += e.dot(p.covariance.ldlt().solve(e));
    }
  }
  const double dof = 6.0 * kRedraws;
  for (size_t k = 0; k < 5; ++k) {
    EXPECT_GT(nees[k], ChiSquareQuantile(0.005, dof)) << images[k] << ": " << nees[k] / dof;
    EXPECT_LT(nees[k], ChiSquareQuantile(0.995, dof)) << images[k] << ": " << nees[k] / dof;
  }
}

TEST(ReferencePoses, RejectAWronglyReadTagAndWithoutAnyGiveNone) {
  Drive drive(3);
  for (Eigen::Vector2d& corner : drive.input.detections[5].detections[0].corners) corner.x() += 40;
  const ReferencePoses result = Estimate(drive);
  EXPECT_EQ(result.rejected, 1);
  EXPECT_LT((result.poses[5].world_from_cam->translation - drive.TrueCamera(5).translation).norm(), 0.15);

  drive.input.detections.clear();
  const ReferencePoses none = Estimate(drive);
  EXPECT_EQ(none.poses[0].status, "none");
  EXPECT_THAT(none.poses[0].reason, HasSubstr("no image of the run sees a tag"));

  Drive still(4);
  still.input.motion.poses.clear();
  for (const ReferencePose& p : Estimate(still).poses) EXPECT_EQ(p.status, p.tags > 0 ? "tags" : "none");
}

// The truth with known noise, as another system's trajectory.
PoseSequence Noisy(const Drive& drive, double sigma_m, double clock_s, uint64_t seed,
                   const Eigen::Vector3d& lever = Eigen::Vector3d::Zero()) {
  Random random(seed);
  PoseSequence sequence;
  for (size_t i = 0; i < drive.truth.size(); ++i) {
    Rigid3d pose = drive.TrueCamera(i);
    pose.translation += pose.rotation * lever;
    pose.translation += sigma_m * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    sequence.stamps_ns.push_back(drive.input.images[i].stamp_ns + static_cast<int64_t>(clock_s * 1e9));
    sequence.poses.emplace_back(pose);
  }
  return sequence;
}

TEST(ScoreEstimate, TruthWithNoiseIsScoredAsThatNoise) {
  int covered = 0;
  constexpr int kRedraws = 20;
  for (int redraw = 0; redraw < kRedraws; ++redraw) {
    const Drive drive(static_cast<uint64_t>(200 + redraw));
    const ReferencePoses reference = Estimate(drive);
    const double sigma = 0.05;
    const EstimateReport report =
        ScoreEstimate("theirs", "run1", Noisy(drive, sigma, 0, 7 + static_cast<uint64_t>(redraw)), reference.poses,
                      drive.input.cameras, {}, {});
    EXPECT_EQ(report.point, "camera");
    EXPECT_EQ(report.answers, 80);
    EXPECT_EQ(report.attempts, 80);
    EXPECT_FALSE(report.time_offset->significant) << report.time_offset->offset_s;
    const double own = std::sqrt(3.0) * sigma;
    covered += own >= report.own_rmse_interval_m->low && own <= report.own_rmse_interval_m->high;
  }
  EXPECT_GE(covered, 17);
}

// An estimate that rests on the same geotags shares what the reference is off by: its error is then its own, however
// uncertain the reference is.
TEST(ScoreEstimate, IntervalHoldsForAnEstimateThatSharesTheReferencesError) {
  const Drive drive(6);
  ReferencePoses reference = Estimate(drive);
  for (ReferencePose& p : reference.poses) p.covariance.bottomRightCorner<3, 3>() += 0.5 * Eigen::Matrix3d::Identity();
  const double sigma = 0.2, own = std::sqrt(3.0) * sigma;
  const EstimateReport report =
      ScoreEstimate("theirs", "run1", Noisy(drive, sigma, 0, 3), reference.poses, drive.input.cameras, {}, {});
  ASSERT_TRUE(report.own_rmse_interval_m);
  EXPECT_EQ(report.own_rmse_interval_m->low, 0);
  EXPECT_GT(report.own_rmse_interval_m->high, own);
}

TEST(ScoreEstimate, FindsClockLeverArmFrameAndAbsence) {
  const Drive drive(5);
  const ReferencePoses reference = Estimate(drive);
  const auto score = [&](const PoseSequence& sequence, const SystemConfig& config = {}) {
    return ScoreEstimate("theirs", "run1", sequence, reference.poses, drive.input.cameras, config, {});
  };
  const EstimateReport late = score(Noisy(drive, 0.02, 0.1, 1));
  ASSERT_TRUE(late.time_offset);
  EXPECT_TRUE(late.time_offset->significant);
  EXPECT_NEAR(late.time_offset->offset_s, -0.1, 0.02);
  EXPECT_THAT(late.notes.at(0), HasSubstr("its clock is off: -0."));
  EXPECT_LT(*late.rmse_with_offset_m, 0.7 * *late.rmse_m);
  SystemConfig told;
  told.time_offset_s = -0.1;
  EXPECT_FALSE(score(Noisy(drive, 0.02, 0.1, 1), told).time_offset->significant);

  // An antenna half a metre beside the camera.
  const EstimateReport beside = score(Noisy(drive, 0.01, 0, 2, {0.5, 0, 0}));
  EXPECT_NEAR(*beside.rmse_m, 0.5, 0.05);
  SystemConfig arm;
  arm.lever_arm_m = {0.5, 0, 0};
  EXPECT_LT(*score(Noisy(drive, 0.01, 0, 2, {0.5, 0, 0}), arm).rmse_m, 0.06);

  // Poses of the body, in a frame of their own, half of the run only.
  PoseSequence other;
  const Rigid3d theirs(ExpSO3({0, 0, 1}), {400, 20, 3});
  for (size_t i = 0; i < 40; ++i) {
    other.stamps_ns.push_back(drive.input.images[i].stamp_ns);
    other.poses.emplace_back(theirs * drive.truth[i]);
  }
  const EstimateReport moved = score(other);
  EXPECT_EQ(moved.point, "body");
  EXPECT_EQ(moved.answers, 40);
  EXPECT_EQ(moved.attempts, 80);
  EXPECT_EQ(moved.rows[60].status, "absent");
  EXPECT_THAT(moved.notes.back(), HasSubstr("another frame"));
  // Our own results are in the site's frame: what a rigid fit takes away is the error that their poses share.
  const EstimateReport own =
      ScoreEstimate("trigpoint/run1", "run1", other, reference.poses, drive.input.cameras, {}, {});
  EXPECT_GT(*own.rmse_m, 5 * *own.aligned_rmse_m);
  EXPECT_THAT(own.notes, Each(Not(HasSubstr("another frame"))));
  EXPECT_FALSE(moved.error_3d.p90_attempts);
  SystemConfig fitted;
  fitted.alignment = TrajectoryAlignment::kSE3;
  EXPECT_LT(*score(other, fitted).rmse_m, 0.05);
  EXPECT_THROW(score(Noisy(drive, 0, 1e6, 1)), InputError);
}

TEST(Epoch, NamesTheTagThatMoved) {
  Random random(9);
  const auto redraw = [&](double shift) {
    std::vector<TagResult> tags;
    for (int id = 0; id < 10; ++id) {
      TagResult tag;
      tag.tag_id = id;
      Vector6d sigma;
      sigma << 0.003, 0.003, 0.003, 0.008, 0.008, 0.012;
      Vector6d noise;
      for (int k = 0; k < 6; ++k) noise[k] = sigma[k] * random.Normal();
      tag.map_from_tag = Rigid3d(ExpSO3({0, 0, 0.3 * id}), {4.0 * id + shift, 2.0 * (id % 3), 1}).Plus(noise);
      tag.covariance = Matrix6d(sigma.cwiseAbs2().asDiagonal());
      tags.push_back(tag);
    }
    return tags;
  };
  int alarms = 0;
  for (int i = 0; i < 50; ++i) {
    for (const TagMove& t : TestEpoch(redraw(0), redraw(0.5)).tags) alarms += t.moved || t.turned;
  }
  EXPECT_LE(alarms, 3);  // 1 % of 50 maps
  const std::vector<TagResult> a = redraw(0);
  std::vector<TagResult> b = redraw(0);
  b[4].map_from_tag->translation.y() += 0.08;
  b[7].map_from_tag->rotation = ExpSO3({0, 0, 0.05}) * b[7].map_from_tag->rotation;
  b.pop_back();
  const EpochTest test = TestEpoch(a, b);
  for (const TagMove& t : test.tags) {
    EXPECT_EQ(t.moved, t.tag_id == 4) << t.tag_id;
    EXPECT_EQ(t.turned, t.tag_id == 7) << t.tag_id;
  }
  EXPECT_EQ(test.only_a, std::vector<int>{9});
  EXPECT_THAT(FormatEpoch(test, "may", "june"), HasSubstr("Moved or turned: tags 4, 7"));
}

}  // namespace
}  // namespace trigpoint
