#include "eval/evidence/world_evidence.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "eval/errors/changed_errors.h"
#include "eval/errors/reference_maps.h"
#include "eval/evidence/rolling_tags.h"
#include "survey/tags/excluded_detections.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr const char* kParts[] = {"control", "tags", "gps"};

// The survey's of the same variant, unless another map is named.
std::string MapName(const UseOptionsOfWorld& options, const std::string& variant) {
  return options.reference.empty() ? ResultNameOf("survey", variant) : options.reference;
}

fs::path DetectionsOf(const Project& project, const std::string& run) {
  return project.ResultDir("detect", run) / "detections.csv";
}

// The joint covariance of tags. Where the map does not have all their cross covariances, an upper bound of it: n times
// the tags' own, which holds whatever they have in common.
Eigen::MatrixXd CovarianceOfTags(const std::vector<const TagResult*>& tags, const TagCovariances& cross, bool* bound) {
  const auto n = static_cast<Eigen::Index>(tags.size());
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(6 * n, 6 * n);
  *bound = false;
  for (Eigen::Index a = 0; a < n; ++a) {
    const TagResult& one = *tags[static_cast<size_t>(a)];
    c.block<6, 6>(6 * a, 6 * a) = *one.covariance;
    for (Eigen::Index b = 0; b < a; ++b) {
      const TagResult& other = *tags[static_cast<size_t>(b)];
      const auto it = cross.find(std::minmax(one.tag_id, other.tag_id));
      if (it == cross.end()) {
        *bound = true;
        continue;
      }
      const Matrix6d block = one.tag_id < other.tag_id ? it->second : Matrix6d(it->second.transpose());
      c.block<6, 6>(6 * a, 6 * b) = block;
      c.block<6, 6>(6 * b, 6 * a) = block.transpose();
    }
  }
  if (!*bound) return c;
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      if (a != b) c.block<6, 6>(6 * a, 6 * b).setZero();
    }
  }
  return static_cast<double>(n) * c;
}

}  // namespace

std::set<std::string> UseOptionsOfWorld::Parts() const {
  std::set<std::string> parts;
  std::istringstream text(use);
  for (std::string part; std::getline(text, part, ',');) {
    std::erase(part, ' ');
    if (!part.empty()) parts.insert(part);
  }
  if (!reference.empty()) parts.insert("tags");
  return parts;
}

std::vector<std::string> UseOptionsOfWorld::Check(const std::string& mode) const {
  std::vector<std::string> problems;
  for (const std::string& part : Parts()) {
    if (std::find(std::begin(kParts), std::end(kParts), part) == std::end(kParts)) {
      problems.push_back("option use has '" + part + "', expected control, tags, gps, with commas between");
    }
  }
  if (mode == "paper" && !Parts().empty()) {
    problems.push_back("option use: the published method (mode paper) georeferences by geotags alone");
  }
  return problems;
}

std::vector<std::string> StagesForWorld(const UseOptionsOfWorld& options) {
  const std::set<std::string> parts = options.Parts();
  std::vector<std::string> stages;
  if (parts.count("tags") > 0 || parts.count("control") > 0) stages.emplace_back("detect");
  if (parts.count("tags") > 0 && options.reference.empty()) stages.emplace_back("survey");
  return stages;
}

void AddWorldInputs(const Project& project, const std::string& run, const std::string& variant,
                    const UseOptionsOfWorld& options, StageRequest* request) {
  const std::set<std::string> parts = options.Parts();
  if (parts.count("tags") == 0 && parts.count("control") == 0) return;
  request->inputs.push_back(project.ResultDir("detect", run) / "manifest.json");
  request->inputs.push_back(project.dir() / "tags.yaml");
  if (parts.count("control") > 0) request->inputs.push_back(project.dir() / "control_points.csv");
  if (parts.count("tags") > 0) {
    const std::string name = MapName(options, variant);
    request->inputs.push_back(name.starts_with("survey") ? ReferenceMapFolder(project, name) / "manifest.json"
                                                         : ReleaseFolder(project, name));
  }
  nlohmann::json review = project.review().InForce({"detection", "tag", "control"}, run);
  if (!review.is_null()) request->values["review_of_world"] = std::move(review);
}

WorldSources::WorldSources(const Project& project, const std::string& run, const std::string& variant,
                           const UseOptionsOfWorld& options, const LocalizeJob& job, bool all_tags)
    : run_(run), job_(job), parts_(options.Parts()), all_tags_(all_tags), sizes_(project.site().tags) {
  if (parts_.empty()) {
    if (all_tags_ && fs::exists(DetectionsOf(project, run_))) ReadImages(project);
    return;
  }
  if (!job.input.has_frame) {
    throw InputError("--use " + options.use +
                     ": the project has no origin; give geotags, GPS, control points or origin.json");
  }
  if (parts_.count("gps") > 0 && job.gps.empty()) {
    throw InputError("--use gps: run " + run_ +
                     " has no GPS while its images were taken; expected gps.csv, *.nmea or " + "*.gpx in runs/" + run_);
  }
  if (parts_.count("tags") > 0) ReadMap(project, MapName(options, variant));
  if (parts_.count("control") > 0) ReadControl(project);
  if (all_tags_ || parts_.count("tags") > 0 || parts_.count("control") > 0) ReadImages(project);
}

void WorldSources::ReadMap(const Project& project, const std::string& name) {
  const std::vector<std::string> names = ReferenceNames(project);
  if (name == "self" || name == "control" || std::find(names.begin(), names.end(), name) == names.end()) {
    if (name.starts_with("survey")) {
      throw InputError("--use tags: there is no map '" + name + "'; run `trigpoint survey " + project.dir().string() +
                       (name == "survey" ? "" : " --variant " + name.substr(name.find('@') + 1)) + "` first");
    }
    throw InputError("there is no map '" + name + "'; nearest: '" + NearestName(name, names) + "'");
  }
  map_ = ReadReferenceMap(project, ReferenceMapFolder(project, name), name);
  for (const TagResult& tag : map_.tags) {
    if (tag.size_m > 0) sizes_.sizes_m[tag.tag_id] = tag.size_m;  // that the map's poses rest on
  }
  if (std::find(map_.runs.begin(), map_.runs.end(), run_) != map_.runs.end()) {
    warnings_.push_back("run " + run_ + " took part in the map '" + name +
                        "': both use the same images, so that the sigmas in world are somewhat too small; "
                        "set role: evaluation in its run.yaml for a map without it");
  }
}

void WorldSources::ReadControl(const Project& project) {
  for (const ControlPoint& point : AtNewestEpoch(project.site().control_points)) {
    const bool excluded = project.review().Excludes("control:" + ReviewControlName(point));
    if (!point.control || point.tag_id < 0 || !(point.local_m || point.geodetic) || excluded) continue;
    // What the map was fixed by is in the map.
    const std::string evidence = "control:" + std::to_string(point.tag_id);
    if (std::find(map_.evidence.begin(), map_.evidence.end(), evidence) != map_.evidence.end()) continue;
    TagControl held;
    if (point.corner >= 0) held.in_tag = TagCorner(sizes_.SizeOf(point.tag_id), point.corner);
    held.position = point.local_m ? *point.local_m : project.frame().EnuFromGeodetic(*point.geodetic);
    held.sigma_h_m = point.sigma_h_m;
    held.sigma_v_m = point.sigma_v_m;
    control_[point.tag_id].push_back(held);
  }
  if (control_.empty() && parts_.count("tags") == 0) {
    throw InputError(
        "--use control: control_points.csv gives no tag that may be used; expected rows with a tag_id and " +
        std::string("the role control"));
  }
}

void WorldSources::ReadImages(const Project& project) {
  const fs::path file = DetectionsOf(project, run_);
  if (!fs::exists(file)) {
    throw InputError("--use tags, control: " + file.string() + " is not there; run `trigpoint detect " +
                     project.dir().string() + "` first");
  }
  detections_ = ReadDetections(file, TagPosesOptions().extra_sigma_px, &warnings_);
  LeaveOutExcluded(project.review(), run_, detections_);
  MoveToImageTimes(project.run(run_), project.site().tags, &detections_);
}

std::vector<TagView> WorldSources::ViewsOf(const std::vector<Rigid3d>& body_from_odom) const {
  std::map<std::pair<int64_t, std::string>, size_t> index;
  const LocalizeInput& input = job_.input;
  for (size_t i = 0; i < input.images.size(); ++i) {
    const FrameImage& image = input.images[i];
    index[{image.stamp_ns, input.cameras[static_cast<size_t>(image.camera)].name}] = i;
  }
  std::vector<TagView> views(input.images.size());
  for (size_t i = 0; i < views.size(); ++i) {
    const FrameImage& image = input.images[i];
    const BodyCamera& camera = input.cameras[static_cast<size_t>(image.camera)];
    views[i].camera = &camera.camera;
    views[i].world_from_cam = (camera.cam_from_body * body_from_odom[static_cast<size_t>(image.pose)]).Inverse();
    views[i].run = run_;
  }
  for (const ImageDetections& image : detections_) {
    const auto at = index.find({image.stamp_ns, image.camera});
    if (at != index.end()) views[at->second].detections = image.detections;
  }
  return views;
}

std::vector<WorldTag> WorldSources::TagsOf(const std::vector<Rigid3d>& body_from_odom, int threads,
                                           ProgressSink& progress, const CancelToken& cancel) const {
  std::vector<WorldTag> tags;
  const std::vector<TagView> views = ViewsOf(body_from_odom);
  const TagPosesOptions options;
  for (const TagEstimate& tag : EstimateTagPoses(views, sizes_, options, threads, progress, cancel)) {
    if (!tag.HasPose() || tag.status != "ok") continue;
    const TagResult* const surveyed = InMap(tag.tag_id);
    const auto control = control_.find(tag.tag_id);
    if (surveyed == nullptr && control == control_.end() && !all_tags_) continue;
    WorldTag& out = tags.emplace_back();
    out.id = tag.tag_id;
    for (int k = 0; k < 4; ++k) out.corners[static_cast<size_t>(k)] = TagCorner(tag.size_m, k);
    for (int index : tag.views) {
      const TagView& view = views[static_cast<size_t>(index)];
      const auto seen = std::find_if(view.detections.begin(), view.detections.end(),
                                     [&](const TagDetection& d) { return d.id == tag.tag_id; });
      const TagSight sight = MakeTagSight(*view.camera, *seen, options.extra_sigma_px);
      out.sightings.push_back({index, sight.rays, sight.whitening});
    }
    const int pose = job_.input.images[static_cast<size_t>(out.sightings.front().image)].pose;
    out.body_from_tag = body_from_odom[static_cast<size_t>(pose)] * *tag.world_from_tag;
    if (surveyed != nullptr) out.world_from_tag = surveyed->map_from_tag;
    if (control != control_.end()) out.control = control->second;
  }
  return tags;
}

const TagResult* WorldSources::InMap(int tag_id) const {
  for (const TagResult& t : map_.tags) {
    if (t.tag_id == tag_id && t.map_from_tag && t.covariance && t.covariance->allFinite()) return &t;
  }
  return nullptr;
}

Eigen::MatrixXd WorldSources::MapCovariance(const std::vector<WorldTag>& tags, ProgressSink& progress) const {
  std::vector<const TagResult*> in_map;
  for (const WorldTag& tag : tags) {
    if (tag.world_from_tag) in_map.push_back(InMap(tag.id));
  }
  bool bound = false;
  Eigen::MatrixXd c = CovarianceOfTags(in_map, map_.cross, &bound);
  if (bound) {
    progress.Log(LogLevel::kWarning,
                 "the map '" + map_.name +
                     "' has no covariances between its tags: an upper bound is used, so that sigmas are too large; for "
                     "better ones set cross_covariances: true for the survey");
  }
  return c;
}

WorldEvidence WorldSources::EvidenceFor(const Reconstruction& reconstruction, int threads, ProgressSink& progress,
                                        const CancelToken& cancel) const {
  WorldEvidence evidence;
  evidence.gps = parts_.count("gps") > 0;
  if (parts_.count("tags") == 0 && parts_.count("control") == 0) return evidence;
  for (const std::string& warning : warnings_) progress.Log(LogLevel::kWarning, warning);
  evidence.tags = TagsOf(reconstruction.problem.poses, threads, progress, cancel);
  evidence.map_covariance = MapCovariance(evidence.tags, progress);
  if (evidence.tags.empty()) {
    throw InputError("--use: run " + run_ + " shows no tag " +
                     (map_.name.empty() ? "with control" : "of the map '" + map_.name + "'") +
                     " well enough; expected at least two images of one");
  }
  return evidence;
}

std::vector<std::string> WorldSources::EvidenceOf(const WorldFit& fit) const {
  std::set<std::string> evidence;
  if (!fit.map_tags.empty()) {
    evidence.insert(map_.evidence.begin(), map_.evidence.end());
    for (const std::string& run : map_.runs) evidence.insert("tags:" + run);
    evidence.insert("map:" + map_.name);
  }
  for (int id : fit.control_tags) evidence.insert("control:" + std::to_string(id));
  if (fit.gps) evidence.insert("gps:" + run_);
  return {evidence.begin(), evidence.end()};
}

}  // namespace trigpoint
