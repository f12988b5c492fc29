#include "eval/scene/scene_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <tuple>

#include "calib/geometry/alignment.h"
#include "datasets/io/csv.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"
#include "datasets/project/review.h"
#include "datasets/project/stage.h"
#include "eval/errors/comparison.h"
#include "eval/errors/evaluate.h"
#include "eval/errors/results.h"
#include "eval/errors/stations.h"
#include "eval/scene/scene_points.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kSameTimeNs = 50'000'000;  // poses of two systems this near in time are of the same moment
constexpr double kCameraHeightM = 1.5;       // above the ground, where no point tells

// The decoder fills what is missing of a JPEG with grey: no end marker behind its middle (before it there may be that
// of a thumbnail) means that it was cut off.
bool IsCutOff(const fs::path& file) {
  const std::string bytes = ReadTextFile(file);
  if (!bytes.starts_with("\xFF\xD8")) return false;
  const size_t end = bytes.rfind("\xFF\xD9");
  return end == std::string::npos || end < bytes.size() / 2;
}

// A panorama's picture at about `width`, decoded small where the format allows it. Empty: cannot be read.
cv::Mat SmallPicture(const fs::path& file, int width) {
  if (!fs::exists(file) || IsCutOff(file)) return {};
  cv::Mat picture;
  for (const int mode :
       {cv::IMREAD_REDUCED_COLOR_8, cv::IMREAD_REDUCED_COLOR_4, cv::IMREAD_REDUCED_COLOR_2, cv::IMREAD_COLOR}) {
    try {
      picture = cv::imread(file.string(), mode);
    } catch (const cv::Exception&) {
      return {};
    }
    if (picture.empty() || picture.cols >= width) break;
  }
  if (!picture.empty() && picture.cols > width) {
    const int height = std::max(1, picture.rows * width / picture.cols);
    cv::resize(picture, picture, {width, height}, 0, 0, cv::INTER_AREA);
  }
  return picture;
}

class Loader {
 public:
  Loader(const Project& project, const SceneOptions& options, const CancelToken& cancel)
      : project_(project), options_(options), cancel_(cancel) {}

  SceneModel Load() {
    model_.site = project_.name();
    for (const Run& run : project_.site().runs) {
      if (!Wanted(run.name)) continue;
      Guard("run " + run.name, [&] { Collect(run); });
    }
    model_.on_earth = std::any_of(runs_.begin(), runs_.end(), [](const RunPart& r) { return r.on_earth; });
    if (!model_.on_earth && runs_.size() > 1) {
      model_.notes.push_back("No run is georeferenced: only " + runs_.front().run->name +
                             " is shown, in its own frame.");
      runs_.resize(1);
    }
    model_.frame = model_.on_earth ? "site ENU"
                   : runs_.empty() ? "none: there is no result"
                                   : "the optimised frame of " + runs_.front().run->name;
    for (const RunPart& part : runs_) {
      if (model_.on_earth && !part.on_earth) {
        model_.notes.push_back("Run " + part.run->name + " is not georeferenced and not shown.");
        continue;
      }
      cancel_.ThrowIfCancelled();
      model_.runs.push_back(part.run->name);
      AddPaths(part);
      AddGps(part);
      Guard("cameras of " + part.run->name, [&] { AddCameras(part); });
      Guard("panoramas of " + part.run->name, [&] { AddPanoramas(part); });
      Guard("points of " + part.run->name, [&] { AddPoints(part); });
    }
    AddTags();
    Guard("control points", [&] { AddControl(); });
    Guard("errors", [&] { AddErrors(); });
    DropFarPoints();
    Thin(model_.points, options_.max_points);
    Thin(model_.cameras, options_.max_cameras);
    model_.ground_z = GroundHeight();
    const fs::path& aerial = project_.site().aerial;
    if (!aerial.empty() && model_.on_earth && options_.aerial_px > 0) {
      Guard("aerial image",
            [&] { model_.aerial = ReadAerial(aerial, project_.frame(), model_.ground_z, options_.aerial_px); });
    }
    return std::move(model_);
  }

 private:
  struct RunPart {
    const Run* run = nullptr;
    fs::path dir;
    LocalizeResult result;
    bool on_earth = false;
    Sim3d scene_from_odom;
  };

  bool Wanted(const std::string& run) const {
    return options_.runs.empty() || std::find(options_.runs.begin(), options_.runs.end(), run) != options_.runs.end();
  }

  // What is broken is named and left out.
  template <typename Fn>
  void Guard(const std::string& what, Fn&& fn) {
    try {
      fn();
    } catch (const Cancelled&) {
      throw;
    } catch (const std::exception& e) {
      model_.notes.push_back(what + ": " + e.what());
    }
  }

  template <typename T>
  static void Thin(std::vector<T>& items, int most) {
    const size_t limit = static_cast<size_t>(std::max(0, most));
    if (items.size() <= limit) return;
    std::vector<T> kept;
    kept.reserve(limit);
    for (size_t i = 0; i < limit; ++i) kept.push_back(std::move(items[i * items.size() / limit]));
    items = std::move(kept);
  }

  // Of a run, or of the whole site with an empty `run`.
  fs::path ResultOf(const std::string& stage, const std::string& run) const {
    if (options_.release.empty()) return project_.ResultDir(stage, ResultNameOf(run, options_.variant));
    const fs::path release = project_.dir() / "releases" / options_.release;
    return stage == "survey" ? release / "map" : run.empty() ? release / stage : release / stage / run;
  }

  // The poses that the tag map gives have no variants.
  fs::path ReferencePosesOf(const std::string& run) const {
    return options_.release.empty() ? project_.ResultDir("reference", run) : ResultOf("reference", run);
  }

  void Collect(const Run& run) {
    RunPart part;
    part.run = &run;
    part.dir = ResultOf("localize", run.name);
    if (!fs::exists(part.dir / "panoramas.csv")) {
      model_.notes.push_back("Run " + run.name + " is not localized.");
      return;
    }
    part.result = ReadLocalizeResult(part.dir);
    part.on_earth = !part.result.cameras.empty();
    part.scene_from_odom = part.result.world_from_odom.value_or(Sim3d());
    runs_.push_back(std::move(part));
  }

  void AddPaths(const RunPart& part) {
    const std::vector<TimedPose>& optimised = part.on_earth ? part.result.cameras : part.result.cameras_odom;
    if (optimised.empty()) return;
    const Run& run = *part.run;
    model_.paths.push_back({ScenePath::Kind::kOptimised, run.name, "localize", optimised});
    const int64_t first = optimised.front().stamp_ns, last = optimised.back().stamp_ns;
    const std::optional<Rigid3d> start =
        run.cameras.empty() ? std::nullopt : run.odometry.At(first, std::numeric_limits<int64_t>::max());
    if (start) {
      const Rigid3d scene_from_raw =
          optimised.front().target_from_body * run.cameras.front().cam_from_body * start->Inverse();
      ScenePath path{ScenePath::Kind::kOdometry, run.name, "odometry", {}};
      for (const TimedPose& pose : run.odometry.poses) {
        if (pose.stamp_ns < first || pose.stamp_ns > last) continue;
        path.poses.push_back({pose.stamp_ns, scene_from_raw * pose.target_from_body});
      }
      if (path.poses.size() > 1) model_.paths.push_back(std::move(path));
    }
    Guard("truth of " + run.name, [&] {
      AddWorldPoses(part, ScenePath::Kind::kTruth, "truth", TruthFolder() / "runs" / (run.name + "_cameras.tum"));
    });
    Guard("reference poses of " + run.name, [&] {
      AddWorldPoses(part, ScenePath::Kind::kReference, "reference poses from the tag map",
                    ReferencePosesOf(run.name) / "cameras.tum");
    });
    if (part.on_earth) AddEstimates(run, optimised);
  }

  // The one `evaluate` scored against, else the project's own.
  fs::path TruthFolder() const {
    const std::string name = ResultNameOf("", options_.variant);
    const nlohmann::json manifest = ReadManifest(project_, "evaluate", name).value_or(nlohmann::json::object());
    const std::string given = manifest.value("/options/truth"_json_pointer, "");
    return project_.dir() / (given.empty() ? "truth" : given);
  }

  // True poses of the first camera in the world, from a file that need not be there.
  void AddWorldPoses(const RunPart& part, ScenePath::Kind kind, const std::string& name, const fs::path& file) {
    if (!fs::exists(file)) return;
    const Trajectory known = ReadTrajectory(file);
    ScenePath path{kind, part.run->name, name, known.poses};
    if (!part.on_earth) {
      const Sim3d fit = FitTo(part.result.cameras_odom, known, kSameTimeNs);
      for (TimedPose& pose : path.poses) pose.target_from_body = fit.TransformPose(pose.target_from_body);
      path.source += ", fitted rigidly";
    }
    model_.paths.push_back(std::move(path));
  }

  // Rigid, by the positions at the same times.
  static Sim3d FitTo(const std::vector<TimedPose>& poses, const Trajectory& theirs, int64_t max_gap_ns) {
    std::vector<Eigen::Vector3d> source, target;
    for (const TimedPose& pose : poses) {
      if (const auto at = theirs.At(pose.stamp_ns, max_gap_ns)) {
        source.push_back(at->translation);
        target.push_back(pose.target_from_body.translation);
      }
    }
    return AlignPoints(source, target, AlignmentKind::kSE3);
  }

  void AddGps(const RunPart& part) {
    if (!part.on_earth || part.run->gps.size() < 2) return;
    ScenePath path{ScenePath::Kind::kGps, part.run->name, "GPS", {}};
    for (const GpsFix& fix : part.run->gps) {
      Rigid3d place;
      place.translation = project_.frame().EnuFromGeodetic(fix.position);
      path.poses.push_back({fix.stamp_ns, place});
    }
    model_.paths.push_back(std::move(path));
  }

  // Anybody's trajectories, laid onto the optimised one by a rigid fit: they come in frames of their own.
  void AddEstimates(const Run& run, const std::vector<TimedPose>& optimised) {
    std::error_code ignored;
    std::set<fs::path> systems;
    for (fs::directory_iterator it(project_.dir() / "estimates", ignored), end; it != end; it.increment(ignored)) {
      systems.insert(it->path());
    }
    for (const fs::path& system : systems) {
      const fs::path file = system / (run.name + ".tum");
      if (!fs::exists(file)) continue;
      const std::string name = system.filename().string();
      Guard("estimate of " + name + " for " + run.name, [&] {
        const Trajectory theirs = ReadTrajectory(file);
        const Sim3d fit = FitTo(optimised, theirs, 20 * kSameTimeNs);
        ScenePath path{ScenePath::Kind::kEstimate, run.name, name, {}};
        for (const TimedPose& pose : theirs.poses) {
          path.poses.push_back({pose.stamp_ns, fit.TransformPose(pose.target_from_body)});
        }
        model_.paths.push_back(std::move(path));
      });
    }
  }

  void AddCameras(const RunPart& part) {
    const Run& run = *part.run;
    std::map<std::string, const ImageEntry*> entries;
    std::map<int64_t, const ImageEntry*> first_camera;
    for (const ImageEntry& image : run.images) {
      entries[image.file] = &image;
      if (image.camera == 0) first_camera[image.stamp_ns] = &image;
    }
    const auto add = [&](const ImageEntry* entry, const Rigid3d& pose, const std::optional<Eigen::Vector3d>& sigma) {
      if (!entry || entry->camera >= static_cast<int>(run.cameras.size()) || !pose.IsFinite()) return;
      const Camera& camera = run.cameras[static_cast<size_t>(entry->camera)].camera;
      SceneCamera c{run.name, entry->file, entry->path, pose, {}, sigma};
      const double right = camera.width() - 0.5, bottom = camera.height() - 0.5;
      for (const Eigen::Vector2d& corner : {Eigen::Vector2d(-0.5, bottom), Eigen::Vector2d(right, bottom),
                                            Eigen::Vector2d(right, -0.5), Eigen::Vector2d(-0.5, -0.5)}) {
        const auto ray = camera.Unproject(corner);
        if (!ray || ray->z() < 0.1) break;
        c.corner_rays.push_back(*ray / ray->z());
      }
      if (c.corner_rays.size() < 4) {  // a lens that sees beyond its corners: a plain pyramid stands for it
        c.corner_rays = {{-0.8, 0.6, 1}, {0.8, 0.6, 1}, {0.8, -0.6, 1}, {-0.8, -0.6, 1}};
      }
      model_.cameras.push_back(std::move(c));
    };
    for (const CameraResult& row : part.result.images) {
      const auto entry = entries.find(row.image);
      if (entry != entries.end() && row.world_from_cam) add(entry->second, *row.world_from_cam, row.sigma_m);
    }
    if (!part.result.images.empty()) return;
    for (const TimedPose& pose : part.on_earth ? part.result.cameras : part.result.cameras_odom) {
      const auto entry = first_camera.find(pose.stamp_ns);
      if (entry != first_camera.end()) add(entry->second, pose.target_from_body, std::nullopt);
    }
  }

  void AddPanoramas(const RunPart& part) {
    std::map<std::string, const Reference*> references;
    for (const Reference& reference : project_.site().references) references[reference.name] = &reference;
    for (const PanoramaResult& row : part.result.panoramas) {
      const std::optional<Rigid3d>& pose = part.on_earth ? row.world_from_pano : row.odom_from_pano;
      if (row.status != "localized" || !pose || !pose->IsFinite()) continue;
      // A photo set goes with the station it is of, as in the evaluation.
      const std::string meant = StationNamed(row.station, project_.site().stations);
      ScenePanorama panorama{part.run->name, options_.variant, row.panorama, meant.empty() ? row.station : meant};
      panorama.world_from_pano = *pose;
      panorama.sigma_m = part.on_earth ? row.sigma_m : row.odom_sigma_m;
      if (const auto it = references.find(row.panorama); it != references.end()) {
        const Reference& reference = *it->second;
        panorama.kind = reference.kind;
        if (!reference.files.empty()) panorama.file = reference.files.front();
        if (part.on_earth && reference.geotag.has_position) {
          Eigen::Vector3d said = project_.frame().EnuFromGeodetic(reference.geotag.position);
          if (!reference.geotag.has_height) said.z() = pose->translation.z();
          panorama.geotag = said;
        }
        panorama.texture = TextureOf(panorama.file);
      }
      model_.panoramas.push_back(std::move(panorama));
    }
  }

  cv::Mat TextureOf(const fs::path& file) {
    if (options_.panorama_width_px <= 0 || file.empty()) return {};
    const auto [it, fresh] = textures_.try_emplace(file);
    if (fresh) {
      cancel_.ThrowIfCancelled();
      it->second = SmallPicture(file, options_.panorama_width_px);
      if (it->second.empty())
        model_.notes.push_back(file.filename().string() + " cannot be read as a picture, or is cut off.");
    }
    return it->second;
  }

  void AddPoints(const RunPart& part) {
    if (options_.max_points <= 0) return;  // not even read
    if (!fs::exists(part.dir / "sparse" / "points3D.bin")) {
      model_.notes.push_back("Run " + part.run->name + " has no sparse model.");
      return;
    }
    std::vector<std::string> names;
    std::vector<ScenePoint> points =
        ReadScenePoints(part.dir / "sparse", static_cast<int>(model_.runs.size()) - 1, &names);
    std::map<std::string, const ImageEntry*> entries;
    for (const ImageEntry& image : part.run->images) entries[image.file] = &image;
    const auto first = static_cast<int>(model_.images.size());
    const auto cameras = std::make_shared<Run>();
    cameras->cameras = part.run->cameras, cameras->config = part.run->config;
    for (const std::string& name : names) {
      const auto entry = entries.find(name);
      model_.images.push_back(entry == entries.end() ? SceneImage() : SceneImage{cameras, *entry->second});
    }
    Thin(points, options_.max_points);
    for (ScenePoint& p : points) {
      if (p.image >= 0) p.image += first;
      p.position =
          part.scene_from_odom.scale * (part.scene_from_odom.rotation * p.position) + part.scene_from_odom.translation;
      p.sigma_m *= part.scene_from_odom.scale;
    }
    model_.points.insert(model_.points.end(), points.begin(), points.end());
  }

  // One square an id: the survey's map first, then what the runs' own cameras say.
  void AddTags() {
    std::set<int> shown;
    const auto add = [&](const fs::path& file, const std::string& source, const Sim3d& scene_from_map) {
      if (!fs::exists(file)) return;
      Guard("tags of " + source, [&] {
        for (const TagResult& row : ReadTagResults(file)) {
          if (!row.map_from_tag || !row.map_from_tag->IsFinite() || !(row.size_m > 0)) continue;
          if ((row.status != "ok" && !row.status.empty()) || !shown.insert(row.tag_id).second) continue;
          SceneTag tag{row.tag_id, row.family, row.role, source, row.size_m};
          tag.world_from_tag = scene_from_map.TransformPose(*row.map_from_tag);
          tag.sigma_m = row.sigma_m;
          DrawPattern(&tag);
          model_.tags.push_back(std::move(tag));
        }
      });
    };
    if (model_.on_earth) {
      std::vector<fs::path> maps = {ResultOf("survey", "")};
      if (options_.release.empty() && !options_.variant.empty()) maps.push_back(project_.ResultDir("survey", ""));
      for (const fs::path& map : maps) {
        const fs::path file = map / "tags.csv";
        if (!fs::exists(file)) continue;
        Guard("tags of survey", [&] {
          // A map that is not georeferenced has a frame of its own.
          if (const std::string frame = TagMapFrame(file); frame.empty() || frame == "enu") add(file, "survey", {});
        });
      }
    }
    for (const RunPart& part : runs_) {
      if (model_.on_earth && !part.on_earth) continue;
      add(ResultOf("evaluate", "") / ("tags_" + part.run->name + ".csv"), part.run->name, part.scene_from_odom);
    }
  }

  // As stated; the tag map's difference where a survey was made.
  void AddControl() {
    if (!model_.on_earth) return;
    std::map<std::string, Eigen::Vector3d> residuals;
    const fs::path file = ResultOf("survey", "") / "summary.json";
    if (fs::exists(file)) {
      const nlohmann::json summary = nlohmann::json::parse(ReadTextFile(file));
      for (const nlohmann::json& point : summary.value("points", nlohmann::json::array())) {
        const auto d = point.value("map_minus_stated_m", std::vector<double>());
        if (d.size() == 3) residuals[point.value("name", "")] = {d[0], d[1], d[2]};
      }
    }
    for (const ControlPoint& point : project_.site().control_points) {
      if (!point.local_m && !point.geodetic) continue;
      SceneControl shown{ReviewControlName(point), point.control ? "control" : "check", point.tag_id};
      shown.position = point.local_m ? *point.local_m : project_.frame().EnuFromGeodetic(*point.geodetic);
      shown.sigma_m = {point.sigma_h_m, point.sigma_h_m, point.sigma_v_m};
      if (const auto at = residuals.find(shown.name); at != residuals.end()) shown.residual_m = at->second;
      model_.control.push_back(std::move(shown));
    }
  }

  void DrawPattern(SceneTag* tag) {
    try {
      auto& family = families_[tag->family];
      if (!family) family = std::make_unique<TagFamily>(tag->family);
      const TagPattern pattern = family->Pattern(tag->id);
      tag->pattern.create(pattern.total, pattern.total, CV_8U);
      for (int r = 0; r < pattern.total; ++r) {
        for (int c = 0; c < pattern.total; ++c) tag->pattern.at<uchar>(r, c) = pattern.At(r, c) ? 255 : 0;
      }
      tag->pattern_size_m = tag->size_m * pattern.total / pattern.width;
    } catch (const Error&) {
      tag->pattern_size_m = tag->size_m;  // a plain square
    }
  }

  // The rows of the one comparison that all of the program shows.
  void AddErrors() {
    const fs::path file = ResultOf("evaluate", "") / "errors.csv";
    if (!fs::exists(file)) return;
    const CsvTable table = CsvTable::Read(
        file, {"run", "method", "station", "panorama", "reference", "kind", "status", "de_m", "dn_m", "du_m"});
    std::vector<std::pair<Comparison, SceneError>> rows;
    std::vector<Comparison> all;
    for (const CsvRow& row : table.rows()) {
      if (row.Text("status") != "localized" || !row.Has("de_m") || !row.Has("dn_m") || !row.Has("du_m")) continue;
      const Comparison of = ComparisonOf(table, row);
      rows.emplace_back(of, ErrorOf(table, row));
      auto same = std::find_if(all.begin(), all.end(), [&](const Comparison& c) { return IsSame(c, of); });
      if (same == all.end()) same = all.insert(all.end(), of);
      ++same->answers;
    }
    const std::optional<Comparison> best = BestComparison(all, options_.variant);
    if (!best) return;
    model_.comparison = best->Words();
    for (const ScenePanorama& panorama : model_.panoramas) {
      for (const auto& [of, of_row] : rows) {
        if (!IsSame(of, *best) || of_row.run != panorama.run || of_row.panorama != panorama.panorama) continue;
        SceneError error = of_row;
        error.reference_position = panorama.world_from_pano.translation - error.difference;
        model_.errors.push_back(std::move(error));
      }
    }
  }

  Comparison ComparisonOf(const CsvTable& table, const CsvRow& row) const {
    Comparison of;
    if (table.HasColumn("variant")) of.variant = row.Text("variant");
    if (of.variant.empty()) of.variant = options_.variant;
    of.method = row.Text("method"), of.reference = row.Text("reference"), of.kind = row.Text("kind");
    of.shares_evidence =
        table.HasColumn("shares_evidence") ? row.Text("shares_evidence") == "yes" : of.reference == "self";
    return of;
  }

  static bool IsSame(const Comparison& a, const Comparison& b) {
    const auto key = [](const Comparison& c) {
      return std::tie(c.variant, c.method, c.reference, c.kind, c.shares_evidence);
    };
    return key(a) == key(b);
  }

  SceneError ErrorOf(const CsvTable& table, const CsvRow& row) const {
    SceneError error;
    error.run = row.Text("run"), error.variant = options_.variant, error.method = row.Text("method");
    error.station = row.Text("station"), error.panorama = row.Text("panorama");
    error.reference = row.Text("reference");
    error.difference = {row.Number("de_m"), row.Number("dn_m"), row.Number("du_m")};
    // A sigma that is no number is one that isn't known; the error is still one.
    const auto sigma = [&](const char* column) {
      return table.HasColumn(column) && row.Has(column) ? ParseDouble(row.Text(column)) : std::nullopt;
    };
    const auto e = sigma("sigma_e_m"), n = sigma("sigma_n_m"), u = sigma("sigma_u_m");
    if (e && n && u && std::isfinite(*e + *n + *u)) error.sigma_m = {*e, *n, *u};
    return error;
  }

  // A single point at a billion metres takes all of the depth buffer's range, and the site vanishes.
  void DropFarPoints() {
    constexpr double kMostExtents = 20;
    const auto [low, high] = model_.Bounds();
    const Eigen::Vector3d middle = 0.5 * (low + high);
    const double most = kMostExtents * std::max(1.0, (high - low).norm());
    std::erase_if(model_.points, [&](const ScenePoint& p) { return !((p.position - middle).norm() < most); });
  }

  double GroundHeight() const {
    std::vector<double> cameras, below;
    for (const SceneCamera& c : model_.cameras) cameras.push_back(c.world_from_cam.translation.z());
    if (cameras.empty()) return 0;
    const double height = Quantile(cameras, 0.5);
    const auto [low, high] = model_.Bounds();
    for (const ScenePoint& p : model_.points) {
      const bool near = p.position.x() > low.x() && p.position.x() < high.x() && p.position.y() > low.y() &&
                        p.position.y() < high.y();
      if (near && p.position.z() < height - 0.3 && p.position.z() > height - 6) below.push_back(p.position.z());
    }
    return below.size() < 50 ? height - kCameraHeightM : Quantile(below, 0.1);
  }

  const Project& project_;
  const SceneOptions& options_;
  const CancelToken& cancel_;
  SceneModel model_;
  std::vector<RunPart> runs_;
  std::map<fs::path, cv::Mat> textures_;
  std::map<std::string, std::unique_ptr<TagFamily>> families_;
};

}  // namespace

std::pair<Eigen::Vector3d, Eigen::Vector3d> SceneModel::Bounds() const {
  Eigen::AlignedBox3d box;
  for (const ScenePath& path : paths) {
    if (path.kind == ScenePath::Kind::kGps) continue;  // may be anywhere
    for (const TimedPose& pose : path.poses) box.extend(pose.target_from_body.translation);
  }
  for (const ScenePanorama& panorama : panoramas) box.extend(panorama.world_from_pano.translation);
  for (const SceneTag& tag : tags) box.extend(tag.world_from_tag.translation);
  if (box.isEmpty()) {
    for (const ScenePoint& point : points) box.extend(point.position);
  }
  if (box.isEmpty()) return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  return {box.min(), box.max()};
}

std::optional<SceneSource> SceneSourceOf(const std::string& written) {
  fs::path folder = written;
  SceneSource source;
  if (const size_t at = written.rfind('@'); !fs::exists(folder) && at != std::string::npos) {
    folder = written.substr(0, at);
    source.variant = written.substr(at + 1);
  }
  if (!folder.has_filename()) folder = folder.parent_path();  // "a/b/" is "a/b"
  const fs::path above = folder.parent_path();
  const std::string name = folder.filename().string();
  if (fs::exists(folder / "release.json") && above.filename() == "releases") {
    source.project = above.parent_path();
    source.release = name;
  } else if (name == "evaluate" && fs::exists(above / "release.json")) {
    return SceneSourceOf(above.string());
  } else if (above.filename() == "results" && (name == "evaluate" || name.starts_with("evaluate@"))) {
    source.project = above.parent_path();
    if (name != "evaluate") source.variant = name.substr(9);
  } else if (fs::exists(folder / "trigpoint.yaml") || fs::is_directory(folder / "results")) {
    source.project = folder;
  }
  if (source.project.empty()) return std::nullopt;
  return source;
}

SceneModel LoadScene(const Project& project, const SceneOptions& options, const CancelToken& cancel) {
  return Loader(project, options, cancel).Load();
}

}  // namespace trigpoint
