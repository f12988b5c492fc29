#include "eval/inspect/run_inspector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "datasets/io/csv.h"
#include "datasets/io/image.h"
#include "datasets/io/rig_file.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/reference_parts.h"
#include "datasets/project/stage.h"
#include "datasets/solution/solution_file.h"
#include "datasets/solution/solution_model.h"
#include "eval/errors/results.h"
#include "localize/reconstruct/feature_store.h"
#include "localize/reconstruct/matching.h"
#include "localize/references/photo_focal.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr double kInlierPx = 3;
constexpr double kRatio = 0.8, kMaxDistance = 0.8;

}  // namespace

std::string OlderLocalization(const Project& project, const std::string& run, const std::string& variant) {
  const fs::path dir = project.ResultDir("localize", ResultNameOf(run, variant));
  if (fs::exists(dir / kSolutionFile) || !fs::exists(dir / "panoramas.csv")) return "";
  return fmt::format("run {}: {} was made by an earlier version and has no {}; run `trigpoint localize {} --run {}{}`",
                     run, RelativeTo(project.dir(), dir), kSolutionFile, ShellWord(project.dir().string()),
                     ShellWord(run), variant.empty() ? "" : " --variant " + ShellWord(variant));
}

struct RunInspector::Parts {
  const Project project;
  const Run& run;
  const std::string localized;  // the name of its result
  bool result_read = false;
  LocalizeResult result;
  SparseModel model;                          // odom
  std::map<std::string, size_t> model_image;  // by name
  std::map<int64_t, size_t> model_point;      // by id
  bool tags_read = false;
  std::map<std::string, std::vector<TagDetection>> tags;  // by image

  Parts(const Project& p, const std::string& name, const std::string& variant)
      : project(p), run(project.run(name)), localized(ResultNameOf(name, variant)) {}
  const ImageEntry& Entry(const std::string& file) const {
    std::vector<std::string> names;
    for (const ImageEntry& entry : run.images) {
      if (entry.file == file) return entry;
      names.push_back(entry.file);
    }
    throw InputError("run " + run.name + " has no image '" + file + "'; nearest: '" + NearestName(file, names) + "'");
  }
  void ReadResult() {
    if (result_read) return;
    result_read = true;
    const fs::path dir = project.ResultDir("localize", localized);
    if (fs::exists(dir / kSolutionFile)) {
      const Solution solution = ReadSolution(dir / kSolutionFile);
      result = ReadLocalizeResult(dir, &solution);
      model = ModelOf(solution).model;
    } else {  // of an older program
      if (fs::exists(dir / "panoramas.csv")) result = ReadLocalizeResult(dir, nullptr);
      if (HasColmapModel(dir / "sparse")) model = ReadColmapModel(dir / "sparse");
    }
    for (size_t i = 0; i < model.images.size(); ++i) model_image[model.images[i].name] = i;
    for (size_t i = 0; i < model.points.size(); ++i) model_point[model.points[i].id] = i;
  }
  void ReadTags() {
    if (tags_read) return;
    tags_read = true;
    const fs::path made = project.ResultDir("detect", run.name) / "detections.csv";
    const fs::path file = fs::exists(made) ? made : run.detections;
    if (file.empty()) return;
    std::vector<std::string> warnings;
    for (ImageDetections& image : ReadDetections(file, 0.2, &warnings)) {
      tags[ReviewImageName(image.image, image.stamp_ns)] = std::move(image.detections);
    }
  }
};

RunInspector::RunInspector(const Project& project, const std::string& run, const std::string& variant)
    : parts_(std::make_unique<Parts>(project, run, variant)) {}
RunInspector::~RunInspector() = default;

InspectedImage RunInspector::Image(const std::string& file) {
  Parts& p = *parts_;
  const ImageEntry& entry = p.Entry(file);
  const Review& review = p.project.review();
  InspectedImage result;
  result.excluded = review.ExcludesImage(p.run.name, file, entry.stamp_ns);
  if (static_cast<size_t>(entry.camera) < p.run.cameras.size()) {
    const Camera& camera = p.run.cameras[static_cast<size_t>(entry.camera)].camera;
    result.width = camera.width(), result.height = camera.height();
  }
  p.ReadTags();
  if (const auto tags = p.tags.find(ReviewImageName(file, entry.stamp_ns)); tags != p.tags.end()) {
    for (const TagDetection& tag : tags->second) {
      InspectedTag t;
      t.id = tag.id;
      t.corners.assign(tag.corners.begin(), tag.corners.end());
      t.sigma_px = tag.SigmaPx();
      t.excluded = review.ExcludesDetection(p.run.name, file, entry.stamp_ns, tag.id);
      result.tags.push_back(std::move(t));
    }
  }
  p.ReadResult();
  const auto found = p.model_image.find(file);
  if (found == p.model_image.end()) return result;
  const ModelImage& image = p.model.images[found->second];
  const Camera& camera = p.model.CameraOf(image);
  double sum = 0;
  for (size_t k = 0; k < image.pixels.size(); ++k) {
    const auto point = p.model_point.find(image.points[k]);
    if (point == p.model_point.end()) continue;
    const ModelPoint& m = p.model.points[point->second];
    const auto predicted = camera.Project(image.cam_from_world * m.position);
    if (!predicted) continue;
    result.points.push_back({m.id, image.pixels[k], *predicted, static_cast<int>(m.track.size())});
    sum += (*predicted - image.pixels[k]).squaredNorm();
  }
  if (!result.points.empty()) result.rms_px = std::sqrt(sum / static_cast<double>(result.points.size()));
  return result;
}

std::vector<std::string> RunInspector::ImagesOf(int64_t point) {
  Parts& p = *parts_;
  p.ReadResult();
  const auto found = p.model_point.find(point);
  if (found == p.model_point.end()) {
    throw InputError("run " + p.run.name + " has no point " + std::to_string(point) + "; its model has " +
                     std::to_string(p.model.points.size()) + " points");
  }
  std::set<uint32_t> seen_by;
  for (const auto& [image, index] : p.model.points[found->second].track) seen_by.insert(image);
  std::vector<std::string> names;
  for (const ImageEntry& entry : p.run.images) {
    const auto image = p.model_image.find(entry.file);
    if (image != p.model_image.end() && seen_by.count(p.model.images[image->second].id) > 0)
      names.push_back(entry.file);
  }
  return names;
}

namespace {

// A picture that an image is matched with, and how it stands in its reference's rig.
struct MatchedView {
  View view;
  std::string features;          // its key in features.db
  std::optional<Camera> sphere;  // of a panorama: matches lie in all of it
  bool placed = true;            // in the rig
};

// The photos of a set: placed as `localized` has refined them, else as they were stitched, else not at all.
std::vector<MatchedView> ViewsOfSet(std::vector<MatchedView> photos, const fs::path& stitched,
                                    const fs::path& localized, const std::string& set) {
  std::map<std::string, View> placed;
  if (fs::exists(stitched / "rig.csv")) {
    for (View& view : ReadRigFiles(stitched).rig.views) placed[view.name] = std::move(view);
  }
  if (!placed.empty() && fs::exists(localized / "rigs.csv")) {
    const CsvTable table =
        CsvTable::Read(localized / "rigs.csv", {"panorama", "photo", "tx", "ty", "tz", "qx", "qy", "qz", "qw"});
    for (const CsvRow& row : table.rows()) {
      const auto photo = placed.find(row.Text("photo"));
      if (row.Text("panorama") != set || photo == placed.end()) continue;
      photo->second.rig_from_view = {
          Eigen::Quaterniond(row.Number("qw"), row.Number("qx"), row.Number("qy"), row.Number("qz")).normalized(),
          {row.Number("tx"), row.Number("ty"), row.Number("tz")}};
    }
  }
  for (MatchedView& photo : photos) {
    const auto its = placed.find(photo.view.name);
    photo.placed = its != placed.end();
    if (photo.placed) photo.view = its->second;
  }
  return photos;
}

// Focal length of a photo as `localize` found it, times what its EXIF states.
double FocalFactor(const Project& project, const std::string& localized, const std::string& photo) {
  const auto manifest = ReadManifest(project, "localize", localized);
  if (!manifest) return 1;
  const nlohmann::json none = nlohmann::json::array();
  for (const auto& focal : manifest->value("metrics", nlohmann::json::object()).value("photo_focals", none)) {
    const auto& photos = focal.at("photos");
    if (std::find(photos.begin(), photos.end(), photo) != photos.end())
      return focal.at("found_by_stated").get<double>();
  }
  return 1;
}

// How far a match is from the epipolar line that `cam_from_view` gives, and whether its rays meet before both.
void Judge(const Camera& camera, const Eigen::Vector3d& ray, const Rigid3d& cam_from_view,
           const Eigen::Vector3d& ray_in_view, InspectedMatch* match) {
  const Eigen::Vector3d towards = cam_from_view.rotation * ray_in_view, baseline = cam_from_view.translation;
  const Eigen::Vector3d normal = baseline.cross(towards);
  const double off = normal.norm() > 1e-9 ? std::abs(ray.dot(normal.normalized())) : 1;
  match->error_px = off * camera.MeanFocal();
  // Their crosses with the baseline point the same way.
  const bool before = ray.cross(towards).dot(ray.cross(-baseline)) > 0 || ray.dot(towards) > 0.999;
  match->inlier = match->error_px < kInlierPx && before;
}

// The pictures of the reference called `panorama`. Throws InputError if there is none.
std::vector<MatchedView> ViewsOf(const Project& project, const ViewOptions& options, const std::string& localized,
                                 const std::string& panorama) {
  std::vector<std::string> names;
  std::vector<MatchedView> views;
  std::string set;
  for (const PreparedReference& prepared : PrepareReferences(project.site(), options, nullptr)) {
    const Reference& reference = project.site().references[static_cast<size_t>(prepared.reference)];
    names.push_back(reference.name);
    if (reference.name != panorama && prepared.name != panorama) continue;
    if (reference.kind == ReferenceKind::kPhotoSet) set = reference.name;
    std::optional<Camera> sphere;
    if (reference.kind == ReferenceKind::kPanorama) {
      const cv::Mat picture = LoadPanorama(reference.files.front(), true);
      sphere = Camera::Equirectangular(picture.cols, picture.rows);
    }
    for (const View& view : prepared.rig.views) {
      views.push_back({view, prepared.name + "#" + view.name, sphere});
      if (!set.empty()) views.back().view.name = fs::path(prepared.name).filename().string();
      const double factor = sphere ? 1 : FocalFactor(project, localized, prepared.name);
      if (factor != 1) views.back().view.camera = WithFocalFactor(view.camera, factor);
    }
  }
  if (views.empty()) {
    throw InputError("there is no reference '" + panorama + "'; nearest: '" + NearestName(panorama, names) + "'");
  }
  return set.empty() ? views
                     : ViewsOfSet(std::move(views), project.ResultDir("stitch", set),
                                  project.ResultDir("localize", localized), set);
}

}  // namespace

std::vector<InspectedMatch> RunInspector::Matches(const std::string& file, const std::string& panorama,
                                                  const std::vector<fs::path>& references, const ViewOptions& options) {
  Parts& p = *parts_;
  const ImageEntry& entry = p.Entry(file);
  const fs::path images_db = p.project.ResultDir("features", p.run.name) / kFeaturesFile;
  std::vector<fs::path> view_dbs;
  for (const fs::path& result : references) view_dbs.push_back(result / kFeaturesFile);
  std::vector<fs::path> databases = view_dbs;
  databases.push_back(images_db);
  for (const fs::path& database : databases) {
    if (!fs::exists(database)) throw InputError(database.string() + ": there are no features yet; run `trigpoint run`");
  }
  const FeatureStore images(images_db), views(view_dbs);
  if (!images.Has(file)) throw InputError("image '" + file + "' has no features");
  const FeatureSet features = images.Read(file);
  const DescriptorBlock descriptors(features.descriptors);
  const Camera& camera = p.run.cameras.at(static_cast<size_t>(entry.camera)).camera;
  // Poses in the run's own frame, where both were localized.
  std::optional<Rigid3d> cam_from_odom, odom_from_pano;
  p.ReadResult();
  if (const auto it = p.model_image.find(file); it != p.model_image.end()) {
    cam_from_odom = p.model.images[it->second].cam_from_world;
  }
  for (const PanoramaResult& answer : p.result.panoramas) {
    if (answer.panorama == panorama) odom_from_pano = answer.odom_from_pano;
  }
  std::vector<InspectedMatch> matches;
  for (const MatchedView& matched : ViewsOf(p.project, options, p.localized, panorama)) {
    if (!views.Has(matched.features)) continue;
    std::optional<Rigid3d> cam_from_view;
    if (cam_from_odom && odom_from_pano && matched.placed) {
      cam_from_view = *cam_from_odom * *odom_from_pano * matched.view.rig_from_view;
    }
    // A view that looks the other way shares nothing with the image.
    if (cam_from_view && (cam_from_view->rotation * Eigen::Vector3d::UnitZ()).z() < -0.2) continue;
    const FeatureSet other = views.Read(matched.features);
    for (const auto& [a, b] : MatchMutual(descriptors, DescriptorBlock(other.descriptors), kRatio, kMaxDistance)) {
      InspectedMatch match;
      match.view = matched.view.name;
      match.image = features.points[static_cast<size_t>(a)].cast<double>();
      match.panorama = other.points[static_cast<size_t>(b)].cast<double>();
      const auto ray_in_view = matched.view.camera.Unproject(match.panorama), ray = camera.Unproject(match.image);
      if (!ray_in_view || !ray) continue;
      if (matched.sphere) {
        match.panorama =
            matched.sphere->Project(matched.view.rig_from_view.rotation * *ray_in_view).value_or(match.panorama);
      }
      match.error_px = std::numeric_limits<double>::quiet_NaN();
      if (cam_from_view) Judge(camera, *ray, *cam_from_view, *ray_in_view, &match);
      matches.push_back(std::move(match));
    }
  }
  return matches;
}

}  // namespace trigpoint
