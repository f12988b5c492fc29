#include "localize/reconstruct/view_graph.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/loss.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "calib/geometry/path.h"
#include "localize/reconstruct/prepared_image.h"
#include "localize/reconstruct/track_table.h"

namespace trigpoint {
namespace {

// Images that odometry places nearest are considered, so that cost stays linear in the length of a run.
constexpr int kConsidered = 300;

// Where odometry places a camera, and what it sees.
struct Viewpoint {
  Rigid3d cam_from_odom;
  Eigen::Vector3d centre;
  std::vector<Eigen::Vector3d> rays;  // odom axes, a grid over the image
  double travelled = 0;               // path of the body up to the image, m
};

std::vector<Viewpoint> MakeViewpoints(const LocalizeInput& input) {
  constexpr int kColumns = 6, kRows = 4;
  const std::vector<double> travelled = PathLengths(input.odom_from_body);  // of the body: its cameras stand apart
  std::vector<Viewpoint> viewpoints;
  for (const FrameImage& image : input.images) {
    const BodyCamera& body_camera = input.cameras[static_cast<size_t>(image.camera)];
    Viewpoint s;
    s.cam_from_odom = body_camera.cam_from_body * input.odom_from_body[static_cast<size_t>(image.pose)].Inverse();
    s.centre = s.cam_from_odom.TargetOriginInSource();
    s.travelled = travelled[static_cast<size_t>(image.pose)];
    for (int r = 0; r < kRows; ++r) {
      for (int c = 0; c < kColumns; ++c) {
        const Eigen::Vector2d pixel((c + 0.5) / kColumns * body_camera.camera.width(),
                                    (r + 0.5) / kRows * body_camera.camera.height());
        if (const auto ray = body_camera.camera.Unproject(pixel)) {
          s.rays.push_back(s.cam_from_odom.rotation.conjugate() * *ray);
        }
      }
    }
    viewpoints.push_back(std::move(s));
  }
  return viewpoints;
}

// The share of a's picture that b may show, too, at the depth where that is the most: the scene's depth is unknown. A
// descriptor stands `viewpoint` rad of change in viewpoint and a factor of 2.5 in distance.
double Overlap(const Viewpoint& a, const Viewpoint& b, const Camera& camera_b, double viewpoint) {
  const double baseline = (a.centre - b.centre).norm();
  double most = 0;
  for (const double depth_ratio : {1.5, 4.0, 12.0}) {
    const double depth = std::max(1.0, depth_ratio * baseline);
    double sum = 0;
    for (const Eigen::Vector3d& ray : a.rays) {
      const Eigen::Vector3d y = a.centre + depth * ray, from_b = y - b.centre;
      const double distance = from_b.norm(), angle = AngleBetween(ray, from_b);
      if (angle > viewpoint || distance > 2.5 * depth || depth > 2.5 * distance) continue;
      const auto pixel = camera_b.Project(b.cam_from_odom * y);
      if (pixel && camera_b.Contains(*pixel)) sum += 1 - 0.5 * angle / viewpoint;
    }
    most = std::max(most, sum / static_cast<double>(std::max<size_t>(1, a.rays.size())));
  }
  return most;
}

// How many tracks each pair of images shares.
std::map<std::pair<int, int>, int> SharedTracks(const TrackSet& tracks) {
  std::map<std::pair<int, int>, int> shared;
  const std::vector<TrackObservation>& all = tracks.observations;
  for (size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    while (end < all.size() && all[end].track == all[begin].track) ++end;
    for (size_t i = begin; i < end; ++i) {
      for (size_t j = begin; j < i; ++j) ++shared[{all[j].image, all[i].image}];
    }
  }
  return shared;
}

// Reads images as pairs need them and keeps the last ones.
class ImageCache {
 public:
  ImageCache(const LocalizeInput& input, int threads, const CancelToken& cancel)
      : input_(input), threads_(threads), cancel_(cancel) {}
  // Makes sure that these are there, and lets go of those that were not used for the longest time.
  void Load(const std::set<int>& images) {
    std::vector<int> missing;
    for (int image : images) {
      if (images_.count(image) == 0) missing.push_back(image);
      used_[image] = ++clock_;
    }
    while (images_.size() + missing.size() > kKept && !images_.empty()) {
      auto oldest = images_.end();
      for (auto it = images_.begin(); it != images_.end(); ++it) {
        if (images.count(it->first) == 0 && (oldest == images_.end() || used_[it->first] < used_[oldest->first]))
          oldest = it;
      }
      if (oldest == images_.end()) break;
      images_.erase(oldest);
    }
    std::vector<std::unique_ptr<PreparedImage>> read(missing.size());
    ParallelFor(static_cast<int64_t>(missing.size()), threads_, cancel_, [&](int64_t i) {
      read[static_cast<size_t>(i)] = PrepareImage(input_, missing[static_cast<size_t>(i)], false);
    });
    for (size_t i = 0; i < missing.size(); ++i) images_[missing[i]] = std::move(read[i]);
  }
  const PreparedImage& at(int image) const { return *images_.at(image); }

 private:
  static constexpr size_t kKept = 96;
  const LocalizeInput& input_;
  int threads_;
  const CancelToken& cancel_;
  std::map<int, std::unique_ptr<PreparedImage>> images_;
  std::map<int, int64_t> used_;
  int64_t clock_ = 0;
};

Rigid3d CamFromOdom(const LocalizeInput& input, const std::vector<Rigid3d>& odom_from_body, int image) {
  const FrameImage& f = input.images[static_cast<size_t>(image)];
  return input.cameras[static_cast<size_t>(f.camera)].cam_from_body *
         odom_from_body[static_cast<size_t>(f.pose)].Inverse();
}

const Camera& CameraOf(const LocalizeInput& input, int image) {
  return input.cameras[static_cast<size_t>(input.images[static_cast<size_t>(image)].camera)].camera;
}

// Diagonal of the field of view, rad: over what a wrong match scatters.
double Span(const Camera& camera) {
  const auto first = camera.Unproject({0, 0}), last = camera.Unproject({camera.width() - 1.0, camera.height() - 1.0});
  return first && last ? AngleBetween(*first, *last) : 1.0;
}

std::vector<Eigen::Vector3d> RaysOf(const PreparedImage& image, const Matches& matches, bool first) {
  std::vector<Eigen::Vector3d> out;
  out.reserve(matches.size());
  for (const auto& [i, j] : matches) out.push_back(image.rays[static_cast<size_t>(first ? i : j)]);
  return out;
}

double InlierAngle(const LocalizeInput& input, const ImagePair& pair, const ViewGraphOptions& options) {
  return options.inlier_px / std::min(CameraOf(input, pair.a).MeanFocal(), CameraOf(input, pair.b).MeanFocal());
}

BundleProblem Chain(const LocalizeInput& input, const std::vector<PoseFactor>& odometry, const OdometryNoise& noise) {
  BundleProblem p;
  for (const BodyCamera& c : input.cameras) p.views.push_back(c.cam_from_body);
  for (const Rigid3d& pose : input.odom_from_body) p.poses.push_back(pose.Inverse());
  p.pose_constant.assign(p.poses.size(), false);
  p.pose_constant[0] = true;
  p.factors = odometry;
  for (PoseFactor& f : p.factors) {
    f.sqrt_info.leftCols<3>() /= noise.rotation;
    f.sqrt_info.rightCols<3>() /= noise.translation;
  }
  return p;
}

// What odometry predicts of pairs, and how well.
class Prediction {
 public:
  Prediction(const LocalizeInput& input, const std::vector<PoseFactor>& odometry, const OdometryNoise& noise,
             const ViewGraphOptions& options, int threads, const CancelToken& cancel)
      : input_(input),
        options_(options),
        chain_(Chain(input, odometry, noise)),
        covariance_(chain_, threads, cancel),
        travelled_(PathLengths(input.odom_from_body)) {}

  // Covariance of [rotation (rad, left), direction of translation (unit vector)] of b from a.
  Matrix6d Covariance(const ImagePair& pair) const {
    const PoseFactor f = Predicted(pair);
    FactorTerms t;
    EvaluateFactor(chain_, f, &t);
    Eigen::Matrix<double, 6, 12> j;
    j << t.ja, t.jb;
    Matrix6d c = j * covariance_.Joint({f.a, f.b}) * j.transpose();
    // Odometry drifts in ways that no noise of a step describes.
    const double path = std::abs(travelled_[static_cast<size_t>(f.a)] - travelled_[static_cast<size_t>(f.b)]);
    const double turned = options_.drift_deg_m * kDegToRad * path;
    const double moved = (options_.drift_part + 0.5 * turned) * path / std::max(length_of(pair), 1e-6);
    const Eigen::Vector3d u = f.measured.translation;
    c.topLeftCorner<3, 3>().diagonal().array() += turned * turned;
    c.bottomRightCorner<3, 3>() += std::min(moved * moved, 10.0) * (Eigen::Matrix3d::Identity() - u * u.transpose());
    return c;
  }

  // Squared Mahalanobis distance of an edge's factor from it, 5 dof.
  double SquaredMahalanobis(const ImagePair& pair, const PoseFactor& edge) const {
    FactorTerms t;
    EvaluateFactor(chain_, edge, &t);  // whitened by the edge's own covariance
    const Matrix6d s = Matrix6d::Identity() + edge.sqrt_info * Covariance(pair) * edge.sqrt_info.transpose();
    return t.r.dot(s.ldlt().solve(t.r));
  }

  // The same of its rotation, 3 dof, and of its direction, 2 dof, each by itself.
  Eigen::Vector2d SquaredByPart(const ImagePair& pair, const PoseFactor& edge) const {
    PoseFactor plain = edge;
    plain.sqrt_info.setIdentity();
    FactorTerms t;
    EvaluateFactor(chain_, plain, &t);
    const Matrix6d information = edge.sqrt_info.transpose() * edge.sqrt_info;
    const Matrix6d s = Covariance(pair) + Matrix6d(information.ldlt().solve(Matrix6d::Identity()));
    const Eigen::Matrix<double, 2, 3> across = TangentBasis(edge.measured.translation);
    const Eigen::Vector3d turn = t.r.head<3>();
    const Eigen::Vector2d aside = across * t.r.tail<3>();
    const Eigen::Matrix2d of_aside = across * s.bottomRightCorner<3, 3>() * across.transpose();
    return {turn.dot(s.topLeftCorner<3, 3>().ldlt().solve(turn)), aside.dot(of_aside.ldlt().solve(aside))};
  }

 private:
  double length_of(const ImagePair& pair) const { return Relative(pair).translation.norm(); }
  Rigid3d Relative(const ImagePair& pair) const {
    return CamFromOdom(input_, input_.odom_from_body, pair.b) *
           CamFromOdom(input_, input_.odom_from_body, pair.a).Inverse();
  }
  PoseFactor Predicted(const ImagePair& pair) const {
    const FrameImage &a = input_.images[static_cast<size_t>(pair.a)], &b = input_.images[static_cast<size_t>(pair.b)];
    PoseFactor f;
    f.kind = PoseFactor::Kind::kTwoView;
    f.a = b.pose, f.b = a.pose;
    f.view_a = b.camera, f.view_b = a.camera;
    f.measured = Relative(pair);
    if (f.measured.translation.norm() > 1e-9) f.measured.translation.normalize();
    return f;
  }

  const LocalizeInput& input_;
  const ViewGraphOptions& options_;
  BundleProblem chain_;
  BundleCovariance covariance_;
  std::vector<double> travelled_;  // path up to each body pose, m
};

// The covariance with two components of direction, along the rows of TangentBasis.
Eigen::Matrix<double, 5, 5> InTangent(const Matrix6d& covariance, const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 5, 6> tangent = Eigen::Matrix<double, 5, 6>::Zero();
  tangent.topLeftCorner<3, 3>().setIdentity();
  tangent.bottomRightCorner<2, 3>() = TangentBasis(direction);
  return tangent * covariance * tangent.transpose() + 1e-8 * Eigen::Matrix<double, 5, 5>::Identity();
}

// The two-view geometry of a pair, from everything compared with everything, and odometry.
ViewEdge VerifyPair(const LocalizeInput& input, const ImagePair& pair, const PreparedImage& a, const PreparedImage& b,
                    const Matrix6d& predicted, const ViewGraphOptions& options, uint64_t seed) {
  ViewEdge edge;
  edge.pair = pair;
  edge.candidates = MatchMutual(a.descriptors, b.descriptors, options.ratio, options.max_distance);
  const auto camera = [&](int image) { return input.images[static_cast<size_t>(image)].camera; };
  if (camera(pair.a) == camera(pair.b)) {
    const double pixel_rad = 1 / CameraOf(input, pair.a).MeanFocal();
    edge.candidates = WithoutCarrier(std::move(edge.candidates), a.rays, b.rays, pixel_rad);
  }
  const Rigid3d prior =
      CamFromOdom(input, input.odom_from_body, pair.b) * CamFromOdom(input, input.odom_from_body, pair.a).Inverse();
  WideBaselineOptions two;
  two.inlier_rad = InlierAngle(input, pair, options);
  two.span_rad = Span(CameraOf(input, pair.b));
  two.prior_covariance =
      InTangent(predicted, prior.translation.norm() > 1e-9 ? prior.translation.normalized() : Eigen::Vector3d::UnitX());
  two.seed = seed;
  edge.geometry = VerifyWideBaseline(RaysOf(a, edge.candidates, true), RaysOf(b, edge.candidates, false), prior, two);
  if (!edge.geometry.verified) edge.candidates = {};
  return edge;
}

// The candidates that `which` indexes become matches of the edge.
void AddMatches(const PreparedImage& a, const PreparedImage& b, const std::vector<int>& which, ViewEdge* edge) {
  for (int k : which) {
    const auto [i, j] = edge->candidates[static_cast<size_t>(k)];
    edge->matches.push_back({{0, edge->pair.a, i, a.features.points[static_cast<size_t>(i)]},
                             {0, edge->pair.b, j, b.features.points[static_cast<size_t>(j)]}});
  }
}

// The matches of an edge that fit the relative pose which all pairs together have: what fits the geometry of this pair
// alone, as repeated structure does, is not among them. Matches are those that are distinctive in the whole picture:
// along an epipolar curve the wrong one of two windows would do.
void KeepAgreeingMatches(const LocalizeInput& input, const PreparedImage& a, const PreparedImage& b,
                         const Rigid3d& b_from_a, const ViewGraphOptions& options, ViewEdge* edge) {
  TwoViewOptions two;
  two.inlier_rad = InlierAngle(input, edge->pair, options);
  // The bundle adjustment has yet to refine the poses.
  two.sigma_rotation_rad = 0.15 * kDegToRad;
  two.sigma_direction_rad = 0.5 * kDegToRad;
  two.min_prior_inliers = 0;
  const std::vector<Eigen::Vector3d> rays_a = RaysOf(a, edge->candidates, true);
  const std::vector<Eigen::Vector3d> rays_b = RaysOf(b, edge->candidates, false);
  const Rigid3d refined = VerifyTwoView(rays_a, rays_b, b_from_a, two).b_from_a;
  const std::vector<int> agreeing = EpipolarInliers(rays_a, rays_b, refined, two.inlier_rad);
  if (static_cast<int>(agreeing.size()) >= kLeastMatches) AddMatches(a, b, agreeing, edge);
  edge->candidates = {};
}

// The factor between two body poses that an edge gives. Calibration errors are common to its matches: no edge is
// known better than `kLeast...`.
PoseFactor EdgeFactor(const LocalizeInput& input, const ViewEdge& edge) {
  constexpr double kLeastRotation = 0.1 * kDegToRad, kLeastDirection = 0.3 * kDegToRad;
  const FrameImage &a = input.images[static_cast<size_t>(edge.pair.a)],
                   &b = input.images[static_cast<size_t>(edge.pair.b)];
  PoseFactor f;
  f.kind = PoseFactor::Kind::kTwoView;
  f.a = b.pose, f.b = a.pose;
  f.view_a = b.camera, f.view_b = a.camera;
  f.measured = edge.geometry.b_from_a;
  f.measured.translation.normalize();
  Eigen::Matrix<double, 5, 5> covariance =
      edge.geometry.information.ldlt().solve(Eigen::Matrix<double, 5, 5>::Identity());
  if (!covariance.allFinite()) covariance.setIdentity();
  covariance.diagonal().head<3>().array() += kLeastRotation * kLeastRotation;
  covariance.diagonal().tail<2>().array() += kLeastDirection * kLeastDirection;
  if (edge.geometry.rotation_only) covariance.diagonal().tail<2>().array() += 100;
  const Eigen::Matrix<double, 5, 5> root =
      Eigen::Matrix<double, 5, 5>(covariance.ldlt().solve(Eigen::Matrix<double, 5, 5>::Identity())).llt().matrixU();
  Eigen::Matrix<double, 5, 6> tangent = Eigen::Matrix<double, 5, 6>::Zero();
  tangent.topLeftCorner<3, 3>().setIdentity();
  tangent.bottomRightCorner<2, 3>() = TangentBasis(f.measured.translation);
  f.sqrt_info.setZero();
  f.sqrt_info.topRows<5>() = root * tangent;
  // Along the direction itself: nothing to first order, but a direction turned round must not look right.
  f.sqrt_info.bottomRightCorner<1, 3>() = root.diagonal().tail<2>().minCoeff() * f.measured.translation.transpose();
  return f;
}

// Bends odometry to the edges: wide kernels first, since the poses of odometry are many sigmas of an edge off. Returns
// the squared error of each edge at the end.
std::vector<double> SolvePoseGraph(const std::vector<PoseFactor>& edges, double gate_chi2, BundleProblem* p,
                                   int threads, const CancelToken& cancel) {
  const size_t odometry = p->factors.size();
  ProgressSink silent;
  BundleOptions bundle;
  bundle.threads = threads;
  bundle.max_iterations = 10;
  bundle.relative_cost_tolerance = 1e-3;
  for (const double widening : {30.0, 10.0, 3.0, 1.0}) {
    p->factors.resize(odometry);
    for (PoseFactor f : edges) {
      f.sqrt_info /= widening;
      f.loss = MakeLoss("dcs", gate_chi2);
      p->factors.push_back(std::move(f));
    }
    SolveBundle(*p, bundle, silent, cancel);
  }
  p->factors.resize(odometry);
  std::vector<double> errors;
  for (const PoseFactor& f : edges) errors.push_back(SquaredError(*p, f));
  return errors;
}

constexpr size_t kLeastErrors = 8;  // from which a variance is estimated

// Two standard deviations of the first of n, as a part of it.
double Chance(size_t n) { return 2 * 0.84 / std::sqrt(static_cast<double>(n)); }

// How much smaller the variance of odometry is than stated, by the pairs of images that agree with it: the median of
// their squared errors against that of a chi-square. Never larger: pairs may be wrong together.
double OdometryVarianceFactor(const std::vector<double>& errors, double gate_chi2) {
  constexpr double kLeast = 0.01;
  std::vector<double> agreeing;
  for (double e : errors) {
    if (e < gate_chi2) agreeing.push_back(e);
  }
  if (agreeing.size() < kLeastErrors) return 1;
  const double chance = Chance(agreeing.size());
  const double variance = std::max(kLeast, Median(std::move(agreeing)) / kMediansOfChi2[5]);
  return variance < 1 - chance ? variance : 1;
}

// Keeps the edges that agree with odometry and with each other.
void RejectContradictions(const LocalizeInput& input, const std::vector<PoseFactor>& odometry,
                          const Prediction& prediction, double gate_chi2, ViewGraph* graph, int threads,
                          const CancelToken& cancel) {
  std::vector<ViewEdge> agreeing, kept;
  std::vector<PoseFactor> factors;
  for (ViewEdge& e : graph->edges) {
    const PoseFactor f = EdgeFactor(input, e);
    if (prediction.SquaredMahalanobis(e.pair, f) > gate_chi2) {
      graph->rejected.push_back(e.pair);
    } else {
      agreeing.push_back(std::move(e));
      factors.push_back(f);
    }
  }
  BundleProblem p = Chain(input, odometry, graph->odometry_noise);
  const std::vector<double> errors = SolvePoseGraph(factors, gate_chi2, &p, threads, cancel);
  for (size_t i = 0; i < agreeing.size(); ++i) {
    // Poses are not exact yet: what the bundle adjustment may still correct is kept.
    if (errors[i] > gate_chi2) {
      graph->rejected.push_back(agreeing[i].pair);
    } else {
      kept.push_back(std::move(agreeing[i]));
    }
  }
  graph->edges = std::move(kept);
  graph->odom_from_body.clear();
  for (const Rigid3d& pose : p.poses) graph->odom_from_body.push_back(pose.Inverse());
}

// How many moments of the run lie between two images.
class MomentsBetween {
 public:
  explicit MomentsBetween(const LocalizeInput& input) : input_(input), moments_(MomentsOfPoses(input)) {}
  int operator()(const ImagePair& pair) const { return std::abs(MomentOf(pair.b) - MomentOf(pair.a)); }
  // From one moment of the run to the next, in all.
  size_t steps() const { return moments_.empty() ? 0 : static_cast<size_t>(moments_.back()); }

 private:
  int MomentOf(int image) const {
    return moments_[static_cast<size_t>(input_.images[static_cast<size_t>(image)].pose)];
  }
  const LocalizeInput& input_;
  std::vector<int> moments_;
};

// The noise of odometry with which its errors against edges are as large as expected, in the median: one factor for
// both parts, or one for each.
OdometryNoise MatchingNoise(const LocalizeInput& input, const std::vector<PoseFactor>& odometry,
                            const std::vector<ViewEdge>& edges, bool by_part, const ViewGraphOptions& options,
                            int threads, const CancelToken& cancel) {
  constexpr int kIterations = 5;  // the edges' own noise has a part in the errors: not linear
  constexpr double kLeast = 0.1;
  OdometryNoise noise;
  for (int k = 0; k < kIterations; ++k) {
    const Prediction prediction(input, odometry, noise, options, threads, cancel);
    std::vector<double> all, turns, aside;
    for (const ViewEdge& e : edges) {
      const PoseFactor f = EdgeFactor(input, e);
      all.push_back(prediction.SquaredMahalanobis(e.pair, f));
      const Eigen::Vector2d parts = prediction.SquaredByPart(e.pair, f);
      turns.push_back(parts[0]), aside.push_back(parts[1]);
    }
    const double both = SigmaRatio(std::move(all), 5);
    noise.rotation *= by_part ? SigmaRatio(std::move(turns), 3) : both;
    noise.translation *= by_part ? SigmaRatio(std::move(aside), 2) : both;
    noise.rotation = std::max(kLeast, noise.rotation), noise.translation = std::max(kLeast, noise.translation);
  }
  return noise;
}

// By how much odometry is noisier than stated, by what neighbouring images see of each other without it. Images may be
// wrong together: those count whose triangles close, and the median decides, as few bad steps do not make the odometry
// bad. A part without excess has the factor 1. Nothing if all excess may be chance, or too few images can be compared.
std::optional<OdometryNoise> NoiseByImages(const LocalizeInput& input, const std::vector<ImagePair>& pairs,
                                           const std::vector<PoseFactor>& odometry, const ViewGraphOptions& options,
                                           int threads, uint64_t seed, const CancelToken& cancel) {
  const MomentsBetween apart(input);
  const auto is_neighbour = [&](const ImagePair& pair) { return apart(pair) == 1; };
  // Long video has few pairs of neighbours left, since tracks connect them: its other pairs are not verified for this.
  const auto neighbours = static_cast<size_t>(std::count_if(pairs.begin(), pairs.end(), is_neighbour));
  if (neighbours < std::min(kLeastErrors, apart.steps())) return std::nullopt;
  ProgressSink silent;
  std::vector<ViewEdge> edges = VerifyPairs(input, pairs, options, threads, seed, silent, cancel);
  const std::vector<Triangles> triangles = CountTriangles(edges);
  std::vector<ViewEdge> confirmed;
  size_t confirmed_neighbours = 0;
  for (size_t i = 0; i < edges.size(); ++i) {
    const Triangles& t = triangles[i];
    if (t.closed == 0 || 2 * t.closed < t.all) continue;
    confirmed_neighbours += is_neighbour(edges[i].pair) ? 1 : 0;
    confirmed.push_back(std::move(edges[i]));
  }
  // A few photos have few neighbours: their other pairs span several steps, with the same noise.
  if (confirmed_neighbours >= kLeastErrors) {
    std::erase_if(confirmed, [&](const ViewEdge& e) { return !is_neighbour(e.pair); });
  }
  if (confirmed.size() < kLeastErrors) return std::nullopt;
  const size_t independent = std::min(confirmed.size(), apart.steps());
  const OdometryNoise both = MatchingNoise(input, odometry, confirmed, false, options, threads, cancel);
  if (both.rotation * both.rotation < 1 + Chance(independent)) return std::nullopt;
  OdometryNoise parts = MatchingNoise(input, odometry, confirmed, true, options, threads, cancel);
  parts.rotation = std::max(1.0, parts.rotation), parts.translation = std::max(1.0, parts.translation);
  return parts;
}

// Calls body(i, image a, image b) for every pair, in parallel, with their features at hand.
void ForEachPair(const LocalizeInput& input, const std::vector<ImagePair>& pairs, int threads,
                 const CancelToken& cancel,
                 const std::function<void(size_t, const PreparedImage&, const PreparedImage&)>& body) {
  ImageCache cache(input, threads, cancel);
  constexpr size_t kBatch = 32;
  for (size_t begin = 0; begin < pairs.size(); begin += kBatch) {
    const size_t end = std::min(pairs.size(), begin + kBatch);
    std::set<int> images;
    for (size_t i = begin; i < end; ++i) images.insert({pairs[i].a, pairs[i].b});
    cache.Load(images);
    ParallelFor(static_cast<int64_t>(end - begin), threads, cancel, [&](int64_t i) {
      const size_t k = begin + static_cast<size_t>(i);
      body(k, cache.at(pairs[k].a), cache.at(pairs[k].b));
    });
  }
}

// Of images of different moments.
std::vector<ImagePair> AllPairs(int images, const MomentsBetween& apart) {
  std::vector<ImagePair> pairs;
  for (int a = 0; a < images; ++a) {
    for (int b = a + 1; b < images; ++b) {
      if (apart({a, b}) > 0) pairs.push_back({a, b});
    }
  }
  return pairs;
}

}  // namespace

std::vector<ImagePair> CandidatePairs(const LocalizeInput& input, const TrackSet& tracks,
                                      const ViewGraphOptions& options) {
  constexpr double kLeastOverlap = 0.1;
  const int n = static_cast<int>(input.images.size());
  const MomentsBetween apart(input);
  if (n <= options.exhaustive) return AllPairs(n, apart);
  const std::vector<Viewpoint> viewpoints = MakeViewpoints(input);
  const std::map<std::pair<int, int>, int> shared = SharedTracks(tracks);
  const double viewpoint = options.viewpoint_deg * kDegToRad;
  std::set<std::pair<int, int>> chosen;
  std::map<int, double> last_asked;  // of each camera
  for (int i = 0; i < n; ++i) {
    const Viewpoint& own = viewpoints[static_cast<size_t>(i)];
    const int camera = input.images[static_cast<size_t>(i)].camera;
    const auto [last, first] = last_asked.try_emplace(camera, own.travelled);
    if (!first && own.travelled - last->second < options.spacing_m && i + 1 < n) continue;
    last->second = own.travelled;
    std::vector<std::pair<double, int>> near;
    for (int j = 0; j < n; ++j) {
      if (apart({i, j}) == 0) continue;
      near.emplace_back((viewpoints[static_cast<size_t>(j)].centre - own.centre).norm(), j);
    }
    if (near.size() > kConsidered) {
      std::nth_element(near.begin(), near.begin() + kConsidered, near.end());
      near.resize(kConsidered);
    }
    std::vector<std::pair<double, int>> scored;
    for (const auto& [distance, j] : near) {
      const Viewpoint& other = viewpoints[static_cast<size_t>(j)];
      const double overlap = std::min(Overlap(own, other, CameraOf(input, j), viewpoint),
                                      Overlap(other, own, CameraOf(input, i), viewpoint));
      if (overlap > kLeastOverlap) scored.emplace_back(-overlap, j);
    }
    std::sort(scored.begin(), scored.end());
    std::vector<int> partners;
    for (const auto& [score, j] : scored) {
      if (static_cast<int>(partners.size()) >= options.neighbours) break;
      const auto close = [&, j = j](int k) {
        const Viewpoint &of_j = viewpoints[static_cast<size_t>(j)], &of_k = viewpoints[static_cast<size_t>(k)];
        return input.images[static_cast<size_t>(j)].camera == input.images[static_cast<size_t>(k)].camera &&
               std::abs(of_j.travelled - of_k.travelled) < 0.5 * options.spacing_m;
      };
      if (std::any_of(partners.begin(), partners.end(), close)) continue;
      partners.push_back(j);
    }
    for (int j : partners) {
      const std::pair<int, int> pair = std::minmax(i, j);
      const auto common = shared.find(pair);
      if (common == shared.end() || common->second < options.connected) chosen.insert(pair);
    }
  }
  std::vector<ImagePair> pairs;
  for (const auto& [a, b] : chosen) pairs.push_back({a, b});
  return pairs;
}

ViewGraph BuildViewGraph(const LocalizeInput& input, const std::vector<ImagePair>& pairs,
                         const std::vector<PoseFactor>& odometry, const ViewGraphOptions& options, int threads,
                         uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
  ViewGraph graph;
  graph.tried = static_cast<int>(pairs.size());
  graph.odom_from_body = input.odom_from_body;
  progress.Begin("pairs of images", graph.tried);
  // Neighbours first: they show the noise of odometry, from which the other pairs are predicted.
  std::vector<ImagePair> neighbours = pairs;
  std::erase_if(neighbours, [apart = MomentsBetween(input)](const ImagePair& pair) { return apart(pair) != 1; });
  const auto verify = [&](const std::vector<ImagePair>& some, const Prediction& prediction) {
    std::vector<ViewEdge> tried(some.size());
    ForEachPair(input, some, threads, cancel, [&](size_t i, const PreparedImage& a, const PreparedImage& b) {
      tried[i] = VerifyPair(input, some[i], a, b, prediction.Covariance(some[i]), options,
                            seed + 1000003 * static_cast<uint64_t>(i));
    });
    std::erase_if(tried, [](const ViewEdge& e) { return !e.geometry.verified; });
    return tried;
  };
  {
    const Prediction stated(input, odometry, {}, options, threads, cancel);
    std::vector<double> errors;
    for (const ViewEdge& e : verify(neighbours, stated))
      errors.push_back(stated.SquaredMahalanobis(e.pair, EdgeFactor(input, e)));
    const double agreeing = std::sqrt(OdometryVarianceFactor(errors, options.gate_chi2));
    graph.odometry_noise = {agreeing, agreeing};
    if (const auto by_images = NoiseByImages(input, pairs, odometry, options, threads, seed, cancel)) {
      graph.odometry_noise = *by_images;
      char text[240];
      std::snprintf(text, sizeof text,
                    "odometry's rotations are about %.1f times and its translations %.1f times as noisy as assumed, "
                    "judging by pairs of neighbouring images that other pairs confirm; its weight is reduced",
                    by_images->rotation, by_images->translation);
      progress.Log(LogLevel::kWarning, text);
    }
  }
  const Prediction prediction(input, odometry, graph.odometry_noise, options, threads, cancel);
  graph.edges = verify(pairs, prediction);
  graph.verified = static_cast<int>(graph.edges.size());
  if (graph.edges.empty()) return graph;
  RejectContradictions(input, odometry, prediction, options.gate_chi2, &graph, threads, cancel);
  std::vector<ImagePair> kept;
  for (const ViewEdge& e : graph.edges) kept.push_back(e.pair);
  ForEachPair(input, kept, threads, cancel, [&](size_t i, const PreparedImage& a, const PreparedImage& b) {
    const Rigid3d b_from_a = CamFromOdom(input, graph.odom_from_body, kept[i].b) *
                             CamFromOdom(input, graph.odom_from_body, kept[i].a).Inverse();
    KeepAgreeingMatches(input, a, b, b_from_a, options, &graph.edges[i]);
  });
  std::erase_if(graph.edges, [&](const ViewEdge& e) {
    if (e.matches.empty()) graph.rejected.push_back(e.pair);
    return e.matches.empty();
  });
  // The surest first: a conflict keeps what is there.
  std::stable_sort(graph.edges.begin(), graph.edges.end(), [](const ViewEdge& x, const ViewEdge& y) {
    return x.geometry.log10_false_alarms < y.geometry.log10_false_alarms;
  });
  return graph;
}

std::vector<ViewEdge> VerifyPairs(const LocalizeInput& input, const std::vector<ImagePair>& pairs,
                                  const ViewGraphOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                                  const CancelToken& cancel) {
  const Matrix6d nothing = 1e4 * Matrix6d::Identity();
  std::vector<ViewEdge> edges(pairs.size());
  progress.Begin("pairs of images", static_cast<int64_t>(pairs.size()));
  ForEachPair(input, pairs, threads, cancel, [&](size_t i, const PreparedImage& a, const PreparedImage& b) {
    ViewEdge& e = edges[i];
    e = VerifyPair(input, pairs[i], a, b, nothing, options, seed + 1000003 * static_cast<uint64_t>(i));
    if (e.geometry.verified) AddMatches(a, b, e.geometry.inliers, &e);
    e.candidates = {};
    progress.Advance(1);
  });
  std::erase_if(edges, [](const ViewEdge& e) { return !e.geometry.verified; });
  return edges;
}

std::vector<Triangles> CountTriangles(const std::vector<ViewEdge>& edges) {
  constexpr double kClosed = 3 * kDegToRad;
  std::map<std::pair<int, int>, const ViewEdge*> of_pair;
  std::map<int, std::set<int>> neighbours;
  for (const ViewEdge& e : edges) {
    of_pair[{e.pair.a, e.pair.b}] = &e;
    neighbours[e.pair.a].insert(e.pair.b);
    neighbours[e.pair.b].insert(e.pair.a);
  }
  const auto rotation = [&](int a, int b) {  // b from a
    const auto forth = of_pair.find({a, b});
    return forth != of_pair.end() ? forth->second->geometry.b_from_a.rotation
                                  : of_pair.at({b, a})->geometry.b_from_a.rotation.conjugate();
  };
  std::vector<Triangles> out;
  for (const ViewEdge& e : edges) {
    Triangles t;
    for (int c : neighbours[e.pair.a]) {
      if (neighbours[e.pair.b].count(c) == 0) continue;
      const Eigen::Quaterniond loop = rotation(c, e.pair.a) * rotation(e.pair.b, c) * rotation(e.pair.a, e.pair.b);
      t.closed += loop.angularDistance(Eigen::Quaterniond::Identity()) < kClosed ? 1 : 0;
      ++t.all;
    }
    out.push_back(t);
  }
  return out;
}

TrackSet JoinTracks(const LocalizeInput& input, const ViewGraph& graph, const TrackSet& tracks,
                    const ViewGraphOptions& options, int min_length) {
  TrackTable table(tracks);
  for (const ViewEdge& e : graph.edges) {
    for (const auto& [a, b] : e.matches) table.Join(a, b);
  }
  const auto direction = [&](const TrackObservation& o) -> Eigen::Vector3d {
    return CamFromOdom(input, graph.odom_from_body, o.image).rotation.conjugate() *
           *CameraOf(input, o.image).Unproject(o.pixel.cast<double>());
  };
  TrackSet joined;
  joined.verified_matches = tracks.verified_matches;
  joined.pairs = tracks.pairs;
  joined.odometry_contradicted = tracks.odometry_contradicted;
  const auto keep = [&](const TrackTable::Track& track) {
    if (static_cast<int>(track.size()) >= min_length) return true;
    return track.size() == 2 &&
           AngleBetween(direction(track[0]), direction(track[1])) > options.min_parallax_deg * kDegToRad;
  };
  table.Close(std::numeric_limits<int>::max(), keep, &joined);
  return joined;
}

}  // namespace trigpoint
