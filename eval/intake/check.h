// check: is what was recorded enough, while still on site?
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/project/forked.h"
#include "datasets/project/project.h"
#include "datasets/project/stage.h"
#include "eval/intake/pairs.h"
#include "eval/intake/pictures.h"
#include "eval/plan/map.h"
#include "eval/report/drawing.h"
#include "eval/text/display_unit.h"
#include "survey/field/advice.h"
#include "survey/field/findings.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

// Of runs that can take part in a map, by name.
using SeenTags = std::map<std::string, std::vector<ImageDetections>>;

// What the survey makes its map of.
struct MapInput {
  SurveyInput input;
  std::vector<std::string> warnings;
};

// Limits of predicted sigmas, m; 0: none.
struct PredictedLimits {
  double any_axis = 0, tag = 0, camera = 0;  // of the worst tag's axis, the worst tag, 95 % of the cameras
};

// What the stages of a project would work with. Each throws OptionError where the project's options are wrong.
struct CheckSources {
  std::function<DetectTagsOptions(const Project&)> detector;
  std::function<SurveyOptions(const Project&)> map;
  // Of these tags and nothing else; throws InputError where no map can be made of them.
  std::function<MapInput(StageContext&, const SeenTags&)> map_input;
  std::function<NetworkOptions(const Project&)> network;
  std::function<PredictedLimits(const Project&)> limits;
};

struct CheckOutcome {
  std::shared_ptr<const Project> project;  // `facts` points into it
  FieldFacts facts;
  std::vector<SiteFinding> findings;  // red ones first
  std::vector<Advice> advice;         // most valuable first
  Light light = Light::kGreen;        // the worst of the findings
  int pictures = 0, waiting = 0;      // looked at; still being copied or not looked at yet
  int planned_seen = 0;               // of facts.planned; of all tags where none are planned: those seen
};

// Reads a folder that grows. Its state is results/check/pictures.jsonl, so that another one goes on where it ended.
class SiteCheck {
 public:
  // Holds the lock of results/check, so that other commands work beside it. Throws InputError, IoError.
  SiteCheck(const std::filesystem::path& dir, CheckSources sources, int threads, uint64_t seed);
  // Reads the folder again and looks at no more than `most` new pictures. Returns how many.
  size_t Look(size_t most, ProgressSink& progress, const CancelToken& cancel);
  // Compares no more than `most` pairs of pictures that were looked at. Returns how many.
  size_t Compare(size_t most, ProgressSink& progress, const CancelToken& cancel);
  // What all of it shows.
  CheckOutcome Judge(ProgressSink& progress, const CancelToken& cancel);
  // Whether files are left that are still being copied.
  bool Waits() const;
  // Whether a photo set is being matched, in a process of its own: Look takes what it finds.
  bool MatchesSet() const { return matching_ != nullptr; }
  // Whether anything but a run's pictures changed since the last Judge: tables, odometry, panoramas, photos of sets, or
  // what a set shows.
  bool OthersChanged() const;
  const std::filesystem::path& out() const { return out_; }

 private:
  FieldRun PicturesOf(const Run& run) const;
  void AddPictures(CheckOutcome* outcome) const;
  void OpenReferenceLines();
  void ReadReferences();
  void AddReferences(CheckOutcome* outcome);
  void ReadSets();
  void WatchSets(ProgressSink& progress);
  void WatchVideos();
  void WatchReferences();
  void AddPlanned(FieldFacts* facts) const;
  SeenTags TagsOf(const FieldFacts& facts) const;
  // Of the runs that can take part; the others' reasons go to facts->unmapped. Nothing: none can, see map_problem.
  std::optional<MapInput> InputOf(SeenTags* tags, StageContext& context, FieldFacts* facts) const;
  void AddMap(FieldFacts* facts, ProgressSink& progress, const CancelToken& cancel) const;
  void AddSets(FieldFacts* facts) const;
  void JudgeGates(CheckOutcome* outcome) const;
  std::vector<std::pair<std::filesystem::path, FileStamp>> Others() const;

  // A photo set as the last Look found it.
  struct WatchedSet {
    std::string name;
    std::string like;  // names, sizes and times of its photos: an unchanged set is not matched again
    int photos = 0;
    bool stable = false;  // no photo of it is being copied
  };
  struct Matching {
    WatchedSet set;
    ForkedTask task;
  };

  std::filesystem::path dir_, out_;
  CheckSources sources_;
  int threads_;
  uint64_t seed_;
  std::unique_ptr<ProjectLock> lock_;
  std::shared_ptr<const Project> project_;
  std::vector<std::string> problems_;  // of opening it
  std::unique_ptr<PictureLog> log_;
  std::unique_ptr<PairLog> pairs_;
  std::unique_ptr<JsonLines> set_lines_, reference_lines_;
  FolderWatch watch_;
  std::map<std::string, int> waiting_;
  std::map<std::string, std::string> videos_arriving_, videos_unreadable_;  // as FieldFacts has them
  std::vector<WatchedSet> watched_sets_;
  bool references_arriving_ = false;  // a panorama or photo is being copied
  std::unique_ptr<Matching> matching_;
  std::map<std::string, std::pair<std::string, FieldSet>> sets_;  // by name: WatchedSet::like, what its photos show
  std::map<std::string, std::pair<FileStamp, std::string>> references_;  // by name: as it was read, why it cannot be
  std::vector<std::pair<std::filesystem::path, FileStamp>> judged_;      // Others at the last judgement
  bool set_matched_ = false;                                             // since the last judgement
};

// findings.csv, tags.csv, next.csv, summary.json; for people, in `unit`: map.svg, index.html. `refresh_s`: the page
// reloads itself, 0: never.
void WriteCheck(const CheckOutcome& outcome, const DisplayUnit& unit, int refresh_s,
                const std::filesystem::path& folder);
// Tags, the way so far, and where to stand next; nothing: no map can be made of it yet.
std::optional<Drawing> CheckMap(const CheckOutcome& outcome, const DisplayUnit& unit = {});
// "amber: 382 pictures of 2 runs, 12 pictures of 1 photo set, 8 of 9 tags seen".
std::string CheckHeadline(const CheckOutcome& outcome);

}  // namespace trigpoint
