// What two things of a scene are known against each other.
#include "eval/scene/scene_pairs.h"

#include <gtest/gtest.h>

#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "tests/datasets/sample_solution.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

class ScenePairsTest : public testing::Test {
 protected:
  ScenePairsTest() : project_(Project::Open(folder_.dir())), solution_(MakeSolution()) {
    // Names that tell images apart; the sample's are for escaping.
    for (size_t i = 0; i < solution_.images.size(); ++i) solution_.images[i].name = std::to_string(i) + ".jpg";
    const std::filesystem::path dir = project_.ResultDir("localize", "run1");
    std::filesystem::create_directories(dir);
    AddCovariances(&solution_, 1, {});
    WriteSolution(solution_, dir / kSolutionFile);
  }
  SceneThing Camera(size_t image) const {
    return {SceneThing::Kind::kCamera, "run1", solution_.images[image].name,
            OdomFromCam(solution_, solution_.images[image]).translation};
  }
  std::optional<Eigen::Matrix3d> Between(const SceneThing& a, const SceneThing& b) const {
    return pairs_.Between(project_, "", false, a, b);
  }

  ProjectFolder folder_;
  Project project_;
  Solution solution_;
  mutable ScenePairs pairs_;
};

TEST_F(ScenePairsTest, CamerasOfOneMomentAreKnownByTheirMount) {
  // Image 6 and 7: the two cameras of one body pose. Their distance is the rig's, which is exact.
  const auto between = Between(Camera(6), Camera(7));
  ASSERT_TRUE(between);
  const Eigen::Vector3d along = (Camera(7).position - Camera(6).position).normalized();
  const Matrix6d own = OdomCovariance(solution_, solution_.images[6].pose);
  const double variance = own.bottomRightCorner(3, 3).trace();
  EXPECT_LT(along.dot(*between * along), 1e-6 * variance);
}

TEST_F(ScenePairsTest, IsThatOfTheJointCovariance) {
  const auto between = Between(Camera(4), Camera(10));
  ASSERT_TRUE(between);
  Eigen::MatrixXd centre(3, 6);
  centre << Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Identity();
  const auto pose = [&](size_t i) {
    const SolutionImage& image = solution_.images[i];
    return centre * OdomPose(solution_, image.pose, BodyFromCam(solution_, image));
  };
  const Eigen::MatrixXd joint = SolutionCovariance(solution_, true, 1, {}).Of({pose(4), pose(10)});
  const Eigen::Matrix3d expected = joint.topLeftCorner<3, 3>() + joint.bottomRightCorner<3, 3>() -
                                   joint.topRightCorner<3, 3>() - joint.bottomLeftCorner<3, 3>();
  EXPECT_LT((*between - expected).norm(), 1e-6 * expected.norm());
}

TEST_F(ScenePairsTest, NothingIsSaidOfOtherPairsAndOfPlacesThatMoved) {
  SceneThing other = Camera(6);
  other.run = "run2";
  EXPECT_FALSE(Between(Camera(4), other));
  SceneThing tag = Camera(6);
  tag.kind = SceneThing::Kind::kTag;
  EXPECT_FALSE(Between(Camera(4), tag));
  SceneThing moved = Camera(6);
  moved.position.x() += 0.1;
  EXPECT_FALSE(Between(Camera(4), moved));
  SceneThing unknown = Camera(6);
  unknown.name = "none.jpg";
  EXPECT_FALSE(Between(Camera(4), unknown));
}

TEST_F(ScenePairsTest, ASolutionIsReadAndFactoredOnceUntilItIsMadeAgain) {
  const auto first = Between(Camera(4), Camera(10));
  ASSERT_TRUE(first);
  // Another content in a file that looks the same: it is not opened.
  const std::filesystem::path file = project_.ResultDir("localize", "run1") / kSolutionFile;
  const auto written = std::filesystem::last_write_time(file);
  const std::string damaged(std::filesystem::file_size(file), ' ');
  folder_.Write("results/localize/run1/" + std::string(kSolutionFile), damaged);
  std::filesystem::last_write_time(file, written);
  EXPECT_EQ(Between(Camera(4), Camera(10)), first);
  EXPECT_TRUE(Between(Camera(2), Camera(8)));
  std::filesystem::last_write_time(file, written + std::chrono::seconds(1));
  EXPECT_THROW(Between(Camera(4), Camera(10)), Error);
  WriteSolution(solution_, file);
  EXPECT_EQ(Between(Camera(4), Camera(10)), first);
}

}  // namespace
}  // namespace trigpoint
