// Results as scenes: models, point clouds, graphs.
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unordered_map>

#include "app/pipeline/export.h"
#include "app/pipeline/feature_store.h"
#include "app/pipeline/stages.h"
#include "datasets/export/scene_files.h"
#include "datasets/project/files.h"
#include "eval/evaluate.h"
#include "eval/results.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Observations in a model are rays cast back into pixels: the feature they came from is the nearest one.
constexpr double kFeatureRadiusPx = 0.05;

// Nearest features by cells of one pixel.
class FeatureGrid {
 public:
  explicit FeatureGrid(const FeatureSet& features) : features_(features), taken_(features.size(), false) {
    for (size_t i = 0; i < features.size(); ++i) cells_[Key(features.points[i].cast<double>())].push_back(i);
  }
  // The nearest one within the radius that nobody took; several may lie on the same place (orientations of SIFT).
  std::optional<size_t> Take(const Eigen::Vector2d& pixel) {
    std::optional<size_t> best;
    double best_distance = kFeatureRadiusPx;
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        const auto cell = cells_.find(Key(pixel + Eigen::Vector2d(dx, dy)));
        if (cell == cells_.end()) continue;
        for (size_t i : cell->second) {
          const double distance = (features_.points[i].cast<double>() - pixel).norm();
          if (taken_[i] || distance > best_distance) continue;
          best_distance = distance;
          best = i;
        }
      }
    }
    if (best) taken_[*best] = true;
    return best;
  }

 private:
  static int64_t Key(const Eigen::Vector2d& p) {
    return static_cast<int64_t>(std::floor(p.x())) * 1'000'003 + static_cast<int64_t>(std::floor(p.y()));
  }
  const FeatureSet& features_;
  std::vector<bool> taken_;
  std::unordered_map<int64_t, std::vector<size_t>> cells_;
};

std::vector<std::string> FrameComments(const Project& project, const RunScene& scene) {
  std::string frame = "frame: odom, the run's own optimised frame, m";
  if (scene.world) {
    const Geodetic& o = project.frame().origin();
    frame = fmt::format("frame: ENU, m, origin latitude {:.9f} deg, longitude {:.9f} deg, ellipsoidal height {:.4f} m",
                        o.latitude_deg, o.longitude_deg, o.height_m);
  }
  return {"trigpoint export of run " + scene.run, frame};
}

void ExportPly(const Project& project, const RunScene& scene, const fs::path& file) {
  using Type = PlyColumn::Type;
  std::vector<PlyColumn> columns = {{"x", Type::kDouble, {}},  {"y", Type::kDouble, {}},    {"z", Type::kDouble, {}},
                                    {"red", Type::kUchar, {}}, {"green", Type::kUchar, {}}, {"blue", Type::kUchar, {}}};
  for (const char* name : {"cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz", "sigma_max", "error_px"}) {
    columns.push_back({name, Type::kFloat, {}});
  }
  columns.push_back({"track_length", Type::kInt, {}});
  for (const ModelPoint& point : scene.model.points) {
    const std::optional<Eigen::Matrix3d> covariance = PointCovariance(scene.model, point, scene.sigma_px);
    if (!covariance) continue;
    const Eigen::Matrix3d& c = *covariance;
    size_t i = 0;
    for (double v : {point.position.x(), point.position.y(), point.position.z(), double(point.rgb[0]),
                     double(point.rgb[1]), double(point.rgb[2]), c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2),
                     std::sqrt(c.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()), point.error_px,
                     static_cast<double>(point.track.size())}) {
      columns[i++].values.push_back(v);
    }
  }
  std::vector<std::string> comments = FrameComments(project, scene);
  comments.push_back(fmt::format(
      "cov_*: m^2, sigma_max: m (1 sigma, largest axis): of triangulation with {:.3f} px, given the cameras",
      scene.sigma_px));
  WritePly(file, columns, comments);
}

// The manifest of the run's localization.
nlohmann::json LocalizeManifest(const Project& project, const StageTarget& target) {
  const auto manifest = ReadManifest(project, "localize", ResultName(StageNamed("localize"), target));
  return manifest ? *manifest : nlohmann::json::object();
}

PoseGraph MakeBundle(const RunScene& scene) {
  PoseGraph graph;
  std::map<uint32_t, std::pair<int, const Camera*>> cameras;
  for (const auto& [id, camera] : scene.model.cameras) {
    cameras[id] = {static_cast<int>(graph.cameras.size()), &camera};
    graph.cameras.push_back({camera.MeanFocal(), 0.5 * (camera.width() - 1), 0.5 * (camera.height() - 1)});
  }
  std::map<uint32_t, const ModelImage*> images;
  int last = 0;
  for (const ModelImage& image : scene.model.images) {
    images[image.id] = &image;
    graph.poses.emplace_back(static_cast<int>(image.id), image.cam_from_world.Inverse());
    last = std::max(last, static_cast<int>(image.id));
  }
  // Two fixed poses hold frame and scale.
  if (!graph.poses.empty()) graph.fixed = {graph.poses.front().first, graph.poses.back().first};
  for (const ModelPoint& point : scene.model.points) {
    const int id = ++last;
    graph.points.emplace_back(id, point.position);
    for (const auto& [image_id, index] : point.track) {
      const ModelImage& image = *images.at(image_id);
      const auto& [number, of_image] = cameras.at(image.camera_id);
      const Camera* const camera = of_image;  // clang 14 does not capture bindings
      const auto& intrinsics = graph.cameras[static_cast<size_t>(number)];
      // The pixel as a pinhole without distortion sees it, and what an error of the real pixel becomes there.
      const auto undistorted = [&](const Eigen::Vector2d& pixel) -> std::optional<Eigen::Vector2d> {
        const auto ray = camera->Unproject(pixel);
        if (!ray || ray->z() < 0.1) return std::nullopt;
        return Eigen::Vector2d(intrinsics[0] * ray->x() / ray->z() + intrinsics[1],
                               intrinsics[0] * ray->y() / ray->z() + intrinsics[2]);
      };
      const Eigen::Vector2d& pixel = image.pixels[index];
      const auto at = undistorted(pixel), right = undistorted(pixel + Eigen::Vector2d(0.5, 0)),
                 down = undistorted(pixel + Eigen::Vector2d(0, 0.5));
      if (!at || !right || !down) continue;
      Eigen::Matrix2d j;
      j << 2 * (*right - *at), 2 * (*down - *at);
      PoseGraph::PixelEdge edge;
      edge.pose = static_cast<int>(image_id);
      edge.point = id;
      edge.camera = number;
      edge.pixel = *at;
      edge.covariance = scene.sigma_px * scene.sigma_px * j * j.transpose();
      graph.pixel_edges.push_back(edge);
    }
  }
  return graph;
}

void ExportColmap(const RunScene& scene, const fs::path& out, ExportReport* report, const CancelToken& cancel) {
  WriteColmapModel(scene.model, out, ModelFormat::kBinary);
  WriteColmapModel(scene.model, out / "text", ModelFormat::kText);
  WriteSceneDatabase(scene, out / "database.db", cancel);
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin", "text/cameras.txt", "text/images.txt",
                           "text/points3D.txt", "database.db"}) {
    report->files.push_back(out / file);
  }
}

}  // namespace

PoseGraph MakePoseGraph(const Project& project, const std::string& variant, const RunScene& scene) {
  PoseGraph graph;
  const Run& run = project.run(scene.run);
  const StageTarget target{scene.run, variant, nlohmann::json::object()};
  const nlohmann::json manifest = LocalizeManifest(project, target);
  const StageInfo& stage = StageNamed("reconstruct");
  const auto made =
      ReadManifest(project, stage.name, ResultName(stage, TargetRead(project, stage, "localize", target)));
  const nlohmann::json options = made.value_or(nlohmann::json::object())
                                     .value("options", nlohmann::json::object())
                                     .value("reconstruct", nlohmann::json::object());
  const nlohmann::json metrics = manifest.value("metrics", nlohmann::json::object());
  const std::vector<double> factors =
      metrics.value("odometry_noise_factor_rx_ry_rz_x_y_z", std::vector<double>(6, 1.0));
  const double scale = metrics.value("odometry_scale", 1.0);
  std::map<std::string, const ImageEntry*> entries;
  for (const ImageEntry& entry : run.images) entries[entry.file] = &entry;

  std::optional<Rigid3d> previous_odom;  // odom_from_cam as measured
  int previous_id = -1;
  for (const ModelImage& image : scene.model.images) {
    const int id = static_cast<int>(image.id);
    graph.poses.emplace_back(id, image.cam_from_world.Inverse());
    const auto entry = entries.find(image.name);
    if (entry == entries.end()) continue;
    const BodyCamera& camera = run.cameras[static_cast<size_t>(entry->second->camera)];
    if (entry->second->camera != 0) continue;  // one chain, of the first camera
    const auto body = run.odometry.At(entry->second->stamp_ns + std::llround(camera.time_offset_s * 1e9), INT64_MAX);
    if (!body) continue;
    const Rigid3d odom_from_cam = *body * camera.cam_from_body.Inverse();
    if (previous_odom) {
      PoseGraph::Edge edge;
      edge.a = previous_id, edge.b = id;
      edge.a_from_b = previous_odom->Inverse() * odom_from_cam;
      edge.a_from_b.translation *= scale;
      const double length = edge.a_from_b.translation.norm();
      const double rotation = kDegToRad * std::hypot(options.value("odometry_rotation_deg", 0.1),
                                                     options.value("odometry_rotation_deg_m", 0.3) * length);
      const double translation = std::hypot(options.value("odometry_translation_m", 0.005),
                                            options.value("odometry_translation_part", 0.02) * length);
      Vector6d sigma;  // of the body's axes
      for (int k = 0; k < 6; ++k) sigma(k) = (k < 3 ? rotation : translation) * factors.at(static_cast<size_t>(k));
      const Eigen::Matrix3d r = camera.cam_from_body.rotation.toRotationMatrix();
      Matrix6d turn = Matrix6d::Zero();
      turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = r;
      edge.covariance = turn * sigma.cwiseAbs2().asDiagonal() * turn.transpose();
      graph.edges.push_back(edge);
    }
    previous_odom = odom_from_cam;
    previous_id = id;
  }
  if (!graph.poses.empty()) graph.fixed = {graph.poses.front().first};

  // Panoramas: points that their nearest camera sees, with the uncertainty they have in the run's frame.
  const LocalizeResult result = ReadLocalizeResult(ResultOf(project, "localize", target));
  const auto world_from_odom = WorldFromOdom(result.cameras_odom, result.cameras);
  int id = graph.poses.empty() ? 0 : graph.poses.back().first;
  for (const PanoramaResult& panorama : result.panoramas) {
    if (!panorama.odom_from_pano || !panorama.odom_sigma_m || graph.poses.empty()) continue;
    const Rigid3d frame_from_odom = scene.world && world_from_odom ? *world_from_odom : Rigid3d();
    const Eigen::Vector3d p = frame_from_odom * panorama.odom_from_pano->translation;
    const auto nearest = std::min_element(graph.poses.begin(), graph.poses.end(), [&](const auto& a, const auto& b) {
      return (a.second.translation - p).norm() < (b.second.translation - p).norm();
    });
    PoseGraph::PointEdge edge;
    edge.pose = nearest->first;
    edge.point = ++id;
    edge.in_pose = nearest->second.Inverse() * p;
    const Eigen::Matrix3d r = (nearest->second.rotation.conjugate() * frame_from_odom.rotation).toRotationMatrix();
    edge.covariance = r * panorama.odom_sigma_m->cwiseMax(1e-6).cwiseAbs2().asDiagonal() * r.transpose();
    graph.points.emplace_back(edge.point, p);
    graph.point_edges.push_back(edge);
  }
  return graph;
}

RunScene ReadRunScene(const Project& project, const std::string& run, const std::string& variant,
                      const std::string& frame) {
  RunScene scene;
  scene.run = project.run(run).name;
  const StageTarget target{run, variant, nlohmann::json::object()};
  const fs::path dir = ResultOf(project, "localize", target);
  if (!HasColmapModel(dir / "sparse")) {
    throw InputError("run " + run + ": not localized yet" + (variant.empty() ? "" : " in variant " + variant) +
                     "; run trigpoint localize first");
  }
  scene.model = ReadColmapModel(dir / "sparse");
  scene.sigma_px =
      LocalizeManifest(project, target).value("metrics", nlohmann::json::object()).value("feature_sigma_px", 1.0);
  const LocalizeResult result = ReadLocalizeResult(dir);
  const auto world_from_odom = WorldFromOdom(result.cameras_odom, result.cameras);
  if (frame == "world" && !world_from_odom) {
    throw InputError("run " + run + ": is not on the Earth (see its log.txt); ask for --frame odom");
  }
  scene.world = frame != "odom" && world_from_odom.has_value();
  if (scene.world) {
    const Rigid3d odom_from_world = world_from_odom->Inverse();
    for (ModelImage& image : scene.model.images) image.cam_from_world = image.cam_from_world * odom_from_world;
    for (ModelPoint& point : scene.model.points) point.position = *world_from_odom * point.position;
  }
  scene.features = ResultOf(project, "features", {run, "", nlohmann::json::object()}) / "features.db";
  return scene;
}

std::optional<Eigen::Matrix3d> PointCovariance(const SparseModel& model, const ModelPoint& point, double sigma_px) {
  // Images and cameras are found by id; ids of a localization are 1..n.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  int rays = 0;
  for (const auto& [id, index] : point.track) {
    const ModelImage* image =
        id >= 1 && id <= model.images.size() && model.images[id - 1].id == id ? &model.images[id - 1] : nullptr;
    if (image == nullptr) {
      const auto it =
          std::find_if(model.images.begin(), model.images.end(), [id = id](const ModelImage& m) { return m.id == id; });
      if (it == model.images.end()) continue;
      image = &*it;
    }
    Eigen::Matrix<double, 2, 3> jacobian;
    if (!model.CameraOf(*image).Project(image->cam_from_world * point.position, &jacobian)) continue;
    const Eigen::Matrix<double, 2, 3> j = jacobian * image->cam_from_world.rotation.toRotationMatrix();
    information += j.transpose() * j / (sigma_px * sigma_px);
    ++rays;
  }
  if (rays < 2) return std::nullopt;
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(information);
  if (!lu.isInvertible()) return std::nullopt;
  return lu.inverse();
}

std::map<uint32_t, std::vector<int>> WriteSceneDatabase(const RunScene& scene, const fs::path& file,
                                                        const CancelToken& cancel) {
  const FeatureStore store(scene.features);
  ColmapDatabase database = ColmapDatabase::Create(file);
  database.Begin();
  std::map<uint32_t, uint32_t> camera_ids;
  for (const auto& [id, camera] : scene.model.cameras) camera_ids[id] = database.AddCamera(camera);
  std::map<uint32_t, uint32_t> image_ids;
  // Feature of each pixel of the model.
  std::map<uint32_t, std::vector<int>> feature_of;
  for (const ModelImage& image : scene.model.images) {
    cancel.ThrowIfCancelled();
    const uint32_t id = image_ids[image.id] = database.AddImage(image.name, camera_ids.at(image.camera_id));
    const FeatureSet features = store.Read(image.name);
    database.WriteFeatures(id, features);
    FeatureGrid grid(features);
    std::vector<int>& of = feature_of[image.id];
    for (const Eigen::Vector2d& pixel : image.pixels) {
      const auto feature = grid.Take(pixel);
      of.push_back(feature ? static_cast<int>(*feature) : -1);
    }
  }
  std::map<std::pair<uint32_t, uint32_t>, std::vector<std::pair<int, int>>> matches;
  for (const ModelPoint& point : scene.model.points) {
    for (size_t i = 0; i < point.track.size(); ++i) {
      for (size_t j = i + 1; j < point.track.size(); ++j) {
        auto a = point.track[i], b = point.track[j];
        if (a.first == b.first) continue;
        if (a.first > b.first) std::swap(a, b);
        const int fa = feature_of.at(a.first)[a.second], fb = feature_of.at(b.first)[b.second];
        if (fa >= 0 && fb >= 0) matches[{a.first, b.first}].emplace_back(fa, fb);
      }
    }
  }
  for (const auto& [pair, rows] : matches) {
    database.WriteVerifiedMatches(image_ids.at(pair.first), image_ids.at(pair.second), rows);
  }
  database.Commit();
  return feature_of;
}

void ExportScene(const Project& project, const ExportRequest& request, const std::string& run, const fs::path& out,
                 ExportReport* report, const CancelToken& cancel) {
  const RunScene scene = ReadRunScene(project, run, request.variant, request.frame);
  const std::vector<std::string> comments = FrameComments(project, scene);
  if (request.to == "colmap") {
    ExportColmap(scene, out, report, cancel);
  } else if (request.to == "ply") {
    ExportPly(project, scene, out / "points.ply");
    report->files.push_back(out / "points.ply");
  } else {
    WriteG2oPoseGraph(out / "pose_graph.g2o", MakePoseGraph(project, request.variant, scene), comments);
    WriteG2oBundle(out / "bundle.g2o", MakeBundle(scene), comments);
    report->files.insert(report->files.end(), {out / "pose_graph.g2o", out / "bundle.g2o"});
  }
  report->lines.push_back(fmt::format("{}: {} images, {} points, frame {}", run, scene.model.images.size(),
                                      scene.model.points.size(), scene.world ? "world (ENU)" : "odom"));
}

}  // namespace trigpoint
