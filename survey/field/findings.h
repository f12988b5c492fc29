// Is what was recorded enough, while one is still on site? From facts so far to findings in plain words.
//
// Everything here is a function of values: what reads the growing folder is eval/intake/pictures.h.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "calib/base/length_text.h"
#include "datasets/io/site.h"
#include "survey/field/picture_quality.h"
#include "survey/network/network.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// Green: nothing to do. Amber: worth another look before leaving. Red: without it a result will be missing or wrong.
enum class Light { kGreen, kAmber, kRed };
const char* LightName(Light light);  // green, amber, red

struct SiteFinding {
  Light light = Light::kGreen;
  std::string topic;  // tags, blur, exposure, lens, files, map, calibration, odometry, clock, gps, loops, stations, ...
  LengthText text;    // one sentence, plain words
};

struct FieldPicture {
  std::string image;  // as in images.txt
  int camera = 0;
  int64_t stamp_ns = 0;
  std::string version;                    // of its file and mask: another one is compared with its neighbours anew
  std::string problem;                    // why it cannot be used; empty: it can
  std::optional<PictureQuality> quality;  // none: the run brings detections in place of images
  std::vector<TagDetection> tags;
};

// Offset of odometry's clock against that of the pictures, as their rotations show it.
struct FieldClock {
  double offset_s = 0, sigma_s = 0;  // to be added to odometry's stamps; 1 sigma
  bool agrees = false;               // no offset lies within three sigma
  bool significant = false;          // another offset fits far better; if neither is true, rotations do not decide
};

// Two pictures of a run that were compared: one after the other, or both of one place at different times.
struct FieldPair {
  std::string from, to;  // pictures
  int shared = -1;       // features that agree with one relative pose; -1: not compared yet
  bool loop = false;     // `from` is of an earlier traversal
  double way_m = 0;      // along the run, at `to`
  int matched = 0;       // features that look alike, whether they agree with a pose or not
};

struct FieldRun {
  const Run* run = nullptr;
  std::vector<FieldPicture> pictures;  // looked at so far, ascending time
  int waiting = 0;                     // pictures that are still being copied or not looked at yet
  std::optional<FieldClock> clock;
  std::string unit_problem;     // odometry against GPS; empty: none
  std::string reading_problem;  // odometry against the pictures' motion; empty: none
  // Odometry that is meant otherwise than it is read: the run is in no map then.
  bool IsMisread() const { return !unit_problem.empty() || !reading_problem.empty(); }
  std::vector<FieldPair> pairs;
};

// A hand-held photo set, as far as its photos hang together.
struct FieldSet {
  std::string name;
  int photos = 0, placed = 0;
  bool full_turn = false;
  double gap_deg = 0;                 // widest part of the horizon that no photo sees
  std::string before_gap, after_gap;  // the photos on its left and right; empty: no gap
  std::string problem;                // why nothing is known; empty: something is
};
// What keeps the ring of a set from being closed. Photos that see the whole horizon need not hang together all round.
std::string WhyOpen(const FieldSet& set);

// One camera of a run, calibrated anew by the tags.
struct FieldCalibration {
  std::string run;
  double rms_px = 0;                         // of the tags' corners
  double corner_factor = 1;                  // residuals in units of the corners' own sigmas
  double focal_change = 0, focal_sigma = 0;  // logarithm of the focal length that fits the tags over the stated one
};

// What a tag is there for, and where, as far as that is known before it is seen.
struct PlannedTag {
  std::string what;  // "station S57, control"
  std::optional<Eigen::Vector3d> world_m;
};

struct FieldFacts {
  const Site* site = nullptr;
  std::vector<FieldRun> runs;
  std::vector<FieldSet> sets;
  std::map<std::string, int> sets_arriving;  // photos of sets that are still being copied
  // Runs whose video cannot be read yet: its name and size. It is still being copied, or no longer grows.
  std::map<std::string, std::string> videos_arriving, videos_unreadable;
  std::set<std::string> referenced;  // stations with a panorama, photo or photo set
  std::map<int, PlannedTag> planned;
  std::map<std::string, std::string> unreadable;  // panoramas and photos by name: why
  // The tag map of what was seen so far.
  std::optional<SurveyInput> input;
  std::optional<SurveyResult> map;
  std::string map_problem;            // why there is none
  std::vector<std::string> unmapped;  // why runs take no part in it
  std::string plan_problem;           // why plan.csv or plan.geojson cannot be used; empty: it can, or there is none
  std::vector<FieldCalibration> calibrations;
  // What `survey` will state, and from where the pictures were taken.
  std::optional<NetworkLayout> layout;
  std::optional<NetworkPrediction> prediction;
};

// Ids of the tags that pictures show, planned or not.
std::set<int> TagsSeen(const FieldFacts& facts);

// How well a tag is seen.
struct TagCoverage {
  int tag_id = -1;
  int pictures = 0, runs = 0;
  double largest_px = 0;                   // longest side in any picture
  std::optional<double> nearest_m;         // of a picture that takes part
  double left_deg = 0, right_deg = 0;      // pictures' directions from the tag: to the left and right of its
                                           // normal, as one faces it; left < right
  std::optional<Eigen::Vector3d> sigma_m;  // predicted, 1 sigma
  std::string status;                      // of TagEstimate; "not seen"; "not tied"
  double SpanDeg() const { return right_deg - left_deg; }
};
// Planned tags and those that were seen, ascending id.
std::vector<TagCoverage> CoverTags(const FieldFacts& facts);

// Where the cameras were within `radius_m` of a station's centre: pictures, and sectors of 30 degrees round it.
struct StationCoverage {
  std::string station;
  int pictures = 0, sectors = 0;
  double nearest_m = 0;
  bool reference = false;  // a panorama, photo or photo set of it is there
};
std::vector<StationCoverage> CoverStations(const FieldFacts& facts, double radius_m);

// Two pictures in a row that share fewer features than this are not connected.
inline constexpr int kLeastSharedInARow = 20;

// Does a run come back to where it was before, so that the drift of its odometry is known?
struct LoopCoverage {
  double length_m = 0;       // way from the first picture to the last
  int returns = 0;           // to tags that were passed before
  double last_return_m = 0;  // along the way
  int pictures_again = 0;    // that show places that were passed before
  int shared_tags = 0;       // with other runs
  bool open = false;         // long, never back at a place, and held by no other run's tags, geotag or GPS
};
// None without odometry or pictures.
std::optional<LoopCoverage> CoverLoop(const FieldFacts& facts, const FieldRun& run);

// What the pictures by themselves show: files, blur, lens, exposure, tags that are missing, photo sets.
std::vector<SiteFinding> FindInPictures(const FieldFacts& facts);
// What the map shows: tags that stand twice, moved or are barely held, calibration, odometry, loops, clock, stations.
std::vector<SiteFinding> FindInMap(const FieldFacts& facts);

// "a, b, c and 4 more".
std::string SomeOf(const std::vector<std::string>& names, size_t most = 4);
LengthText SomeOf(const std::vector<LengthText>& names, size_t most = 4);

}  // namespace trigpoint
