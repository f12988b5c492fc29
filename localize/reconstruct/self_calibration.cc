#include "localize/reconstruct/self_calibration.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/base/error.h"
#include "localize/reconstruct/lens_shift.h"

namespace trigpoint {
namespace {

constexpr int kPointsPerImage = 200;  // more hardly say more of three numbers
// 1 sigma of the distortion of lenses that nobody calibrated, about none.
constexpr double kSigmaK1 = 0.1, kSigmaK2 = 0.1;
// 1 sigma of the principal point about the picture's centre, share of the long side.
constexpr double kSigmaCentre = 0.01;
constexpr double kSigmaRevised = 0.01;  // of each error of a calibration that images contradict; usual: 0.003
constexpr double kSearchedSigma = 0.1;  // of a focal length that was searched in steps of 15 %

constexpr int kLens = kLensParameters;
using Lens = LensParameters;  // f (px, the mean), k1, k2, principal point (px)

// What of a camera is not estimated.
struct FixedLens {
  double f_x = 1, f_y = 1;  // shares of the mean focal length
  double p1 = 0, p2 = 0;
};

// (predicted pixel - pixel) / sigma.
struct PixelCost {
  Rigid3d cam_from_body;
  FixedLens fixed;
  Eigen::Vector2d pixel;
  double inverse_sigma;
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* lens, T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_cam = InCamera(cam_from_body, pose, point);
    if (in_cam.z() < T(1e-6)) return false;
    const Eigen::Matrix<T, 2, 1> x = in_cam.template head<2>() / in_cam.z();
    const T r2 = x.squaredNorm(), xy = T(2) * x.x() * x.y();
    Eigen::Matrix<T, 2, 1> distorted = (T(1) + r2 * (lens[1] + r2 * lens[2])) * x;
    distorted.x() += fixed.p1 * xy + fixed.p2 * (r2 + T(2) * x.x() * x.x());
    distorted.y() += fixed.p2 * xy + fixed.p1 * (r2 + T(2) * x.y() * x.y());
    const Eigen::Matrix<T, 2, 1> predicted(lens[0] * fixed.f_x * distorted.x() + lens[3],
                                           lens[0] * fixed.f_y * distorted.y() + lens[4]);
    Eigen::Map<Eigen::Matrix<T, 2, 1>>{residual} = T(inverse_sigma) * (predicted - pixel.cast<T>());
    return true;
  }
};

double Parameter(const Camera& camera, size_t k) { return camera.params().size() > k ? camera.params()[k] : 0; }

// With the parameters of Lens and FixedLens alone.
bool IsRadtan(const Camera& camera) {
  const bool radtan = camera.model() == CameraModel::kPinhole || camera.model() == CameraModel::kRadtan;
  return radtan && Parameter(camera, 8) == 0;  // k3
}

Lens LensOf(const Camera& camera) {
  return {camera.MeanFocal(), Parameter(camera, 4), Parameter(camera, 5), Parameter(camera, 2), Parameter(camera, 3)};
}

FixedLens FixedOf(const Camera& camera) {
  const double f = camera.MeanFocal();
  return {camera.params()[0] / f, camera.params()[1] / f, Parameter(camera, 6), Parameter(camera, 7)};
}

Camera WithLens(const Camera& camera, const Lens& lens, const FixedLens& fixed = {}) {
  return {CameraModel::kRadtan,
          camera.width(),
          camera.height(),
          {lens[0] * fixed.f_x, lens[0] * fixed.f_y, lens[3], lens[4], lens[1], lens[2], fixed.p1, fixed.p2}};
}

// Without distortion, its principal point in the picture's middle.
Camera WithFocal(const Camera& camera, double focal_px) {
  return WithLens(camera, {focal_px, 0, 0, 0.5 * (camera.width() - 1), 0.5 * (camera.height() - 1)});
}

// What is known of a lens that is free.
struct LensPrior {
  Lens value{}, sigma{};
  FixedLens fixed;
  bool guessed = false;  // nobody calibrated it
};
using LensPriors = std::vector<std::optional<LensPrior>>;  // of each camera; none: it is held

// Of a guess: 1 sigma of lenses that nobody calibrated.
std::optional<LensPrior> GuessOf(const BodyCamera& camera) {
  if (!(camera.focal_sigma_share > 0)) return std::nullopt;
  const int width = camera.camera.width(), height = camera.camera.height();
  const double centre = kSigmaCentre * std::max(width, height);
  return LensPrior{{camera.guessed_focal_px, 0, 0, 0.5 * (width - 1), 0.5 * (height - 1)},
                   {camera.focal_sigma_share * camera.guessed_focal_px, kSigmaK1, kSigmaK2, centre, centre},
                   {},
                   true};
}

// Of a calibration: each parameter may move the picture's corners by a share of half the diagonal.
std::optional<LensPrior> CalibrationOf(const BodyCamera& camera) {
  const Camera& c = camera.camera;
  const bool whole = camera.part.kind == PicturePart::Kind::kAll;
  if (!whole || !IsRadtan(c)) return std::nullopt;
  const double f = c.MeanFocal(), corner = HalfDiagonal(c) / f, centre = kSigmaRevised * HalfDiagonal(c);
  return LensPrior{
      LensOf(c),
      {kSigmaRevised * f, kSigmaRevised / std::pow(corner, 2), kSigmaRevised / std::pow(corner, 4), centre, centre},
      FixedOf(c)};
}

void AddLenses(const LensPriors& priors, LensBundle* bundle) {
  for (size_t c = 0; c < bundle->lenses.size(); ++c) {
    if (!bundle->HasLens(c)) continue;
    double* const lens = bundle->lenses[c].data();
    if (!priors[c]) {
      bundle->problem.SetParameterBlockConstant(lens);
      continue;
    }
    bundle->AddPrior(c, priors[c]->value, priors[c]->sigma);
    bundle->problem.SetParameterLowerBound(lens, 0, 0.2 * priors[c]->value[0]);
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

// The ninth of its camera's picture in which an observation lies; numbers of all cameras differ.
int PartOfPicture(const LocalizeInput& input, const BearingObservation& o) {
  const Camera& camera = input.cameras[static_cast<size_t>(o.view)].camera;
  const Eigen::Vector2d pixel = camera.Project(o.ray.cast<double>()).value_or(Eigen::Vector2d::Zero());
  const auto third = [](double at, int size) { return std::clamp(static_cast<int>(3 * at / size), 0, 2); };
  return 9 * o.view + 3 * third(pixel.y(), camera.height()) + third(pixel.x(), camera.width());
}

// Of a lens's errors, LensParameters, by that of the lens itself: the errors that move pixels over the picture as each
// of its parameters does, by least squares.
Eigen::Matrix<double, kLens, kLens> CovarianceOfErrors(const Camera& camera, const FixedLens& fixed,
                                                       const Eigen::Matrix<double, kLens, kLens>& of_lens) {
  constexpr int kGrid = 9;
  constexpr Lens kSteps = {1e-3, 1e-6, 1e-6, 1e-3, 1e-3};  // px and distortion
  Eigen::MatrixXd by_error(2 * kGrid * kGrid, kLens), by_parameter = Eigen::MatrixXd::Zero(2 * kGrid * kGrid, kLens);
  for (int at = 0; at < kGrid * kGrid; ++at) {
    const Eigen::Vector2d pixel((at % kGrid + 0.5) / kGrid * camera.width(),
                                (at / kGrid + 0.5) / kGrid * camera.height());
    by_error.middleRows<2>(2 * at) = ShiftOf(camera, pixel);
    const auto ray = camera.Unproject(pixel);
    for (size_t k = 0; k < kLens && ray; ++k) {
      Lens moved = LensOf(camera);
      moved[k] += kSteps[k];
      const auto there = WithLens(camera, moved, fixed).Project(*ray), here = camera.Project(*ray);
      if (there && here) by_parameter.block<2, 1>(2 * at, static_cast<Eigen::Index>(k)) = (*there - *here) / kSteps[k];
    }
  }
  const Eigen::Matrix<double, kLens, kLens> by_lens = by_error.colPivHouseholderQr().solve(by_parameter);
  return by_lens * of_lens * by_lens.transpose();
}

// The lenses that `priors` let free.
std::vector<SelfCalibration> Calibrate(const LocalizeInput& input, const Reconstruction& r, const LensPriors& priors) {
  const auto any = [&](const auto& which) { return std::any_of(priors.begin(), priors.end(), which); };
  if (!any([](const auto& prior) { return prior.has_value(); })) return {};
  std::vector<Lens> lenses;
  for (const BodyCamera& c : input.cameras) lenses.push_back(LensOf(c.camera));
  LensBundle bundle(r, std::move(lenses));
  // Nothing for what is no pixel of the camera, nor for lenses of another model.
  bundle.AddImages(kPointsPerImage, [&](const BearingObservation& o) -> ceres::CostFunction* {
    const BodyCamera& camera = input.cameras[static_cast<size_t>(o.view)];
    const auto pixel = camera.camera.Project(o.ray.cast<double>());
    if (!pixel || !IsRadtan(camera.camera)) return nullptr;
    const auto& prior = priors[static_cast<size_t>(o.view)];
    return new ceres::AutoDiffCostFunction<PixelCost, 2, 6, 3, kLens>(
        new PixelCost{camera.cam_from_body, prior ? prior->fixed : FixedOf(camera.camera), *pixel,
                      1 / (r.sigma_px * r.correlation_inflation)});
  });
  bundle.AddMotion();
  AddLenses(priors, &bundle);
  bundle.Solve(50);
  using Part = std::function<int(const BearingObservation&)>;
  const bool guessed = any([](const auto& prior) { return prior && prior->guessed; });
  MarginalCovariance known =
      bundle.CovarianceOfLenses(guessed ? Part([&](const auto& o) { return PartOfPicture(input, o); }) : Part());
  if (known.shared > 1) {
    // Where the lens model is wrong, points err alike; counted as independent they would outvote the prior.
    bundle.Discount(known.shared);
    bundle.Solve(50);
    known = bundle.CovarianceOfLenses();
  }
  const Eigen::MatrixXd& covariance = known.covariance;
  if (covariance.size() == 0)
    throw NumericError(
        "the lens cannot be estimated: the images do not determine it; calibrate the camera (trigpoint calibrate)");
  std::vector<SelfCalibration> found;
  Eigen::Index at = 0;
  for (size_t c = 0; c < bundle.lenses.size(); ++c) {
    if (!priors[c] || !bundle.HasLens(c)) continue;
    const Eigen::VectorXd sigma = covariance.diagonal().segment<kLens>(at).cwiseMax(0).cwiseSqrt();
    SelfCalibration s;
    s.camera = static_cast<int>(c);
    s.found = WithLens(input.cameras[c].camera, bundle.lenses[c], priors[c]->fixed);
    s.covariance = CovarianceOfErrors(s.found, priors[c]->fixed, covariance.block<kLens, kLens>(at, at));
    at += kLens;
    s.sigma_focal_px = sigma(0), s.sigma_k1 = sigma(1), s.sigma_k2 = sigma(2);
    s.sigma_centre_px = sigma.tail<2>().maxCoeff();
    for (size_t k = 0; k < kLens; ++k) {
      const double off = std::abs(bundle.lenses[c][k] - priors[c]->value[k]);
      s.sigmas = std::max(s.sigmas, off / std::max(1e-12, sigma(static_cast<Eigen::Index>(k))));
    }
    s.shift_px = LargestShift(input.cameras[c].camera, s.found);
    found.push_back(s);
  }
  return found;
}

}  // namespace

std::vector<SelfCalibration> SelfCalibrate(const LocalizeInput& input, const Reconstruction& r) {
  LensPriors priors;
  for (const BodyCamera& c : input.cameras) priors.push_back(GuessOf(c));
  return Calibrate(input, r, priors);
}

std::vector<SelfCalibration> ReviseLenses(const LocalizeInput& input, const Reconstruction& r,
                                          const std::vector<BodyCamera>& calibrated) {
  LensPriors priors;
  for (const BodyCamera& c : calibrated) priors.push_back(CalibrationOf(c));
  return Calibrate(input, r, priors);
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
