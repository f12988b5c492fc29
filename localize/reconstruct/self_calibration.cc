#include "localize/reconstruct/self_calibration.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "localize/reconstruct/lens_bundle.h"

namespace trigpoint {
namespace {

constexpr int kPointsPerImage = 200;  // more hardly say more of three numbers
// 1 sigma of the distortion of lenses that nobody calibrated, about none.
constexpr double kSigmaK1 = 0.1, kSigmaK2 = 0.1;
// 1 sigma of the principal point about the picture's centre, share of the long side.
constexpr double kSigmaCentre = 0.01;
constexpr double kSearchedSigma = 0.1;  // of a focal length that was searched in steps of 15 %

constexpr int kLens = kLensParameters;
using Lens = LensParameters;  // f (px), k1, k2, principal point (px)

// (predicted pixel - pixel) / sigma.
struct PixelCost {
  Rigid3d cam_from_body;
  Eigen::Vector2d pixel;
  double inverse_sigma;
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* lens, T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_cam = InCamera(cam_from_body, pose, point);
    if (in_cam.z() < T(1e-6)) return false;
    const Eigen::Matrix<T, 2, 1> x = in_cam.template head<2>() / in_cam.z();
    const T r2 = x.squaredNorm();
    const Eigen::Matrix<T, 2, 1> predicted =
        lens[0] * (T(1) + r2 * (lens[1] + r2 * lens[2])) * x + Eigen::Matrix<T, 2, 1>(lens[3], lens[4]);
    Eigen::Map<Eigen::Matrix<T, 2, 1>>{residual} = T(inverse_sigma) * (predicted - pixel.cast<T>());
    return true;
  }
};

Lens LensOf(const Camera& camera) {
  const std::vector<double>& p = camera.params();
  return {camera.MeanFocal(), p.size() > 4 ? p[4] : 0, p.size() > 5 ? p[5] : 0, p[2], p[3]};
}

Camera WithLens(const Camera& camera, const Lens& lens) {
  return {CameraModel::kRadtan,
          camera.width(),
          camera.height(),
          {lens[0], lens[0], lens[3], lens[4], lens[1], lens[2], 0, 0}};
}

// Without distortion, its principal point in the picture's middle.
Camera WithFocal(const Camera& camera, double focal_px) {
  return WithLens(camera, {focal_px, 0, 0, 0.5 * (camera.width() - 1), 0.5 * (camera.height() - 1)});
}

// Nothing for what is no pixel of the camera.
ceres::CostFunction* CostOf(const LocalizeInput& input, const Reconstruction& r, const BearingObservation& o) {
  const BodyCamera& camera = input.cameras[static_cast<size_t>(o.view)];
  const auto pixel = camera.camera.Project(o.ray.cast<double>());
  if (!pixel) return nullptr;
  auto* cost = new PixelCost{camera.cam_from_body, *pixel, 1 / (r.sigma_px * r.correlation_inflation)};
  return new ceres::AutoDiffCostFunction<PixelCost, 2, 6, 3, kLens>(cost);
}

void AddLenses(const LocalizeInput& input, LensBundle* bundle) {
  for (size_t c = 0; c < bundle->lenses.size(); ++c) {
    if (!bundle->HasLens(c)) continue;
    double* const lens = bundle->lenses[c].data();
    const BodyCamera& camera = input.cameras[c];
    if (!(camera.focal_sigma_share > 0)) {
      bundle->problem.SetParameterBlockConstant(lens);
      continue;
    }
    const int width = camera.camera.width(), height = camera.camera.height();
    const double centre = kSigmaCentre * std::max(width, height);
    bundle->AddPrior(c, {camera.guessed_focal_px, 0, 0, 0.5 * (width - 1), 0.5 * (height - 1)},
                     {camera.focal_sigma_share * camera.guessed_focal_px, kSigmaK1, kSigmaK2, centre, centre});
    bundle->problem.SetParameterLowerBound(lens, 0, 0.2 * camera.guessed_focal_px);
  }
}

double LargestShift(const Camera& before, const Camera& after) {
  double largest = 0;
  for (int k = 0; k < 9; ++k) {
    const Eigen::Vector2d pixel(0.5 * (k % 3) * (before.width() - 1), 0.5 * (k / 3) * (before.height() - 1));
    const auto ray = before.Unproject(pixel);
    const auto moved = ray ? after.Project(*ray) : std::nullopt;
    largest = std::max(largest, moved ? (*moved - pixel).norm() : static_cast<double>(before.width()));
  }
  return largest;
}

}  // namespace

std::vector<SelfCalibration> SelfCalibrate(const LocalizeInput& input, const Reconstruction& r) {
  const auto guessed = [](const BodyCamera& c) { return c.focal_sigma_share > 0; };
  if (std::none_of(input.cameras.begin(), input.cameras.end(), guessed)) return {};
  std::vector<Lens> lenses;
  for (const BodyCamera& c : input.cameras) lenses.push_back(LensOf(c.camera));
  LensBundle bundle(r, std::move(lenses));
  bundle.AddImages(kPointsPerImage, [&](const BearingObservation& o) { return CostOf(input, r, o); });
  bundle.AddMotion();
  AddLenses(input, &bundle);
  bundle.Solve(50);

  const Eigen::MatrixXd covariance = bundle.CovarianceOfLenses();
  if (covariance.size() == 0)
    throw NumericError(
        "the lens cannot be estimated: the images do not determine it; calibrate the camera (trigpoint calibrate)");
  std::vector<SelfCalibration> found;
  Eigen::Index at = 0;
  for (size_t c = 0; c < bundle.lenses.size(); ++c) {
    if (!guessed(input.cameras[c]) || !bundle.HasLens(c)) continue;
    const Eigen::VectorXd sigma = covariance.diagonal().segment<kLens>(at).cwiseMax(0).cwiseSqrt();
    at += kLens;
    SelfCalibration s;
    s.camera = static_cast<int>(c);
    s.found = WithLens(input.cameras[c].camera, bundle.lenses[c]);
    s.sigma_focal_px = sigma(0), s.sigma_k1 = sigma(1), s.sigma_k2 = sigma(2);
    s.sigma_centre_px = sigma.tail<2>().maxCoeff();
    s.shift_px = LargestShift(input.cameras[c].camera, s.found);
    found.push_back(s);
  }
  return found;
}

namespace {

// Of images that are one, four and ten apart in time, of one camera: with little and with much parallax.
std::vector<ImagePair> PairsAlongTime(const LocalizeInput& input, size_t camera) {
  constexpr size_t kStarts = 20;
  std::vector<int> images;
  for (size_t i = 0; i < input.images.size(); ++i) {
    if (input.images[i].camera == static_cast<int>(camera)) images.push_back(static_cast<int>(i));
  }
  std::vector<ImagePair> pairs;
  const size_t step = std::max<size_t>(1, images.size() / kStarts);
  for (size_t k = 0; k < images.size(); k += step) {
    for (const size_t apart : {1, 4, 10}) {
      if (k + apart < images.size()) pairs.push_back({images[k], images[k + apart]});
    }
  }
  return pairs;
}

}  // namespace

void SearchFocalLengths(LocalizeInput* input, const ViewGraphOptions& options, int threads, uint64_t seed,
                        ProgressSink& progress, const CancelToken& cancel) {
  for (size_t c = 0; c < input->cameras.size(); ++c) {
    BodyCamera& camera = input->cameras[c];
    if (camera.focal_sigma_share < kWildGuess) continue;
    const std::vector<ImagePair> pairs = PairsAlongTime(*input, c);
    const double long_side = std::max(camera.camera.width(), camera.camera.height());
    double best = 0;
    size_t most = 0;
    // From 100 deg across the long side to 20 deg, in steps of 15 %.
    for (double share = 0.42; share < 3; share *= 1.15) {
      camera.camera = WithFocal(camera.camera, share * long_side);
      size_t fitting = 0;
      for (const ViewEdge& edge : VerifyPairs(*input, pairs, options, threads, seed, progress, cancel)) {
        fitting += edge.matches.size();
      }
      if (fitting > most) most = fitting, best = share;
    }
    if (best > 0) camera.guessed_focal_px = best * long_side, camera.focal_sigma_share = kSearchedSigma;
    camera.camera = WithFocal(camera.camera, camera.guessed_focal_px);
  }
}

}  // namespace trigpoint
