// An id that hangs at two places, seen before anything is solved: odometry drifts by percents of its way, and a tag
// that it finds again much farther off is another sheet with the same number.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/base/median.h"
#include "survey/tags/map_start.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

// Odometry between two visits may be off by this much: a step, a part of the way, and a part of the distance to the
// tag.
constexpr double kStep_m = 0.5, kOfWay = 0.1, kOfRange = 0.2;

struct Visit {
  int run = 0;
  int64_t first_ns = 0, last_ns = 0;
  double first_way_m = 0, last_way_m = 0;  // along the odometry
  double range_m = 0;                      // nearest
  std::vector<int> sights;
  std::vector<double> x, y, z;
  int group = 0;  // of visits of one place
  Eigen::Vector3d Place() const { return {Median(x), Median(y), Median(z)}; }
  Eigen::Vector3d LastPlace() const { return {x.back(), y.back(), z.back()}; }
};

struct Seen {
  int sight = 0;
  int64_t stamp_ns = 0;
  double way_m = 0, range_m = 0;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // of the tag's centre, odometry frame
};

bool IsOff(const Visit& before, const Visit& now) {
  const double way = now.first_way_m - before.last_way_m;
  return (now.Place() - before.Place()).norm() > kStep_m + kOfWay * way + kOfRange * (before.range_m + now.range_m);
}

std::vector<Visit> VisitsOf(int run, const std::vector<Seen>& seen) {
  std::vector<Visit> visits;
  for (const Seen& s : seen) {
    const bool goes_on =
        !visits.empty() && s.stamp_ns - visits.back().last_ns <= kVisitGap_ns &&
        (s.place - visits.back().LastPlace()).norm() < kStep_m + kOfRange * (s.range_m + visits.back().range_m);
    if (!goes_on) visits.push_back({run, s.stamp_ns, s.stamp_ns, s.way_m, s.way_m, s.range_m, {}, {}, {}, {}, 0});
    Visit& visit = visits.back();
    visit.last_ns = s.stamp_ns;
    visit.last_way_m = s.way_m;
    visit.range_m = std::min(visit.range_m, s.range_m);
    visit.sights.push_back(s.sight);
    visit.x.push_back(s.place.x()), visit.y.push_back(s.place.y()), visit.z.push_back(s.place.z());
  }
  // One picture may be a mistake.
  std::erase_if(visits, [](const Visit& v) { return v.sights.size() < 2; });
  return visits;
}

// By id, ascending time.
std::map<int, std::vector<Seen>> SeenIn(const SurveyInput& input, int run, const MapStart& start) {
  std::map<int, std::vector<Seen>> seen;
  const SurveyRun& its = input.runs[static_cast<size_t>(run)];
  double way = 0;
  std::optional<Eigen::Vector3d> last;
  for (const MapFrame& frame : start.frames) {
    if (frame.run != run || !frame.odom_from_body) continue;
    if (last) way += (frame.odom_from_body->translation - *last).norm();
    last = frame.odom_from_body->translation;
    for (int i : frame.sights) {
      const MapSight& s = start.sights[static_cast<size_t>(i)];
      const auto poses = EstimatePlanarPoses(s.sight, input.sizes.SizeOf(s.detection.id));
      if (poses.empty()) continue;
      const Eigen::Vector3d& in_camera = poses.front().cam_from_tag.translation;  // both solutions share the centre
      const Rigid3d body_from_cam = its.cameras[static_cast<size_t>(s.camera)].cam_from_body.Inverse();
      seen[s.detection.id].push_back(
          {i, frame.stamp_ns, way, in_camera.norm(), *frame.odom_from_body * (body_from_cam * in_camera)});
    }
  }
  return seen;
}

// Ids that are not where they were over a stretch of a run. Two tags that say so of the same stretch: odometry jumped.
std::set<int> JumpingIds(const std::map<int, std::vector<Visit>>& visits) {
  struct Jump {
    int id, run;
    int64_t from_ns, to_ns;
  };
  std::vector<Jump> jumps;
  for (const auto& [id, its] : visits) {
    for (size_t k = 1; k < its.size(); ++k) {
      if (its[k].run == its[k - 1].run && IsOff(its[k - 1], its[k]))
        jumps.push_back({id, its[k].run, its[k - 1].last_ns, its[k].first_ns});
    }
  }
  std::set<int> ids;
  for (const Jump& jump : jumps) {
    const bool shared = std::any_of(jumps.begin(), jumps.end(), [&](const Jump& other) {
      return other.id != jump.id && other.run == jump.run && other.from_ns < jump.to_ns && jump.from_ns < other.to_ns;
    });
    if (!shared) ids.insert(jump.id);
  }
  return ids;
}

// A visit belongs to the place whose last visit it agrees with. The number of places.
int GroupByPlace(std::vector<Visit>* visits) {
  int groups = 0;
  for (size_t k = 0; k < visits->size(); ++k) {
    Visit& visit = (*visits)[k];
    visit.group = -1;
    for (size_t before = k; before-- > 0 && visit.group < 0;) {
      const Visit& earlier = (*visits)[before];
      if (earlier.run == visit.run && !IsOff(earlier, visit)) visit.group = earlier.group;
    }
    if (visit.group < 0) visit.group = groups++;
  }
  return groups;
}

}  // namespace

std::vector<SplitPlace> SplitDuplicates(const SurveyInput& input, MapStart* start) {
  std::map<int, std::vector<Visit>> visits;  // by id, run after run, ascending time
  for (int run = 0; run < static_cast<int>(input.runs.size()); ++run) {
    for (const auto& [id, its] : SeenIn(input, run, *start)) {
      std::vector<Visit> found = VisitsOf(run, its);
      visits[id].insert(visits[id].end(), found.begin(), found.end());
    }
  }
  std::vector<SplitPlace> places;
  for (const int id : JumpingIds(visits)) {
    std::vector<Visit>& its = visits.at(id);
    const int groups = GroupByPlace(&its);
    std::vector<size_t> pictures(static_cast<size_t>(groups));
    for (const Visit& v : its) pictures[static_cast<size_t>(v.group)] += v.sights.size();
    const auto most = std::max_element(pictures.begin(), pictures.end()) - pictures.begin();
    for (int group = 0; group < groups; ++group) {
      if (group == most) continue;
      SplitPlace split;
      split.tag_id = id;
      for (const Visit& v : its) {
        if (v.group != group) continue;
        split.run = v.run;
        for (int i : v.sights) start->sights[static_cast<size_t>(i)].place = -1 - static_cast<int>(places.size());
      }
      places.push_back(split);
    }
    // Pictures of no visit don't say which of the places they show.
    std::set<int> told;
    for (const Visit& v : its) told.insert(v.sights.begin(), v.sights.end());
    for (size_t i = 0; i < start->sights.size(); ++i) {
      MapSight& s = start->sights[i];
      if (s.detection.id == id && told.count(static_cast<int>(i)) == 0) s.place = kNoPlace;
    }
  }
  // The start is looked for without them.
  for (MapFrame& frame : start->frames) {
    std::erase_if(frame.sights, [&](int i) { return start->sights[static_cast<size_t>(i)].place < 0; });
  }
  return places;
}

}  // namespace trigpoint
