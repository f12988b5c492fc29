#include "localize/reconstruct/rig_length.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/lens_shift.h"
#include "localize/reconstruct/structure_from_motion.h"

namespace trigpoint {
namespace {

constexpr double kOneCentre_m = 1e-3;
// `localize` takes thresholds in metres to hold where a length is right to a tenth.
constexpr double kKnownShare = 0.1;
constexpr size_t kMostPoses = 150;  // as in lens_bundle.cc; of longer runs some stretches
constexpr size_t kStretches = 5, kPosesOfStretch = 60;
constexpr size_t kMostImages = 60;  // of a stretch that stand apart, evenly spread
constexpr size_t kPartners = 4;     // images that each of them is matched with
// Of the points' median distance: a stretch that is shorter does not show the unit. Rays of 1/500 rad give the length
// of one with this share to 2 % by one point, to 0.3 %, as well as a calibration is known, by the 60 of an image.
constexpr double kLeastExtent = 0.1;
// As in the first rounds of a reconstruction: a calibration's usual error moves pixels by more than the noise.
constexpr double kGate = 9;

std::vector<Eigen::Vector3d> FirstCentres(const LocalizeInput& input) {
  std::vector<Eigen::Vector3d> centres(input.pose_stamps.size(), Eigen::Vector3d::Zero());
  std::vector<bool> known(centres.size(), false);
  for (const FrameImage& image : input.images) {
    const auto pose = static_cast<size_t>(image.pose);
    if (known[pose]) continue;
    centres[pose] = input.cameras[static_cast<size_t>(image.camera)].cam_from_body.TargetOriginInSource();
    known[pose] = true;
  }
  return centres;
}

// From an image's camera to the first centre of its pose, m, camera axes.
Eigen::Vector3d ArmOf(const LocalizeInput& input, const FrameImage& image, const Eigen::Vector3d& first_centre) {
  const Rigid3d& cam_from_body = input.cameras[static_cast<size_t>(image.camera)].cam_from_body;
  return cam_from_body * first_centre;
}

Rigid3d RotationAlone(const Rigid3d& t) { return {t.rotation, Eigen::Vector3d::Zero()}; }

// A scene point in an image that stands apart. W of the observation times (in_cam + a arm_m) is zero.
struct ApartMatch {
  ImageObservation seen;
  Eigen::Vector3d in_cam;  // units, as from the first centre
  Eigen::Vector3d arm_m;

  Eigen::Matrix<double, 2, 3> W() const { return seen.o.w.cast<double>(); }
  // The a with which the whitened residual is least.
  double Inverse() const { return -(W() * arm_m).dot(W() * in_cam) / (W() * arm_m).squaredNorm(); }
  // By how many sigmas it moves the observation where a changes by 1.
  double Shift() const { return (W() * arm_m).norm() / in_cam.norm(); }
  double Chi2(double inverse) const {
    const Eigen::Vector3d u = (in_cam + inverse * arm_m).normalized();
    return u.dot(seen.o.ray.cast<double>()) > 0 ? (W() * u).squaredNorm() : std::numeric_limits<double>::infinity();
  }
};

// A stretch of a run about the first centres of its poses.
class Stretch {
 public:
  Stretch(const LocalizeInput& input, const Reconstruction& first, size_t begin, size_t end)
      : input_(input), begin_(static_cast<int>(begin)), centres_(FirstCentres(input)) {
    LocalizeInput motion;
    motion.has_odometry = false;
    for (size_t k = begin; k < end; ++k) {
      Rigid3d pose = first.problem.poses[k];
      pose.translation -= centres_[k];
      r_.problem.poses.push_back(pose);
      motion.odom_from_body.push_back(pose.Inverse());
    }
    // One factor holds the length; the others only connect what no points connect.
    ReconstructOptions weak;
    weak.odometry_rotation_deg = 20;
    weak.odometry_translation_part = 0.5;
    r_.problem.factors = OdometryFactors(motion, weak, Vector6d::Ones());
    r_.problem.points = first.problem.points;
    r_.point_valid = first.point_valid;
    r_.sigma_px = first.sigma_px;
    r_.correlation_inflation = first.correlation_inflation;
    for (size_t i = 0; i < first.problem.observations.size(); ++i) {
      BearingObservation o = first.problem.observations[i];
      if (!o.active || !r_.point_valid[static_cast<size_t>(o.point)] || !Contains(o.pose)) continue;
      o.pose -= begin_;
      r_.problem.observations.push_back(o);
      r_.image_of.push_back(first.image_of[i]);
      r_.feature_of.push_back(first.feature_of[i]);
      of_image_[first.image_of[i]].push_back(r_.problem.observations.size() - 1);
    }
  }

  bool Contains(int pose) const { return pose >= begin_ && pose < begin_ + static_cast<int>(r_.problem.poses.size()); }

  // Is it long enough against the distance of its points to show the unit of the reconstruction?
  bool Moves() const {
    const BundleProblem& p = r_.problem;
    std::vector<double> depths;
    for (const BearingObservation& o : p.observations) {
      depths.push_back((p.poses[static_cast<size_t>(o.pose)] * p.points[static_cast<size_t>(o.point)]).norm());
    }
    double extent = 0;
    for (const Rigid3d& pose : p.poses) {
      extent = std::max(extent, (pose.TargetOriginInSource() - p.poses.front().TargetOriginInSource()).norm());
    }
    return !depths.empty() && extent > kLeastExtent * Median(std::move(depths));
  }

  // Images that stand apart, at most kMostImages.
  std::vector<int> Apart(const std::vector<bool>& of_first_centre) const {
    std::vector<int> all;
    for (size_t i = 0; i < input_.images.size(); ++i) {
      if (!of_first_centre[i] && Contains(input_.images[i].pose)) all.push_back(static_cast<int>(i));
    }
    if (all.size() <= kMostImages) return all;
    std::vector<int> some;
    for (size_t k = 0; k < kMostImages; ++k) some.push_back(all[k * all.size() / kMostImages]);
    return some;
  }

  std::vector<ApartMatch> MatchesOf(int image, const ViewGraphOptions& options) const {
    const FeatureSet features = input_.image_features(image);
    const DescriptorBlock block(features.descriptors);
    std::set<int> points, taken;
    std::vector<ApartMatch> matches;
    for (const int partner : PartnersOf(image, options)) {
      std::map<int, int> point_of;
      for (const size_t k : of_image_.at(partner)) point_of[r_.feature_of[k]] = r_.problem.observations[k].point;
      const DescriptorBlock other(input_.image_features(partner).descriptors);
      for (const auto& [a, b] : MatchMutual(block, other, options.ratio, options.max_distance)) {
        const auto point = point_of.find(b);
        if (point == point_of.end() || points.count(point->second) > 0 || taken.count(a) > 0) continue;
        const auto match = MatchOf({point->second, image, a, features.points[static_cast<size_t>(a)]});
        if (!match) continue;
        points.insert(point->second), taken.insert(a);
        matches.push_back(*match);
      }
    }
    return matches;
  }

  const Reconstruction& reconstruction() const { return r_; }
  double sigma_px() const { return r_.sigma_px * r_.correlation_inflation; }

 private:
  // Of the first centre as if the camera stood there.
  Rigid3d CamFromOdom(int image) const {
    const FrameImage& its = input_.images[static_cast<size_t>(image)];
    return RotationAlone(input_.cameras[static_cast<size_t>(its.camera)].cam_from_body) *
           r_.problem.poses[static_cast<size_t>(its.pose - begin_)];
  }

  // Nothing without a distance that the observation can show.
  std::optional<ApartMatch> MatchOf(const TrackObservation& t) const {
    std::optional<BearingObservation> o = ObservationOf(input_, t, sigma_px());
    if (!o) return {};
    const FrameImage& image = input_.images[static_cast<size_t>(t.image)];
    ApartMatch match;
    match.in_cam = CamFromOdom(t.image) * r_.problem.points[static_cast<size_t>(t.track)];
    match.arm_m = ArmOf(input_, image, centres_[static_cast<size_t>(image.pose)]);
    o->pose -= begin_;
    match.seen = {*o, t.image, t.feature};
    if (!((match.W() * match.arm_m).norm() > 1e-9)) return {};
    return match;
  }

  // Images of the first centre with the most points that should be in this image and are seen from about the same
  // side; the nearest in time of those with as many.
  std::vector<int> PartnersOf(int image, const ViewGraphOptions& options) const {
    constexpr size_t kSample = 30;
    const Camera& camera = input_.cameras[static_cast<size_t>(input_.images[static_cast<size_t>(image)].camera)].camera;
    const Rigid3d cam_from_odom = CamFromOdom(image);
    const Eigen::Vector3d centre = cam_from_odom.TargetOriginInSource();
    std::vector<std::array<int, 3>> ranked;  // less points, time between, image
    for (const auto& [other, observations] : of_image_) {
      const Eigen::Vector3d its_centre = CamFromOdom(other).TargetOriginInSource();
      const size_t step = std::max<size_t>(1, observations.size() / kSample);
      int shown = 0;
      for (size_t k = 0; k < observations.size(); k += step) {
        const auto point = static_cast<size_t>(r_.problem.observations[observations[k]].point);
        const Eigen::Vector3d& y = r_.problem.points[point];
        const auto pixel = camera.Project(cam_from_odom * y);
        shown += pixel && camera.Contains(*pixel) &&
                         AngleBetween(y - centre, y - its_centre) < options.viewpoint_deg * kDegToRad
                     ? 1
                     : 0;
      }
      const int between =
          std::abs(input_.images[static_cast<size_t>(image)].pose - input_.images[static_cast<size_t>(other)].pose);
      if (shown > 0) ranked.push_back({-shown, between, other});
    }
    std::sort(ranked.begin(), ranked.end());
    std::vector<int> partners;
    for (size_t k = 0; k < std::min(kPartners, ranked.size()); ++k) partners.push_back(ranked[k][2]);
    return partners;
  }

  const LocalizeInput& input_;
  int begin_;
  std::vector<Eigen::Vector3d> centres_;
  Reconstruction r_;
  std::map<int, std::vector<size_t>> of_image_;  // observations of each image
};

// The median, each match counting by how well it shows the length.
double MedianInverse(const std::vector<ApartMatch>& matches) {
  std::vector<std::pair<double, double>> values;
  double all = 0, sum = 0;
  for (const ApartMatch& m : matches) {
    values.emplace_back(m.Inverse(), m.Shift());
    all += values.back().second;
  }
  std::sort(values.begin(), values.end());
  for (const auto& [value, weight] : values) {
    sum += weight;
    if (2 * sum >= all) return value;
  }
  return 0;
}

// Leaves the matches that agree on one length and returns its inverse; leaves none where as many would by chance: the
// bound of Chernoff on the number of matches that lie within the gate of where any of their lengths puts them.
double KeepAgreeing(const LocalizeInput& input, double sigma_px, std::vector<ApartMatch>* matches) {
  const double gate = kGate * ReconstructOptions().outlier_chi2;
  const auto tried = static_cast<double>(matches->size());
  std::erase_if(*matches, [&](const ApartMatch& m) { return !(m.Chi2(m.Inverse()) < gate); });
  const double start = MedianInverse(*matches);
  std::erase_if(*matches, [&](const ApartMatch& m) { return !(m.Chi2(start) < gate); });
  if (matches->empty()) return 0;
  const Camera& camera =
      input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(matches->front().seen.image)].camera)].camera;
  const double inside = EIGEN_PI * gate * sigma_px * sigma_px / (camera.width() * camera.height());
  const double share = static_cast<double>(matches->size()) / tried;
  double log_chance = 0;
  if (share > inside && inside > 0) {
    log_chance = -share * std::log(share / inside);
    if (share < 1) log_chance -= (1 - share) * std::log((1 - share) / (1 - inside));
  }
  if (std::log(tried) + tried * log_chance > std::log(WideBaselineOptions().max_false_alarms)) matches->clear();
  return MedianInverse(*matches);
}

// Whitened direction of a point from a camera that stands apart. The camera's parameters are a (units a metre), then
// its rotation, rad.
struct ApartCost {
  Rigid3d turn;  // cam_from_body without its translation
  Eigen::Vector3d arm_m;
  Eigen::Matrix<double, 2, 3> w;
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* camera, T* residual) const {
    Eigen::Matrix<T, 3, 1> in_cam = InCamera(turn, pose, point);
    in_cam += camera[0] * arm_m.cast<T>();
    if (in_cam.squaredNorm() < T(1e-12)) return false;
    Eigen::Matrix<T, 3, 1> turned;
    ceres::AngleAxisRotatePoint(camera + 1, in_cam.data(), turned.data());
    Eigen::Map<Eigen::Matrix<T, 2, 1>>{residual} = w.cast<T>() * turned.normalized();
    return true;
  }
};

struct Inverse {
  double value = 0, variance = 0;  // units a metre
};

// The mean of the cameras that stand apart. Nothing where they do not show it.
std::optional<Inverse> MeanOfCameras(const std::vector<size_t>& cameras, LensBundle* bundle) {
  const Eigen::MatrixXd covariance = bundle->CovarianceOfLenses().covariance;
  const auto n = static_cast<Eigen::Index>(cameras.size());
  if (covariance.rows() < kLensParameters * n) return {};
  Eigen::MatrixXd joint(n, n);
  Eigen::VectorXd values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    values(i) = bundle->lenses[cameras[static_cast<size_t>(i)]][0];
    for (Eigen::Index j = 0; j < n; ++j) joint(i, j) = covariance(kLensParameters * i, kLensParameters * j);
  }
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(joint);
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return {};
  const Eigen::VectorXd weights = ldlt.solve(Eigen::VectorXd::Ones(n));
  if (!(weights.sum() > 0)) return {};
  return Inverse{weights.dot(values) / weights.sum(), 1 / weights.sum()};
}

// By all matches of a stretch, poses, points and rotations of cameras moving along.
std::optional<Inverse> Adjust(const LocalizeInput& input, const Stretch& stretch,
                              const std::vector<ApartMatch>& matches, double start) {
  Reconstruction r = stretch.reconstruction();
  std::vector<ImageObservation> added;
  std::map<int, Eigen::Vector3d> arms;  // of images that stand apart, m
  for (const ApartMatch& m : matches) {
    added.push_back(m.seen);
    arms[m.seen.image] = m.arm_m;
  }
  AddObservations(added, &r);
  LensBundle bundle(r, std::vector<LensParameters>(input.cameras.size(), LensParameters{start}));
  std::set<size_t> apart;
  bundle.AddImages(kLensPointsPerImage, [&](const BearingObservation& o) -> ceres::CostFunction* {
    const Rigid3d turn = RotationAlone(input.cameras[static_cast<size_t>(o.view)].cam_from_body);
    const auto index = static_cast<size_t>(&o - r.problem.observations.data());
    const auto arm = arms.find(r.image_of[index]);
    if (arm == arms.end()) return RayCostOf(turn, o, LensShift::Zero());
    apart.insert(static_cast<size_t>(o.view));
    return new ceres::AutoDiffCostFunction<ApartCost, 2, 6, 3, kLensParameters>(
        new ApartCost{turn, arm->second, o.w.cast<double>()});
  });
  bundle.AddMotion();
  constexpr double kWide = 100;  // units are of about a metre: a tenth of the points' distance, or by GPS
  std::vector<size_t> cameras;
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    if (!bundle.HasLens(c)) continue;
    if (apart.count(c) == 0) {
      bundle.problem.SetParameterBlockConstant(bundle.lenses[c].data());
      continue;
    }
    const Camera& camera = input.cameras[c].camera;
    const double turn = kUsualLensError * HalfDiagonal(camera) / camera.MeanFocal();
    bundle.AddPrior(c, LensParameters{}, {kWide, turn, turn, turn, 1});
    cameras.push_back(c);
  }
  if (cameras.empty() || !bundle.IsRedundant()) return {};
  bundle.Solve(kLensIterations);
  return MeanOfCameras(cameras, &bundle);
}

// First and last but one pose of each stretch.
std::vector<std::pair<size_t, size_t>> StretchesOf(size_t poses) {
  if (poses <= kMostPoses) return {{0, poses}};
  std::vector<std::pair<size_t, size_t>> stretches;
  for (size_t k = 0; k < kStretches; ++k) {
    const size_t begin = k * (poses - kPosesOfStretch) / (kStretches - 1);
    stretches.emplace_back(begin, begin + kPosesOfStretch);
  }
  return stretches;
}

// Nothing where a stretch shows no length. `shifts`: gets those of the matches that agree.
std::optional<Inverse> InverseByStretch(const LocalizeInput& input, const Stretch& stretch,
                                        const std::vector<bool>& of_first_centre, const ViewGraphOptions& pairs,
                                        int threads, const CancelToken& cancel, std::vector<double>* shifts) {
  if (!stretch.Moves()) return {};
  const std::vector<int> images = stretch.Apart(of_first_centre);
  std::vector<std::vector<ApartMatch>> of_images(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), threads, cancel, [&](int64_t i) {
    of_images[static_cast<size_t>(i)] = stretch.MatchesOf(images[static_cast<size_t>(i)], pairs);
  });
  std::vector<ApartMatch> matches;
  for (const auto& its : of_images) matches.insert(matches.end(), its.begin(), its.end());
  const double start = KeepAgreeing(input, stretch.sigma_px(), &matches);
  if (matches.empty()) return {};
  for (const ApartMatch& m : matches) shifts->push_back(m.Shift());
  try {
    return Adjust(input, stretch, matches, start);
  } catch (const NumericError&) {
    return {};  // what is not determined shows no length
  }
}

}  // namespace

std::vector<int> ImagesOfFirstCentre(const LocalizeInput& input) {
  const std::vector<Eigen::Vector3d> centres = FirstCentres(input);
  std::vector<int> images;
  for (size_t i = 0; i < input.images.size(); ++i) {
    const FrameImage& image = input.images[i];
    if (ArmOf(input, image, centres[static_cast<size_t>(image.pose)]).norm() < kOneCentre_m)
      images.push_back(static_cast<int>(i));
  }
  return images;
}

LocalizeInput OnlyImages(const LocalizeInput& input, const std::vector<int>& images) {
  LocalizeInput some = input;
  some.images.clear();
  for (const int i : images) some.images.push_back(input.images[static_cast<size_t>(i)]);
  if (input.image_features) {
    some.image_features = [images, all = input.image_features](int i) { return all(images[static_cast<size_t>(i)]); };
  }
  if (input.image_picture) {
    some.image_picture = [images, all = input.image_picture](int i) { return all(images[static_cast<size_t>(i)]); };
  }
  return some;
}

RigLength LengthByRig(const LocalizeInput& input, const Reconstruction& first, const ViewGraphOptions& pairs,
                      int threads, const CancelToken& cancel) {
  std::vector<bool> of_first_centre(input.images.size(), false);
  for (const int i : ImagesOfFirstCentre(input)) of_first_centre[static_cast<size_t>(i)] = true;
  RigLength length;
  std::vector<Inverse> found;
  std::vector<double> shifts;
  for (const auto& [begin, end] : StretchesOf(first.problem.poses.size())) {
    const Stretch stretch(input, first, begin, end);
    if (const auto one = InverseByStretch(input, stretch, of_first_centre, pairs, threads, cancel, &shifts))
      found.push_back(*one);
  }
  length.matches = static_cast<int>(shifts.size());
  if (found.empty() || length.matches < StructureFromMotionOptions().min_matches) return length;
  double weights = 0, mean = 0, chi2 = 0;
  for (const Inverse& one : found) weights += 1 / one.variance, mean += one.value / one.variance;
  mean /= weights;
  for (const Inverse& one : found) chi2 += std::pow(one.value - mean, 2) / one.variance;
  // Stretches that differ by more than their sigmas drift in length (Birge's ratio).
  const double birge = found.size() > 1 ? std::max(1.0, chi2 / (static_cast<double>(found.size()) - 1)) : 1;
  const double sigma = std::sqrt(birge / weights);
  length.contradiction_sigmas = Median(std::move(shifts)) * (std::abs(mean - 1) + 2 * sigma);
  if (!(mean > 0)) return length;
  length.m_per_unit = 1 / mean;
  // The distance of cameras is calibrated as well as a lens is.
  length.sigma_share = std::hypot(sigma / mean, kUsualLensError);
  length.known = length.sigma_share < kKnownShare;
  return length;
}

std::vector<Rigid3d> MotionInMetres(const LocalizeInput& input, const Reconstruction& first, double m_per_unit) {
  const std::vector<Eigen::Vector3d> centres = FirstCentres(input);
  std::vector<Rigid3d> motion;
  for (size_t k = 0; k < centres.size(); ++k) {
    Rigid3d centre_from_odom = first.problem.poses[k];
    centre_from_odom.translation -= centres[k];
    Rigid3d odom_from_centre = centre_from_odom.Inverse();
    odom_from_centre.translation *= m_per_unit;
    motion.push_back(odom_from_centre * Rigid3d(Eigen::Quaterniond::Identity(), -centres[k]));
  }
  const Eigen::Vector3d origin = motion.empty() ? Eigen::Vector3d::Zero() : motion.front().translation;
  for (Rigid3d& pose : motion) pose.translation -= origin;
  return motion;
}

}  // namespace trigpoint
