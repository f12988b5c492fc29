#include "localize/reconstruct/structure_from_motion.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "calib/estimation/ransac.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/minimal_solvers.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/reconstruct/track_table.h"
#include "localize/references/retrieval.h"

namespace trigpoint {
namespace {

using Poses = std::vector<std::optional<Rigid3d>>;  // body_from_odom

constexpr double kLossChi2 = 4 * 5.99;  // wide: poses that were just added are some pixels off

const FrameImage& ImageAt(const LocalizeInput& input, int image) { return input.images[static_cast<size_t>(image)]; }

const BodyCamera& CameraOf(const LocalizeInput& input, int image) {
  return input.cameras[static_cast<size_t>(ImageAt(input, image).camera)];
}

// Which images look alike, by visual words of the run itself.
void AddAlike(const LocalizeInput& input, const StructureFromMotionOptions& options, int threads, uint64_t seed,
              const CancelToken& cancel, std::set<std::pair<int, int>>* pairs) {
  const int n = static_cast<int>(input.images.size());
  const auto descriptors = [&](int i) { return DescriptorBlock(input.image_features(i).descriptors); };
  const RetrievalIndex index = IndexInMemory(n, descriptors, {}, seed, threads, cancel);
  std::vector<std::vector<RetrievalHit>> hits(static_cast<size_t>(n));
  ParallelFor(n, threads, cancel, [&](int64_t i) {
    hits[static_cast<size_t>(i)] = index.Query(descriptors(static_cast<int>(i)), options.retrieved + 1);
  });
  for (int i = 0; i < n; ++i) {
    for (const RetrievalHit& hit : hits[static_cast<size_t>(i)]) {
      if (hit.document != i) pairs->insert(std::minmax(i, hit.document));
    }
  }
}

std::vector<ImagePair> PairsByAppearance(const LocalizeInput& input, const StructureFromMotionOptions& options,
                                         int threads, uint64_t seed, const CancelToken& cancel) {
  const int n = static_cast<int>(input.images.size());
  std::set<std::pair<int, int>> pairs;
  const bool exhaustive = n <= options.exhaustive;
  for (int i = 0; i < n && exhaustive; ++i) {
    for (int j = i + 1; j < n; ++j) pairs.insert({i, j});
  }
  // Of the same camera: the next images of a rig are of the same moment.
  const std::vector<int> next = NextOfCamera(input);
  for (int i = 0; i < n && !exhaustive; ++i) {
    int j = i;
    for (int k = 0; k < options.neighbours && (j = next[static_cast<size_t>(j)]) >= 0; ++k) pairs.insert({i, j});
  }
  if (!exhaustive) AddAlike(input, options, threads, seed, cancel, &pairs);
  std::vector<ImagePair> out;
  for (const auto& [a, b] : pairs) {
    if (ImageAt(input, a).pose != ImageAt(input, b).pose) out.push_back({a, b});
  }
  return out;
}

// Pairs of what only looks alike (windows, facades) seldom close a triangle: an edge goes if most of its do not.
void RejectOpenTriangles(std::vector<ViewEdge>* edges) {
  const std::vector<Triangles> of_edges = CountTriangles(*edges);
  std::vector<ViewEdge> kept;
  for (size_t i = 0; i < edges->size(); ++i) {
    if (2 * of_edges[i].closed >= of_edges[i].all) kept.push_back(std::move((*edges)[i]));
  }
  *edges = std::move(kept);
}

// The tracks of all edges, the longest of each image.
TrackSet LongTracks(const std::vector<ViewEdge>& edges, int per_image) {
  TrackTable table;
  for (const ViewEdge& e : edges) {
    for (const auto& [a, b] : e.matches) table.Join(a, b);
  }
  TrackSet all;
  table.Close(
      std::numeric_limits<int>::max(), [](const TrackTable::Track&) { return true; }, &all);
  std::vector<size_t> begin(static_cast<size_t>(all.tracks) + 1, 0);
  for (const TrackObservation& o : all.observations) ++begin[static_cast<size_t>(o.track) + 1];
  for (size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  std::vector<size_t> order(static_cast<size_t>(all.tracks));
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t x, size_t y) { return begin[x + 1] - begin[x] > begin[y + 1] - begin[y]; });
  std::map<int, int> used;
  TrackSet kept;
  for (size_t t : order) {
    const auto first = all.observations.begin() + static_cast<std::ptrdiff_t>(begin[t]),
               last = all.observations.begin() + static_cast<std::ptrdiff_t>(begin[t + 1]);
    if (std::none_of(first, last, [&](const TrackObservation& o) { return used[o.image] < per_image; })) continue;
    for (auto o = first; o != last; ++o) {
      ++used[o->image];
      kept.observations.push_back(*o);
      kept.observations.back().track = kept.tracks;
    }
    ++kept.tracks;
  }
  return kept;
}

// What is known while images are added.
struct Model {
  Poses body_from_odom;
  std::vector<Eigen::Vector3d> points;  // of each track; NaN: not known
  std::pair<int, int> first;            // the poses it began with
  int placed = 0;
};

ReconstructOptions Thresholds() {
  ReconstructOptions o;
  o.sigma_px = 1;
  o.min_parallax_deg = 1;
  o.max_depth_m = 1e9;  // nothing has a length yet
  return o;
}

// Points and poses of what is placed. Gauge: the pose it began with, and softly the length of the first step.
void Adjust(const LocalizeInput& input, const TrackSet& tracks, bool poses_too, int threads, ProgressSink& progress,
            const CancelToken& cancel, Model* model) {
  const ReconstructOptions options = Thresholds();
  Reconstruction r;
  BundleProblem& p = r.problem;
  std::vector<int> of_pose(model->body_from_odom.size(), -1);
  for (size_t k = 0; k < of_pose.size(); ++k) {
    if (!model->body_from_odom[k]) continue;
    of_pose[k] = static_cast<int>(p.poses.size());
    p.poses.push_back(*model->body_from_odom[k]);
    p.pose_constant.push_back(static_cast<int>(k) == model->first.first);
  }
  for (const BodyCamera& c : input.cameras) p.views.push_back(c.cam_from_body);
  for (const TrackObservation& t : tracks.observations) {
    const int pose = of_pose[static_cast<size_t>(ImageAt(input, t.image).pose)];
    const std::optional<BearingObservation> o = ObservationOf(input, t, options.sigma_px);
    if (pose < 0 || !o) continue;
    p.observations.push_back(*o);
    p.observations.back().pose = pose;
  }
  p.points.assign(static_cast<size_t>(tracks.tracks), Eigen::Vector3d::Zero());
  r.point_valid.assign(p.points.size(), false);
  p.loss = MakeLoss("dcs", kLossChi2);
  PoseFactor gauge;
  gauge.kind = PoseFactor::Kind::kBetween;
  gauge.a = of_pose[static_cast<size_t>(model->first.first)];
  gauge.b = of_pose[static_cast<size_t>(model->first.second)];
  gauge.measured = p.poses[static_cast<size_t>(gauge.a)] * p.poses[static_cast<size_t>(gauge.b)].Inverse();
  gauge.sqrt_info = Matrix6d::Identity();
  p.factors = {gauge};
  // Poses that were just added are some pixels off.
  Settle(options, 16 * options.outlier_chi2, &r, threads, cancel);
  if (poses_too) {
    BundleOptions bundle;
    bundle.threads = threads;
    bundle.max_iterations = 10;
    bundle.relative_cost_tolerance = 1e-3;
    SolveBundle(p, bundle, progress, cancel);
    for (BearingObservation& o : p.observations) o.active = true;
    r.point_valid.assign(p.points.size(), false);
    Settle(options, options.outlier_chi2, &r, threads, cancel);
  }
  for (size_t k = 0; k < of_pose.size(); ++k) {
    if (of_pose[k] >= 0) model->body_from_odom[k] = p.poses[static_cast<size_t>(of_pose[k])];
  }
  model->points = p.points;
  for (size_t j = 0; j < p.points.size(); ++j) {
    if (!r.point_valid[j]) model->points[j].setConstant(std::numeric_limits<double>::quiet_NaN());
  }
}

// Features of an image that show known points.
struct Sighted {
  std::vector<Eigen::Vector3d> rays, points;  // camera frame, unit; odom frame
};

std::vector<Sighted> KnownPoints(const LocalizeInput& input, const TrackSet& tracks, const Model& model) {
  std::vector<Sighted> of_image(input.images.size());
  for (const TrackObservation& t : tracks.observations) {
    if (model.body_from_odom[static_cast<size_t>(ImageAt(input, t.image).pose)]) continue;
    const Eigen::Vector3d& y = model.points[static_cast<size_t>(t.track)];
    const auto ray = CameraOf(input, t.image).camera.Unproject(t.pixel.cast<double>());
    if (!ray || !y.allFinite()) continue;
    of_image[static_cast<size_t>(t.image)].rays.push_back(*ray);
    of_image[static_cast<size_t>(t.image)].points.push_back(y);
  }
  return of_image;
}

// The body's pose from one of its images.
std::optional<Rigid3d> Place(const LocalizeInput& input, int image, const Sighted& seen,
                             const StructureFromMotionOptions& options, uint64_t seed, const CancelToken& cancel) {
  const BodyCamera& camera = CameraOf(input, image);
  RansacOptions ransac;
  ransac.max_iterations = 2000;
  ransac.threshold = 6 / camera.camera.MeanFocal();
  ransac.seed = seed + static_cast<uint64_t>(image);
  const int n = static_cast<int>(seen.rays.size());
  const auto best = Ransac<Rigid3d, 3>(
      n, ransac, [&](const std::vector<int>& sample) { return ThreePointPoses(seen.rays, seen.points, sample); },
      [&](const Rigid3d& cam_from_odom, int i) {
        return AngleBetween(cam_from_odom * seen.points[static_cast<size_t>(i)], seen.rays[static_cast<size_t>(i)]);
      });
  const auto inliers = static_cast<int>(best.inliers.size());
  if (!best.found || inliers < options.min_matches || inliers < options.min_share * n) return {};
  BundleProblem p;
  p.poses = {best.model};
  p.views = {Rigid3d()};
  p.points_constant = true;
  p.loss = MakeLoss("dcs", kLossChi2);
  for (int k : best.inliers) {
    const Eigen::Vector3d& ray = seen.rays[static_cast<size_t>(k)];
    const auto pixel = camera.camera.Project(ray);
    if (!pixel) continue;
    BearingObservation o;
    o.point = static_cast<int>(p.points.size());
    o.ray = ray.cast<float>();
    o.w = camera.camera.BearingSqrtInfo(*pixel, 1.0).cast<float>();
    p.observations.push_back(o);
    p.points.push_back(seen.points[static_cast<size_t>(k)]);
  }
  ProgressSink silent;
  SolveBundle(p, {.max_iterations = 10, .relative_cost_tolerance = 1e-4, .threads = 1}, silent, cancel);
  return camera.cam_from_body.Inverse() * p.poses[0];
}

// Adds the images that see the most known points. Returns how many poses were placed.
int AddImages(const LocalizeInput& input, const TrackSet& tracks, const StructureFromMotionOptions& options,
              int threads, uint64_t seed, const CancelToken& cancel, Model* model) {
  const std::vector<Sighted> seen = KnownPoints(input, tracks, *model);
  std::map<int, int> image_of;  // pose -> the image with the most
  size_t most = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (static_cast<int>(seen[i].rays.size()) < options.min_matches) continue;
    const auto [it, fresh] = image_of.try_emplace(input.images[i].pose, static_cast<int>(i));
    if (!fresh && seen[i].rays.size() > seen[static_cast<size_t>(it->second)].rays.size())
      it->second = static_cast<int>(i);
    most = std::max(most, seen[i].rays.size());
  }
  // Those that see nearly as much are as safe; others wait for the points that these bring.
  for (const double least : {0.7, 0.0}) {
    std::vector<int> images;
    for (const auto& [pose, image] : image_of) {
      if (static_cast<double>(seen[static_cast<size_t>(image)].rays.size()) >= least * static_cast<double>(most))
        images.push_back(image);
    }
    Poses placed(images.size());
    ParallelFor(static_cast<int64_t>(images.size()), threads, cancel, [&](int64_t i) {
      const int image = images[static_cast<size_t>(i)];
      placed[static_cast<size_t>(i)] = Place(input, image, seen[static_cast<size_t>(image)], options, seed, cancel);
    });
    int count = 0;
    for (size_t i = 0; i < images.size(); ++i) {
      if (!placed[i]) continue;
      model->body_from_odom[static_cast<size_t>(ImageAt(input, images[i]).pose)] = placed[i];
      ++count;
    }
    if (count > 0) return count;
  }
  return 0;
}

// Edges to begin with, the best first: many matches that other images show, too, and whose rays meet at an angle.
std::vector<const ViewEdge*> Beginnings(const LocalizeInput& input, const TrackSet& tracks,
                                        const std::vector<ViewEdge>& edges) {
  constexpr double kGoodParallax = 4 * kDegToRad;
  constexpr size_t kShown = 3;                     // images
  std::map<std::pair<int, int>, size_t> shown_by;  // image, feature -> images
  for (size_t begin = 0, end = 0; begin < tracks.observations.size(); begin = end) {
    while (end < tracks.observations.size() && tracks.observations[end].track == tracks.observations[begin].track)
      ++end;
    for (size_t k = begin; k < end; ++k) {
      shown_by[{tracks.observations[k].image, tracks.observations[k].feature}] = end - begin;
    }
  }
  std::vector<std::pair<double, const ViewEdge*>> scored;
  for (const ViewEdge& e : edges) {
    if (e.geometry.rotation_only) continue;
    std::vector<double> angles;
    for (const auto& [a, b] : e.matches) {
      const auto track = shown_by.find({a.image, a.feature});
      const auto ray_a = CameraOf(input, a.image).camera.Unproject(a.pixel.cast<double>());
      const auto ray_b = CameraOf(input, b.image).camera.Unproject(b.pixel.cast<double>());
      if (track == shown_by.end() || track->second < kShown || !ray_a || !ray_b) continue;
      angles.push_back(AngleBetween(e.geometry.b_from_a.rotation * *ray_a, *ray_b));
    }
    if (angles.empty()) continue;
    const auto shown = static_cast<double>(angles.size());
    scored.emplace_back(-shown * std::min(1.0, Median(std::move(angles)) / kGoodParallax), &e);
  }
  std::stable_sort(scored.begin(), scored.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
  std::vector<const ViewEdge*> out;
  for (const auto& [score, e] : scored) out.push_back(e);
  return out;
}

Model Grow(const LocalizeInput& input, const TrackSet& tracks, const ViewEdge& begin,
           const StructureFromMotionOptions& options, int threads, uint64_t seed, ProgressSink& progress,
           const CancelToken& cancel) {
  Model model;
  model.body_from_odom.resize(input.pose_stamps.size());
  model.first = {ImageAt(input, begin.pair.a).pose, ImageAt(input, begin.pair.b).pose};
  model.body_from_odom[static_cast<size_t>(model.first.first)] = Rigid3d();
  model.body_from_odom[static_cast<size_t>(model.first.second)] =
      CameraOf(input, begin.pair.b).cam_from_body.Inverse() * begin.geometry.b_from_a *
      CameraOf(input, begin.pair.a).cam_from_body;
  model.placed = 2;
  Adjust(input, tracks, true, threads, progress, cancel, &model);
  progress.Begin("images placed", static_cast<int64_t>(model.body_from_odom.size()));
  // A bundle adjustment whenever the model has grown by a tenth.
  for (int adjusted = 2;;) {
    cancel.ThrowIfCancelled();
    const int added = AddImages(input, tracks, options, threads, seed, cancel, &model);
    model.placed += added;
    progress.Advance(added);
    if (added == 0 && adjusted == model.placed) break;
    const bool poses_too = added == 0 || 10 * (model.placed - adjusted) >= adjusted;
    Adjust(input, tracks, poses_too, threads, progress, cancel, &model);
    if (poses_too) adjusted = model.placed;
  }
  return model;
}

ImageMotion Normalised(const LocalizeInput& input, const TrackSet& tracks, const Model& model) {
  ImageMotion motion;
  motion.placed = model.placed;
  std::vector<double> depths;
  for (const TrackObservation& t : tracks.observations) {
    const std::optional<Rigid3d>& pose = model.body_from_odom[static_cast<size_t>(ImageAt(input, t.image).pose)];
    const Eigen::Vector3d& y = model.points[static_cast<size_t>(t.track)];
    if (pose && y.allFinite()) depths.push_back((*pose * y).norm());
  }
  const double length = depths.empty() ? 1 : ImageMotion::kUsualDepth / Median(std::move(depths));
  std::optional<Rigid3d> first;
  for (const std::optional<Rigid3d>& pose : model.body_from_odom) {
    motion.odom_from_body.emplace_back();
    if (!pose) continue;
    if (!first) first = pose;
    motion.odom_from_body.back() = *first * pose->Inverse();
    motion.odom_from_body.back()->translation *= length;
  }
  return motion;
}

}  // namespace

void LevelMotion(const LocalizeInput& input, const std::vector<Eigen::Vector3d>& tops, ImageMotion* motion) {
  // 1 sigma of a camera that is held in the hand, as in the levelling of photo sets (survey/panorama/levelling.cc).
  constexpr double kRoll = 2 * kDegToRad, kPitch = 8 * kDegToRad;
  constexpr double kAgree = 0.5;  // mean cosine: 60 deg
  Eigen::Matrix3d level = Eigen::Matrix3d::Zero();
  Eigen::Vector3d top = Eigen::Vector3d::Zero(), ahead = Eigen::Vector3d::Zero();
  double placed = 0;
  for (size_t i = 0; i < input.images.size(); ++i) {
    const std::optional<Rigid3d>& pose = motion->odom_from_body[static_cast<size_t>(input.images[i].pose)];
    if (!pose) continue;
    // How a calibrated camera sits on its body is known, and bodies stand upright: their x is ahead, their z is up.
    const BodyCamera& camera = CameraOf(input, static_cast<int>(i));
    const Eigen::Quaterniond body_from_cam = camera.cam_from_body.rotation.conjugate();
    Eigen::Vector3d z = Eigen::Vector3d::UnitX(), up = Eigen::Vector3d::UnitZ();
    if (!camera.has_extrinsics) z = body_from_cam * Eigen::Vector3d::UnitZ(), up = body_from_cam * tops[i];
    z = pose->rotation * z, up = pose->rotation * up;
    const Eigen::Vector3d x = z.cross(up);
    level += x * x.transpose() / (kRoll * kRoll) + z * z.transpose() / (kPitch * kPitch);
    top += up, ahead += z, ++placed;
  }
  // What is level is square to the vertical.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(level);
  Eigen::Vector3d vertical = eigen.eigenvectors().col(0);
  if (std::abs(vertical.dot(top)) > kAgree * placed) {
    vertical *= vertical.dot(top) > 0 ? 1 : -1;
  } else if (ahead.norm() > kAgree * placed) {  // no side of the pictures is up: they look down, as a drone's do
    vertical = -ahead.normalized();
  } else {
    return;
  }
  const Rigid3d turn(Eigen::Quaterniond::FromTwoVectors(vertical, Eigen::Vector3d::UnitZ()), Eigen::Vector3d::Zero());
  for (std::optional<Rigid3d>& pose : motion->odom_from_body) {
    if (pose) pose = turn * *pose;
  }
}

ImageMotion MotionFromImages(const LocalizeInput& original, const StructureFromMotionOptions& options,
                             const ViewGraphOptions& view_graph, int threads, uint64_t seed, ProgressSink& progress,
                             const CancelToken& cancel) {
  // Without a length, the distances of a rig's cameras mean nothing yet; beside those of the scene they are small.
  LocalizeInput input = original;
  for (BodyCamera& c : input.cameras) c.cam_from_body.translation.setZero();
  input.odom_from_body.assign(input.pose_stamps.size(), Rigid3d());
  const std::vector<ImagePair> pairs = PairsByAppearance(input, options, threads, seed, cancel);
  std::vector<ViewEdge> edges = VerifyPairs(input, pairs, view_graph, threads, seed, progress, cancel);
  const size_t verified = edges.size();
  RejectOpenTriangles(&edges);
  progress.Log(LogLevel::kInfo, std::to_string(verified - edges.size()) + " of " + std::to_string(verified) +
                                    " verified pairs rejected: most of their triangles do not close");
  // The surest first: a conflict keeps what is there.
  std::stable_sort(edges.begin(), edges.end(), [](const ViewEdge& x, const ViewEdge& y) {
    return x.geometry.log10_false_alarms < y.geometry.log10_false_alarms;
  });
  const TrackSet tracks = LongTracks(edges, options.tracks_per_image);
  const std::vector<const ViewEdge*> beginnings = Beginnings(input, tracks, edges);
  if (beginnings.empty()) {
    throw InputError(
        "no two images of the run fit each other with parallax (" + std::to_string(pairs.size()) + " pairs tried, " +
        std::to_string(verified) +
        " verified): a run without odometry needs images that were taken from several places and overlap, so "
        "that three at least show the same");
  }
  constexpr size_t kBeginnings = 5;
  Model best;
  for (size_t k = 0; k < std::min(kBeginnings, beginnings.size()); ++k) {
    Model model = Grow(input, tracks, *beginnings[k], options, threads, seed, progress, cancel);
    if (model.placed > best.placed) best = std::move(model);
    if (2 * best.placed > static_cast<int>(input.pose_stamps.size())) break;
  }
  ImageMotion motion = Normalised(input, tracks, best);
  motion.pairs_tried = static_cast<int>(pairs.size());
  motion.pairs_verified = static_cast<int>(verified);
  return motion;
}

}  // namespace trigpoint
