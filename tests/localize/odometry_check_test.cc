// Wrong conventions in odometry are named by the images; right odometry is never refused.
#include "localize/reconstruct/odometry_check.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "localize/reconstruct/camera_mount.h"
#include "localize/reconstruct/odometry_clock.h"
#include "localize/reconstruct/odometry_drift.h"
#include "localize/reconstruct/odometry_jump.h"
#include "localize/reconstruct/odometry_stretch.h"
#include "localize/reconstruct/reconstruct_run.h"
#include "tests/localize/test_drive.h"

namespace trigpoint {
namespace {

using test::Drive;
using test::MakeDrive;
using test::WithLateCamera;

std::string ContradictionOf(Drive& drive) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ProgressSink progress;
  Trajectory whole;
  for (const FrameImage& image : drive.input.images) {
    const auto k = static_cast<size_t>(image.pose);
    if (image.camera == 0) whole.poses.push_back({drive.input.pose_stamps[k], drive.input.odom_from_body[k]});
  }
  return CheckOdometry(drive.input, whole, "odometry.tum", {}, 2, 1, progress, {}).contradiction.value_or("");
}

// The message for a drive whose odometry is written in another way.
template <typename Change>
std::string WrittenAs(Change&& change) {
  Drive drive = MakeDrive(0.8, 3);
  for (Rigid3d& pose : drive.input.odom_from_body) pose = change(pose);
  return ContradictionOf(drive);
}

TEST(OdometryCheck, AgreesWithWhatIsRight) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    for (const double step : {0.25, 0.5, 1.0, 2.0}) {
      Drive drive = MakeDrive(0.8, seed, step);
      EXPECT_EQ(ContradictionOf(drive), "") << seed << " " << step;
    }
  }
}

TEST(OdometryCheck, NamesTheReadingThatAgrees) {
  const auto w_first = WrittenAs([](const Rigid3d& p) {
    const Eigen::Quaterniond& q = p.rotation;  // its coefficients w x y z, read as x y z w
    return Rigid3d(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), p.translation);
  });
  EXPECT_NE(w_first.find("if its quaternions are written w x y z"), std::string::npos) << w_first;
  const auto inverted = WrittenAs([](const Rigid3d& p) { return p.Inverse(); });
  EXPECT_NE(inverted.find("its poses are body_from_odom"), std::string::npos) << inverted;
  const auto conjugate = WrittenAs([](const Rigid3d& p) { return Rigid3d(p.rotation.conjugate(), p.translation); });
  EXPECT_NE(conjugate.find("its quaternions rotate the other way"), std::string::npos) << conjugate;
  Eigen::Matrix3d axes;  // right, down, forward
  axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Quaterniond camera(axes);
  const auto camera_axes =
      WrittenAs([&](const Rigid3d& p) { return Rigid3d(p.rotation * camera.conjugate(), p.translation); });
  EXPECT_NE(camera_axes.find("its body axes are right, down, forward"), std::string::npos) << camera_axes;
  const auto y = WrittenAs([](const Rigid3d& p) {
    return Rigid3d(p.rotation, {p.translation.x(), -p.translation.y(), p.translation.z()});
  });
  EXPECT_NE(y.find("its y is negated"), std::string::npos) << y;
  const auto both = WrittenAs([](const Rigid3d& p) {
    return Rigid3d(p.rotation, {-p.translation.x(), -p.translation.y(), p.translation.z()});
  });
  EXPECT_NE(both.find("its x and y are negated"), std::string::npos) << both;
}

// On a gentle slope the wrong sign changes each direction of motion by less than the gates, but it changes all.
TEST(OdometryCheck, NamesHeightsOfTheWrongSign) {
  const Eigen::Quaterniond slope(Eigen::AngleAxisd(0.06, Eigen::Vector3d(0.6, 0.8, 0)));
  const auto upside = WrittenAs([&](const Rigid3d& p) {
    const Eigen::Vector3d t = slope * p.translation;
    return Rigid3d(slope * p.rotation, {t.x(), t.y(), -t.z()});
  });
  EXPECT_NE(upside.find("its z is negated"), std::string::npos) << upside;
  EXPECT_EQ(WrittenAs([&](const Rigid3d& p) { return Rigid3d(slope, Eigen::Vector3d::Zero()) * p; }), "");
}

// A dozen images: all of them are compared with their neighbours.
TEST(OdometryCheck, NamesTheJumpOfAShortRun) {
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    Drive drive = MakeDrive(0.25, seed, 1.0);
    ASSERT_LT(drive.input.images.size(), 20U);
    EXPECT_EQ(ContradictionOf(drive), "") << seed;
    std::vector<Rigid3d>& poses = drive.input.odom_from_body;
    const std::vector<Rigid3d> good = poses;
    const size_t middle = poses.size() / 2;
    const Eigen::Vector3d aside = good[middle].rotation * Eigen::Vector3d(0, 2, 0);
    for (size_t k = middle; k < poses.size(); ++k) poses[k].translation += aside;
    EXPECT_NE(ContradictionOf(drive).find("jumps between"), std::string::npos) << seed << ContradictionOf(drive);
    poses = good;
    poses[middle].translation += aside;
    EXPECT_NE(ContradictionOf(drive).find("jumps between"), std::string::npos) << seed << ContradictionOf(drive);
    poses = good;
    const Rigid3d turned = good[middle] * Rigid3d(ExpSO3({0, 0, 1}), Eigen::Vector3d::Zero()) * good[middle].Inverse();
    for (size_t k = middle; k < poses.size(); ++k) poses[k] = turned * poses[k];
    EXPECT_NE(ContradictionOf(drive).find("jumps between"), std::string::npos) << seed << ContradictionOf(drive);
  }
}

// Images on both sides of the jump that show nothing: it lies anywhere between those around them.
TEST(OdometryCheck, NamesAllStepsThatMayBeTheJump) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Drive drive = MakeDrive(0.25, seed, 1.0);
    std::vector<Rigid3d>& poses = drive.input.odom_from_body;
    const size_t middle = poses.size() / 2;
    const Eigen::Vector3d aside = poses[middle].rotation * Eigen::Vector3d(0, 2, 0);
    for (size_t k = middle; k < poses.size(); ++k) poses[k].translation += aside;
    Random random(seed);
    for (const size_t blind : {middle - 1, middle}) random.Shuffle(drive.seen[blind].features.points);
    const auto second = [&](size_t pose) { return 1e-9 * static_cast<double>(drive.input.pose_stamps[pose]); };
    const std::string found = ContradictionOf(drive);
    double from = 0, to = 0, moved = 0;
    const size_t at = found.find("jumps between");
    ASSERT_NE(at, std::string::npos) << seed << found;
    ASSERT_EQ(std::sscanf(found.c_str() + at, "jumps between %lf and %lf s: it moves %lf m", &from, &to, &moved), 3);
    EXPECT_NEAR(from, second(middle - 2), 1e-3) << seed;
    EXPECT_NEAR(to, second(middle + 1), 1e-3) << seed;
    EXPECT_NEAR(moved, (poses[middle].translation - poses[middle - 1].translation).norm(), 0.01) << seed;
  }
}

// Two cameras whose clocks are 5 ms apart have a body pose each: consecutive poses show no step, and the moment that is
// wrong has two of them.
TEST(OdometryCheck, NamesTheJumpOfCamerasWithClocksOfTheirOwn) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Drive drive = WithLateCamera(MakeDrive(0.25, seed, 1.0), 5'000'000);
    EXPECT_EQ(ContradictionOf(drive), "") << seed;
    std::vector<Rigid3d>& poses = drive.input.odom_from_body;
    const size_t middle = poses.size() / 4 * 2;  // of the first camera
    const Eigen::Vector3d aside = poses[middle].rotation * Eigen::Vector3d(0, 2, 0);
    poses[middle].translation += aside;
    poses[middle + 1].translation += aside;
    EXPECT_NE(ContradictionOf(drive).find("jumps between"), std::string::npos) << seed << ContradictionOf(drive);
  }
}

// A wrong lens model or gyroscope scale: all turns are off, and at one place far more. That place is not the cause.
TEST(OdometryCheck, DoesNotBlameOnePlaceForTurnsThatAreOffEverywhere) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    Drive drive = MakeDrive(0.8, seed, 1.0);
    std::vector<Rigid3d>& poses = drive.input.odom_from_body;
    const std::vector<Rigid3d> good = poses;
    for (size_t k = 1; k < poses.size(); ++k) {
      Rigid3d step = good[k - 1].Inverse() * good[k];
      step.rotation = ExpSO3(0.6 * LogSO3(step.rotation));
      if (k == poses.size() / 2) step.rotation = step.rotation * ExpSO3({0, 0, 0.5});
      poses[k] = poses[k - 1] * step;
    }
    const std::string found = ContradictionOf(drive);
    EXPECT_EQ(found.find("jumps between"), std::string::npos) << seed << found;
    EXPECT_NE(found.find("contradicts the images"), std::string::npos) << seed << found;
  }
}

// Poses that are held until the next one comes; at a red light the pictures stand, too.
TEST(OdometryCheck, NamesPosesThatAreHeld) {
  for (const bool images_stand : {false, true}) {
    Drive drive = MakeDrive(0.3, 3, 0.5);
    const std::vector<Rigid3d> poses = drive.input.odom_from_body;
    const auto seen = drive.seen;
    for (size_t k = 0; k < poses.size(); ++k) {
      drive.input.odom_from_body[k] = poses[k - k % 4];
      if (images_stand) drive.seen[k] = seen[k - k % 4];
    }
    const std::string found = ContradictionOf(drive);
    EXPECT_EQ(found.find("seem to be held") != std::string::npos, !images_stand) << found;
  }
}

// Stops some metres apart, as street-level imagery has them: odometry is a few degrees and a few per cent off
// everywhere.
TEST(OdometryCheck, TakesWhatIsOffEverywhereForNoise) {
  int refused = 0, all = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    for (const double step : {1.0, 2.0}) {
      for (const double noise_deg : {0.5, 4.0}) {
        Drive drive = MakeDrive(0.5, seed, step);
        Random random(100 + seed);
        const auto noise = [&](double sigma) {
          return Eigen::Vector3d(sigma * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
        };
        for (Rigid3d& pose : drive.input.odom_from_body) {
          pose.rotation = pose.rotation * ExpSO3(noise(noise_deg * kDegToRad / std::sqrt(3.0)));
          pose.translation += noise(0.05 * step);
        }
        refused += ContradictionOf(drive).empty() ? 0 : 1;
        ++all;
      }
    }
  }
  EXPECT_LE(refused, all / 20) << "of " << all;
}

// Odometry may stand still only where the images do.
TEST(OdometryCheck, NamesAPoseThatIsThereTwiceWhileImagesTurn) {
  for (const bool images_stand : {false, true}) {
    Drive drive = MakeDrive(1.6, 3, 2.0);
    const size_t middle = drive.seen.size() / 2;
    drive.input.odom_from_body[middle] = drive.input.odom_from_body[middle - 1];
    if (images_stand) drive.seen[middle] = drive.seen[middle - 1];
    const std::string found = ContradictionOf(drive);
    EXPECT_EQ(found.find("it has the same pose") != std::string::npos, !images_stand) << found;
  }
}

TEST(OdometryCheck, NamesImagesThatAreOnePicture) {
  Drive drive = MakeDrive(0.25, 1, 1.0);
  for (auto& seen : drive.seen) seen.features = drive.seen.front().features;
  EXPECT_NE(ContradictionOf(drive).find("show the same picture"), std::string::npos) << ContradictionOf(drive);
}

// A minute of odometry that turns unevenly, with its stamps and turns that images would show.
struct ClockedDrive {
  Trajectory odometry;
  std::vector<MeasuredTurn> turns;
};

ClockedDrive MakeClockedDrive(double offset_s, double rate, Random* random) {
  ClockedDrive drive;
  const auto heading = [](double t) { return 0.9 * std::sin(0.4 * t) + 0.5 * std::sin(0.23 * t + 1); };
  const Eigen::Quaterniond cam_from_body(0.5, 0.5, -0.5, 0.5);
  const auto body = [&](double t) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(heading(t), Eigen::Vector3d::UnitZ()));
  };
  for (int k = 0; k <= 600; ++k) {
    const double t = 0.1 * k;
    drive.odometry.poses.push_back({std::llround(1e9 * (t / (1 + rate) - offset_s)), Rigid3d(body(t), {t, 0, 0})});
  }
  for (int k = 0; k < 55; ++k) {
    const double a = k + 0.2, b = a + 0.8;
    const Eigen::Vector3d noise = 0.005 * Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal());
    drive.turns.push_back({std::llround(1e9 * a), std::llround(1e9 * b), cam_from_body,
                           ExpSO3(noise) * cam_from_body * body(b).conjugate() * body(a) * cam_from_body.conjugate()});
  }
  return drive;
}

// Turns that change: a second of another clock shows. Where the body turns evenly nothing can be known.
TEST(OdometryClock, IsFoundFromTurns) {
  Random random(5);
  for (const double offset_s : {-3.0, -0.4, 0.0, 0.7, 6.0}) {
    const auto [odometry, turns] = MakeClockedDrive(offset_s, 0, &random);
    const auto clock = FindOdometryClock(odometry, turns, 10);
    ASSERT_TRUE(clock);
    EXPECT_NEAR(clock->offset_s, offset_s, 3.5 * clock->sigma_s);
    EXPECT_LT(clock->sigma_s, 0.1);
    EXPECT_EQ(clock->significant, offset_s != 0);
    EXPECT_EQ(clock->rate, 0);
    EXPECT_FALSE(FindOdometryClock(odometry, {turns.begin(), turns.begin() + 5}, 10));
  }
}

TEST(OdometryClock, ThatRunsAtAnotherRateIsFound) {
  Random random(6);
  for (const double rate : {-0.04, 0.03, 0.045}) {
    const auto [odometry, turns] = MakeClockedDrive(0.3, rate, &random);
    const auto clock = FindOdometryClock(odometry, turns, 10);
    ASSERT_TRUE(clock);
    EXPECT_TRUE(clock->significant) << rate;
    EXPECT_NEAR(clock->rate, rate, 0.006);
  }
  // Beyond the rates that are tried, the last of them fits best. It is not the clock's.
  for (const double rate : {-0.07, 0.07}) {
    const auto [odometry, turns] = MakeClockedDrive(0.3, rate, &random);
    const auto clock = FindOdometryClock(odometry, turns, 10);
    ASSERT_TRUE(clock);
    EXPECT_EQ(clock->rate, 0) << rate;
  }
}

// A picture that was lost: those after it have each the time of the one before.
TEST(OdometryClock, ThatStepsIsFound) {
  Random random(7);
  for (const double at_s : {15.0, 28.0, 40.0}) {
    auto [odometry, turns] = MakeClockedDrive(0, 0, &random);
    EXPECT_FALSE(FindClockStep(odometry, turns, 10));
    for (MeasuredTurn& turn : turns) {
      if (turn.a_ns > 1e9 * at_s) turn.a_ns -= 800'000'000, turn.b_ns -= 800'000'000;
    }
    const auto step = FindClockStep(odometry, turns, 10);
    ASSERT_TRUE(step) << at_s;
    EXPECT_NEAR(step->clock.offset_s, -0.8, 3 * step->clock.sigma_s + 0.1) << at_s;
    EXPECT_NEAR(1e-9 * static_cast<double>(step->at_ns), at_s, 60 / 4.0);
    EXPECT_TRUE(step->after);
  }
  // By chance alone, none.
  for (int draw = 0; draw < 30; ++draw) {
    const auto [odometry, turns] = MakeClockedDrive(0, 0, &random);
    EXPECT_FALSE(FindClockStep(odometry, turns, 10));
  }
}

TEST(OdometryClock, IsNotKnownWhereTurnsAreEven) {
  Drive drive = MakeDrive(0.8, 3);
  const std::vector<Rigid3d> poses = drive.input.odom_from_body;
  for (size_t k = 0; k < poses.size(); ++k) drive.input.odom_from_body[k] = poses[k < 3 ? 0 : k - 3];
  EXPECT_EQ(ContradictionOf(drive).find("clock"), std::string::npos);
}

// No direction of motion contradicts a jump along the path; the points do that images on both sides show.
TEST(OdometryJump, AlongThePathIsShownByPoints) {
  constexpr double kJump_m = 5;
  for (const bool jumps : {false, true}) {
    Drive drive = MakeDrive(0.2, 3, 0.8);
    const size_t middle = drive.seen.size() / 2;
    const Eigen::Vector3d ahead = drive.input.odom_from_body[middle].rotation * Eigen::Vector3d::UnitX();
    for (size_t k = middle; k < drive.seen.size() && jumps; ++k) {
      drive.input.odom_from_body[k].translation += kJump_m * ahead;
    }
    drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
    ProgressSink progress;
    const RunReconstruction run = ReconstructRun(drive.input, {}, false, 2, 1, progress, {});
    const auto jump = FindJumpByPoints(drive.input, run.reconstruction, 1);
    ASSERT_EQ(jump.has_value(), jumps);
    if (!jumps) continue;
    EXPECT_EQ(jump->before, static_cast<int>(middle) - 1);
    EXPECT_EQ(jump->after, static_cast<int>(middle));
    EXPECT_LT((jump->shift_m + kJump_m * ahead).norm(), 0.2 * kJump_m) << jump->shift_m.transpose();
  }
}

// A jump that the solution spreads over the run: half a step, along the path.
TEST(OdometryJump, OfHalfAStepIsTheOneThatImagesContradict) {
  constexpr double kJump_m = 0.5;
  for (const bool jumps : {false, true}) {
    Drive drive = MakeDrive(0.15, 3, 0.9);
    const size_t middle = drive.seen.size() / 2;
    const Eigen::Vector3d ahead = drive.input.odom_from_body[middle].rotation * Eigen::Vector3d::UnitX();
    for (size_t k = middle; k < drive.seen.size() && jumps; ++k) {
      drive.input.odom_from_body[k].translation += kJump_m * ahead;
    }
    drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
    ProgressSink progress;
    const RunReconstruction run = ReconstructRun(drive.input, {}, false, 2, 1, progress, {});
    EXPECT_FALSE(FindJumpByPoints(drive.input, run.reconstruction, 1));
    const auto step = FindContradictedStep(drive.input, run.reconstruction, 2, {});
    ASSERT_EQ(step.has_value(), jumps) << run.reconstruction.correlation_inflation;
    if (!jumps) continue;
    EXPECT_EQ(step->before, static_cast<int>(middle) - 1);
    EXPECT_EQ(step->after, static_cast<int>(middle));
    EXPECT_FALSE(step->of_images);
    EXPECT_NEAR(step->shift_m.norm(), kJump_m, 0.3 * kJump_m);
  }
}

// A picture is lost, and each later one has the time of the one before: the images move on by two steps at once. In so
// short a run only some draws show it, but none shows another place, or takes it for a jump of odometry.
TEST(OdometryJump, WhereAPictureIsMissingTheImagesStandOut) {
  ReconstructRunOptions options;
  options.reconstruct.odometry_translation_m = 0.01;  // as the drive has it
  options.reconstruct.odometry_translation_part = 0;
  int found = 0;
  for (uint64_t seed = 3; seed <= 8; ++seed) {
    Drive drive = MakeDrive(0.15, seed, 0.9, 40);
    const size_t middle = drive.seen.size() / 2;
    drive.seen.erase(drive.seen.begin() + static_cast<std::ptrdiff_t>(middle));
    drive.input.images.pop_back();
    drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
    ProgressSink progress;
    const RunReconstruction run = ReconstructRun(drive.input, options, false, 2, 1, progress, {});
    const auto step = FindContradictedStep(drive.input, run.reconstruction, 2, {});
    if (!step) continue;
    ++found;
    EXPECT_TRUE(step->of_images) << seed;
    EXPECT_EQ(step->before, static_cast<int>(middle) - 1) << seed;
  }
  EXPECT_GE(found, 1);
}

TEST(OdometryCheck, NamesACameraThatIsTurned) {
  for (const Eigen::Vector3d& deg :
       {Eigen::Vector3d(0, 5, 0), Eigen::Vector3d(-4, 3, 0), Eigen::Vector3d(0.5, -0.5, 0)}) {
    Drive drive = MakeDrive(0.8, 3);
    Rigid3d& stated = drive.input.cameras.front().cam_from_body;
    stated.rotation = ExpSO3(deg * kDegToRad) * stated.rotation;
    const std::string found = ContradictionOf(drive);
    if (deg.norm() < 3) {
      EXPECT_EQ(found, "");
      continue;
    }
    EXPECT_NE(found.find("its T_cam_imu differs by"), std::string::npos) << found;
    std::vector<int> all;
    for (int i = 0; i < static_cast<int>(drive.input.images.size()); i += 2) all.push_back(i);
    const auto error = FindMountError(drive.input.odom_from_body, MeasureMotions(drive.input, all, {}, 2, 1, {}));
    ASSERT_TRUE(error);
    EXPECT_LT((error->rotation - deg * kDegToRad).norm(), 4 * error->sigma_rad + 0.005) << error->rotation.transpose();
  }
}

// A path of `turn_rad` in all, the camera turned on the body by 2 deg; directions with a noise of 1 deg.
std::pair<std::vector<Rigid3d>, std::vector<MeasuredMotion>> Directions(double turn_rad, double ratio, double axis_rad,
                                                                        uint64_t seed) {
  constexpr int kSteps = 60;
  Random random(seed);
  Eigen::Matrix3d axes;  // right, down, forward
  axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Rigid3d stated(Eigen::Quaterniond(axes), {0, 0, 0});
  const Rigid3d mounted(ExpSO3({0, 2 * kDegToRad, 0}) * stated.rotation, {0, 0, 0});
  std::vector<Rigid3d> path(1);
  std::vector<MeasuredMotion> motions;
  for (int k = 0; k < kSteps; ++k) {
    path.push_back(path.back() * Rigid3d(ExpSO3({0, 0, turn_rad / kSteps}), {1, 0, 0}));
    MeasuredMotion m;
    m.a = k, m.b = k + 1;
    m.sensor_from_body = stated;
    m.b_from_a =
        mounted * path[static_cast<size_t>(k) + 1].Inverse() * path[static_cast<size_t>(k)] * mounted.Inverse();
    m.b_from_a.translation = ExpSO3({0, kDegToRad * random.Normal(), 0}) * m.b_from_a.translation;
    m.has_direction = true;
    m.sigma_direction_rad = m.sigma_rotation_rad = kDegToRad;
    motions.push_back(m);
  }
  const Eigen::Rotation2Dd axis(axis_rad);
  const Eigen::Matrix2d stretch = axis * Eigen::Vector2d(ratio, 1).asDiagonal() * axis.inverse().toRotationMatrix();
  for (Rigid3d& pose : path) pose.translation.head<2>() = stretch * pose.translation.head<2>();
  return {path, motions};
}

// The fewer the motions, the more their residuals look like noise: the turn is found all the same.
TEST(OdometryMount, PositionsTurnedAgainstRotationsShowInFewMotions) {
  for (const double turned_deg : {-10.0, 0.0, 10.0, 25.0}) {
    auto [path, motions] = Directions(3, 1, 0, 7);
    for (Rigid3d& pose : path) {
      pose.translation = ExpSO3({0, 0, turned_deg * kDegToRad}) * pose.translation;
    }
    std::vector<MeasuredMotion> few;
    for (size_t k = 0; k < motions.size(); k += 6) few.push_back(motions[k]);
    const auto error = FindMountError(path, few);
    ASSERT_TRUE(error) << turned_deg;
    // About the camera's y axis, down, beside the 2 deg by which it is mounted otherwise.
    EXPECT_NEAR(error->rotation.y() * kRadToDeg, -(turned_deg + 2), 4 * error->sigma_rad * kRadToDeg)
        << error->rotation.transpose() * kRadToDeg;
  }
}

// Twice as noisy as stated: the mean square of the error, in its sigmas, is 1 where the noise is found. The residuals
// are vectors of three components (rotations) and of two (directions).
TEST(OdometryMount, ItsSigmaFollowsTheNoise) {
  constexpr int kDraws = 200;
  constexpr double kStated_rad = 2 * kDegToRad, kNoise_rad = 2 * kStated_rad;
  double squares = 0;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    auto [path, motions] = Directions(3, 1, 0, seed);
    Random random(1000 + seed);
    const auto noise = [&] {
      return ExpSO3(kNoise_rad * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
    };
    for (MeasuredMotion& m : motions) {
      const Rigid3d& mounted = m.sensor_from_body;
      m.b_from_a =
          mounted * path[static_cast<size_t>(m.b)].Inverse() * path[static_cast<size_t>(m.a)] * mounted.Inverse();
      m.b_from_a.rotation = noise() * m.b_from_a.rotation;
      m.b_from_a.translation = noise() * m.b_from_a.translation;
      m.sigma_rotation_rad = m.sigma_direction_rad = kStated_rad;
    }
    const auto error = FindMountError(path, motions);
    ASSERT_TRUE(error) << seed;
    squares += std::pow(error->rotation.y() / error->sigma_rad, 2) / kDraws;  // the axis that only directions show
  }
  EXPECT_GT(squares, 0.5);
  EXPECT_LT(squares, 1.5);
}

std::vector<int64_t> StampsOf(const Trajectory& trajectory) {
  std::vector<int64_t> stamps;
  for (const TimedPose& pose : trajectory.poses) stamps.push_back(pose.stamp_ns);
  return stamps;
}

// Errors in sigmas of many draws: their mean square is 1 where the sigma is right.
TEST(OdometryDrift, IsFoundAndTakenOut) {
  const Eigen::Vector3d drift_rad_m(0, 0, 0.3 * kDegToRad);
  double squares = 0;
  constexpr int kDraws = 40;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    auto [path, motions] = Directions(3, 1, 0, seed);
    Random random(seed);
    for (MeasuredMotion& m : motions) {
      const Rigid3d mounted = m.sensor_from_body;
      m.b_from_a =
          mounted * path[static_cast<size_t>(m.b)].Inverse() * path[static_cast<size_t>(m.a)] * mounted.Inverse();
      m.b_from_a.rotation =
          ExpSO3(0.2 * kDegToRad * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal())) *
          m.b_from_a.rotation;
      m.sigma_rotation_rad = 0.2 * kDegToRad;
    }
    Trajectory right, odometry;
    for (const Rigid3d& pose : path) right.poses.push_back({static_cast<int64_t>(right.poses.size()), pose});
    odometry = WithoutDrift(right, StampsOf(right), path, -drift_rad_m);
    std::vector<Rigid3d> drifting;
    for (const TimedPose& pose : odometry.poses) drifting.push_back(pose.target_from_body);
    const auto none = FindDrift(path, motions, 0.01);
    ASSERT_TRUE(none);
    EXPECT_FALSE(none->significant) << none->rad_m.transpose();
    const auto found = FindDrift(drifting, motions, 0.01);
    ASSERT_TRUE(found);
    EXPECT_TRUE(found->significant);
    // What is chance about the other axes is no drift.
    EXPECT_EQ(found->significant_rad_m.head<2>().norm(), 0);
    EXPECT_EQ(found->significant_rad_m.z(), found->rad_m.z());
    EXPECT_FALSE(FindDrift(drifting, motions, 0.5)->significant);  // noise explains it
    squares += (found->rad_m - drift_rad_m).cwiseQuotient(found->sigma_rad_m).squaredNorm() / (3 * kDraws);
    const Trajectory mended = WithoutDrift(odometry, StampsOf(right), drifting, drift_rad_m);
    for (size_t k = 0; k < path.size(); ++k) {
      EXPECT_LT((mended.poses[k].target_from_body.Inverse() * path[k]).translation.norm(), 1e-9);
    }
    const std::vector<Rigid3d> poses = WithoutDrift(drifting, drift_rad_m);
    for (size_t k = 0; k < path.size(); ++k) EXPECT_LT((poses[k].Inverse() * path[k]).translation.norm(), 1e-9);
  }
  EXPECT_GT(squares, 0.3);
  EXPECT_LT(squares, 1.5);
}

// Rotations that scatter as stated are as stated; three times as much is found, and by how much.
TEST(OdometryTurnNoise, IsFoundWhereItIsLargerThanStated) {
  constexpr double kStated_rad = 0.3 * kDegToRad, kImages_rad = 0.2 * kDegToRad;
  constexpr int kDraws = 100;
  int found_wrongly = 0, found = 0;
  double sum = 0;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    auto [path, motions] = Directions(3, 1, 0, seed);
    Random random(seed);
    const auto turned = [&](double sigma) {
      return ExpSO3(sigma * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
    };
    std::vector<double> variances;
    for (size_t k = 0; k < path.size(); ++k) variances.push_back(static_cast<double>(k) * kStated_rad * kStated_rad);
    const auto noise_of = [&](double times) {
      std::vector<Rigid3d> noisy = {path[0]};
      for (size_t k = 1; k < path.size(); ++k) {
        const Rigid3d step = path[k - 1].Inverse() * path[k];
        noisy.push_back(noisy.back() * Rigid3d(step.rotation * turned(times * kStated_rad), step.translation));
      }
      for (MeasuredMotion& m : motions) {
        const Rigid3d mounted = m.sensor_from_body;
        m.b_from_a =
            mounted * path[static_cast<size_t>(m.b)].Inverse() * path[static_cast<size_t>(m.a)] * mounted.Inverse();
        m.b_from_a.rotation = turned(kImages_rad) * m.b_from_a.rotation;
        m.sigma_rotation_rad = kImages_rad;
      }
      return TurnNoise(noisy, motions, variances);
    };
    found_wrongly += noise_of(1) > 1 ? 1 : 0;
    const double three = noise_of(3);
    found += three > 1 ? 1 : 0;
    sum += three / kDraws;
  }
  EXPECT_LE(found_wrongly, 2);
  EXPECT_GT(found, 95);
  EXPECT_GT(sum, 2.0);  // the images' own noise is not three times as large
  EXPECT_LT(sum, 3.2);
}

// Odometry between images has noise: its path is longer than the metres a drift was found over.
TEST(OdometryDrift, IsTakenOutByTheMetresFromImageToImage) {
  constexpr int kPerStep = 20;
  constexpr double kNoise_m = 0.05;  // as long as a step of odometry
  const Eigen::Vector3d drift_rad_m(0, 0, 0.3 * kDegToRad);
  const std::vector<Rigid3d> path = Directions(3, 1, 0, 1).first;  // of the images, a metre apart
  Random random(1);
  Trajectory odometry;
  std::vector<int64_t> stamps;
  for (size_t i = 0; i <= kPerStep * (path.size() - 1); ++i) {
    const size_t k = i / kPerStep, j = i % kPerStep;
    const double share = static_cast<double>(j) / kPerStep;
    Rigid3d pose = j == 0 ? path[k] : Interpolate(path[k], path[k + 1], share);
    if (j == 0) stamps.push_back(static_cast<int64_t>(i));
    if (j > 0) pose.translation += kNoise_m * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    pose.rotation = pose.rotation * ExpSO3((static_cast<double>(k) + share) * drift_rad_m);
    odometry.poses.push_back({static_cast<int64_t>(i), pose});
  }
  const Trajectory mended = WithoutDrift(odometry, stamps, path, drift_rad_m);
  for (size_t k = 0; k < path.size(); ++k) {
    EXPECT_LT(AngleBetween(mended.poses[kPerStep * k].target_from_body.rotation, path[k].rotation), 1e-9) << k;
  }
}

TEST(OdometryStretch, IsFoundFromDirections) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const auto [stretched, motions] = Directions(6, 1.3, 0.5, seed);
    const auto found = FindStretch(stretched, motions);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->ratio, 1.3, 4 * found->sigma_ratio);
    EXPECT_NEAR(found->axis_rad, 0.5, 4 * found->sigma_ratio / 0.3);
    EXPECT_GT(found->turned_rad, 5 * found->sigma_rad);
    const auto [right, its] = Directions(6, 1, 0, seed);
    const auto none = FindStretch(right, its);
    ASSERT_TRUE(none);
    EXPECT_LT(none->turned_rad, 5 * none->sigma_rad);
    // A stretch of a straight path turns it, as another mount of the camera does.
    const auto [straight, along] = Directions(0.1, 1.3, 0.5, seed);
    EXPECT_FALSE(FindStretch(straight, along));
  }
}

TEST(OdometryCheck, NamesPositionsStretchedAlongAnAxis) {
  const std::string found = WrittenAs([](const Rigid3d& p) {
    return Rigid3d(p.rotation, {1.3 * p.translation.x(), p.translation.y(), p.translation.z()});
  });
  const std::string said = "its lengths are too long in one direction by a factor of ";
  ASSERT_NE(found.find(said), std::string::npos) << found;
  EXPECT_NEAR(std::stod(found.substr(found.find(said) + said.size())), 1.3, 0.03);
}

TEST(OdometryCheck, RefusesWhatNoReadingMends) {
  const auto still = WrittenAs([](const Rigid3d& p) { return Rigid3d({1, 0, 0, 0}, p.translation); });
  EXPECT_NE(still.find("no other order, axis, sign or inverse agrees"), std::string::npos) << still;
}

TEST(OdometryCheck, DoesNotDecideWithoutMotion) {
  Drive drive = MakeDrive(0.8, 3);
  for (Rigid3d& pose : drive.input.odom_from_body) pose = Rigid3d();
  for (test::SeenFeatures& seen : drive.seen) seen = drive.seen.front();
  EXPECT_EQ(ContradictionOf(drive), "");
  Drive few = MakeDrive(0.03, 3);  // three images
  for (Rigid3d& pose : few.input.odom_from_body) pose = pose.Inverse();
  EXPECT_EQ(ContradictionOf(few), "");
}

}  // namespace
}  // namespace trigpoint
