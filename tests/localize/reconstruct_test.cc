// A drive straight ahead along a street: what its trajectory is worth when the camera is known well, and when it isn't.
#include "localize/reconstruct/reconstruct.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "calib/estimation/random.h"
#include "localize/reconstruct/camera_arm.h"
#include "localize/reconstruct/clock_error.h"

namespace trigpoint {
namespace {

struct Street {
  LocalizeInput input;
  TrackSet tracks;
  std::vector<Rigid3d> odom_from_body;  // truth
};

// 120 frames, 0.8 m and 0.1 s apart; points on both sides and on the ground. `k1`: distortion of the camera that nobody
// knows of. `winding`: of the way, to both sides, m. `late_s`: a second camera takes its pictures so much later; 0:
// there is none. `pace`: the share by which the speed rises and falls.
Street MakeStreet(double k1, uint64_t seed, double winding = 0, double late_s = 0, double pace = 0) {
  Street street;
  Random random(seed);
  constexpr int kFrames = 120;
  constexpr double kStep = 0.8;
  const Camera truth(CameraModel::kRadtan, 1240, 376, {718, 718, 619.5, 187.5, k1, 0, 0, 0});
  BodyCamera camera;
  camera.name = "cam0";
  camera.camera = Camera(CameraModel::kPinhole, 1240, 376, {718, 718, 619.5, 187.5});
  Eigen::Matrix3d cam_from_body;  // looks ahead
  cam_from_body << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  camera.cam_from_body = {Eigen::Quaterniond(cam_from_body), Eigen::Vector3d::Zero()};
  street.input.cameras = {camera};
  if (late_s > 0) street.input.cameras.push_back(camera);
  const auto body_at = [&](double time) {
    const double frame = time + 10 * pace * std::sin(time / 10);
    const double phase = kStep * frame / 5, heading = std::atan(winding / 5 * std::sin(phase));
    return Rigid3d(ExpSO3({0, 0, heading}), {kStep * frame, winding * (1 - std::cos(phase)), 0});
  };
  const auto add = [&](double frame, int of_camera, const Rigid3d& body, const Rigid3d& odom) {
    const int64_t stamp = std::llround(1e8 * frame);
    const int pose = static_cast<int>(street.odom_from_body.size());
    street.odom_from_body.push_back(body);
    street.input.odom_from_body.push_back(odom);
    street.input.pose_stamps.push_back(stamp);
    street.input.images.push_back({stamp, std::to_string(pose), of_camera, pose});
  };
  Rigid3d odom = body_at(0);
  for (int i = 0; i < kFrames; ++i) {
    const Rigid3d body = body_at(i);
    if (i > 0) {
      const Eigen::Vector3d noise(random.Normal(), random.Normal(), random.Normal());
      const Eigen::Vector3d turn(random.Normal(), random.Normal(), random.Normal());
      const Rigid3d step = body_at(i - 1).Inverse() * body;
      odom = odom * Rigid3d(step.rotation * ExpSO3(0.0005 * turn), step.translation + 0.012 * noise);
    }
    add(i, 0, body, odom);
    const Rigid3d late = body_at(i + late_s / 0.1);
    if (late_s > 0) add(i + late_s / 0.1, 1, late, odom * body.Inverse() * late);
  }
  const int images = static_cast<int>(street.input.images.size());
  for (int j = 0; j < 5000; ++j) {
    const double side = random.Uniform() < 0.5 ? -1 : 1;
    const Eigen::Vector3d point(random.Uniform(0, kStep * kFrames + 40), side * random.Uniform(4, 8),
                                random.Uniform(-1.5, 4));
    std::vector<TrackObservation> seen;
    for (int i = 0; i < images; ++i) {
      const Eigen::Vector3d in_cam =
          camera.cam_from_body * (street.odom_from_body[static_cast<size_t>(i)].Inverse() * point);
      if (in_cam.z() < 3 || in_cam.z() > 30) continue;
      const auto pixel = truth.Project(in_cam);
      if (!pixel || !truth.Contains(*pixel)) continue;
      const Eigen::Vector2d noisy = *pixel + 0.3 * Eigen::Vector2d(random.Normal(), random.Normal());
      seen.push_back({street.tracks.tracks, i, j, noisy.cast<float>()});
    }
    if (seen.size() < 3) continue;
    street.tracks.observations.insert(street.tracks.observations.end(), seen.begin(), seen.end());
    ++street.tracks.tracks;
  }
  return street;
}

// Root mean square error of the way over ten steps, as a part of it, less the scale that all share.
double WayError(const std::vector<Rigid3d>& odom_from_body) {
  std::vector<double> ways;
  double mean = 0;
  for (size_t i = 0; i + 10 < odom_from_body.size(); i += 10) {
    ways.push_back((odom_from_body[i + 10].translation - odom_from_body[i].translation).norm());
    mean += ways.back();
  }
  mean /= static_cast<double>(ways.size());
  double sum = 0;
  for (double w : ways) sum += (w / mean - 1) * (w / mean - 1);
  return std::sqrt(sum / static_cast<double>(ways.size()));
}

Reconstruction Solve(const Street& street, const OdometryNoise& noise = {}) {
  ProgressSink progress;
  const CancelToken cancel;
  return Reconstruct(street.input, {street.input.odom_from_body, noise}, street.tracks.tracks,
                     street.tracks.observations, ReconstructOptions(), false, 2, progress, cancel);
}

std::vector<Rigid3d> Bodies(const Reconstruction& r) {
  std::vector<Rigid3d> bodies;
  for (const Rigid3d& pose : r.problem.poses) bodies.push_back(pose.Inverse());
  return bodies;
}

TEST(Reconstruct, ImagesOfAKnownCameraMendOdometry) {
  const Street street = MakeStreet(0, 5);
  const Reconstruction r = Solve(street);
  EXPECT_NEAR(r.sigma_px, 0.3, 0.03);
  EXPECT_LT(r.correlation_inflation, 1.3);
  EXPECT_LT(WayError(Bodies(r)), 0.7 * WayError(street.input.odom_from_body));
}

TEST(Reconstruct, ImagesThatDriftInScaleAreBelievedLess) {
  const Street street = MakeStreet(0.02, 5);  // at the picture's edge 9 px
  const Reconstruction r = Solve(street);
  EXPECT_GT(r.correlation_inflation, 2);
  // No better than odometry, but not much worse either.
  EXPECT_LT(WayError(Bodies(r)), 2 * WayError(street.input.odom_from_body));
}

// Every `every`-th image of a street.
Street ThinOut(const Street& street, int every) {
  Street thin;
  thin.input.cameras = street.input.cameras;
  for (size_t i = 0; i < street.odom_from_body.size(); i += static_cast<size_t>(every)) {
    const int pose = static_cast<int>(thin.odom_from_body.size());
    thin.odom_from_body.push_back(street.odom_from_body[i]);
    thin.input.odom_from_body.push_back(street.input.odom_from_body[i]);
    thin.input.pose_stamps.push_back(street.input.pose_stamps[i]);
    thin.input.images.push_back({street.input.pose_stamps[i], std::to_string(i), 0, pose});
  }
  std::map<int, std::vector<TrackObservation>> tracks;
  for (TrackObservation o : street.tracks.observations) {
    if (o.image % every != 0) continue;
    o.image /= every;
    tracks[o.track].push_back(o);
  }
  for (auto& [track, seen] : tracks) {
    if (seen.size() < 3) continue;
    for (TrackObservation& o : seen) o.track = thin.tracks.tracks;
    thin.tracks.observations.insert(thin.tracks.observations.end(), seen.begin(), seen.end());
    ++thin.tracks.tracks;
  }
  return thin;
}

// Root mean square error of positions after the similarity that fits best, m.
double PositionError(const Street& street, const std::vector<Rigid3d>& odom_from_body) {
  const auto n = static_cast<Eigen::Index>(odom_from_body.size());
  Eigen::Matrix3Xd from(3, n), to(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    from.col(i) = odom_from_body[static_cast<size_t>(i)].translation;
    to.col(i) = street.odom_from_body[static_cast<size_t>(i)].translation;
  }
  const Eigen::Matrix4d fit = Eigen::umeyama(from, to, true);
  return std::sqrt(((fit.topLeftCorner<3, 3>() * from).colwise() + fit.topRightCorner<3, 1>() - to).squaredNorm() /
                   static_cast<double>(n));
}

// A calibration that is off makes images contradict odometry where no residual shows it. Whether the images' error
// and odometry's add up or cancel is chance: a result has 0.4 to 2 times odometry's error. On average it is not worse
// than the odometry that it was given, with few images, too.
TEST(Reconstruct, ImagesThatContradictOdometryDoNotHarmIt) {
  constexpr int kDraws = 12;
  double ratios = 0;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    const Street street = ThinOut(MakeStreet(0.05, seed), 4);
    const Reconstruction r = Solve(street);
    ratios += PositionError(street, Bodies(r)) / PositionError(street, street.input.odom_from_body);
  }
  EXPECT_LT(ratios / kDraws, 1.1);
}

// Every fifth track gets an observation of another point: a wrong match has joined two.
TEST(Reconstruct, TracksThatWrongMatchesJoinedAreSplit) {
  Street street = MakeStreet(0, 5);
  std::vector<std::vector<TrackObservation>> tracks(static_cast<size_t>(street.tracks.tracks));
  for (const TrackObservation& o : street.tracks.observations) tracks[static_cast<size_t>(o.track)].push_back(o);
  street.tracks.observations.clear();
  int wrong = 0;
  for (size_t t = 0; t < tracks.size(); ++t) {
    std::vector<TrackObservation> track = tracks[t];
    if (t % 5 == 0 && track.size() >= 3) {
      const size_t other = (t + tracks.size() / 2) % tracks.size();
      for (TrackObservation o : tracks[other]) {
        const auto same = [&](const TrackObservation& x) { return x.image == o.image; };
        if (std::any_of(track.begin(), track.end(), same)) continue;
        o.track = static_cast<int>(t);
        track.push_back(o);
        ++wrong;
        break;
      }
      std::sort(track.begin(), track.end(),
                [](const TrackObservation& x, const TrackObservation& y) { return x.image < y.image; });
    }
    street.tracks.observations.insert(street.tracks.observations.end(), track.begin(), track.end());
  }
  ASSERT_GT(wrong, 50);
  const Reconstruction r = Solve(street);
  EXPECT_NEAR(r.sigma_px, 0.3, 0.05);
  EXPECT_LT(WayError(Bodies(r)), 0.8 * WayError(street.input.odom_from_body));
}

// Noise of poses differs from step to step by more than noise of steps does; images do not contradict it for that.
TEST(Reconstruct, OdometryWhosePosesAreNoisyIsNotContradicted) {
  Street street = MakeStreet(0, 5, 1);
  Random random(7);
  constexpr double kTurn_rad = 0.02, kShift_m = 0.1;
  for (Rigid3d& pose : street.input.odom_from_body) {
    const Eigen::Vector3d turn(random.Normal(), random.Normal(), random.Normal());
    const Eigen::Vector3d shift(random.Normal(), random.Normal(), random.Normal());
    pose = pose * Rigid3d(ExpSO3(kTurn_rad * turn), kShift_m * shift);
  }
  // As pairs of images find it: of a step, against 0.26 deg and 0.017 m as stated.
  const Reconstruction r = Solve(street, {std::sqrt(2) * kTurn_rad / 0.0046, std::sqrt(2) * kShift_m / 0.0168});
  EXPECT_NEAR(r.sigma_px, 0.3, 0.03);
  EXPECT_LT(r.correlation_inflation, 1.5);
}

// Two cameras whose clocks are 5 ms apart have a body pose each. Between the two of a moment odometry has no noise to
// show: that of the steps is as large as with one camera.
TEST(Reconstruct, CamerasOfOneMomentMakeOdometryNoBetter) {
  const Vector6d one = Solve(MakeStreet(0, 5)).odometry_noise_factor;
  const Vector6d two = Solve(MakeStreet(0, 5, 0, 0.005)).odometry_noise_factor;
  for (int axis = 3; axis < 6; ++axis) {
    EXPECT_NEAR(one(axis), 0.012 / 0.0168, 0.2) << axis;  // of the steps, as drawn and as stated
    EXPECT_GT(two(axis), 0.85 * one(axis)) << axis;       // counted with steps of no noise: 0.71
  }
}

TEST(Reconstruct, CamerasThatStandElsewhereOnTheBodyAreFound) {
  for (const double off_m : {0.0, 0.3, -0.3}) {
    SCOPED_TRACE(off_m);
    Street street = MakeStreet(0, 5, 3);
    BodyCamera& camera = street.input.cameras.front();
    const Eigen::Vector3d stated(off_m, 0.5 * off_m, 0);  // they stand at the body's origin
    camera.cam_from_body.translation = -(camera.cam_from_body.rotation * stated);
    const auto error = FindArmError(Solve(street), 0.01, 2, {});
    ASSERT_TRUE(error);
    EXPECT_EQ(error->significant, off_m != 0) << error->arm_m.transpose() << " sigma " << error->sigma_m;
    if (off_m == 0) continue;
    EXPECT_LT(error->arm_m.x() * off_m, 0) << error->arm_m.transpose();
  }
}

// Poses with the odometry of another time, as their images were taken that much earlier than stated.
Street WithLateImages(Street street, double late_s, const std::function<bool(size_t pose)>& are_late) {
  Trajectory odometry;
  for (size_t k = 0; k < street.odom_from_body.size(); ++k) {
    odometry.poses.push_back({street.input.pose_stamps[k], street.input.odom_from_body[k]});
  }
  for (size_t k = 0; k < street.odom_from_body.size(); ++k) {
    const auto at = odometry.At(street.input.pose_stamps[k] + std::llround(1e9 * late_s), 1'000'000'000);
    if (are_late(k) && at) street.input.odom_from_body[k] = *at;
  }
  return street;
}

std::vector<ClockError> ErrorsOf(const Street& street) { return FindClockErrors(street.input, Solve(street), 2, {}); }

// Of the images of a camera, or of a part of the run, whichever is most significant.
ClockError MostSignificant(const std::vector<ClockError>& errors) {
  return *std::max_element(errors.begin() + 1, errors.end(),
                           [](const auto& a, const auto& b) { return a.Sigmas() < b.Sigmas(); });
}

TEST(Reconstruct, ImagesThatAreLateAreFound) {
  constexpr double kLate_s = 0.08;
  const Street street = MakeStreet(0, 5, 3, 0, 0.5);
  const std::vector<ClockError> good = ErrorsOf(street);
  EXPECT_LT(good.front().Sigmas(), 3) << good.front().late_s;
  EXPECT_LT(MostSignificant(good).Sigmas(), 4) << MostSignificant(good).late_s;

  // Of first order: a correction is made in steps.
  const ClockError all = ErrorsOf(WithLateImages(street, kLate_s, [](size_t) { return true; })).front();
  EXPECT_NEAR(all.late_s, kLate_s, 0.3 * kLate_s) << all.sigma_s;
  EXPECT_GT(all.Sigmas(), 5) << all.sigma_s;

  const ClockError part = MostSignificant(ErrorsOf(WithLateImages(street, kLate_s, [](size_t k) { return k >= 60; })));
  EXPECT_NEAR(part.late_s, kLate_s, 0.4 * kLate_s) << part.sigma_s;
  EXPECT_GT(part.Sigmas(), 6) << part.sigma_s;
  ASSERT_TRUE(part.from_ns);
  EXPECT_NEAR(1e-9 * static_cast<double>(*part.from_ns), 6, 1);
}

TEST(Reconstruct, ACameraWhoseImagesAreLateIsFound) {
  constexpr double kLate_s = 0.02;
  const Street street = MakeStreet(0, 5, 3, 0.05, 0.5);
  EXPECT_LT(MostSignificant(ErrorsOf(street)).Sigmas(), 4);
  int cameras = 0;
  for (const ClockError& e : ErrorsOf(WithLateImages(street, kLate_s, [](size_t pose) { return pose % 2 == 1; }))) {
    if (e.camera < 0) continue;
    EXPECT_NEAR(e.late_s, e.camera == 1 ? kLate_s : -kLate_s, 0.3 * kLate_s) << e.camera << " sigma " << e.sigma_s;
    EXPECT_GT(e.Sigmas(), 6) << e.sigma_s;
    ++cameras;
  }
  EXPECT_EQ(cameras, 2);
}

// A camera that stands elsewhere moves otherwise where the body turns, which is no clock.
TEST(Reconstruct, ACameraThatStandsElsewhereIsNotLate) {
  Street street = MakeStreet(0, 5, 3, 0, 0.5);
  BodyCamera& camera = street.input.cameras.front();
  camera.cam_from_body.translation = -(camera.cam_from_body.rotation * Eigen::Vector3d(0.3, 0.15, 0));
  const ClockError all = ErrorsOf(street).front();
  EXPECT_TRUE(std::abs(all.late_s) < 0.01 || all.Sigmas() < 3) << all.late_s << " sigma " << all.sigma_s;
}

}  // namespace
}  // namespace trigpoint
