#include "datasets/solution/solution_covariance.h"

#include "calib/base/error.h"
#include "calib/geometry/similarity.h"

namespace trigpoint {
namespace {

BundleProblem WithFreeScale(BundleProblem problem, bool free_scale) {
  problem.scale_constant = !free_scale;
  problem.scale_prior = problem.scale;
  return problem;
}

// d world_from_rig / d odom_from_rig, and by the georeference's similarity.
struct WorldJacobians {
  Matrix6d by_pose;
  Eigen::Matrix<double, 6, 7> by_similarity;
};

WorldJacobians JacobiansOf(const Solution& solution, int pose) {
  if (!solution.georeference) throw Error("a covariance in the world needs a solution with a georeference");
  WorldJacobians j;
  SimilarityJacobians(solution.georeference->world_from_odom,
                      solution.problem.poses[static_cast<size_t>(pose)].Inverse(), &j.by_pose, &j.by_similarity);
  return j;
}

}  // namespace

SolutionCovariance::SolutionCovariance(const Solution& solution, bool free_scale, int threads,
                                       const CancelToken& cancel)
    : solution_(solution), covariance_(WithFreeScale(solution.problem, free_scale), threads, cancel) {}

Eigen::MatrixXd SolutionCovariance::Odom(const std::vector<int>& poses) const {
  Eigen::MatrixXd c = covariance_.Joint(poses);
  for (size_t a = 0; a < poses.size(); ++a) {
    const Matrix6d j = InverseJacobian(solution_.problem.poses[static_cast<size_t>(poses[a])]);
    const auto at = 6 * static_cast<Eigen::Index>(a);
    c.middleRows<6>(at) = (j * c.middleRows<6>(at)).eval();
    c.middleCols<6>(at) = (c.middleCols<6>(at) * j.transpose()).eval();
  }
  return 0.5 * (c + c.transpose());
}

Eigen::MatrixXd SolutionCovariance::World(const std::vector<int>& poses) const {
  Eigen::MatrixXd c = Odom(poses);
  std::vector<WorldJacobians> jacobians;
  for (int pose : poses) jacobians.push_back(JacobiansOf(solution_, pose));
  const SolutionGeoreference& geo = *solution_.georeference;
  const auto with = [&](size_t a) -> const auto& { return geo.with_poses[static_cast<size_t>(poses[a])]; };
  for (size_t a = 0; a < poses.size(); ++a) {
    for (size_t b = 0; b < poses.size(); ++b) {
      auto block = c.block<6, 6>(6 * static_cast<Eigen::Index>(a), 6 * static_cast<Eigen::Index>(b));
      const auto& [pa, sa] = jacobians[a];
      const auto& [pb, sb] = jacobians[b];
      block = (pa * block * pb.transpose() + sa * geo.covariance * sb.transpose() + pa * with(a) * sb.transpose() +
               sa * with(b).transpose() * pb.transpose())
                  .eval();
    }
  }
  return 0.5 * (c + c.transpose());
}

void AddCovariances(Solution* solution, int threads, const CancelToken& cancel) {
  std::vector<Matrix6d> unused;
  BundleCovariance(solution->problem, threads, cancel).PoseBlocks({}, &solution->covariances, &unused);
}

Matrix6d OdomCovariance(const Solution& solution, int pose) {
  const auto i = static_cast<size_t>(pose);
  return InverseCovariance(solution.problem.poses[i], solution.covariances.at(i));
}

Matrix6d WorldCovariance(const Solution& solution, int pose) {
  const auto [by_pose, by_similarity] = JacobiansOf(solution, pose);
  const SolutionGeoreference& geo = *solution.georeference;
  const Matrix6d cross = by_pose * geo.with_poses[static_cast<size_t>(pose)] * by_similarity.transpose();
  return by_pose * OdomCovariance(solution, pose) * by_pose.transpose() +
         by_similarity * geo.covariance * by_similarity.transpose() + cross + cross.transpose();
}

Matrix6d MountedCovariance(const Rigid3d& frame_from_rig, const Matrix6d& covariance, const Rigid3d& rig_from_x) {
  // What is mounted moves with the rig's rotation.
  Matrix6d j = Matrix6d::Identity();
  j.bottomLeftCorner<3, 3>() = -Skew(frame_from_rig.rotation * rig_from_x.translation);
  return j * covariance * j.transpose();
}

}  // namespace trigpoint
