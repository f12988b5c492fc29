#include "eval/truth/reference_poses.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/camchain.h"
#include "eval/truth/chain_solver.h"
#include "survey/tags/planar_pose.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

constexpr double kNsPerSecond = 1e9;

double SideOf(const TagDetection& d) {
  double side = (d.corners[0] - d.corners[3]).norm();
  for (size_t k = 1; k < 4; ++k) side = std::min(side, (d.corners[k] - d.corners[k - 1]).norm());
  return side;
}

// The run as bodies, tags and what ties them.
class Builder {
 public:
  Builder(const ReferencePoseInput& input, const ReferencePoseOptions& options) : input_(input), options_(options) {
    AddBodies();
    AddTags();
    AddObservations();
    AddMotion();
    Start();
  }
  ChainProblem& problem() { return problem_; }
  const std::vector<int>& tag_ids() const { return tag_ids_; }
  int BodyOf(const ImageEntry& image) const { return BodyAt(MomentOf(image)); }
  // Along the path to the next body with a tag; infinite if the motion does not lead to one.
  std::vector<double> Bridges() const {
    const double kFar = std::numeric_limits<double>::infinity();
    std::vector<double> bridge(stamps_.size(), kFar);
    for (const ChainObservation& s : problem_.observations) {
      if (!s.rejected) bridge[static_cast<size_t>(s.body)] = 0;
    }
    for (const ChainMotion& m : problem_.motions) {
      bridge[static_cast<size_t>(m.b)] =
          std::min(bridge[static_cast<size_t>(m.b)], bridge[static_cast<size_t>(m.a)] + m.a_from_b.translation.norm());
    }
    for (auto m = problem_.motions.rbegin(); m != problem_.motions.rend(); ++m) {
      bridge[static_cast<size_t>(m->a)] = std::min(bridge[static_cast<size_t>(m->a)],
                                                   bridge[static_cast<size_t>(m->b)] + m->a_from_b.translation.norm());
    }
    return bridge;
  }
  // Of an image that sees `tags` tags and is `bridge_m` from the next that sees one.
  ReferencePose PoseOf(const ImageEntry& image, int tags, double bridge_m, const ChainSolution& solution) const {
    ReferencePose pose;
    pose.stamp_ns = image.stamp_ns;
    pose.image = image.file;
    const bool known = image.camera >= 0 && static_cast<size_t>(image.camera) < input_.cameras.size();
    const Rigid3d body_from_cam =
        known ? input_.cameras[static_cast<size_t>(image.camera)].cam_from_body.Inverse() : Rigid3d();
    pose.camera = known ? input_.cameras[static_cast<size_t>(image.camera)].name : "";
    const auto i = static_cast<size_t>(BodyOf(image));
    pose.tags = tags;
    pose.bridged_m = bridge_m;
    pose.status = pose.tags > 0 ? "tags" : "bridged";
    if (!std::isfinite(bridge_m)) {
      pose.status = "none";
      pose.reason = "sees no tag of the map, and no motion ties it to an image that does";
      pose.bridged_m = 0;
    } else if (bridge_m > options_.max_bridge_m) {
      pose.status = "none";
      pose.reason = fmt::format("{:.1f} m along the path from the next image with a tag, more than {:g} m", bridge_m,
                                options_.max_bridge_m);
    } else {
      if (pose.tags == 0) pose.reason = fmt::format("no tag in it; {:.2f} m of motion from one that has", bridge_m);
      const Rigid3d& body = problem_.bodies[i];
      pose.world_from_cam = body * body_from_cam;
      Matrix6d j = Matrix6d::Identity();
      j.bottomLeftCorner<3, 3>() = -Skew(body.rotation * body_from_cam.translation);
      pose.covariance = j * solution.body_covariance[i] * j.transpose();
    }
    return pose;
  }

 private:
  // The moment that an image shows, on the clock of the motion.
  int64_t MomentOf(const ImageEntry& image) const {
    const bool known = image.camera >= 0 && static_cast<size_t>(image.camera) < input_.cameras.size();
    return known ? BodyStamp(image.stamp_ns, input_.cameras[static_cast<size_t>(image.camera)]) : image.stamp_ns;
  }
  // -1: there is no body then.
  int BodyAt(int64_t moment_ns) const {
    const auto it = bodies_.find(moment_ns);
    return it == bodies_.end() ? -1 : it->second;
  }
  const BodyCamera* CameraNamed(const std::string& name) const {
    const auto camera =
        std::find_if(input_.cameras.begin(), input_.cameras.end(), [&](const BodyCamera& c) { return c.name == name; });
    return camera == input_.cameras.end() ? nullptr : &*camera;
  }

  void AddBodies() {
    std::set<int64_t> stamps;
    for (const ImageEntry& image : input_.images) stamps.insert(MomentOf(image));
    for (const ImageDetections& image : input_.detections) {
      if (const BodyCamera* camera = CameraNamed(image.camera)) stamps.insert(BodyStamp(image.stamp_ns, *camera));
    }
    stamps_.assign(stamps.begin(), stamps.end());
    for (size_t i = 0; i < stamps_.size(); ++i) bodies_[stamps_[i]] = static_cast<int>(i);
    problem_.bodies.resize(stamps_.size());
  }

  void AddTags() {
    std::vector<const TagResult*> used;
    for (const TagResult& tag : input_.tags) {
      if (!tag.map_from_tag || !tag.map_from_tag->IsFinite()) continue;
      tag_index_[tag.tag_id] = static_cast<int>(used.size());
      tag_ids_.push_back(tag.tag_id);
      sizes_.push_back(tag.size_m > 0 ? tag.size_m : input_.sizes.SizeOf(tag.tag_id));
      problem_.tags.push_back(*tag.map_from_tag);
      used.push_back(&tag);
    }
    // What is exact in the map still needs a finite weight.
    constexpr double kExact[2] = {1e-5, 1e-5};
    const auto n = static_cast<Eigen::Index>(used.size());
    problem_.tag_covariance = Eigen::MatrixXd::Zero(6 * n, 6 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const TagResult& tag = *used[static_cast<size_t>(i)];
      Matrix6d c = Matrix6d::Zero();
      if (tag.covariance && tag.covariance->allFinite()) {
        c = *tag.covariance;
      } else if (tag.sigma_m) {
        c.bottomRightCorner<3, 3>() = tag.sigma_m->cwiseAbs2().asDiagonal();
        if (tag.sigma_rot_rad) {
          const Eigen::Matrix3d r = tag.map_from_tag->rotation.toRotationMatrix();
          c.topLeftCorner<3, 3>() = r * tag.sigma_rot_rad->cwiseAbs2().asDiagonal() * r.transpose();
        }
      }
      for (int k = 0; k < 6; ++k) c(k, k) += kExact[k / 3] * kExact[k / 3];
      problem_.tag_covariance.block<6, 6>(6 * i, 6 * i) = c;
      for (Eigen::Index j = 0; j < i; ++j) {
        const int a = tag.tag_id, b = used[static_cast<size_t>(j)]->tag_id;
        const auto it = input_.cross.find({std::min(a, b), std::max(a, b)});
        if (it == input_.cross.end()) continue;
        const Matrix6d ab = a < b ? it->second : Matrix6d(it->second.transpose());
        problem_.tag_covariance.block<6, 6>(6 * i, 6 * j) = ab;
        problem_.tag_covariance.block<6, 6>(6 * j, 6 * i) = ab.transpose();
      }
    }
  }

  void AddObservations() {
    for (const ImageDetections& image : input_.detections) {
      const BodyCamera* camera = CameraNamed(image.camera);
      if (camera == nullptr) continue;
      const int body = BodyAt(BodyStamp(image.stamp_ns, *camera));
      for (const TagDetection& d : image.detections) {
        const auto tag = tag_index_.find(d.id);
        if (tag == tag_index_.end() || SideOf(d) < options_.min_side_px) continue;
        const double size = sizes_[static_cast<size_t>(tag->second)];
        if (!(size > 0)) throw InputError(fmt::format("tag {} has no size; give it in tags.yaml", d.id));
        ChainObservation o;
        o.sight = MakeTagSight(camera->camera, d, options_.extra_sigma_px);
        o.size_m = size;
        o.cam_from_body = camera->cam_from_body;
        o.body = body;
        o.tag = tag->second;
        problem_.observations.push_back(std::move(o));
      }
    }
  }

  void AddMotion() {
    const auto max_gap = static_cast<int64_t>(options_.max_gap_s * kNsPerSecond);
    for (size_t i = 0; i < stamps_.size(); ++i) odom_.push_back(input_.motion.At(stamps_[i], max_gap));
    for (size_t i = 1; i < stamps_.size(); ++i) {
      if (!odom_[i - 1] || !odom_[i]) continue;
      ChainMotion m;
      m.a = static_cast<int>(i) - 1;
      m.b = static_cast<int>(i);
      m.a_from_b = odom_[i - 1]->Inverse() * *odom_[i];
      const double seconds = static_cast<double>(stamps_[i] - stamps_[i - 1]) / kNsPerSecond;
      const double root = std::sqrt(std::max(1e-6, m.a_from_b.translation.norm() + 0.01 * seconds));
      m.sigma_rot_rad = options_.motion_rot_deg * kDegToRad * root;
      m.sigma_m = options_.motion_m * root;
      problem_.motions.push_back(m);
    }
    problem_.scale_sigma = input_.scale_sigma;
  }

  // Each detection gives two poses of its body, each a guess of world_from_odom. The one that agrees with most of the
  // detections around it is taken; bodies without a detection get the motion from the nearest body that has one.
  void Start() {
    struct Guess {
      size_t sight;
      Rigid3d world_from_body;
    };
    const std::vector<ChainObservation>& seen = problem_.observations;
    std::vector<std::vector<Guess>> guesses(stamps_.size());
    for (size_t s = 0; s < seen.size(); ++s) {
      for (const PlanarPose& p : EstimatePlanarPoses(seen[s].sight, seen[s].size_m)) {
        const Rigid3d body =
            problem_.tags[static_cast<size_t>(seen[s].tag)] * p.cam_from_tag.Inverse() * seen[s].cam_from_body;
        guesses[static_cast<size_t>(seen[s].body)].push_back({s, body});
      }
    }
    constexpr size_t kAround = 20;  // detections on each side
    constexpr double kAgreePx = 30;
    std::vector<std::optional<Rigid3d>> best(stamps_.size());
    for (size_t i = 0; i < stamps_.size(); ++i) {
      double best_votes = -1;
      for (const Guess& g : guesses[i]) {
        const size_t first = g.sight > kAround ? g.sight - kAround : 0;
        const size_t last = std::min(seen.size(), g.sight + kAround + 1);
        double votes = 0;
        for (size_t s = first; s < last; ++s) {
          const auto j = static_cast<size_t>(seen[s].body);
          if (j != i && (!odom_[i] || !odom_[j])) continue;
          const Rigid3d body = j == i ? g.world_from_body : g.world_from_body * (odom_[i]->Inverse() * *odom_[j]);
          const Rigid3d cam_from_tag =
              seen[s].cam_from_body * body.Inverse() * problem_.tags[static_cast<size_t>(seen[s].tag)];
          if (!TagFaces(seen[s].sight, seen[s].size_m, cam_from_tag)) continue;
          const double px =
              ResidualPx(seen[s].sight, TagResidual(seen[s].sight, seen[s].size_m, seen[s].cam_from_body, body,
                                                    problem_.tags[static_cast<size_t>(seen[s].tag)]));
          votes += 1 / (1 + px * px / (kAgreePx * kAgreePx));
        }
        if (votes > best_votes) best_votes = votes, best[i] = g.world_from_body;
      }
    }
    for (size_t i = 0; i < stamps_.size(); ++i) {
      if (best[i]) {
        problem_.bodies[i] = *best[i];
        continue;
      }
      size_t nearest = stamps_.size();
      int64_t apart = std::numeric_limits<int64_t>::max();
      for (size_t j = 0; j < stamps_.size(); ++j) {
        const int64_t d = std::abs(stamps_[j] - stamps_[i]);
        if (best[j] && odom_[j] && d < apart) apart = d, nearest = j;
      }
      if (nearest < stamps_.size() && odom_[i]) {
        problem_.bodies[i] = *best[nearest] * (odom_[nearest]->Inverse() * *odom_[i]);
      } else if (i > 0) {
        problem_.bodies[i] = problem_.bodies[i - 1];
      }
    }
    // A body that neither a tag nor the motion constrains is held fixed; it gets no pose in the result.
    const std::vector<double> bridge = Bridges();
    problem_.free.resize(stamps_.size());
    for (size_t i = 0; i < stamps_.size(); ++i) problem_.free[i] = std::isfinite(bridge[i]);
  }

  const ReferencePoseInput& input_;
  const ReferencePoseOptions& options_;
  ChainProblem problem_;
  std::vector<int64_t> stamps_;
  std::map<int64_t, int> bodies_;
  std::map<int, int> tag_index_;
  std::vector<int> tag_ids_;
  std::vector<double> sizes_;
  std::vector<std::optional<Rigid3d>> odom_;
};

ReferencePoses NoPoses(const ReferencePoseInput& input, const std::string& reason) {
  ReferencePoses result;
  result.warnings.push_back(reason + ": no pose can be given");
  for (const ImageEntry& image : input.images) {
    ReferencePose pose;
    pose.stamp_ns = image.stamp_ns;
    pose.image = image.file;
    const auto camera = static_cast<size_t>(std::max(0, image.camera));
    if (camera < input.cameras.size()) pose.camera = input.cameras[camera].name;
    pose.status = "none";
    pose.reason = reason;
    result.poses.push_back(std::move(pose));
  }
  return result;
}

}  // namespace

ReferencePoses EstimateReferencePoses(const ReferencePoseInput& input, const ReferencePoseOptions& options,
                                      ProgressSink& progress, const CancelToken& cancel) {
  for (const std::string& problem : options.Check()) throw OptionError(problem);
  Builder builder(input, options);
  ChainProblem& problem = builder.problem();
  if (problem.observations.empty()) return NoPoses(input, "no image of the run sees a tag of the map");
  const ChainOptions chain{options.gate_chi2, options.variance_rounds, options.max_iterations};
  const ChainSolution solution = SolveChain(&problem, chain, progress, cancel);

  ReferencePoses result;
  result.scale = problem.scale;
  result.scale_sigma = solution.scale_sigma;
  result.corner_factor = problem.corner_factor;
  result.motion_rot_factor = problem.motion_rot_factor;
  result.motion_m_factor = problem.motion_m_factor;
  std::vector<int> tags_of_body(problem.bodies.size(), 0);
  std::set<int> used;
  double squares = 0;
  for (const ChainObservation& s : problem.observations) {
    if (s.rejected) {
      ++result.rejected;
      continue;
    }
    ++result.sights;
    ++tags_of_body[static_cast<size_t>(s.body)];
    used.insert(builder.tag_ids()[static_cast<size_t>(s.tag)]);
    squares += std::pow(s.rms_px, 2);
  }
  if (result.sights == 0) {
    return NoPoses(input, "every picture of a tag contradicts the map; is it of this site and epoch?");
  }
  result.tags_used.assign(used.begin(), used.end());
  result.rms_px = std::sqrt(squares / result.sights);
  if (result.rejected > 0) {
    result.warnings.push_back(
        fmt::format("{} of {} pictures of tags contradict the map and the run's motion and are "
                    "left out",
                    result.rejected, result.rejected + result.sights));
  }
  const std::vector<double> bridge = builder.Bridges();
  for (const ImageEntry& image : input.images) {
    const auto i = static_cast<size_t>(builder.BodyOf(image));
    result.poses.push_back(builder.PoseOf(image, tags_of_body[i], bridge[i], solution));
  }
  return result;
}

}  // namespace trigpoint
