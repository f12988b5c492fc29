#include "localize/reconstruct/rolling_shutter.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "localize/reconstruct/lens_shift.h"

namespace trigpoint {
namespace {

constexpr double kUnit_s = 0.01;      // of the readout time as a parameter: about as large as the others
constexpr double kSigmaReadout = 10;  // its 1 sigma before the images are used: wide

const BodyCamera& CameraOf(const LocalizeInput& input, const BearingObservation& o) {
  return input.cameras[static_cast<size_t>(o.view)];
}

MotionRate RateOf(const LocalizeInput& input, const BearingObservation& o) {
  return RateOfCamera(input.body_rates[static_cast<size_t>(o.pose)], CameraOf(input, o).cam_from_body);
}

double InverseDistance(const BundleProblem& p, const BearingObservation& o) {
  const Eigen::Vector3d in_cam = p.views[static_cast<size_t>(o.view)] *
                                 (p.poses[static_cast<size_t>(o.pose)] * p.points[static_cast<size_t>(o.point)]);
  return 1 / in_cam.norm();
}

// How the lens moves a pixel, but that the distortion by r^4 gives way to the readout time, which comes first.
ceres::CostFunction* CostOf(const LocalizeInput& input, const BundleProblem& p, const BearingObservation& o) {
  const MotionRate rate = RateOf(input, o);
  const BodyCamera& camera = CameraOf(input, o);
  const Eigen::Vector3d ray = o.ray.cast<double>();
  const auto pixel = camera.camera.Project(ray);
  if (!pixel || !rate.known) return nullptr;
  const Eigen::Vector3d by_time = rate.omega.cross(ray) + InverseDistance(p, o) * rate.velocity;
  const Eigen::Matrix<double, 2, 3> w = o.w.cast<double>();
  LensShift by_lens, shift;
  if (!WhitenedShift(camera.camera, *pixel, w, &by_lens)) return nullptr;
  shift << -kUnit_s * RowOffset(camera.camera, pixel->y()) * (w * by_time), by_lens.leftCols<kLensParameters - 1>();
  return RayCostOf(camera.cam_from_body, o, shift);
}

}  // namespace

FeatureSet AtImageTime(FeatureSet features, const BodyCamera& camera, const MotionRate& body) {
  if (camera.readout_s == 0) return features;
  const MotionRate rate = RateOfCamera(body, camera.cam_from_body);
  for (Eigen::Vector2f& pixel : features.points) {
    pixel = PixelAtImageTime(camera.camera, camera.readout_s, pixel.cast<double>(), rate, 0).cast<float>();
  }
  return features;
}

bool HasReadout(const std::vector<BodyCamera>& cameras) {
  return std::any_of(cameras.begin(), cameras.end(), [](const BodyCamera& camera) { return camera.readout_s != 0; });
}

std::vector<TrackObservation> AtImageTimes(const LocalizeInput& input, const Reconstruction& r) {
  const BundleProblem& p = r.problem;
  std::vector<TrackObservation> tracks;
  tracks.reserve(p.observations.size());
  for (size_t i = 0; i < p.observations.size(); ++i) {
    const BearingObservation& o = p.observations[i];
    const BodyCamera& camera = CameraOf(input, o);
    const auto pixel = camera.camera.Project(o.ray.cast<double>());
    if (!pixel) continue;
    MotionRate way = RateOf(input, o);
    way.omega.setZero();
    const double inverse = r.point_valid[static_cast<size_t>(o.point)] ? InverseDistance(p, o) : 0;
    const Eigen::Vector2d moved = PixelAtImageTime(camera.camera, camera.readout_s, *pixel, way, inverse);
    tracks.push_back({o.point, r.image_of[i], r.feature_of[i], moved.cast<float>()});
  }
  return tracks;
}

std::vector<ReadoutEstimate> EstimateReadout(const LocalizeInput& input, const Reconstruction& r) {
  const auto known = std::count_if(input.body_rates.begin(), input.body_rates.end(),
                                   [](const MotionRate& rate) { return rate.known; });
  if (2 * known < static_cast<int64_t>(input.body_rates.size()) || known == 0) return {};
  LensBundle bundle(r, std::vector<LensParameters>(input.cameras.size(), LensParameters{}));
  bundle.AddImages(kLensPointsPerImage, [&](const BearingObservation& o) { return CostOf(input, r.problem, o); });
  bundle.AddMotion();
  std::vector<ReadoutEstimate> estimates;
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    if (!bundle.HasLens(c)) continue;
    const double centre = kUsualLensError * HalfDiagonal(input.cameras[c].camera);
    bundle.AddPrior(c, LensParameters{}, {kSigmaReadout, kUsualLensError, centre, centre, kUsualLensError});
    estimates.push_back({static_cast<int>(c)});
  }
  if (!bundle.IsRedundant()) return {};
  bundle.Solve(kLensIterations);
  const Eigen::MatrixXd covariance = bundle.CovarianceOfLenses().covariance;  // and of poses behind them
  if (covariance.size() == 0) return {};
  for (size_t i = 0; i < estimates.size(); ++i) {
    ReadoutEstimate& e = estimates[i];
    const auto row = static_cast<Eigen::Index>(kLensParameters * i);
    e.change_s = kUnit_s * bundle.lenses[static_cast<size_t>(e.camera)][0];
    e.sigma_s = kUnit_s * std::sqrt(covariance(row, row));
    e.readout_s = input.cameras[static_cast<size_t>(e.camera)].readout_s + e.change_s;
  }
  return estimates;
}

}  // namespace trigpoint
