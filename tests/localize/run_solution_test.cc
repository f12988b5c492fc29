// A run's solution: what is read back goes on to the same answers, and gives the covariances that localize states.
#include "localize/run_solution.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <filesystem>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "tests/support/temp_dir.h"
#include "tests/synthetic/synthetic_features.h"

namespace trigpoint {
namespace {

struct Drive {
  SyntheticSite site;
  LocalizeInput input;
};

Drive MakeDrive() {
  SyntheticOptions options;
  options.path = "street";
  options.length_m = 40;
  options.points_per_image = 60;
  options.panoramas = 5;
  Drive drive{MakeSyntheticSite(options, 3), {}};
  LocalizeInput& input = drive.input;
  input.cameras = drive.site.cameras;
  for (size_t i = 0; i < drive.site.images.size(); ++i) {
    const SyntheticImage& image = drive.site.images[i];
    input.images.push_back({image.stamp_ns, std::to_string(i), image.camera, image.step});
  }
  for (const TimedPose& pose : drive.site.odometry.poses) {
    input.pose_stamps.push_back(pose.stamp_ns);
    input.odom_from_body.push_back(pose.target_from_body);
  }
  for (const SyntheticPanorama& panorama : drive.site.panoramas) {
    input.references.push_back(
        {panorama.name, panorama.name, ReferenceKind::kPanorama, panorama.rig, panorama.geotag, "", -1});
  }
  input.has_frame = true;
  input.frame = drive.site.frame;
  input.scale_sigma = options.odometry_scale_sigma;
  return drive;
}

class RunSolution : public testing::Test {
 protected:
  RunSolution() : drive_(MakeDrive()) {
    drive_.input.image_features = [this](int i) { return SyntheticImageFeatures(drive_.site, i); };
    drive_.input.view_features = [this](int p, int v) { return SyntheticViewFeatures(drive_.site, p, v); };
  }
  RunReconstruction Run() { return ReconstructRun(drive_.input, {}, false, 2, 1, progress_, {}); }
  Localization Localized(Reconstruction run) {
    return Localize(drive_.input, std::move(run), {}, LocalizeOptions(), 2, 1, progress_, {});
  }
  Drive drive_;
  TempDir dir_;
  std::filesystem::path file_ = dir_ / "run.db";
  ProgressSink progress_;
};

TEST_F(RunSolution, ReadBackLeadsToTheSameAnswers) {
  RunReconstruction run = Run();
  Reconstruction kept = run.reconstruction;
  WriteSolution(SolutionOf(drive_.input, "run1", "trigpoint", std::move(run)), file_);
  const Solution read = ReadSolution(file_);
  ASSERT_FALSE(read.counts.empty());
  EXPECT_EQ(read.counts.front().first, "tracks");
  EXPECT_EQ(read.counts.front().second, static_cast<double>(kept.problem.points.size()));
  const Localization a = Localized(std::move(kept)), b = Localized(ReconstructionOf(drive_.input, read));
  ASSERT_TRUE(a.on_earth);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].world_from_x.translation, b.cameras[i].world_from_x.translation);
    EXPECT_EQ(a.cameras[i].covariance, b.cameras[i].covariance);
  }
  for (size_t i = 0; i < a.references.size(); ++i) {
    EXPECT_EQ(a.references[i].world.world_from_x.translation, b.references[i].world.world_from_x.translation);
  }
}

// Odometry is 8 % too short, which geotags show. The views' own poses (G1) were found before that.
TEST_F(RunSolution, TheOwnPosesOfViewsFollowTheScale) {
  constexpr double kShort = 1.08;
  for (Rigid3d& pose : drive_.input.odom_from_body) pose.translation /= kShort;
  drive_.input.scale_sigma = 0.1;
  const Localization result = Localized(Run().reconstruction);
  ASSERT_TRUE(result.on_earth);
  ASSERT_NEAR(result.odometry_scale, kShort / drive_.site.truth.odometry_scale, 0.04);
  const Eigen::Vector3d first = result.body_from_odom.front().TargetOriginInSource();
  std::vector<double> off;  // of the view with the most inliers from its panorama, as a part of the way
  for (const ReferenceAnswer& answer : result.references) {
    if (answer.pose < 0) continue;
    const Eigen::Vector3d centre = answer.registration.rig_from_odom.TargetOriginInSource();
    const ViewAnswer* best = nullptr;
    for (const ViewAnswer& view : answer.registration.views) {
      if (view.status == AnswerStatus::kLocalized && (best == nullptr || view.inliers > best->inliers)) best = &view;
    }
    if (best == nullptr || (centre - first).norm() < 15) continue;
    off.push_back((best->view_from_odom.TargetOriginInSource() - centre).norm() / (centre - first).norm());
  }
  ASSERT_FALSE(off.empty());
  EXPECT_LT(Median(off), 0.4 * (kShort - 1));
}

// Registration takes the matches for far more exact than they are; with the noise that they show, they do not fix the
// panoramas to the sigma that is asked for.
TEST_F(RunSolution, PanoramasThatTheSolutionDoesNotFixAreLeftOut) {
  LocalizeOptions options;
  options.registration.sigma_px = 0.05;
  options.registration.outlier_chi2 = 10000;
  options.registration.max_sigma_m = 0.002;
  const Localization result = Localize(drive_.input, Run().reconstruction, {}, options, 2, 1, progress_, CancelToken());
  int left_out = 0;
  for (const ReferenceAnswer& answer : result.references) {
    if (answer.registration.reason.find("do not fix its position") == std::string::npos) continue;
    ++left_out;
    EXPECT_EQ(answer.registration.status, AnswerStatus::kRejected);
    EXPECT_EQ(answer.pose, -1);
  }
  EXPECT_GT(left_out, 0);
}

TEST_F(RunSolution, OfAnotherRunIsRefused) {
  const Solution solution = SolutionOf(drive_.input, "run1", "trigpoint", Run());
  drive_.input.images[3].name = "another";
  try {
    ReconstructionOf(drive_.input, solution);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("the solution of run run1 holds other images"), std::string::npos) << e.what();
  }
}

// What localize states of each camera and panorama is what the file gives back, alone and jointly.
TEST_F(RunSolution, GivesTheCovariancesOfTheAnswers) {
  Localization result = Localized(Run().reconstruction);
  ASSERT_TRUE(result.on_earth);
  const std::vector<ReferenceAnswer> references = result.references;
  const std::vector<PoseEstimate> cameras = result.cameras;
  WriteSolution(SolutionOf(drive_.input, "run1", "trigpoint", {}, &result), file_);
  const Solution s = ReadSolution(file_);
  std::vector<int> poses = {s.images[5].pose, s.images[20].pose};
  int localized = 0;
  for (size_t i = 0; i < references.size(); ++i) {
    ASSERT_EQ(s.references[i].status, AnswerStatusName(references[i].registration.status));
    if (s.references[i].pose < 0) continue;
    ++localized;
    poses.push_back(s.references[i].pose);
    const Rigid3d world =
        s.georeference->world_from_odom.TransformPose(s.problem.poses[static_cast<size_t>(poses.back())].Inverse());
    EXPECT_LT((world.translation - references[i].world.world_from_x.translation).norm(), 1e-9);
    EXPECT_TRUE(WorldCovariance(s, poses.back()).isApprox(references[i].world.covariance, 1e-9));
    const double error = (world.translation - drive_.site.truth.world_from_pano[i].translation).norm();
    EXPECT_LT(error, 5 * std::sqrt(references[i].world.covariance.diagonal().tail<3>().sum())) << s.references[i].name;
  }
  ASSERT_GE(localized, 3);
  const Matrix6d of_camera = ImageWorldCovariance(s, s.images[5]);
  EXPECT_TRUE(of_camera.isApprox(cameras[5].covariance, 1e-9));
  std::vector<SolutionFunction> functions;
  for (int pose : poses) functions.push_back(WorldPose(s, pose));
  const Eigen::MatrixXd joint = SolutionCovariance(s, false, 2, {}).Of(functions);
  for (size_t i = 0; i < poses.size(); ++i) {
    const auto at = 6 * static_cast<Eigen::Index>(i);
    EXPECT_TRUE((joint.block<6, 6>(at, at).isApprox(WorldCovariance(s, poses[i]), 1e-6))) << i;
  }
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(joint, Eigen::EigenvaluesOnly).eigenvalues()(0),
            -1e-12 * joint.trace());
  // They hang on one fit to the Earth, so that what is between two of them is known better than either.
  const Eigen::Matrix3d a = joint.block<3, 3>(15, 15), b = joint.block<3, 3>(21, 21), ab = joint.block<3, 3>(15, 21);
  EXPECT_LT((a + b - ab - ab.transpose()).trace(), (a + b).trace());
}

}  // namespace
}  // namespace trigpoint
