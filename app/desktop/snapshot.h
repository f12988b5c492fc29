// What the desktop knows of a project at one moment: plain values, read in the background, never changed. No Qt here.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "eval/text/display_unit.h"

namespace trigpoint {

class Project;
struct JobQuery;

struct SnapshotImage {
  std::string file;  // as in images.txt
  std::filesystem::path path;
  int64_t stamp_ns = 0;
  int camera = 0;
  int video_frame = -1;
};

struct SnapshotRun {
  std::string name, role, date;
  std::string broken;  // why nothing of it can be used
  bool mirrored = false;
  std::vector<SnapshotImage> images;
  std::vector<std::string> cameras;
};

struct SnapshotReference {
  std::string kind;  // panorama, photo, photo set
  std::string name, station;
  int listed = -1;  // index of its station among those listed; -1: stations.csv has none for it
  std::vector<std::filesystem::path> files;
};

struct SnapshotStation {
  std::string name;
  int tag_id = -1;
};

struct SnapshotControl {
  std::string object, name, role;  // control or check, review included
  int tag_id = -1;                 // at its centre or a corner; -1: marked in images
};

// What a result is in one number or word: "detections 42", "median 0.344 m", "passed".
struct StageMetric {
  enum class Kind { kNone, kCount, kNumber, kLength, kWord };
  Kind kind = Kind::kNone;
  std::string name;  // of the number; else the word
  double value = 0;  // a length: in metres
  std::string unit;  // of a number that is no length; may be empty
  std::string Text(const DisplayUnit& shown) const;
};

struct SnapshotResult {
  std::string stage, run, variant, title;
  std::string state;   // done, out of date, failed, running, missing, not needed; empty: not looked at yet
  std::string reason;  // of a failure
  StageMetric metric;
  double seconds = 0;                 // that it took; 0: not known
  std::optional<uint64_t> seed = {};  // that it was made with; nothing: not known
};

struct Snapshot {
  std::filesystem::path dir;
  std::string name;
  std::vector<std::string> problems;  // what keeps parts of it from opening, one sentence each
  std::vector<std::string> warnings;
  std::vector<SnapshotRun> runs;
  std::vector<SnapshotReference> references;
  std::vector<SnapshotStation> stations;
  std::vector<SnapshotControl> controls;
  std::vector<int> tags;
  std::set<std::string> excluded;  // objects that the review leaves out
  std::vector<std::string> variants;
  std::shared_ptr<const Project> project;

  const SnapshotRun* FindRun(const std::string& run) const;
  // The object itself and what belongs to it: a station's tag, control point, panoramas and sets, and back; image and
  // tag of a detection.
  std::set<std::string> Related(const std::string& object) const;
};

// Opens a project as far as it can be opened; what cannot is in `problems`. Throws InputError if there is no folder.
std::shared_ptr<const Snapshot> OpenSnapshot(const std::filesystem::path& dir);
// The state of every result; reads and hashes inputs that were never hashed before.
std::vector<SnapshotResult> StatesOfSnapshot(const Snapshot& snapshot);
// Stage, title and metric of what is there, without asking whether it is out of date: fast.
std::vector<SnapshotResult> ResultsOfSnapshot(const Snapshot& snapshot);

// How long what a query would compute again took the last time, and how many results that are not there it would make.
struct ExpectedTime {
  double seconds = 0;  // of all that are computed again
  int again = 0, never_made = 0;
  int unchecked = 0;                     // whether these are out of date is not known yet
  double unchecked_s = 0;                // that they took
  std::map<std::string, double> of_job;  // seconds of each that is computed again, by its title
};
// Results of another seed are computed again.
ExpectedTime ExpectedTimeOf(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, const JobQuery& query,
                            uint64_t seed = 1);
// Whether each result of a query was made with the options and decisions of now, or was kept beside its successor when
// a decision replaced it. Does not look at the inputs' contents: fast.
bool AreKept(const Snapshot& snapshot, const JobQuery& query);

}  // namespace trigpoint
