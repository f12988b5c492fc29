#include "survey/network/network.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/base/union_find.h"
#include "calib/estimation/sparse_least_squares.h"
#include "calib/geometry/bearing.h"
#include "survey/tags/control.h"
#include "survey/tags/map_start.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

constexpr double kHeldM = 1e-5, kHeldRad = 1e-7;  // what a gauge holds, as in the survey
constexpr double kDatumShiftSigma = 10;           // m, as in the survey
// Non-centrality of a test of one quantity at 0.1 % (two-sided) with a power of 80 %: 3.29 + 0.84.
constexpr double kNonCentrality = 4.13;
constexpr double kLeastRedundancy = 1e-4;
constexpr double kNearest_m = 1;  // scene points of a panorama
constexpr double kInfinite = std::numeric_limits<double>::infinity();

// What holds the world, as the survey chooses: control where it is well spread or alone, else geotags beside it, whose
// common shift is then unknown.
struct Datum {
  bool in_world = false, geotags = false, shift = false;
};

Datum DatumOf(const std::vector<Eigen::Vector3d>& control, const std::vector<Eigen::Vector3d>& geotags) {
  Datum datum;
  datum.geotags = !AreWellSpread(control) && !geotags.empty();
  std::vector<Eigen::Vector3d> used = control;
  if (datum.geotags) used.insert(used.end(), geotags.begin(), geotags.end());
  datum.in_world = HoldAFrame(used);
  datum.geotags = datum.geotags && datum.in_world;
  datum.shift = datum.geotags && !control.empty();
  return datum;
}

class Network {
 public:
  Network(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed)
      : layout_(layout), options_(options), sights_(PlanSights(layout, options, seed)) {
    for (size_t p = 0; p < layout.passes.size(); ++p) ties_.push_back(PlanTies(layout.passes[p], options, seed));
  }

  NetworkPrediction Predict(int threads, const CancelToken& cancel) {
    if (sights_.empty()) {
      throw InputError("no planned picture sees a tag: check sizes, distances and which way tags and cameras face");
    }
    FindLinked();
    AddUnknowns();
    AddSights();
    AddTies();
    AddOdometry();
    AddDatum();
    Invert(threads, cancel);
    Collect();
    return std::move(result_);
  }

  // Of the one pass of a layout without tags.
  std::vector<PanoramaPrediction> Panoramas(int threads, const CancelToken& cancel) {
    linked_.assign(1, true);
    NumberFrames();
    AddUnknowns();
    AddTies();
    AddOdometry();
    std::vector<PanoramaPrediction> predictions;
    std::vector<int> unknowns;
    for (const PlannedPanorama& panorama : layout_.panoramas) {
      const int shared = AddPanorama(panorama);
      if (shared == 0) continue;
      predictions.push_back({0, panorama.name, shared, Matches(panorama.world_from_pano.translation)});
      unknowns.push_back(static_cast<int>(solver_.unknowns.size()) - 1);
    }
    if (predictions.empty()) return predictions;
    using PointObservation = SparseLeastSquares::PointObservation;
    std::stable_sort(solver_.observations.begin(), solver_.observations.end(),
                     [](const PointObservation& a, const PointObservation& b) { return a.point < b.point; });
    Invert(threads, cancel);
    for (size_t i = 0; i < unknowns.size(); ++i) predictions[i].covariance = solver_.PoseCovariance(unknowns[i]);
    return predictions;
  }

 private:
  // Everything is where its observations put it: this prepares the equations and moves nothing.
  void Invert(int threads, const CancelToken& cancel) {
    ProgressSink silent;
    solver_.Solve(1, threads, silent, cancel);
    solver_.Linearise(threads, cancel, true);
  }

  // With its geotag, and the scene points it shows: those in reach, evenly along the pass. Returns how many; with too
  // few for an answer nothing is added.
  int AddPanorama(const PlannedPanorama& panorama) {
    const Eigen::Vector3d& at = panorama.world_from_pano.translation;
    std::vector<int> near;
    for (size_t k = 0; k < solver_.points.size(); ++k) {
      const double away = (solver_.points[k] - at).norm();
      if (away > kNearest_m && away < options_.tie_far_m) near.push_back(static_cast<int>(k));
    }
    const auto count = std::min(near.size(), static_cast<size_t>(options_.panorama_points));
    if (count < static_cast<size_t>(kMatchesNeeded)) return 0;
    const int pose = solver_.AddPose(panorama.world_from_pano);
    const int view = static_cast<int>(solver_.views.size());
    solver_.views.push_back({Rigid3d(), nullptr});
    for (size_t i = 0; i < count; ++i) {
      const int point = near[i * near.size() / count];
      const Eigen::Vector3d ray =
          (panorama.world_from_pano.Inverse() * solver_.points[static_cast<size_t>(point)]).normalized();
      solver_.observations.push_back(
          {point, pose, view, (TangentBasis(ray) / (options_.panorama_sigma_deg * kDegToRad)).cast<float>()});
    }
    Vector6d sigma;
    sigma << panorama.sigma_tilt_rad, panorama.sigma_tilt_rad, panorama.sigma_heading_rad, panorama.sigma_h_m,
        panorama.sigma_h_m, panorama.sigma_v_m;
    solver_.AddFactor(new PosePriorCost(panorama.world_from_pano, sigma), nullptr, {pose});
    return static_cast<int>(count);
  }

  // Scene points of the one pass that a panorama at `centre` sees much as one of the pictures does.
  int Matches(const Eigen::Vector3d& centre) const {
    const PlannedPass& pass = layout_.passes.front();
    const double least_cosine = std::cos(options_.match_angle_deg * kDegToRad);
    std::set<int> matched;
    for (const PlannedTie& tie : ties_.front().ties) {
      const Eigen::Vector3d& point = ties_.front().points[static_cast<size_t>(tie.point)];
      const Eigen::Vector3d camera = pass.world_from_body[static_cast<size_t>(tie.frame)].target_from_body *
                                     pass.cameras[static_cast<size_t>(tie.camera)].cam_from_body.TargetOriginInSource();
      const Eigen::Vector3d from_camera = point - camera, from_pano = point - centre;
      const double near = std::min(from_camera.norm(), from_pano.norm()),
                   far = std::max(from_camera.norm(), from_pano.norm());
      if ((camera - centre).norm() > options_.match_reach_m || far > options_.match_ratio * near) continue;
      if (from_camera.dot(from_pano) >= least_cosine * near * far) matched.insert(tie.point);
    }
    return static_cast<int>(matched.size());
  }

  int Frame(int pass, int frame) const { return first_frame_[static_cast<size_t>(pass)] + frame; }
  bool Tied(int tag_id) const { return tag_unknown_.contains(tag_id); }

  void NumberFrames() {
    int frames = 0;
    for (const PlannedPass& pass : layout_.passes) {
      first_frame_.push_back(frames);
      frames += static_cast<int>(pass.world_from_body.size());
    }
  }

  // Odometry joins the frames of a pass, tags join passes: what is not tied to the largest part is left out.
  void FindLinked() {
    NumberFrames();
    UnionFind passes(static_cast<int>(layout_.passes.size()));
    std::map<int, int> seen_by;
    for (const PlannedSight& sight : sights_) {
      const auto [it, fresh] = seen_by.try_emplace(sight.tag_id, sight.pass);
      if (!fresh) passes.Join(sight.pass, it->second);
    }
    std::map<int, int> count;
    for (const PlannedSight& sight : sights_) ++count[passes.Root(sight.pass)];
    const int root = std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) {
                       return a.second < b.second;
                     })->first;
    for (size_t p = 0; p < layout_.passes.size(); ++p) {
      linked_.push_back(passes.Root(static_cast<int>(p)) == root);
      if (!linked_.back()) {
        result_.left_out.push_back(layout_.passes[p].name);
        result_.warnings.push_back(
            fmt::format("pass {} shares no tag with the others and is left out", layout_.passes[p].name));
      }
    }
    for (const auto& [tag_id, pass] : seen_by) {
      if (!linked_[static_cast<size_t>(pass)]) result_.apart[tag_id] = layout_.passes[static_cast<size_t>(pass)].name;
    }
    std::erase_if(sights_, [&](const PlannedSight& sight) { return !linked_[static_cast<size_t>(sight.pass)]; });
  }

  void AddUnknowns() {
    for (size_t p = 0; p < layout_.passes.size(); ++p) {
      for (const TimedPose& pose : layout_.passes[p].world_from_body) {
        frame_unknown_.push_back(linked_[p] ? solver_.AddPose(pose.target_from_body) : -1);
      }
    }
    std::set<int> seen;
    for (const PlannedSight& sight : sights_) seen.insert(sight.tag_id);
    for (const int id : seen) tag_unknown_[id] = solver_.AddPose(layout_.world_from_tag.at(id));
    shift_ = solver_.AddNumbers({0});  // of corners: none is planned for
    solver_.unknowns[static_cast<size_t>(shift_)].constant = true;
  }

  void AddSights() {
    for (const PlannedSight& sight : sights_) {
      const BodyCamera& camera =
          layout_.passes[static_cast<size_t>(sight.pass)].cameras[static_cast<size_t>(sight.camera)];
      const TagSight seen = MakeTagSight(camera.camera, sight.detection, options_.extra_sigma_px);
      sight_factor_.push_back(
          solver_.AddFactor(new TagCost(seen, layout_.sizes.SizeOf(sight.tag_id), camera.cam_from_body, &one_), nullptr,
                            {frame_unknown_[static_cast<size_t>(Frame(sight.pass, sight.frame))],
                             tag_unknown_.at(sight.tag_id), shift_}));
    }
  }

  void AddTies() {
    for (size_t p = 0; p < ties_.size(); ++p) {
      if (!linked_[p]) continue;
      const PlannedPass& pass = layout_.passes[p];
      const int first_view = static_cast<int>(solver_.views.size()),
                first_point = static_cast<int>(solver_.points.size());
      for (const BodyCamera& camera : pass.cameras) solver_.views.push_back({camera.cam_from_body, nullptr});
      solver_.points.insert(solver_.points.end(), ties_[p].points.begin(), ties_[p].points.end());
      for (const PlannedTie& tie : ties_[p].ties) {
        const Camera& camera = pass.cameras[static_cast<size_t>(tie.camera)].camera;
        solver_.observations.push_back(
            {first_point + tie.point, frame_unknown_[static_cast<size_t>(Frame(static_cast<int>(p), tie.frame))],
             first_view + tie.camera, camera.BearingSqrtInfo(tie.pixel, options_.tie_sigma_px).cast<float>()});
      }
    }
  }

  void AddOdometry() {
    for (size_t p = 0; p < layout_.passes.size(); ++p) {
      const PlannedPass& pass = layout_.passes[p];
      if (!linked_[p] || pass.world_from_body.size() < 2) continue;
      const int scale = solver_.AddNumbers({1}), drift = solver_.AddNumbers({0});
      for (size_t k = 1; k < pass.world_from_body.size(); ++k) {
        const TimedPose &a = pass.world_from_body[k - 1], &b = pass.world_from_body[k];
        const Rigid3d a_from_b = a.target_from_body.Inverse() * b.target_from_body;
        const double seconds = 1e-9 * static_cast<double>(b.stamp_ns - a.stamp_ns);
        const double length = a_from_b.translation.norm();
        const Vector6d sigma = OdometryStepSigma(length, seconds, options_.odometry_rot_deg, options_.odometry_m);
        const Eigen::Vector3d way = length * (b.target_from_body.rotation.conjugate() * Eigen::Vector3d::UnitZ());
        const int at = Frame(static_cast<int>(p), static_cast<int>(k));
        solver_.AddFactor(
            new OdometryCost(a_from_b, way, sigma, pass.odometry_factor.data()), nullptr,
            {frame_unknown_[static_cast<size_t>(at) - 1], frame_unknown_[static_cast<size_t>(at)], scale, drift});
      }
      solver_.AddFactor(new NumberCost(1, std::max(1e-6, pass.scale_sigma)), nullptr, {scale});
      solver_.AddFactor(new NumberCost(0, std::max(1e-9, options_.heading_drift_deg_m * kDegToRad)), nullptr, {drift});
    }
  }

  Eigen::Vector3d Lever(const SurveyPoint& p) const {
    return p.corner < 0 ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                        : TagCorner(layout_.sizes.SizeOf(p.tag_id), p.corner);
  }

  void ChooseDatum() {
    std::vector<Eigen::Vector3d> control, geotags;
    for (const SurveyPoint& p : layout_.points) {
      if (!Tied(p.tag_id)) continue;
      if (p.role == PointRole::kControl) control.push_back(p.world_m);
      if (p.role == PointRole::kGeotag) geotags.push_back(p.world_m);
    }
    datum_ = DatumOf(control, geotags);
    result_.in_world = datum_.in_world;
    result_.datum = !datum_.in_world  ? "first camera"
                    : !datum_.geotags ? "control"
                    : control.empty() ? "geotags"
                                      : "control and geotags";
  }

  void AddDatum() {
    ChooseDatum();
    int shift = -1;
    if (datum_.shift) {
      shift = solver_.AddNumbers({0, 0, 0});
      solver_.AddFactor(new KnownPointCost(Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(kDatumShiftSigma)),
                        nullptr, {shift});
    }
    for (const SurveyPoint& p : layout_.points) {
      PointPrediction point{p.name, p.tag_id, p.role};
      point.used = Tied(p.tag_id) && result_.in_world &&
                   (p.role == PointRole::kControl || (p.role == PointRole::kGeotag && datum_.geotags));
      point_factor_.push_back(-1);
      if (point.used) {
        const Rigid3d& tag = layout_.world_from_tag.at(p.tag_id);
        const Eigen::Vector3d offset = OffsetInWorld(p, tag), at = tag * Lever(p) + offset;
        const Eigen::Vector3d sigma(p.sigma_h_m, p.sigma_h_m, p.sigma_v_m);
        point_factor_.back() =
            p.role == PointRole::kGeotag && shift >= 0
                ? solver_.AddFactor(new ShiftedPointCost(Lever(p), offset, at, sigma), nullptr,
                                    {tag_unknown_.at(p.tag_id), shift})
                : solver_.AddFactor(new PointCost(Lever(p), offset, at, sigma), nullptr, {tag_unknown_.at(p.tag_id)});
      }
      result_.points.push_back(point);
    }
    AddDistances();
    result_.gauge = "all six from " + result_.datum + ", weighted by stated sigmas";
    if (result_.in_world) return;
    result_.gauge = "the first camera's body: position and attitude, held";
    result_.warnings.push_back(
        std::string("expected three known points that are not on one line, found ") +
        (layout_.points.empty() ? "none" : "fewer, or all on one line") +
        ": accuracy is relative to the first camera, not to the world; add control (--suggest control 3)");
    Vector6d sigma;
    sigma << Eigen::Vector3d::Constant(kHeldRad), Eigen::Vector3d::Constant(kHeldM);
    const int first = sights_.front().pass;
    solver_.AddFactor(
        new PosePriorCost(layout_.passes[static_cast<size_t>(first)].world_from_body.front().target_from_body, sigma),
        nullptr, {frame_unknown_[static_cast<size_t>(Frame(first, 0))]});
  }

  void AddDistances() {
    for (const SurveyDistance& d : layout_.distances) {
      if (d.check || !Tied(d.from) || !Tied(d.to) || d.from == d.to) continue;
      const double length =
          (layout_.world_from_tag.at(d.from).translation - layout_.world_from_tag.at(d.to).translation).norm();
      distance_factor_.push_back(solver_.AddFactor(new DistanceCost(length, d.sigma_m), nullptr,
                                                   {tag_unknown_.at(d.from), tag_unknown_.at(d.to)}));
      result_.distances.push_back({d, {}});
    }
  }

  // Of row `row` of a factor whose observation has the given sigma; `unknown`: the pose that an error would move.
  Reliability ReliabilityOf(int factor, Eigen::Index row, double sigma, int unknown) const {
    Reliability r;
    const double absorbed = solver_.Leverage(factor)(row, row);
    r.redundancy = std::clamp(1 - absorbed, 0.0, 1.0);
    r.blunder = r.redundancy > kLeastRedundancy ? kNonCentrality * sigma / std::sqrt(r.redundancy)
                                                : std::numeric_limits<double>::infinity();
    // dx = Q J' e / sigma: the columns of J that belong to the pose, and the pose's own covariance with them.
    const int offset = solver_.Offset(unknown);
    if (offset < 0 || !std::isfinite(r.blunder)) return r;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(solver_.Equations(), 1);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(solver_.Leverage(factor).rows(), 1);
    unit(row, 0) = r.blunder / sigma;
    solver_.AddTransposed(factor, unit, &right);
    r.effect_m = solver_.SolveNormal(right).block(offset + 3, 0, 3, 1).norm();
    return r;
  }

  void Collect() {
    std::map<int, std::set<int>> passes;
    std::map<int, int> images;
    std::map<int, int> tags_of_frame;
    for (size_t i = 0; i < sights_.size(); ++i) {
      const PlannedSight& s = sights_[i];
      ++images[s.tag_id];
      passes[s.tag_id].insert(s.pass);
      ++tags_of_frame[Frame(s.pass, s.frame)];
      CollectSight(i);
    }
    for (const auto& [id, pose] : layout_.world_from_tag) {
      TagPrediction tag;
      tag.tag_id = id;
      tag.world_m = pose.translation;
      tag.images = images[id];
      tag.passes = static_cast<int>(passes[id].size());
      tag.tied = Tied(id);
      if (tag.tied) tag.covariance = solver_.PoseCovariance(tag_unknown_.at(id));
      for (const PointPrediction& p : result_.points) {
        if (p.tag_id != id || p.role == PointRole::kGeotag) continue;
        tag.role = p.role == PointRole::kControl ? "control" : tag.role == "free" ? "check" : tag.role;
      }
      result_.tags.push_back(tag);
    }
    for (size_t p = 0; p < layout_.passes.size(); ++p) {
      for (size_t k = 0; linked_[p] && k < layout_.passes[p].world_from_body.size(); ++k) {
        const TimedPose& pose = layout_.passes[p].world_from_body[k];
        const int frame = Frame(static_cast<int>(p), static_cast<int>(k));
        result_.bodies.push_back({static_cast<int>(p), pose.stamp_ns, pose.target_from_body,
                                  solver_.PoseCovariance(frame_unknown_[static_cast<size_t>(frame)]),
                                  tags_of_frame[frame]});
      }
    }
    CollectPoints();
    CollectJoint();
  }

  // All eight coordinates count; the least controlled one is stated. Its effect is not: it is that of one picture.
  void CollectSight(size_t i) {
    const PlannedSight& s = sights_[i];
    SightPrediction sight{
        s.pass,
        layout_.passes[static_cast<size_t>(s.pass)].world_from_body[static_cast<size_t>(s.frame)].stamp_ns,
        s.camera,
        s.tag_id,
        s.side_px,
        s.angle_deg,
        std::hypot(s.detection.corner_sigma_px[0], options_.extra_sigma_px)};
    const double absorbed = solver_.Leverage(sight_factor_[i]).diagonal().maxCoeff();
    sight.worst.redundancy = std::clamp(1 - absorbed, 0.0, 1.0);
    sight.worst.blunder = sight.worst.redundancy > kLeastRedundancy
                              ? kNonCentrality * sight.sigma_px / std::sqrt(sight.worst.redundancy)
                              : std::numeric_limits<double>::infinity();
    result_.sights.push_back(sight);
  }

  void CollectPoints() {
    for (size_t i = 0; i < result_.points.size(); ++i) {
      PointPrediction& point = result_.points[i];
      if (point_factor_[i] < 0) continue;
      const SurveyPoint& p = layout_.points[i];
      const int tag = tag_unknown_.at(p.tag_id);
      const Reliability east = ReliabilityOf(point_factor_[i], 0, p.sigma_h_m, tag);
      const Reliability north = ReliabilityOf(point_factor_[i], 1, p.sigma_h_m, tag);
      point.horizontal = east.redundancy < north.redundancy ? east : north;
      point.vertical = ReliabilityOf(point_factor_[i], 2, p.sigma_v_m, tag);
    }
    for (size_t i = 0; i < result_.distances.size(); ++i) {
      DistancePrediction& d = result_.distances[i];
      d.reliability = ReliabilityOf(distance_factor_[i], 0, d.distance.sigma_m, tag_unknown_.at(d.distance.from));
    }
  }

  void CollectJoint() {
    const auto n = static_cast<Eigen::Index>(tag_unknown_.size());
    result_.joint.resize(3 * n, 3 * n);
    Eigen::Index column = 0;
    for (const auto& [id, unknown] : tag_unknown_) {
      const Eigen::MatrixXd all = solver_.CovarianceColumns(solver_.Offset(unknown) + 3, 3);
      Eigen::Index row = 0;
      for (const auto& [other, its_unknown] : tag_unknown_) {
        result_.joint.block<3, 3>(3 * row++, 3 * column) = all.middleRows(solver_.Offset(its_unknown) + 3, 3);
      }
      ++column;
    }
  }

  const NetworkLayout& layout_;
  const NetworkOptions& options_;
  std::vector<PlannedSight> sights_;
  std::vector<PassTies> ties_;
  double one_ = 1;
  SparseLeastSquares solver_;
  std::vector<bool> linked_;  // passes
  std::vector<int> first_frame_, frame_unknown_;
  std::map<int, int> tag_unknown_;
  int shift_ = -1;
  std::vector<int> sight_factor_, point_factor_, distance_factor_;
  Datum datum_;
  NetworkPrediction result_;
};

double Rms(const Eigen::MatrixXd& joint) {
  return joint.rows() > 0 ? std::sqrt(joint.trace() / (static_cast<double>(joint.rows()) / 3)) : kInfinite;
}

}  // namespace

double NetworkPrediction::RmsSigma() const { return Rms(joint); }

double NetworkPrediction::RmsSigmaOf(const NetworkPrediction& before) const {
  if (before.in_world && !in_world) return kInfinite;
  double sum = 0;
  int n = 0;
  for (const TagPrediction& tag : before.tags) {
    if (!tag.tied) continue;
    const auto now =
        std::find_if(tags.begin(), tags.end(), [&](const TagPrediction& t) { return t.tag_id == tag.tag_id; });
    if (now == tags.end() || !now->tied) return kInfinite;
    sum += now->covariance.diagonal().tail<3>().sum(), ++n;
  }
  return n > 0 ? std::sqrt(sum / n) : kInfinite;
}

NetworkPrediction PredictNetwork(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed, int threads,
                                 const CancelToken& cancel) {
  const std::vector<std::string> problems = options.Check();
  if (!problems.empty()) throw OptionError(problems.front());
  return Network(layout, options, seed).Predict(ResolveThreads(threads), cancel);
}

std::vector<PanoramaPrediction> PredictPanoramas(const NetworkLayout& layout, const NetworkOptions& options,
                                                 uint64_t seed, int threads, const CancelToken& cancel) {
  const std::vector<std::string> problems = options.Check();
  if (!problems.empty()) throw OptionError(problems.front());
  std::vector<PanoramaPrediction> all;
  for (size_t p = 0; p < layout.passes.size() && !layout.panoramas.empty(); ++p) {
    NetworkLayout alone;
    alone.passes = {layout.passes[p]};
    alone.passes.front().seen = std::vector<PlannedSight>();
    alone.panoramas = layout.panoramas;
    for (PanoramaPrediction& panorama : Network(alone, options, seed).Panoramas(ResolveThreads(threads), cancel)) {
      panorama.pass = static_cast<int>(p);
      all.push_back(std::move(panorama));
    }
  }
  return all;
}

namespace {

constexpr double kMostTried = 20000;  // sets of which all are tried

double Choices(size_t n, size_t k) {
  double choices = 1;
  for (size_t i = 0; i < k; ++i) choices *= static_cast<double>(n - i) / static_cast<double>(i + 1);
  return choices;
}

// The tags' sigmas in the world with control on chosen ones (equations: network.h).
class ControlChooser {
 public:
  using Set = std::vector<Eigen::Index>;  // of tags, in the order of the joint covariance

  ControlChooser(const NetworkPrediction& free, const std::vector<SurveyPoint>& known, double sigma_h_m,
                 double sigma_v_m)
      : joint_(free.joint), variance_(Eigen::Vector3d(sigma_h_m, sigma_h_m, sigma_v_m).cwiseAbs2()) {
    for (const TagPrediction& tag : free.tags) {
      if (tag.tied) tags_.push_back(&tag);
    }
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const TagPrediction* tag : tags_) middle += tag->world_m / static_cast<double>(tags_.size());
    motion_.resize(joint_.rows(), 6);
    for (size_t i = 0; i < tags_.size(); ++i) {
      motion_.middleRows<3>(3 * static_cast<Eigen::Index>(i)) << -Skew(tags_[i]->world_m - middle),
          Eigen::Matrix3d::Identity();
    }
    std::set<int> taken;
    for (const SurveyPoint& p : known) {
      if (p.role != PointRole::kGeotag) taken.insert(p.tag_id);
      const auto its = std::find_if(tags_.begin(), tags_.end(), [&](const auto* t) { return t->tag_id == p.tag_id; });
      if (its == tags_.end() || p.role == PointRole::kCheck) continue;
      const Eigen::Vector3d variance = Eigen::Vector3d(p.sigma_h_m, p.sigma_h_m, p.sigma_v_m).cwiseAbs2();
      (p.role == PointRole::kControl ? control_ : geotags_).push_back({its - tags_.begin(), p.world_m, variance});
    }
    for (size_t i = 0; i < tags_.size(); ++i) {
      if (!taken.contains(tags_[i]->tag_id)) candidates_.push_back(static_cast<Eigen::Index>(i));
    }
  }

  const Set& candidates() const { return candidates_; }
  int TagId(Eigen::Index k) const { return tags_[static_cast<size_t>(k)]->tag_id; }

  // Infinite without a datum.
  double RmsWith(const Set& chosen) const {
    std::vector<Observed> used = control_;
    for (const Eigen::Index k : chosen) used.push_back({k, tags_[static_cast<size_t>(k)]->world_m, variance_});
    const Datum datum = DatumOf(Places(used), Places(geotags_));
    if (!datum.in_world) return kInfinite;
    const size_t first_geotag = used.size();
    if (datum.geotags) used.insert(used.end(), geotags_.begin(), geotags_.end());
    return Rms(used, datum.shift ? first_geotag : used.size());
  }
  // With control on all candidates, and all geotags without a common shift: nothing more can be known.
  double Bound() const {
    std::vector<Observed> used = control_;
    for (const Eigen::Index k : candidates_) used.push_back({k, tags_[static_cast<size_t>(k)]->world_m, variance_});
    used.insert(used.end(), geotags_.begin(), geotags_.end());
    return Rms(used, used.size());
  }

  // The best `count` of `from`; `exact` where all were tried, else exchanges of one no longer improve it.
  Set Best(const Set& from, size_t count, bool* exact) const {
    *exact = Choices(from.size(), count) <= kMostTried;
    Set best(from.begin(), from.begin() + static_cast<std::ptrdiff_t>(count)), chosen;
    double rms = kInfinite;
    if (*exact) {
      TryAll(from, 0, count, &chosen, &rms, &best);
      return best;
    }
    best = FarApart(from, count);
    rms = RmsWith(best);
    for (bool better = true; better;) {
      better = false;
      for (size_t i = 0; i < count; ++i) {
        for (const Eigen::Index k : from) {
          if (std::find(best.begin(), best.end(), k) != best.end()) continue;
          Set other = best;
          other[i] = k;
          const double its = RmsWith(other);
          if (its < rms) rms = its, best = other, better = true;
        }
      }
    }
    return best;
  }

 private:
  struct Observed {
    Eigen::Index tag = 0;
    Eigen::Vector3d world_m, variance;
  };
  static std::vector<Eigen::Vector3d> Places(const std::vector<Observed>& points) {
    std::vector<Eigen::Vector3d> places;
    for (const Observed& p : points) places.push_back(p.world_m);
    return places;
  }

  // Points from `first_shifted` on have a shift in common.
  double Rms(const std::vector<Observed>& used, size_t first_shifted) const {
    const auto rows = static_cast<Eigen::Index>(3 * used.size());
    Eigen::MatrixXd seen(rows, joint_.cols()), own(rows, rows), moved(rows, 6);
    for (size_t i = 0; i < used.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(3 * i);
      seen.middleRows<3>(row) = joint_.middleRows<3>(3 * used[i].tag);
      moved.middleRows<3>(row) = motion_.middleRows<3>(3 * used[i].tag);
    }
    for (size_t i = 0; i < used.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(3 * i);
      own.middleCols<3>(row) = seen.middleCols<3>(3 * used[i].tag);
      own.diagonal().segment<3>(row) += used[i].variance;
      for (size_t k = first_shifted; i >= first_shifted && k < used.size(); ++k) {
        own.block<3, 3>(static_cast<Eigen::Index>(3 * k), row).diagonal().array() +=
            kDatumShiftSigma * kDatumShiftSigma;
      }
    }
    const Eigen::LLT<Eigen::MatrixXd> root(own);
    const Eigen::MatrixXd white = root.matrixL().solve(seen), turned = root.matrixL().solve(moved);
    const Eigen::MatrixXd left = motion_ - white.transpose() * turned;
    const Eigen::LDLT<Eigen::MatrixXd> normal(turned.transpose() * turned);
    if (normal.info() != Eigen::Success || !(normal.vectorD().minCoeff() > 0)) return kInfinite;
    const double trace =
        joint_.trace() - white.squaredNorm() + left.transpose().cwiseProduct(normal.solve(left.transpose())).sum();
    return std::sqrt(std::max(0.0, trace) / static_cast<double>(tags_.size()));
  }

  void TryAll(const Set& from, size_t begin, size_t count, Set* chosen, double* rms, Set* best) const {
    if (count == 0) {
      if (const double its = RmsWith(*chosen); its < *rms) *rms = its, *best = *chosen;
      return;
    }
    for (size_t k = begin; k + count <= from.size(); ++k) {
      chosen->push_back(from[k]);
      TryAll(from, k + 1, count - 1, chosen, rms, best);
      chosen->pop_back();
    }
  }

  // Each as far from a line through those before it as any: a start that holds a frame where one can.
  Set FarApart(const Set& from, size_t count) const {
    std::vector<Eigen::Vector3d> there = Places(control_);
    Set set;
    while (set.size() < count) {
      const auto away = [&](Eigen::Index k) {
        const Eigen::Vector3d& at = tags_[static_cast<size_t>(k)]->world_m;
        double least = std::numeric_limits<double>::max();
        for (size_t i = 0; i < there.size(); ++i) {
          if (there.size() == 1) least = (at - there[0]).norm();
          for (size_t j = 0; j < i; ++j) least = std::min(least, (there[i] - at).cross(there[j] - at).norm());
        }
        return std::find(set.begin(), set.end(), k) == set.end() ? least : -1;
      };
      set.push_back(*std::max_element(from.begin(), from.end(), [&](auto a, auto b) { return away(a) < away(b); }));
      there.push_back(tags_[static_cast<size_t>(set.back())]->world_m);
    }
    return set;
  }

  const Eigen::MatrixXd& joint_;
  Eigen::Vector3d variance_;
  std::vector<const TagPrediction*> tags_;
  Eigen::MatrixXd motion_;  // of the tags by a rigid motion: rotation, translation
  std::vector<Observed> control_, geotags_;
  Set candidates_;
};

}  // namespace

ControlSuggestion SuggestControl(const NetworkPrediction& free, const std::vector<SurveyPoint>& known, int count,
                                 double sigma_h_m, double sigma_v_m) {
  const ControlChooser chooser(free, known, sigma_h_m, sigma_v_m);
  ControlSuggestion suggestion;
  ControlChooser::Set order, pool = chooser.candidates();
  suggestion.rms_before_m = suggestion.rms_after_m = suggestion.bound_m = chooser.RmsWith({});
  for (const Eigen::Index k : pool) suggestion.each.emplace_back(chooser.TagId(k), chooser.RmsWith({k}));
  constexpr size_t kFrame = 3;  // points that hold a frame
  while (!std::isfinite(chooser.RmsWith(order))) {
    if (++suggestion.needed > std::min(kFrame, pool.size())) {
      suggestion.reachable = false;
      return suggestion;
    }
    order = chooser.Best(pool, suggestion.needed, &suggestion.exact);
  }
  const size_t wanted = std::min(std::max(static_cast<size_t>(std::max(0, count)), suggestion.needed), pool.size());
  suggestion.exact = Choices(pool.size(), wanted) <= kMostTried;
  if (suggestion.exact) {
    pool = chooser.Best(pool, wanted, &suggestion.exact);
    bool all_tried = false;
    order = chooser.Best(pool, suggestion.needed, &all_tried);
  }
  while (order.size() < wanted) {
    double best = kInfinite;
    ControlChooser::Set next = order;
    for (const Eigen::Index k : pool) {
      if (std::find(order.begin(), order.end(), k) != order.end()) continue;
      ControlChooser::Set with = order;
      with.push_back(k);
      const double rms = chooser.RmsWith(with);
      if (rms < best || next.size() == order.size()) best = rms, next = with;
    }
    order = next;
  }
  for (size_t k = 0; k < order.size(); ++k) {
    suggestion.tag_ids.push_back(chooser.TagId(order[k]));
    suggestion.rms_steps_m.push_back(
        chooser.RmsWith({order.begin(), order.begin() + static_cast<std::ptrdiff_t>(k) + 1}));
  }
  if (!order.empty()) suggestion.rms_after_m = suggestion.rms_steps_m.back();
  suggestion.bound_m = suggestion.exact ? suggestion.rms_after_m : chooser.Bound();
  return suggestion;
}

}  // namespace trigpoint
