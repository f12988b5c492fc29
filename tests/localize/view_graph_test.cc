// Pairs of images beyond neighbours in time: they tie photos far apart, and wrong ones are rejected.
#include "localize/reconstruct/view_graph.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "calib/geometry/path.h"
#include "localize/reconstruct/track_table.h"
#include "tests/localize/test_drive.h"

namespace trigpoint {
namespace {

using test::Drive;
using test::MakeDrive;
using test::WithLateCamera;

constexpr int64_t kLate_ns = 5'000'000;  // of a camera's clock against another's

RunReconstruction Solve(Drive& drive, int neighbours) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ReconstructRunOptions options;
  options.pairs.neighbours = neighbours;
  options.loops.close = false;
  ProgressSink progress;
  return ReconstructRun(drive.input, options, false, 2, 1, progress, {});
}

double OdometryError(const Drive& drive) {
  std::vector<Rigid3d> body_from_odom;
  for (const Rigid3d& pose : drive.input.odom_from_body) body_from_odom.push_back(pose.Inverse());
  return test::Error(drive, body_from_odom);
}

TEST(ViewGraph, TiesPhotosThatStandFarApart) {
  Drive drive = MakeDrive(1.6, 3, 3.0);
  const RunReconstruction result = Solve(drive, 10);
  EXPECT_GT(result.pairs_joined, static_cast<int>(drive.seen.size()));
  EXPECT_LT(test::Error(drive, result.reconstruction.problem.poses), 0.3 * OdometryError(drive));
}

TEST(ViewGraph, TiesTheEndOfAVideoToItsBeginning) {
  Drive drive = MakeDrive(1.15, 3);
  const RunReconstruction with = Solve(drive, 10), without = Solve(drive, 0);
  EXPECT_EQ(without.pairs_tried, 0);
  EXPECT_GT(with.pairs_joined, 0);
  EXPECT_LT(test::Error(drive, with.reconstruction.problem.poses),
            0.7 * test::Error(drive, without.reconstruction.problem.poses));
}

// A camera whose clock is late has body poses of its own, next to those of the others.
TEST(Frames, StepsAndMomentsAreThoseOfACamera) {
  const Drive one = MakeDrive(0.5, 3);
  const auto poses = static_cast<int>(one.seen.size());
  const LocalizeInput late = WithLateCamera(one, kLate_ns).input;
  const LocalizeInput halfway = WithLateCamera(one, one.input.pose_stamps[1] / 2).input;
  EXPECT_GT(MedianStep(one.input), 0.4);
  EXPECT_EQ(MedianStep(late), MedianStep(one.input));
  EXPECT_EQ(MedianStep(halfway), MedianStep(one.input));
  const std::vector<int> of_one = MomentsOfPoses(one.input), of_late = MomentsOfPoses(late),
                         of_halfway = MomentsOfPoses(halfway);
  ASSERT_EQ(of_late.size(), 2U * of_one.size());
  for (int k = 0; k < 2 * poses; ++k) {
    if (k < poses) {
      EXPECT_EQ(of_one[static_cast<size_t>(k)], k);
    }
    EXPECT_EQ(of_late[static_cast<size_t>(k)], k / 2);
    EXPECT_EQ(of_halfway[static_cast<size_t>(k)], k);
  }
}

// The path is the body's, wherever its cameras stand and however their clocks differ.
TEST(Frames, CamerasThatStandApartAddNoPath) {
  const Drive one = MakeDrive(0.5, 3);
  Drive late = WithLateCamera(one, kLate_ns);
  late.input.cameras.back().cam_from_body.translation += Eigen::Vector3d(0.5, 0, 0);
  std::vector<Rigid3d> body_from_odom;
  for (const Rigid3d& pose : late.input.odom_from_body) body_from_odom.push_back(pose.Inverse());
  const std::vector<double> path = PathToImages(late.input, body_from_odom),
                            of_one = PathLengths(one.input.odom_from_body);
  ASSERT_EQ(path.size(), 2 * of_one.size());
  for (size_t i = 0; i < path.size(); ++i) EXPECT_NEAR(path[i], of_one[i / 2], 1e-9);
}

// Images of one camera are of different moments, however soon they follow each other.
TEST(Frames, ABurstOfOneCameraIsNoMoment) {
  LocalizeInput burst = MakeDrive(0.5, 3).input;
  burst.pose_stamps[1] = burst.pose_stamps[0] + kLate_ns;
  EXPECT_EQ(MomentsOfPoses(burst)[1], 1);
}

// However near each other they are; those of one moment are no pair.
TEST(ViewGraph, FewImagesAreAllPaired) {
  const Drive drive = MakeDrive(0.1, 3, 0.25), late = WithLateCamera(drive, kLate_ns);
  const size_t n = drive.seen.size();
  ASSERT_LE(static_cast<int>(late.seen.size()), ViewGraphOptions().exhaustive);
  EXPECT_EQ(CandidatePairs(drive.input, {}, {}).size(), n * (n - 1) / 2);
  EXPECT_EQ(CandidatePairs(late.input, {}, {}).size(), 2 * n * (2 * n - 1) / 2 - n);
}

ViewGraph GraphOf(Drive& drive) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ProgressSink progress;
  return BuildViewGraph(drive.input, CandidatePairs(drive.input, {}, {}),
                        OdometryFactors(drive.input, {}, Vector6d::Ones()), {}, 2, 1, progress, {});
}

bool Has(const ImagePair& pair, int image) { return pair.a == image || pair.b == image; }

// A photo that shows what its neighbour, 3 m and 21 deg farther on, has seen: the pairs are verified by their images,
// and odometry contradicts them.
TEST(ViewGraph, RejectsWhatOdometryContradicts) {
  Drive drive = MakeDrive(1.6, 3, 3.0);
  constexpr int kCopy = 12;
  drive.seen[kCopy] = drive.seen[kCopy + 1];
  const ViewGraph graph = GraphOf(drive);
  const auto rejected =
      std::count_if(graph.rejected.begin(), graph.rejected.end(), [](const ImagePair& p) { return Has(p, kCopy); });
  const auto kept =
      std::count_if(graph.edges.begin(), graph.edges.end(), [](const ViewEdge& e) { return Has(e.pair, kCopy); });
  EXPECT_GT(rejected, 0);
  EXPECT_EQ(kept, 0);
  EXPECT_GT(graph.edges.size(), drive.seen.size());
  EXPECT_LT(test::Error(drive, Solve(drive, 10).reconstruction.problem.poses), OdometryError(drive));
}

// A photo that shows what one on the other side of the yard has seen: a facade that stands twice.
TEST(ViewGraph, TiesNoPhotoThatShowsAnotherPlace) {
  Drive drive = MakeDrive(1.6, 3, 3.0);
  constexpr int kCopy = 12, kOriginal = 3;
  drive.seen[kCopy] = drive.seen[kOriginal];
  for (const ViewEdge& e : GraphOf(drive).edges) EXPECT_FALSE(Has(e.pair, kCopy)) << e.pair.a << " " << e.pair.b;
  EXPECT_LT(test::Error(drive, Solve(drive, 10).reconstruction.problem.poses), OdometryError(drive));
}

// Odometry anew, its noise `times` the one that the options state.
void RedrawOdometry(double times, uint64_t seed, Drive* drive) {
  const ReconstructOptions stated;
  Random random(seed);
  Rigid3d odometry;
  for (size_t k = 1; k < drive->odom_from_body.size(); ++k) {
    Rigid3d motion = drive->odom_from_body[k - 1].Inverse() * drive->odom_from_body[k];
    const double length = motion.translation.norm();
    const double turn =
        times * std::hypot(stated.odometry_rotation_deg, stated.odometry_rotation_deg_m * std::sqrt(length));
    const double shift = times * std::hypot(stated.odometry_translation_m, stated.odometry_translation_part * length);
    motion.translation += shift * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    motion.rotation =
        motion.rotation * ExpSO3(turn * kDegToRad * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
    odometry = odometry * motion;
    drive->input.odom_from_body[k] = odometry;
  }
}

// Odometry whose noise is four times as large as stated does not keep photos from where they belong.
TEST(ViewGraph, SeesThatOdometryIsNoisierThanStated) {
  Drive drive = MakeDrive(1.6, 3, 3.0);
  RedrawOdometry(4, 5, &drive);
  const OdometryNoise noise = GraphOf(drive).odometry_noise;
  for (const double factor : {noise.rotation, noise.translation}) {
    EXPECT_GT(factor, 2);
    EXPECT_LT(factor, 8);
  }
  EXPECT_LT(test::Error(drive, Solve(drive, 10).reconstruction.problem.poses), 0.1 * OdometryError(drive));
}

// Neighbours are images of consecutive moments: those of one moment say nothing of odometry.
TEST(ViewGraph, SeesItWithCamerasOfDifferentClocksToo) {
  Drive drive = MakeDrive(1.6, 3, 3.0);
  RedrawOdometry(4, 5, &drive);
  Drive late = WithLateCamera(drive, kLate_ns);
  const OdometryNoise noise = GraphOf(late).odometry_noise;
  EXPECT_GT(noise.rotation, 2);
  EXPECT_LT(noise.rotation, 8);
}

TEST(ViewGraph, BelievesOdometryThatIsAsStated) {
  Drive drive = MakeDrive(1.6, 3, 3.0);
  RedrawOdometry(1, 5, &drive);
  EXPECT_LE(GraphOf(drive).odometry_noise.rotation, 1);
  EXPECT_LE(GraphOf(drive).odometry_noise.translation, 1);
}

// Eight photos have seven neighbours only: their other pairs tell of odometry's noise, too. What is left of it is
// mostly the scale, which photos do not see.
TEST(ViewGraph, FewPhotosAreNotDoubtedForNoisyOdometry) {
  for (const uint64_t seed : {3, 4, 5, 6}) {
    Drive drive = MakeDrive(0.5, seed, 3.0);
    ASSERT_EQ(drive.seen.size(), 8U);
    RedrawOdometry(2, seed, &drive);
    const RunReconstruction result = Solve(drive, 10);
    EXPECT_LT(test::Error(drive, result.reconstruction.problem.poses), 0.75 * OdometryError(drive)) << seed;
  }
}

TEST(ViewGraph, ResultsDoNotDependOnThreads) {
  Drive drive = MakeDrive(1.0, 4, 3.0);
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ProgressSink progress;
  const auto poses = [&](int threads) {
    return ReconstructRun(drive.input, {}, false, threads, 1, progress, {}).reconstruction.problem.poses;
  };
  const std::vector<Rigid3d> one = poses(1), three = poses(3);
  ASSERT_EQ(one.size(), three.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].translation, three[i].translation);
    EXPECT_EQ(one[i].rotation.coeffs(), three[i].rotation.coeffs());
  }
}

TrackObservation At(int image, int feature) {
  TrackObservation o;
  o.image = image;
  o.feature = feature;
  return o;
}

TEST(TrackTable, JoinsWhatMatchesAndRefusesTwoFeaturesOfOneImage) {
  TrackTable table;
  EXPECT_TRUE(table.Join(At(0, 1), At(1, 5)));
  EXPECT_TRUE(table.Join(At(1, 5), At(2, 7)));
  EXPECT_TRUE(table.Join(At(3, 2), At(4, 2)));
  EXPECT_FALSE(table.Join(At(0, 2), At(2, 7)));  // image 0 is there already, by feature 1
  EXPECT_TRUE(table.Join(At(2, 7), At(3, 2)));
  TrackSet out;
  table.Close(
      100, [](const TrackTable::Track& track) { return track.size() >= 2; }, &out);
  ASSERT_EQ(out.tracks, 1);
  std::vector<int> images;
  for (const TrackObservation& o : out.observations) images.push_back(o.image);
  EXPECT_EQ(images, (std::vector<int>{0, 1, 2, 3, 4}));
}

}  // namespace
}  // namespace trigpoint
