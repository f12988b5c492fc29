// The review: what people decided about single detections, images, stations and control points, who, when and why.
//
// review.jsonl at the top of the project holds one decision a line and is only ever appended to; what holds now follows
// from reading it from top to bottom. An object is named by its kind:
//   image:RUN/FILE            an image of a run, FILE as in images.txt ("@1000.5" by its time where it has no name)
//   detection:RUN/FILE#TAG    one tag in one image
//   tag:TAG                   a tag, wherever it is seen
//   station:NAME              a station
//   panorama:NAME             a panorama, photo or photo set as a reference
//   control:TAG               a control point: a tag's centre, TAG/CORNER a corner, or the name of a marked point
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

namespace trigpoint {

class Project;
struct ControlPoint;

// "image", "detection", "tag", "station", "panorama", "control".
const std::vector<std::string>& ReviewKinds();

// A line of review.jsonl.
struct ReviewEntry {
  int number = 0;      // counts from 1
  std::string action;  // exclude, restore, role, undo
  std::string object;
  std::string role;  // of action role: control or check
  int undoes = 0;    // of action undo: the number of the entry that it takes back
  std::string reason;
  std::string user;
  std::string time;      // UTC
  bool in_force = true;  // not taken back
};

// What holds after all entries. A plain value.
class Review {
 public:
  Review() = default;
  // A file that is not there is an empty review. A line that cannot be read is named in `warnings` and left out.
  static Review Read(const std::filesystem::path& file, std::vector<std::string>* warnings);

  const std::vector<ReviewEntry>& entries() const { return entries_; }
  bool Excludes(const std::string& object) const { return excluded_.count(object) > 0; }
  bool ExcludesImage(const std::string& run, const std::string& file, int64_t stamp_ns) const;
  // The detection itself, its image, or its tag.
  bool ExcludesDetection(const std::string& run, const std::string& file, int64_t stamp_ns, int tag_id) const;
  bool ExcludesStation(const std::string& name) const { return Excludes("station:" + name); }
  bool ExcludesPanorama(const std::string& name) const { return Excludes("panorama:" + name); }
  // The roles that were changed: object -> control or check.
  const std::map<std::string, std::string>& roles() const { return roles_; }
  const std::set<std::string>& excluded() const { return excluded_; }
  // What holds of the given kinds, of one run's images and detections where `run` is not empty; null if nothing does.
  // A result that heeds the review has this among its inputs.
  nlohmann::json InForce(const std::vector<std::string>& kinds, const std::string& run) const;

 private:
  std::vector<ReviewEntry> entries_;
  std::set<std::string> excluded_;
  std::map<std::string, std::string> roles_;
};

// "images/000012.jpg", or "@1000.5" for an image without a name.
std::string ReviewImageName(const std::string& file, int64_t stamp_ns);
// "57", "57/2" or the name of a marked point.
std::string ReviewControlName(const ControlPoint& point);

// The full name of an object of the project; a name without a kind is completed where only one thing has it ("S57",
// "run1/images/000012.jpg"). Throws InputError naming the nearest one.
std::string ResolveReviewObject(const Project& project, const std::string& action, const std::string& text);

// What is to be decided. `role` may be empty: the other one of control and check. The object of an undo may be
// "last", the number of an entry ("3"), or an object, whose last entry in force is taken back.
struct ReviewRequest {
  std::string action;  // exclude, restore, role, undo
  std::string object;
  std::string role;
  std::string reason;
  std::string user;  // empty: the user of this process
};

// Checks the request against the project and appends it to review.jsonl, all of it or nothing, beside other writers.
// Throws OptionError (unknown action, no reason), InputError (no such object, nothing to restore or to undo), IoError.
ReviewEntry AppendReview(const Project& project, const ReviewRequest& request);

// One line about an entry: "3 2026-05-12T09:43:20Z anna excludes station:S57: tag was moved".
std::string FormatReviewEntry(const ReviewEntry& entry);

}  // namespace trigpoint
