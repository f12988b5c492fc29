// Wrong conventions in odometry are named by the images; right odometry is never refused.
#include "localize/reconstruct/odometry_check.h"

#include <gtest/gtest.h>

#include "tests/localize/test_drive.h"

namespace trigpoint {
namespace {

using test::Drive;
using test::MakeDrive;

std::string ContradictionOf(Drive& drive) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ProgressSink progress;
  return FindContradiction(drive.input, "odometry.tum", {}, 2, 1, progress, {}).value_or("");
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
