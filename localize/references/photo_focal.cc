#include "localize/references/photo_focal.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "calib/estimation/loss.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {
namespace {

Camera WithFactor(const Camera& camera, double factor) {
  std::vector<double> parameters = camera.params();
  parameters[0] *= factor, parameters[1] *= factor;
  return {camera.model(), camera.width(), camera.height(), std::move(parameters)};
}

// Normal equations of one photo: its pose, the logarithm of the factor, and how they mix.
struct PhotoTerms {
  Matrix6d pose = Matrix6d::Zero();
  Vector6d by_pose = Vector6d::Zero(), mixed = Vector6d::Zero();
  double focal = 0, by_focal = 0;
  double squares = 0, weights = 0;
  int points = 0;
};

// Where the estimation is.
struct FocalState {
  double log_factor = 0;
  double noise = 1;  // times the stated, by the residuals
  std::vector<Rigid3d> poses;
  // Of each observation of each photo: where its point is, given all. Taken where the run puts it, what its error does
  // to pixels would pass for an effect of the focal length, most where points hardly differ in distance.
  std::vector<std::vector<Eigen::Vector3d>> points;
};

class FocalProblem {
 public:
  FocalProblem(const std::vector<RegisteredPhoto>& photos, const std::vector<Eigen::Vector3d>& points,
               const std::vector<Eigen::Matrix3d>& covariances, const RegistrationOptions& options)
      : photos_(photos),
        points_(points),
        covariances_(covariances),
        options_(options),
        loss_(MakeLoss("dcs", options.outlier_chi2)) {}

  FocalState Start() const {
    FocalState at;
    for (const RegisteredPhoto& photo : photos_) {
      at.poses.push_back(photo.registration.rig_from_odom);
      at.points.emplace_back();
      for (const ViewObservation& o : photo.registration.inliers)
        at.points.back().push_back(points_[static_cast<size_t>(o.point)]);
    }
    return at;
  }

  // One of Gauss-Newton. Returns how well the factor is known, and by what.
  PhotoFocal Step(double prior, double prior_sigma, FocalState* at) const {
    constexpr double kMostNoise = 3;  // as in the registration
    PhotoFocal out;
    double h = 1 / (prior_sigma * prior_sigma), g = (at->log_factor - prior) * h, squares = 0, weights = 0;
    std::vector<Vector6d> by_pose, by_focal;  // the poses' own steps, and by the factor's
    for (size_t k = 0; k < photos_.size(); ++k) {
      const PhotoTerms t = TermsOf(k, at);
      const Eigen::LDLT<Matrix6d> pose(t.pose);
      by_pose.push_back(pose.solve(t.by_pose)), by_focal.push_back(pose.solve(t.mixed));
      if (t.points == 0 || !by_focal.back().allFinite()) {
        by_pose.back().setZero(), by_focal.back().setZero();
        continue;
      }
      h += t.focal - t.mixed.dot(by_focal.back());
      g += t.by_focal - t.mixed.dot(by_pose.back());
      squares += t.squares, weights += t.weights;
      out.points += t.points;
      ++out.photos;
    }
    const double step = -g / h;
    at->log_factor += step;
    for (size_t k = 0; k < photos_.size(); ++k) at->poses[k] = at->poses[k].Plus(-by_pose[k] - step * by_focal[k]);
    const double freedom = 2 * weights - 6 * out.photos - 1;
    at->noise = freedom > 0 ? std::clamp(at->noise * std::sqrt(squares / freedom), 1.0, kMostNoise) : kMostNoise;
    out.sigma = 1 / std::sqrt(h);
    return out;
  }

 private:
  // Moves the points, too.
  PhotoTerms TermsOf(size_t k, FocalState* at) const {
    const auto& [reference, registration] = photos_[k];
    std::vector<Camera> cameras;
    std::vector<Rigid3d> view_from_rig;
    for (const View& v : reference.rig.views) {
      cameras.push_back(WithFactor(v.camera, std::exp(at->log_factor)));
      view_from_rig.push_back(v.rig_from_view.Inverse());
    }
    PhotoTerms sum;
    for (size_t i = 0; i < registration.inliers.size(); ++i) {
      const ViewObservation& o = registration.inliers[i];
      if (o.repeated) continue;
      const auto view = static_cast<size_t>(o.view);
      Add(o, cameras[view], view_from_rig[view], at->poses[k], at->noise, &at->points[k][i], &sum);
    }
    return sum;
  }

  void Add(const ViewObservation& o, const Camera& camera, const Rigid3d& view_from_rig, const Rigid3d& pose,
           double noise, Eigen::Vector3d* y, PhotoTerms* sum) const {
    const Eigen::Vector2d pixel = o.pixel.cast<double>();
    const auto point = static_cast<size_t>(o.point);
    const Eigen::Vector3d turned = pose.rotation * *y;
    Eigen::Matrix<double, 2, 3> by_view;
    const auto seen = camera.Project(view_from_rig * (turned + pose.translation), &by_view);
    if (!seen) return;
    const double weight_px = 1 / (options_.sigma_px * noise);
    const Eigen::Matrix<double, 2, 3> by_rig = weight_px * by_view * view_from_rig.rotation.toRotationMatrix();
    const Eigen::Matrix<double, 2, 3> by_point = by_rig * pose.rotation.toRotationMatrix();
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose << -by_rig * Skew(turned), by_rig;
    // The predicted pixel: with the observed one its noise would multiply itself.
    const Eigen::Vector2d by_focal = weight_px * (*seen - Eigen::Vector2d(camera.params()[2], camera.params()[3]));
    const Eigen::Vector2d by_run = weight_px * (*seen - pixel) + by_point * (points_[point] - *y);
    const Eigen::Matrix2d covariance =
        Eigen::Matrix2d::Identity() + by_point * covariances_[point] * by_point.transpose();
    *y = points_[point] - covariances_[point] * by_point.transpose() * covariance.ldlt().solve(by_run);
    Accumulate(covariance, by_run, by_pose, by_focal, o.weight, sum);
  }

  void Accumulate(const Eigen::Matrix2d& covariance, const Eigen::Vector2d& error,
                  const Eigen::Matrix<double, 2, 6>& error_by_pose, const Eigen::Vector2d& error_by_focal,
                  double probability, PhotoTerms* sum) const {
    const Eigen::LLT<Eigen::Matrix2d> root(covariance);
    const Eigen::Vector2d r = root.matrixL().solve(error), by_focal = root.matrixL().solve(error_by_focal);
    const Eigen::Matrix<double, 2, 6> by_pose = root.matrixL().solve(error_by_pose);
    double rho[3] = {0, 1, 0};
    loss_->Evaluate(r.squaredNorm(), rho);
    const double weight = probability * rho[1];
    sum->pose += weight * by_pose.transpose() * by_pose;
    sum->by_pose += weight * by_pose.transpose() * r;
    sum->mixed += weight * by_pose.transpose() * by_focal;
    sum->focal += weight * by_focal.squaredNorm();
    sum->by_focal += weight * by_focal.dot(r);
    sum->squares += weight * r.squaredNorm();
    sum->weights += weight;
    ++sum->points;
  }

  const std::vector<RegisteredPhoto>& photos_;
  const std::vector<Eigen::Vector3d>& points_;
  const std::vector<Eigen::Matrix3d>& covariances_;
  const RegistrationOptions& options_;
  std::unique_ptr<ceres::LossFunction> loss_;
};

}  // namespace

PhotoFocal EstimateFocal(const std::vector<RegisteredPhoto>& photos, const std::vector<Eigen::Vector3d>& points,
                         const std::vector<Eigen::Matrix3d>& covariances, const RegistrationOptions& options,
                         double prior, double prior_sigma) {
  constexpr int kIterations = 20;
  constexpr double kSmall = 1e-3;
  const FocalProblem problem(photos, points, covariances, options);
  FocalState at = problem.Start();
  PhotoFocal out;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double log_factor = at.log_factor, noise = at.noise;
    out = problem.Step(prior, prior_sigma, &at);
    const bool steady = std::abs(at.noise / noise - 1) < kSmall;
    if (steady && std::abs(at.log_factor - log_factor) < kSmall * out.sigma) break;
  }
  out.factor = std::exp(at.log_factor);
  return out;
}

namespace {

// References that state one focal length.
struct FocalGroup {
  double stated_px = 0, share = 0;
  std::vector<size_t> members;
};

std::vector<FocalGroup> GroupsOf(const std::vector<ReferenceViews>& references) {
  std::map<double, FocalGroup> groups;
  for (size_t i = 0; i < references.size(); ++i) {
    const double share = references[i].errors.focal_share;
    if (!(share > 0)) continue;
    const double focal_px = references[i].rig.views.front().camera.MeanFocal();
    FocalGroup& group = groups[focal_px];
    group.stated_px = focal_px, group.share = share;
    group.members.push_back(i);
  }
  std::vector<FocalGroup> out;
  for (auto& [focal_px, group] : groups) out.push_back(std::move(group));
  return out;
}

// Answers of a group's members with its focal length times a factor.
struct FocalTrial {
  double log_factor = 0;
  std::vector<Registration> answers;

  double Support() const {
    double sum = 0;
    for (const Registration& g : answers) sum += g.status == AnswerStatus::kLocalized ? g.support : 0;
    return sum;
  }
};

// The members that the retrieval says most of: enough to estimate their focal length.
FocalGroup MostMatched(const FocalGroup& group, const std::vector<Registration>& registrations) {
  constexpr size_t kMost = 8;
  FocalGroup some = group;
  std::stable_sort(some.members.begin(), some.members.end(),
                   [&](size_t a, size_t b) { return registrations[a].view_matches > registrations[b].view_matches; });
  some.members.resize(std::min(kMost, some.members.size()));
  return some;
}

class FocalRefiner {
 public:
  // `attempt`: the members' answers with such cameras.
  using Attempt =
      std::function<std::vector<Registration>(const LocalizeInput& tried, const std::vector<size_t>& members)>;
  FocalRefiner(const LocalizeInput& input, const Reconstruction& reconstruction, const RegistrationOptions& options,
               Attempt attempt)
      : tried_(input),
        points_(reconstruction.problem.points),
        covariances_(PointCovariances(reconstruction.problem)),
        options_(options),
        attempt_(std::move(attempt)) {}

  // Nothing where no member is localized, with whatever focal length.
  std::optional<PhotoFocal> Refine(const FocalGroup& group, std::vector<ReferenceViews>* references,
                                   std::vector<Registration>* registrations) {
    const FocalGroup some = MostMatched(group, *registrations);
    FocalTrial best = AsStated(some, *registrations);
    PhotoFocal focal;
    bool settled = best.Support() > 0 && Settle(some, *references, &best, &focal);
    if (!settled) {
      // Far from the true focal length, the points that are found are those that fit the wrong one.
      best = Search(some, *references, std::move(best));
      if (!(best.Support() > 0)) return {};
      settled = Settle(some, *references, &best, &focal);
    }
    if (!settled) focal.sigma = group.share;
    focal.stated_px = group.stated_px;
    focal.factor = std::exp(best.log_factor);
    Take(group, focal, references, registrations);
    return focal;
  }

 private:
  static FocalTrial AsStated(const FocalGroup& group, const std::vector<Registration>& registrations) {
    FocalTrial trial;
    for (const size_t i : group.members) trial.answers.push_back(registrations[i]);
    return trial;
  }

  void Scale(const FocalGroup& group, const std::vector<ReferenceViews>& stated, double log_factor) {
    for (const size_t i : group.members) {
      tried_.references[i].rig = stated[i].rig;
      for (View& v : tried_.references[i].rig.views) v.camera = WithFactor(v.camera, std::exp(log_factor));
    }
  }

  FocalTrial Try(const FocalGroup& group, const std::vector<ReferenceViews>& stated, double log_factor) {
    Scale(group, stated, log_factor);
    return {log_factor, attempt_(tried_, group.members)};
  }

  // The factor is that on the trial's focal length.
  PhotoFocal Estimate(const FocalGroup& group, const std::vector<ReferenceViews>& stated, const FocalTrial& trial) {
    Scale(group, stated, trial.log_factor);
    std::vector<RegisteredPhoto> placed;
    for (size_t k = 0; k < group.members.size(); ++k) {
      if (trial.answers[k].status != AnswerStatus::kLocalized) continue;
      placed.push_back({tried_.references[group.members[k]], trial.answers[k]});
    }
    return EstimateFocal(placed, points_, covariances_, options_, -trial.log_factor, group.share);
  }

  // The focal length under which most points are found.
  FocalTrial Search(const FocalGroup& group, const std::vector<ReferenceViews>& stated, FocalTrial best) {
    const auto offer = [&](double log_factor) {
      FocalTrial trial = Try(group, stated, log_factor);
      if (trial.Support() > best.Support()) best = std::move(trial);
    };
    for (const double sigmas : {-2, -1, 1, 2}) offer(sigmas * group.share);
    for (const double sigmas : {0.5, 0.25}) {
      const double middle = best.log_factor;
      offer(middle - sigmas * group.share), offer(middle + sigmas * group.share);
    }
    return best;
  }

  // Estimates and registers in turns. Whether the focal length stayed in the end.
  bool Settle(const FocalGroup& group, const std::vector<ReferenceViews>& stated, FocalTrial* best, PhotoFocal* focal) {
    constexpr int kRounds = 8;
    double last = 0, stride = 1;
    for (int round = 0; round < kRounds; ++round) {
      *focal = Estimate(group, stated, *best);
      const double step = std::log(focal->factor);
      // Of the points that are found, more fit the present focal length: each step is too short.
      stride = step * last > 0 ? std::min(2 * stride, 4.0) : 1;
      const bool stays = std::abs(step) < focal->sigma;
      FocalTrial next = Try(group, stated, best->log_factor + (stays ? 1 : stride) * step);
      // A focal length that loses more points than chance explains (3 sigma of a count) has led to wrong poses.
      if (round > 0 && next.Support() < best->Support() - 3 * std::sqrt(best->Support())) return false;
      *best = std::move(next);
      if (stays) {
        focal->sigma = std::hypot(focal->sigma, step);
        return true;
      }
      last = step;
    }
    return false;
  }

  // All members with the focal length found, registered again where that moves what they show by more than the noise.
  void Take(const FocalGroup& group, const PhotoFocal& focal, std::vector<ReferenceViews>* references,
            std::vector<Registration>* registrations) {
    const double log_factor = std::log(focal.factor);
    const Camera& camera = (*references)[group.members.front()].rig.views.front().camera;
    const double corner_px = 0.5 * std::hypot(camera.width(), camera.height());
    if (std::abs(log_factor) * corner_px > options_.sigma_px) {
      FocalTrial all = Try(group, *references, log_factor);
      for (size_t k = 0; k < group.members.size(); ++k) (*registrations)[group.members[k]] = std::move(all.answers[k]);
    }
    Scale(group, *references, log_factor);
    for (const size_t i : group.members) {
      (*references)[i].rig = tried_.references[i].rig;
      (*references)[i].errors.focal_share = focal.sigma;
    }
  }

  LocalizeInput tried_;
  const std::vector<Eigen::Vector3d>& points_;
  std::vector<Eigen::Matrix3d> covariances_;
  const RegistrationOptions& options_;
  Attempt attempt_;
};

}  // namespace

std::vector<PhotoFocal> RefinePhotoFocals(const LocalizeInput& input, const Reconstruction& reconstruction,
                                          const Retrieval& retrieval, const RegistrationOptions& options, int threads,
                                          uint64_t seed, ProgressSink& progress, const CancelToken& cancel,
                                          std::vector<ReferenceViews>* references,
                                          std::vector<Registration>* registrations) {
  std::vector<PhotoFocal> found;
  const std::vector<FocalGroup> groups = GroupsOf(*references);
  if (groups.empty()) return found;
  RegistrationOptions wide = options;  // so that points are found whose places the focal length moves
  wide.guided_px *= 2;
  const auto attempt = [&](const LocalizeInput& tried, const std::vector<size_t>& members) {
    return RegisterReferences(tried, reconstruction, retrieval, wide, false, members, threads, seed, progress, cancel);
  };
  FocalRefiner refiner(input, reconstruction, options, attempt);
  for (const FocalGroup& group : groups) {
    const std::optional<PhotoFocal> focal = refiner.Refine(group, references, registrations);
    if (focal) found.push_back(*focal);
  }
  return found;
}

}  // namespace trigpoint
