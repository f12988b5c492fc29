#include "eval/truth/truth.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "datasets/io/text.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

constexpr int64_t kNsPerS = 1'000'000'000;

// Index of the stamp nearest to `stamp` in an ascending list, or nothing if it is `max_ns` or more away.
template <typename Timed>
const Timed* Nearest(const std::vector<Timed>& timed, int64_t stamp, int64_t max_ns) {
  const auto after =
      std::lower_bound(timed.begin(), timed.end(), stamp, [](const Timed& t, int64_t s) { return t.stamp_ns < s; });
  const Timed* best = nullptr;
  int64_t distance = max_ns;
  const auto consider = [&](const Timed& t) {
    if (const int64_t d = std::abs(t.stamp_ns - stamp); d < distance) best = &t, distance = d;
  };
  if (after != timed.begin()) consider(*std::prev(after));
  if (after != timed.end()) consider(*after);
  return best;
}

int NumberOf(const std::string& station) {
  std::string digits;
  std::copy_if(station.begin(), station.end(), std::back_inserter(digits),
               [](unsigned char c) { return std::isdigit(c) != 0; });
  const auto number = ParseInt(digits);
  if (!number) throw InputError("station " + station + ": expected a number in its name to find its truth by");
  return static_cast<int>(*number);
}

double Rmse(double sum_of_squares, size_t n) { return std::sqrt(sum_of_squares / static_cast<double>(n)); }

double SquaredResiduals(const Sim3d& fit, const std::vector<Eigen::Vector3d>& source,
                        const std::vector<Eigen::Vector3d>& target) {
  double sum = 0;
  for (size_t i = 0; i < source.size(); ++i) sum += (fit * source[i] - target[i]).squaredNorm();
  return sum;
}

double Nees(const Eigen::Vector3d& error, const Eigen::Vector3d& sigma) {
  return error.cwiseQuotient(sigma).squaredNorm();
}

// The same cameras, estimated and true.
struct Pairs {
  std::vector<Rigid3d> odom, world;
};

std::vector<Eigen::Vector3d> Centres(const std::vector<Rigid3d>& poses) {
  std::vector<Eigen::Vector3d> centres;
  for (const Rigid3d& pose : poses) centres.push_back(pose.translation);
  return centres;
}

// Each camera as its centre and points beside it: on a straight stretch the cameras' own rotations fix the roll, which
// centres leave open; where the path bends, centres are metres apart and decide.
std::vector<Eigen::Vector3d> PointsBeside(const std::vector<Rigid3d>& poses) {
  constexpr double kBesideM = 0.1;
  std::vector<Eigen::Vector3d> points;
  for (const Rigid3d& pose : poses) {
    for (int axis = 0; axis < 3; ++axis) {
      points.push_back(pose * Eigen::Vector3d(kBesideM * Eigen::Vector3d::Unit(axis)));
      points.push_back(pose * Eigen::Vector3d(-kBesideM * Eigen::Vector3d::Unit(axis)));
    }
  }
  return points;
}

Pairs CompareCameras(const LocalizeResult& result, const Truth& truth, int64_t max_ns, TruthEvaluation* evaluation) {
  Pairs pairs;
  double squares_h = 0, squares_v = 0, camera_nees = 0;
  size_t world_count = 0, nees_count = 0;
  for (const TimedPose& camera : truth.cameras) {
    const Eigen::Vector3d& position = camera.target_from_body.translation;
    if (const TimedPose* estimate = Nearest(result.cameras_odom, camera.stamp_ns, max_ns)) {
      pairs.odom.push_back(estimate->target_from_body);
      pairs.world.push_back(camera.target_from_body);
    }
    if (const TimedPose* estimate = Nearest(result.cameras, camera.stamp_ns, max_ns)) {
      const Eigen::Vector3d e = estimate->target_from_body.translation - position;
      squares_h += e.head<2>().squaredNorm();
      squares_v += e.z() * e.z();
      ++world_count;
      const CameraResult* row = Nearest(result.images, camera.stamp_ns, max_ns);
      if (row != nullptr && row->sigma_m) camera_nees += Nees(e, *row->sigma_m) / 3, ++nees_count;
    }
  }
  if (world_count > 0) {
    evaluation->camera_rmse_h_m = Rmse(squares_h, world_count);
    evaluation->camera_rmse_v_m = Rmse(squares_v, world_count);
  }
  if (nees_count > 0) evaluation->camera_nees_per_dof = camera_nees / static_cast<double>(nees_count);
  if (pairs.odom.size() < 3) return pairs;
  const std::vector<Eigen::Vector3d> odom = Centres(pairs.odom), world = Centres(pairs.world);
  const auto rmse = [&](const Sim3d& fit) { return Rmse(SquaredResiduals(fit, odom, world), odom.size()); };
  evaluation->ate_se3_m = rmse(AlignPoints(odom, world, AlignmentKind::kSE3));
  const Sim3d similarity = AlignPoints(odom, world, AlignmentKind::kSim3);
  evaluation->ate_sim3_m = rmse(similarity);
  evaluation->scale_error = 1 / similarity.scale - 1;
  return pairs;
}

TruthError ErrorOf(const PanoramaResult& row, int station, const Rigid3d& world_from_pano, const Pairs& pairs,
                   double fit_radius_m) {
  Pairs near;
  for (size_t i = 0; i < pairs.world.size(); ++i) {
    if ((pairs.world[i].translation - world_from_pano.translation).norm() >= fit_radius_m) continue;
    near.odom.push_back(pairs.odom[i]);
    near.world.push_back(pairs.world[i]);
  }
  const Pairs& used = near.odom.empty() ? pairs : near;
  const Sim3d world_from_odom = AlignPoints(PointsBeside(used.odom), PointsBeside(used.world), AlignmentKind::kSE3);
  TruthError error{.station = station, .panorama = row.panorama};
  const Rigid3d estimate = world_from_odom.TransformPose(*row.odom_from_pano);
  error.relative_m = (estimate.translation - world_from_pano.translation).norm();
  error.relative_rot_deg = kRadToDeg * AngleBetween(estimate.rotation, world_from_pano.rotation);
  if (!row.world_from_pano) return error;
  const Eigen::Vector3d e = row.world_from_pano->translation - world_from_pano.translation;
  error.world_h_m = e.head<2>().norm();
  error.world_v_m = std::abs(e.z());
  if (row.sigma_m) error.nees = Nees(e, *row.sigma_m);
  return error;
}

}  // namespace

Truth ReadTruth(const std::filesystem::path& dir, const std::string& run) {
  Truth truth;
  truth.cameras = ReadTrajectory(dir / "runs" / (run + "_cameras.tum")).poses;
  std::filesystem::path panoramas = dir / ("panoramas_" + run + ".tum");
  if (!std::filesystem::exists(panoramas)) panoramas = dir / "panoramas.tum";
  for (const TimedPose& pose : ReadTrajectory(panoramas).poses) {
    truth.panoramas.emplace(static_cast<int>(pose.stamp_ns / kNsPerS), pose.target_from_body);
  }
  return truth;
}

TruthEvaluation EvaluateAgainstTruth(const LocalizeResult& result, const Truth& truth, const TruthOptions& options) {
  TruthEvaluation evaluation;
  evaluation.frames_truth = static_cast<int>(truth.cameras.size());
  evaluation.frames_out = static_cast<int>(result.cameras_odom.size());
  const Pairs pairs =
      CompareCameras(result, truth, static_cast<int64_t>(options.max_time_difference_s * kNsPerS), &evaluation);

  std::map<int, TruthError> answers;
  double panorama_nees = 0;
  int panorama_nees_count = 0;
  for (const PanoramaResult& row : result.panoramas) {
    if (row.status != "localized" || !row.odom_from_pano) continue;
    const int station = NumberOf(row.station);
    const auto it = truth.panoramas.find(station);
    if (it == truth.panoramas.end()) throw InputError("station " + row.station + " is not in the truth");
    if (pairs.odom.empty())
      throw InputError("no camera of the run has a true pose at its time: is the truth of this run?");
    const TruthError error = ErrorOf(row, station, it->second, pairs, options.fit_radius_m);
    if (error.nees) panorama_nees += *error.nees, ++panorama_nees_count;
    answers.insert_or_assign(station, error);
  }
  if (panorama_nees_count > 0) evaluation.panorama_anees_per_dof = panorama_nees / panorama_nees_count / 3;

  for (const auto& [station, pose] : truth.panoramas) {
    const Eigen::Vector3d& place = pose.translation;
    const bool expected = std::any_of(truth.cameras.begin(), truth.cameras.end(), [&](const TimedPose& camera) {
      return (camera.target_from_body.translation - place).norm() < options.expected_radius_m;
    });
    if (!expected) continue;
    evaluation.expected.push_back(station);
    if (answers.count(station) == 0) evaluation.missing.push_back(station);
  }
  std::vector<double> relative;
  for (auto& [station, error] : answers) {
    relative.push_back(error.relative_m);
    evaluation.answers.push_back(std::move(error));
  }
  if (!relative.empty()) {
    evaluation.relative_median_m = Quantile(relative, 0.5);
    evaluation.relative_p90_m = Quantile(relative, 0.9);
    evaluation.relative_max_m = Quantile(relative, 1);
  }
  return evaluation;
}

}  // namespace trigpoint
