// Rows of panoramas.csv from a solution: where a set lies whose photos were answered one by one, and how surely.
#include "datasets/solution/reference_rows.h"

#include <gtest/gtest.h>

#include "datasets/solution/solution_covariance.h"
#include "tests/datasets/sample_solution.h"

namespace trigpoint {
namespace {

// A photo of set "photos/a" at a place of odom, that looks along `azimuth_rad` in plan.
void AddPhoto(const Eigen::Vector3d& place, double azimuth_rad, double sigma_m, Solution* s) {
  const Eigen::Vector3d ahead(std::cos(azimuth_rad), std::sin(azimuth_rad), 0);
  Eigen::Matrix3d axes;
  axes << ahead.cross(Eigen::Vector3d::UnitZ()), -Eigen::Vector3d::UnitZ(), ahead;
  SolutionReference& photo = s->references.emplace_back();
  photo.row = "photos/a", photo.status = "localized";
  photo.pose = static_cast<int>(s->problem.poses.size());
  s->problem.poses.push_back(Rigid3d(Eigen::Quaterniond(axes), place).Inverse());
  s->covariances.push_back(sigma_m * sigma_m * Matrix6d::Identity());
  s->georeference->with_poses.emplace_back(Eigen::Matrix<double, 6, 7>::Zero());
}

Solution WithoutReferences() {
  Solution s = MakeSolution();
  s.references.clear();
  return s;
}

double SigmaOf(const Solution& s) {
  const Matrix6d covariance = OdomCovariance(s, ReferenceRows(s).front());
  return std::sqrt(covariance.diagonal().tail<3>().maxCoeff());
}

TEST(ReferenceRows, APanoramaIsAsItsPoseIs) {
  const Solution s = MakeSolution();
  const std::vector<ReferenceRow> rows = ReferenceRows(s);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_TRUE(rows[0].localized.empty());
  const ReferenceRow& row = rows[1];
  EXPECT_EQ(row.name, "photos/a");
  EXPECT_EQ(row.localized, std::vector<size_t>{1});
  EXPECT_EQ(row.centre_sigma_m, 0);
  EXPECT_EQ(row.odom_from_pano.translation, OdomFromRig(s, 6).translation);
  EXPECT_EQ(WorldCovariance(s, row), WorldCovariance(s, 6));
}

TEST(ReferenceRows, ASetIsTheMeanOfItsPhotos) {
  Solution s = WithoutReferences();
  s.references.emplace_back().row = "photos/a", s.references.back().status = "unmatched";
  AddPhoto({1, 2, 0}, 0, 0.01, &s);
  AddPhoto({1.2, 2, 0.3}, 0, 0.01, &s);
  const ReferenceRow row = ReferenceRows(s).front();
  EXPECT_EQ(row.references.size(), 3U);
  EXPECT_EQ(row.shown, 1U);
  EXPECT_TRUE(row.odom_from_pano.translation.isApprox(Eigen::Vector3d(1.1, 2, 0.15)));
  EXPECT_EQ(row.odom_from_pano.rotation.coeffs(), OdomFromRig(s, s.references[1].pose).rotation.coeffs());
}

// Photos that look the same way lie on the same side of the centre, those that look about all balance.
TEST(ReferenceRows, ASetIsKnownAsItsPhotosLookAbout) {
  Solution one_way = WithoutReferences(), about = WithoutReferences();
  for (int k = 0; k < 8; ++k) {
    AddPhoto({1, 2, 0}, 0.1 * k, 0.01, &one_way);
    AddPhoto({1, 2, 0}, 0.25 * EIGEN_PI * k, 0.01, &about);
  }
  EXPECT_GT(SigmaOf(one_way), 0.9 * kHeld_m);
  EXPECT_LT(SigmaOf(about), 0.4 * kHeld_m);
}

TEST(ReferenceRows, PhotosThatDifferAreInTheSigma) {
  Solution s = WithoutReferences();
  AddPhoto({0, 0, 0}, 0, 0.01, &s);
  AddPhoto({2, 0, 0}, EIGEN_PI, 0.01, &s);
  EXPECT_GT(SigmaOf(s), 0.5);
}

}  // namespace
}  // namespace trigpoint
