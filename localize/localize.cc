#include "localize/localize.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <utility>

#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/estimation/loss.h"
#include "calib/geometry/similarity.h"
#include "datasets/solution/reference_rows.h"
#include "localize/georegistration/gps_check.h"
#include "localize/reconstruct/lens_check.h"
#include "localize/references/align_views.h"
#include "localize/references/determined.h"
#include "localize/references/match_noise.h"
#include "localize/references/mirrored.h"
#include "localize/references/stray_photo.h"
#include "localize/references/view_turns.h"

namespace trigpoint {
namespace {

// What every step is given.
struct Task {
  const LocalizeInput& input;
  const std::vector<GpsPlace>& gps;
  const LocalizeOptions& options;
  int threads;
  uint64_t seed;
  ProgressSink& progress;
  const CancelToken& cancel;

  bool IsPaper() const { return options.mode == "paper"; }
  BundleOptions Bundle() const {
    BundleOptions bundle;
    bundle.threads = threads;
    return bundle;
  }
  // Of solutions that others follow.
  BundleOptions RoughBundle() const {
    BundleOptions bundle = Bundle();
    bundle.distance_tolerance = 0.5;
    return bundle;
  }
};

constexpr double kPoseUnknowns = 6;

bool IsLocalized(const ReferenceAnswer& a) { return a.registration.status == AnswerStatus::kLocalized; }

// The pose of a reference becomes one of the joint problem over images, points and references.
void AddPose(ReferenceAnswer* answer, BundleProblem* p) {
  answer->pose = static_cast<int>(p->poses.size());
  p->poses.push_back(answer->registration.rig_from_odom);
  p->pose_constant.push_back(false);
}

// Adds the localized ones of the references taken to the reconstruction: a pose each, their observations, sorted by
// point.
void AddReferences(const std::vector<ReferenceViews>& references, const std::vector<bool>& taken, double sigma_px,
                   std::vector<ReferenceAnswer>* answers, Reconstruction* r) {
  BundleProblem& p = r->problem;
  std::vector<ImageObservation> rows;
  for (size_t i = 0; i < answers->size(); ++i) {
    ReferenceAnswer& answer = (*answers)[i];
    if (!taken[i] || !IsLocalized(answer)) continue;
    const ReferenceViews& ref = references[i];
    const int first_view = static_cast<int>(p.views.size());
    for (const View& v : ref.rig.views) p.views.push_back(v.rig_from_view.Inverse());
    AddPose(&answer, &p);
    answer.views = {answer.pose, first_view, ref.rig.views.front().camera.MeanFocal(), ref.errors};
    for (const ViewObservation& v : answer.registration.inliers) {
      if (v.repeated) continue;
      const Camera& camera = ref.rig.views[static_cast<size_t>(v.view)].camera;
      BearingObservation o;
      o.point = v.point;
      o.pose = answer.pose;
      o.view = first_view + v.view;
      o.ray = camera.Unproject(v.pixel.cast<double>())->cast<float>();
      o.w = (std::sqrt(v.weight) * camera.BearingSqrtInfo(v.pixel.cast<double>(), sigma_px)).cast<float>();
      // image -1 - reference, feature within its view: told apart from the run's own
      rows.push_back({o, -1 - static_cast<int>(i), v.feature});
    }
  }
  AddObservations(rows, r);
}

// Whether an observation is one of the references taken.
bool IsOf(const Reconstruction& r, size_t k, const std::vector<bool>& taken) {
  return r.image_of[k] < 0 && taken[ReferenceOf(r, k)];
}

// References that are rejected bend no solution.
void LeaveOut(const std::set<size_t>& rejected, Localization* result) {
  Reconstruction& r = result->reconstruction;
  for (const size_t i : rejected) {
    ReferenceAnswer& answer = result->references[i];
    r.problem.pose_constant[static_cast<size_t>(answer.pose)] = true;
    answer.pose = answer.views.pose = -1;
  }
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (r.image_of[k] < 0 && rejected.count(ReferenceOf(r, k)) > 0) r.problem.observations[k].active = false;
  }
}

// The matches of the references taken, with the probability of each to be true.
std::vector<WeighedMatch> MatchesOf(const std::vector<ReferenceAnswer>& answers, const std::vector<bool>& taken,
                                    const Reconstruction& r) {
  std::map<std::tuple<int, int, int>, double> weights;  // by reference, view and feature
  for (size_t i = 0; i < answers.size(); ++i) {
    for (const ViewObservation& v : answers[i].registration.inliers)
      weights[{static_cast<int>(i), answers[i].views.first + v.view, v.feature}] = v.weight;
  }
  std::vector<WeighedMatch> matches;
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (IsOf(r, k, taken))
      matches.push_back({k, weights.at({-1 - r.image_of[k], r.problem.observations[k].view, r.feature_of[k]})});
  }
  return matches;
}

// Of the solved problem, with what the lenses and the references' views leave open.
std::unique_ptr<BundleCovariance> CovarianceOf(const Task& task, Localization* result) {
  Reconstruction& r = result->reconstruction;
  BundleProblem& p = r.problem;
  std::vector<PlacedViews> references;
  for (const ReferenceAnswer& answer : result->references) references.push_back(answer.views);
  p.pose_shifts.resize(0, 0);
  const Eigen::MatrixXd by_views = PoseShiftsByViews(references, p, task.threads, task.cancel);
  p.pose_shifts = PoseShiftsByLenses(task.input, r, task.threads, task.cancel);
  if (by_views.size() > 0) {
    p.pose_shifts.conservativeResize(by_views.rows(), p.pose_shifts.cols() + by_views.cols());
    p.pose_shifts.rightCols(by_views.cols()) = by_views;
  }
  return std::make_unique<BundleCovariance>(p, task.threads, task.cancel);
}

// Covariance of places' odom_from_rig (left tangent, odom axes), jointly.
Eigen::MatrixXd PlacesCovariance(const BundleProblem& p, const std::vector<int>& poses, const BundleCovariance& all) {
  Eigen::MatrixXd c = all.Joint(poses);
  for (size_t a = 0; a < poses.size(); ++a) {
    const Matrix6d j = InverseJacobian(p.poses[static_cast<size_t>(poses[a])]);
    const auto at = 6 * static_cast<Eigen::Index>(a);
    c.middleRows<6>(at) = (j * c.middleRows<6>(at)).eval();
    c.middleCols<6>(at) = (c.middleCols<6>(at) * j.transpose()).eval();
  }
  return 0.5 * (c + c.transpose());
}

// Covariance of every pose's odom_from_rig with what the fit to the Earth made of the places: 6 rows a pose, 7 columns.
Eigen::MatrixXd CovarianceWithFit(const BundleProblem& p, const std::vector<int>& places, const GeoRegistration& geo,
                                  const BundleCovariance& all) {
  Eigen::MatrixXd of_places = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), 7);
  for (size_t k = 0; k < places.size(); ++k) {
    const Matrix6d j = InverseJacobian(p.poses[static_cast<size_t>(places[k])]);
    of_places.middleRows<6>(6 * static_cast<Eigen::Index>(places[k])) +=
        j.transpose() * geo.sensitivity.middleCols<6>(6 * static_cast<Eigen::Index>(k)).transpose();
  }
  Eigen::MatrixXd c = all.Times(of_places);
  for (size_t i = 0; i < p.poses.size(); ++i) {
    const auto at = 6 * static_cast<Eigen::Index>(i);
    c.middleRows<6>(at) = (InverseJacobian(p.poses[i]) * c.middleRows<6>(at)).eval();
  }
  return c;
}

// World pose and covariance of something rigidly known in the run's frame. `with_fit`: see CovarianceWithFit.
PoseEstimate ToWorld(const GeoRegistration& geo, const Rigid3d& odom_from_x, const Matrix6d& covariance,
                     const Eigen::Matrix<double, 6, 7>& with_fit) {
  PoseEstimate e;
  e.world_from_x = geo.world_from_odom.TransformPose(odom_from_x);
  Matrix6d a;
  Eigen::Matrix<double, 6, 7> b;
  SimilarityJacobians(geo.world_from_odom, odom_from_x, &a, &b);
  const Matrix6d cross = a * with_fit * b.transpose();
  e.covariance = a * covariance * a.transpose() + b * geo.covariance * b.transpose() + cross + cross.transpose();
  return e;
}

// The photos of a hand-held set were taken within arm's reach of each other. Photos whose poses agree with that are
// accepted, the others rejected. The whole set is rejected if only one photo has a pose, or if most of its poses
// disagree, unless three and more agree that have found more points than all others: poses at wrong places find few.
void AgreeOnSets(const LocalizeInput& input, double radius, std::vector<ReferenceAnswer>* answers) {
  std::map<int, std::vector<size_t>> sets;
  for (size_t i = 0; i < answers->size(); ++i) {
    if (input.references[i].set >= 0) sets[input.references[i].set].push_back(i);
  }
  for (const auto& [set, members] : sets) {
    std::vector<size_t> answered;
    for (size_t i : members) {
      if (IsLocalized((*answers)[i])) answered.push_back(i);
    }
    const auto centre = [&](size_t i) { return (*answers)[i].registration.rig_from_odom.TargetOriginInSource(); };
    const auto support = [&](const std::vector<size_t>& some) {
      double sum = 0;
      for (size_t i : some) sum += (*answers)[i].registration.support;
      return sum;
    };
    std::vector<size_t> best;
    for (size_t i : answered) {
      std::vector<size_t> near;
      for (size_t j : answered) {
        if ((centre(i) - centre(j)).norm() < radius) near.push_back(j);
      }
      if (near.size() > best.size() || (near.size() == best.size() && support(near) > support(best))) best = near;
    }
    const bool most = 2 * best.size() > answered.size() || (best.size() >= 3 && 2 * support(best) > support(answered));
    const bool enough = members.size() == 1 || (best.size() >= 2 && most);
    for (size_t i : answered) {
      if (enough && std::find(best.begin(), best.end(), i) != best.end()) continue;
      Registration& g = (*answers)[i].registration;
      g.status = AnswerStatus::kRejected;
      g.reason = enough ? "disagrees with the other photos of its set"
                        : "the photos of its set do not agree: " + std::to_string(best.size()) + " of " +
                              std::to_string(answered.size()) + " answers within " +
                              std::to_string(radius).substr(0, 4) + " m";
    }
  }
}

struct EarthInput : GeoStart {
  bool gps = false;
};

EarthInput CollectEarth(const Task& task, const Localization& result) {
  const LocalizeInput& input = task.input;
  const GeoRegistrationOptions& options = task.options.geo;
  EarthInput e;
  const BundleProblem& p = result.reconstruction.problem;
  if (input.has_frame) {
    std::vector<int> pose_of;
    for (const ReferenceAnswer& answer : result.references) pose_of.push_back(answer.pose);
    static_cast<GeoStart&>(e) = GeotagsOf(input, pose_of, p);
  }
  const bool use_gps = options.use_gps == "always" || (options.use_gps == "auto" && e.observations.empty());
  if (use_gps) {
    int64_t last = std::numeric_limits<int64_t>::min();
    for (const GpsPlace& g : task.gps) {
      if (last != std::numeric_limits<int64_t>::min() &&
          static_cast<double>(g.stamp_ns - last) * 1e-9 < options.gps_correlation_s)
        continue;
      last = g.stamp_ns;
      GeoObservation o;
      o.odom_from_rig = p.poses[static_cast<size_t>(g.pose)].Inverse();
      o.odom_from_rig.translation = o.odom_from_rig * g.arm_m;
      o.position = g.position;
      o.has_height = g.sigma_v_m < kUnknownHeightSigma;
      if (!o.has_height) o.position.z() = 0;
      o.sigma_h_m = g.sigma_h_m, o.sigma_v_m = OwnHeightSigma(g.sigma_v_m, g.sigma_sea_m);
      o.sigma_sea_m = g.sigma_sea_m;
      e.observations.push_back(o);
      e.poses.push_back(g.pose);
      e.references.push_back(-1);
      e.gps = true;
    }
  }
  return e;
}

// The run's way onto the Earth.
struct EarthFit {
  EarthInput input;
  std::unique_ptr<BundleCovariance> covariance;  // of the problem as it is; none while that is solved, to save memory
  Eigen::MatrixXd with_fit;                      // see CovarianceWithFit; empty: not on the Earth
};

GeoRegistration FitSources(const Task& task, const BundleProblem& p, double scale_prior, EarthFit* earth) {
  EarthInput& e = earth->input;
  GeoRegistration geo = RegisterBySources(&e.observations, PlacesCovariance(p, e.poses, *earth->covariance),
                                          scale_prior, task.input.scale_sigma, task.input.levelled, task.options.geo);
  e.gps ? CheckGpsShape(p, task.gps, task.options.geo, e.references.front() < 0, &geo) : HeedGps(p, task.gps, &geo);
  return geo;
}

// The pose with its centre `scale` times as far from `origin`.
Rigid3d Stretched(Rigid3d pose, const Eigen::Vector3d& origin, double scale) {
  const Eigen::Vector3d centre = origin + scale * (pose.TargetOriginInSource() - origin);
  pose.translation = -(pose.rotation * centre);
  return pose;
}

// Where the views that observe from each pose are in the mean, in its rig.
std::vector<Eigen::Vector3d> MeanArms(const BundleProblem& p) {
  std::vector<Eigen::Vector3d> sums(p.poses.size(), Eigen::Vector3d::Zero());
  std::vector<int> count(p.poses.size(), 0);
  for (const BearingObservation& o : p.observations) {
    const auto pose = static_cast<size_t>(o.pose);
    sums[pose] += p.views[static_cast<size_t>(o.view)].TargetOriginInSource();
    ++count[pose];
  }
  for (size_t i = 0; i < sums.size(); ++i) sums[i] /= std::max(1, count[i]);
  return sums;
}

// All lengths of the run, from its first place: distances of points from the cameras, not from the rigs, whose own
// lengths stay.
void ApplyScale(double scale, BundleProblem* p) {
  const std::vector<Eigen::Vector3d> arms = MeanArms(*p);
  const Eigen::Vector3d origin = p->poses[0].Inverse() * arms[0];
  for (size_t i = 0; i < p->poses.size(); ++i) {
    Rigid3d& pose = p->poses[i];
    pose.translation += (scale - 1) * (pose.rotation * origin + pose.translation - arms[i]);
  }
  for (Eigen::Vector3d& y : p->points) y = origin + scale * (y - origin);
  p->scales.front().value = scale;
}

// The bundle with what was measured in the world, and what follows from it.
void UseWorld(const Task& task, const WorldEvidence& evidence, EarthFit* earth, Localization* result) {
  BundleProblem& p = result->reconstruction.problem;
  WorldFit& fit = result->world;
  earth->covariance.reset();
  earth->input.registration = result->geo;
  fit = FitWorld(task.input, earth->input, task.gps, evidence, task.options.geo, task.Bundle(), &p,
                 &result->reconstruction.summary, task.progress, task.cancel);
  earth->covariance = CovarianceOf(task, result);
  result->on_earth = fit.solved;
  result->earth_reason = fit.reason;
  if (!fit.solved) return;
  result->geo = GeoRegistrationOf(fit, earth->input, task.options.geo, p, *earth->covariance, &earth->with_fit,
                                  &result->odometry_scale_sigma);
  result->odometry_scale = p.scales.front().value;
  result->earth_source = SourceOf(fit);
  // The bundle takes errors of fixes as independent: one that all share is looked for here. Tags would show it.
  if (fit.gps && fit.map_tags.empty() && fit.control_tags.empty()) {
    CheckGpsShape(p, task.gps, task.options.geo, !fit.geotags, &result->geo);
    result->on_earth = result->geo.solved;
    result->earth_reason = result->geo.reason;
  }
  for (const std::string& warning : fit.warnings) task.progress.Log(LogLevel::kWarning, warning);
}

void LeaveOutHeadings(EarthInput* earth) {
  for (GeoObservation& o : earth->observations) o.has_heading = o.has_tilt = false;
}

void NoteGeotags(const std::vector<ReferenceViews>& references, const GeoStart& earth, Localization* result) {
  std::map<int, const ReferenceAnswer*> of_set;  // whose geotag is that of all photos of a hand-held set
  for (size_t k = 0; k < earth.references.size(); ++k) {
    if (earth.references[k] < 0) continue;
    const auto i = static_cast<size_t>(earth.references[k]);
    ReferenceAnswer& answer = result->references[i];
    answer.geotag_used = true;
    answer.geotag_outlier = result->geo.outlier[k];
    answer.geotag_difference = result->geo.residuals[k];
    if (references[i].set >= 0) of_set[references[i].set] = &answer;
  }
  for (size_t i = 0; i < references.size(); ++i) {
    ReferenceAnswer& answer = result->references[i];
    const auto shared = of_set.find(references[i].set);
    if (answer.pose < 0 || shared == of_set.end()) continue;
    answer.geotag_used = true;
    answer.geotag_outlier = shared->second->geotag_outlier;
    answer.geotag_difference = shared->second->geotag_difference;
  }
}

// Repeated structure can put a reference elsewhere with a few dozen points. Where its own geotag says so, more of them
// are needed; with many, it is the geotag that is wrong. Returns those that are rejected.
std::set<size_t> RejectContradicted(int least, Localization* result) {
  std::set<size_t> rejected;
  for (size_t i = 0; i < result->references.size(); ++i) {
    ReferenceAnswer& answer = result->references[i];
    Registration& g = answer.registration;
    const auto repeated = [](const ViewObservation& o) { return o.repeated; };
    const auto points =
        g.inliers.size() - static_cast<size_t>(std::count_if(g.inliers.begin(), g.inliers.end(), repeated));
    if (answer.pose < 0 || !answer.geotag_outlier || points >= static_cast<size_t>(least)) continue;
    g.status = AnswerStatus::kRejected;
    g.reason = fmt::format("{} points of the run fit a pose {:.1f} m from its geotag, {} needed where the two disagree",
                           points, answer.geotag_difference.norm(), least);
    rejected.insert(i);
  }
  return rejected;
}

void LeaveOutContradicted(const Task& task, const EarthInput& earth, Localization* result) {
  NoteGeotags(task.input.references, earth, result);
  LeaveOut(RejectContradicted(task.options.registration.min_contradicted_inliers, result), result);
}

// The Earth by geotags and GPS, and the odometry's scale with it. One more round with the scale applied makes the run's
// frame metric.
void UseSources(const Task& task, bool with_headings, EarthFit* earth, Localization* result) {
  BundleProblem& p = result->reconstruction.problem;
  result->geo = FitSources(task, p, 1, earth);
  if (result->geo.solved && !task.IsPaper()) {
    const double scale = result->odometry_scale = result->geo.world_from_odom.scale;
    LeaveOutContradicted(task, earth->input, result);
    ApplyScale(scale, &p);
    // Lever arms do not scale: one more solution accounts for it.
    earth->covariance.reset();
    result->reconstruction.summary = SolveBundle(p, task.Bundle(), task.progress, task.cancel);
    earth->input = CollectEarth(task, *result);
    if (!with_headings) LeaveOutHeadings(&earth->input);
    earth->covariance = CovarianceOf(task, result);
    result->geo = FitSources(task, p, 1 / scale, earth);
  }
  result->earth_reason = result->geo.reason;
  if (!result->geo.solved) return;
  result->on_earth = true;
  result->earth_source =
      earth->input.gps ? (earth->input.references.front() >= 0 ? "geotags and gps" : "gps") : "geotags";
  result->odometry_scale_sigma = std::sqrt(result->geo.covariance(6, 6));
}

// The strays among the references of one set, by how well each is known in the solution.
void FindStrays(std::vector<size_t> photos, const BundleProblem& p, const BundleCovariance& all,
                const std::vector<ReferenceAnswer>& answers, std::set<size_t>* strays) {
  std::vector<int> poses;
  for (const size_t i : photos) poses.push_back(answers[i].pose);
  const Eigen::MatrixXd joint = PlacesCovariance(p, poses, all);
  std::vector<Eigen::Vector3d> places;
  std::vector<Eigen::Matrix3d> covariances;
  for (size_t k = 0; k < poses.size(); ++k) {
    const auto at = 6 * static_cast<Eigen::Index>(k) + 3;
    places.push_back(p.poses[static_cast<size_t>(poses[k])].TargetOriginInSource());
    covariances.push_back(joint.block<3, 3>(at, at));
  }
  for (int k = 0; (k = StrayPhoto(places, covariances, kHeld_m)) >= 0;) {
    strays->insert(photos[static_cast<size_t>(k)]);
    photos.erase(photos.begin() + k), places.erase(places.begin() + k), covariances.erase(covariances.begin() + k);
  }
}

// Photos of hand-held sets that were answered one by one: those that stand elsewhere than the others leave the
// solution.
void LeaveOutStrays(const Task& task, EarthFit* earth, Localization* result) {
  BundleProblem& p = result->reconstruction.problem;
  std::map<int, std::vector<size_t>> sets;
  for (size_t i = 0; i < result->references.size(); ++i) {
    const int set = task.input.references[i].set;
    if (result->references[i].pose >= 0 && set >= 0) sets[set].push_back(i);
  }
  std::set<size_t> strays;
  for (const auto& [set, photos] : sets) FindStrays(photos, p, *earth->covariance, result->references, &strays);
  if (strays.empty()) return;
  for (const size_t i : strays) {
    Registration& g = result->references[i].registration;
    g.status = AnswerStatus::kRejected;
    g.reason = "stands elsewhere than the other photos of its set";
  }
  LeaveOut(strays, result);
  earth->covariance.reset();
  result->reconstruction.summary = SolveBundle(p, task.Bundle(), task.progress, task.cancel);
  earth->covariance = CovarianceOf(task, result);
}

EarthFit Georeference(const Task& task, const WorldEvidence& evidence, Localization* result) {
  result->odometry_scale_sigma = task.input.scale_sigma;
  EarthFit earth;
  earth.covariance = CovarianceOf(task, result);
  if (!task.IsPaper()) LeaveOutStrays(task, &earth, result);
  earth.input = CollectEarth(task, *result);
  const std::optional<std::string> other_headings = OtherHeadings(earth.input.observations);
  if (other_headings) {
    task.progress.Log(
        LogLevel::kWarning,
        "the headings of panoramas and photos contradict their positions: they seem to be " + *other_headings +
            "; expected degrees clockwise from true north. They are not used: correct heading_deg or the EXIF");
    LeaveOutHeadings(&earth.input);
  }
  if (!task.input.has_frame) {
    result->earth_reason = "the project has no origin: give geotags, GPS, control points or origin.json";
    return earth;
  }
  UseSources(task, !other_headings, &earth, result);
  if (evidence.Any()) {
    UseWorld(task, evidence, &earth, result);
  } else if (result->on_earth) {
    earth.with_fit =
        CovarianceWithFit(result->reconstruction.problem, earth.input.poses, result->geo, *earth.covariance);
  }
  return earth;
}

// Where no panorama is localized: their pictures may be mirrored.
void TellMirrored(const Task& task, const Localization& result) {
  if (std::any_of(result.references.begin(), result.references.end(), IsLocalized)) return;
  const auto mirrored =
      FindMirroredPanoramas(task.input, result.reconstruction, task.options.retrieval, task.options.registration,
                            task.threads, task.seed, task.progress, task.cancel);
  if (mirrored) task.progress.Log(LogLevel::kWarning, *mirrored);
}

// Rejects panoramas whose pictures are stretched, by their own matches or by those of all from the same source.
void RejectStretched(const std::vector<ReferenceViews>& references, ProgressSink& progress,
                     std::vector<ReferenceAnswer>* answers) {
  std::map<std::string, StretchVotes> of_source;
  for (size_t i = 0; i < references.size(); ++i) {
    const StretchVotes& votes = (*answers)[i].registration.stretch;
    if (votes.stretched.empty()) continue;
    StretchVotes& sum = of_source[references[i].source];
    sum.stretched.resize(votes.stretched.size());
    for (size_t k = 0; k < votes.stretched.size(); ++k) sum.stretched[k] += votes.stretched[k];
    sum.as_it_is += votes.as_it_is;
  }
  int rejected = 0;
  std::string first;
  for (size_t i = 0; i < references.size(); ++i) {
    Registration& g = (*answers)[i].registration;
    const StretchVotes& votes = g.stretch;
    if (!IsLocalized((*answers)[i]) || votes.stretched.empty()) continue;
    std::optional<int> factor = StretchShown(votes);
    // With few matches far from the horizon it cannot show it alone, but its matches have to say the same.
    if (!factor) factor = StretchShown(of_source[references[i].source]);
    if (!factor || votes.stretched[static_cast<size_t>(*factor)] <= votes.as_it_is) continue;
    g.status = AnswerStatus::kRejected;
    const std::string stretched =
        fmt::format("heights above the horizon are {:.2f} times too large", StretchFactor(*factor));
    g.reason = "its picture seems to be stretched: " + stretched;
    if (rejected++ == 0) first = references[i].name + ": " + stretched;
  }
  if (rejected == 0) return;
  progress.Log(LogLevel::kWarning, Counted(rejected, "panorama is", "panoramas are") +
                                       " not used, as pictures seem to be stretched (" + first +
                                       "); expected 360 by 180 deg, 2:1: give the angles that they show (GPano), or "
                                       "add the missing sky and ground");
}

// As published: the points stay as they are, the references' poses are appended for the global fit only.
void HoldReferences(Localization* result) {
  BundleProblem& p = result->reconstruction.problem;
  for (ReferenceAnswer& answer : result->references) {
    if (!IsLocalized(answer)) continue;
    AddPose(&answer, &p);
    PoseFactor held;
    held.kind = PoseFactor::Kind::kPrior;
    held.a = answer.pose;
    held.measured = answer.registration.rig_from_odom;
    held.sqrt_info = Matrix6d(answer.registration.covariance.llt().solve(Matrix6d::Identity())).llt().matrixU();
    p.factors.push_back(held);
  }
}

// Matches of references that joined the solution together, and their noise.
struct MatchGroup {
  std::vector<WeighedMatch> matches;
  double unknowns = 0;  // of their poses
  double sigma_px = 0;
};

// References whose matches no longer fix them, as too few still fit the solution or their points have gone far away,
// are left out of it. Returns whether any is.
bool LeaveOutUndetermined(double most_sigma_m, std::vector<MatchGroup>* groups, Localization* result) {
  Reconstruction& r = result->reconstruction;
  std::map<size_t, std::vector<size_t>> observations;
  for (const MatchGroup& group : *groups) {
    for (const WeighedMatch& match : group.matches)
      observations[ReferenceOf(r, match.observation)].push_back(match.observation);
  }
  std::set<size_t> left_out;
  for (const auto& [reference, its] : observations) {
    ReferenceAnswer& answer = result->references[reference];
    const auto pose = static_cast<size_t>(answer.pose);
    if (LargestPositionSigma(r.problem.poses[pose], r.problem, its) <= most_sigma_m) continue;
    answer.registration.status = AnswerStatus::kRejected;
    answer.registration.reason = "the points that it sees do not fix its position in the solution of all";
    left_out.insert(reference);
  }
  if (left_out.empty()) return false;
  LeaveOut(left_out, result);
  for (MatchGroup& group : *groups) {
    const auto before = static_cast<double>(group.matches.size());
    std::erase_if(group.matches,
                  [&](const WeighedMatch& m) { return left_out.count(ReferenceOf(r, m.observation)) > 0; });
    if (before > 0) group.unknowns *= static_cast<double>(group.matches.size()) / before;
  }
  return true;
}

// Gives the matches the noise that they show: not less than that of the images' features, which are found in the same
// way. Returns the factor by which it grew. `unknowns`: others that they determine.
double UpdateNoise(const RegistrationOptions& options, double unknowns, MatchGroup* group, Reconstruction* r) {
  constexpr double kMostNoise = 10;
  BundleProblem& p = r->problem;
  const double shown = group->sigma_px * MatchNoise(p, group->matches, group->unknowns + unknowns);
  const double factor = std::max(r->sigma_px, std::min(shown, kMostNoise * options.sigma_px)) / group->sigma_px;
  group->sigma_px *= factor;
  for (const WeighedMatch& match : group->matches) {
    BearingObservation& o = p.observations[match.observation];
    o.w /= static_cast<float>(factor);
    o.active = r->point_valid[static_cast<size_t>(o.point)] && SquaredError(p, o) < options.outlier_chi2;
  }
  return factor;
}

// Solved again with the noise that the references show. How far points follow the references depends on it: in turns.
void SolveWithNoise(const Task& task, double unknowns, std::vector<MatchGroup>* groups, Localization* result) {
  constexpr int kRounds = 3;
  constexpr double kSettled = 0.1;
  constexpr double kNothing_m = 1000;  // a position as uncertain as this is held by nothing
  const RegistrationOptions& options = task.options.registration;
  Reconstruction& r = result->reconstruction;
  size_t matches = 0;
  for (const MatchGroup& group : *groups) matches += group.matches.size();
  const auto solve = [&] { r.summary = SolveBundle(r.problem, task.RoughBundle(), task.progress, task.cancel); };
  for (int round = 0; round < kRounds; ++round) {
    bool settled = true;
    for (MatchGroup& group : *groups) {
      if (group.matches.empty()) continue;
      const double share = static_cast<double>(group.matches.size()) / static_cast<double>(matches);
      settled &= std::abs(std::log(UpdateNoise(options, share * unknowns, &group, &r))) < kSettled;
    }
    LeaveOutUndetermined(kNothing_m, groups, result);
    solve();
    if (settled) break;
  }
  if (LeaveOutUndetermined(options.max_sigma_m, groups, result)) solve();
}

// Which references are to see what is aligned alone: those that have enough of it to be localized by.
std::vector<bool> WellAligned(const RegistrationOptions& options, const AlignedViews& found,
                              const Localization& result) {
  const size_t enough = 3 * static_cast<size_t>(options.min_inliers);
  const Reconstruction& r = result.reconstruction;
  std::vector<std::vector<size_t>> aligned(result.references.size());
  for (const size_t k : found.observations) aligned[ReferenceOf(r, k)].push_back(k);
  std::vector<bool> well(aligned.size(), false);
  for (size_t i = 0; i < well.size(); ++i) {
    if (aligned[i].size() < enough) continue;
    const Rigid3d& pose = r.problem.poses[static_cast<size_t>(result.references[i].pose)];
    well[i] = LargestPositionSigma(pose, r.problem, aligned[i]) <= options.max_sigma_m;
  }
  return well;
}

// References that see the spots of points that the run's images show, by alignment, in place of features that were
// found by themselves: those whose pictures do not show the same are left out where the others suffice. What is aligned
// is a group of its own, the second one.
void AlignWithImages(const Task& task, const std::vector<ReferenceViews>& references, const std::vector<bool>& taken,
                     std::vector<MatchGroup>* groups, Localization* result) {
  if (!task.input.reference_pictures || !task.input.image_picture) return;
  Reconstruction& r = result->reconstruction;
  std::vector<int> first_view(references.size(), -1);
  for (size_t i = 0; i < references.size(); ++i) {
    if (taken[i] && result->references[i].pose >= 0) first_view[i] = result->references[i].views.first;
  }
  const AlignedViews found =
      AlignViews(task.input, references, first_view, r, task.threads, task.progress, task.cancel);
  MatchGroup& as_found = groups->front();
  const std::vector<bool> well = WellAligned(task.options.registration, found, *result);
  std::map<size_t, Eigen::Vector2f> pixel_of;  // of observations
  for (size_t k = 0; k < found.observations.size(); ++k) pixel_of[found.observations[k]] = found.pixels[k];
  const std::set<size_t> elsewhere(found.elsewhere.begin(), found.elsewhere.end());
  const double unknowns = as_found.unknowns;
  MatchGroup by_pictures{{}, 0, as_found.sigma_px};
  for (const WeighedMatch& match : std::exchange(as_found.matches, {})) {
    BearingObservation& o = r.problem.observations[match.observation];
    const size_t reference = ReferenceOf(r, match.observation);
    const auto pixel = pixel_of.find(match.observation);
    const bool untried = o.active && pixel == pixel_of.end() && elsewhere.count(match.observation) == 0;
    if (!well[reference] || untried) {
      as_found.matches.push_back(match);
    } else if (pixel == pixel_of.end()) {
      o.active = false;
    } else {
      const Camera& camera =
          references[reference].rig.views[static_cast<size_t>(o.view - first_view[reference])].camera;
      const Eigen::Vector2d px = pixel->second.cast<double>();
      o.ray = camera.Unproject(px)->cast<float>();
      o.w = (std::sqrt(match.weight) * camera.BearingSqrtInfo(px, by_pictures.sigma_px)).cast<float>();
      by_pictures.matches.push_back(match);
    }
  }
  if (by_pictures.matches.empty()) return;
  const double kept = static_cast<double>(as_found.matches.size() + by_pictures.matches.size());
  by_pictures.unknowns = unknowns * static_cast<double>(by_pictures.matches.size()) / kept;
  as_found.unknowns = unknowns - by_pictures.unknowns;
  groups->push_back(std::move(by_pictures));
  task.progress.Log(LogLevel::kInfo,
                    fmt::format("{} of {} observations of references aligned with the pictures of their points",
                                found.observations.size(), found.tried));
}

// The panoramas taken by whom they are from: these are put together in the same way.
std::map<std::string, std::vector<RigViews>> PanoramasBySource(const std::vector<ReferenceViews>& references,
                                                               const std::vector<bool>& taken,
                                                               const std::vector<ReferenceAnswer>& answers) {
  std::map<std::string, std::vector<RigViews>> of_source;
  for (size_t i = 0; i < references.size(); ++i) {
    const ReferenceViews& r = references[i];
    const int views = static_cast<int>(r.rig.views.size());
    if (!taken[i] || answers[i].pose < 0 || r.kind != ReferenceKind::kPanorama || views < 2) continue;
    of_source[r.source].push_back({answers[i].pose, answers[i].views.first, views});
  }
  return of_source;
}

// Panoramas whose views show themselves to be turned against each other.
void TurnPanoramas(const Task& task, const std::vector<ReferenceViews>& references, const std::vector<bool>& taken,
                   std::vector<MatchGroup>* groups, Localization* result) {
  constexpr int kRounds = 4;
  constexpr double kSettled = 0.05;  // of the sigma
  Reconstruction& r = result->reconstruction;
  BundleProblem& p = r.problem;
  p.pose_shifts.resize(0, 0);
  for (const auto& [source, panoramas] : PanoramasBySource(references, taken, result->references)) {
    const auto shown = FindViewTurns(panoramas, p, task.threads, task.cancel);
    if (!shown) continue;
    const std::vector<TurnedView> views = FreeViews(panoramas, *shown, &p);
    TurnsShown turns{*shown, 0};
    for (int round = 0; round < kRounds; ++round) {
      SolveBundle(p, task.RoughBundle(), task.progress, task.cancel);
      const double before = turns.sigma_rad;
      turns = UpdateTurns(views, task.threads, task.cancel, &p);
      SolveWithNoise(task, turns.unknowns, groups, result);
      if (std::abs(turns.sigma_rad - before) < kSettled * before) break;
    }
    task.progress.Log(LogLevel::kInfo,
                      fmt::format("the parts of the panoramas{} are turned against each other by {:.3f} deg (1 sigma), "
                                  "as their points show; the panoramas' sigmas contain it",
                                  source.empty() ? "" : " from " + source, turns.sigma_rad * kRadToDeg));
  }
}

// The references taken join the solution, with the noise that they show in it.
void SolveWith(const Task& task, const std::vector<ReferenceViews>& references, const std::vector<bool>& taken,
               Localization* result) {
  Reconstruction& r = result->reconstruction;
  AddReferences(references, taken, task.options.registration.sigma_px, &result->references, &r);
  std::vector<MatchGroup> groups = {{MatchesOf(result->references, taken, r), 0, task.options.registration.sigma_px}};
  for (size_t i = 0; i < taken.size(); ++i)
    groups.front().unknowns += taken[i] && result->references[i].pose >= 0 ? kPoseUnknowns : 0;
  LeaveOutUndetermined(task.options.registration.max_sigma_m, &groups, result);
  SolveBundle(r.problem, task.RoughBundle(), task.progress, task.cancel);
  SolveWithNoise(task, 0, &groups, result);
  AlignWithImages(task, references, taken, &groups, result);
  if (groups.size() > 1) SolveWithNoise(task, 0, &groups, result);
  TurnPanoramas(task, references, taken, &groups, result);
}

// The stitched sets follow once `refine` has seen what the others say.
void SolveJointly(const Task& task, const RefineReferences& refine, std::vector<ReferenceViews> references,
                  std::vector<Registration> registrations, Localization* result) {
  std::vector<bool> sets(references.size()), others(references.size());
  for (size_t i = 0; i < references.size(); ++i) {
    sets[i] = refine && references[i].stitched;
    others[i] = !sets[i];
  }
  SolveWith(task, references, others, result);
  if (std::find(sets.begin(), sets.end(), true) == sets.end()) return;
  refine(result->reconstruction, result->retrieval, &references, &registrations);
  for (size_t i = 0; i < references.size(); ++i) {
    if (sets[i]) result->references[i].registration = registrations[i];
  }
  SolveWith(task, references, sets, result);
}

// The views' own poses (G1) and the distances were found before the run's scale was: they follow it.
void ScaleRegistrations(Localization* result) {
  const BundleProblem& p = result->reconstruction.problem;
  const Eigen::Vector3d origin = p.poses[0].Inverse() * MeanArms(p)[0];
  const double scale = result->odometry_scale;
  for (ReferenceAnswer& answer : result->references) {
    answer.registration.distance_m *= scale;
    for (ViewAnswer& view : answer.registration.views) {
      view.view_from_odom = Stretched(view.view_from_odom, origin, scale);
      view.distance_m *= scale;
    }
  }
}

// World pose of one of the problem's poses.
PoseEstimate WorldPose(const Localization& result, int pose) {
  const auto at = static_cast<size_t>(pose);
  const Rigid3d& rig_from_odom = result.reconstruction.problem.poses[at];
  const Matrix6d own = InverseCovariance(rig_from_odom, result.pose_covariances[at]);
  return ToWorld(result.geo, rig_from_odom.Inverse(), own, result.with_fit[at]);
}

// The camera rides on the body: its position moves with the body's rotation.
PoseEstimate CameraOnBody(const PoseEstimate& body, const Rigid3d& body_from_cam) {
  PoseEstimate camera;
  camera.world_from_x = body.world_from_x * body_from_cam;
  Matrix6d j = Matrix6d::Identity();
  j.bottomLeftCorner<3, 3>() = -Skew(body.world_from_x.rotation * body_from_cam.translation);
  camera.covariance = j * body.covariance * j.transpose();
  return camera;
}

// What the solved problem says of references, bodies and cameras.
void Answer(const Task& task, EarthFit earth, Localization* result) {
  const BundleProblem& p = result->reconstruction.problem;
  std::vector<Matrix6d> unused;
  std::move(*earth.covariance).PoseBlocks({}, &result->pose_covariances, &unused);
  earth.covariance.reset();
  for (Eigen::Index row = 0; row < earth.with_fit.rows(); row += 6)
    result->with_fit.push_back(earth.with_fit.middleRows<6>(row));
  for (ReferenceAnswer& answer : result->references) {
    if (answer.pose < 0) continue;
    answer.registration.rig_from_odom = p.poses[static_cast<size_t>(answer.pose)];
    answer.registration.covariance = result->pose_covariances[static_cast<size_t>(answer.pose)];
    if (result->on_earth) answer.world = WorldPose(*result, answer.pose);
  }
  if (result->odometry_scale != 1) ScaleRegistrations(result);
  const size_t body_poses = task.input.odom_from_body.size();
  if (result->on_earth) {
    NoteGeotags(task.input.references, earth.input, result);
    // The published method takes geotags as given: it rejects no panorama by its own.
    if (!task.IsPaper()) {
      for (const size_t i : RejectContradicted(task.options.registration.min_contradicted_inliers, result)) {
        result->references[i].pose = -1;
      }
    }
    std::vector<PoseEstimate> bodies(body_poses);
    ParallelFor(static_cast<int64_t>(body_poses), task.threads, task.cancel,
                [&](int64_t i) { bodies[static_cast<size_t>(i)] = WorldPose(*result, static_cast<int>(i)); });
    for (const FrameImage& image : task.input.images) {
      const Rigid3d body_from_cam = task.input.cameras[static_cast<size_t>(image.camera)].cam_from_body.Inverse();
      result->cameras.push_back(CameraOnBody(bodies[static_cast<size_t>(image.pose)], body_from_cam));
    }
  }
  result->body_from_odom.assign(p.poses.begin(), p.poses.begin() + static_cast<std::ptrdiff_t>(body_poses));
}

}  // namespace

LocalizeOptions LocalizeOptions::ForMode(const std::string& mode) {
  LocalizeOptions o;
  o.mode = mode;
  if (mode == "paper") {
    o.registration.ratio = 0.7;
  } else if (mode != "trigpoint") {
    throw OptionError("mode is '" + mode + "', expected trigpoint or paper");
  }
  return o;
}

std::vector<std::string> LocalizeOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (mode != "trigpoint" && mode != "paper")
    problems.push_back("option mode is '" + mode + "', expected trigpoint or paper");
  return problems;
}

Localization Localize(const LocalizeInput& input, Reconstruction run, const std::vector<GpsPlace>& gps,
                      const LocalizeOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                      const CancelToken& cancel, const RefineReferences& refine, const WorldEvidence& world_evidence) {
  const Task task{input, gps, options, threads, seed, progress, cancel};
  const bool paper = task.IsPaper();
  Localization result;
  result.reconstruction = std::move(run);
  StepTimes steps(&result.seconds);
  result.retrieval =
      RetrieveViews(input, options.geo.use_gps == "never" ? std::vector<GpsPlace>() : gps, options.retrieval,
                    options.registration.max_distance_m, paper, seed, threads, progress, cancel);
  steps.End("retrieval");
  std::vector<Registration> registrations = RegisterReferences(
      input, result.reconstruction, result.retrieval, options.registration, paper, threads, seed, progress, cancel);
  std::vector<ReferenceViews> references = input.references;
  if (!paper) {
    result.photo_focals = RefinePhotoFocals(input, result.reconstruction, result.retrieval, options.registration,
                                            threads, seed, progress, cancel, &references, &registrations);
  }
  for (const Registration& g : registrations) result.references.emplace_back().registration = g;
  RejectStretched(references, progress, &result.references);
  AgreeOnSets(input, options.registration.set_radius_m, &result.references);
  if (!paper) TellMirrored(task, result);
  steps.End("registration");
  if (paper) {
    HoldReferences(&result);
  } else {
    SolveJointly(task, refine, std::move(references), std::move(registrations), &result);
    Reconstruction& r = result.reconstruction;
    r.summary = SolveBundle(r.problem, task.Bundle(), progress, cancel);
  }
  steps.End("joint solution");
  EarthFit earth = Georeference(task, world_evidence, &result);
  Answer(task, std::move(earth), &result);
  steps.End("earth and covariances");
  return result;
}

Localization LocalizeAtItsLength(bool has_odometry, const std::function<Localization(double length)>& localize) {
  constexpr int kRounds = 3;
  constexpr double kGoodEnough = 1.1;
  double length = 1;
  for (int round = 1;; ++round) {
    Localization result = localize(length);
    const bool known = std::abs(std::log(result.odometry_scale)) < std::log(kGoodEnough);
    if (has_odometry || !result.on_earth || known || round == kRounds) return result;
    length *= result.odometry_scale;
  }
}

}  // namespace trigpoint
