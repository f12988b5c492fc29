// solution.db: what is written comes back bit by bit, and what is damaged is refused.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "calib/base/error.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "datasets/io/text.h"
#include "datasets/solution/solution_check.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "datasets/solution/solution_model.h"
#include "tests/datasets/sample_solution.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

template <typename T>
bool SameBytes(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

void ExpectSamePose(const Rigid3d& a, const Rigid3d& b) {
  for (int k = 0; k < 4; ++k) EXPECT_TRUE(SameBytes(a.rotation.coeffs()[k], b.rotation.coeffs()[k]));
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(SameBytes(a.translation[k], b.translation[k]));
}

std::string Execute(const fs::path& file, const std::string& sql) {
  sqlite3* db = nullptr;
  sqlite3_open(file.c_str(), &db);
  char* message = nullptr;
  sqlite3_exec(db, sql.c_str(), nullptr, nullptr, &message);
  const std::string text = message == nullptr ? "" : message;
  sqlite3_free(message);
  sqlite3_close(db);
  return text;
}

TEST(SolutionFile, ComesBackBitByBit) {
  const TempDir dir;
  Solution s = MakeSolution();
  s.problem.points[3] = {-0.0, std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::infinity()};
  s.problem.points[4].setConstant(std::numeric_limits<double>::quiet_NaN());
  s.problem.points[5] = {3.0, 1e300, 0.1 + 0.2};
  s.point_valid[4] = false;
  WriteSolution(s, dir / "solution.db");
  const Solution back = ReadSolution(dir / "solution.db");
  EXPECT_EQ(back.run, s.run);
  ASSERT_EQ(back.cameras.size(), 2u);
  EXPECT_EQ(back.cameras[1].name, "cam1");
  EXPECT_EQ(back.cameras[1].camera.model(), CameraModel::kRadtan);
  EXPECT_EQ(back.cameras[1].camera.params(), s.cameras[1].camera.params());
  EXPECT_TRUE(std::signbit(back.cameras[1].time_offset_s));
  ExpectSamePose(back.cameras[1].cam_from_body, s.cameras[1].cam_from_body);
  ASSERT_EQ(back.images.size(), 12u);
  EXPECT_EQ(back.images[11].name, s.images[11].name);
  EXPECT_EQ(back.images[11].stamp_ns, s.images[11].stamp_ns);
  EXPECT_EQ(back.images[11].camera, 1);
  EXPECT_EQ(back.pose_stamps, s.pose_stamps);
  ASSERT_EQ(back.problem.poses.size(), s.problem.poses.size());
  for (size_t i = 0; i < s.problem.poses.size(); ++i) ExpectSamePose(back.problem.poses[i], s.problem.poses[i]);
  EXPECT_EQ(back.problem.pose_constant, s.problem.pose_constant);
  ASSERT_EQ(back.problem.points.size(), s.problem.points.size());
  for (size_t j = 0; j < s.problem.points.size(); ++j) {
    if (j == 4) {
      EXPECT_TRUE(back.problem.points[j].array().isNaN().all());
    } else {
      EXPECT_TRUE(SameBytes(back.problem.points[j], s.problem.points[j])) << j;
    }
  }
  EXPECT_EQ(back.point_valid, s.point_valid);
  EXPECT_EQ(back.depth_m, s.depth_m);
  ASSERT_EQ(back.problem.observations.size(), s.problem.observations.size());
  for (size_t k = 0; k < s.problem.observations.size(); ++k) {
    const BearingObservation &a = back.problem.observations[k], &b = s.problem.observations[k];
    EXPECT_TRUE(a.point == b.point && a.pose == b.pose && a.view == b.view && a.active == b.active);
    EXPECT_TRUE(SameBytes(a.w, b.w) && SameBytes(a.ray, b.ray));
  }
  EXPECT_EQ(back.image_of, s.image_of);
  EXPECT_EQ(back.feature_of, s.feature_of);
  ASSERT_EQ(back.problem.factors.size(), 7u);
  for (size_t k = 0; k < 7; ++k) EXPECT_EQ(back.problem.factors[k].kind, s.problem.factors[k].kind);
  EXPECT_EQ(back.problem.factors[5].view_b, 1);
  EXPECT_EQ(back.problem.factors[6].arm, s.problem.factors[6].arm);
  EXPECT_EQ(back.problem.factors[2].sqrt_info, s.problem.factors[2].sqrt_info);
  EXPECT_EQ(back.problem.factors[2].weight, s.problem.factors[2].weight);
  ExpectSamePose(back.problem.factors[2].measured, s.problem.factors[2].measured);
  const auto loss = [](const std::shared_ptr<const ceres::LossFunction>& l) {
    const auto* chi2 = dynamic_cast<const Chi2Loss*>(l.get());
    return std::make_pair(std::string(chi2->name()), chi2->threshold());
  };
  EXPECT_EQ(loss(back.problem.loss), loss(s.problem.loss));
  EXPECT_EQ(loss(back.problem.factors[2].loss), std::make_pair(std::string("huber"), 22.5));
  EXPECT_EQ(back.problem.scales.front().value, 1.01);
  EXPECT_EQ(back.problem.scales.front().sigma, 0.02);
  EXPECT_EQ(back.sigma_px, s.sigma_px);
  EXPECT_EQ(back.odometry_noise_factor, s.odometry_noise_factor);
  EXPECT_EQ(back.summary.final_cost, 1e-310);
  EXPECT_EQ(back.counts, s.counts);
  EXPECT_EQ(back.covariances[6], s.covariances[6]);
  ASSERT_EQ(back.references.size(), 2u);
  EXPECT_EQ(back.references[0].reason, "chance");
  EXPECT_EQ(back.references[1].pose, 6);
  EXPECT_EQ(back.references[1].row, "photos/a");
  EXPECT_TRUE(SameBytes(back.references[1].geotag_difference, s.references[1].geotag_difference));
  ASSERT_TRUE(back.georeference);
  EXPECT_EQ(back.georeference->covariance, s.georeference->covariance);
  EXPECT_EQ(back.georeference->with_poses[3], s.georeference->with_poses[3]);
  EXPECT_EQ(back.georeference->world_from_odom.scale, 1.02);
  EXPECT_EQ(back.georeference->origin.height_m, 500.25);
}

TEST(SolutionFile, TheSameSolutionGivesTheSameBytes) {
  const TempDir dir;
  WriteSolution(MakeSolution(), dir / "a.db");
  WriteSolution(ReadSolution(dir / "a.db"), dir / "b.db");
  dir.Write("c.db", "something older");
  WriteSolution(MakeSolution(), dir / "c.db");
  const std::string bytes = ReadTextFile(dir / "a.db");
  EXPECT_EQ(bytes, ReadTextFile(dir / "b.db"));
  EXPECT_EQ(bytes, ReadTextFile(dir / "c.db"));
}

TEST(SolutionFile, OneWithoutReferencesAndEarthComesBack) {
  const TempDir dir;
  Solution s = MakeSolution();
  s.references.resize(2);
  s.georeference.reset();
  s.covariances.clear();
  WriteSolution(s, dir / "solution.db");
  const Solution back = ReadSolution(dir / "solution.db");
  EXPECT_FALSE(back.georeference);
  EXPECT_TRUE(back.covariances.empty());
}

std::string Refusal(const fs::path& file) {
  return MessageOf<Error>([&] { ReadSolution(file); });
}

TEST(SolutionFile, RefusesWhatIsNoSolution) {
  const TempDir dir;
  EXPECT_NE(Refusal(dir / "none.db").find("none.db: cannot be read"), std::string::npos);
  EXPECT_NE(Refusal(dir.Write("text.db", "timestamp,x,y\n")).find("text.db: is damaged or no solution"),
            std::string::npos);
  EXPECT_NE(Refusal(dir.Write("empty.db", "")).find("empty.db: is another kind of database"), std::string::npos);
  Execute(dir / "other.db", "CREATE TABLE run (name); INSERT INTO run VALUES ('x')");
  EXPECT_NE(Refusal(dir / "other.db").find("expected a solution of Trigpoint"), std::string::npos);
}

TEST(SolutionFile, WhatWasMeasuredInTheWorldComesBack) {
  const TempDir dir;
  Solution s = MakeSolution();
  ASSERT_TRUE(s.georeference);
  s.georeference->evidence = {"control:57", "tags:run3"};
  MapFactor& map = s.problem.map.emplace();
  map.rigs = {1, 0};
  map.frame = 2;
  map.measured = {Rigid3d(), Rigid3d(Eigen::Quaterniond::Identity(), {1, 2, 3})};
  map.sqrt_info =
      Eigen::MatrixXd::NullaryExpr(12, 12, [](Eigen::Index r, Eigen::Index c) { return 0.1 * r - c / 3.0; });
  WriteSolution(s, dir / "solution.db");
  const Solution back = ReadSolution(dir / "solution.db");
  EXPECT_EQ(back.georeference->evidence, s.georeference->evidence);
  ASSERT_TRUE(back.problem.map);
  EXPECT_EQ(back.problem.map->rigs, map.rigs);
  EXPECT_EQ(back.problem.map->frame, 2);
  ExpectSamePose(back.problem.map->measured[1], map.measured[1]);
  EXPECT_EQ(back.problem.map->sqrt_info, map.sqrt_info);
  map.rigs[0] = 1000;
  EXPECT_THROW(WriteSolution(s, dir / "wrong.db"), InputError);
}

// Of a site: each run with its scale, its cameras and images, all poses.
TEST(SolutionFile, KeepsSeveralRuns) {
  const TempDir dir;
  Solution s = MakeSolution();
  s.runs.resize(2);
  s.runs[0].name = "a", s.runs[1].name = "b";
  s.runs[1].first_camera = 1, s.runs[1].first_image = 7, s.runs[1].first_pose = 3;
  s.runs[1].sigma_px = 0.7, s.runs[1].correlation_inflation = 2;
  s.problem.scales = {{1.01, false, 1, 0.02}, {0.99, false, 1, 0.03}};
  s.problem.factors.front().scale = 1;
  for (size_t i = 7; i < s.images.size(); ++i) s.images[i].camera = 1;
  WriteSolution(s, dir / "solution.db");
  const Solution back = ReadSolution(dir / "solution.db");
  ASSERT_EQ(back.runs.size(), 2u);
  EXPECT_EQ(back.runs[1].name, "b");
  EXPECT_EQ(back.problem.scales[1].value, 0.99);
  EXPECT_EQ(back.problem.scales[0].sigma, 0.02);
  EXPECT_FALSE(back.problem.scales[1].constant);
  EXPECT_EQ(back.problem.factors.front().scale, 1);
  const Solution part = PartOfRun(back, 1);
  EXPECT_EQ(part.run, "b");
  ASSERT_EQ(part.cameras.size(), 1u);
  EXPECT_EQ(part.images.size(), s.images.size() - 7);
  EXPECT_EQ(part.images.front().camera, 0);
  EXPECT_EQ(part.problem.poses.size(), s.problem.poses.size());
  s.problem.factors.front().scale = 2;
  EXPECT_THROW(WriteSolution(s, dir / "wrong.db"), InputError);
}

TEST(SolutionFile, KeepsWhatTheLensLeavesOpen) {
  const TempDir dir;
  Solution s = MakeSolution();
  s.lens_errors.assign(s.cameras.size(), {0.01, -2, 0.5, 1e-3, -1e-4});
  s.problem.pose_shifts = Eigen::MatrixXd::Random(6 * static_cast<Eigen::Index>(s.problem.poses.size()), 3);
  WriteSolution(s, dir / "solution.db");
  const Solution back = ReadSolution(dir / "solution.db");
  EXPECT_EQ(back.lens_errors, s.lens_errors);
  EXPECT_TRUE(back.lens_roots.empty());
  EXPECT_EQ(back.problem.pose_shifts, s.problem.pose_shifts);
  s.lens_roots.assign(5 * s.cameras.size(), {0.001, -0.2, 0.5, 1e-3, -1e-4});
  WriteSolution(s, dir / "roots.db");
  EXPECT_EQ(ReadSolution(dir / "roots.db").lens_roots, s.lens_roots);
  s.lens_roots.pop_back();
  EXPECT_THROW(WriteSolution(s, dir / "wrong.db"), InputError);
}

TEST(SolutionFile, RefusesANewerFormat) {
  const TempDir dir;
  WriteSolution(MakeSolution(), dir / "solution.db");
  ASSERT_EQ(Execute(dir / "solution.db", "PRAGMA user_version = 6"), "");
  const std::string message = Refusal(dir / "solution.db");
  EXPECT_NE(message.find("format version 6, this program reads up to 5"), std::string::npos) << message;
}

TEST(SolutionFile, RefusesAChangedNumber) {
  for (const char* sql :
       {"UPDATE points SET x = x + 1e-12 WHERE rowid = 7",
        "UPDATE observations SET active = 1 - active WHERE rowid = 9", "UPDATE refs SET status = 'localized'",
        "UPDATE run SET loss = 'none'", "DELETE FROM factors WHERE rowid = 5", "DELETE FROM checksum",
        "UPDATE poses SET rig_from_odom_qw = 'one' WHERE rowid = 2", "DROP TABLE views",
        "UPDATE cameras SET model = 'fisheye'", "UPDATE covariances SET covariance = x'00'", "DELETE FROM run",
        "UPDATE observations SET point = 99999999999 WHERE rowid = 1"}) {
    const TempDir dir;
    WriteSolution(MakeSolution(), dir / "solution.db");
    ASSERT_EQ(Execute(dir / "solution.db", sql), "") << sql;
    const std::string message = Refusal(dir / "solution.db");
    EXPECT_NE(message.find("solution.db: is damaged"), std::string::npos) << sql << ": " << message;
    EXPECT_NE(message.find("compute it again"), std::string::npos) << message;
  }
}

// A byte anywhere in the file, or its end: refused or without effect, never a crash or another number.
TEST(SolutionFile, RefusesOrSurvivesDamageAnywhere) {
  const TempDir dir;
  const Solution s = MakeSolution();
  WriteSolution(s, dir / "good.db");
  const std::string good = ReadTextFile(dir / "good.db");
  int refused = 0;
  Random random(3);
  for (int k = 0; k < 200; ++k) {
    std::string bytes = good;
    const size_t at = static_cast<size_t>(random.Uniform() * static_cast<double>(bytes.size()));
    if (k % 4 == 0) {
      bytes.resize(at);
    } else {
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << (k % 8)));
    }
    dir.Write("bad.db", bytes);
    try {
      const Solution back = ReadSolution(dir / "bad.db");
      WriteSolution(back, dir / "again.db");
      EXPECT_EQ(ReadTextFile(dir / "again.db"), good) << "byte " << at;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("bad.db"), std::string::npos) << e.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

TEST(SolutionFile, IsNotWrittenWhereItDoesNotFitTogether) {
  const TempDir dir;
  Solution s = MakeSolution();
  s.problem.observations[5].pose = 7;
  EXPECT_NE(MessageOf<InputError>([&] { WriteSolution(s, dir / "s.db"); }).find("observation 5 names pose 7 of 7"),
            std::string::npos);
  s = MakeSolution();
  s.depth_m.pop_back();
  EXPECT_NE(MessageOf<InputError>([&] { CheckSolution(s); }).find("39 depths for 40 points"), std::string::npos);
}

TEST(SolutionModel, KnowsTheFeatureBehindEveryPixel) {
  Solution s = MakeSolution();
  // Rays that both cameras have, so that every observation has a pixel.
  for (BearingObservation& o : s.problem.observations) o.ray = Eigen::Vector3f(0.1F, -0.2F, 1).normalized();
  s.point_valid[3] = false;
  for (BearingObservation& o : s.problem.observations) o.active = o.point != 5 || o.pose == 0;
  const SolutionModel made = ModelOf(s);
  ASSERT_EQ(made.model.images.size(), 12u);
  EXPECT_EQ(made.model.points.size(), 39u) << "all but one that is not part of the solution";
  for (const ModelPoint& point : made.model.points) {
    EXPECT_NE(point.id, 4);
    EXPECT_EQ(point.track.size(), point.id == 6 ? 2u : 12u) << "references are no images of the run";
    for (const auto& [id, index] : point.track) {
      EXPECT_EQ(made.model.images[id - 1].points[index], point.id);
      EXPECT_EQ(made.feature_of[id - 1][index], 1000 * (point.id - 1) + static_cast<int>(id - 1));
    }
  }
}

TEST(SolutionCovariance, OfAFileIsThatOfTheBundle) {
  const TempDir dir;
  Solution s = MakeSolution();
  std::vector<Matrix6d> unused;
  BundleCovariance(s.problem, 1, {}).PoseBlocks({}, &s.covariances, &unused);
  WriteSolution(s, dir / "solution.db");
  const Solution back = ReadSolution(dir / "solution.db");
  const Eigen::MatrixXd expected = BundleCovariance(s.problem, 1, {}).Joint({2, 5, 6});
  const auto all = [&](const auto& pose) { return std::vector{pose(back, 2), pose(back, 5), pose(back, 6)}; };
  const auto in_odom = [](const Solution& of, int pose) { return OdomPose(of, pose); };
  const auto in_world = [](const Solution& of, int pose) { return WorldPose(of, pose); };
  const Eigen::MatrixXd odom = SolutionCovariance(back, false, 1, {}).Of(all(in_odom));
  const Matrix6d j2 = InverseJacobian(s.problem.poses[2]), j6 = InverseJacobian(s.problem.poses[6]);
  EXPECT_TRUE((odom.block<6, 6>(0, 12).isApprox(j2 * expected.block<6, 6>(0, 12) * j6.transpose(), 1e-9)));
  EXPECT_TRUE((odom.block<6, 6>(12, 12).isApprox(OdomCovariance(back, 6), 1e-9)));
  const Eigen::MatrixXd world = SolutionCovariance(back, false, 1, {}).Of(all(in_world));
  EXPECT_TRUE((world.block<6, 6>(6, 6).isApprox(WorldCovariance(back, 5), 1e-9)));
  // Of what depends on two of them: here their difference.
  const SolutionFunction between = WorldPose(back, 2) + -Matrix6d::Identity() * WorldPose(back, 5);
  const Matrix6d difference =
      world.block<6, 6>(0, 0) + world.block<6, 6>(6, 6) - world.block<6, 6>(0, 6) - world.block<6, 6>(6, 0);
  const Eigen::MatrixXd of_difference = SolutionCovariance(back, false, 1, {}).Of({between});
  EXPECT_LT((of_difference - difference).norm(), 1e-9 * world.norm());
  // A length that is not known blurs what lies far from the beginning.
  const Eigen::MatrixXd free = SolutionCovariance(back, true, 1, {}).Of({OdomPose(back, 5)});
  EXPECT_GT(free(3, 3), odom(9, 9));
}

// The covariance of world_from_rig against draws of poses and similarity.
TEST(SolutionCovariance, InTheWorldIsThatOfDraws) {
  Solution s = MakeSolution();
  SolutionGeoreference& geo = *s.georeference;
  s.covariances.assign(s.problem.poses.size(), 1e-6 * Matrix6d::Identity());
  for (auto& block : geo.with_poses) block.setZero();
  const Matrix6d predicted = WorldCovariance(s, 4);
  const Eigen::Matrix<double, 7, 7> root = geo.covariance.llt().matrixL();
  const Rigid3d world = geo.world_from_odom.TransformPose(s.problem.poses[4].Inverse());
  Matrix6d sum = Matrix6d::Zero();
  Random random(5);
  constexpr int kDraws = 20000;
  for (int k = 0; k < kDraws; ++k) {
    Vector6d pose;
    Eigen::Matrix<double, 7, 1> fit;
    for (double& v : pose) v = 1e-3 * random.Normal();
    for (double& v : fit) v = 0.1 * random.Normal();  // a tenth: small enough to be linear
    fit = root * fit;
    Sim3d similarity = geo.world_from_odom;
    similarity.rotation = ExpSO3(fit.head<3>()) * similarity.rotation;
    similarity.translation += fit.segment<3>(3);
    similarity.scale += fit(6);
    const Vector6d error = similarity.TransformPose(s.problem.poses[4].Plus(pose).Inverse()).Minus(world);
    sum += error * error.transpose() / kDraws;
  }
  geo.covariance *= 0.01;
  const Matrix6d expected = WorldCovariance(s, 4);
  EXPECT_LT((sum - expected).norm(), 0.05 * expected.norm());
  EXPECT_GT(predicted.norm(), expected.norm());
}

}  // namespace
}  // namespace trigpoint
