#include "datasets/solution/solution_covariance.h"

#include "calib/base/error.h"
#include "calib/geometry/similarity.h"

namespace trigpoint {
namespace {

BundleProblem WithFreeScale(BundleProblem problem, bool free_scale) {
  for (OdometryScale& scale : problem.scales) {
    if (!scale.constant) continue;  // what lies in the world shows the length
    scale.constant = !free_scale;
    scale.prior = scale.value;
  }
  return problem;
}

// d world_from_rig / d odom_from_rig, and by the georeference's similarity.
struct WorldJacobians {
  Matrix6d by_pose;
  Eigen::Matrix<double, 6, 7> by_similarity;
};

WorldJacobians JacobiansOf(const Solution& solution, const Rigid3d& odom_from_x) {
  if (!solution.georeference) throw Error("a covariance in the world needs a solution with a georeference");
  WorldJacobians j;
  SimilarityJacobians(solution.georeference->world_from_odom, odom_from_x, &j.by_pose, &j.by_similarity);
  return j;
}

// d frame_from_x / d frame_from_rig: what is mounted moves with the rig's rotation.
Matrix6d MountedJacobian(const Rigid3d& frame_from_rig, const Rigid3d& rig_from_x) {
  Matrix6d j = Matrix6d::Identity();
  j.bottomLeftCorner<3, 3>() = -Skew(frame_from_rig.rotation * rig_from_x.translation);
  return j;
}

}  // namespace

SolutionFunction OdomPose(const Solution& solution, int pose, const Rigid3d& rig_from_x) {
  return {{{pose, MountedJacobian(OdomFromRig(solution, pose), rig_from_x)}}, {}};
}

SolutionFunction WorldPose(const Solution& solution, int pose, const Rigid3d& rig_from_x) {
  const Rigid3d odom_from_rig = OdomFromRig(solution, pose);
  const WorldJacobians j = JacobiansOf(solution, odom_from_rig * rig_from_x);
  return {{{pose, j.by_pose * MountedJacobian(odom_from_rig, rig_from_x)}}, j.by_similarity};
}

SolutionFunction operator*(const Eigen::MatrixXd& d, const SolutionFunction& f) {
  SolutionFunction out;
  for (const auto& [pose, by] : f.by_pose) out.by_pose.emplace_back(pose, d * by);
  if (f.by_similarity.size() > 0) out.by_similarity = d * f.by_similarity;
  return out;
}

SolutionFunction operator+(const SolutionFunction& a, const SolutionFunction& b) {
  SolutionFunction out = a;
  out.by_pose.insert(out.by_pose.end(), b.by_pose.begin(), b.by_pose.end());
  if (out.by_similarity.size() == 0) {
    out.by_similarity = b.by_similarity;
  } else if (b.by_similarity.size() > 0) {
    out.by_similarity += b.by_similarity;
  }
  return out;
}

SolutionCovariance::SolutionCovariance(const Solution& solution, bool free_scale, int threads,
                                       const CancelToken& cancel)
    : solution_(solution), covariance_(WithFreeScale(solution.problem, free_scale), threads, cancel) {}

Eigen::MatrixXd SolutionCovariance::Of(const std::vector<SolutionFunction>& functions) const {
  const std::vector<Rigid3d>& poses = solution_.problem.poses;
  std::vector<Eigen::Index> begin = {0};  // of each function's values
  for (const SolutionFunction& f : functions) begin.push_back(begin.back() + f.by_pose.front().second.rows());
  const auto each = [&](size_t from, size_t to, const auto& use) {
    for (size_t f = from; f < to; ++f) {
      for (const auto& [pose, d] : functions[f].by_pose) {
        use(f, 6 * static_cast<Eigen::Index>(pose), d * InverseJacobian(poses[static_cast<size_t>(pose)]));
      }
    }
  };
  // Functions at a time: their derivatives by all poses are a dense matrix.
  constexpr Eigen::Index kMostColumns = 300;
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(begin.back(), begin.back());
  for (size_t first = 0, end = 0; first < functions.size(); first = end) {
    while (end < functions.size() && (end == first || begin[end + 1] - begin[first] <= kMostColumns)) ++end;
    Eigen::MatrixXd of_poses =
        Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(poses.size()), begin[end] - begin[first]);
    each(first, end, [&](size_t f, Eigen::Index row, const Eigen::MatrixXd& d) {
      of_poses.block(row, begin[f] - begin[first], 6, d.rows()) += d.transpose();
    });
    of_poses = covariance_.Times(of_poses);
    each(0, functions.size(), [&](size_t f, Eigen::Index row, const Eigen::MatrixXd& d) {
      c.block(begin[f], begin[first], d.rows(), of_poses.cols()) += d * of_poses.middleRows<6>(row);
    });
  }
  // By the similarity, and with the poses that it was fitted to.
  if (solution_.georeference) {
    const SolutionGeoreference& geo = *solution_.georeference;
    Eigen::MatrixXd by = Eigen::MatrixXd::Zero(c.rows(), 7), with = by;
    for (size_t f = 0; f < functions.size(); ++f) {
      const auto rows = [&](Eigen::MatrixXd& m) { return m.middleRows(begin[f], begin[f + 1] - begin[f]); };
      if (functions[f].by_similarity.size() > 0) rows(by) = functions[f].by_similarity;
      for (const auto& [pose, d] : functions[f].by_pose) rows(with) += d * geo.with_poses[static_cast<size_t>(pose)];
    }
    c += by * geo.covariance * by.transpose() + with * by.transpose() + by * with.transpose();
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
  const auto [by_pose, by_similarity] = JacobiansOf(solution, OdomFromRig(solution, pose));
  const SolutionGeoreference& geo = *solution.georeference;
  const Matrix6d cross = by_pose * geo.with_poses[static_cast<size_t>(pose)] * by_similarity.transpose();
  return by_pose * OdomCovariance(solution, pose) * by_pose.transpose() +
         by_similarity * geo.covariance * by_similarity.transpose() + cross + cross.transpose();
}

Matrix6d ImageWorldCovariance(const Solution& solution, const SolutionImage& image) {
  const Rigid3d world_from_body =
      solution.georeference->world_from_odom.TransformPose(OdomFromRig(solution, image.pose));
  const Matrix6d j = MountedJacobian(world_from_body, BodyFromCam(solution, image));
  return j * WorldCovariance(solution, image.pose) * j.transpose();
}

}  // namespace trigpoint
