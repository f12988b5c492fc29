#include "localize/reconstruct/lens_check.h"

#include <fmt/format.h>

#include <cmath>

#include "localize/reconstruct/lens_bundle.h"

namespace trigpoint {
namespace {

constexpr int kPointsPerImage = 60;
constexpr int kIterations = 10;
constexpr int kLeastRedundancy = 200;  // with less, five more parameters remove much by chance
// 1 sigma of each error before the images are used: wide. What images do not determine stays as calibrated.
constexpr double kSigmaShare = 0.3, kSigmaCentre = 0.1;  // the centre's: share of half the diagonal
// A calibration is contradicted if another lens removes more than the first share of the squared residuals and moves
// pixels by more than the second share of half the picture's diagonal. With good calibrations of real cameras, it
// removes up to 30 % in runs straight ahead.
constexpr double kMuchBetter = 0.4, kFarOff = 0.01;

using Lens = Eigen::Map<const Eigen::Matrix<double, kLensParameters, 1>>;
using Shift = Eigen::Matrix<double, 2, kLensParameters>;

double HalfDiagonal(const Camera& camera) { return 0.5 * std::hypot(camera.width(), camera.height()); }

// How far a pixel moves (px) with each parameter of the lens: a share of the focal length, the principal point (px, two
// of them), and shares of radial distortion by r^2 and r^4, where r is 1 in the corners.
Shift ShiftOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d d = pixel - 0.5 * Eigen::Vector2d(camera.width() - 1, camera.height() - 1);
  const double r2 = d.squaredNorm() / std::pow(HalfDiagonal(camera), 2);
  Shift s;
  s << d, Eigen::Matrix2d::Identity(), r2 * d, r2 * r2 * d;
  return s;
}

std::optional<Eigen::Matrix<double, 3, 2>> RayByPixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  constexpr double kStep = 0.25;
  Eigen::Matrix<double, 3, 2> j;
  for (int i = 0; i < 2; ++i) {
    const auto more = camera.Unproject(pixel + kStep * Eigen::Vector2d::Unit(i));
    const auto less = camera.Unproject(pixel - kStep * Eigen::Vector2d::Unit(i));
    if (!more || !less) return std::nullopt;
    j.col(i) = (*more - *less) / (2 * kStep);
  }
  return j;
}

// Whitened difference of a point's direction from the observed ray, as the lens moves it.
struct RayCost {
  Rigid3d cam_from_body;
  Eigen::Matrix<double, 2, 3> w;
  Eigen::Vector3d ray;
  Shift whitened_shift;
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* lens, T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_cam = InCamera(cam_from_body, pose, point);
    if (in_cam.squaredNorm() < T(1e-12)) return false;
    Eigen::Map<Eigen::Matrix<T, 2, 1>>{residual} =
        w.cast<T>() * (in_cam.normalized() - ray.cast<T>()) +
        whitened_shift.cast<T>() * Eigen::Map<const Eigen::Matrix<T, kLensParameters, 1>>(lens);
    return true;
  }
};

ceres::CostFunction* CostOf(const LocalizeInput& input, const BearingObservation& o) {
  const BodyCamera& camera = input.cameras[static_cast<size_t>(o.view)];
  const auto pixel = camera.camera.Project(o.ray.cast<double>());
  const auto by_pixel = pixel ? RayByPixel(camera.camera, *pixel) : std::nullopt;
  if (!by_pixel) return nullptr;
  const Eigen::Matrix<double, 2, 3> w = o.w.cast<double>();
  auto* cost =
      new RayCost{camera.cam_from_body, w, o.ray.cast<double>(), w * *by_pixel * ShiftOf(camera.camera, *pixel)};
  return new ceres::AutoDiffCostFunction<RayCost, 2, 6, 3, kLensParameters>(cost);
}

double RmsShift(const Camera& camera, const Lens& lens) {
  constexpr int kGrid = 9;
  double sum = 0;
  for (int k = 0; k < kGrid * kGrid; ++k) {
    const Eigen::Vector2d pixel((k % kGrid + 0.5) / kGrid * camera.width(),
                                (k / kGrid + 0.5) / kGrid * camera.height());
    sum += (ShiftOf(camera, pixel) * lens).squaredNorm();
  }
  return std::sqrt(sum / (kGrid * kGrid));
}

}  // namespace

LensCheck CheckLenses(const LocalizeInput& input, const Reconstruction& r) {
  LensBundle bundle(r, std::vector<LensParameters>(input.cameras.size(), LensParameters{}));
  bundle.AddImages(kPointsPerImage, [&](const BearingObservation& o) { return CostOf(input, o); });
  bundle.AddMotion();
  std::vector<size_t> cameras;
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    if (!bundle.HasLens(c)) continue;
    const double centre = kSigmaCentre * HalfDiagonal(input.cameras[c].camera);
    bundle.AddPrior(c, LensParameters{}, {kSigmaShare, centre, centre, kSigmaShare, kSigmaShare});
    bundle.problem.SetParameterBlockConstant(bundle.lenses[c].data());
    cameras.push_back(c);
  }
  LensCheck check;
  if (bundle.problem.NumResiduals() - bundle.problem.NumParameters() < kLeastRedundancy) return check;
  const double calibrated = bundle.Solve(kIterations);
  for (const size_t c : cameras) bundle.problem.SetParameterBlockVariable(bundle.lenses[c].data());
  check.better = calibrated > 0 ? 1 - bundle.Solve(kIterations) / calibrated : 0;
  for (const size_t c : cameras) {
    const Lens lens(bundle.lenses[c].data());
    check.errors.push_back({static_cast<int>(c), lens(0), lens.segment<2>(1), RmsShift(input.cameras[c].camera, lens)});
  }
  return check;
}

std::optional<std::string> Contradiction(const LocalizeInput& input, const LensCheck& check) {
  if (check.better < kMuchBetter) return std::nullopt;
  std::string text;
  for (const LensError& e : check.errors) {
    const BodyCamera& camera = input.cameras[static_cast<size_t>(e.camera)];
    if (e.rms_px < kFarOff * HalfDiagonal(camera.camera)) continue;
    text +=
        fmt::format("{}{}: focal length about {:+.1f} %, principal point {:+.0f}, {:+.0f} px, pixels {:.0f} px RMS",
                    text.empty() ? "" : "; ", camera.name, 100 * e.focal, e.centre_px.x(), e.centre_px.y(), e.rms_px);
  }
  if (text.empty()) return std::nullopt;
  return fmt::format(
      "the images contradict the camera's calibration: another lens ({}) removes {:.0f} % of their squared residuals; "
      "expected the calibration of this camera at this zoom, focus and picture size (camchain.yaml): calibrate it anew "
      "(trigpoint calibrate). In a run straight ahead, odometry whose heading or height drifts shows the same: check "
      "it, "
      "too. Option check_conventions=false skips this check",
      text, 100 * check.better);
}

}  // namespace trigpoint
