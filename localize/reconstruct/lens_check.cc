#include "localize/reconstruct/lens_check.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "localize/reconstruct/lens_shift.h"

namespace trigpoint {
namespace {

// 1 sigma of each error before the images are used: wide. What images do not determine stays as calibrated.
constexpr double kSigmaShare = 0.3, kSigmaCentre = 0.1;  // the centre's: share of half the diagonal
// A calibration is contradicted if another lens removes more than the first share of the squared residuals and moves
// pixels by more than the second share of half the picture's diagonal. With good calibrations of real cameras, it
// removes up to 30 % in runs straight ahead.
constexpr double kMuchBetter = 0.4, kFarOff = 0.01;

using Lens = Eigen::Map<const Eigen::Matrix<double, kLensParameters, 1>>;

ceres::CostFunction* CostOf(const LocalizeInput& input, const BearingObservation& o) {
  const BodyCamera& camera = input.cameras[static_cast<size_t>(o.view)];
  const auto pixel = camera.camera.Project(o.ray.cast<double>());
  LensShift shift;
  if (!pixel || !WhitenedShift(camera.camera, *pixel, o.w.cast<double>(), &shift)) return nullptr;
  return RayCostOf(camera.cam_from_body, o, shift);
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

// Fills the bundle with the run's images and with what is known of their lenses, which are held. Returns the cameras
// with images; none where these have too few points in common.
std::vector<size_t> AddLenses(const LocalizeInput& input, double sigma_share, double sigma_centre, LensBundle* bundle) {
  bundle->AddImages(kLensPointsPerImage, [&](const BearingObservation& o) { return CostOf(input, o); });
  bundle->AddMotion();
  std::vector<size_t> cameras;
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    if (!bundle->HasLens(c)) continue;
    const double centre = sigma_centre * HalfDiagonal(input.cameras[c].camera);
    bundle->AddPrior(c, LensParameters{}, {sigma_share, centre, centre, sigma_share, sigma_share});
    bundle->problem.SetParameterBlockConstant(bundle->lenses[c].data());
    cameras.push_back(c);
  }
  if (!bundle->IsRedundant()) return {};
  return cameras;
}

double SolveWithLenses(const std::vector<size_t>& cameras, LensBundle* bundle) {
  for (const size_t c : cameras) bundle->problem.SetParameterBlockVariable(bundle->lenses[c].data());
  return bundle->Solve(kLensIterations);
}

// The ray of an observation under another lens, and its weight there.
void SeeThrough(const Camera& camera, const LensParameters& error, BearingObservation* o) {
  const auto pixel = camera.Project(o->ray.cast<double>());
  if (!pixel) return;
  const Eigen::Vector2d moved = *pixel - ShiftOf(camera, *pixel) * Lens(error.data());
  const auto ray = camera.Unproject(moved);
  if (!ray || !camera.Project(*ray)) return;
  const float sigma = camera.BearingSqrtInfo(*pixel, 1).cast<float>().norm() / o->w.norm();
  o->ray = ray->cast<float>();
  o->w = camera.BearingSqrtInfo(moved, 1).cast<float>() / sigma;
}

// The same observations under lenses with these errors.
BundleProblem SeenThrough(const LocalizeInput& input, const std::vector<LensParameters>& errors, BundleProblem p) {
  for (BearingObservation& o : p.observations) {
    const auto view = static_cast<size_t>(o.view);
    if (o.active && view < errors.size()) SeeThrough(input.cameras[view].camera, errors[view], &o);
  }
  return p;
}

}  // namespace

LensCheck CheckLenses(const LocalizeInput& input, const Reconstruction& r) {
  LensBundle bundle(r, std::vector<LensParameters>(input.cameras.size(), LensParameters{}));
  const std::vector<size_t> cameras = AddLenses(input, kSigmaShare, kSigmaCentre, &bundle);
  LensCheck check;
  if (cameras.empty()) return check;
  const double calibrated = bundle.Solve(kLensIterations);
  check.better = calibrated > 0 ? 1 - SolveWithLenses(cameras, &bundle) / calibrated : 0;
  for (const size_t c : cameras) {
    const Lens lens(bundle.lenses[c].data());
    check.errors.push_back({static_cast<int>(c), lens(0), lens.segment<2>(1), RmsShift(input.cameras[c].camera, lens)});
  }
  return check;
}

std::vector<LensParameters> LensErrors(const LocalizeInput& input, const Reconstruction& r) {
  LensBundle bundle(r, std::vector<LensParameters>(input.cameras.size(), LensParameters{}));
  const std::vector<size_t> cameras = AddLenses(input, kUsualLensError, kUsualLensError, &bundle);
  if (cameras.empty()) return {};
  SolveWithLenses(cameras, &bundle);
  return bundle.lenses;
}

std::vector<LensParameters> LensRoots(const LocalizeInput& input, const std::vector<SelfCalibration>& found,
                                      double others) {
  std::vector<LensParameters> roots(kLensParameters * input.cameras.size(), LensParameters{});
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    const double centre = others * HalfDiagonal(input.cameras[c].camera);
    Eigen::Matrix<double, kLensParameters, 1> sigma;
    sigma << others, centre, centre, others, others;
    Eigen::Matrix<double, kLensParameters, kLensParameters> root = sigma.asDiagonal();
    for (const SelfCalibration& s : found) {
      if (s.camera != static_cast<int>(c)) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(s.covariance);
      root = axes.eigenvectors() * axes.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
    }
    for (Eigen::Index k = 0; k < kLensParameters; ++k) {
      LensParameters& error = roots[kLensParameters * c + static_cast<size_t>(k)];
      Eigen::Map<Eigen::Matrix<double, kLensParameters, 1>>(error.data()) = root.col(k);
    }
  }
  return roots;
}

Eigen::MatrixXd PoseShiftsByLenses(const LocalizeInput& input, const Reconstruction& r, int threads,
                                   const CancelToken& cancel) {
  if (r.lens_errors.empty() && r.lens_roots.empty()) return {};
  const std::vector<LensParameters> roots = r.lens_roots.empty() ? LensRoots(input, {}, kUsualLensError) : r.lens_roots;
  BundleProblem calibrated = r.problem;
  calibrated.pose_shifts.resize(0, 0);
  const BundleCovariance covariance(calibrated, threads, cancel);
  const Eigen::VectorXd gradient = covariance.Gradient();
  constexpr double kPart = 1.0 / 32;  // of an error: moved by all of it, points would count as outliers
  std::vector<Eigen::VectorXd> shifts;
  for (size_t k = 0; k < roots.size(); ++k) {
    if (roots[k] == LensParameters{}) continue;
    std::vector<LensParameters> errors(input.cameras.size(), LensParameters{});
    LensParameters& error = errors[k / kLensParameters];
    std::transform(roots[k].begin(), roots[k].end(), error.begin(), [](double e) { return kPart * e; });
    const BundleProblem seen = SeenThrough(input, errors, calibrated);
    shifts.push_back(covariance.Times(gradient - BundleCovariance(seen, threads, cancel).Gradient()) / kPart);
  }
  if (!r.lens_errors.empty()) {
    // What the images ask for may be far from the calibration: not to first order.
    BundleProblem other = SeenThrough(input, r.lens_errors, calibrated);
    BundleOptions options;
    options.threads = threads;
    ProgressSink silent;
    SolveBundle(other, options, silent, cancel);
    Eigen::VectorXd& shift = shifts.emplace_back(gradient.size());
    for (size_t i = 0; i < other.poses.size(); ++i) {
      shift.segment<6>(6 * static_cast<Eigen::Index>(i)) = other.poses[i].Minus(calibrated.poses[i]);
    }
  }
  Eigen::MatrixXd out(gradient.size(), static_cast<Eigen::Index>(shifts.size()));
  for (Eigen::Index k = 0; k < out.cols(); ++k) out.col(k) = shifts[static_cast<size_t>(k)];
  return out;
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
      "it, too. Option --set reconstruct.check_conventions=false skips this check",
      text, 100 * check.better);
}

}  // namespace trigpoint
