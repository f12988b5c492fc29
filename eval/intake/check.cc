#include "eval/intake/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/camchain.h"
#include "datasets/io/exif.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/site_sketch.h"
#include "datasets/project/options_json.h"
#include "eval/plan/findings.h"
#include "localize/reconstruct/odometry_unit.h"
#include "localize/reconstruct/self_calibration.h"
#include "survey/input/reference_tags.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kAdvice = 3;
constexpr double kMostOffset_s = 10;  // of odometry's clock that is looked for

std::optional<FieldClock> ClockOf(const FieldRun& run, const std::vector<MeasuredTurn>& turns) {
  const auto clock = FindOdometryClock(run.run->odometry, turns, kMostOffset_s);
  if (!clock) return std::nullopt;
  return FieldClock{clock->offset_s, clock->sigma_s, clock->agrees, clock->significant && clock->rate == 0};
}

// Odometry's clock, and how its poses are to be read.
void CompareTurns(const PairLog& pairs, FieldRun* run) {
  // A lens that is guessed shows rotations that are wrong by its focal length.
  const auto is_guess = [](const BodyCamera& c) { return c.focal_sigma_share >= kWildGuess; };
  if (std::any_of(run->run->cameras.begin(), run->run->cameras.end(), is_guess)) return;
  const std::vector<MeasuredTurn> turns = TurnsOf(*run, pairs);
  run->clock = ClockOf(*run, turns);
  if (run->clock && run->clock->significant) return;  // with its clock corrected it agrees
  run->reading_problem = FindOtherReading(*run->run, turns, "odometry.tum").value_or("");
}

}  // namespace

SiteCheck::SiteCheck(const fs::path& dir, CheckSources sources, int threads, uint64_t seed)
    : dir_(dir), out_(dir / "results" / "check"), sources_(std::move(sources)), threads_(threads), seed_(seed) {
  if (!fs::is_directory(dir)) {
    throw InputError(dir.string() + ": no such folder; expected the one that the recordings are copied to");
  }
  lock_ = std::make_unique<ProjectLock>(out_);
}

size_t SiteCheck::Look(size_t most, ProgressSink& progress, const CancelToken& cancel) {
  problems_.clear();
  project_ = std::make_shared<const Project>(Project::OpenTolerant(dir_, &problems_));
  const DetectTagsOptions options = sources_.detector(*project_);
  if (!log_) {
    log_ = std::make_unique<PictureLog>(
        out_ / "pictures.jsonl", nlohmann::json{{"schema", 2}, {"blur", 4}, {"detector", JsonFromOptions(options)}});
    pairs_ = std::make_unique<PairLog>(out_ / "pairs.jsonl");
    OpenReferenceLines();
  }
  waiting_.clear();
  std::vector<PendingPicture> pending = watch_.Pending(project_->site(), *log_, &waiting_);
  WatchVideos();
  WatchReferences();
  WatchSets(progress);
  for (size_t k = most; k < pending.size(); ++k) ++waiting_[pending[k].run->name];
  pending.resize(std::min(most, pending.size()));
  if (!pending.empty()) LookAtPictures(pending, options, log_.get(), threads_, progress, cancel);
  return pending.size();
}

// A video has its index at its end, so that no picture of it can be read before all of it is there.
void SiteCheck::WatchVideos() {
  videos_arriving_.clear();
  videos_unreadable_.clear();
  constexpr double kBytesPerMb = 1e6;
  for (const auto& [run, why] : project_->site().broken_runs) {
    std::error_code ignored;
    for (fs::directory_iterator it(dir_ / "runs" / run, ignored), end; it != end; it.increment(ignored)) {
      const std::string name = it->path().filename().string();
      if (!IsVideoName(it->path()) || !it->is_regular_file(ignored)) continue;
      const FileStamp stamp = StampOf(it->path());
      const std::string text = fmt::format("{}, {:.1f} MB", name, static_cast<double>(stamp.size) / kBytesPerMb);
      if (!watch_.IsStable(it->path(), stamp)) {
        videos_arriving_[run] = text + " so far";
      } else if (why.find(name + ": ") != std::string::npos) {
        videos_unreadable_[run] = text;
      }
    }
  }
}

std::vector<std::pair<fs::path, FileStamp>> SiteCheck::Others() const {
  std::vector<std::pair<fs::path, FileStamp>> files;
  const auto add = [&](const fs::path& folder) {
    std::error_code ignored;
    for (fs::directory_iterator it(folder, ignored), end; it != end; it.increment(ignored)) {
      if (it->is_regular_file(ignored)) files.emplace_back(it->path(), StampOf(it->path()));
    }
  };
  add(dir_);
  for (const Run& run : project_->site().runs) add(run.dir);
  for (const auto& [run, why] : project_->site().broken_runs) add(dir_ / "runs" / run);
  for (const fs::path& set : PhotoSetFolders(dir_)) add(set);
  for (const Reference& reference : project_->site().references) {
    for (const fs::path& file : reference.files) files.emplace_back(file, StampOf(file));
  }
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  return files;
}

bool SiteCheck::Waits() const {
  return !videos_arriving_.empty() || references_arriving_ ||
         std::any_of(waiting_.begin(), waiting_.end(), [](const auto& run) { return run.second > 0; }) ||
         std::any_of(watched_sets_.begin(), watched_sets_.end(), [](const auto& set) { return !set.stable; });
}

bool SiteCheck::OthersChanged() const { return set_matched_ || Others() != judged_; }

size_t SiteCheck::Compare(size_t most, ProgressSink& progress, const CancelToken& cancel) {
  size_t compared = 0;
  for (const Run& run : project_->site().runs) {
    if (compared < most) {
      compared += ComparePairs(PicturesOf(run), most - compared, pairs_.get(), threads_, progress, cancel);
    }
  }
  return compared;
}

// Those that were looked at.
FieldRun SiteCheck::PicturesOf(const Run& run) const {
  FieldRun field;
  field.run = &run;
  std::map<fs::path, FileStamp> stamps;  // a video has many pictures
  for (const ImageEntry& image : run.images) {
    const auto [it, fresh] = stamps.try_emplace(image.path);
    if (fresh) it->second = StampOf(image.path);
    FileStamp stamp = it->second;
    stamp.mask = MaskStamp(run, image);
    const FieldPicture* seen = log_->Find(run.name, image.file, stamp);
    if (seen == nullptr) continue;
    field.pictures.push_back(*seen);
    field.pictures.back().version = fmt::format("{} {} {}", stamp.size, stamp.changed_ns, stamp.mask);
    field.pictures.back().camera = image.camera;
    field.pictures.back().stamp_ns = image.stamp_ns;
  }
  return field;
}

void SiteCheck::AddPictures(CheckOutcome* outcome) const {
  for (const Run& run : project_->site().runs) {
    FieldRun field = PicturesOf(run);
    if (const auto waiting = waiting_.find(run.name); waiting != waiting_.end()) field.waiting = waiting->second;
    field.pairs = PairsOf(field, *pairs_);
    if (!run.detections.empty()) {
      std::vector<std::string> warnings;
      for (const ImageDetections& image : ReadDetections(run.detections, 0.5, &warnings)) {
        FieldPicture picture;
        picture.image = image.image;
        picture.stamp_ns = image.stamp_ns;
        for (size_t c = 0; c < run.cameras.size(); ++c) {
          if (run.cameras[c].name == image.camera) picture.camera = static_cast<int>(c);
        }
        picture.tags = image.detections;
        field.pictures.push_back(std::move(picture));
      }
    }
    field.unit_problem = FindOtherUnit(run).value_or("");
    CompareTurns(*pairs_, &field);
    outcome->pictures += static_cast<int>(field.pictures.size());
    outcome->waiting += field.waiting;
    outcome->facts.runs.push_back(std::move(field));
  }
}

namespace {

// Where a sketch says which tags are put up, others that are printed (tags.yaml) are spares until a picture shows them.
void EraseSpares(FieldFacts* facts) {
  const std::set<int> seen = TagsSeen(*facts);
  std::erase_if(facts->planned, [&](const auto& tag) { return tag.second.what.empty() && !seen.contains(tag.first); });
}

// What reading the site warned of, pictures that are not copied yet in one sentence.
std::vector<SiteFinding> FindInFiles(const Site& site) {
  std::vector<SiteFinding> findings;
  std::vector<std::string> absent;
  for (const std::string& warning : site.warnings) {
    // Runs that cannot be used are named by FindInPictures.
    if (warning.find("is left out") != std::string::npos && warning.find("run '") != std::string::npos) continue;
    if (warning.find(": there is no file ") != std::string::npos) {
      absent.push_back(warning);
    } else {
      findings.push_back({Light::kAmber, "files", warning});
    }
  }
  if (absent.size() == 1) findings.push_back({Light::kAmber, "files", absent.front()});
  if (absent.size() > 1) {
    findings.push_back(
        {Light::kAmber, "files", "tables name files that are not copied yet, the first: " + absent.front()});
  }
  return findings;
}

}  // namespace

void SiteCheck::AddPlanned(FieldFacts* facts) const {
  const auto add = [&](int id, const std::string& what) {
    if (id < 0) return;
    std::string& its = facts->planned[id].what;
    if (!what.empty() && its.find(what) == std::string::npos) its += (its.empty() ? "" : ", ") + what;
  };
  const Site& site = project_->site();
  for (const auto& [id, size] : site.tags.sizes_m) add(id, "");
  for (const Station& station : site.stations) add(station.tag_id, "station " + station.name);
  for (const ControlPoint& point : site.control_points) {
    add(point.tag_id, point.control ? "control" : "check point");
    if (point.tag_id < 0) continue;
    if (point.local_m) facts->planned[point.tag_id].world_m = point.local_m;
    if (point.geodetic && project_->has_frame()) {
      facts->planned[point.tag_id].world_m = project_->frame().EnuFromGeodetic(*point.geodetic);
    }
  }
  bool sketched = false;
  for (const char* name : {"plan.csv", "plan.geojson"}) {
    if (!fs::is_regular_file(dir_ / name)) continue;
    std::vector<SketchItem> sketch;
    try {
      sketch = ReadSiteSketch(dir_ / name);
      RequireTagIds(sketch, site.tags.family);
    } catch (const InputError& e) {
      facts->plan_problem = e.what();
    }
    for (const SketchItem& item : sketch) {
      if (item.kind != "tag") continue;
      sketched = true;
      add(item.tag_id, "in " + std::string(name));
      std::optional<Eigen::Vector3d>& at = facts->planned[item.tag_id].world_m;
      if (!at) at = item.local_m;
      if (!at && item.geodetic && project_->has_frame()) at = project_->frame().EnuFromGeodetic(*item.geodetic);
    }
    break;
  }
  if (sketched) EraseSpares(facts);
}

namespace {

// What was found and what it is relative to.
void StateAccuracy(const NetworkPrediction& p, const Site& site, std::vector<SiteFinding>* findings) {
  const auto weakest = std::max_element(p.tags.begin(), p.tags.end(), [](const auto& a, const auto& b) {
    return (a.tied ? TagSigma(a) : 0) < (b.tied ? TagSigma(b) : 0);
  });
  if (weakest == p.tags.end() || !weakest->tied) return;
  findings->push_back(
      {Light::kGreen, "accuracy",
       fmt::format("predicted with what is there: tags {:.1f} mm (RMS of the 3D sigma), weakest tag {} with {:.1f} mm; "
                   "datum: {}",
                   1e3 * p.RmsSigma(), weakest->tag_id, 1e3 * TagSigma(*weakest), p.datum)});
  const bool wanted = !site.control_points.empty() || !site.references.empty() || site.origin;
  if (p.in_world || !wanted) return;
  findings->push_back({Light::kAmber, "datum",
                       "nothing fixes the site in the world yet: sigmas are relative to the " + p.datum +
                           "; photograph the tags of three control points that are not on one line, or bring geotagged "
                           "panoramas of three stations"});
}

}  // namespace

void SiteCheck::JudgeGates(CheckOutcome* outcome) const {
  const PredictedLimits limits = sources_.limits(*project_);
  const bool set = limits.any_axis > 0 || limits.tag > 0 || limits.camera > 0;
  if (!outcome->facts.prediction || !outcome->facts.prediction->in_world) {
    if (!set) return;
    outcome->findings.push_back(
        {Light::kRed, "accuracy",
         std::string("the gates are undecided: ") +
             (outcome->facts.prediction
                  ? "nothing fixes the site in the world yet; expected three control points or "
                    "geotagged panoramas that are not on one line, in pictures that show their tags"
                  : "no accuracy can be predicted before tags are seen")});
    return;
  }
  const NetworkPrediction& p = *outcome->facts.prediction;
  double worst = 0, worst_axis = 0;
  for (const TagPrediction& tag : p.tags) {
    if (!tag.tied) continue;
    worst_axis = std::max(worst_axis, tag.Sigma().maxCoeff());
    worst = std::max(worst, TagSigma(tag));
  }
  const auto gate = [&](double limit, double value, const std::string& what) {
    if (!(limit > 0)) return;
    const bool passed = value <= limit;
    outcome->findings.push_back({passed ? Light::kGreen : Light::kRed, "accuracy",
                                 "gate " + what + " at most " + Length{limit, -1} + ": predicted " + Length{value, 4} +
                                     (passed ? ", passed" : ", not reached")});
  };
  gate(limits.any_axis, worst_axis, "survey.max_tag_sigma_m, any axis,");
  gate(limits.tag, worst, "3D sigma of the weakest tag");
  std::vector<double> bodies;
  for (const BodyPrediction& body : p.bodies) bodies.push_back(BodySigma(body));
  gate(limits.camera, Percentile(bodies, 0.95), "95th percentile of the cameras' 3D sigma");
}

CheckOutcome SiteCheck::Judge(ProgressSink& progress, const CancelToken& cancel) {
  CheckOutcome outcome;
  outcome.project = project_;
  FieldFacts& facts = outcome.facts;
  facts.site = &project_->site();
  for (const std::string& problem : problems_) outcome.findings.push_back({Light::kRed, "files", problem});
  const std::vector<SiteFinding> of_files = FindInFiles(*facts.site);
  outcome.findings.insert(outcome.findings.end(), of_files.begin(), of_files.end());
  facts.videos_arriving = videos_arriving_;
  facts.videos_unreadable = videos_unreadable_;
  outcome.waiting += static_cast<int>(videos_arriving_.size());
  AddPictures(&outcome);
  AddPlanned(&facts);
  AddMap(&facts, progress, cancel);
  AddReferences(&outcome);
  AddSets(&facts);
  for (const auto& [set, photos] : facts.sets_arriving) {
    outcome.waiting += photos;
    outcome.findings.push_back({Light::kAmber, "photo sets",
                                fmt::format("photo set {}: {} photos, still being copied or not matched yet; check "
                                            "again in some seconds",
                                            set, photos)});
  }
  for (const auto& find : {FindInPictures, FindInMap}) {
    const std::vector<SiteFinding> found = find(facts);
    outcome.findings.insert(outcome.findings.end(), found.begin(), found.end());
  }
  if (facts.prediction) StateAccuracy(*facts.prediction, *facts.site, &outcome.findings);
  JudgeGates(&outcome);
  if (outcome.pictures == 0 && facts.sets.empty() && facts.sets_arriving.empty()) {
    outcome.findings.push_back({Light::kRed, "files", "no picture has been copied here yet"});
  }
  std::stable_sort(outcome.findings.begin(), outcome.findings.end(),
                   [](const SiteFinding& a, const SiteFinding& b) { return a.light > b.light; });
  const auto same = [](const SiteFinding& a, const SiteFinding& b) { return a.text == b.text && a.topic == b.topic; };
  outcome.findings.erase(std::unique(outcome.findings.begin(), outcome.findings.end(), same), outcome.findings.end());
  outcome.light = outcome.findings.empty() ? Light::kGreen : outcome.findings.front().light;
  for (const TagCoverage& tag : CoverTags(facts)) {
    const bool counts = facts.planned.empty() || facts.planned.contains(tag.tag_id);
    outcome.planned_seen += counts && tag.pictures > 0 ? 1 : 0;
  }
  outcome.advice = WhatNext(facts, sources_.network(*project_), kAdvice, seed_, threads_, cancel);
  judged_ = Others();
  set_matched_ = false;
  return outcome;
}

}  // namespace trigpoint
