// Starting values of a tag map: internal to survey/tags.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "survey/tags/tag_map.h"

namespace trigpoint {

// A tag in a picture of a frame.
struct MapSight {
  int frame = 0;
  int camera = 0;
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
};

struct MapStart {
  std::vector<MapFrame> frames;  // run by run, ascending time; only such that see a tag
  std::vector<MapSight> sights;
  std::map<int, Rigid3d> world_from_tag;
  std::vector<std::string> warnings;
  bool in_world = false;
};

// Frames and sights of the input; nothing estimated yet.
MapStart CollectSights(const SurveyInput& input, const SurveyOptions& options);

// Tag and body poses of each run, runs joined by common tags, the whole moved to the points (control first) or the
// fixed tag. Frames and tags that cannot be tied to the rest stay without a pose and are named in `warnings`.
void FindStart(const SurveyInput& input, const std::vector<SurveyPoint>& datum_points, int threads,
               const CancelToken& cancel, MapStart* start);

// The pictures of a map as views of EstimateTagPoses; `run` < 0: all.
std::vector<TagView> ViewsOf(const SurveyInput& input, const MapStart& start, int run);

}  // namespace trigpoint
