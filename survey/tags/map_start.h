// Starting values of a tag map: internal to survey/tags.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

constexpr int64_t kVisitGap_ns = 3'000'000'000;  // pictures of a tag within this time are one visit
constexpr int kNoPlace = std::numeric_limits<int>::min();

// A tag in a picture of a frame.
struct MapSight {
  int frame = 0;
  int camera = 0;
  int place = 0;  // of its tag: the id, until a tag is found to stand in several places; kNoPlace: nobody knows which
  TagDetection detection;
  TagSight sight;
  bool rejected = false;
};

// A body pose that is to be estimated.
struct MapFrame {
  int run = 0;
  int64_t stamp_ns = 0;
  std::optional<Rigid3d> odom_from_body;
  std::optional<Rigid3d> world_from_body;  // start value
  std::vector<int> sights;
  bool has_ties = false;  // scene points or marks tie it, too
};

struct MapStart {
  std::vector<MapFrame> frames;  // run by run, ascending time; such that see a tag or a scene point
  std::vector<MapSight> sights;
  std::map<int, Rigid3d> world_from_tag;
  std::vector<std::map<int, Rigid3d>> by_run;  // the same by the pictures of each run alone, where it is joined
  std::vector<std::string> warnings;
  std::map<std::string, Eigen::Vector3d> marked;  // points that are marked in pictures
  bool in_world = false;
};

// The frame of a run at a time, -1 if there is none.
int FrameAt(const MapStart& start, int run, int64_t stamp_ns);

// Where a point of a station stands from its tag's centre, world axes. `world_from_tag` must be levelled for offsets in
// the tag's levelled frame: right as a reader of the tag sees it, out towards the reader, up.
Eigen::Vector3d OffsetInWorld(const SurveyPoint& point, const Rigid3d& world_from_tag);
Eigen::Vector3d OffsetInWorld(const Station& station, const Rigid3d& world_from_tag);

// Frames and sights of the input; nothing estimated yet.
MapStart CollectSights(const SurveyInput& input, const SurveyOptions& options);

// A further place of an id, in one of the runs.
struct SplitPlace {
  int tag_id = 0, run = 0;
};

// Ids that are seen farther apart than odometry can have drifted: their sights are given places -1, -2, ... in the
// order of what is returned, but for the place with the most pictures, which keeps the id. Two tags that contradict
// odometry over the same stretch don't count: there it is odometry that jumped.
std::vector<SplitPlace> SplitDuplicates(const SurveyInput& input, MapStart* start);

// Tag and body poses of each run, runs joined by common tags, the whole moved to the points (control first) or the
// fixed tag. Frames and tags that cannot be tied to the rest stay without a pose and are named in `warnings`.
void FindStart(const SurveyInput& input, const std::vector<SurveyPoint>& datum_points, int threads,
               const CancelToken& cancel, MapStart* start);

// Body poses of a run along its odometry, tied anew to tags seen before wherever it comes back to them elsewhere:
// drift that is left in would make the pictures of whole visits look wrong. For FindStart.
void FollowOdometry(const SurveyInput& input, int run, MapStart* start);

// The pictures of a map as views of EstimateTagPoses; `run` < 0: all.
std::vector<TagView> ViewsOf(const SurveyInput& input, const MapStart& start, int run);

}  // namespace trigpoint
