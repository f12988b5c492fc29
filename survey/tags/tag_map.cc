#include "survey/tags/tag_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/base/union_find.h"
#include "calib/geo/geodetic.h"
#include "survey/tags/control.h"
#include "survey/tags/conventions.h"
#include "survey/tags/map_solver.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

constexpr double kHuberChi2 = 15.5;               // 95 % of chi-square with 8 degrees of freedom
constexpr double kGeotagChi2 = 7.8;               // 95 %, 3 degrees of freedom
constexpr double kOdometryChi2 = 12.6;            // 95 %, 6 degrees of freedom
constexpr double kMarkChi2 = 5.99;                // 95 %, 2 degrees of freedom
constexpr double kDistanceChi2 = 10.8;            // 99.9 %, 1 degree of freedom
constexpr double kLeastRedundancy = 20;           // observations to spare before a variance component is believed
constexpr double kFarthest_m = 1e5;               // from the known points: no site is as large
constexpr double kDatumShiftSigma = 10;           // m: geotags against control before anything is known
constexpr double kGpsCorrelation_s = 60;          // fixes within this time share their error
constexpr double kHeldM = 1e-5, kHeldRad = 1e-7;  // what a gauge holds
constexpr double kSlip = 30;                      // factor on the sigma of a step that jumped
// Gates of the first rounds; a sight within one is not rejected yet.
constexpr std::array<double, 4> kWideGatePx = {60, 60, 20, 7};
// Factors on the threshold of the corners' robust loss: a loop that odometry missed is closed by a few pictures, if
// these may pull with their full weight at first.
constexpr std::array<double, 4> kWideLoss = {4000, 200, 20, 1};
constexpr double kOutvoted = 20;  // times the median chi-square of its visit: a picture that is wrong by itself
constexpr int kExtraRounds = 3, kMostTagRounds = 8;
// Self-calibration: how far a camera may be from what is stated, 1 sigma.
constexpr double kFocalSigma = 0.05, kCentreSigma = 0.02, kK1Sigma = 0.1, kK2Sigma = 0.3;

class CameraPriorCost final : public ceres::SizedCostFunction<5, 5> {
 public:
  explicit CameraPriorCost(const std::array<double, 5>& sigma) : sigma_(sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    for (size_t k = 0; k < 5; ++k) residuals[k] = parameters[0][k] / sigma_[k];
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      std::fill(jacobians[0], jacobians[0] + 25, 0.0);
      for (size_t k = 0; k < 5; ++k) jacobians[0][6 * k] = 1 / sigma_[k];
    }
    return true;
  }

 private:
  std::array<double, 5> sigma_;
};

// Where a map fails, the points that it does not fit from the beginning.
std::string FarPoints(const std::vector<std::string>& far_points) {
  if (far_points.empty()) return "";
  return fmt::format("; the pictures have the control points {} elsewhere: check these first",
                     fmt::join(far_points, ", "));
}

}  // namespace

MapSolver::MapSolver(const SurveyInput& input, const SurveyOptions& options, int threads, ProgressSink& progress,
                     const CancelToken& cancel)
    : input_(input),
      options_(options),
      threads_(ResolveThreads(threads)),
      progress_(progress),
      cancel_(cancel),
      odometry_loss_(kOdometryChi2),
      geotag_loss_(kGeotagChi2),
      mark_loss_(kMarkChi2),
      distance_loss_(kDistanceChi2) {}

SurveyResult MapSolver::Run() {
  const auto heed = [&](const std::vector<ConventionFinding>& findings) {
    for (const ConventionFinding& f : findings) {
      if (f.refuse && options_.check_conventions) throw InputError(f.text);
      Warn(f.text);
    }
  };
  heed(CheckInput(input_));
  start_ = CollectSights(input_, options_);
  if (start_.sights.empty())
    throw InputError("no run shows a tag of tags.yaml: there is nothing to survey; check its family and its tags");
  heed(CheckSights(input_, start_));
  moved_ = SplitDuplicates(input_, &start_);
  for (const SplitPlace& split : moved_) duplicates_.insert(split.tag_id);
  ChooseDatum();
  progress_.Begin("starting values of the tag map", 0);
  FindStart(input_, datum_points_, threads_, cancel_, &start_);
  for (const std::string& warning : start_.warnings) Warn(warning);
  heed(CheckPoints(input_, start_, datum_points_));
  DropDatumWithoutFrame();
  result_.in_world = start_.in_world || (input_.fixed && input_.fixed_in_world);
  LoadState();
  progress_.Begin("tag map", 0);
  // Each round: solve, reject what contradicts, weigh the groups by their own residuals. The last solve has the final
  // weights.
  int rounds = options_.variance_rounds;
  for (int round = 0;; ++round) {
    huber_ = std::make_unique<HuberChi2Loss>(kHuberChi2 *
                                             kWideLoss[std::min(static_cast<size_t>(round), kWideLoss.size() - 1)]);
    const SparseLeastSquares::Summary summary = Solve(true);
    if (round == 0) result_.cost_before = summary.cost_before;
    ReturnControl();
    result_.cost_after = summary.cost_after;
    const bool last = round >= rounds;
    const bool may_reject = round < rounds + kExtraRounds;
    // Wrong distances first: a wrong one bends the map, and correct tags would be rejected in its place.
    const bool distances = may_reject && round > 0 && SnoopDistances();
    const bool tags = may_reject && round > 0 && !distances && SnoopTags();
    const bool sights = may_reject && !tags && !distances && SnoopSights(round);
    const bool odometry = may_reject && round > 0 && !tags && !distances && !outvoted_ && SnoopOdometry();
    const bool points = may_reject && round > 0 && !tags && !distances && !sights && !odometry && SnoopControl();
    const bool rejected = tags || distances || sights || odometry || points;
    const bool moves = last && may_reject && !rejected && ReplaceSlips();
    // The weights were widened by a tag that had moved: they are estimated again.
    if (tags || distances || moves) rounds = std::min(round + 3, options_.variance_rounds + kMostTagRounds);
    if (last && !rejected && !moves) break;
    if (!last) UpdateFactors();
  }
  for (int f : unlinked_frames_) start_.frames[static_cast<size_t>(f)].world_from_body.reset();
  RequireCredible();
  Collect();
  return std::move(result_);
}

// Points that do not hold a frame are no datum: the map keeps that of its first camera.
void MapSolver::DropDatumWithoutFrame() {
  if (input_.fixed || start_.in_world) return;
  if (!datum_points_.empty()) {
    const std::string problem = "expected three known points that are not on one line, found fewer";
    if (!input_.use_control || !input_.use_geotags) {  // one of them was asked for
      throw InputError("datum " + result_.datum + ": " + problem + "; give more of them, or another datum");
    }
    Warn(problem + ": the map is not georeferenced; survey more points, or choose another datum");
  }
  const auto has_gps = [](const SurveyRun& run) { return !run.gps.empty(); };
  if (datum_points_.empty() && input_.use_gps && std::any_of(input_.runs.begin(), input_.runs.end(), has_gps)) {
    const std::string problem = "expected GPS fixes that are not on one line";
    if (!input_.use_control && !input_.use_geotags) throw InputError("datum gps: " + problem);
    Warn(problem + ": the map is not georeferenced; survey more points, or choose another datum");
  }
  datum_points_.clear();
  use_shift_ = false;
  result_.datum = "first camera";
}

// Throws if a tag lies farther than kFarthest_m from the site: such a map is wrong, however small its residuals.
void MapSolver::RequireCredible() const {
  // A surveyor's grid may begin far away.
  Eigen::Vector3d site = Eigen::Vector3d::Zero();
  for (const SurveyPoint& p : datum_points_) site += p.world_m / static_cast<double>(datum_points_.size());
  if (input_.fixed) site = input_.fixed->world_from_tag.translation;
  for (const auto& [place, pose] : tags_) {
    if (tag_unknown_.count(place) == 0 || (pose.IsFinite() && (pose.translation - site).norm() < kFarthest_m)) continue;
    throw NumericError(fmt::format(
        "the tag map did not converge: tag {} is {:.3g} m from the site. Odometry, tag sizes and surveyed points "
        "contradict each other: check the axes and order of odometry.tum (x y z qx qy qz qw; body x forward, y left, "
        "z up, as in T_cam_imu of camchain.yaml), tags.yaml and control_points.csv{}",
        IdOf(place), (pose.translation - site).norm(), FarPoints(far_at_start_)));
  }
}

// By a picture, and at one place.
bool MapSolver::IsSeen(const SurveyPoint& p) const {
  if (p.tag_id < 0) return true;
  return duplicates_.count(p.tag_id) == 0 && std::any_of(start_.sights.begin(), start_.sights.end(),
                                                         [&](const MapSight& s) { return s.detection.id == p.tag_id; });
}

void MapSolver::ChooseDatum() {
  std::vector<SurveyPoint> control, geotags;
  std::vector<Eigen::Vector3d> places;
  for (const SurveyPoint& p : input_.points) {
    if (!IsSeen(p)) {
      if (p.role != PointRole::kGeotag) {
        const char* why =
            duplicates_.count(p.tag_id) > 0 ? "its tag's id is seen at several places" : "no picture shows its tag";
        result_.warnings.push_back(
            {fmt::format("{} point {}: {}; it takes no part", RoleName(p.role), p.name, why), -1, p.name});
      }
      continue;
    }
    if (p.role == PointRole::kControl && input_.use_control) control.push_back(p), places.push_back(p.world_m);
    if (p.role == PointRole::kGeotag && input_.use_geotags) geotags.push_back(p);
  }
  if (input_.fixed) {
    result_.datum = "tag " + std::to_string(input_.fixed->tag_id);
  } else if (AreWellSpread(places) || geotags.empty()) {
    datum_points_ = control;
    result_.datum = control.empty() && input_.use_gps ? "gps" : "control";
  } else {
    datum_points_ = geotags;
    datum_points_.insert(datum_points_.end(), control.begin(), control.end());
    use_shift_ = !control.empty();
    result_.datum = control.empty() ? "geotags" : "control and geotags";
  }
}

void MapSolver::LoadState() {
  tags_ = start_.world_from_tag;
  marked_ = start_.marked;
  if (input_.fixed) tags_[input_.fixed->tag_id] = input_.fixed->world_from_tag;
  run_states_.resize(input_.runs.size());
  for (size_t r = 0; r < input_.runs.size(); ++r) {
    const SurveyRun& run = input_.runs[r];
    run_states_[r].shift.assign(run.cameras.size(), 0);
    run_states_[r].camera_change.assign(run.cameras.size(), {});
    for (const BodyCamera& camera : run.cameras) run_states_[r].cameras.push_back(camera.camera);
    tie_losses_.push_back(std::make_unique<HuberChi2Loss>(run.tie_loss_chi2));
    // Tie points follow their run into the map.
    Rigid3d map_from_run;
    for (const MapFrame& frame : start_.frames) {
      if (frame.run != static_cast<int>(r) || !frame.world_from_body) continue;
      if (const auto start = run.start.At(frame.stamp_ns, 0)) {
        map_from_run = *frame.world_from_body * start->Inverse();
        break;
      }
    }
    run_states_[r].first_point = {tie_points_.size(), tie_points_.size() + run.tie_points.size()};
    for (const Eigen::Vector3d& p : run.tie_points) tie_points_.push_back(map_from_run * p);
  }
  std::vector<int> lost(input_.runs.size());
  for (const MapFrame& frame : start_.frames) lost[static_cast<size_t>(frame.run)] += frame.world_from_body ? 0 : 1;
  for (size_t r = 0; r < lost.size(); ++r) {
    if (lost[r] == 0) continue;
    Warn(fmt::format("{}: {} left out: odometry does not cover {}, and tags do not place {}", input_.runs[r].name,
                     Counted(lost[r], "picture"), lost[r] == 1 ? "it" : "them", lost[r] == 1 ? "it" : "them"));
  }
  PlaceSplit();
  SplitElsewhere();
  GateControl();
  GateStart();
}

void MapSolver::Warn(const std::string& text) {
  const auto same = [&](const MapWarning& w) { return w.text == text; };
  if (std::none_of(result_.warnings.begin(), result_.warnings.end(), same)) result_.warnings.push_back({text, -1, ""});
}

int MapSolver::IdOf(int place) const { return place >= 0 ? place : moved_[static_cast<size_t>(-1 - place)].tag_id; }

double MapSolver::SizeOf(int place) const {
  const auto found = sizes_found_.find(place);
  const double single = found == sizes_found_.end() ? 0 : found->second.log_ratio;
  return input_.sizes.SizeOf(IdOf(place)) * std::exp(common_log_size_ + single);
}

bool MapSolver::Usable(const MapSight& s) const {
  return !s.rejected && Placed(s.frame) && tags_.count(s.place) > 0 && unlinked_tags_.count(s.place) == 0 &&
         unlinked_frames_.count(s.frame) == 0;
}

// Frames and tags that sights, odometry and scene points tie to the largest part of the map; the others wait outside.
void MapSolver::FindLinked() {
  unlinked_frames_.clear();
  unlinked_tags_.clear();
  UnionFind parts(static_cast<int>(start_.frames.size()));
  std::map<int, int> tag_frame, sights;
  std::vector<int> last_odometry(input_.runs.size(), -1), last_tied(input_.runs.size(), -1);
  for (size_t f = 0; f < start_.frames.size(); ++f) {
    const MapFrame& frame = start_.frames[f];
    if (!frame.world_from_body) continue;
    const auto r = static_cast<size_t>(frame.run);
    const int index = static_cast<int>(f);
    if (frame.odom_from_body) {
      if (last_odometry[r] >= 0) parts.Join(index, last_odometry[r]);
      last_odometry[r] = index;
    }
    if (frame.has_ties) {
      if (last_tied[r] >= 0) parts.Join(index, last_tied[r]);
      last_tied[r] = index;
    }
  }
  for (const MapSight& s : start_.sights) {
    if (!Usable(s)) continue;
    const auto [it, fresh] = tag_frame.try_emplace(s.place, s.frame);
    if (!fresh) parts.Join(s.frame, it->second);
  }
  for (const MapSight& s : start_.sights) {
    if (Usable(s)) ++sights[parts.Root(s.frame)];
  }
  const auto most =
      std::max_element(sights.begin(), sights.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == sights.end())
    throw InputError(
        "no tag map: expected a usable picture of a tag, found none; the warnings list why each is left out");
  for (size_t f = 0; f < start_.frames.size(); ++f) {
    if (parts.Root(static_cast<int>(f)) != most->first) unlinked_frames_.insert(static_cast<int>(f));
  }
  for (const auto& [id, frame] : tag_frame) {
    if (parts.Root(frame) != most->first) unlinked_tags_.insert(id);
  }
}

Eigen::Vector3d MapSolver::Lever(const SurveyPoint& p) const {
  return p.corner < 0 ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : TagCorner(SizeOf(p.tag_id), p.corner);
}

void MapSolver::Add(Kind kind, int index, ceres::CostFunction* cost, const ceres::LossFunction* loss,
                    const std::vector<int>& unknowns) {
  solver_.AddFactor(cost, loss, unknowns);
  observations_.push_back({kind, index});
}

void MapSolver::Build() {
  FindLinked();
  solver_ = SparseLeastSquares();
  observations_.clear();
  tag_unknown_.clear();
  mark_unknown_.clear();
  shift_unknown_ = -1;
  frame_unknown_.assign(start_.frames.size(), -1);
  for (size_t f = 0; f < start_.frames.size(); ++f) {
    if (start_.frames[f].world_from_body && unlinked_frames_.count(static_cast<int>(f)) == 0) {
      frame_unknown_[f] = solver_.AddPose(*start_.frames[f].world_from_body);
    }
  }
  for (const auto& [id, pose] : tags_) {
    if (unlinked_tags_.count(id) == 0) tag_unknown_[id] = solver_.AddPose(pose);
  }
  AddRuns();
  AddSights();
  AddTies();
  AddOdometry();
  AddPoints();
  AddGauge();
}

// What the runs' odometry and cameras have for unknowns, and what is known of them.
void MapSolver::AddRuns() {
  for (RunState& state : run_states_) {
    state.scale_unknown = solver_.AddNumbers({state.scale});
    state.drift_unknown = solver_.AddNumbers({state.drift});
    state.shift_unknown.clear();
    for (double shift : state.shift) {
      const int u = solver_.AddNumbers({shift});
      state.shift_unknown.push_back(u);
      if (options_.corner_shift_px > 0) {
        Add(Kind::kOther, 0, new NumberCost(0, options_.corner_shift_px), nullptr, {u});
      } else {
        solver_.unknowns[static_cast<size_t>(u)].constant = true;
      }
    }
    state.camera_unknown.clear();
    for (size_t c = 0; options_.self_calibrate && c < state.cameras.size(); ++c) {
      const std::array<double, 5>& change = state.camera_change[c];
      const int u = solver_.AddNumbers({change.begin(), change.end()});
      state.camera_unknown.push_back(u);
      const double width = state.cameras[c].width();
      const std::array<double, 5> sigma = {kFocalSigma, kCentreSigma * width, kCentreSigma * width, kK1Sigma, kK2Sigma};
      Add(Kind::kOther, 0, new CameraPriorCost(sigma), nullptr, {u});
    }
  }
}

void MapSolver::AddSights() {
  for (size_t i = 0; i < start_.sights.size(); ++i) {
    const MapSight& s = start_.sights[i];
    if (!Usable(s)) continue;
    const auto run = static_cast<size_t>(start_.frames[static_cast<size_t>(s.frame)].run);
    const auto camera = static_cast<size_t>(s.camera);
    const RunState& state = run_states_[run];
    const Rigid3d& cam_from_body = input_.runs[run].cameras[camera].cam_from_body;
    ceres::CostFunction* cost = nullptr;
    if (options_.self_calibrate) {
      cost = new TagPixelCost(state.cameras[camera], s.detection, s.sight.sigma_px, SizeOf(s.place), cam_from_body,
                              &state.corner);
    } else {
      cost = new TagCost(s.sight, SizeOf(s.place), cam_from_body, &state.corner);
    }
    const int of_camera = (options_.self_calibrate ? state.camera_unknown : state.shift_unknown)[camera];
    Add(Kind::kTag, static_cast<int>(i), cost, huber_.get(),
        {frame_unknown_[static_cast<size_t>(s.frame)], tag_unknown_.at(s.place), of_camera});
  }
}

void MapSolver::AddTies() {
  std::vector<int> first_view;
  for (size_t r = 0; r < input_.runs.size(); ++r) {
    first_view.push_back(static_cast<int>(solver_.views.size()));
    for (const BodyCamera& camera : input_.runs[r].cameras) {
      solver_.views.push_back({camera.cam_from_body, tie_losses_[r].get()});
    }
  }
  solver_.points = tie_points_;
  for (size_t r = 0; r < input_.runs.size(); ++r) {
    int64_t stamp = std::numeric_limits<int64_t>::min();
    int frame = -1;
    for (const SurveyTie& tie : input_.runs[r].ties) {
      if (tie.stamp_ns != stamp) stamp = tie.stamp_ns, frame = FrameAt(start_, static_cast<int>(r), stamp);
      if (frame < 0 || frame_unknown_[static_cast<size_t>(frame)] < 0) continue;
      solver_.observations.push_back({static_cast<int>(run_states_[r].first_point[0]) + tie.point,
                                      frame_unknown_[static_cast<size_t>(frame)], first_view[r] + tie.camera, tie.w});
    }
  }
}

void MapSolver::AddOdometry() {
  std::vector<bool> has_odometry(run_states_.size(), false);
  int before = -1;
  for (size_t f = 0; f < start_.frames.size(); ++f) {
    const MapFrame& frame = start_.frames[f];
    if (!frame.odom_from_body || frame_unknown_[f] < 0) continue;
    const auto r = static_cast<size_t>(frame.run);
    if (before >= 0 && start_.frames[static_cast<size_t>(before)].run == frame.run) {
      const MapFrame& last = start_.frames[static_cast<size_t>(before)];
      const Rigid3d a_from_b = last.odom_from_body->Inverse() * *frame.odom_from_body;
      const double seconds = 1e-9 * static_cast<double>(frame.stamp_ns - last.stamp_ns);
      const double length = a_from_b.translation.norm();
      Vector6d sigma = OdometryStepSigma(length, seconds, options_.odometry_rot_deg, options_.odometry_m);
      const Eigen::Vector3d way = length * (frame.odom_from_body->rotation.conjugate() * Eigen::Vector3d::UnitZ());
      RunState& state = run_states_[r];
      const int index = static_cast<int>(f);
      if (slipped_.count(index) > 0) sigma *= kSlip;
      Add(Kind::kOdometry, index, new OdometryCost(a_from_b, way, sigma, state.odometry.data()), &odometry_loss_,
          {frame_unknown_[static_cast<size_t>(before)], frame_unknown_[f], state.scale_unknown, state.drift_unknown});
      has_odometry[r] = true;
    }
    before = static_cast<int>(f);
  }
  for (size_t r = 0; r < run_states_.size(); ++r) {
    if (!has_odometry[r]) continue;
    const double scale_sigma = std::max(1e-6, input_.runs[r].scale_sigma);
    ceres::CostFunction* scale = nullptr;
    if (input_.runs[r].stills) {
      scale = new FactorCost(scale_sigma);  // a rig's size is known to a factor
    } else {
      scale = new NumberCost(1, scale_sigma);
    }
    Add(Kind::kOther, 0, scale, nullptr, {run_states_[r].scale_unknown});
    Add(Kind::kOther, 0, new NumberCost(0, std::max(1e-9, options_.heading_drift_deg_m * kDegToRad)), nullptr,
        {run_states_[r].drift_unknown});
  }
}

void MapSolver::AddPoints() {
  if (use_shift_) {
    shift_unknown_ = solver_.AddNumbers({shift_.x(), shift_.y(), shift_.z()});
    Add(Kind::kOther, 0, new KnownPointCost(Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(kDatumShiftSigma)),
        nullptr, {shift_unknown_});
  }
  for (const SurveyPoint& p : input_.points) {
    if (p.marks.empty() || marked_.count(p.name) == 0) continue;
    const Eigen::Vector3d& at = marked_.at(p.name);
    const int u = solver_.AddNumbers({at.x(), at.y(), at.z()});
    mark_unknown_[p.name] = u;
    for (const SurveyMark& m : p.marks) {
      const int f = FrameAt(start_, m.run, m.stamp_ns);
      if (f < 0 || frame_unknown_[static_cast<size_t>(f)] < 0) continue;
      const BodyCamera& camera = input_.runs[static_cast<size_t>(m.run)].cameras[static_cast<size_t>(m.camera)];
      Add(Kind::kMark, 0, new MarkCost(camera.camera.BearingSqrtInfo(m.pixel, m.sigma_px), camera.cam_from_body),
          &mark_loss_, {frame_unknown_[static_cast<size_t>(f)], u});
    }
  }
  for (size_t i = 0; i < datum_points_.size(); ++i) {
    const SurveyPoint& p = datum_points_[i];
    if (Excluded(p) || p.start_only) continue;
    const Eigen::Vector3d sigma(p.sigma_h_m, p.sigma_h_m, p.sigma_v_m);
    const int index = static_cast<int>(i);
    if (p.tag_id < 0) {
      const auto mark = mark_unknown_.find(p.name);
      if (mark != mark_unknown_.end()) {
        Add(Kind::kPoint, index, new KnownPointCost(p.world_m, sigma), nullptr, {mark->second});
      }
      continue;
    }
    const auto tag = tag_unknown_.find(p.tag_id);
    if (tag == tag_unknown_.end()) continue;
    const Eigen::Vector3d offset = OffsetInWorld(p, tags_.at(p.tag_id));
    if (p.role == PointRole::kGeotag && use_shift_) {
      Add(Kind::kPoint, index, new ShiftedPointCost(Lever(p), offset, p.world_m, sigma), &geotag_loss_,
          {tag->second, shift_unknown_});
    } else {
      Add(Kind::kPoint, index, new PointCost(Lever(p), offset, p.world_m, sigma),
          p.role == PointRole::kGeotag ? &geotag_loss_ : nullptr, {tag->second});
    }
  }
  for (size_t i = 0; i < input_.distances.size(); ++i) {
    const SurveyDistance& d = input_.distances[i];
    const auto a = tag_unknown_.find(d.from), b = tag_unknown_.find(d.to);
    if (d.check || wrong_distances_.count(static_cast<int>(i)) > 0 || a == tag_unknown_.end() ||
        b == tag_unknown_.end() || d.from == d.to)
      continue;
    Add(Kind::kDistance, static_cast<int>(i), new DistanceCost(d.distance_m, d.sigma_m), &distance_loss_,
        {a->second, b->second});
  }
  AddFixes();
  AddStations();
}

// A receiver's errors are correlated over kGpsCorrelation_s: the fixes within that time together count as one.
void MapSolver::AddFixes() {
  if (!result_.in_world) return;
  size_t all = 0;
  for (const SurveyRun& run : input_.runs) all += run.gps.size();
  const double once = std::sqrt(static_cast<double>(all));  // heights above the sea share one error
  for (size_t r = 0; input_.use_gps && r < input_.runs.size(); ++r) {
    const std::vector<SurveyFix>& fixes = input_.runs[r].gps;
    if (fixes.empty()) continue;
    const double span = 1e-9 * static_cast<double>(fixes.back().stamp_ns - fixes.front().stamp_ns);
    const double independent = std::max(1.0, span / kGpsCorrelation_s);
    const double widen = std::sqrt(std::max(1.0, static_cast<double>(fixes.size()) / independent));
    for (const SurveyFix& fix : fixes) {
      const int f = FrameAt(start_, static_cast<int>(r), fix.stamp_ns);
      if (f < 0 || frame_unknown_[static_cast<size_t>(f)] < 0) continue;
      Add(Kind::kFix, 0,
          new PointCost(
              fix.arm_m, Eigen::Vector3d::Zero(), fix.world_m,
              {widen * fix.sigma_h_m, widen * fix.sigma_h_m, (fix.sigma_sea_m > 0 ? once : widen) * fix.sigma_v_m}),
          &geotag_loss_, {frame_unknown_[static_cast<size_t>(f)]});
    }
  }
}

// Set-ups, their orientations and points that are no tags of the map are unknowns; tags that are read are the map's
// own.
void MapSolver::AddStations() {
  station_readings_.clear();
  if (!input_.stations || !result_.in_world || !input_.use_control) return;
  const SurveyStations& stations = *input_.stations;
  std::map<std::string, int> points;
  for (const NetworkPoint& p : stations.network.points) {
    const auto tag = TagOfTarget(p.name);
    if (tag && tag_unknown_.count(tag->first) > 0) continue;
    points[p.name] = solver_.AddNumbers({p.position.x(), p.position.y(), p.position.z()});
  }
  for (const NetworkPoint& p : stations.known) {
    const auto at = points.find(p.name);
    if (at == points.end()) continue;
    Add(Kind::kOther, 0, new KnownPointCost(p.position, {p.sigma_h_m, p.sigma_h_m, p.sigma_v_m}), nullptr,
        {at->second});
  }
  std::map<std::string, std::pair<int, int>> setups;  // instrument, orientation
  for (const StationSetup& setup : stations.network.setups) {
    const Eigen::Vector3d& at = setup.instrument;
    const int instrument = solver_.AddNumbers({at.x(), at.y(), at.z()});
    setups[setup.name] = {instrument, solver_.AddNumbers({setup.orientation_rad})};
    const auto below = points.find(setup.name);
    if (setup.height_m && below != points.end()) {
      Add(Kind::kOther, 0, new AboveCost(*setup.height_m, stations.level_from_world), nullptr,
          {below->second, instrument});
    }
  }
  for (const NetworkResidual& reading : stations.network.residuals) {
    if (reading.excluded) continue;
    const StationSighting& s = stations.sightings[reading.sighting];
    const auto& [instrument, orientation] = setups.at(s.setup);
    const auto [observed, sigma] = ReadingOf(s, reading.reading);
    std::vector<int> unknowns = {instrument};
    std::optional<Eigen::Vector3d> lever;
    if (const auto point = points.find(s.target); point != points.end()) {
      unknowns.push_back(point->second);
    } else {
      const auto tag = *TagOfTarget(s.target);
      lever = tag.second < 0 ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : TagCorner(SizeOf(tag.first), tag.second);
      unknowns.push_back(tag_unknown_.at(tag.first));
    }
    if (reading.reading == StationReading::kDirection) unknowns.push_back(orientation);
    Add(Kind::kStation, static_cast<int>(station_readings_.size()),
        new StationCost(reading.reading, observed, sigma, lever, s.target_height_m, stations.level_from_world), nullptr,
        unknowns);
    station_readings_.emplace_back(reading.sighting, reading.reading);
  }
}

// Heights of the plane's tags that are in the map; how many. `alone`: nothing else holds the tilt, so they must.
int MapSolver::AddPlane(bool alone) {
  std::vector<Eigen::Vector3d> centres;
  for (int id : input_.level_tags) {
    const auto tag = tag_unknown_.find(id);
    if (tag == tag_unknown_.end()) continue;
    Add(Kind::kOther, 0, new HeightCost(0, input_.level_sigma_m), nullptr, {tag->second});
    centres.push_back(tags_.at(id).translation);
  }
  if (alone && !input_.level_tags.empty() && !HoldAFrame(centres)) {
    const std::string tags = fmt::format("option plane_tags ({})", fmt::join(input_.level_tags, " "));
    if (centres.size() < 3) {
      throw InputError(
          fmt::format("{}: expected three of these tags or more in the map, found {}, as pictures do not "
                      "tie the others to it; name other tags, or use another datum",
                      tags, centres.size()));
    }
    throw InputError(tags +
                     ": these tags lie on one line, about which the map can turn; expected a tag beside that line: "
                     "name one, or use another datum");
  }
  return static_cast<int>(centres.size());
}

void MapSolver::AddGauge() {
  const bool free_frame = !input_.fixed && datum_points_.empty() && !result_.in_world;
  bool gravity = false;
  if (input_.use_gravity) {
    for (size_t r = 0; r < input_.runs.size(); ++r) {
      if (!input_.runs[r].levelled) continue;
      int frames = 0;
      for (const MapFrame& f : start_.frames) frames += f.run == static_cast<int>(r) && f.odom_from_body ? 1 : 0;
      for (size_t f = 0; f < start_.frames.size(); ++f) {
        const MapFrame& frame = start_.frames[f];
        if (frame.run != static_cast<int>(r) || !frame.odom_from_body || frame_unknown_[f] < 0) continue;
        // The level's error is common to the run: all its frames count as one.
        Add(Kind::kOther, 0,
            new GravityCost(frame.odom_from_body->rotation.conjugate() * Eigen::Vector3d::UnitZ(),
                            options_.gravity_deg * kDegToRad * std::sqrt(static_cast<double>(frames))),
            nullptr, {frame_unknown_[f]});
        gravity = true;
      }
    }
  }
  const int level = AddPlane(free_frame && !gravity);
  if (input_.fixed) {
    if (tag_unknown_.count(input_.fixed->tag_id) == 0) {
      throw InputError(fmt::format(
          "tag {}: expected in the map, because the datum holds it; no picture shows it together with other tags",
          input_.fixed->tag_id));
    }
    const int tag = tag_unknown_.at(input_.fixed->tag_id);
    solver_.unknowns[static_cast<size_t>(tag)].constant = true;
    result_.gauge = fmt::format("the pose of tag {}, held exactly", input_.fixed->tag_id);
  } else if (!free_frame) {
    result_.gauge = "all six from " + result_.datum + ", weighted by stated sigmas";
  } else {
    const double free = std::numeric_limits<double>::infinity();
    Vector6d sigma;
    sigma << Eigen::Vector3d::Constant(kHeldRad), Eigen::Vector3d::Constant(kHeldM);
    result_.gauge = "the first camera's body: position and attitude, held";
    if (level >= 3) {
      sigma(0) = sigma(1) = sigma(5) = free;
      result_.gauge = fmt::format(
          "the first camera's body: horizontal position and heading; tilt and height from the plane of {} tags", level);
      result_.datum = "plane";
    } else if (gravity) {
      sigma(0) = sigma(1) = free;
      result_.gauge = "the first camera's body: position and heading; tilt from gravity";
      result_.datum = "gravity";
    }
    for (size_t f = 0; f < start_.frames.size(); ++f) {
      if (frame_unknown_[f] < 0) continue;
      Add(Kind::kOther, 0, new PosePriorCost(*start_.frames[f].world_from_body, sigma), nullptr, {frame_unknown_[f]});
      break;
    }
  }
}

// Solves from the present state and stores the result; `linearise`: prepares the covariances there.
SparseLeastSquares::Summary MapSolver::Solve(bool linearise) {
  Build();
  SparseLeastSquares::Summary summary;
  try {
    summary = solver_.Solve(options_.max_iterations, threads_, progress_, cancel_);
    if (linearise) solver_.Linearise(threads_, cancel_, true);
  } catch (const NumericError& e) {
    throw NumericError(fmt::format("{}{}", e.what(), FarPoints(far_at_start_)));
  }
  result_.iterations += summary.iterations;
  StoreState();
  return summary;
}

void MapSolver::StoreState() {
  for (size_t f = 0; f < start_.frames.size(); ++f) {
    if (frame_unknown_[f] >= 0) start_.frames[f].world_from_body = solver_.Pose(frame_unknown_[f]);
  }
  const auto number = [&](int u, int k = 0) {
    return solver_.unknowns[static_cast<size_t>(u)].value[static_cast<size_t>(k)];
  };
  for (const auto& [id, unknown] : tag_unknown_) tags_[id] = solver_.Pose(unknown);
  for (auto& [name, point] : marked_) {
    const auto u = mark_unknown_.find(name);
    if (u != mark_unknown_.end()) point = {number(u->second), number(u->second, 1), number(u->second, 2)};
  }
  for (RunState& state : run_states_) {
    state.scale = number(state.scale_unknown);
    state.drift = number(state.drift_unknown);
    for (size_t c = 0; c < state.shift.size(); ++c) state.shift[c] = number(state.shift_unknown[c]);
  }
  if (options_.self_calibrate) StoreCameras();
  if (shift_unknown_ >= 0) shift_ = {number(shift_unknown_), number(shift_unknown_, 1), number(shift_unknown_, 2)};
  tie_points_ = solver_.points;
}

// Cameras as estimated, and the rays of their sights.
void MapSolver::StoreCameras() {
  for (size_t r = 0; r < run_states_.size(); ++r) {
    RunState& state = run_states_[r];
    for (size_t c = 0; c < state.cameras.size(); ++c) {
      const SparseLeastSquares::Unknown& u = solver_.unknowns[static_cast<size_t>(state.camera_unknown[c])];
      std::copy(u.value.begin(), u.value.begin() + 5, state.camera_change[c].begin());
      input_.runs[r].cameras[c].camera = AdjustedCamera(state.cameras[c], state.camera_change[c].data());
    }
  }
  for (MapSight& s : start_.sights) {
    const auto run = static_cast<size_t>(start_.frames[static_cast<size_t>(s.frame)].run);
    try {
      s.sight = MakeTagSight(input_.runs[run].cameras[static_cast<size_t>(s.camera)].camera, s.detection,
                             options_.extra_sigma_px);
    } catch (const NumericError&) {
      s.rejected = true;  // beyond the camera's valid angle now
    }
  }
}

// Variance components: for each run's corners and the six axes of its odometry,
// factor^2 = sum of squared residuals / redundancy.
void MapSolver::UpdateFactors() {
  struct Group {
    double square = 0, redundancy = 0;
  };
  std::vector<std::array<Group, 7>> groups(run_states_.size());
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Observation& o = observations_[i];
    if (o.kind != Kind::kTag && o.kind != Kind::kOdometry) continue;
    const int factor = static_cast<int>(i);
    if (o.kind == Kind::kOdometry && slipped_.count(o.index) > 0) continue;
    const int frame = o.kind == Kind::kOdometry ? o.index : start_.sights[static_cast<size_t>(o.index)].frame;
    const int run = start_.frames[static_cast<size_t>(frame)].run;
    const Eigen::MatrixXd absorbed = solver_.Leverage(factor);
    const Eigen::VectorXd residual = solver_.Residual(factor);
    const double weight = solver_.Weight(factor);
    for (Eigen::Index k = 0; k < residual.size(); ++k) {
      Group& g = groups[static_cast<size_t>(run)][o.kind == Kind::kTag ? 0 : static_cast<size_t>(1 + k)];
      g.square += weight * residual[k] * residual[k];
      g.redundancy += weight - absorbed(k, k);
    }
  }
  for (size_t r = 0; r < run_states_.size(); ++r) {
    for (size_t k = 0; k < 7; ++k) {
      const Group& g = groups[r][k];
      if (g.redundancy < kLeastRedundancy) continue;
      double& factor = k == 0 ? run_states_[r].corner : run_states_[r].odometry[static_cast<Eigen::Index>(k - 1)];
      factor *= std::clamp(std::sqrt(g.square / g.redundancy), 0.1, 10.0);
      factor = std::clamp(factor, 1e-3, 1e3);
    }
  }
}

// False: the tag's back is seen.
bool MapSolver::ResidualOf(const MapSight& s, Vector8d* residual) const {
  const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
  const auto run = static_cast<size_t>(frame.run), camera = static_cast<size_t>(s.camera);
  const Rigid3d& cam_from_body = input_.runs[run].cameras[camera].cam_from_body;
  const Rigid3d& tag = tags_.at(s.place);
  if (!TagFaces(s.sight, SizeOf(s.place), cam_from_body * frame.world_from_body->Inverse() * tag)) return false;
  *residual = TagResidual(s.sight, SizeOf(s.place), cam_from_body, *frame.world_from_body, tag) -
              run_states_[run].shift[camera] * s.sight.outward;
  return true;
}

double MapSolver::SightPx(const MapSight& s) const {
  Vector8d r;
  return ResidualOf(s, &r) ? ResidualPx(s.sight, r) : std::numeric_limits<double>::infinity();
}

double MapSolver::SightChi2(const MapSight& s) const {
  Vector8d r;
  if (!ResidualOf(s, &r)) return std::numeric_limits<double>::infinity();
  const auto run = static_cast<size_t>(start_.frames[static_cast<size_t>(s.frame)].run);
  return r.squaredNorm() / (run_states_[run].corner * run_states_[run].corner);
}

// Pictures of tags whose residual is beyond the gate are rejected, rejected ones that fit come back. True if anything
// changed. The gate is wide at first: where odometry has drifted or jumped, the pictures of the next tags are all far
// off although they are right.
bool MapSolver::SnoopSights(int round) {
  std::vector<double> chi2(start_.sights.size(), -1), used;
  const double wide_px = round < std::ssize(kWideGatePx) ? kWideGatePx[static_cast<size_t>(round)] : 0;
  std::map<int, int> of_tag, of_frame;
  for (size_t i = 0; i < chi2.size(); ++i) {
    const MapSight& s = start_.sights[i];
    if (!Placed(s.frame) || tags_.count(s.place) == 0) continue;
    chi2[i] = SightChi2(s);
    if (!s.rejected) used.push_back(chi2[i]);
  }
  if (used.empty()) return false;
  // Before the corners' sigma is known to be right, it is judged by the median (of chi-square 8: 7.344).
  const double gate = options_.snooping_chi2 * std::max(1.0, Median(std::move(used)) / 7.344);
  outvoted_ = false;
  // A picture that the rest of its visit contradicts is wrong by itself, not by odometry's drift, however small the
  // error.
  std::vector<bool> outvoted(chi2.size(), false);
  const auto index = [&](const MapSight* s) { return static_cast<size_t>(s - start_.sights.data()); };
  // Wrong distances are looked for first.
  for (const std::vector<MapSight*>& visit : round > 0 ? Visits() : std::vector<std::vector<MapSight*>>()) {
    if (visit.size() <= kLeastVisit) continue;
    std::vector<double> its;
    for (const MapSight* s : visit) its.push_back(chi2[index(s)]);
    const double middle = Median(std::move(its));
    for (const MapSight* s : visit) outvoted[index(s)] = chi2[index(s)] > kOutvoted * middle;
  }
  const auto beyond = [&](size_t i) { return chi2[i] > gate && (outvoted[i] || SightPx(start_.sights[i]) > wide_px); };
  bool any = false;
  for (size_t i = 0; i < chi2.size(); ++i) {
    if (chi2[i] < 0) continue;
    const MapSight& s = start_.sights[i];
    if (beyond(i)) continue;
    ++of_tag[s.place];
    ++of_frame[s.frame];
  }
  for (size_t i = 0; i < chi2.size(); ++i) {
    if (chi2[i] < 0) continue;
    MapSight& s = start_.sights[i];
    const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
    // A tag or a frame is not left without any observation.
    const bool needed = of_tag[s.place] == 0 || (of_frame[s.frame] == 0 && !frame.odom_from_body && !frame.has_ties);
    const bool rejected = beyond(i) && (!needed || s.rejected);
    any |= rejected != s.rejected;
    outvoted_ |= rejected && !s.rejected && outvoted[i];
    s.rejected = rejected;
  }
  return any;
}

// The control point that contradicts the others most: its index and its chi-square as an extra parameter. Nothing where
// too few are left to tell which is wrong; `may_leave`: of points without which the rest still holds the map.
std::optional<std::pair<int, double>> MapSolver::WorstControl(bool may_leave) const {
  std::vector<Eigen::Vector3d> used;
  for (const SurveyPoint& p : datum_points_) {
    if (p.role == PointRole::kControl && !Excluded(p)) used.push_back(p.world_m);
  }
  if (used.size() < 4) return std::nullopt;  // of three points the wrong one cannot be found
  std::optional<std::pair<int, double>> worst;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Observation& o = observations_[i];
    if (o.kind != Kind::kPoint || datum_points_[static_cast<size_t>(o.index)].role != PointRole::kControl) continue;
    const int factor = static_cast<int>(i);
    const Eigen::MatrixXd cofactor = Eigen::Matrix3d::Identity() * 1.0001 - solver_.Leverage(factor);
    const Eigen::VectorXd r = solver_.Residual(factor);
    const double chi2 = r.dot(cofactor.inverse() * r);
    if (worst && chi2 <= worst->second) continue;
    std::vector<Eigen::Vector3d> left;
    for (const Eigen::Vector3d& p : used) {
      if (p != datum_points_[static_cast<size_t>(o.index)].world_m) left.push_back(p);
    }
    if (!may_leave || AreWellSpread(left)) worst = {o.index, chi2};
  }
  return worst;
}

// Takes the control point out that contradicts the others most, if enough remain without it.
bool MapSolver::SnoopControl() {
  const auto worst = WorstControl(true);
  if (!worst || worst->second <= kPointChi2) return false;
  excluded_.insert(datum_points_[static_cast<size_t>(worst->first)].name);
  return true;
}

// Takes the measured distance out that contradicts the rest most. A distance that nothing else controls is kept.
bool MapSolver::SnoopDistances() {
  int worst = -1;
  double most = kDistanceChi2;
  for (size_t i = 0; i < observations_.size(); ++i) {
    if (observations_[i].kind != Kind::kDistance) continue;
    const int factor = static_cast<int>(i);
    const double r = solver_.Residual(factor)[0], left = 1.0001 - solver_.Leverage(factor)(0, 0);
    if (r * r / left > most) most = r * r / left, worst = observations_[i].index;
  }
  if (worst < 0) return false;
  // A jump of odometry has six numbers to explain the same with.
  for (size_t r = 0; r < input_.runs.size(); ++r) {
    if (most / kDistanceChi2 < SlipChi2(static_cast<int>(r)) / kSlipChi2) return false;
  }
  wrong_distances_.insert(worst);
  return true;
}

SurveyResult SurveyTags(const SurveyInput& input, const SurveyOptions& options, int threads, ProgressSink& progress,
                        const CancelToken& cancel) {
  if (const std::vector<std::string> problems = options.Check(); !problems.empty()) throw OptionError(problems.front());
  return MapSolver(input, options, threads, progress, cancel).Run();
}

}  // namespace trigpoint
