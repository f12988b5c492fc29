#include "localize/reconstruct/image_motion.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/estimation/ransac.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "datasets/io/camchain.h"
#include "datasets/io/gps.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

// Median distance from the middle.
double ReachOf(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d middle;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> along;
    for (const Eigen::Vector3d& p : places) along.push_back(p[k]);
    middle[k] = Median(std::move(along));
  }
  std::vector<double> distances;
  for (const Eigen::Vector3d& p : places) distances.push_back((p - middle).norm());
  return Median(std::move(distances));
}

// Which way is up in the pictures of the input's images.
std::vector<Eigen::Vector3d> TopsOf(const Run& run, const LocalizeInput& input) {
  std::map<std::string, const ImageEntry*> entries;
  for (const ImageEntry& entry : run.images) entries[entry.file] = &entry;
  std::vector<Eigen::Vector3d> tops;
  for (const FrameImage& image : input.images) {
    const bool by_body = input.cameras[static_cast<size_t>(image.camera)].has_extrinsics;  // its top is not asked for
    tops.push_back(by_body ? Eigen::Vector3d(-Eigen::Vector3d::UnitY()) : TopOf(run, *entries.at(image.name)));
  }
  return tops;
}

// Fixes at the times of a motion's poses.
struct Fixed {
  std::vector<Eigen::Vector3d> found, said;  // frame of the motion; east, north, up about the first fix, m
  std::vector<GpsFix> fixes;
};

Fixed FixedPlaces(const std::vector<GpsFix>& gps, const std::vector<TimedPose>& motion) {
  Fixed places;
  if (gps.empty()) return places;
  const LocalFrame frame(gps.front().position);
  std::vector<int64_t> stamps;
  for (const TimedPose& pose : motion) stamps.push_back(pose.stamp_ns);
  for (const GpsFix& fix : gps) {
    const auto near = NearestToFix(stamps, fix);
    if (!near) continue;
    places.found.push_back(motion[*near].target_from_body.translation);
    places.said.push_back(frame.EnuFromGeodetic(fix.position));
    places.fixes.push_back(fix);
  }
  return places;
}

double SigmaOfHeight(const GpsFix& fix) { return OwnHeightSigma(fix.sigma_v_m, fix.sigma_sea_m); }

std::optional<Sim3d> FitTo(const Fixed& places, const std::vector<int>& which) {
  std::vector<Eigen::Vector3d> found, said;
  for (int i : which) {
    found.push_back(places.found[static_cast<size_t>(i)]), said.push_back(places.said[static_cast<size_t>(i)]);
  }
  try {
    return AlignPoints(found, said, AlignmentKind::kSim3);
  } catch (const NumericError&) {
    return std::nullopt;
  }
}

// The fixes that agree with one of the fits to three of them.
std::vector<int> Agreeing(const Fixed& places) {
  RansacOptions options;
  options.threshold = std::sqrt(16.3);  // sigmas: 99.9 %, three degrees of freedom
  const auto fit_to = [&](const std::vector<int>& three) {
    const auto fit = FitTo(places, three);
    return fit ? std::vector{*fit} : std::vector<Sim3d>();
  };
  const auto sigmas_off = [&](const Sim3d& fit, int k) {
    const auto i = static_cast<size_t>(k);
    const Eigen::Vector3d off = fit * places.found[i] - places.said[i];
    return std::hypot(off.head<2>().norm() / places.fixes[i].sigma_h_m, off.z() / SigmaOfHeight(places.fixes[i]));
  };
  return Ransac<Sim3d, 3>(static_cast<int>(places.found.size()), options, fit_to, sigmas_off).inliers;
}

}  // namespace

std::optional<double> LengthByGps(const std::vector<GpsFix>& gps, const std::vector<TimedPose>& motion) {
  constexpr double kSigmas = 3;  // the median of noise alone, 1.18 sigma, makes what is this long 8 % longer
  Fixed places = FixedPlaces(gps, motion);
  if (places.found.size() < 3) return {};
  std::vector<double> sigmas;
  for (const GpsFix& fix : places.fixes) sigmas.push_back(fix.sigma_h_m);
  for (Eigen::Vector3d& said : places.said) said.z() = 0;  // heights of fixes are the noisiest
  // In space: pictures that all look down with one heading do not show which way is up.
  const double true_m = ReachOf(places.said), in_units = ReachOf(places.found);
  if (true_m < kSigmas * Median(std::move(sigmas)) || !(in_units > 0)) return {};
  return true_m / in_units;
}

std::optional<Eigen::Vector3d> UpByGps(const std::vector<GpsFix>& gps, const std::vector<TimedPose>& motion) {
  constexpr size_t kLeast = 5;
  constexpr double kKnown_rad = 10 * kDegToRad;
  const Fixed places = FixedPlaces(gps, motion);
  const bool heights = std::all_of(places.fixes.begin(), places.fixes.end(),
                                   [](const GpsFix& fix) { return fix.sigma_v_m < kUnknownHeightSigma; });
  if (!heights) return {};
  const std::vector<int> agree = Agreeing(places);
  if (agree.size() < kLeast || 2 * agree.size() <= places.found.size()) return {};
  const auto fit = FitTo(places, agree);
  if (!fit) return {};
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (int i : agree) middle += places.said[static_cast<size_t>(i)].head<2>() / static_cast<double>(agree.size());
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // of the slopes to east and north, by heights
  for (int k : agree) {
    const auto i = static_cast<size_t>(k);
    const Eigen::Vector2d apart = (places.said[i].head<2>() - middle) / SigmaOfHeight(places.fixes[i]);
    information += apart * apart.transpose();
  }
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(information).eigenvalues()(0);
  if (!(least > 1 / (kKnown_rad * kKnown_rad))) return {};
  return fit->rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

namespace {

constexpr const char* kScaleSigma = "scale_sigma=";  // in the first line of a motion whose length is known

std::vector<std::string> HeaderOf(const std::string& unit) {
  return {"trigpoint motion 1; frame=odom (origin at the first placed pose, z up); from=images; unit=" + unit};
}

// How well the length of a motion is known, by its first line.
double ScaleSigmaOf(const std::filesystem::path& motion) {
  std::ifstream in(motion);
  std::string line;
  std::getline(in, line);
  const size_t at = line.find(kScaleSigma);
  if (at == std::string::npos) return kUnknownScaleSigma;
  return ParseDouble(Trim(line.substr(at + std::string(kScaleSigma).size()))).value_or(kUnknownScaleSigma);
}

// Turns a motion that stands by its pictures' tops, where the run's GPS shows that it lies: they look down. Returns
// what is to be said of it.
std::string LevelByGps(const std::vector<GpsFix>& gps, std::vector<TimedPose>* motion) {
  constexpr double kLies = 0.7;  // cosine, 45 deg: beyond what the tops of cameras held upright and GPS leave open
  const auto up = UpByGps(gps, *motion);
  if (!up || up->z() > kLies) return "";
  const Rigid3d turn(Eigen::Quaterniond::FromTwoVectors(*up, Eigen::Vector3d::UnitZ()), Eigen::Vector3d::Zero());
  for (TimedPose& pose : *motion) pose.target_from_body = turn * pose.target_from_body;
  return "; its vertical is that of the run's GPS, as the tops of its pictures do not point up";
}

}  // namespace

FoundMotion FindImageMotion(const Run& run, const LocalizeInput& all, const ReconstructRunOptions& options,
                            const std::filesystem::path& file, int threads, uint64_t seed, ProgressSink& progress,
                            const CancelToken& cancel) {
  // Cameras that stand apart contradict a motion without a unit.
  const LocalizeInput input = OnlyImages(all, ImagesOfFirstCentre(all));
  ImageMotion found = MotionFromImages(input, options.motion, options.pairs, threads, seed, progress, cancel);
  LevelMotion(input, TopsOf(run, input), &found);
  std::vector<TimedPose> poses;
  for (size_t i = 0; i < found.odom_from_body.size(); ++i) {
    if (found.odom_from_body[i]) poses.push_back({all.pose_stamps[i], *found.odom_from_body[i]});
  }
  const std::string level = LevelByGps(run.gps, &poses);
  const std::optional<double> length = LengthByGps(run.gps, poses);
  for (TimedPose& pose : poses) pose.target_from_body.translation *= length.value_or(1);
  const std::string unit = length ? "m, by the run's GPS" : "unknown (the median distance of scene points is 10 units)";
  WriteTum(file, poses, HeaderOf(unit));
  return {fmt::format("run {} has no odometry: the motion of {} of {} poses was found from its images alone ({} of {} "
                      "pairs verified){}; its unit of length is ",
                      run.name, found.placed, all.pose_stamps.size(), found.pairs_verified, found.pairs_tried, level),
          unit};
}

void WriteMotion(const LocalizeInput& input, const BundleProblem& solved, const std::string& unit, double sigma_share,
                 const std::filesystem::path& file) {
  std::vector<TimedPose> poses;
  for (size_t k = 0; k < input.pose_stamps.size(); ++k) {
    poses.push_back({input.pose_stamps[k], solved.poses[k].Inverse()});
  }
  const std::string sigma =
      sigma_share < kUnknownScaleSigma ? fmt::format("; {}{:.6f}", kScaleSigma, sigma_share) : std::string();
  WriteTum(file, poses, HeaderOf(unit + sigma));
}

namespace {

// Photos taken with a camera of the run take the lens that was found for it.
void FollowLenses(const std::vector<BodyCamera>& calibrated, const Run& run, Site* site) {
  const auto same = [](const Camera& a, const Camera& b) {
    return a.model() == b.model() && a.width() == b.width() && a.height() == b.height() && a.params() == b.params();
  };
  for (Reference& photo : site->references) {
    if (!photo.camera) continue;
    for (size_t c = 0; c < calibrated.size(); ++c) {
      if (!same(*photo.camera, calibrated[c].camera)) continue;
      photo.camera = run.cameras[c].camera;
      break;
    }
  }
}

}  // namespace

std::vector<BodyCamera> FoundLenses(const std::filesystem::path& dir) {
  const std::filesystem::path file = dir / kFoundCamerasFile;
  return std::filesystem::exists(file) ? ReadCamchain(file) : std::vector<BodyCamera>();
}

double OdometryTime(const std::filesystem::path& dir) {
  const std::filesystem::path file = dir / kOdometryTimeFile;
  if (!std::filesystem::exists(file)) return 0;
  return YamlMap(file, LoadYaml(file), {"time_offset_s"}).Number("time_offset_s", 0);
}

void FollowReconstruction(const std::filesystem::path& dir, Run* run, Site* site) {
  const std::vector<BodyCamera> calibrated = run->cameras;
  TakeLenses(FoundLenses(dir), &run->cameras);
  if (site != nullptr) FollowLenses(calibrated, *run, site);
  MoveOdometry(OdometryTime(dir), run);
  if (!run->odometry.poses.empty()) return;
  run->odometry = ReadTrajectory(dir / kMotionFile);
  run->config.odometry_scale_sigma = ScaleSigmaOf(dir / kMotionFile);
  run->config.odometry_levelled = false;
  std::set<int64_t> placed;
  for (const TimedPose& pose : run->odometry.poses) placed.insert(pose.stamp_ns);
  std::erase_if(run->images, [&](const ImageEntry& i) {
    return placed.count(BodyStamp(i.stamp_ns, run->cameras[static_cast<size_t>(i.camera)])) == 0;
  });
}

void MoveOdometry(double by_s, Run* run) {
  for (TimedPose& pose : run->odometry.poses) pose.stamp_ns += std::llround(1e9 * by_s);
  run->config.odometry_time_offset_s += by_s;
}

void WriteOdometryTime(double by_s, double sigma_s, const std::filesystem::path& file) {
  WriteFileAtomically(file,
                      fmt::format("# added to the stamps of odometry, as images are late against it; 1 sigma {:.4f} "
                                  "s\ntime_offset_s: {:.9f}\n",
                                  sigma_s, by_s));
}

void TakeCameras(const std::vector<SelfCalibration>& found, Run* run) {
  for (const SelfCalibration& s : found) run->cameras[static_cast<size_t>(s.camera)].camera = s.found;
}

namespace {

// "cam0: f 725.3 +- 1.2 px (before 718.9), ...", 1 sigma.
std::string LensText(const BodyCamera& camera, const SelfCalibration& s, double focal_before_px) {
  const std::vector<double>& p = s.found.params();
  return fmt::format(
      "{}: f {:.1f} +- {:.1f} px (before {:.1f}), principal point {:.1f}, {:.1f} +- {:.1f} px, k1 {:.4f} +- {:.4f}, k2 "
      "{:.4f} +- {:.4f}",
      camera.name, s.found.MeanFocal(), s.sigma_focal_px, focal_before_px, p[2], p[3], s.sigma_centre_px, p[4],
      s.sigma_k1, p[5], s.sigma_k2);
}

}  // namespace

void WriteFoundCameras(const Run& run, const std::vector<SelfCalibration>& found, const std::filesystem::path& file,
                       ProgressSink& progress) {
  std::vector<std::string> comments = {"estimated from the run's images, which nobody calibrated; 1 sigma:"};
  for (const SelfCalibration& s : found) {
    const BodyCamera& camera = run.cameras[static_cast<size_t>(s.camera)];
    comments.push_back(LensText(camera, s, camera.guessed_focal_px));
    progress.Log(LogLevel::kWarning, fmt::format("run {} is not calibrated; estimated from its images (1 sigma): {}",
                                                 run.name, comments.back()));
  }
  WriteCamchain(file, run.cameras, comments);
}

void WriteRevisedCameras(const Run& calibrated, const Run& revised, const std::vector<SelfCalibration>& found,
                         const std::filesystem::path& file, ProgressSink& progress) {
  std::vector<std::string> comments = {"estimated from the run's images about their calibration; 1 sigma:"};
  for (const SelfCalibration& s : found) {
    const BodyCamera& camera = calibrated.cameras[static_cast<size_t>(s.camera)];
    comments.push_back(LensText(camera, s, camera.camera.MeanFocal()));
    progress.Log(
        LogLevel::kWarning,
        fmt::format("run {}: its images contradict odometry, and agree with it better through another lens than "
                    "the calibrated one, which is used instead (1 sigma): {}; calibrate the camera anew "
                    "(trigpoint calibrate), and check odometry",
                    calibrated.name, comments.back()));
  }
  WriteCamchain(file, revised.cameras, comments);
}

void ScaleReconstruction(double length, Reconstruction* r) {
  for (Rigid3d& pose : r->problem.poses) pose.translation *= length;
  for (Eigen::Vector3d& y : r->problem.points) y *= length;
  for (PoseFactor& f : r->problem.factors) {
    f.measured.translation *= length;
    f.sqrt_info.rightCols<3>() /= length;
  }
  const double most = ReconstructOptions().max_depth_m;
  for (size_t j = 0; j < r->depth_m.size(); ++j) {
    r->depth_m[j] *= length;
    if (r->depth_m[j] > most) r->point_valid[j] = false;
  }
  for (BearingObservation& o : r->problem.observations) {
    o.active = o.active && r->point_valid[static_cast<size_t>(o.point)];
  }
}

}  // namespace trigpoint
