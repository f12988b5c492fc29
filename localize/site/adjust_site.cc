#include "localize/site/adjust_site.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "calib/base/union_find.h"

namespace trigpoint {
namespace {

// The runs that can be placed, in their order.
void LeaveOutUnplaced(std::vector<SiteRun>* runs, std::vector<PlacedRun>* placed, std::vector<std::string>* warnings) {
  size_t kept = 0;
  for (size_t i = 0; i < runs->size(); ++i) {
    if (!(*placed)[i].world_from_odom) {
      warnings->push_back(
          "run " + (*runs)[i].name +
          " is left out: it is not georeferenced, shares no panorama or tag with a run that is, and shows too few "
          "tags that the adjustment uses (--use tags, --use control)");
      continue;
    }
    if (kept != i) (*runs)[kept] = std::move((*runs)[i]), (*placed)[kept] = std::move((*placed)[i]);
    ++kept;
  }
  runs->resize(kept);
  placed->resize(kept);
  if (kept == 0) {
    throw InputError(
        "no run is georeferenced, so that there is no datum: give geotags, GPS or control points, and run `trigpoint "
        "localize` again");
  }
}

// Removes runs that nothing holds in the world; false if all are held, or none is.
bool LeaveOutLoose(const std::vector<int>& loose, std::vector<SiteRun>* runs, std::vector<std::string>* warnings) {
  if (loose.empty() || loose.size() == runs->size()) return false;
  for (auto r = loose.rbegin(); r != loose.rend(); ++r) {
    const auto run = runs->begin() + *r;
    warnings->push_back("run " + run->name +
                        " is left out: no geotag, GPS fix or surveyed tag that is used ties it to the world, and it "
                        "shares no panorama, tag or image with a run that is tied; use what georeferenced it: --use "
                        "tags, --use control or --use gps");
    runs->erase(run);
  }
  return true;
}

// The adjustment with these warnings first, each once.
SiteAdjustment WithWarnings(std::vector<std::string> warnings, SiteAdjustment site) {
  for (std::string& warning : site.warnings) {
    if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end()) warnings.push_back(std::move(warning));
  }
  site.warnings = std::move(warnings);
  return site;
}

// Each tag once, with what all runs see of it, from the runs' tags; a tag's place in the map or its control points from
// `evidence`.
WorldEvidence JoinTags(const std::vector<SiteRun>& runs, const JoinedRuns& joined, const WorldEvidence& evidence,
                       std::vector<std::set<int>>* runs_of_tag) {
  std::map<int, WorldTag> tags;
  std::map<int, std::set<int>> seen;
  for (size_t r = 0; r < runs.size(); ++r) {
    for (const WorldTag& tag : runs[r].tags) {
      auto [at, fresh] = tags.try_emplace(tag.id, tag);
      if (fresh) at->second.sightings.clear();
      for (TagSighting s : tag.sightings) {
        s.image += joined.runs[r].first_image;
        at->second.sightings.push_back(s);
      }
      seen[tag.id].insert(static_cast<int>(r));
    }
  }
  WorldEvidence out;
  out.gps = evidence.gps;
  std::vector<Eigen::Index> rows;  // of the map's covariance
  Eigen::Index row = 0;
  // Those of the map come first, in its order: the covariance is theirs. Only runs that were left out may show some.
  for (const WorldTag& known : evidence.tags) {
    const Eigen::Index first = row;
    row += known.world_from_tag ? 6 : 0;
    const auto at = tags.find(known.id);
    if (at == tags.end()) continue;
    for (Eigen::Index k = first; k < row; ++k) rows.push_back(k);
    at->second.world_from_tag = known.world_from_tag;
    at->second.control = known.control;
    out.tags.push_back(std::move(at->second));
    runs_of_tag->push_back(seen[known.id]);
    tags.erase(at);
  }
  out.map_covariance = evidence.map_covariance(rows, rows);
  for (auto& [id, tag] : tags) {
    // One that a single run sees and nothing holds tells nothing new.
    if (seen[id].size() < 2) continue;
    out.tags.push_back(std::move(tag));
    runs_of_tag->push_back(seen[id]);
  }
  return out;
}

// The fixes that take part; poses: the run's own.
std::vector<std::vector<GpsPlace>> GpsOf(const std::vector<SiteRun>& runs, bool all) {
  std::vector<std::vector<GpsPlace>> gps;
  for (const SiteRun& run : runs) {
    const auto& geo = run.solution.georeference;
    gps.push_back(all || (geo && geo->source == "gps") ? run.gps : std::vector<GpsPlace>());
  }
  return gps;
}

// Runs as sets of those that panoramas and tags tie to each other; what holds them in the world is one more member.
UnionFind TiesOf(const std::vector<SiteRun>& runs, const std::vector<PlacedRun>& placed,
                 const std::vector<std::vector<GpsPlace>>& gps, const WorldEvidence& evidence) {
  const auto world = static_cast<int>(runs.size());
  UnionFind ties(world + 1);
  std::map<std::string, int> shown_by;
  for (int r = 0; r < world; ++r) {
    const SiteRun& run = runs[static_cast<size_t>(r)];
    const std::vector<int>& elsewhere = placed[static_cast<size_t>(r)].elsewhere;
    const auto tie = [&](const std::string& name, bool held) {
      ties.Join(shown_by.try_emplace(name, r).first->second, r);
      if (held) ties.Join(world, r);
    };
    if (!gps[static_cast<size_t>(r)].empty()) ties.Join(world, r);
    for (size_t i = 0; i < run.solution.references.size(); ++i) {
      const SolutionReference& reference = run.solution.references[i];
      if (reference.pose < 0 || reference.status != "localized") continue;
      if (std::find(elsewhere.begin(), elsewhere.end(), static_cast<int>(i)) != elsewhere.end()) continue;
      const bool same = i < run.input.references.size();  // joining throws where it is not
      tie("panorama " + reference.name, same && run.input.references[i].geotag.has_position);
    }
    for (const WorldTag& tag : run.tags) {
      tie(fmt::format("tag {}", tag.id), std::any_of(evidence.tags.begin(), evidence.tags.end(),
                                                     [&](const WorldTag& known) { return known.id == tag.id; }));
    }
  }
  return ties;
}

// The runs that are not in the set of the world.
std::vector<int> LooseRuns(UnionFind ties, size_t runs) {
  std::vector<int> loose;
  const auto world = static_cast<int>(runs);
  for (int r = 0; r < world; ++r) {
    if (ties.Root(r) != ties.Root(world)) loose.push_back(r);
  }
  return loose;
}

// Where each body of the runs is by its run alone. One without a georeference lies where the others put it.
std::vector<Rigid3d> PosesAlone(const std::vector<SiteRun>& runs, const std::vector<PlacedRun>& placed) {
  std::vector<Rigid3d> poses;
  for (size_t i = 0; i < runs.size(); ++i) {
    const Solution& s = runs[i].solution;
    const Sim3d& world_from_odom = s.georeference ? s.georeference->world_from_odom : *placed[i].world_from_odom;
    for (size_t k = 0; k < s.pose_stamps.size(); ++k)
      poses.push_back(world_from_odom.TransformPose(OdomFromRig(s, static_cast<int>(k))).Inverse());
  }
  return poses;
}

// What was said of the panoramas' places against where they are now.
void NoteGeotags(const GeoStart& start, const GeoRegistrationOptions& options, JoinedRuns* joined) {
  const BundleProblem& p = joined->reconstruction.problem;
  for (SolutionReference& r : joined->references) r.geotag.clear();
  for (size_t i = 0; i < start.observations.size(); ++i) {
    const GeoObservation& o = start.observations[i];
    if (!o.has_position) continue;
    SolutionReference& r = joined->references[static_cast<size_t>(start.references[i])];
    r.geotag_difference = o.position - p.poses[static_cast<size_t>(r.pose)].TargetOriginInSource();
    r.geotag = IsOutlier(o, r.geotag_difference, options) ? "outlier" : "ok";
    if (!o.has_height) r.geotag_difference.z() = std::nan("");
  }
}

Solution SolutionOf(JoinedRuns&& joined, const WorldFit& fit, std::vector<Matrix6d> covariances) {
  Solution s;
  static_cast<Reconstruction&>(s) = std::move(joined.reconstruction);
  s.run = "site";
  s.runs = std::move(joined.runs);
  s.cameras = std::move(joined.input.cameras);
  for (BodyCamera& camera : s.cameras) camera.mask = {};
  s.images = std::move(joined.input.images);
  s.pose_stamps = std::move(joined.input.pose_stamps);
  s.covariances = std::move(covariances);
  s.references = std::move(joined.references);
  SolutionGeoreference& geo = s.georeference.emplace();
  geo.source = SourceOf(fit);
  geo.origin = joined.input.frame.origin();
  geo.with_poses.assign(s.problem.poses.size(), Eigen::Matrix<double, 6, 7>::Zero());
  return s;
}

// Points that images of several runs see, counted for each of these.
void CountSharedPoints(const JoinedRuns& joined, std::vector<RunInSite>* runs) {
  const Reconstruction& r = joined.reconstruction;
  std::set<int> of_point;
  for (size_t k = 0; k < r.image_of.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    if (r.image_of[k] >= 0 && o.active) of_point.insert(joined.run_of_image[static_cast<size_t>(r.image_of[k])]);
    if (k + 1 < r.image_of.size() && r.problem.observations[k + 1].point == o.point) continue;
    for (int run : of_point) (*runs)[static_cast<size_t>(run)].shared_points += of_point.size() > 1 ? 1 : 0;
    of_point.clear();
  }
}

std::vector<RunInSite> FactsOf(const JoinedRuns& joined, const std::vector<std::set<int>>& runs_of_tag,
                               const std::vector<Rigid3d>& before, const BundleCovariance& covariance) {
  std::vector<RunInSite> runs(joined.runs.size());
  const BundleProblem& p = joined.reconstruction.problem;
  for (size_t r = 0; r < runs.size(); ++r) {
    runs[r].name = joined.runs[r].name;
    runs[r].scale = p.scales[r].value;
    runs[r].scale_sigma = std::sqrt(covariance.ScaleVariance(static_cast<int>(r)));
  }
  for (size_t i = 0; i < joined.input.images.size(); ++i) {
    RunInSite& run = runs[static_cast<size_t>(joined.run_of_image[i])];
    ++run.images;
    const auto pose = static_cast<size_t>(joined.input.images[i].pose);
    const double move = (before[pose].TargetOriginInSource() - p.poses[pose].TargetOriginInSource()).norm();
    run.largest_move_m = std::max(run.largest_move_m, move);
  }
  for (const std::vector<int>& of : joined.runs_of_reference) {
    for (int run : of) runs[static_cast<size_t>(run)].shared_panoramas += of.size() > 1 ? 1 : 0;
  }
  for (const std::set<int>& of : runs_of_tag) {
    for (int run : of) runs[static_cast<size_t>(run)].shared_tags += of.size() > 1 ? 1 : 0;
  }
  CountSharedPoints(joined, &runs);
  return runs;
}

void CheckDatum(const GeoStart& start, const SiteFitInput& site, const WorldEvidence& world) {
  const auto placed = [](const GeoObservation& o) { return o.has_position; };
  const auto held = [](const WorldTag& tag) { return tag.world_from_tag || !tag.control.empty(); };
  if (std::any_of(start.observations.begin(), start.observations.end(), placed) ||
      std::any_of(world.tags.begin(), world.tags.end(), held) ||
      std::any_of(site.gps.begin(), site.gps.end(), [](const auto& gps) { return !gps.empty(); })) {
    return;
  }
  throw InputError(
      "nothing holds the site's datum: no localized panorama has a geotag, and no run is georeferenced by GPS; use "
      "control "
      "or the survey's tags (--use control, --use tags)");
}

void WarnOfMoved(const std::vector<TagInRun>& moved, const JoinedRuns& joined, std::vector<std::string>* warnings) {
  for (const TagInRun& tag : moved) {
    warnings->push_back(
        fmt::format("tag {} stands elsewhere in run {} than in the other runs: it is left out of that run", tag.tag_id,
                    joined.runs[static_cast<size_t>(tag.run)].name));
  }
}

// Runs that nothing but what holds them in the world ties to the others.
void WarnOfLonely(const std::vector<RunInSite>& runs, std::vector<std::string>* warnings) {
  for (const RunInSite& run : runs) {
    if (runs.size() < 2 || run.shared_panoramas + run.shared_tags + run.shared_points > 0) continue;
    warnings->push_back("run " + run.name +
                        " shares no panorama, tag or point with the others: its own geotags, GPS or tags of the map "
                        "alone place it");
  }
}

}  // namespace

std::vector<std::string> SiteOptions::Check() const { return CheckRanges(*this); }

SiteAdjustment AdjustSite(std::vector<SiteRun> runs, const WorldEvidence& evidence, const SiteOptions& options,
                          int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
  SiteAdjustment out;
  std::vector<PlacedRun> placed = PlaceRuns(runs, evidence, &out.warnings);
  LeaveOutUnplaced(&runs, &placed, &out.warnings);
  const std::vector<Rigid3d> before = PosesAlone(runs, placed);
  SiteFitInput site;
  site.gps = GpsOf(runs, evidence.gps);
  UnionFind ties = TiesOf(runs, placed, site.gps, evidence);
  // Joining gives up the runs' solutions.
  std::vector<SiteRun> kept = LooseRuns(ties, runs.size()).empty() ? std::vector<SiteRun>() : runs;
  JoinedRuns joined = JoinRuns(&runs, placed, options.geo.tilt_sigma_deg * kDegToRad);
  Reconstruction& r = joined.reconstruction;
  const RunLinks links = LinkRuns(joined, options.links, options.registration, threads, seed, progress, cancel);
  out.links_tried = links.tried, out.links_found = links.found, out.links_refused = links.refused;
  for (const auto& [a, b] : links.pairs) {
    ties.Join(joined.run_of_point[static_cast<size_t>(a)], joined.run_of_point[static_cast<size_t>(b)]);
  }
  if (LeaveOutLoose(LooseRuns(ties, runs.size()), &kept, &out.warnings)) {
    return WithWarnings(std::move(out.warnings),
                        AdjustSite(std::move(kept), evidence, options, threads, seed, progress, cancel));
  }
  for (size_t i = 0; i < site.gps.size(); ++i) {
    for (GpsPlace& place : site.gps[i]) place.pose += joined.runs[i].first_pose;
  }

  std::vector<std::set<int>> runs_of_tag;
  const WorldEvidence world = JoinTags(runs, joined, evidence, &runs_of_tag);
  for (const WorldTag& tag : world.tags) out.tags.push_back(tag.id);
  std::vector<int> pose_of;
  for (const SolutionReference& reference : joined.references) pose_of.push_back(reference.pose);
  const GeoStart start = GeotagsOf(joined.input, pose_of, r.problem);
  site.run_of_image = joined.run_of_image;
  site.links = links.factors;
  site.after_links = [&] {
    PointPairs pairs = PairsByPanoramas(joined);
    pairs.insert(pairs.end(), links.pairs.begin(), links.pairs.end());
    MergePoints(pairs, options.outlier_chi2, &joined, threads, cancel);
  };
  CheckDatum(start, site, world);
  const BundleOptions bundle{.threads = threads};
  std::vector<TagInRun> moved;
  out.fit =
      FitSite(joined.input, start, site, world, options.geo, bundle, &r.problem, &r.summary, &moved, progress, cancel);
  out.warnings.insert(out.warnings.end(), out.fit.warnings.begin(), out.fit.warnings.end());
  WarnOfMoved(moved, joined, &out.warnings);
  NoteGeotags(start, options.geo, &joined);
  BundleCovariance covariance(r.problem, threads, cancel);
  out.runs = FactsOf(joined, runs_of_tag, before, covariance);
  WarnOfLonely(out.runs, &out.warnings);
  out.runs_of_reference = joined.runs_of_reference;
  std::vector<Matrix6d> covariances, unused;
  std::move(covariance).PoseBlocks({}, &covariances, &unused);
  out.solution = SolutionOf(std::move(joined), out.fit, std::move(covariances));
  return out;
}

}  // namespace trigpoint
