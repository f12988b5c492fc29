#include "survey/tags/tag_poses.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kHuberChi2 = 15.5;          // 95 % of chi-square with 8 degrees of freedom
constexpr size_t kMostHypothesisViews = 60;  // pictures that propose poses; all pictures judge them
constexpr double kTwinAngle = 0.2;           // rad; planar solutions nearer than this are one
constexpr double kAmbiguousChi2 = 9;         // cost that a twin must be worse by, in units of the variance factor

struct Sighting {
  int view = 0;
  TagSight sight;
  Rigid3d world_from_cam;
  bool has_covariance = false;
};

struct Hypothesis {
  Rigid3d world_from_tag;
  std::vector<int> inliers;  // positions in the list of sightings
  double score = 0;
};

const Rigid3d kIdentity;

Matrix6d SquareRoot(const Matrix6d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose();
}

class OneTag {
 public:
  OneTag(double size_m, const TagPosesOptions& options) : size_m_(size_m), options_(options) {}

  void Add(int index, const TagView& view, const TagDetection& detection) {
    Sighting s;
    s.view = index;
    s.sight = MakeTagSight(*view.camera, detection, options_.extra_sigma_px);
    s.world_from_cam = view.world_from_cam;
    if (view.covariance) {
      s.has_covariance = true;
      covariance_roots_.push_back(SquareRoot(*view.covariance));
    } else {
      covariance_roots_.push_back(Matrix6d::Zero());
    }
    sightings_.push_back(s);
  }

  bool empty() const { return sightings_.empty(); }

  void Estimate(const std::vector<TagView>& views, TagEstimate* out) {
    std::vector<int> all(sightings_.size());
    for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
    std::vector<Hypothesis> hypotheses = Hypotheses(all);
    if (hypotheses.empty()) {
      out->status = "unsolved";
      out->reason = "no planar pose from any picture";
      return;
    }
    Hypothesis best = hypotheses.front();
    Fit fit = Solve(best);
    out->world_from_tag = fit.world_from_tag;
    out->covariance = fit.covariance;
    out->by_camera = std::move(fit.by_camera);
    out->rms_px = fit.rms_px;
    std::set<std::string> runs;
    for (int i : fit.used) {
      out->views.push_back(sightings_[i].view);
      runs.insert(views[sightings_[i].view].run);
    }
    out->images = static_cast<int>(fit.used.size());
    out->runs = static_cast<int>(runs.size());
    out->rejected = static_cast<int>(sightings_.size() - fit.used.size());
    out->status = out->images < options_.min_images ? "weak" : "ok";
    if (out->status == "weak") out->reason = "seen in " + Counted(out->images, "picture");
    CheckTwin(hypotheses, fit, out);
    CheckSecondPlace(views, fit, runs, out);
  }

 private:
  struct Fit {
    Rigid3d world_from_tag;
    Matrix6d covariance = Matrix6d::Zero();
    double cost = 0;  // robust, whitened
    double variance_factor = 1;
    double rms_px = 0;
    std::vector<int> used;
    std::vector<Matrix6d> by_camera;  // of each used
  };

  double ErrorPx(const Sighting& s, const Rigid3d& world_from_tag) const {
    const Rigid3d cam_from_tag = s.world_from_cam.Inverse() * world_from_tag;
    if (!TagFaces(s.sight, size_m_, cam_from_tag)) return 1e9;
    return ResidualPx(s.sight, TagResidual(s.sight, size_m_, kIdentity, s.world_from_cam, world_from_tag));
  }

  // Every planar solution of the given sightings, judged by them; most explained first.
  std::vector<Hypothesis> Hypotheses(const std::vector<int>& members) const {
    std::vector<Hypothesis> found;
    const size_t step = (members.size() + kMostHypothesisViews - 1) / kMostHypothesisViews;
    for (size_t m = 0; m < members.size(); m += step) {
      const Sighting& s = sightings_[members[m]];
      for (const PlanarPose& pose : EstimatePlanarPoses(s.sight, size_m_)) {
        Hypothesis h;
        h.world_from_tag = s.world_from_cam * pose.cam_from_tag;
        for (int i : members) {
          const double e = ErrorPx(sightings_[i], h.world_from_tag) / options_.gate_px;
          if (e >= 1) continue;
          h.score += 1 - e * e;
          h.inliers.push_back(i);
        }
        if (!h.inliers.empty()) found.push_back(h);
      }
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
    return found;
  }

  struct Linear {
    Vector8d r;  // whitened, the cameras' covariance taken into the whitening
    Matrix86d by_tag, by_camera;
    Matrix86d camera_part = Matrix86d::Zero();  // by_camera times the root of the camera's covariance
  };

  Linear Linearise(int i, const Rigid3d& world_from_tag) const {
    const Sighting& s = sightings_[i];
    Linear l;
    l.r = TagResidual(s.sight, size_m_, kIdentity, s.world_from_cam, world_from_tag, &l.by_camera, &l.by_tag);
    if (!s.has_covariance) return l;
    l.camera_part = l.by_camera * covariance_roots_[i];
    const Eigen::Matrix<double, 8, 8> c =
        Eigen::Matrix<double, 8, 8>::Identity() + l.camera_part * l.camera_part.transpose();
    const Eigen::LLT<Eigen::Matrix<double, 8, 8>> llt(c);
    llt.matrixL().solveInPlace(l.r);
    for (Matrix86d* m : {&l.by_tag, &l.by_camera, &l.camera_part}) llt.matrixL().solveInPlace(*m);
    return l;
  }

  double HuberWeight(const Linear& l) const {
    return std::min(1.0, std::sqrt(kHuberChi2 * factor_ / std::max(l.r.squaredNorm(), 1e-300)));
  }

  double RobustCost(const Rigid3d& t, const std::vector<int>& used) const {
    double cost = 0;
    for (int i : used) {
      const double s = Linearise(i, t).r.squaredNorm();
      cost += s <= kHuberChi2 * factor_ ? s : 2 * std::sqrt(s * kHuberChi2 * factor_) - kHuberChi2 * factor_;
    }
    return cost;
  }

  Fit Solve(const Hypothesis& start) {
    Fit fit;
    fit.world_from_tag = start.world_from_tag;
    fit.used = start.inliers;
    factor_ = 1e6;  // the first round is not robust
    for (int round = 0; round < 4; ++round) {
      Minimise(&fit);
      factor_ = std::max(1.0, MedianFactor(fit));
      std::vector<int> used;  // the whole list is judged again by the better pose
      for (size_t i = 0; i < sightings_.size(); ++i) {
        if (ErrorPx(sightings_[i], fit.world_from_tag) < options_.gate_px) used.push_back(static_cast<int>(i));
      }
      if (used.empty()) break;
      fit.used = used;
    }
    Minimise(&fit);
    fit.cost = RobustCost(fit.world_from_tag, fit.used);
    Covariance(&fit);
    return fit;
  }

  // Variance factor from the median of the sightings' squared residuals (median of chi-square 8: 7.344).
  double MedianFactor(const Fit& fit) const {
    std::vector<double> s;
    for (int i : fit.used) s.push_back(Linearise(i, fit.world_from_tag).r.squaredNorm());
    // Six of the 8 n are spent on the pose.
    const double n = 8.0 * static_cast<double>(s.size());
    return Median(std::move(s)) / 7.344 * n / (n - 6);
  }

  void Minimise(Fit* fit) const {
    double lambda = 1e-6, cost = RobustCost(fit->world_from_tag, fit->used);
    for (int iteration = 0; iteration < 50; ++iteration) {
      Matrix6d a = Matrix6d::Zero();
      Vector6d b = Vector6d::Zero();
      for (int i : fit->used) {
        const Linear l = Linearise(i, fit->world_from_tag);
        const double w = HuberWeight(l);
        a += w * l.by_tag.transpose() * l.by_tag;
        b += w * l.by_tag.transpose() * l.r;
      }
      a.diagonal() *= 1 + lambda;
      const Vector6d step = -a.ldlt().solve(b);
      if (!step.allFinite()) return;
      const Rigid3d next = fit->world_from_tag.Plus(step);
      const double next_cost = RobustCost(next, fit->used);
      if (next_cost <= cost) {
        const bool done = cost - next_cost < 1e-10 * (1 + cost);
        fit->world_from_tag = next;
        cost = next_cost;
        lambda *= 0.1;
        if (done) return;
      } else {
        lambda = std::max(lambda, 1e-9) * 10;
        if (lambda > 1e8) return;
      }
    }
  }

  void Covariance(Fit* fit) const {
    Matrix6d a = Matrix6d::Zero(), common = Matrix6d::Zero(), own = Matrix6d::Zero(), noise = Matrix6d::Zero();
    double chi2 = 0, weights = 0, square_px = 0;
    for (int i : fit->used) {
      const Linear l = Linearise(i, fit->world_from_tag);
      const double w = HuberWeight(l);
      a += w * l.by_tag.transpose() * l.by_tag;
      // The whitened residual has unit covariance: corner noise is what the camera's part leaves of it.
      const Eigen::Matrix<double, 8, 8> corner =
          Eigen::Matrix<double, 8, 8>::Identity() - l.camera_part * l.camera_part.transpose();
      noise += w * l.by_tag.transpose() * corner * l.by_tag;
      const Matrix6d g = w * l.by_tag.transpose() * l.camera_part;
      fit->by_camera.emplace_back(-w * l.by_tag.transpose() * l.by_camera);
      common += g;
      own += g * g.transpose();
      chi2 += w * l.r.squaredNorm();
      weights += 8 * w;
      const double px = ErrorPx(sightings_[i], fit->world_from_tag);
      square_px += px * px;
    }
    fit->rms_px = std::sqrt(square_px / static_cast<double>(fit->used.size()));
    fit->variance_factor = std::max(1.0, chi2 / std::max(1.0, weights - 6));
    const Matrix6d inverse = a.ldlt().solve(Matrix6d::Identity());
    for (Matrix6d& d : fit->by_camera) d = (inverse * d).eval();
    const double rho = options_.camera_correlation;
    const Matrix6d middle = fit->variance_factor * noise + rho * common * common.transpose() + (1 - rho) * own;
    fit->covariance = inverse * middle * inverse;
  }

  // Is there another orientation that explains the same pictures about as well?
  void CheckTwin(const std::vector<Hypothesis>& hypotheses, const Fit& fit, TagEstimate* out) {
    for (const Hypothesis& h : hypotheses) {
      if (AngleBetween(h.world_from_tag.rotation, fit.world_from_tag.rotation) < kTwinAngle) continue;
      if (h.score < 0.5 * hypotheses.front().score) return;
      Fit twin;
      twin.world_from_tag = h.world_from_tag;
      twin.used = fit.used;
      Minimise(&twin);
      twin.cost = RobustCost(twin.world_from_tag, twin.used);
      const double angle = AngleBetween(twin.world_from_tag.rotation, fit.world_from_tag.rotation);
      if (angle < kTwinAngle) continue;
      if (twin.cost - fit.cost < kAmbiguousChi2 * std::max(1.0, fit.variance_factor)) {
        out->status = "ambiguous";
        std::ostringstream text;
        text << "an orientation " << std::lround(angle * kRadToDeg) << " deg away explains the "
             << Counted(fit.used.size(), "picture") << " as well; take pictures from other sides";
        out->reason = text.str();
      }
      return;
    }
  }

  // Do the pictures that do not fit agree on a place of their own?
  void CheckSecondPlace(const std::vector<TagView>& views, const Fit& fit, const std::set<std::string>& runs,
                        TagEstimate* out) {
    std::vector<int> rest;
    for (size_t i = 0; i < sightings_.size(); ++i) {
      if (!std::binary_search(fit.used.begin(), fit.used.end(), static_cast<int>(i)))
        rest.push_back(static_cast<int>(i));
    }
    if (rest.empty()) return;
    const std::vector<Hypothesis> others = Hypotheses(rest);
    // Two pictures that agree, or one that shows the id a second time beside the first, are not chance.
    bool twice = false;
    for (int i : rest) {
      for (int k : fit.used) twice = twice || sightings_[i].view == sightings_[k].view;
    }
    if (others.empty() || (others.front().inliers.size() < 2 && !twice)) return;
    std::set<std::string> other_runs;
    bool shared = false;
    for (int i : others.front().inliers) {
      const std::string& run = views[sightings_[i].view].run;
      other_runs.insert(run);
      shared = shared || runs.count(run) > 0;
    }
    const Eigen::Vector3d a = fit.world_from_tag.translation, b = others.front().world_from_tag.translation;
    // Two sheets don't overlap: what stands nearer in one run are pictures that are wrong alike.
    if (shared && (a - b).norm() < size_m_) return;
    std::ostringstream text;
    text.precision(2);
    text << std::fixed << "seen at (" << a.x() << ", " << a.y() << ", " << a.z() << ") in "
         << Counted(fit.used.size(), "picture") << " and at (" << b.x() << ", " << b.y() << ", " << b.z() << ") in "
         << others.front().inliers.size() << ", " << (a - b).norm() << " m apart";
    out->status = shared ? "duplicate" : "moved";
    out->reason = text.str();
  }

  double size_m_;
  const TagPosesOptions& options_;
  std::vector<Sighting> sightings_;
  std::vector<Matrix6d> covariance_roots_;
  double factor_ = 1;
};

}  // namespace

std::vector<TagEstimate> EstimateTagPoses(const std::vector<TagView>& views, const TagSizes& sizes,
                                          const TagPosesOptions& options, int threads, ProgressSink& progress,
                                          const CancelToken& cancel) {
  if (const std::vector<std::string> problems = options.Check(); !problems.empty()) throw OptionError(problems.front());
  std::map<int, std::vector<std::pair<int, const TagDetection*>>> by_id;
  for (size_t v = 0; v < views.size(); ++v) {
    for (const TagDetection& d : views[v].detections) by_id[d.id].emplace_back(static_cast<int>(v), &d);
  }
  std::vector<TagEstimate> out;
  for (const auto& [id, found] : by_id) {
    TagEstimate tag;
    tag.tag_id = id;
    tag.family = found.front().second->family;
    tag.size_m = sizes.SizeOf(id);
    if (!(tag.size_m > 0)) {
      throw InputError("tags.yaml: tag " + std::to_string(id) + " has no size; give size_m, or sizes_m for its id");
    }
    out.push_back(tag);
  }
  progress.Begin("tag poses", static_cast<int64_t>(out.size()));
  ParallelFor(static_cast<int64_t>(out.size()), threads, cancel, [&](int64_t i) {
    TagEstimate& tag = out[i];
    OneTag solver(tag.size_m, options);
    int small = 0;
    for (const auto& [view, detection] : by_id.at(tag.tag_id)) {
      if (detection->ShortestSide() < options.min_side_px) {
        ++small;
        continue;
      }
      try {
        solver.Add(view, views[view], *detection);
      } catch (const NumericError&) {
        ++small;  // a corner outside the camera's field of view: as useless as one too small
      }
    }
    if (solver.empty()) {
      tag.status = "unsolved";
      tag.reason = Counted(small, "picture") + ", each too small or outside the camera model";
    } else {
      solver.Estimate(views, &tag);
    }
    progress.Advance(1);
  });
  return out;
}

}  // namespace trigpoint
