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
#include "localize/references/match_noise.h"

namespace trigpoint {

Camera WithFocalFactor(const Camera& camera, double factor) {
  std::vector<double> parameters = camera.params();
  parameters.at(0) *= factor, parameters.at(1) *= factor;
  return {camera.model(), camera.width(), camera.height(), std::move(parameters)};
}

namespace {

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
  std::vector<std::pair<double, double>> photos;  // of each: what it says of the factor, information and gradient
};

// Variance of the photos' own factors about their mean, beyond what their points leave open (DerSimonian and Laird
// 1986).
double ScatterOf(const std::vector<std::pair<double, double>>& photos) {
  if (photos.size() < 2) return 0;
  double sum = 0, squares = 0, q = 0;
  for (const auto& [information, gradient] : photos) {
    if (!(information > 0)) continue;
    sum += information, squares += information * information;
    q += gradient * gradient / information;
  }
  const double spread = sum - squares / sum, expected = static_cast<double>(photos.size()) - 1;
  constexpr double kNone = 1e-9;  // as where one photo alone says something
  return spread > kNone * sum ? std::max(0.0, (q - expected) / spread) : 0;
}

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
    at->photos.clear();
    for (size_t k = 0; k < photos_.size(); ++k) {
      const PhotoTerms t = TermsOf(k, at);
      const Eigen::LDLT<Matrix6d> pose(t.pose);
      by_pose.push_back(pose.solve(t.by_pose)), by_focal.push_back(pose.solve(t.mixed));
      if (t.points == 0 || !by_focal.back().allFinite()) {
        by_pose.back().setZero(), by_focal.back().setZero();
        continue;
      }
      at->photos.emplace_back(t.focal - t.mixed.dot(by_focal.back()), t.by_focal - t.mixed.dot(by_pose.back()));
      h += at->photos.back().first, g += at->photos.back().second;
      squares += t.squares, weights += t.weights;
      out.points += t.points;
      ++out.photos;
    }
    const double step = -g / h;
    at->log_factor += step;
    for (size_t k = 0; k < photos_.size(); ++k) at->poses[k] = at->poses[k].Plus(-by_pose[k] - step * by_focal[k]);
    const double freedom = 2 * weights - 6 * out.photos - 1;
    at->noise = freedom > 0 ? std::clamp(at->noise * std::sqrt(squares / freedom), 1.0, kMostNoise) : kMostNoise;
    out.mean_sigma = 1 / std::sqrt(h);
    return out;
  }

 private:
  // Moves the points, too.
  PhotoTerms TermsOf(size_t k, FocalState* at) const {
    const auto& [reference, registration] = photos_[k];
    std::vector<Camera> cameras;
    std::vector<Rigid3d> view_from_rig;
    for (const View& v : reference.rig.views) {
      cameras.push_back(WithFocalFactor(v.camera, std::exp(at->log_factor)));
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
    if (steady && std::abs(at.log_factor - log_factor) < kSmall * out.mean_sigma) break;
  }
  out.factor = std::exp(at.log_factor);
  out.sigma = std::hypot(out.mean_sigma, std::sqrt(ScatterOf(at.photos)));
  return out;
}

namespace {

// References that state one focal length: of one set, or of none.
struct FocalGroup {
  double share = 0;
  std::vector<size_t> members;
};

std::vector<FocalGroup> GroupsOf(const std::vector<ReferenceViews>& references) {
  std::map<std::pair<int, double>, FocalGroup> groups;
  for (size_t i = 0; i < references.size(); ++i) {
    const double share = references[i].errors.focal_share;
    if (!(share > 0)) continue;
    FocalGroup& group = groups[{references[i].set, references[i].rig.views.front().camera.MeanFocal()}];
    group.share = share;
    group.members.push_back(i);
  }
  std::vector<FocalGroup> out;
  for (auto& [key, group] : groups) out.push_back(std::move(group));
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

// Of the localized members those with most points found: enough to estimate their focal length.
FocalGroup BestFound(const FocalGroup& group, const std::vector<Registration>& registrations) {
  constexpr size_t kMost = 8;
  FocalGroup some = group;
  std::erase_if(some.members, [&](size_t i) { return registrations[i].status != AnswerStatus::kLocalized; });
  std::stable_sort(some.members.begin(), some.members.end(),
                   [&](size_t a, size_t b) { return registrations[a].support > registrations[b].support; });
  some.members.resize(std::min(kMost, some.members.size()));
  return some;
}

// Fewer points than chance explains (3 sigma of a count).
bool LosesPoints(double now, double before) { return now < before - 3 * std::sqrt(before); }

class FocalRefiner {
 public:
  // The members' answers with such cameras; `wide`: searched for points whose places the focal length moves.
  using Attempt = std::function<std::vector<Registration>(const LocalizeInput& tried,
                                                          const std::vector<size_t>& members, bool wide)>;
  FocalRefiner(const LocalizeInput& input, const Reconstruction& reconstruction, const RegistrationOptions& options,
               Attempt attempt)
      : tried_(input),
        points_(reconstruction.problem.points),
        covariances_(PointCovariances(reconstruction.problem)),
        options_(options),
        attempt_(std::move(attempt)) {}

  // Nothing where no member is localized as stated, or where points are lost.
  std::optional<PhotoFocal> Refine(const FocalGroup& group, std::vector<ReferenceViews>* references,
                                   std::vector<Registration>* registrations) {
    const FocalGroup some = BestFound(group, *registrations);
    if (some.members.empty()) return {};
    FocalTrial best = Try(some, *references, 0);
    PhotoFocal focal;
    bool settled = Settle(some, *references, &best, &focal);
    if (!settled) {
      // Far from the true focal length, the points that are found are those that fit the wrong one.
      best = Search(some, *references, std::move(best));
      settled = Settle(some, *references, &best, &focal);
    }
    if (focal.photos == 0) return {};
    if (!settled) focal.sigma = group.share;
    focal.factor = std::exp(best.log_factor);
    focal.references = group.members;
    if (!Take(group, focal, references, registrations)) return {};
    return focal;
  }

 private:
  void Scale(const FocalGroup& group, const std::vector<ReferenceViews>& stated, double log_factor) {
    for (const size_t i : group.members) {
      tried_.references[i].rig = stated[i].rig;
      for (View& v : tried_.references[i].rig.views) v.camera = WithFocalFactor(v.camera, std::exp(log_factor));
    }
  }

  FocalTrial Try(const FocalGroup& group, const std::vector<ReferenceViews>& stated, double log_factor) {
    Scale(group, stated, log_factor);
    return {log_factor, attempt_(tried_, group.members, true)};
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
    if (!(best->Support() > 0)) return false;
    double last = 0, stride = 1;
    for (int round = 0; round < kRounds; ++round) {
      *focal = Estimate(group, stated, *best);
      const double step = std::log(focal->factor);
      if (!(std::abs(step) < 2 * group.share)) return false;
      // Of the points that are found, more fit the present focal length: each step is too short.
      stride = step * last > 0 ? std::min(2 * stride, 4.0) : 1;
      const bool stays = std::abs(step) < focal->mean_sigma;
      FocalTrial next = Try(group, stated, best->log_factor + (stays ? 1 : stride) * step);
      if (LosesPoints(next.Support(), best->Support())) return false;
      *best = std::move(next);
      if (stays) {
        focal->sigma = std::hypot(focal->sigma, stride * step);
        return true;
      }
      last = step;
    }
    return false;
  }

  // All members with the focal length found, registered again where that moves what they show by more than the noise.
  // Nothing changes where they lose points by it.
  bool Take(const FocalGroup& group, const PhotoFocal& focal, std::vector<ReferenceViews>* references,
            std::vector<Registration>* registrations) {
    const double log_factor = std::log(focal.factor);
    const Camera& camera = (*references)[group.members.front()].rig.views.front().camera;
    const double corner_px = 0.5 * std::hypot(camera.width(), camera.height());
    Scale(group, *references, log_factor);
    if (std::abs(log_factor) * corner_px > options_.sigma_px) {
      FocalTrial before, after{log_factor, attempt_(tried_, group.members, false)};
      for (const size_t i : group.members) before.answers.push_back((*registrations)[i]);
      if (LosesPoints(after.Support(), before.Support())) return false;
      for (size_t k = 0; k < group.members.size(); ++k) (*registrations)[group.members[k]] = after.answers[k];
    }
    for (const size_t i : group.members) {
      (*references)[i].rig = tried_.references[i].rig;
      (*references)[i].errors.focal_share = focal.sigma;
    }
    return true;
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
  RegistrationOptions wide = options;
  wide.guided_px *= 2;
  const auto attempt = [&](const LocalizeInput& tried, const std::vector<size_t>& members, bool is_wide) {
    return RegisterReferences(tried, reconstruction, retrieval, is_wide ? wide : options, false, threads, seed,
                              progress, cancel, &members);
  };
  FocalRefiner refiner(input, reconstruction, options, attempt);
  for (const FocalGroup& group : groups) {
    const std::optional<PhotoFocal> focal = refiner.Refine(group, references, registrations);
    if (focal) found.push_back(*focal);
  }
  return found;
}

}  // namespace trigpoint
