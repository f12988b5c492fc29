#include "eval/evaluate.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "calib/base/error.h"
#include "eval/distributions.h"

namespace trigpoint {
namespace {

constexpr char kLocalized[] = "localized";
constexpr char kMissing[] = "missing";
constexpr char kNoReference[] = "no_reference";

// What one method answered for one panorama.
struct Answer {
  std::string status, reason;
  std::optional<Eigen::Vector3d> odom, world;              // position in either frame
  std::optional<Eigen::Vector3d> odom_sigma, world_sigma;  // per axis of the frame
};

// A tag map as the evaluation of one run uses it.
struct MapView {
  std::string reference, kind;
  std::map<int, const TagResult*> tags;
  std::optional<Eigen::Matrix3d> enu_from_map;
  std::optional<Eigen::Vector3d> up_in_map;
  const std::vector<TimedPose>* cameras = nullptr;  // in the map's frame
  const ReferenceMap* map = nullptr;                // null: self
  bool shares_evidence = false;
  std::vector<std::string> rests_on;
};

// "2 of 8 views ..." is the localizer's business; here the view with the most inliers speaks for its panorama.
Answer BestView(const std::vector<ViewResult>& views, const std::string& panorama) {
  const ViewResult* best = nullptr;
  const auto rank = [](const ViewResult& v) {
    return std::pair(v.status == kLocalized && v.odom_from_view, v.inliers);
  };
  for (const ViewResult& view : views) {
    if (view.panorama == panorama && (best == nullptr || rank(view) > rank(*best))) best = &view;
  }
  if (best == nullptr) return {.status = "unmatched", .reason = "no view matched"};
  Answer answer{.status = best->status, .reason = best->reason};
  if (best->odom_from_view) answer.odom = best->odom_from_view->translation;
  return answer;
}

Answer OwnAnswer(const PanoramaResult& row) {
  Answer answer{.status = row.status, .reason = row.reason};
  if (row.odom_from_pano) answer.odom = row.odom_from_pano->translation;
  if (row.world_from_pano) answer.world = row.world_from_pano->translation;
  answer.odom_sigma = row.odom_sigma_m;
  answer.world_sigma = row.sigma_m;
  return answer;
}

Eigen::Matrix3d Diagonal(const Eigen::Vector3d& sigma) { return sigma.cwiseAbs2().asDiagonal(); }

// The tag's covariance, left tangent in the map's axes, from whatever is given of it.
std::optional<Matrix6d> CovarianceOf(const TagResult& tag) {
  if (tag.covariance) return tag.covariance;
  if (!tag.sigma_m) return std::nullopt;
  Matrix6d c = Matrix6d::Zero();
  c.bottomRightCorner<3, 3>() = Diagonal(*tag.sigma_m);
  if (tag.sigma_rot_rad) {
    const Eigen::Matrix3d r = tag.map_from_tag->rotation.toRotationMatrix();
    c.topLeftCorner<3, 3>() = r * Diagonal(*tag.sigma_rot_rad) * r.transpose();
  }
  return c;
}

// d (tag centre + offset) / d (tag's left tangent), map axes. An offset in the tag's levelled frame turns with the
// tag's heading (about `up`); one in east, north, up does not.
Eigen::Matrix<double, 3, 6> CentreFromTag(const Station& station, const TagResult& tag, const Eigen::Vector3d& centre,
                                          const std::optional<Eigen::Vector3d>& up) {
  Eigen::Matrix<double, 3, 6> j = Eigen::Matrix<double, 3, 6>::Zero();
  j.rightCols<3>().setIdentity();
  if (station.in_tag_frame && up) {
    j.leftCols<3>() = up->cross(centre - tag.map_from_tag->translation) * up->transpose();
  }
  return j;
}

double InSpace(const Eigen::Matrix3d& covariance) { return std::sqrt(std::max(0.0, covariance.trace())); }

// The part of a normalised error in a subspace.
template <int kSize>
std::optional<double> NeesOf(const Eigen::Vector3d& error, const Eigen::Matrix3d& c, int begin) {
  const Eigen::Matrix<double, kSize, kSize> part = c.block<kSize, kSize>(begin, begin);
  const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> llt(part);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Eigen::Matrix<double, kSize, 1> e = error.segment<kSize>(begin);
  return e.dot(llt.solve(e));
}

std::map<int, const TagResult*> UsableTags(const std::vector<TagResult>& tags) {
  std::map<int, const TagResult*> usable;
  for (const TagResult& tag : tags) {
    if (tag.map_from_tag && tag.map_from_tag->IsFinite()) usable.emplace(tag.tag_id, &tag);
  }
  return usable;
}

double NearestCamera(const std::vector<TimedPose>& cameras, const Eigen::Vector3d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const TimedPose& c : cameras) nearest = std::min(nearest, (c.target_from_body.translation - point).norm());
  return nearest;
}

void NameDominant(ErrorRow* row) {
  double most = 0;
  const auto consider = [&](const char* name, const std::optional<double>& sigma) {
    if (sigma && *sigma > most) most = *sigma, row->dominant = name;
  };
  consider("tag map", row->sigma_tag_map_m);
  consider("station offset", row->sigma_station_offset_m);
  consider("stitch centre", row->sigma_stitch_m);
  consider("localization", row->sigma_localization_m);
}

// Fills the errors of a localized row; turns it into no_reference where there is nothing to hold it against.
// False: the reference doesn't say where the station's centre is.
bool Score(const Answer& answer, const Station* station, const MapView& map, double passed_radius_m,
           double stitch_sigma_m, ErrorRow* row) {
  std::optional<Eigen::Vector3d> centre;
  const TagResult* tag = nullptr;
  std::string reason;
  if (station == nullptr) {
    reason = "station " + row->station + " is not in stations.csv";
  } else if (const auto it = map.tags.find(station->tag_id); it == map.tags.end()) {
    reason = "tag " + std::to_string(station->tag_id) + " has no pose in reference " + map.reference;
    if (map.map != nullptr && map.map->unusable.count(station->tag_id) > 0) {
      reason += ": " + map.map->unusable.at(station->tag_id);
    }
  } else {
    tag = it->second;
    centre = StationCentre(*station, *tag->map_from_tag, map.enu_from_map, map.up_in_map, &reason);
  }
  if (centre) row->passed = NearestCamera(*map.cameras, *centre) <= passed_radius_m;
  if (row->status != kLocalized) return centre.has_value();

  if (stitch_sigma_m > 0) row->sigma_stitch_m = std::sqrt(3.0) * stitch_sigma_m;
  const bool relative = map.kind == "relative";
  const std::optional<Eigen::Vector3d>& position = relative ? answer.odom : answer.world;
  if (!position || !position->allFinite()) {
    row->status = kMissing;
    row->reason = std::string("localized, but the result gives no position in ") +
                  (relative ? "the run's own frame" : "world (no global fit)");
    return centre.has_value();
  }
  if (!centre) {
    row->status = kNoReference;
    row->reason = reason;
    return false;
  }
  const Eigen::Vector3d difference = *position - *centre;
  row->error_3d_m = difference.norm();
  if (map.up_in_map) {
    const double vertical = difference.dot(*map.up_in_map);
    row->error_v_m = std::abs(vertical);
    row->error_h_m = (difference - vertical * *map.up_in_map).norm();
  }
  if (!map.enu_from_map) return true;
  row->error_enu_m = *map.enu_from_map * difference;
  const std::optional<Eigen::Vector3d>& sigma = relative ? answer.odom_sigma : answer.world_sigma;
  const Eigen::Matrix3d& enu = *map.enu_from_map;
  if (map.kind == "absolute") row->place_enu_m = *position;
  row->centre_from_tag = CentreFromTag(*station, *tag, *centre, map.up_in_map);
  row->sigma_station_offset_m = std::sqrt(3.0) * station->sigma_m;
  const std::optional<Matrix6d> tag_covariance = CovarianceOf(*tag);
  if (tag_covariance && tag_covariance->allFinite()) {
    const Eigen::Matrix3d c = row->centre_from_tag * *tag_covariance * row->centre_from_tag.transpose();
    row->sigma_tag_map_m = InSpace(c);
    row->reference_covariance_m2 =
        enu * (c + Eigen::Matrix3d::Identity() * station->sigma_m * station->sigma_m) * enu.transpose();
  }
  if (sigma && sigma->allFinite()) row->sigma_localization_m = sigma->norm();
  NameDominant(row);
  if (!row->sigma_localization_m || !row->reference_covariance_m2) return true;
  const double stitch = stitch_sigma_m * stitch_sigma_m;
  const Eigen::Matrix3d c =
      enu * Diagonal(*sigma) * enu.transpose() + *row->reference_covariance_m2 + Eigen::Matrix3d::Identity() * stitch;
  const auto nees = NeesOf<3>(*row->error_enu_m, c, 0);
  if (!nees) return true;
  row->covariance_m2 = c;
  row->nees = nees;
  row->dof = 3;
  row->nees_h = NeesOf<2>(*row->error_enu_m, c, 0);
  row->nees_v = NeesOf<1>(*row->error_enu_m, c, 2);
  return true;
}

bool Intersect(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  return std::any_of(a.begin(), a.end(), [&](const auto& x) { return std::find(b.begin(), b.end(), x) != b.end(); });
}

ErrorGroup GroupOf(const ErrorRow& row) {
  return {row.variant, row.method, row.reference, row.kind, row.shares_evidence};
}

PercentileIntervals IntervalsOf(const std::vector<ClusteredValue>& values, int abstentions,
                                const BootstrapOptions& options) {
  PercentileIntervals i;
  i.median = ClusteredQuantileInterval(values, 0.5, options);
  i.p90 = ClusteredQuantileInterval(values, 0.9, options);
  // The q-th of the attempts is the q / answered-th of the answers.
  const double answered = static_cast<double>(values.size()) / std::max<double>(1, values.size() + abstentions);
  if (abstentions == 0) {
    i.median_attempts = i.median;
    i.p90_attempts = i.p90;
    return i;
  }
  if (0.5 < answered) i.median_attempts = ClusteredQuantileInterval(values, 0.5 / answered, options);
  if (0.9 < answered) i.p90_attempts = ClusteredQuantileInterval(values, 0.9 / answered, options);
  return i;
}

void AddBudget(const std::vector<const ErrorRow*>& rows, GroupSummary* summary) {
  const auto add = [&](const char* name, auto member) {
    double sum = 0;
    int n = 0;
    for (const ErrorRow* row : rows) {
      const std::optional<double>& sigma = row->*member;
      if (row->error_3d_m && sigma) sum += *sigma * *sigma, ++n;
    }
    if (n > 0) summary->budget_m[name] = std::sqrt(sum / n);
  };
  add("tag map", &ErrorRow::sigma_tag_map_m);
  add("station offset", &ErrorRow::sigma_station_offset_m);
  add("stitch centre", &ErrorRow::sigma_stitch_m);
  add("localization", &ErrorRow::sigma_localization_m);
  double most = 0;
  for (const auto& [name, sigma] : summary->budget_m) {
    if (sigma > most) most = sigma, summary->dominant = name;
  }
}

void AddTrust(const std::vector<const ErrorRow*>& rows, GroupSummary* summary) {
  std::vector<double> order, errors, trusted, untrusted;
  for (const ErrorRow* row : rows) {
    if (!row->error_3d_m || !row->depth) continue;
    order.push_back(row->depth->depth_sigma_m);
    errors.push_back(*row->error_3d_m);
    (row->trusted.value_or(true) ? trusted : untrusted).push_back(*row->error_3d_m);
  }
  summary->untrusted = static_cast<int>(untrusted.size());
  summary->error_trusted = trigpoint::Summarize(trusted, 0);
  summary->error_untrusted = trigpoint::Summarize(untrusted, 0);
  summary->coverage_risk = CoverageRisk(order, errors);
}

// All rows with a covariance at once. Errors of one station share its reference, those of one map its tags, those of
// one run its global fit; what is not given is taken as independent.
std::optional<NeesSummary> JointNeesOf(const std::vector<const ErrorRow*>& all, const ReferenceMap* map,
                                       const std::map<std::string, CommonError>& common) {
  std::vector<const ErrorRow*> rows;
  for (const ErrorRow* row : all) {
    if (row->nees && row->place_enu_m) rows.push_back(row);
  }
  if (rows.size() < 2 || map == nullptr) return std::nullopt;
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::VectorXd e(3 * n);
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  // The common part must not be more than what is stated in all.
  const auto common_scale = [&](const ErrorRow& row, const CommonError& error) {
    const Eigen::Vector3d whole = (*row.covariance_m2 - *row.reference_covariance_m2).diagonal();
    const Eigen::Vector3d part = error.Between(*row.place_enu_m, *row.place_enu_m);
    Eigen::Vector3d scale;
    for (int i = 0; i < 3; ++i)
      scale[i] = part[i] > 0 ? std::min(1.0, std::sqrt(std::max(0.0, 0.99 * whole[i] / part[i]))) : 0;
    return scale;
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    const ErrorRow& a = *rows[static_cast<size_t>(i)];
    e.segment<3>(3 * i) = *a.error_enu_m;
    c.block<3, 3>(3 * i, 3 * i) = *a.covariance_m2;
    for (Eigen::Index j = 0; j < i; ++j) {
      const ErrorRow& b = *rows[static_cast<size_t>(j)];
      Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
      if (a.tag_id == b.tag_id) {
        block += *a.reference_covariance_m2;
      } else if (const auto it = map->cross.find({std::min(a.tag_id, b.tag_id), std::max(a.tag_id, b.tag_id)});
                 it != map->cross.end()) {
        const Matrix6d ab = a.tag_id < b.tag_id ? it->second : Matrix6d(it->second.transpose());
        block += a.centre_from_tag * ab * b.centre_from_tag.transpose();
      }
      if (const auto it = common.find(a.run); a.run == b.run && it != common.end() && it->second.Usable()) {
        const Eigen::Vector3d between = it->second.Between(*a.place_enu_m, *b.place_enu_m);
        block += Eigen::Matrix3d(
            (between.array() * common_scale(a, it->second).array() * common_scale(b, it->second).array())
                .matrix()
                .asDiagonal());
      }
      c.block<3, 3>(3 * i, 3 * j) = block;
      c.block<3, 3>(3 * j, 3 * i) = block.transpose();
    }
  }
  const auto nees = JointNees(e, c);
  if (!nees) return std::nullopt;
  NeesSummary summary{.rows = static_cast<int>(n), .dof = static_cast<int>(3 * n), .nees = *nees};
  return summary;
}

// Stations whose place a reference doesn't know: run, variant, reference, station. Whether a run answers there or not,
// it is no attempt.
using UnknownPlaces = std::set<std::tuple<std::string, std::string, std::string, std::string>>;

void SummarizeGroup(const std::vector<const ErrorRow*>& rows, const UnknownPlaces& places_unknown,
                    const EvaluateOptions& options, GroupSummary* summary) {
  std::set<std::string> runs, stations;
  std::map<std::string, int> run_index, station_index;
  std::vector<ClusteredValue> clustered;
  std::vector<ClusteredValue> clustered_h, clustered_v;
  std::vector<double> e3, eh, ev;
  double nees = 0;
  int dof = 0;
  for (const ErrorRow* row : rows) {
    runs.insert(row->run);
    stations.insert(row->station);
    if (row->status != kLocalized) {
      ++summary->reasons[row->reason.empty() ? row->status : row->status + ": " + row->reason];
    }
    if (row->status == kNoReference) {
      ++summary->unscored;
      continue;
    }
    if (places_unknown.count({row->run, row->variant, row->reference, row->station}) > 0) continue;
    ++summary->attempts;
    summary->passed += row->passed;
    if (!row->error_3d_m) continue;
    ++summary->answers;
    summary->passed_answers += row->passed;
    e3.push_back(*row->error_3d_m);
    clustered.push_back({*row->error_3d_m,
                         station_index.emplace(row->station, static_cast<int>(station_index.size())).first->second,
                         run_index.emplace(row->run, static_cast<int>(run_index.size())).first->second});
    const auto component = [&](const std::optional<double>& error, std::vector<double>* values,
                               std::vector<ClusteredValue>* in_clusters) {
      if (!error) return;
      values->push_back(*error);
      in_clusters->push_back({*error, clustered.back().station, clustered.back().run});
    };
    component(row->error_h_m, &eh, &clustered_h);
    component(row->error_v_m, &ev, &clustered_v);
    if (row->nees) {
      ++summary->nees_count, nees += *row->nees, dof += row->dof;
      summary->nees_by_run[row->run].Add(*row->nees, row->dof);
      summary->nees_by_station[row->station].Add(*row->nees, row->dof);
    }
    if (row->nees_h) summary->nees_h.Add(*row->nees_h, 2);
    if (row->nees_v) summary->nees_v.Add(*row->nees_v, 1);
  }
  summary->runs = static_cast<int>(runs.size());
  summary->stations = static_cast<int>(stations.size());
  const int abstentions = summary->attempts - summary->answers;
  summary->error_3d = trigpoint::Summarize(e3, abstentions);
  summary->error_h = trigpoint::Summarize(eh, abstentions);
  summary->error_v = trigpoint::Summarize(ev, abstentions);
  if (dof > 0) {
    summary->anees_per_dof = nees / dof;
    const double tail = 0.5 * (1 - options.confidence);
    summary->anees_bounds = Interval{ChiSquareQuantile(tail, dof) / dof, ChiSquareQuantile(1 - tail, dof) / dof};
  }
  const BootstrapOptions bootstrap{.samples = options.bootstrap_samples, .confidence = options.confidence};
  summary->intervals_3d = IntervalsOf(clustered, abstentions, bootstrap);
  summary->intervals_h = IntervalsOf(clustered_h, abstentions, bootstrap);
  summary->intervals_v = IntervalsOf(clustered_v, abstentions, bootstrap);
  summary->median_interval = summary->intervals_3d.median;
  summary->p90_interval = summary->intervals_3d.p90;
  const VarianceShares shares = ClusterShares(clustered);
  summary->station_share = shares.station;
  summary->run_share = shares.run;
  AddBudget(rows, summary);
  AddTrust(rows, summary);
  summary->cumulative = CumulativeHistogram(clustered, abstentions, bootstrap);
}

void Insert(const std::vector<std::string>& from, std::vector<std::string>* to) {
  std::set<std::string> all(to->begin(), to->end());
  all.insert(from.begin(), from.end());
  to->assign(all.begin(), all.end());
}

}  // namespace

std::optional<Rigid3d> WorldFromOdom(const std::vector<TimedPose>& cameras_odom,
                                     const std::vector<TimedPose>& cameras) {
  std::map<int64_t, const Rigid3d*> world;
  for (const TimedPose& pose : cameras) world.emplace(pose.stamp_ns, &pose.target_from_body);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d mean_odom = Eigen::Vector3d::Zero(), mean_world = Eigen::Vector3d::Zero();
  int n = 0;
  for (const TimedPose& pose : cameras_odom) {
    const auto it = world.find(pose.stamp_ns);
    if (it == world.end()) continue;
    sum += (it->second->rotation * pose.target_from_body.rotation.conjugate()).toRotationMatrix();
    mean_odom += pose.target_from_body.translation;
    mean_world += it->second->translation;
    ++n;
  }
  if (n == 0) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1.0 : 1.0;
  const Eigen::Matrix3d r = svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  return Rigid3d(Eigen::Quaterniond(r), mean_world / n - r * mean_odom / n);
}

std::string StationNamed(const std::string& name, const std::vector<Station>& stations) {
  const auto number = [](const std::string& text) {
    std::string digits;
    for (const char c : text) {
      if (std::isdigit(static_cast<unsigned char>(c)) != 0) digits += c;
    }
    return digits.empty() || digits.size() > 9 ? -1 : std::stol(digits);
  };
  for (const Station& station : stations) {
    if (station.name == name) return name;
  }
  std::set<std::string> same;
  for (const Station& station : stations) {
    if (number(station.name) >= 0 && number(station.name) == number(name)) same.insert(station.name);
  }
  return same.size() == 1 ? *same.begin() : "";
}

std::optional<Eigen::Vector3d> StationCentre(const Station& station, const Rigid3d& map_from_tag,
                                             const std::optional<Eigen::Matrix3d>& enu_from_map,
                                             const std::optional<Eigen::Vector3d>& up_in_map, std::string* reason) {
  if (!station.in_tag_frame) {
    if (!enu_from_map && !station.offset_m.isZero()) {
      *reason = "the offset of station " + station.name +
                " is east/north/up, but the run has no global fit to give north; measure right/out/up instead";
      return std::nullopt;
    }
    return map_from_tag.translation +
           (enu_from_map ? Eigen::Vector3d(enu_from_map->transpose() * station.offset_m) : Eigen::Vector3d::Zero());
  }
  if (!up_in_map) {
    *reason = "the offset of station " + station.name +
              " is right/out/up, but the vertical of the run's frame is not known (no global fit, and run.yaml does "
              "not say odometry.levelled)";
    return std::nullopt;
  }
  const Eigen::Vector3d up = up_in_map->normalized();
  const Eigen::Vector3d x = map_from_tag.rotation * Eigen::Vector3d::UnitX();
  Eigen::Vector3d right = x - up.dot(x) * up;
  if (right.norm() < 0.1) {
    *reason = "tag " + std::to_string(station.tag_id) + " is turned on its side, so that right/out/up has no meaning";
    return std::nullopt;
  }
  right.normalize();
  return map_from_tag.translation + station.offset_m.x() * right + station.offset_m.y() * right.cross(up) +
         station.offset_m.z() * up;
}

Evaluation Evaluate(const EvaluateInput& input, const EvaluateOptions& options) {
  for (const std::string& problem : options.Check()) throw OptionError(problem);
  if (input.runs.empty()) throw InputError("evaluate: there is no localize result to evaluate; run `localize` first");

  Evaluation result;
  result.options = options;
  std::map<std::string, const Station*> stations;
  for (const Station& station : input.stations) {
    if (stations.emplace(station.name, &station).second) {
      result.stations.push_back(station.name);
    } else {
      result.warnings.push_back("station " + station.name + " stands twice in stations.csv; its first row is used");
    }
  }
  if (stations.empty()) result.warnings.push_back("no stations: without stations.csv no error can be given");

  // variant -> run -> what its positions have in common.
  std::map<std::string, std::map<std::string, CommonError>> common;
  UnknownPlaces places_unknown;
  std::map<ErrorGroup, const ReferenceMap*> group_map;
  std::map<ErrorGroup, std::pair<std::vector<std::string>, std::vector<std::string>>> rests_on;
  for (const ReferenceMap& map : input.references) {
    std::string without;
    for (const TagResult& tag : map.tags) {
      const auto c = tag.map_from_tag ? CovarianceOf(tag) : std::nullopt;
      if (tag.map_from_tag && (!c || !c->allFinite())) without += " " + std::to_string(tag.tag_id);
    }
    if (!without.empty()) {
      result.warnings.push_back("reference " + map.name + ": no covariance of tag" + without +
                                "; errors against it have no sigma and no test");
    }
  }
  for (const EvaluatedRun& run : input.runs) {
    const LocalizeResult& localized = run.result;
    const std::optional<Rigid3d> world_from_odom = WorldFromOdom(localized.cameras_odom, localized.cameras);
    for (const std::string& warning : localized.warnings) result.warnings.push_back(run.run + ": " + warning);
    common[run.variant].try_emplace(run.run, CommonError(run.cameras));
    std::map<std::string, std::optional<DepthSupport>> support;
    for (const PanoramaResult& row : localized.panoramas) {
      if (row.status != kLocalized || !row.odom_from_pano || run.structure.empty()) continue;
      support[row.panorama] = SupportAt(run.structure, row.odom_from_pano->translation, options.structure_radius_m,
                                        1e-3 * options.ray_sigma_mrad);
    }

    // The maps this run is held against.
    std::vector<MapView> maps;
    if (run.self_tags.empty()) {
      result.warnings.push_back(run.run +
                                ": no tag was estimated from its own cameras, so there are no relative errors");
    } else {
      MapView self{.reference = "self",
                   .kind = "relative",
                   .tags = UsableTags(run.self_tags),
                   .cameras = &localized.cameras_odom,
                   .shares_evidence = true,
                   .rests_on = {"tags:" + run.run}};
      if (world_from_odom) {
        self.enu_from_map = world_from_odom->rotation.toRotationMatrix();
        self.up_in_map = self.enu_from_map->row(2).transpose();
      } else if (run.odometry_levelled) {
        self.up_in_map = Eigen::Vector3d::UnitZ();
      }
      maps.push_back(std::move(self));
    }
    for (const ReferenceMap& reference : input.references) {
      MapView map{
          .reference = reference.name,
          .kind = "absolute",
          .tags = UsableTags(reference.tags),
          .enu_from_map = Eigen::Matrix3d::Identity(),
          .up_in_map = Eigen::Vector3d::UnitZ(),
          .cameras = &localized.cameras,
          .map = &reference,
          .shares_evidence = Intersect({run.run}, reference.runs) || Intersect(run.evidence, reference.evidence),
          .rests_on = reference.evidence};
      for (const std::string& name : reference.runs) map.rests_on.push_back("tags:" + name);
      maps.push_back(std::move(map));
    }

    // The answers, one row per panorama and method; stations that the result does not mention are kept as missing.
    struct Attempt {
      std::string method, station, panorama;
      Answer answer;
    };
    std::vector<Attempt> attempts;
    std::set<std::string> mentioned;
    std::vector<std::string> methods{run.method};
    if (!localized.views.empty()) methods.push_back("g1");
    for (const PanoramaResult& row : localized.panoramas) {
      std::string station = row.station.empty() ? row.panorama : row.station;
      if (const std::string meant = StationNamed(station, input.stations); !meant.empty()) station = meant;
      mentioned.insert(station);
      attempts.push_back({run.method, station, row.panorama, OwnAnswer(row)});
      if (localized.views.empty()) continue;
      Answer g1 = BestView(localized.views, row.panorama);
      if (g1.odom && world_from_odom) g1.world = *world_from_odom * *g1.odom;
      attempts.push_back({"g1", station, row.panorama, std::move(g1)});
    }
    for (const std::string& name : result.stations) {
      if (mentioned.count(name) > 0) continue;
      for (const std::string& method : methods) {
        attempts.push_back({method, name, "", {.status = kMissing, .reason = "not in panoramas.csv"}});
      }
    }

    for (const MapView& map : maps) {
      for (const Attempt& attempt : attempts) {
        const auto station = stations.find(attempt.station);
        ErrorRow row{.run = run.run,
                     .variant = run.variant,
                     .method = attempt.method,
                     .station = attempt.station,
                     .panorama = attempt.panorama,
                     .tag_id = station == stations.end() ? -1 : station->second->tag_id,
                     .reference = map.reference,
                     .kind = map.kind,
                     .status = attempt.answer.status,
                     .reason = attempt.answer.reason,
                     .shares_evidence = map.shares_evidence};
        const auto stitch = run.stitch_sigma.find(attempt.panorama);
        const bool known = Score(attempt.answer, station == stations.end() ? nullptr : station->second, map,
                                 options.passed_radius_m, stitch == run.stitch_sigma.end() ? 0 : stitch->second, &row);
        if (!known) places_unknown.insert({row.run, row.variant, row.reference, row.station});
        if (const auto it = support.find(attempt.panorama); it != support.end() && row.error_3d_m) {
          row.depth = it->second;
          if (row.depth) row.trusted = row.depth->depth_sigma_m <= options.trust_depth_sigma_m;
        }
        group_map[GroupOf(row)] = map.map;
        auto& [estimate, reference] = rests_on[GroupOf(row)];
        if (row.error_3d_m) Insert({"tag:" + std::to_string(row.tag_id)}, &reference);
        Insert(run.evidence, &estimate);
        Insert({"images:" + run.run}, &estimate);
        Insert(map.rests_on, &reference);
        result.rows.push_back(std::move(row));
      }
    }
  }

  std::map<std::string, size_t> column;
  for (size_t i = 0; i < result.stations.size(); ++i) column.emplace(result.stations[i], i);
  const auto key = [&](const ErrorRow& row) {
    const auto it = column.find(row.station);
    return std::tuple(GroupOf(row), row.run, it == column.end() ? result.stations.size() : it->second);
  };
  std::stable_sort(result.rows.begin(), result.rows.end(),
                   [&](const ErrorRow& a, const ErrorRow& b) { return key(a) < key(b); });
  for (size_t begin = 0, end = 0; begin < result.rows.size(); begin = end) {
    std::vector<const ErrorRow*> rows;
    const ErrorGroup group = GroupOf(result.rows[begin]);
    while (end < result.rows.size() && GroupOf(result.rows[end]) == group) rows.push_back(&result.rows[end++]);
    GroupSummary summary{.group = group};
    std::tie(summary.estimate_rests_on, summary.reference_rests_on) = rests_on[group];
    SummarizeGroup(rows, places_unknown, options, &summary);
    summary.nees_joint = JointNeesOf(rows, group_map[group], common[group.variant]);
    result.groups.push_back(std::move(summary));
  }
  return result;
}

}  // namespace trigpoint
