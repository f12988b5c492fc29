#include "survey/panorama/rig_bundle.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "calib/base/error.h"
#include "calib/base/union_find.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/marginal_covariance.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "calib/geometry/so3.h"
#include "survey/panorama/rig_costs.h"

namespace trigpoint {
namespace {

constexpr double kScenePoints = 50;  // what all points together are worth in saying how far the scene is
constexpr std::array<double, 3> kCells_deg = {10, 20, 40};  // over which errors may be alike
// 1 sigma of p1 and p2. Calibrated lenses have up to 0.001; a principal point that is 1 % of the focal length off the
// picture's middle, which photos that are turned show as decentring, has 0.003.
constexpr double kDecentring = 0.002;
constexpr double kUnknown = 1e6;  // variance of what nothing says anything about

// ((c / r) - a) / kappa; parameters: centre (m), ln r.
struct CircleCost {
  Eigen::Vector3d look;
  double inverse_share;
  template <typename T>
  bool operator()(const T* centre, const T* log_radius, T* residual) const {
    using std::exp;
    const T inverse = exp(-log_radius[0]);
    for (int k = 0; k < 3; ++k) residual[k] = (centre[k] * inverse - look(k)) * inverse_share;
    return true;
  }
};

// rho * r / sigma: how far a point's distance moves it, as an angle (rad). Seen from a circle, points that are all at
// one distance are the same as points at infinity and a longer lens; what else holds the two apart is weak in one row.
struct ParallaxPrior {
  double inverse_sigma;
  template <typename T>
  bool operator()(const T* point, const T* log_radius, T* residual) const {
    using std::exp;
    residual[0] = point[2] * exp(log_radius[0]) * inverse_sigma;
    residual[1] = T(0);  // as many rows as an observation has: Ceres eliminates points by blocks of one size faster
    return true;
  }
};

struct ScalarPrior {
  int index;
  double value, inverse_sigma;
  template <typename T>
  bool operator()(const T* block, T* residual) const {
    residual[0] = (block[index] - value) * inverse_sigma;
    return true;
  }
};

using ceres::AutoDiffCostFunction;

// What is adjusted, and which of it the observations reach. Ceres keeps pointers into it.
struct Blocks {
  explicit Blocks(const RigState& state, double radius_m)
      : rotations(state.photos.size(), {0, 0, 0}),
        log_radius(std::log(radius_m)),
        seen(state.photos.size(), false),
        lens_seen(state.lenses.size(), false) {
    for (const RigPhoto& p : state.photos) centres.push_back({p.centre.x(), p.centre.y(), p.centre.z()});
    for (const Lens& l : state.lenses) lenses.push_back({l.focal_px, l.k1, l.k2, l.p1, l.p2});
    for (const RigPoint& p : state.points) points.push_back({0, 0, p.inverse_distance});
  }
  Blocks(const Blocks&) = delete;
  Blocks& operator=(const Blocks&) = delete;

  std::vector<std::array<double, 3>> rotations, centres, points;
  std::vector<std::array<double, kLensParameters>> lenses;
  double log_radius = 0;
  std::vector<bool> seen, lens_seen;
  std::vector<double*> camera_blocks, point_blocks;  // in the problem, in its order
};

// Points in one cell of the sphere may err alike. `width`: rad.
int CellOf(const Eigen::Vector3d& direction, double width) {
  const double elevation = std::asin(std::clamp(-direction.y(), -1.0, 1.0));
  const int row = static_cast<int>(std::floor(elevation / width));
  const double around = 2 * std::numbers::pi * std::cos((row + 0.5) * width);
  const int cells = std::max(1, static_cast<int>(std::lround(around / width)));
  const double turn = std::atan2(direction.x(), direction.z()) / (2 * std::numbers::pi) + 0.5;
  return 1000 * (row + 500) + std::min(cells - 1, static_cast<int>(turn * cells));
}

void AddObservations(const std::vector<PairView>& views, const RigState& state, double sigma_px,
                     ceres::LossFunction* loss, ceres::Problem* problem, Blocks* b) {
  for (size_t j = 0; j < state.points.size(); ++j) {
    const RigPoint& point = state.points[j];
    for (const RigObservation& o : point.observations) {
      const size_t i = static_cast<size_t>(o.photo);
      const RigPhoto& photo = state.photos[i];
      const size_t lens = static_cast<size_t>(photo.lens);
      problem->AddResidualBlock(new RigObservationCost(views[i], state.lenses[lens].fisheye, photo.cam_from_rig,
                                                       point.direction, o.pixel, o.weight / sigma_px),
                                loss, b->rotations[i].data(), b->centres[i].data(), b->lenses[lens].data(),
                                b->points[j].data());
      b->seen[i] = true;
      b->lens_seen[lens] = true;
    }
  }
  if (problem->NumResidualBlocks() == 0) throw NumericError("no matches between the photos are left to adjust");
}

// Points with the scene's parallax, or at their distances if the centres are held.
void AddPoints(const RigState& state, const RigBundleOptions& options, ceres::Problem* problem, Blocks* b) {
  // One scene has one spread of distances: its points count together as kScenePoints.
  const double inverse_parallax =
      std::sqrt(std::min(1.0, kScenePoints / static_cast<double>(state.points.size()))) / options.parallax;
  for (size_t j = 0; j < state.points.size(); ++j) {
    if (state.points[j].observations.empty()) continue;
    double* point = b->points[j].data();
    b->point_blocks.push_back(point);
    if (options.centres) {
      problem->AddResidualBlock(new AutoDiffCostFunction<ParallaxPrior, 2, 3, 1>(new ParallaxPrior{inverse_parallax}),
                                nullptr, point, &b->log_radius);
    } else {
      problem->SetManifold(point, new ceres::SubsetManifold(3, {2}));
    }
  }
}

// The first photo's rotation is held; centres are held or on the circle.
void AddPhotos(const RigState& state, const RigBundleOptions& options, ceres::Problem* problem, Blocks* b) {
  bool first = true;
  for (size_t i = 0; i < state.photos.size(); ++i) {
    if (!b->seen[i]) continue;
    b->camera_blocks.push_back(b->rotations[i].data());
    b->camera_blocks.push_back(b->centres[i].data());
    if (first) problem->SetParameterBlockConstant(b->rotations[i].data());
    first = false;
    if (!options.centres) {
      problem->SetParameterBlockConstant(b->centres[i].data());
      continue;
    }
    Eigen::Vector3d look = state.photos[i].cam_from_rig.conjugate() * Eigen::Vector3d::UnitZ();
    look -= options.up * options.up.dot(look);
    const bool circle = options.circle_share > 0 && look.norm() > 0.2;
    // Straight up or down there is no direction on the circle: somewhere within it, like everything without a circle.
    look = circle ? look.normalized() : Eigen::Vector3d::Zero();
    problem->AddResidualBlock(
        new AutoDiffCostFunction<CircleCost, 3, 3, 1>(new CircleCost{look, circle ? 1 / options.circle_share : 1.0}),
        nullptr, b->centres[i].data(), &b->log_radius);
  }
  if (!options.centres) return;
  problem->AddResidualBlock(new AutoDiffCostFunction<ScalarPrior, 1, 1>(new ScalarPrior{
                                0, std::log(options.radius_m), 1 / std::log(std::max(1.001, options.radius_factor))}),
                            nullptr, &b->log_radius);
  // Nothing but this prior knows the size, so the answer is its own value; the covariance is taken with it free.
  problem->SetParameterBlockConstant(&b->log_radius);
}

// Of a lens, by the order of its parameters.
std::vector<int> HeldParameters(const Lens& lens, bool distortion) {
  if (!distortion) return {1, 2, 3, 4};
  return lens.fisheye ? std::vector<int>{3, 4} : std::vector<int>{};
}

void AddLenses(const RigState& state, const RigBundleOptions& options, ceres::Problem* problem, Blocks* b) {
  const auto prior_on = [&](double* lens, int index, double value, double sigma) {
    problem->AddResidualBlock(
        new AutoDiffCostFunction<ScalarPrior, 1, kLensParameters>(new ScalarPrior{index, value, 1 / sigma}), nullptr,
        lens);
  };
  for (size_t l = 0; l < state.lenses.size(); ++l) {
    if (!b->lens_seen[l]) continue;
    double* lens = b->lenses[l].data();
    b->camera_blocks.push_back(lens);
    if (const std::vector<int> held = HeldParameters(state.lenses[l], options.distortion); !held.empty()) {
      problem->SetManifold(lens, new ceres::SubsetManifold(kLensParameters, held));
    }
    const LensPrior& prior = state.lens_priors[l];
    if (prior.focal_px > 0) prior_on(lens, 0, prior.focal_px, prior.sigma_share * prior.focal_px);
    // What lenses of phones and cameras have; holds the terms where few photos see the corners. Two fisheyes back to
    // back say only how far out their rim is: between its axis and there a lens is what others of its kind are.
    const Lens usual = StartLens(1, state.lenses[l].fisheye);
    prior_on(lens, 1, usual.k1, usual.fisheye ? 0.05 : 0.2);
    prior_on(lens, 2, usual.k2, usual.fisheye ? 0.02 : 0.2);
    if (usual.fisheye) continue;
    for (const int p : {3, 4}) prior_on(lens, p, 0, kDecentring);
    problem->SetParameterLowerBound(lens, 0, 20);
  }
}

ceres::Solver::Summary Minimise(const RigBundleOptions& options, ceres::Problem* problem, Blocks* b) {
  ceres::Solver::Options solve;
  solve.linear_solver_type = ceres::DENSE_SCHUR;
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (double* p : b->point_blocks) ordering->AddElementToGroup(p, 0);
  // A group each: within one, Ceres goes by addresses in memory, which differ from run to run.
  int group = 1;
  for (double* c : b->camera_blocks) ordering->AddElementToGroup(c, group++);
  if (options.centres) ordering->AddElementToGroup(&b->log_radius, group);
  solve.linear_solver_ordering.reset(ordering);
  solve.max_num_iterations = options.max_iterations;
  solve.function_tolerance = 1e-8;
  solve.num_threads = 1;  // several add up in an order of their own, and the result is not the same every time
  solve.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solve, problem, &summary);
  if (!summary.IsSolutionUsable()) throw NumericError("the photos' bundle adjustment failed: " + summary.message);
  return summary;
}

// Back into the state; the covariance is taken where the tangents are zero.
void StoreBlocks(const Blocks& b, RigState* state) {
  for (size_t i = 0; i < state->photos.size(); ++i) {
    if (!b.seen[i]) continue;
    RigPhoto& p = state->photos[i];
    p.cam_from_rig = (ExpSO3(Eigen::Vector3d(b.rotations[i][0], b.rotations[i][1], b.rotations[i][2])) * p.cam_from_rig)
                         .normalized();
    p.centre = Eigen::Vector3d(b.centres[i][0], b.centres[i][1], b.centres[i][2]);
  }
  for (size_t l = 0; l < state->lenses.size(); ++l) {
    Lens& lens = state->lenses[l];
    const auto& [focal_px, k1, k2, p1, p2] = b.lenses[l];
    lens = {focal_px, k1, k2, lens.fisheye, p1, p2};
  }
  for (size_t j = 0; j < state->points.size(); ++j) {
    RigPoint& p = state->points[j];
    const Eigen::Vector3d d =
        p.direction + TangentBasis(p.direction).transpose() * Eigen::Vector2d(b.points[j][0], b.points[j][1]);
    p.inverse_distance = b.points[j][2] / d.norm();
    p.direction = d.normalized();
  }
  state->radius_m = std::exp(b.log_radius);
}

// Root mean square of the observations' errors, px a coordinate.
double RmsPx(const std::vector<PairView>& views, const RigState& state) {
  double sum = 0;
  int count = 0;
  for (const RigPoint& p : state.points) {
    for (const RigObservation& o : p.observations) {
      Eigen::Vector2d pixel;
      if (!ProjectRigPoint(views, state, p, o.photo, &pixel)) continue;
      sum += (pixel - o.pixel).squaredNorm();
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / (2 * count)) : 0;
}

// Of each row of the answer's covariance its column in the reduced one, -1: held.
std::vector<int> SourceRows(const RigState& state, const Blocks& b, const std::map<const double*, int>& column,
                            bool distortion) {
  std::vector<int> source;
  for (size_t i = 0; i < state.photos.size(); ++i) {
    if (!state.photos[i].placed) continue;
    for (const double* block : {b.rotations[i].data(), b.centres[i].data()}) {
      const auto it = column.find(block);
      for (int k = 0; k < 3; ++k) source.push_back(it == column.end() ? -1 : it->second + k);
    }
  }
  for (size_t l = 0; l < state.lenses.size(); ++l) {
    const auto it = column.find(b.lenses[l].data());
    const std::vector<int> held = HeldParameters(state.lenses[l], distortion);
    int free = 0;
    for (int k = 0; k < kLensParameters; ++k) {
      const bool is_held = it == column.end() || std::find(held.begin(), held.end(), k) != held.end();
      source.push_back(is_held ? -1 : it->second + free++);
    }
  }
  return source;
}

// Covariances of photos and lenses, the points and the radius marginalised.
void FillCovariance(const RigState& state, const RigBundleOptions& options, ceres::Problem* problem, Blocks* b,
                    RigBundleResult* result) {
  if (options.centres) {
    problem->SetParameterBlockVariable(&b->log_radius);
    b->camera_blocks.push_back(&b->log_radius);
  }
  int columns = 0;
  std::map<const double*, int> column;
  std::vector<double*> free_blocks;
  for (double* c : b->camera_blocks) {
    if (problem->IsParameterBlockConstant(c)) continue;
    column[c] = columns;
    columns += problem->ParameterBlockTangentSize(c);
    free_blocks.push_back(c);
  }
  std::vector<std::vector<int>> groupings;
  for (const double cell : kCells_deg) {
    groupings.emplace_back();
    for (const RigPoint& p : state.points) {
      if (!p.observations.empty()) groupings.back().push_back(CellOf(p.direction, cell * kDegToRad));
    }
  }
  const MarginalCovariance marginal = Marginalise(problem, free_blocks, b->point_blocks, groupings);
  result->shared_errors = std::max(1.0, marginal.shared);
  Eigen::MatrixXd reduced = result->shared_errors * marginal.covariance;
  if (reduced.size() == 0) reduced = Eigen::MatrixXd::Identity(columns, columns) * kUnknown;
  if (options.centres) result->radius_log_sigma = std::sqrt(std::max(0.0, reduced(columns - 1, columns - 1)));
  const std::vector<int> source = SourceRows(state, *b, column, options.distortion);
  const Eigen::Index n = static_cast<Eigen::Index>(source.size());
  result->covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index r = 0; r < n; ++r) {
    for (Eigen::Index c = 0; c < n; ++c) {
      const int sr = source[static_cast<size_t>(r)], sc = source[static_cast<size_t>(c)];
      if (sr >= 0 && sc >= 0) result->covariance(r, c) = reduced(sr, sc);
    }
  }
  const Eigen::Index photos = n - kLensParameters * static_cast<Eigen::Index>(state.lenses.size());
  result->shape_covariance = result->covariance.topLeftCorner(photos, photos);
  if (!options.centres) return;
  Eigen::VectorXd with_radius = Eigen::VectorXd::Zero(photos);
  for (Eigen::Index r = 0; r < photos; ++r) {
    const int sr = source[static_cast<size_t>(r)];
    if (sr >= 0) with_radius(r) = reduced(sr, columns - 1);
  }
  result->shape_covariance -= with_radius * with_radius.transpose() / reduced(columns - 1, columns - 1);
}

}  // namespace

bool ProjectRigPoint(const std::vector<PairView>& views, const RigState& state, const RigPoint& point, int photo,
                     Eigen::Vector2d* pixel) {
  const RigPhoto& p = state.photos[static_cast<size_t>(photo)];
  const Eigen::Vector3d ray = p.cam_from_rig * (point.direction - point.inverse_distance * p.centre);
  return PixelOfRay(views[static_cast<size_t>(photo)], state.lenses[static_cast<size_t>(p.lens)], ray.normalized(),
                    pixel);
}

RigBundleResult SolveRig(const std::vector<PairView>& views, const RigBundleOptions& options, bool with_covariance,
                         const CancelToken& cancel, RigState* state) {
  cancel.ThrowIfCancelled();
  const bool huber = options.huber_px > 0;
  const double knee = (huber ? options.huber_px : options.tukey_px) / options.sigma_px;
  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(huber ? "huber" : "tukey", knee * knee);
  Blocks blocks(*state, options.radius_m);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  AddObservations(views, *state, options.sigma_px, loss.get(), &problem, &blocks);
  AddPoints(*state, options, &problem, &blocks);
  AddPhotos(*state, options, &problem, &blocks);
  AddLenses(*state, options, &problem, &blocks);
  const ceres::Solver::Summary summary = Minimise(options, &problem, &blocks);
  cancel.ThrowIfCancelled();

  RigBundleResult result;
  result.cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size());
  StoreBlocks(blocks, state);
  result.rms_px = RmsPx(views, *state);
  if (with_covariance) FillCovariance(*state, options, &problem, &blocks, &result);
  return result;
}

double SigmaOfDistance(const std::vector<PairView>& views, const RigState& state, const RigPoint& point) {
  constexpr double kStep = 1e-3;
  RigPoint near = point;
  near.inverse_distance += kStep;
  double information = 0;
  for (const RigObservation& o : point.observations) {
    Eigen::Vector2d at, moved;
    if (!ProjectRigPoint(views, state, point, o.photo, &at) || !ProjectRigPoint(views, state, near, o.photo, &moved))
      continue;
    information += (o.weight * (moved - at) / kStep).squaredNorm();
  }
  // Its direction takes part of it: half is what a pair keeps.
  return information > 0 ? std::sqrt(2 / information) : 1e3;
}

std::vector<RigPoint> BuildRigPoints(const std::vector<PairView>& views, const RigState& state,
                                     const std::vector<PhotoPair>& pairs) {
  // Sets of (photo, feature).
  std::vector<int> offset(views.size() + 1, 0);
  for (size_t v = 0; v < views.size(); ++v) offset[v + 1] = offset[v] + views[v].features->size();
  UnionFind chains(offset.back());
  for (const PhotoPair& pair : pairs) {
    for (const auto& [i, j] : pair.matches) {
      chains.Join(offset[static_cast<size_t>(pair.a)] + i, offset[static_cast<size_t>(pair.b)] + j);
    }
  }
  std::map<int, std::vector<std::pair<int, int>>> members;
  for (const PhotoPair& pair : pairs) {
    for (const auto& [i, j] : pair.matches) {
      members[chains.Root(offset[static_cast<size_t>(pair.a)] + i)].emplace_back(pair.a, i);
      members[chains.Root(offset[static_cast<size_t>(pair.b)] + j)].emplace_back(pair.b, j);
    }
  }
  std::vector<RigPoint> points;
  for (auto& [key, list] : members) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    RigPoint point;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    bool twice = false;
    for (size_t k = 0; k < list.size(); ++k) {
      const auto [photo, feature] = list[k];
      twice = twice || (k > 0 && list[k - 1].first == photo);
      const PairView& view = views[static_cast<size_t>(photo)];
      const RigPhoto& p = state.photos[static_cast<size_t>(photo)];
      if (!p.placed) continue;
      RigObservation o{photo, feature, view.features->points[static_cast<size_t>(feature)].cast<double>()};
      sum += p.cam_from_rig.conjugate() * RayOfPixel(view, state.lenses[static_cast<size_t>(p.lens)], o.pixel);
      point.observations.push_back(o);
    }
    // Two features of one photo cannot be the same point: one of the links is wrong, and nothing says which.
    if (twice || point.observations.size() < 2) continue;
    point.direction = sum.normalized();
    points.push_back(std::move(point));
  }
  return points;
}

double LookAround(const RigState& state) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const RigPhoto& p : state.photos) {
    if (!p.placed) continue;
    const Eigen::Vector3d right = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitX();
    spread += right * right.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread);
  return 2 * eigen.eigenvalues()(1) / std::max(1e-12, spread.trace());
}

Eigen::Vector3d UpFromPhotos(const RigState& state) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const RigPhoto& p : state.photos) {
    if (!p.placed) continue;
    const Eigen::Vector3d right = p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitX();
    m += right * right.transpose();
    up -= p.cam_from_rig.conjugate() * Eigen::Vector3d::UnitY();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(m);
  if (up.norm() < 1e-9) return eigen.eigenvectors().col(0);
  // Photos that look one way have right sides that are all alike: then the mean of their tops is all there is.
  if (LookAround(state) < kOneWay) {
    const Eigen::Vector3d right = eigen.eigenvectors().col(2);
    return (up - right * right.dot(up)).normalized();
  }
  const Eigen::Vector3d axis = eigen.eigenvectors().col(0);
  return axis.dot(up) < 0 ? Eigen::Vector3d(-axis) : axis;
}

void TurnRig(const Eigen::Quaterniond& new_from_old, RigState* state) {
  for (RigPhoto& p : state->photos) {
    p.cam_from_rig = (p.cam_from_rig * new_from_old.conjugate()).normalized();
    p.centre = new_from_old * p.centre;
  }
  for (RigPoint& p : state->points) p.direction = new_from_old * p.direction;
}

void MoveRigOrigin(const Eigen::Vector3d& centre, RigState* state) {
  for (RigPhoto& p : state->photos) p.centre -= centre;
  for (RigPoint& p : state->points) {
    const Eigen::Vector3d d = p.direction - p.inverse_distance * centre;
    p.inverse_distance /= d.norm();
    p.direction = d.normalized();
  }
}

}  // namespace trigpoint
