#include "localize/localize.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include "calib/base/parallel.h"
#include "calib/estimation/loss.h"
#include "calib/geometry/similarity.h"
#include "localize/georegistration/gps_check.h"
#include "localize/reconstruct/lens_check.h"
#include "localize/references/mirrored.h"

namespace trigpoint {
namespace {

// The joint problem over images, points and references: indices of the references' poses (-1: not part of it).
struct Joint {
  std::vector<int> pose_of_reference;
};

// Adds the localized ones of the references taken to the reconstruction: a pose each, their observations, sorted by
// point.
void AddReferences(const std::vector<ReferenceViews>& references, const std::vector<ReferenceAnswer>& answers,
                   const std::vector<bool>& taken, double sigma_px, Reconstruction* r, Joint* joint) {
  BundleProblem& p = r->problem;
  std::vector<ImageObservation> rows;
  for (size_t i = 0; i < answers.size(); ++i) {
    const Registration& g = answers[i].registration;
    if (!taken[i] || g.status != AnswerStatus::kLocalized) continue;
    const ReferenceViews& ref = references[i];
    const int first_view = static_cast<int>(p.views.size());
    for (const View& v : ref.rig.views) p.views.push_back(v.rig_from_view.Inverse());
    joint->pose_of_reference[i] = static_cast<int>(p.poses.size());
    for (const ViewObservation& v : g.inliers) {
      if (v.repeated) continue;
      const Camera& camera = ref.rig.views[static_cast<size_t>(v.view)].camera;
      BearingObservation o;
      o.point = v.point;
      o.pose = joint->pose_of_reference[i];
      o.view = first_view + v.view;
      o.ray = camera.Unproject(v.pixel.cast<double>())->cast<float>();
      o.w = (std::sqrt(v.weight) * camera.BearingSqrtInfo(v.pixel.cast<double>(), sigma_px)).cast<float>();
      // image -1 - reference, feature within its view: told apart from the run's own
      rows.push_back({o, -1 - static_cast<int>(i), v.feature});
    }
    p.poses.push_back(g.rig_from_odom);
    p.pose_constant.push_back(false);
  }
  AddObservations(rows, r);
}

// Whether an observation is one of the references taken.
bool IsOf(const Reconstruction& r, size_t k, const std::vector<bool>& taken) {
  return r.image_of[k] < 0 && taken[static_cast<size_t>(-1 - r.image_of[k])];
}

// Noise of the observations of the references taken from their residuals (points carry their share): one factor for
// all.
double ReferenceNoiseFactor(const Reconstruction& r, const std::vector<bool>& taken) {
  std::vector<double> errors;
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    if (IsOf(r, k, taken) && r.problem.observations[k].active)
      errors.push_back(SquaredError(r.problem, r.problem.observations[k]));
  }
  if (errors.size() < 50) return 1;
  const size_t middle = errors.size() / 2;
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(middle), errors.end());
  return std::sqrt(errors[middle] / 1.386);  // median of chi-square with 2 dof
}

// Of the solved problem, with what the lenses leave open.
std::unique_ptr<BundleCovariance> CovarianceOf(const LocalizeInput& input, int threads, const CancelToken& cancel,
                                               Reconstruction* r) {
  r->problem.pose_shifts = PoseShiftsByLenses(input, *r, threads, cancel);
  return std::make_unique<BundleCovariance>(r->problem, threads, cancel);
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
// accepted, the others rejected. The whole set is rejected if most of its poses disagree or only one photo has a pose.
void AgreeOnSets(const LocalizeInput& input, double radius, std::vector<ReferenceAnswer>* answers) {
  std::map<int, std::vector<size_t>> sets;
  for (size_t i = 0; i < answers->size(); ++i) {
    if (input.references[i].set >= 0) sets[input.references[i].set].push_back(i);
  }
  for (const auto& [set, members] : sets) {
    std::vector<size_t> answered;
    for (size_t i : members) {
      if ((*answers)[i].registration.status == AnswerStatus::kLocalized) answered.push_back(i);
    }
    const auto centre = [&](size_t i) { return (*answers)[i].registration.rig_from_odom.TargetOriginInSource(); };
    std::vector<size_t> best;
    for (size_t i : answered) {
      std::vector<size_t> near;
      for (size_t j : answered) {
        if ((centre(i) - centre(j)).norm() < radius) near.push_back(j);
      }
      if (near.size() > best.size()) best = near;
    }
    const bool enough = members.size() == 1 || (best.size() >= 2 && 2 * best.size() > answered.size());
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

EarthInput CollectEarth(const LocalizeInput& input, const Localization& result, const Joint& joint,
                        const std::vector<GpsPlace>& gps, const GeoRegistrationOptions& options) {
  EarthInput e;
  const BundleProblem& p = result.reconstruction.problem;
  if (input.has_frame) {
    for (size_t i = 0; i < result.references.size(); ++i) {
      const GeoTag& tag = input.references[i].geotag;
      if (joint.pose_of_reference[i] < 0 || (!tag.has_position && !tag.has_heading)) continue;
      const Rigid3d& rig_from_odom = p.poses[static_cast<size_t>(joint.pose_of_reference[i])];
      e.observations.push_back(GeoObservationOf(tag, input.frame, rig_from_odom.Inverse()));
      e.observations.back().source = input.references[i].source;
      e.poses.push_back(joint.pose_of_reference[i]);
      e.references.push_back(static_cast<int>(i));
    }
  }
  const bool use_gps = options.use_gps == "always" || (options.use_gps == "auto" && e.observations.empty());
  if (use_gps) {
    int64_t last = std::numeric_limits<int64_t>::min();
    for (const GpsPlace& g : gps) {
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
      o.sigma_h_m = g.sigma_h_m, o.sigma_v_m = g.sigma_v_m;
      e.observations.push_back(o);
      e.poses.push_back(g.pose);
      e.references.push_back(-1);
      e.gps = true;
    }
  }
  return e;
}

// The bundle with what was measured in the world, and what follows from it.
void UseWorld(const LocalizeInput& input, const GeoStart& start, const std::vector<GpsPlace>& gps,
              const WorldEvidence& evidence, const GeoRegistrationOptions& options, const BundleOptions& bundle,
              ProgressSink& progress, const CancelToken& cancel, Localization* result, Eigen::MatrixXd* with_fit,
              std::unique_ptr<BundleCovariance>* covariance) {
  BundleProblem& p = result->reconstruction.problem;
  WorldFit& fit = result->world;
  fit = FitWorld(input, start, gps, evidence, options, bundle, &p, &result->reconstruction.summary, progress, cancel);
  *covariance = CovarianceOf(input, bundle.threads, cancel, &result->reconstruction);
  result->on_earth = fit.solved;
  result->earth_reason = fit.reason;
  if (!fit.solved) return;
  result->geo = GeoRegistrationOf(fit, start, options, p, **covariance, with_fit, &result->odometry_scale_sigma);
  result->odometry_scale = p.scales.front().value;
  result->earth_source = SourceOf(fit);
  for (const std::string& warning : fit.warnings) progress.Log(LogLevel::kWarning, warning);
}

// Where no panorama is localized: their pictures may be mirrored.
void TellMirrored(const LocalizeInput& input, const LocalizeOptions& options, int threads, uint64_t seed,
                  ProgressSink& progress, const CancelToken& cancel, const Localization& result) {
  const auto localized = [](const ReferenceAnswer& a) { return a.registration.status == AnswerStatus::kLocalized; };
  if (std::any_of(result.references.begin(), result.references.end(), localized)) return;
  const auto mirrored = FindMirroredPanoramas(input, result.reconstruction, options.retrieval, options.registration,
                                              threads, seed, progress, cancel);
  if (mirrored) progress.Log(LogLevel::kWarning, *mirrored);
}

void NoteGeotags(const GeoStart& earth, Localization* result) {
  for (size_t k = 0; k < earth.references.size(); ++k) {
    if (earth.references[k] < 0) continue;
    ReferenceAnswer& answer = result->references[static_cast<size_t>(earth.references[k])];
    answer.geotag_used = true;
    answer.geotag_outlier = result->geo.outlier[k];
    answer.geotag_difference = result->geo.residuals[k];
  }
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
  const bool paper = options.mode == "paper";
  Localization result;
  result.reconstruction = std::move(run);
  StepTimes steps(&result.seconds);
  Reconstruction& r = result.reconstruction;
  BundleProblem& p = r.problem;
  const size_t body_poses = input.odom_from_body.size();
  result.retrieval = RetrieveViews(input, options.retrieval, paper, seed, threads, progress, cancel);
  steps.End("retrieval");
  std::vector<Registration> registrations =
      RegisterReferences(input, r, result.retrieval, options.registration, paper, threads, seed, progress, cancel);
  for (const Registration& g : registrations) result.references.emplace_back().registration = g;
  AgreeOnSets(input, options.registration.set_radius_m, &result.references);
  if (!paper) TellMirrored(input, options, threads, seed, progress, cancel, result);
  steps.End("registration");

  BundleOptions bundle;
  bundle.threads = threads;
  bundle.max_iterations = 10;
  bundle.relative_cost_tolerance = 1e-5;
  Joint joint;
  if (paper) {
    // The points stay as they are: the references' poses are appended for the global fit only.
    joint.pose_of_reference.assign(registrations.size(), -1);
    for (size_t i = 0; i < registrations.size(); ++i) {
      if (result.references[i].registration.status != AnswerStatus::kLocalized) continue;
      joint.pose_of_reference[i] = static_cast<int>(p.poses.size());
      p.poses.push_back(registrations[i].rig_from_odom);
      p.pose_constant.push_back(false);
      PoseFactor held;
      held.kind = PoseFactor::Kind::kPrior;
      held.a = joint.pose_of_reference[i];
      held.measured = registrations[i].rig_from_odom;
      held.sqrt_info = Matrix6d(registrations[i].covariance.llt().solve(Matrix6d::Identity())).llt().matrixU();
      p.factors.push_back(held);
    }
  } else {
    std::vector<ReferenceViews> references = input.references;
    joint.pose_of_reference.assign(references.size(), -1);
    const auto solve_with = [&](const std::vector<bool>& taken) {
      AddReferences(references, result.references, taken, options.registration.sigma_px, &r, &joint);
      SolveBundle(p, bundle, progress, cancel);
      const double factor = std::clamp(ReferenceNoiseFactor(r, taken), 0.3, 10.0);
      for (size_t k = 0; k < p.observations.size(); ++k) {
        BearingObservation& o = p.observations[k];
        if (!IsOf(r, k, taken)) continue;
        o.w /= static_cast<float>(factor);
        o.active =
            r.point_valid[static_cast<size_t>(o.point)] && SquaredError(p, o) < options.registration.outlier_chi2;
      }
      r.summary = SolveBundle(p, bundle, progress, cancel);
    };
    std::vector<bool> sets(references.size()), others(references.size());
    for (size_t i = 0; i < references.size(); ++i) {
      sets[i] = refine && references[i].stitched;
      others[i] = !sets[i];
    }
    solve_with(others);
    if (std::find(sets.begin(), sets.end(), true) != sets.end()) {
      refine(r, result.retrieval, &references, &registrations);
      for (size_t i = 0; i < references.size(); ++i) {
        if (sets[i]) result.references[i].registration = registrations[i];
      }
      solve_with(sets);
    }
  }
  steps.End("joint solution");

  // The Earth, and the odometry's scale with it. One more round with the scale applied makes the run's frame metric.
  result.odometry_scale_sigma = input.scale_sigma;
  EarthInput earth = CollectEarth(input, result, joint, gps, options.geo);
  const std::optional<std::string> other_headings = OtherHeadings(earth.observations);
  const auto leave_out_headings = [&] {
    for (GeoObservation& o : earth.observations) o.has_heading = o.has_tilt = false;
  };
  if (other_headings) {
    progress.Log(LogLevel::kWarning, "judging by their positions, the headings of the panoramas seem to be " +
                                         *other_headings +
                                         "; expected degrees clockwise from north; not used: correct table or EXIF");
    leave_out_headings();
  }
  std::unique_ptr<BundleCovariance> local = CovarianceOf(input, threads, cancel, &r);
  if (!input.has_frame) {
    result.earth_reason = "the project has no origin: give geotags, GPS, control points or origin.json";
  } else {
    const auto fit = [&](double scale_prior) {
      GeoRegistration geo = RegisterBySources(&earth.observations, PlacesCovariance(p, earth.poses, *local),
                                              scale_prior, input.scale_sigma, input.levelled, options.geo);
      earth.gps ? CheckGpsShape(p, gps, options.geo, earth.references.front() < 0, &geo) : HeedGps(p, gps, &geo);
      return geo;
    };
    result.geo = fit(1);
    if (result.geo.solved && !paper) {
      const double scale = result.odometry_scale = result.geo.world_from_odom.scale;
      const Eigen::Vector3d origin = p.poses[0].TargetOriginInSource();
      for (Rigid3d& pose : p.poses) {
        const Eigen::Vector3d centre = origin + scale * (pose.TargetOriginInSource() - origin);
        pose.translation = -(pose.rotation * centre);
      }
      for (Eigen::Vector3d& y : p.points) y = origin + scale * (y - origin);
      p.scales.front().value = scale;
      // Lever arms do not scale: one more solution accounts for it.
      bundle.max_iterations = 5;
      local.reset();
      r.summary = SolveBundle(p, bundle, progress, cancel);
      earth = CollectEarth(input, result, joint, gps, options.geo);
      if (other_headings) leave_out_headings();
      local = CovarianceOf(input, threads, cancel, &r);
      result.geo = fit(1 / scale);
    }
    result.earth_reason = result.geo.reason;
    if (result.geo.solved) {
      result.on_earth = true;
      result.earth_source = earth.gps ? (earth.references.front() >= 0 ? "geotags and gps" : "gps") : "geotags";
      result.odometry_scale_sigma = std::sqrt(result.geo.covariance(6, 6));
    }
  }
  Eigen::MatrixXd with_fit;
  if (world_evidence.Any() && input.has_frame) {
    local.reset();
    earth.registration = result.geo;
    bundle.max_iterations = 20;
    UseWorld(input, earth, gps, world_evidence, options.geo, bundle, progress, cancel, &result, &with_fit, &local);
  } else if (result.on_earth) {
    with_fit = CovarianceWithFit(p, earth.poses, result.geo, *local);
  }

  // Answers.
  const auto odom_from = [&](int pose) { return p.poses[static_cast<size_t>(pose)].Inverse(); };
  std::vector<Matrix6d>& covariances = result.pose_covariances;
  std::vector<Matrix6d> unused;
  std::move(*local).PoseBlocks({}, &covariances, &unused);
  local.reset();
  for (Eigen::Index row = 0; row < with_fit.rows(); row += 6) result.with_fit.push_back(with_fit.middleRows<6>(row));
  const auto world = [&](int pose) {
    const Matrix6d own = InverseCovariance(p.poses[static_cast<size_t>(pose)], covariances[static_cast<size_t>(pose)]);
    return ToWorld(result.geo, odom_from(pose), own, result.with_fit[static_cast<size_t>(pose)]);
  };
  for (size_t i = 0; i < result.references.size(); ++i) {
    ReferenceAnswer& answer = result.references[i];
    const int pose = joint.pose_of_reference[i];
    if (pose < 0) continue;
    answer.pose = pose;
    answer.registration.rig_from_odom = p.poses[static_cast<size_t>(pose)];
    answer.registration.covariance = covariances[static_cast<size_t>(pose)];
    if (result.on_earth) answer.world = world(pose);
  }
  if (result.on_earth) {
    NoteGeotags(earth, &result);
    std::vector<PoseEstimate> bodies(body_poses);
    ParallelFor(static_cast<int64_t>(body_poses), threads, cancel,
                [&](int64_t i) { bodies[static_cast<size_t>(i)] = world(static_cast<int>(i)); });
    for (const FrameImage& image : input.images) {
      const PoseEstimate& body = bodies[static_cast<size_t>(image.pose)];
      const Rigid3d body_from_cam = input.cameras[static_cast<size_t>(image.camera)].cam_from_body.Inverse();
      PoseEstimate camera;
      camera.world_from_x = body.world_from_x * body_from_cam;
      // The camera rides on the body: its position moves with the body's rotation.
      Matrix6d j = Matrix6d::Identity();
      j.bottomLeftCorner<3, 3>() = -Skew(body.world_from_x.rotation * body_from_cam.translation);
      camera.covariance = j * body.covariance * j.transpose();
      result.cameras.push_back(camera);
    }
  }
  result.body_from_odom.assign(p.poses.begin(), p.poses.begin() + static_cast<std::ptrdiff_t>(body_poses));
  steps.End("earth and covariances");
  return result;
}

}  // namespace trigpoint
