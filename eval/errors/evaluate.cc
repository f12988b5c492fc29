#include "eval/errors/evaluate.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

constexpr char kLocalized[] = "localized";
constexpr char kMissing[] = "missing";
constexpr char kNoReference[] = "no_reference";

// What one method answered for one panorama.
struct Answer {
  std::string status, reason;
  std::optional<Eigen::Vector3d> odom, world;  // position in either frame
  // ENU, m^2: of the position in world; of that in odom, for errors against the run's own tags.
  std::optional<Eigen::Matrix3d> covariance, relative_covariance;
};

// A tag map as the evaluation of one run uses it.
struct MapView {
  std::string reference, kind;
  std::map<int, const TagResult*> tags;
  std::optional<Eigen::Matrix3d> enu_from_map;
  std::optional<Eigen::Vector3d> up_in_map;
  double metre = 1;                                 // its length in the map
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

Eigen::Matrix3d Diagonal(const Eigen::Vector3d& sigma) { return sigma.cwiseAbs2().asDiagonal(); }

Answer OwnAnswer(const EvaluatedRun& run, const PanoramaResult& row) {
  Answer answer{.status = row.status, .reason = row.reason};
  if (row.odom_from_pano) answer.odom = row.odom_from_pano->translation;
  if (row.world_from_pano) answer.world = row.world_from_pano->translation;
  answer.covariance = run.covariances.absolute.Between(row.panorama, row.panorama);
  answer.relative_covariance = run.covariances.relative.Between(row.panorama, row.panorama);
  if (!answer.covariance && row.sigma_m) answer.covariance = Diagonal(*row.sigma_m);
  if (!answer.relative_covariance && row.odom_sigma_m && run.result.world_from_odom) {
    const Eigen::Matrix3d enu = run.result.world_from_odom->rotation.toRotationMatrix();
    answer.relative_covariance = enu * Diagonal(*row.odom_sigma_m / run.self_metre) * enu.transpose();
  }
  return answer;
}

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

// The covariance of a row's error with what it is made of, and the error in its units.
void AddUncertainty(const Answer& answer, const Station& station, const TagResult& tag, const Eigen::Vector3d& centre,
                    const MapView& map, double stitch_sigma_m, ErrorRow* row) {
  const std::optional<Eigen::Matrix3d>& own = map.kind == "relative" ? answer.relative_covariance : answer.covariance;
  const Eigen::Matrix3d& enu = *map.enu_from_map;
  row->centre_from_tag = CentreFromTag(station, *tag.map_from_tag, centre, map.up_in_map);
  row->sigma_station_offset_m = std::sqrt(3.0) * station.sigma_m;
  const std::optional<Matrix6d> tag_covariance = CovarianceOf(tag);
  if (tag_covariance && tag_covariance->allFinite()) {
    const Eigen::Matrix3d c =
        row->centre_from_tag * *tag_covariance * row->centre_from_tag.transpose() / (map.metre * map.metre);
    row->sigma_tag_map_m = InSpace(c);
    row->reference_covariance_m2 =
        enu * (c + Eigen::Matrix3d::Identity() * station.sigma_m * station.sigma_m) * enu.transpose();
  }
  if (own && own->allFinite()) row->sigma_localization_m = InSpace(*own);
  NameDominant(row);
  if (!row->sigma_localization_m || !row->reference_covariance_m2) return;
  const double stitch = stitch_sigma_m * stitch_sigma_m;
  const Eigen::Matrix3d c = *own + *row->reference_covariance_m2 + Eigen::Matrix3d::Identity() * stitch;
  const auto nees = NeesOf<3>(*row->error_enu_m, c, 0);
  if (!nees) return;
  row->covariance_m2 = c;
  row->nees = nees;
  row->dof = 3;
  row->nees_h = NeesOf<2>(*row->error_enu_m, c, 0);
  row->nees_v = NeesOf<1>(*row->error_enu_m, c, 2);
}

// Fills the errors of a localized row; turns it into no_reference where there is nothing to hold it against.
// False: the reference doesn't say where the station's centre is.
bool Score(const Answer& answer, const Station* given, const MapView& map, double passed_radius_m,
           double stitch_sigma_m, ErrorRow* row) {
  std::optional<Station> station;  // in units of the map
  if (given != nullptr) station = *given, station->offset_m *= map.metre;
  std::optional<Eigen::Vector3d> centre;
  const TagResult* tag = nullptr;
  std::string reason;
  if (!station) {
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
  const Eigen::Vector3d difference = (*position - *centre) / map.metre;
  row->error_3d_m = difference.norm();
  if (map.up_in_map) {
    const double vertical = difference.dot(*map.up_in_map);
    row->error_v_m = std::abs(vertical);
    row->error_h_m = (difference - vertical * *map.up_in_map).norm();
  }
  if (!map.enu_from_map) return true;
  row->error_enu_m = *map.enu_from_map * difference;
  AddUncertainty(answer, *station, *tag, *centre, map, stitch_sigma_m, row);
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

// run -> what its errors have in common.
using CommonErrors = std::map<std::string, const AnswerCovariances*>;

// Between the errors of two rows. Those of one station share its reference, those of one map its tags, those of one run
// its images and its fit; what is not given is taken as independent.
Eigen::Matrix3d CovarianceBetween(const ErrorRow& a, const ErrorRow& b, const ReferenceMap* map,
                                  const CommonErrors& common) {
  const bool relative = a.kind == "relative";
  Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
  if (a.run == b.run) {
    const AnswerCovariances& run = *common.at(a.run);
    block = (relative ? run.relative : run.absolute).Between(a.panorama, b.panorama).value_or(block);
  } else if (relative) {
    return block;  // tags of their own
  }
  if (a.tag_id == b.tag_id) return block + *a.reference_covariance_m2;
  if (map == nullptr) return block;
  const auto it = map->cross.find({std::min(a.tag_id, b.tag_id), std::max(a.tag_id, b.tag_id)});
  if (it == map->cross.end()) return block;
  const Matrix6d ab = a.tag_id < b.tag_id ? it->second : Matrix6d(it->second.transpose());
  return block + a.centre_from_tag * ab * b.centre_from_tag.transpose();
}

// All rows with a covariance at once; `map` is null for the run's own tags.
std::optional<NeesSummary> JointNeesOf(const std::vector<const ErrorRow*>& all, const ReferenceMap* map,
                                       const CommonErrors& common) {
  std::vector<const ErrorRow*> rows;
  for (const ErrorRow* row : all) {
    if (row->nees) rows.push_back(row);
  }
  if (rows.size() < 2) return std::nullopt;
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::VectorXd e(3 * n);
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ErrorRow& a = *rows[static_cast<size_t>(i)];
    e.segment<3>(3 * i) = *a.error_enu_m;
    c.block<3, 3>(3 * i, 3 * i) = *a.covariance_m2;
    for (Eigen::Index j = 0; j < i; ++j) {
      const Eigen::Matrix3d block = CovarianceBetween(a, *rows[static_cast<size_t>(j)], map, common);
      c.block<3, 3>(3 * i, 3 * j) = block;
      c.block<3, 3>(3 * j, 3 * i) = block.transpose();
    }
  }
  const auto nees = JointNees(e, c);
  if (!nees) return std::nullopt;
  return NeesSummary{.rows = static_cast<int>(n), .dof = static_cast<int>(3 * n), .nees = *nees};
}

// Normalised errors, rows taken as independent.
void AddNees(const std::vector<const ErrorRow*>& rows, double confidence, GroupSummary* summary) {
  NeesSummary in_space;
  for (const ErrorRow* row : rows) {
    if (row->nees) {
      in_space.Add(*row->nees, row->dof);
      summary->nees_by_run[row->run].Add(*row->nees, row->dof);
      summary->nees_by_station[row->station].Add(*row->nees, row->dof);
    }
    if (row->nees_h) summary->nees_h.Add(*row->nees_h, 2);
    if (row->nees_v) summary->nees_v.Add(*row->nees_v, 1);
  }
  summary->nees_count = in_space.rows;
  if (in_space.dof == 0) return;
  summary->anees_per_dof = in_space.PerDof();
  summary->anees_bounds = in_space.Bounds(confidence);
}

void SummarizeGroup(const std::vector<const ErrorRow*>& rows, const EvaluateOptions& options, GroupSummary* summary) {
  std::set<std::string> runs, stations;
  std::map<std::string, int> run_index, station_index;
  std::vector<ClusteredValue> clustered;
  std::vector<ClusteredValue> clustered_h, clustered_v;
  std::vector<double> e3, eh, ev;
  for (const ErrorRow* row : rows) {
    runs.insert(row->run);
    if (row->status != kLocalized) {
      ++summary->reasons[row->reason.empty() ? row->status : row->status + ": " + row->reason];
    }
    summary->unscored += row->status == kNoReference;
    if (!row->attempt) continue;
    ++summary->attempts;
    stations.insert(row->station);
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
  }
  summary->runs = static_cast<int>(runs.size());
  summary->stations = static_cast<int>(stations.size());
  const int abstentions = summary->attempts - summary->answers;
  summary->error_3d = trigpoint::Summarize(e3, abstentions);
  summary->error_h = trigpoint::Summarize(eh, abstentions);
  summary->error_v = trigpoint::Summarize(ev, abstentions);
  AddNees(rows, options.confidence, summary);
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

using Stations = std::map<std::string, const Station*>;
using Support = std::map<std::string, std::optional<DepthSupport>>;  // panorama -> structure around it

// An answer of a method, or that there is none.
struct Attempt {
  std::string method, station, panorama;
  Answer answer;
};

// What is known of a group before its errors are summarised.
struct GroupBackground {
  const ReferenceMap* map = nullptr;          // null: self
  std::set<std::string> estimate, reference;  // what each side rests on
};

void WarnOfReferences(const std::vector<ReferenceMap>& references, std::vector<std::string>* warnings) {
  for (const ReferenceMap& map : references) {
    std::string without;
    for (const TagResult& tag : map.tags) {
      const auto c = tag.map_from_tag ? CovarianceOf(tag) : std::nullopt;
      if (tag.map_from_tag && (!c || !c->allFinite())) without += " " + std::to_string(tag.tag_id);
    }
    if (without.empty()) continue;
    warnings->push_back("reference " + map.name + ": no covariance of tag" + without +
                        "; errors against it have no sigma and no test");
  }
}

Stations StationsByName(const std::vector<Station>& all, Evaluation* result) {
  Stations stations;
  for (const Station& station : all) {
    if (stations.emplace(station.name, &station).second) {
      result->stations.push_back(station.name);
    } else {
      result->warnings.push_back("station " + station.name + " stands twice in stations.csv; its first row is used");
    }
  }
  if (stations.empty()) result->warnings.push_back("no stations: without stations.csv no error can be given");
  return stations;
}

// The maps a run is held against: its own tags if there are any, and the references.
std::vector<MapView> MapsOf(const EvaluatedRun& run, const std::vector<ReferenceMap>& references) {
  std::vector<MapView> maps;
  if (!run.self_tags.empty()) {
    MapView self{.reference = "self",
                 .kind = "relative",
                 .tags = UsableTags(run.self_tags),
                 .metre = run.self_metre,
                 .cameras = &run.result.cameras_odom,
                 .shares_evidence = true,
                 .rests_on = {"tags:" + run.run}};
    if (run.result.world_from_odom) {
      self.enu_from_map = run.result.world_from_odom->rotation.toRotationMatrix();
      self.up_in_map = self.enu_from_map->row(2).transpose();
    } else if (run.odometry_levelled) {
      self.up_in_map = Eigen::Vector3d::UnitZ();
    }
    maps.push_back(std::move(self));
  }
  for (const ReferenceMap& reference : references) {
    MapView map{.reference = reference.name,
                .kind = "absolute",
                .tags = UsableTags(reference.tags),
                .enu_from_map = Eigen::Matrix3d::Identity(),
                .up_in_map = Eigen::Vector3d::UnitZ(),
                .cameras = &run.result.cameras,
                .map = &reference,
                .rests_on = reference.evidence};
    for (const std::string& name : reference.runs) map.rests_on.push_back("tags:" + name);
    map.shares_evidence = Intersect({run.run}, reference.runs) || Intersect(run.evidence, map.rests_on);
    maps.push_back(std::move(map));
  }
  return maps;
}

// One for each panorama and method; stations that the result does not mention are kept as missing.
std::vector<Attempt> AttemptsOf(const EvaluatedRun& run, const std::vector<Station>& stations,
                                const std::vector<std::string>& station_names) {
  const LocalizeResult& localized = run.result;
  std::vector<Attempt> attempts;
  std::set<std::string> mentioned;
  std::vector<std::string> methods{run.method};
  if (!localized.views.empty()) methods.push_back("g1");
  for (const PanoramaResult& row : localized.panoramas) {
    const std::string station = StationOf(row.panorama, row.station, stations);
    mentioned.insert(station);
    attempts.push_back({run.method, station, row.panorama, OwnAnswer(run, row)});
    if (localized.views.empty()) continue;
    Answer g1 = BestView(localized.views, row.panorama);
    if (g1.odom && localized.world_from_odom) g1.world = *localized.world_from_odom * *g1.odom;
    attempts.push_back({"g1", station, row.panorama, std::move(g1)});
  }
  for (const std::string& name : station_names) {
    if (mentioned.count(name) > 0) continue;
    for (const std::string& method : methods) {
      attempts.push_back({method, name, "", {.status = kMissing, .reason = "not in panoramas.csv"}});
    }
  }
  return attempts;
}

Support SupportOf(const EvaluatedRun& run, const EvaluateOptions& options) {
  Support support;
  for (const PanoramaResult& row : run.result.panoramas) {
    if (row.status != kLocalized || !row.odom_from_pano || run.structure.empty()) continue;
    support[row.panorama] = SupportAt(run.structure, row.odom_from_pano->translation, options.structure_radius_m,
                                      1e-3 * options.ray_sigma_mrad);
  }
  return support;
}

// `measured`: the station's offset comes from its panoramas.
ErrorRow RowOf(const EvaluatedRun& run, const Attempt& attempt, const Stations& stations, bool measured,
               const MapView& map, const Support& support, const EvaluateOptions& options) {
  const auto found = stations.find(attempt.station);
  const Station* const station = found == stations.end() ? nullptr : found->second;
  ErrorRow row{.run = run.run,
               .variant = run.variant,
               .method = attempt.method,
               .station = attempt.station,
               .panorama = attempt.panorama,
               .tag_id = station == nullptr ? -1 : station->tag_id,
               .reference = map.reference,
               .kind = map.kind,
               .status = attempt.answer.status,
               .reason = attempt.answer.reason,
               .shares_evidence = map.shares_evidence};
  if (map.map != nullptr && map.map->own_evidence.count(row.tag_id) > 0) {
    row.shares_evidence = Intersect(run.evidence, {map.map->own_evidence.at(row.tag_id)});
  }
  if (measured) row.shares_evidence = true;
  const auto stitch = run.stitch_sigma.find(attempt.panorama);
  row.attempt = Score(attempt.answer, station, map, options.passed_radius_m,
                      stitch == run.stitch_sigma.end() ? 0 : stitch->second, &row);
  if (const auto it = support.find(attempt.panorama); it != support.end() && row.error_3d_m) {
    row.depth = it->second;
    if (row.depth) row.trusted = row.depth->depth_sigma_m <= options.trust_depth_sigma_m;
  }
  return row;
}

void SortRows(const std::vector<std::string>& stations, std::vector<ErrorRow>* rows) {
  std::map<std::string, size_t> column;
  for (size_t i = 0; i < stations.size(); ++i) column.emplace(stations[i], i);
  const auto key = [&](const ErrorRow& row) {
    const auto it = column.find(row.station);
    return std::tuple(GroupOf(row), row.run, it == column.end() ? stations.size() : it->second);
  };
  std::stable_sort(rows->begin(), rows->end(), [&](const ErrorRow& a, const ErrorRow& b) { return key(a) < key(b); });
}

}  // namespace

Evaluation Evaluate(const EvaluateInput& input, const EvaluateOptions& options) {
  for (const std::string& problem : options.Check()) throw OptionError(problem);
  if (input.runs.empty()) throw InputError("evaluate: there is no localize result to evaluate; run `localize` first");

  Evaluation result;
  result.options = options;
  const Stations stations = StationsByName(input.stations, &result);
  WarnOfReferences(input.references, &result.warnings);
  std::map<std::string, CommonErrors> common;  // by variant
  std::map<ErrorGroup, GroupBackground> background;
  for (const EvaluatedRun& run : input.runs) {
    for (const std::string& warning : run.result.warnings) result.warnings.push_back(run.run + ": " + warning);
    if (run.self_tags.empty()) {
      result.warnings.push_back(run.run +
                                ": no tag was estimated from its own cameras, so there are no relative errors");
    }
    common[run.variant].try_emplace(run.run, &run.covariances);
    const Support support = SupportOf(run, options);
    const std::vector<Attempt> attempts = AttemptsOf(run, input.stations, result.stations);
    for (const MapView& map : MapsOf(run, input.references)) {
      for (const Attempt& attempt : attempts) {
        ErrorRow row =
            RowOf(run, attempt, stations, input.measured_stations.contains(attempt.station), map, support, options);
        GroupBackground& group = background[GroupOf(row)];
        group.map = map.map;
        group.estimate.insert(run.evidence.begin(), run.evidence.end());
        group.estimate.insert("images:" + run.run);
        group.reference.insert(map.rests_on.begin(), map.rests_on.end());
        if (row.error_3d_m) group.reference.insert("tag:" + std::to_string(row.tag_id));
        result.rows.push_back(std::move(row));
      }
    }
  }

  SortRows(result.stations, &result.rows);
  for (size_t begin = 0, end = 0; begin < result.rows.size(); begin = end) {
    std::vector<const ErrorRow*> rows;
    GroupSummary summary{.group = GroupOf(result.rows[begin])};
    while (end < result.rows.size() && GroupOf(result.rows[end]) == summary.group) rows.push_back(&result.rows[end++]);
    const GroupBackground& behind = background[summary.group];
    summary.estimate_rests_on.assign(behind.estimate.begin(), behind.estimate.end());
    summary.reference_rests_on.assign(behind.reference.begin(), behind.reference.end());
    SummarizeGroup(rows, options, &summary);
    summary.nees_joint = JointNeesOf(rows, behind.map, common[summary.group.variant]);
    result.groups.push_back(std::move(summary));
  }
  return result;
}

}  // namespace trigpoint
