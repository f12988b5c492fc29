// A drive that comes back to where it began: the loop is found, closed, and believed only with reason.
#include "localize/reconstruct/loops.h"

#include <gtest/gtest.h>

#include "tests/localize/test_drive.h"

namespace trigpoint {
namespace {

using test::Drive;
using test::MakeDrive;

RunReconstruction Solve(Drive& drive, bool close) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ReconstructRunOptions options;
  options.pairs.neighbours = 0;  // which would tie both traversals, too
  options.loops.close = close;
  options.loops.gap_m = 20;
  ProgressSink progress;
  return ReconstructRun(drive.input, options, false, 2, 1, progress, {});
}

double Error(const Drive& drive, const RunReconstruction& result) {
  return test::Error(drive, result.reconstruction.problem.poses);
}

TEST(Loops, AreClosedAndHelp) {
  Drive drive = MakeDrive(1.15, 3);
  const RunReconstruction open = Solve(drive, false), closed = Solve(drive, true);
  EXPECT_EQ(open.loops.tried, 0);
  EXPECT_GE(closed.loops.tried, 3);
  EXPECT_GE(closed.loops.closed, 3);
  EXPECT_EQ(closed.loops.contradicting, 0);
  EXPECT_GT(closed.loops.merged_points, 100);
  // Where the drive meets its beginning, the traversals fit.
  const size_t last = drive.seen.size() - 1;
  const auto miss = [&](const RunReconstruction& result) {
    const Rigid3d truth = drive.odom_from_body[0].Inverse() * drive.odom_from_body[last];
    return (result.reconstruction.problem.poses[last].TargetOriginInSource() - truth.translation).norm();
  };
  EXPECT_LT(miss(closed), 0.05);
  EXPECT_LT(miss(closed), 0.5 * miss(open));
  EXPECT_LT(Error(drive, closed), Error(drive, open));
}

TEST(Loops, AreNotLookedForWhereThereAreNone) {
  Drive drive = MakeDrive(0.8, 3);
  EXPECT_EQ(Solve(drive, true).loops.tried, 0);
}

// The end of the drive sees what its beginning saw, but 5 m farther on: a facade that stands twice. The images say one
// thing, the odometry another.
TEST(Loops, ACopyIsNotBelieved) {
  Drive drive = MakeDrive(1.06, 5);
  const size_t n = drive.seen.size();
  for (size_t k = 0; k < 10; ++k) drive.seen[n - 10 + k] = drive.seen[6 + k];
  const RunReconstruction result = Solve(drive, true);
  EXPECT_GE(result.loops.found, 1);
  EXPECT_EQ(result.loops.closed, 0);
  EXPECT_EQ(result.loops.contradicting, result.loops.found);
}

}  // namespace
}  // namespace trigpoint
