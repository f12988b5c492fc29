#include "localize/reconstruct/self_calibration.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/estimation/marginal_covariance.h"
#include "calib/geometry/so3.h"

namespace trigpoint {
namespace {

constexpr int kPointsPerImage = 200;  // more hardly say more of three numbers
// 1 sigma of the distortion of lenses that nobody calibrated, about none.
constexpr double kSigmaK1 = 0.1, kSigmaK2 = 0.1;
// 1 sigma of the principal point about the picture's centre, share of the long side.
constexpr double kSigmaCentre = 0.01;
constexpr double kSearchedSigma = 0.1;  // of a focal length that was searched in steps of 15 %
constexpr double kLossPx = 2.5;         // of the residuals' noise: beyond it errors count less (Cauchy)

using Block = std::array<double, 6>;  // angle axis and translation of body_from_odom
constexpr int kLens = 5;
using Lens = std::array<double, kLens>;  // f (px), k1, k2, principal point (px)

template <typename T>
Eigen::Matrix<T, 3, 1> Transformed(const T* pose, const Eigen::Matrix<T, 3, 1>& point) {
  Eigen::Matrix<T, 3, 1> out;
  ceres::AngleAxisRotatePoint(pose, point.data(), out.data());
  return out + Eigen::Map<const Eigen::Matrix<T, 3, 1>>(pose + 3);
}

// (predicted pixel - pixel) / sigma.
struct PixelCost {
  Rigid3d cam_from_body;
  Eigen::Vector2d pixel;
  double inverse_sigma;
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* lens, T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_body = Transformed<T>(pose, Eigen::Map<const Eigen::Matrix<T, 3, 1>>(point));
    const Eigen::Matrix<T, 3, 1> in_cam =
        cam_from_body.rotation.cast<T>() * in_body + cam_from_body.translation.cast<T>();
    if (in_cam.z() < T(1e-6)) return false;
    const Eigen::Matrix<T, 2, 1> x = in_cam.template head<2>() / in_cam.z();
    const T r2 = x.squaredNorm();
    const Eigen::Matrix<T, 2, 1> predicted =
        lens[0] * (T(1) + r2 * (lens[1] + r2 * lens[2])) * x + Eigen::Matrix<T, 2, 1>(lens[3], lens[4]);
    Eigen::Map<Eigen::Matrix<T, 2, 1>>{residual} = T(inverse_sigma) * (predicted - pixel.cast<T>());
    return true;
  }
};

// A pose factor between two poses, as the bundle has it; scaled by nothing.
struct BetweenCost {
  const PoseFactor& factor;
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    Eigen::Quaternion<T> qa, qb;
    T q[4];
    ceres::AngleAxisToQuaternion(a, q);
    qa = Eigen::Quaternion<T>(q[0], q[1], q[2], q[3]);
    ceres::AngleAxisToQuaternion(b, q);
    qb = Eigen::Quaternion<T>(q[0], q[1], q[2], q[3]);
    const Eigen::Quaternion<T> turn = qa * qb.conjugate();
    const Eigen::Matrix<T, 3, 1> shift =
        Eigen::Map<const Eigen::Matrix<T, 3, 1>>(a + 3) - turn * Eigen::Map<const Eigen::Matrix<T, 3, 1>>(b + 3);
    const Eigen::Quaternion<T> off = turn * factor.measured.rotation.conjugate().cast<T>();
    const T wxyz[4] = {off.w(), off.x(), off.y(), off.z()};
    Eigen::Matrix<T, 6, 1> e;
    ceres::QuaternionToAngleAxis(wxyz, e.data());
    e.template tail<3>() = shift - factor.measured.translation.cast<T>();
    Eigen::Map<Eigen::Matrix<T, 6, 1>>{residual} = factor.sqrt_info.cast<T>() * e;
    return true;
  }
};

struct LensPrior {
  Lens value, inverse_sigma;
  template <typename T>
  bool operator()(const T* lens, T* residual) const {
    for (size_t k = 0; k < value.size(); ++k) residual[k] = (lens[k] - value[k]) * inverse_sigma[k];
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

// Poses that take part: all, or some stretches of a long run.
std::vector<bool> PosesToUse(size_t poses) {
  constexpr size_t kMost = 150, kStretches = 5;
  std::vector<bool> used(poses, poses <= kMost);
  for (size_t k = 0; k < kStretches && poses > kMost; ++k) {
    const size_t begin = k * (poses - kMost / kStretches) / (kStretches - 1);
    std::fill_n(used.begin() + static_cast<std::ptrdiff_t>(begin), kMost / kStretches, true);
  }
  return used;
}

// Points to adjust: those that most images show, so many that every image has enough.
std::vector<bool> PointsToUse(const Reconstruction& r, const std::vector<bool>& poses, size_t images) {
  std::vector<int> seen(r.problem.points.size(), 0);
  std::vector<std::vector<size_t>> observations(r.problem.points.size());
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    const auto point = static_cast<size_t>(o.point);
    if (!o.active || !r.point_valid[point] || !poses[static_cast<size_t>(o.pose)]) continue;
    ++seen[point];
    observations[point].push_back(k);
  }
  std::vector<size_t> order(seen.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return seen[a] > seen[b]; });
  std::vector<int> of_image(images, 0);
  std::vector<bool> used(seen.size(), false);
  for (const size_t j : order) {
    if (seen[j] < 2) break;
    const auto has_room = [&](size_t k) { return of_image[static_cast<size_t>(r.image_of[k])] < kPointsPerImage; };
    if (std::none_of(observations[j].begin(), observations[j].end(), has_room)) continue;
    used[j] = true;
    for (const size_t k : observations[j]) ++of_image[static_cast<size_t>(r.image_of[k])];
  }
  return used;
}

// Ceres keeps pointers into it.
struct Blocks {
  std::vector<Block> poses;
  std::vector<Eigen::Vector3d> points;
  std::vector<Lens> lenses;  // of each camera
};

void AddObservations(const LocalizeInput& input, const Reconstruction& r, ceres::LossFunction* loss,
                     ceres::Problem* problem, Blocks* b) {
  const std::vector<bool> poses = PosesToUse(r.problem.poses.size());
  const std::vector<bool> used = PointsToUse(r, poses, input.images.size());
  for (const BearingObservation& o : r.problem.observations) {
    if (!o.active || !used[static_cast<size_t>(o.point)] || !poses[static_cast<size_t>(o.pose)]) continue;
    const auto camera = static_cast<size_t>(o.view);
    if (camera >= input.cameras.size()) continue;
    const auto pixel = input.cameras[camera].camera.Project(o.ray.cast<double>());
    if (!pixel) continue;
    auto* cost = new PixelCost{input.cameras[camera].cam_from_body, *pixel, 1 / (r.sigma_px * r.correlation_inflation)};
    problem->AddResidualBlock(new ceres::AutoDiffCostFunction<PixelCost, 2, 6, 3, kLens>(cost), loss,
                              b->poses[static_cast<size_t>(o.pose)].data(),
                              b->points[static_cast<size_t>(o.point)].data(), b->lenses[camera].data());
  }
}

void AddLenses(const LocalizeInput& input, ceres::Problem* problem, Blocks* b) {
  for (size_t c = 0; c < b->lenses.size(); ++c) {
    double* const lens = b->lenses[c].data();
    if (!problem->HasParameterBlock(lens)) continue;
    const BodyCamera& camera = input.cameras[c];
    if (!(camera.focal_sigma_share > 0)) {
      problem->SetParameterBlockConstant(lens);
      continue;
    }
    const int width = camera.camera.width(), height = camera.camera.height();
    const double centre = 1 / (kSigmaCentre * std::max(width, height));
    const Lens value = {camera.guessed_focal_px, 0, 0, 0.5 * (width - 1), 0.5 * (height - 1)};
    const Lens inverse = {1 / (camera.focal_sigma_share * camera.guessed_focal_px), 1 / kSigmaK1, 1 / kSigmaK2, centre,
                          centre};
    problem->AddResidualBlock(new ceres::AutoDiffCostFunction<LensPrior, kLens, kLens>(new LensPrior{value, inverse}),
                              nullptr, lens);
    problem->SetParameterLowerBound(lens, 0, 0.2 * camera.guessed_focal_px);
  }
}

// Odometry between the poses that take part. Of each stretch the first pose is held.
void AddMotion(const Reconstruction& r, ceres::Problem* problem, Blocks* b) {
  std::vector<bool> follows(b->poses.size(), false);
  for (const PoseFactor& f : r.problem.factors) {
    const auto first = static_cast<size_t>(f.a), second = static_cast<size_t>(f.b);
    if (f.kind != PoseFactor::Kind::kBetween || !problem->HasParameterBlock(b->poses[first].data()) ||
        !problem->HasParameterBlock(b->poses[second].data()))
      continue;
    problem->AddResidualBlock(new ceres::AutoDiffCostFunction<BetweenCost, 6, 6, 6>(new BetweenCost{f}), nullptr,
                              b->poses[first].data(), b->poses[second].data());
    follows[std::max(first, second)] = true;
  }
  for (size_t k = 0; k < b->poses.size(); ++k) {
    if (follows[k] || !problem->HasParameterBlock(b->poses[k].data())) continue;
    problem->SetParameterBlockConstant(b->poses[k].data());
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

// Of the lenses that are free, in order.
Eigen::MatrixXd CovarianceOfLenses(ceres::Problem* problem, Blocks* b) {
  const auto is_free = [&](double* block) {
    return problem->HasParameterBlock(block) && !problem->IsParameterBlockConstant(block);
  };
  std::vector<double*> kept, points;
  for (Lens& lens : b->lenses) {
    if (is_free(lens.data())) kept.push_back(lens.data());
  }
  for (Block& pose : b->poses) {
    if (is_free(pose.data())) kept.push_back(pose.data());
  }
  for (Eigen::Vector3d& point : b->points) {
    if (is_free(point.data())) points.push_back(point.data());
  }
  const MarginalCovariance marginal = Marginalise(problem, kept, points, {});
  if (marginal.covariance.size() == 0)
    throw NumericError(
        "the lens cannot be estimated: the images do not determine it; calibrate the camera (trigpoint calibrate)");
  return marginal.covariance;
}

}  // namespace

std::vector<SelfCalibration> SelfCalibrate(const LocalizeInput& input, const Reconstruction& r, int threads) {
  const auto guessed = [](const BodyCamera& c) { return c.focal_sigma_share > 0; };
  if (std::none_of(input.cameras.begin(), input.cameras.end(), guessed)) return {};
  Blocks b;
  for (const Rigid3d& pose : r.problem.poses) {
    const Eigen::Vector3d w = LogSO3(pose.rotation);
    b.poses.push_back({w.x(), w.y(), w.z(), pose.translation.x(), pose.translation.y(), pose.translation.z()});
  }
  b.points = r.problem.points;
  for (const BodyCamera& c : input.cameras) b.lenses.push_back(LensOf(c.camera));
  ceres::CauchyLoss loss(kLossPx);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  AddObservations(input, r, &loss, &problem, &b);
  if (problem.NumResidualBlocks() == 0)
    throw NumericError("the lens cannot be estimated: expected points seen in several images, found none");
  AddMotion(r, &problem, &b);
  AddLenses(input, &problem, &b);
  ceres::Solver::Options solve;
  solve.linear_solver_type = ceres::SPARSE_SCHUR;
  solve.num_threads = ResolveThreads(threads);
  solve.max_num_iterations = 50;
  solve.function_tolerance = 1e-6;
  solve.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solve, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw NumericError("the lenses cannot be estimated: " + summary.message);

  const Eigen::MatrixXd covariance = CovarianceOfLenses(&problem, &b);
  std::vector<SelfCalibration> found;
  Eigen::Index at = 0;
  for (size_t c = 0; c < b.lenses.size(); ++c) {
    const double* const lens = b.lenses[c].data();
    if (!guessed(input.cameras[c]) || !problem.HasParameterBlock(lens)) continue;
    const Eigen::VectorXd sigma = covariance.diagonal().segment<kLens>(at).cwiseMax(0).cwiseSqrt();
    at += kLens;
    SelfCalibration s;
    s.camera = static_cast<int>(c);
    s.found = WithLens(input.cameras[c].camera, b.lenses[c]);
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
