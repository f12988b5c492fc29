// The covariance of answers less what the run's own tags give, against derivatives by differences of the whole way:
// poses of cameras, tags estimated from them, the centre that a tag gives, the fit to the Earth.
#include "eval/errors/answer_covariance.h"

#include <gtest/gtest.h>

#include "datasets/solution/solution_covariance.h"
#include "eval/errors/stations.h"
#include "survey/tags/planar_pose.h"
#include "survey/tags/tag_poses.h"
#include "tests/datasets/sample_solution.h"

namespace trigpoint {
namespace {

constexpr double kSize = 1;

struct OwnTag {
  Solution solution = MakeSolution();
  std::vector<TagView> views;  // of the first camera, in the order of its images
  std::vector<int> images;
  std::vector<Station> stations{{.name = "photos/a", .tag_id = 3, .offset_m = {0.3, 0.9, -0.4}, .in_tag_frame = true}};

  OwnTag() {
    solution.references[1].station = "photos/a";
    AddCovariances(&solution, 1, {});
    // Upright, so that offsets turn with the heading alone.
    solution.georeference->world_from_odom.rotation = ExpSO3({0, 0, 1.5});
    solution.georeference->world_from_odom.scale = 1;
    Eigen::Matrix3d facing;  // a reader who looks along x of odom
    facing << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    const Rigid3d odom_from_tag(Eigen::Quaterniond(facing) * ExpSO3({0, 0.3, 0}), {8, 0.5, 0.3});
    for (size_t i = 0; i < solution.images.size(); ++i) {
      if (solution.images[i].camera != 0) continue;
      TagView view;
      view.camera = &solution.cameras[0].camera;
      view.world_from_cam = OdomFromCam(solution, solution.images[i]);
      TagDetection d;
      d.id = 3;
      for (int k = 0; k < 4; ++k) {
        d.corners[static_cast<size_t>(k)] =
            view.camera->Project(view.world_from_cam.Inverse() * (odom_from_tag * TagCorner(kSize, k))).value();
      }
      d.corner_sigma_px.fill(0.2);
      view.detections = {d};
      views.push_back(view);
      images.push_back(static_cast<int>(i));
    }
  }
  TagEstimate Estimate() const {
    TagSizes sizes;
    sizes.size_m = kSize;
    ProgressSink quiet;
    return EstimateTagPoses(views, sizes, {}, 1, quiet, {}).at(0);
  }
  // The answer less its station by the tag, for poses moved in odom and a similarity moved. With the scale, centres of
  // cameras move; the tag keeps its size.
  Eigen::Vector3d Difference(const std::vector<Rigid3d>& odom_from_rig, const Sim3d& world_from_odom) {
    for (size_t v = 0; v < views.size(); ++v) {
      const SolutionImage& image = solution.images[static_cast<size_t>(images[v])];
      views[v].world_from_cam =
          world_from_odom.TransformPose(odom_from_rig[static_cast<size_t>(image.pose)] * BodyFromCam(solution, image));
    }
    const Rigid3d tag = *Estimate().world_from_tag;
    std::string reason;
    return world_from_odom * odom_from_rig[6].translation -
           StationCentre(stations[0], tag, Eigen::Matrix3d::Identity(), Eigen::Vector3d::UnitZ(), &reason).value();
  }
};

TEST(AnswerCovariance, FollowsTheTagsThatTheRunsOwnCamerasGive) {
  OwnTag own;
  const Solution& s = own.solution;
  const TagEstimate tag = own.Estimate();
  ASSERT_EQ(tag.status, "ok");
  ASSERT_EQ(tag.views.size(), 6u);
  TagDerivatives by_camera;
  for (size_t k = 0; k < tag.views.size(); ++k) {
    by_camera[3].emplace_back(own.images[static_cast<size_t>(tag.views[k])], tag.by_camera[k]);
  }
  TagResult known;
  known.tag_id = 3;
  known.map_from_tag = tag.world_from_tag;
  const AnswerCovariances got = CovariancesOfAnswers(s, {known}, by_camera, own.stations, 2, {});

  std::vector<Rigid3d> poses;
  std::vector<SolutionFunction> all;
  for (size_t p = 0; p < s.problem.poses.size(); ++p) {
    poses.push_back(OdomFromRig(s, static_cast<int>(p)));
    all.push_back(OdomPose(s, static_cast<int>(p)));
  }
  const Sim3d fit = s.georeference->world_from_odom;
  const auto n = 6 * static_cast<Eigen::Index>(poses.size());
  Eigen::MatrixXd by(3, n + 7), joint(n + 7, n + 7);
  constexpr double kStep = 1e-4;
  for (Eigen::Index column = 0; column < n + 7; ++column) {
    const auto moved = [&](double step) {
      std::vector<Rigid3d> p = poses;
      Sim3d f = fit;
      if (column < n) {
        Rigid3d& pose = p[static_cast<size_t>(column / 6)];
        pose = pose.Plus(step * Vector6d::Unit(column % 6));
      } else {
        Eigen::Matrix<double, 7, 1> d = Eigen::Matrix<double, 7, 1>::Zero();
        d(column - n) = step;
        f.rotation = ExpSO3(d.head<3>()) * f.rotation;
        f.translation += d.segment<3>(3);
        f.scale += d(6);
      }
      return own.Difference(p, f);
    };
    by.col(column) = (moved(kStep) - moved(-kStep)) / (2 * kStep);
  }
  joint.topLeftCorner(n, n) = SolutionCovariance(s, false, 1, {}).Of(all);
  for (size_t p = 0; p < poses.size(); ++p) {
    joint.block(6 * static_cast<Eigen::Index>(p), n, 6, 7) = s.georeference->with_poses[p];
  }
  joint.bottomLeftCorner(7, n) = joint.topRightCorner(n, 7).transpose();
  joint.bottomRightCorner(7, 7) = s.georeference->covariance;
  const Eigen::Matrix3d expected = by * joint * by.transpose();
  const auto relative = got.relative.Between("photos/a", "photos/a");
  ASSERT_TRUE(relative);
  EXPECT_LT((*relative - expected).norm(), 0.01 * expected.norm()) << *relative << "\n\n" << expected;

  const auto absolute = got.absolute.Between("photos/a", "photos/a");
  ASSERT_TRUE(absolute);
  EXPECT_TRUE(absolute->isApprox(WorldCovariance(s, 6).bottomRightCorner<3, 3>(), 1e-6));
  EXPECT_FALSE(got.absolute.Between("photos/a", "p0"));
}

TEST(AnswerCovariance, IsNotKnownWithoutAPlaceOnTheEarth) {
  OwnTag own;
  own.solution.georeference.reset();
  EXPECT_TRUE(CovariancesOfAnswers(own.solution, {}, {}, own.stations, 1, {}).absolute.at.empty());
}

}  // namespace
}  // namespace trigpoint
