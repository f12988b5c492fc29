// What a solved tag map says: tags, runs, points and distances against it.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/base/median.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "survey/tags/map_solver.h"

namespace trigpoint {
namespace {

constexpr double kDistanceSigmas = 3.3;   // 99.9 % of a normal
constexpr double kLeastRedundant = 1e-3;  // share of an observation's variance that others must leave to judge it by
constexpr size_t kFewTags = 100;          // covariances of all their pairs are 2 MB
constexpr double kGpsCorrelation_s = 60;  // fixes within this time share their error

Eigen::Matrix3d Stated(const SurveyPoint& p) {
  return Eigen::Vector3d(p.sigma_h_m, p.sigma_h_m, p.sigma_v_m).cwiseAbs2().asDiagonal();
}

// Weighted mean that single outliers do not move; its sigma from the stated ones or the scatter, whichever is larger.
DatumShift RobustMean(const std::vector<Eigen::Vector3d>& values, const std::vector<Eigen::Vector3d>& sigmas) {
  DatumShift shift;
  shift.n = static_cast<int>(values.size());
  for (int k = 0; k < 3; ++k) {
    std::vector<double> all;
    for (const Eigen::Vector3d& v : values) all.push_back(v[k]);
    double mean = Median(std::move(all)), weight = 0, square = 0;
    for (int round = 0; round < 10; ++round) {
      double sum = 0;
      weight = square = 0;
      for (size_t i = 0; i < values.size(); ++i) {
        const double d = (values[i][k] - mean) / sigmas[i][k];
        const double w = std::min(1.0, 2 / std::max(1e-9, std::abs(d))) / (sigmas[i][k] * sigmas[i][k]);
        sum += w * values[i][k];
        weight += w;
        square += w * (values[i][k] - mean) * (values[i][k] - mean);
      }
      mean = sum / weight;
    }
    shift.stated_minus_map_m[k] = mean;
    const double scatter = values.size() > 1 ? square / static_cast<double>(values.size() - 1) : 1;
    shift.sigma_m[k] = std::sqrt(std::max(1.0, scatter) / weight);
  }
  return shift;
}

}  // namespace

std::string_view RoleName(PointRole role) {
  return role == PointRole::kControl ? "control" : role == PointRole::kCheck ? "check" : "geotag";
}

void MapSolver::Collect() {
  CollectRuns();
  CollectTags();
  CollectResiduals();
  CompareWithPoints();
  CompareDistances();
  CompareStations();
  ComparePlane();
  CompareDatums();
  if (!start_.in_world) FitMapToPoints();
  if (options_.cross_covariances || result_.tags.size() <= kFewTags) CrossCovariances();
  JudgeSizes();
  DoubtDatum();
  if (options_.budget) CollectBudgets();
}

void MapSolver::CollectRuns() {
  const auto sigma = [&](int unknown) {
    const int offset = solver_.Offset(unknown);
    return offset < 0 ? 0.0 : std::sqrt(solver_.Covariance(offset, offset, 1, 1)(0, 0));
  };
  for (size_t r = 0; r < run_states_.size(); ++r) {
    const RunState& state = run_states_[r];
    RunAgreement run;
    run.name = input_.runs[r].name;
    run.stills = input_.runs[r].stills;
    run.scale = state.scale;
    run.scale_sigma = sigma(state.scale_unknown);
    run.heading_drift_deg_m = state.drift * kRadToDeg;
    run.heading_drift_sigma_deg_m = sigma(state.drift_unknown) * kRadToDeg;
    if (!state.shift.empty()) {
      run.corner_shift_px = state.shift.front();
      run.corner_shift_sigma_px = sigma(state.shift_unknown.front());
    }
    if (!state.camera_unknown.empty()) {
      run.camera = input_.runs[r].cameras.front().camera;
      const int offset = solver_.Offset(state.camera_unknown.front());
      for (int k = 0; k < 5; ++k) {
        run.camera_sigma[static_cast<size_t>(k)] =
            offset < 0 ? 0.0 : std::sqrt(solver_.Covariance(offset + k, offset + k, 1, 1)(0, 0));
      }
    }
    run.corner_factor = state.corner;
    run.odometry_factor = state.odometry;
    result_.runs.push_back(run);
  }
  result_.undecided = undecided_;
  for (const MoveOrJump& u : undecided_) Warn(u.Text(input_.runs[static_cast<size_t>(u.run)].name));
  for (int f : slipped_) {
    const MapFrame& frame = start_.frames[static_cast<size_t>(f)];
    result_.runs[static_cast<size_t>(frame.run)].jumps_ns.push_back(frame.stamp_ns);
  }
  for (const MapFrame& frame : start_.frames) {
    if (!frame.world_from_body) continue;
    RunAgreement& run = result_.runs[static_cast<size_t>(frame.run)];
    ++run.frames;
    run.world_from_body.push_back({frame.stamp_ns, *frame.world_from_body});
  }
}

// Duplicates, moved tags and twins show when the cameras are known.
std::map<int, TagEstimate> MapSolver::JudgeByCameras() {
  TagPosesOptions judge;
  judge.extra_sigma_px = options_.extra_sigma_px;
  judge.min_side_px = options_.min_side_px;
  ProgressSink silent;
  const std::vector<TagView> views = ViewsOf(input_, start_, -1);
  const std::vector<TagEstimate> estimates = EstimateTagPoses(views, input_.sizes, judge, threads_, silent, cancel_);
  result_.shapes = MeasureTagShapes(views, estimates, options_.extra_sigma_px);
  std::map<int, TagEstimate> judged;
  for (const TagEstimate& t : estimates) judged[t.tag_id] = t;
  return judged;
}

struct MapSolver::SeenTag {
  TagEstimate tag;  // named and counted, without its pose
  std::set<int> runs;
  double square_px = 0;  // sum over the pictures used
};

// By id; counts the pictures of the runs, too.
std::map<int, MapSolver::SeenTag> MapSolver::CountSights() {
  std::map<int, SeenTag> seen;
  for (const MapSight& s : start_.sights) {
    auto& [tag, runs, square_px] = seen[s.detection.id];
    tag.tag_id = s.detection.id;
    tag.family = s.detection.family;
    tag.size_m = SizeOf(tag.tag_id);  // as found where the stated one is wrong: the map was made with it
    const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
    RunAgreement& run = result_.runs[static_cast<size_t>(frame.run)];
    if (!Usable(s) || s.place < 0) {
      ++tag.rejected;
      ++run.rejected;
      continue;
    }
    const BodyCamera& camera = input_.runs[static_cast<size_t>(frame.run)].cameras[static_cast<size_t>(s.camera)];
    const double shift = run_states_[static_cast<size_t>(frame.run)].shift[static_cast<size_t>(s.camera)];
    const Vector8d r =
        TagResidual(s.sight, SizeOf(s.place), camera.cam_from_body, *frame.world_from_body, tags_.at(tag.tag_id)) -
        shift * s.sight.outward;
    const double px = ResidualPx(s.sight, r);
    ++tag.images;
    ++run.sights;
    runs.insert(frame.run);
    square_px += px * px;
    run.rms_px += px * px;
  }
  for (RunAgreement& run : result_.runs) run.rms_px = run.sights > 0 ? std::sqrt(run.rms_px / run.sights) : 0;
  return seen;
}

void MapSolver::CollectTags() {
  const std::map<int, TagEstimate> judged = JudgeByCameras();
  for (auto& [id, seen] : CountSights()) {
    TagEstimate& tag = seen.tag;
    const auto unknown = tag_unknown_.find(id);
    if (unknown == tag_unknown_.end() || tag.images == 0) {
      tag.status = "unsolved";
      tag.reason = "not tied to the rest of the map";
    } else {
      tag.world_from_tag = tags_.at(id);
      tag.covariance = solver_.PoseCovariance(unknown->second);
      tag.runs = static_cast<int>(seen.runs.size());
      tag.rms_px = std::sqrt(seen.square_px / tag.images);
      const auto its = judged.find(id);
      tag.status = its != judged.end() && its->second.HasPose() ? its->second.status : "weak";
      tag.reason = its != judged.end() ? its->second.reason : "";
    }
    JudgeShape(&tag);
    JudgePlaces(&tag);
    if (!tag.reason.empty()) {
      result_.warnings.push_back({fmt::format("tag {} ({}): {}", id, tag.status, tag.reason), id, ""});
    }
    for (const SurveyPoint& p : input_.points) {
      if (p.tag_id != id || p.role == PointRole::kGeotag) continue;
      const bool used = p.role == PointRole::kControl && result_.datum.starts_with("control") && !Excluded(p) &&
                        duplicates_.count(id) == 0;
      tag.role = used ? "control" : p.role == PointRole::kCheck ? "check" : tag.role;
    }
    result_.tags.push_back(tag);
  }
}

void MapSolver::CollectResiduals() {
  for (const MapSight& s : start_.sights) {
    const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
    SightResidual& r = result_.sights.emplace_back();
    r.run = frame.run;
    r.stamp_ns = frame.stamp_ns;
    r.camera = s.camera;
    r.tag_id = s.detection.id;
    r.used = Usable(s) && s.place >= 0;
    const bool placed = Placed(s.frame) && tags_.count(s.place) > 0;
    r.rms_px = placed ? SightPx(s) : std::numeric_limits<double>::infinity();
    r.chi2 = placed ? SightChi2(s) : std::numeric_limits<double>::infinity();
  }
}

// A size or shape that the other evidence contradicts is named. Where most tags are off alike, it is the scale.
void MapSolver::JudgeShape(TagEstimate* tag) const {
  for (const TagShape& shape : result_.shapes) {
    if (shape.tag_id != tag->tag_id || (tag->status != "ok" && tag->status != "weak")) continue;
    TagShape single = shape;  // what is common to all tags is named once
    single.size_ratio /= std::exp(common_log_size_);
    if (single.SizeIsWrong()) {
      tag->status = "size";
      tag->reason = fmt::format("its edge is {:.4f} +- {:.4f} m (1 sigma) by the pictures, stated are {:.4f} m",
                                shape.size_ratio * shape.edge_m, shape.size_sigma * shape.edge_m, shape.edge_m);
    } else if (shape.IsBent()) {
      tag->status = "bent";
      tag->reason = fmt::format(
          "its sheet is not flat and square: height / width {:.3f} +- {:.3f}, corners {:.1f} +- {:.1f} mm off one "
          "plane",
          shape.aspect, shape.aspect_sigma, 1e3 * std::abs(shape.twist_m), 1e3 * shape.twist_sigma_m);
    }
  }
}

bool MapSolver::PlaceOf(const SurveyPoint& p, Eigen::Vector3d* place, Eigen::Matrix3d* covariance) const {
  covariance->setZero();
  if (p.tag_id < 0) {
    const auto mark = mark_unknown_.find(p.name);
    if (mark == mark_unknown_.end()) return false;
    *place = marked_.at(p.name);
    const int offset = solver_.Offset(mark->second);
    if (offset >= 0) *covariance = solver_.Covariance(offset, offset, 3, 3);
    return true;
  }
  const auto unknown = tag_unknown_.find(p.tag_id);
  if (unknown == tag_unknown_.end()) return false;
  const Rigid3d& pose = tags_.at(p.tag_id);
  const Eigen::Vector3d turned = pose.rotation * Lever(p);
  *place = turned + pose.translation + OffsetInWorld(p, pose);
  Eigen::Matrix<double, 3, 6> j;
  j << -Skew(turned), Eigen::Matrix3d::Identity();
  *covariance = j * solver_.PoseCovariance(unknown->second) * j.transpose();
  return true;
}

// The control on which the map rests at a check point, in words: a wrong point shows at those around it.
std::string MapSolver::ControlNear(const SurveyPoint& p) const {
  std::vector<std::pair<double, std::string>> near;
  for (const SurveyPoint& q : datum_points_) {
    if (q.role == PointRole::kControl && !Excluded(q)) near.emplace_back((q.world_m - p.world_m).norm(), q.name);
  }
  if (p.role != PointRole::kCheck || near.empty()) return "";
  std::sort(near.begin(), near.end());
  const bool several = near.size() > 1;
  std::string text = ", and those of control " + std::string(several ? "points " : "point ") + near.front().second;
  if (several) text += " and " + near[1].second;
  return text + " near it";
}

void MapSolver::CompareWithPoints() {
  if (!result_.in_world) return;
  double square_h = 0, square_v = 0, stated_h = 0, stated_v = 0;
  for (const SurveyPoint& p : input_.points) {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Matrix3d map = Eigen::Matrix3d::Zero();
    if (p.start_only || !PlaceOf(p, &place, &map)) continue;
    PointAgreement a{.name = p.name, .role = p.role, .tag_id = p.tag_id, .stated_m = p.world_m};
    a.error_m = place - p.world_m;
    a.excluded = Excluded(p);
    a.used = !a.excluded && std::any_of(datum_points_.begin(), datum_points_.end(),
                                        [&](const SurveyPoint& q) { return q.role == p.role && q.name == p.name; });
    a.stated_sigma_h_m = p.sigma_h_m;
    a.stated_sigma_v_m = p.sigma_v_m;
    const Eigen::Matrix3d stated = Stated(p);
    if (a.used && p.role == PointRole::kGeotag && use_shift_) a.error_m += shift_;
    // Residual of an observation that took part: its covariance is the stated one less the fitted one.
    const Eigen::Matrix3d covariance = a.used ? Eigen::Matrix3d(stated - map) : Eigen::Matrix3d(stated + map);
    a.covariance_m2 = covariance;
    a.sigma_h_m = std::sqrt(std::max(0.0, 0.5 * (covariance(0, 0) + covariance(1, 1))));
    a.sigma_v_m = std::sqrt(std::max(0.0, covariance(2, 2)));
    const Eigen::Matrix3d floor = 1e-4 * stated;  // a point that alone holds a direction has no residual there
    a.chi2 = a.error_m.dot((covariance + floor).ldlt().solve(a.error_m));
    if (a.used && p.role == PointRole::kControl) {
      // The fit without this point, in linear approximation: e / (1 - h) in three dimensions.
      const Eigen::Matrix3d gain = stated * (covariance + floor).inverse();
      a.left_out_m = gain * a.error_m;
      a.left_out_sigma_m = (gain * stated).diagonal().cwiseMax(0).cwiseSqrt();
    }
    if (a.chi2 > kPointChi2) {
      result_.warnings.push_back(
          {fmt::format("{} point {} is {:.3f} m off the map, {:.1f} sigma: {}", RoleName(p.role), p.name,
                       a.error_m.norm(), std::sqrt(a.chi2),
                       a.excluded ? "taken out, since it contradicts the other control; check its coordinates"
                                  : "more than its sigma allows; check its coordinates" + ControlNear(p)),
           -1, p.name});
    }
    // The map has a tag that was moved at one place, and the surveyor saw it at one: they need not be the same.
    const bool elsewhere =
        std::any_of(moved_.begin(), moved_.end(), [&](const SplitPlace& split) { return split.tag_id == p.tag_id; });
    a.checked = p.role == PointRole::kCheck && !elsewhere;
    if (a.checked) {
      ++result_.check.n;
      square_h += a.error_m.head<2>().squaredNorm();
      square_v += a.error_m.z() * a.error_m.z();
      stated_h += 2 * p.sigma_h_m * p.sigma_h_m;
      stated_v += p.sigma_v_m * p.sigma_v_m;
    }
    result_.points.push_back(a);
  }
  CheckSummary& check = result_.check;
  if (check.n == 0) return;
  check.rmse_h_m = std::sqrt(square_h / check.n);
  check.rmse_v_m = std::sqrt(square_v / check.n);
  check.rmse_3d_m = std::sqrt((square_h + square_v) / check.n);
  check.stated_h_m = std::sqrt(stated_h / check.n);
  check.stated_v_m = std::sqrt(stated_v / check.n);
}

void MapSolver::CompareStations() {
  constexpr double kLargest = 3.89;  // 99.99 %
  if (!input_.stations) return;
  for (const NetworkResidual& r : input_.stations->network.residuals) {
    if (r.excluded) result_.station_residuals.push_back(r);
  }
  for (size_t i = 0; i < observations_.size(); ++i) {
    if (observations_[i].kind != Kind::kStation) continue;
    const auto& [sighting, reading] = station_readings_[static_cast<size_t>(observations_[i].index)];
    const StationSighting& s = input_.stations->sightings[sighting];
    const int factor = static_cast<int>(i);
    const double whitened = solver_.Residual(factor)[0], left = 1 - solver_.Leverage(factor)(0, 0);
    NetworkResidual r{sighting, reading, whitened * ReadingOf(s, reading).second, 0, false};
    if (left > 1e-3) r.standardised = whitened / std::sqrt(left);
    if (std::abs(r.standardised) > kLargest) {
      Warn(
          fmt::format("total_station.csv, line {}: the {} from {} to {} contradicts the map by {:.1f} sigma; check "
                      "the reading, and whether the tag was moved between the survey and the run",
                      s.line, StationReadingName(reading), s.setup, s.target, std::abs(r.standardised)));
    }
    result_.station_residuals.push_back(r);
  }
}

void MapSolver::CompareDistances() {
  for (size_t i = 0; i < input_.distances.size(); ++i) {
    const SurveyDistance& d = input_.distances[i];
    const auto a = tag_unknown_.find(d.from), b = tag_unknown_.find(d.to);
    if (a == tag_unknown_.end() || b == tag_unknown_.end() || d.from == d.to) {
      Warn(fmt::format("distances.csv: distance {} - {} is not used: the map does not have both tags; check the ids",
                       d.from, d.to));
      continue;
    }
    const Eigen::Vector3d along = TagPose(d.to).translation - TagPose(d.from).translation;
    DistanceAgreement agreement;
    agreement.stated = d;
    agreement.map_m = along.norm();
    const int at = solver_.Offset(a->second), bt = solver_.Offset(b->second);
    // Covariance of the difference of both centres: columns of the whole inverse, since the pair need not be adjacent.
    Eigen::Matrix3d c = Eigen::Matrix3d::Zero();
    if (at >= 0) c += solver_.PoseCovariance(a->second).bottomRightCorner<3, 3>();
    if (bt >= 0) c += solver_.PoseCovariance(b->second).bottomRightCorner<3, 3>();
    if (at >= 0 && bt >= 0) {
      const Eigen::Matrix3d cross = solver_.CovarianceColumns(at + 3, 3).middleRows(bt + 3, 3);
      c -= cross + cross.transpose();
    }
    const Eigen::Vector3d unit = along.normalized();
    const double map = unit.dot(c * unit), stated = d.sigma_m * d.sigma_m;
    agreement.excluded = wrong_distances_.count(static_cast<int>(i)) > 0;
    agreement.sigma_m = std::sqrt(std::max(1e-12, d.check || agreement.excluded ? stated + map : stated - map));
    const double off = agreement.map_m - d.distance_m;
    if (std::abs(off) > kDistanceSigmas * agreement.sigma_m) {
      Warn(fmt::format("distance {} - {}: measured {:.4f} m, map {:.4f} m, {:.1f} sigma apart{}", d.from, d.to,
                       d.distance_m, agreement.map_m, std::abs(off) / agreement.sigma_m,
                       agreement.excluded ? ": taken out; measure it again" : ""));
    }
    result_.distances.push_back(agreement);
  }
}

// Heights of the plane's tags above it, by the sigma of such residuals: stated less fitted.
void MapSolver::ComparePlane() {
  const double stated = input_.level_sigma_m * input_.level_sigma_m;
  for (int id : input_.level_tags) {
    const auto tag = tag_unknown_.find(id);
    if (tag == tag_unknown_.end()) continue;
    PlaneAgreement a;
    a.tag_id = id;
    a.height_m = tags_.at(id).translation.z();
    const double left = stated - solver_.PoseCovariance(tag->second)(5, 5);
    a.sigma_m = left > kLeastRedundant * stated ? std::sqrt(left) : 0;
    if (a.sigma_m > 0 && std::abs(a.height_m) > kDistanceSigmas * a.sigma_m) {
      Warn(
          fmt::format("tag {} lies {:.3f} m {} the plane of plane_tags, {:.1f} sigma: it or another of them does not "
                      "belong to that plane; measure their heights, or leave one out",
                      id, std::abs(a.height_m), a.height_m > 0 ? "above" : "below", std::abs(a.height_m) / a.sigma_m));
    }
    result_.plane.push_back(a);
  }
}

void MapSolver::CompareDatums() {
  if (!result_.in_world) return;
  std::vector<Eigen::Vector3d> values, sigmas;
  for (const SurveyPoint& p : input_.points) {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Matrix3d map = Eigen::Matrix3d::Zero();
    if (p.role != PointRole::kGeotag || !PlaceOf(p, &place, &map)) continue;
    values.emplace_back(p.world_m - place);
    sigmas.emplace_back((Stated(p) + map).diagonal().cwiseSqrt());
  }
  if (!values.empty() && result_.datum != "geotags") {
    result_.shifts.push_back(RobustMean(values, sigmas));
    result_.shifts.back().of = "geotags";
  }
  values.clear(), sigmas.clear();
  double sea_m = 0;
  for (size_t r = 0; r < input_.runs.size(); ++r) {
    const std::vector<SurveyFix>& fixes = input_.runs[r].gps;
    std::vector<Eigen::Vector3d> its, its_sigma;
    Trajectory path;
    path.poses = result_.runs[r].world_from_body;
    for (const SurveyFix& fix : fixes) {
      const auto body = path.At(fix.stamp_ns, static_cast<int64_t>(5 * 1e9));
      if (!body) continue;
      its.emplace_back(fix.world_m - *body * fix.arm_m);
      its_sigma.emplace_back(fix.sigma_h_m, fix.sigma_h_m, OwnHeightSigma(fix.sigma_v_m, fix.sigma_sea_m));
      sea_m = std::max(sea_m, fix.sigma_sea_m);
    }
    if (its.empty()) continue;
    const double span = 1e-9 * static_cast<double>(fixes.back().stamp_ns - fixes.front().stamp_ns);
    const double widen = std::sqrt(static_cast<double>(its.size()) / std::max(1.0, span / kGpsCorrelation_s));
    for (Eigen::Vector3d& s : its_sigma) s *= std::max(1.0, widen);
    const DatumShift mean = RobustMean(its, its_sigma);
    values.push_back(mean.stated_minus_map_m);
    sigmas.push_back(mean.sigma_m);
  }
  if (!values.empty() && result_.datum != "gps") {
    DatumShift mean = RobustMean(values, sigmas);
    mean.sigma_m.z() = std::hypot(mean.sigma_m.z(), sea_m);
    mean.of = "gps";
    result_.shifts.push_back(mean);
  }
}

// If control contradicts geotags or GPS, it is unknown which is wrong: the difference becomes part of the tags' sigmas.
void MapSolver::DoubtDatum() {
  if (!result_.in_world || result_.datum == "geotags" || result_.datum == "gps") return;
  constexpr double kSigmas = 5, kLeast_m = 10, kLeastHeight_m = 15;  // coarse: geotags and GPS are no survey
  Eigen::Matrix3d shifted = Eigen::Matrix3d::Zero(), bent = Eigen::Matrix3d::Zero();
  for (const DatumShift& s : result_.shifts) {
    const Eigen::Vector3d& d = s.stated_minus_map_m;
    const bool far = d.head<2>().norm() > std::max(kLeast_m, kSigmas * s.sigma_m.head<2>().norm());
    if (!far && std::abs(d.z()) <= std::max(kLeastHeight_m, kSigmas * s.sigma_m.z())) continue;
    shifted += d * d.transpose();
    Warn(
        fmt::format("{} lie {:.1f} m {} the site as control places it: one of the two is wrong, and the difference is "
                    "part of the tags' sigmas; check coordinates, heights (above the ellipsoid) and crs",
                    s.of == "gps" ? "GPS fixes" : s.of, far ? d.head<2>().norm() : std::abs(d.z()),
                    far         ? "from"
                    : d.z() > 0 ? "above"
                                : "below"));
  }
  int points = 0, wrong = 0, checks = 0, wrong_checks = 0;
  // The smallest error of one point that explains all of it: what is found by leaving out another point than the wrong
  // one is many times that error where few points are left.
  double most = 0, single = std::numeric_limits<double>::infinity();
  Eigen::AlignedBox3d extent;
  for (const PointAgreement& p : result_.points) {
    if (p.role == PointRole::kGeotag || p.excluded) continue;
    ++points;
    checks += p.role == PointRole::kCheck;
    extent.extend(p.stated_m);
    if (p.chi2 <= kPointChi2) continue;
    ++wrong;
    wrong_checks += p.role == PointRole::kCheck;
    most = std::max(most, p.error_m.norm());
    if (p.left_out_m) single = std::min(single, p.left_out_m->norm());
  }
  if (std::isfinite(single)) most = std::max(most, single);
  const bool most_wrong = points >= 3 && 2 * wrong > points;
  // A map can be bent to three control points, so that they agree with it whatever is wrong.
  const bool untested = points - checks < 4 && 2 * wrong_checks > checks;
  if (most_wrong || untested) {
    // Exchanged points turn a site by any angle.
    constexpr double kTurned = 0.1;  // rad
    const double size = extent.diagonal().norm(), sigma = most > kTurned * size ? std::max(most, size) : most;
    bent = sigma * sigma * Eigen::Matrix3d::Identity();
    Warn(fmt::format(
        "{} of {} {}, by up to {:.3g} m, and the pictures do not show which is wrong: the difference is part "
        "of the tags' sigmas; check their coordinates and tags",
        most_wrong ? wrong : wrong_checks, most_wrong ? points : checks,
        most_wrong ? "control and check points contradict each other"
                   : "check points contradict control, of which fewer than four points are there",
        most));
  }
  for (TagEstimate& tag : result_.tags) {
    if (tag.HasPose()) tag.covariance.bottomRightCorner<3, 3>() += shifted + bent;
  }
  // A shift is common to all, other contradictions need not be.
  for (auto& [pair, covariance] : result_.cross) covariance.bottomRightCorner<3, 3>() += shifted;
}

void MapSolver::FitMapToPoints() {
  std::vector<Eigen::Vector3d> map, stated;
  std::vector<std::string> names;
  for (const SurveyPoint& p : input_.points) {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    if (p.role == PointRole::kGeotag || !PlaceOf(p, &place, &covariance)) continue;
    map.push_back(place);
    stated.push_back(p.world_m);
    names.push_back(p.name);
  }
  if (map.size() < 4) return;
  const Sim3d fit = AlignPoints(map, stated, AlignmentKind::kSE3);
  std::vector<double> distance;
  FitToPoints result;
  result.n = static_cast<int>(map.size());
  for (size_t i = 0; i < map.size(); ++i) {
    distance.push_back((fit * map[i] - stated[i]).norm());
    result.rmse_m += distance.back() * distance.back() / result.n;
    result.max_m = std::max(result.max_m, distance.back());
  }
  result.rmse_m = std::sqrt(result.rmse_m);
  std::vector<double> sorted = distance;
  std::sort(sorted.begin(), sorted.end());
  result.median_m = 0.5 * (sorted[sorted.size() / 2] + sorted[(sorted.size() - 1) / 2]);
  for (size_t i = 0; i < map.size(); ++i) {
    if (distance[i] > 3 * result.median_m) result.worst.emplace_back(names[i], distance[i]);
  }
  result_.fit = result;
}

void MapSolver::CrossCovariances() {
  for (auto a = tag_unknown_.begin(); a != tag_unknown_.end(); ++a) {
    const int offset = solver_.Offset(a->second);
    if (offset < 0 || a->first < 0) continue;
    cancel_.ThrowIfCancelled();
    const Eigen::MatrixXd columns = solver_.CovarianceColumns(offset, 6);
    for (auto b = std::next(a); b != tag_unknown_.end(); ++b) {
      const int other = solver_.Offset(b->second);
      if (other < 0) continue;
      const Matrix6d b_a = columns.middleRows(other, 6);
      result_.cross[{a->first, b->first}] = b_a.transpose();
    }
  }
}

}  // namespace trigpoint
