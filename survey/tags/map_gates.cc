// What is set apart or left out before the first solution: sheets that hang elsewhere in another run, pictures and
// surveyed points that the start contradicts by far. With their full weight they would bend everything, and a start
// that is far off may not converge.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/base/median.h"
#include "survey/tags/control.h"
#include "survey/tags/map_solver.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kVisitPx = 15;      // agreement of a visit's pictures
constexpr double kStartGatePx = 60;  // a sight that the start contradicts by more waits for the first solution
constexpr double kTurned_rad = 45 * kDegToRad;
constexpr double kElsewhere_m = 1.5;     // from where the map has it: a step of odometry is shorter
constexpr double kOfDistance = 0.1;      // odometry drifts by less of the way between two tags
constexpr size_t kNeighbours = 2;        // tags of a run before and after another
constexpr double kPointWaits_m = 1;      // a surveyed point this much farther off than the others waits
constexpr double kTimesMedian = 4;       // and by as much of what the others are off
constexpr double kPointReturns_m = 0.5;  // after the first solution

}  // namespace

// Where a picture by itself shows its tag: the planar solutions, in the map. The picture's frame is placed.
std::vector<Rigid3d> MapSolver::PlanarPlaces(const MapSight& s) const {
  const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
  const Rigid3d world_from_cam =
      *frame.world_from_body *
      input_.runs[static_cast<size_t>(frame.run)].cameras[static_cast<size_t>(s.camera)].cam_from_body.Inverse();
  std::vector<Rigid3d> places;
  for (const PlanarPose& pose : EstimatePlanarPoses(s.sight, SizeOf(s.place))) {
    places.push_back(world_from_cam * pose.cam_from_tag);
  }
  return places;
}

// First guesses of places that were split off before the start: the planar solution that most of its pictures share.
void MapSolver::PlaceSplit() {
  for (size_t k = 0; k < moved_.size(); ++k) {
    const int place = -1 - static_cast<int>(k);
    std::vector<const MapSight*> sights;
    for (const MapSight& s : start_.sights) {
      if (s.place == place && Placed(s.frame)) sights.push_back(&s);
    }
    double best = std::numeric_limits<double>::infinity();
    std::optional<Rigid3d> found;
    for (const MapSight* s : sights) {
      for (const Rigid3d& world_from_tag : PlanarPlaces(*s)) {
        tags_[place] = world_from_tag;
        double sum = 0;
        for (const MapSight* other : sights) sum += std::min(kStartGatePx, SightPx(*other));
        if (sum < best) best = sum, found = tags_[place];
      }
    }
    tags_.erase(place);
    if (found) tags_[place] = *found;
  }
}

// How a sheet is turned in its plane is never in doubt, unlike how it is tilted: a small picture has two solutions.
// What counts is the part of the turn about the sheet's normal.
bool MapSolver::IsTurned(const Rigid3d& in_map, const Rigid3d& in_run) {
  const Eigen::Quaterniond turn = in_map.rotation.conjugate() * in_run.rotation;
  return 2 * std::atan2(std::abs(turn.z()), std::abs(turn.w())) >= kTurned_rad;
}

// Tags of a run that its pictures show elsewhere than the map has them, while the tags passed before and after are
// where they are: odometry drifts from tag to tag and jumps for all that follow.
std::set<int> MapSolver::ElsewhereIn(size_t run) const {
  if (input_.runs[run].stills) return {};  // one picture of a tag from one place: its distance is hardly known
  std::vector<int> order;                  // by the time of the first picture
  std::set<int> known;
  for (const MapSight& s : start_.sights) {
    const int id = s.place;
    if (start_.frames[static_cast<size_t>(s.frame)].run != static_cast<int>(run) || tags_.count(id) == 0 ||
        start_.by_run[run].count(id) == 0)
      continue;
    if (known.insert(id).second) order.push_back(id);
  }
  const auto off = [&](int id) {
    return Eigen::Vector3d(start_.by_run[run].at(id).translation - tags_.at(id).translation);
  };
  std::set<int> elsewhere;
  for (size_t i = 0; i < order.size(); ++i) {
    size_t neighbours = 0, agree = 0;
    for (size_t k = i - std::min(i, kNeighbours); k <= std::min(i + kNeighbours, order.size() - 1); ++k) {
      if (k == i) continue;
      const double apart = (tags_.at(order[k]).translation - tags_.at(order[i]).translation).norm();
      ++neighbours;
      agree += (off(order[i]) - off(order[k])).norm() <= kElsewhere_m + kOfDistance * apart ? 1 : 0;
    }
    if (neighbours >= kNeighbours && agree == 0) elsewhere.insert(order[i]);
  }
  return elsewhere;
}

// A sheet that hangs turned or elsewhere in another run is given a place of its own at once.
void MapSolver::SplitElsewhere() {
  for (size_t r = 0; r < start_.by_run.size(); ++r) {
    const std::set<int> elsewhere = ElsewhereIn(r);
    for (const auto& [id, by_its_pictures] : start_.by_run[r]) {
      const auto tag = tags_.find(id);
      if (tag == tags_.end() || (!elsewhere.contains(id) && !IsTurned(tag->second, by_its_pictures))) continue;
      if (!GivePlace(id, static_cast<int>(r), by_its_pictures).empty()) LeaveOutControlOn(id);
    }
  }
}

// How far the present map has a control point from where it was surveyed; nothing if it does not have it.
std::optional<double> MapSolver::ControlOff(const SurveyPoint& p) const {
  if (p.role != PointRole::kControl) return std::nullopt;
  if (p.tag_id < 0) {
    const auto mark = marked_.find(p.name);
    return mark == marked_.end() ? std::nullopt : std::optional((mark->second - p.world_m).norm());
  }
  const auto tag = tags_.find(p.tag_id);
  if (tag == tags_.end()) return std::nullopt;
  return (tag->second * Lever(p) + OffsetInWorld(p, tag->second) - p.world_m).norm();
}

// Control that is much farther off than the rest waits for the first solution, if enough is left.
void MapSolver::GateControl() {
  std::vector<double> all;
  for (const SurveyPoint& p : datum_points_) {
    if (const auto off = ControlOff(p); off && !Excluded(p)) all.push_back(*off);
  }
  for (const SurveyPoint& p : datum_points_) {
    if (const auto off = ControlOff(p); off && *off > kPointWaits_m) far_at_start_.push_back(p.name);
  }
  if (all.size() < 4) return;
  const double most = kPointWaits_m + kTimesMedian * Median(std::move(all));
  std::set<std::string> far;
  std::vector<Eigen::Vector3d> left;
  for (const SurveyPoint& p : datum_points_) {
    const auto off = ControlOff(p);
    if (!off || Excluded(p)) continue;
    if (*off > most) far.insert(p.name);
    if (*off <= most) left.push_back(p.world_m);
  }
  if (!AreWellSpread(left)) return;
  waiting_ = far;
  excluded_.insert(far.begin(), far.end());
}

// Takes control back that fits the first solution.
void MapSolver::ReturnControl() {
  for (const SurveyPoint& p : datum_points_) {
    const auto off = ControlOff(p);
    if (waiting_.count(p.name) > 0 && off && *off < kPointReturns_m) excluded_.erase(p.name);
  }
  waiting_.clear();
}

// Pictures of one tag by one run, without a gap; those of placed frames and tags.
std::vector<std::vector<MapSight*>> MapSolver::Visits() {
  std::map<std::pair<int, int>, std::vector<MapSight*>> of_tag;  // run and place, ascending time
  for (MapSight& s : start_.sights) {
    if (!Placed(s.frame) || tags_.count(s.place) == 0) continue;
    of_tag[{start_.frames[static_cast<size_t>(s.frame)].run, s.place}].push_back(&s);
  }
  std::vector<std::vector<MapSight*>> visits;
  for (const auto& [key, sights] : of_tag) {
    int64_t last = 0;
    for (MapSight* s : sights) {
      const int64_t stamp = start_.frames[static_cast<size_t>(s->frame)].stamp_ns;
      if (s == sights.front() || stamp - last > kVisitGap_ns) visits.emplace_back();
      visits.back().push_back(s);
      last = stamp;
    }
  }
  return visits;
}

// Leaves out pictures that the start contradicts by far; they are tested again after the first solution. Pictures of a
// visit that agree among themselves are kept: there odometry has drifted.
void MapSolver::GateStart() {
  const std::vector<std::vector<MapSight*>> visits = Visits();
  for (const std::vector<MapSight*>& visit : visits) {
    for (MapSight* s : visit) s->rejected = SightPx(*s) > kStartGatePx;
  }
  for (const std::vector<MapSight*>& visit : visits) {
    const bool any_fits = std::any_of(visit.begin(), visit.end(), [](const MapSight* s) { return !s->rejected; });
    if (any_fits || visit.size() < kLeastVisit) continue;
    // The planar solution of one of them that fits most.
    const int place = visit.front()->place;
    const Rigid3d in_map = tags_.at(place);
    std::vector<MapSight*> most;
    for (const MapSight* s : visit) {
      for (const Rigid3d& world_from_tag : PlanarPlaces(*s)) {
        tags_[place] = world_from_tag;
        std::vector<MapSight*> fitting;
        std::copy_if(visit.begin(), visit.end(), std::back_inserter(fitting),
                     [&](const MapSight* other) { return SightPx(*other) < kVisitPx; });
        if (fitting.size() > most.size()) most = fitting;
      }
    }
    tags_[place] = in_map;
    if (most.size() < kLeastVisit) continue;
    for (MapSight* s : most) s->rejected = false;
  }
}

}  // namespace trigpoint
