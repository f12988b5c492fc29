#include "eval/exchange/scene.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/counted.h"
#include "datasets/export/scene_files.h"
#include "datasets/project/files.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "datasets/solution/solution_model.h"
#include "eval/inspect/run_inspector.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> FrameComments(const RunScene& scene) {
  std::string frame = "frame: odom, the run's own optimised frame, m";
  if (scene.world_from_odom) {
    const Geodetic& o = scene.solution.georeference->origin;
    frame = fmt::format("frame: ENU, m, origin latitude {:.9f} deg, longitude {:.9f} deg, ellipsoidal height {:.4f} m",
                        o.latitude_deg, o.longitude_deg, o.height_m);
  }
  return {"trigpoint export of run " + scene.run, frame};
}

void ExportPly(const RunScene& scene, const fs::path& file) {
  using Type = PlyColumn::Type;
  std::vector<PlyColumn> columns = {{"x", Type::kDouble, {}},  {"y", Type::kDouble, {}},    {"z", Type::kDouble, {}},
                                    {"red", Type::kUchar, {}}, {"green", Type::kUchar, {}}, {"blue", Type::kUchar, {}}};
  for (const char* name : {"cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz", "sigma_max", "error_px"}) {
    columns.push_back({name, Type::kFloat, {}});
  }
  columns.push_back({"track_length", Type::kInt, {}});
  for (const ModelPoint& point : scene.model.points) {
    const std::optional<Eigen::Matrix3d> covariance = PointCovariance(scene, point);
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
  std::vector<std::string> comments = FrameComments(scene);
  comments.push_back(fmt::format(
      "cov_*: m^2, sigma_max: m (1 sigma, largest axis): of triangulation with {:.3f} px, given the cameras",
      scene.solution.sigma_px));
  WritePly(file, columns, comments);
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
      edge.covariance = std::pow(scene.solution.sigma_px, 2) * j * j.transpose();
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

// Cameras chained by odometry with the noise that localize found, panoramas as points seen from their nearest camera.
// One chain, of the first camera; ids are those of the model.
PoseGraph MakePoseGraph(const RunScene& scene) {
  PoseGraph graph;
  const Solution& s = scene.solution;
  const Sim3d frame_from_odom = scene.world_from_odom.value_or(Sim3d());
  std::map<int, int> id_of;  // of body poses
  for (size_t i = 0; i < s.images.size(); ++i) {
    const int id = static_cast<int>(i + 1);
    graph.poses.emplace_back(id, scene.model.images[i].cam_from_world.Inverse());
    if (s.images[i].camera == 0) id_of[s.images[i].pose] = id;
  }
  if (graph.poses.empty()) return graph;
  graph.fixed = {graph.poses.front().first};
  const Rigid3d& cam_from_body = s.cameras.front().cam_from_body;
  for (const PoseFactor& f : s.problem.factors) {
    if (f.kind != PoseFactor::Kind::kBetween || id_of.count(f.a) == 0 || id_of.count(f.b) == 0) continue;
    PoseGraph::Edge edge;
    edge.a = id_of[f.a], edge.b = id_of[f.b];
    Rigid3d a_from_b = f.measured;
    if (f.scale >= 0) a_from_b.translation *= s.problem.scales[static_cast<size_t>(f.scale)].value;
    edge.a_from_b = cam_from_body * a_from_b * cam_from_body.Inverse();
    // From the bodies' tangents to the cameras'.
    Matrix6d j = Matrix6d::Zero();
    j.topLeftCorner<3, 3>() = j.bottomRightCorner<3, 3>() = cam_from_body.rotation.toRotationMatrix();
    j.bottomLeftCorner<3, 3>() =
        -j.topLeftCorner<3, 3>() * Skew(a_from_b.rotation * cam_from_body.TargetOriginInSource());
    j.bottomRows<3>() *= frame_from_odom.scale;
    edge.a_from_b.translation *= frame_from_odom.scale;
    edge.covariance = j * (f.sqrt_info.transpose() * f.sqrt_info).inverse() * j.transpose();
    graph.edges.push_back(edge);
  }
  int id = graph.poses.back().first;
  for (const SolutionReference& reference : s.references) {
    if (reference.pose < 0 || reference.status != "localized" || s.covariances.empty()) continue;
    const Eigen::Vector3d p = frame_from_odom * OdomFromRig(s, reference.pose).translation;
    const auto nearest = std::min_element(graph.poses.begin(), graph.poses.end(), [&](const auto& a, const auto& b) {
      return (a.second.translation - p).norm() < (b.second.translation - p).norm();
    });
    PoseGraph::PointEdge edge;
    edge.pose = nearest->first;
    edge.point = ++id;
    edge.in_pose = nearest->second.Inverse() * p;
    const Eigen::Matrix3d r =
        frame_from_odom.scale * (nearest->second.rotation.conjugate() * frame_from_odom.rotation).toRotationMatrix();
    edge.covariance = r * OdomCovariance(s, reference.pose).bottomRightCorner<3, 3>() * r.transpose();
    graph.points.emplace_back(edge.point, p);
    graph.point_edges.push_back(edge);
  }
  return graph;
}

}  // namespace

RunScene ReadRunScene(const Project& project, const std::string& run, const std::string& variant,
                      const std::string& frame) {
  RunScene scene;
  scene.run = project.run(run).name;
  const fs::path dir = project.ResultDir("localize", ResultNameOf(run, variant));
  if (!fs::exists(dir / kSolutionFile)) {
    if (const std::string older = OlderLocalization(project, run, variant); !older.empty()) throw InputError(older);
    throw InputError("run " + run + ": not localized yet" + (variant.empty() ? "" : " in variant " + variant) +
                     "; run trigpoint localize first");
  }
  scene.solution = ReadSolution(dir / kSolutionFile);
  SolutionModel model = ModelOf(scene.solution);
  scene.model = std::move(model.model);
  scene.feature_of = std::move(model.feature_of);
  const bool on_earth = scene.solution.georeference.has_value();
  if (frame == "world" && !on_earth) {
    throw InputError("run " + run + ": is not georeferenced (its log.txt has the reason); give --frame odom");
  }
  if (frame != "odom" && on_earth) {
    const Sim3d& world_from_odom = scene.world_from_odom.emplace(scene.solution.georeference->world_from_odom);
    for (ModelImage& image : scene.model.images) {
      image.cam_from_world = world_from_odom.TransformPose(image.cam_from_world.Inverse()).Inverse();
    }
    for (ModelPoint& point : scene.model.points) point.position = world_from_odom * point.position;
  }
  scene.features = project.ResultDir("features", run) / kFeaturesFile;
  return scene;
}

std::optional<Eigen::Matrix3d> PointCovariance(const RunScene& scene, const ModelPoint& point) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  int rays = 0;
  for (const auto& [id, index] : point.track) {
    const ModelImage& image = scene.model.images[id - 1];
    Eigen::Matrix<double, 2, 3> jacobian;
    if (!scene.model.CameraOf(image).Project(image.cam_from_world * point.position, &jacobian)) continue;
    const Eigen::Matrix<double, 2, 3> j = jacobian * image.cam_from_world.rotation.toRotationMatrix();
    information += j.transpose() * j / std::pow(scene.solution.sigma_px, 2);
    ++rays;
  }
  if (rays < 2) return std::nullopt;
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(information);
  if (!lu.isInvertible()) return std::nullopt;
  return lu.inverse();
}

namespace {

// The features of an image, those of points where the reconstruction takes them to be: pictures of points are aligned.
FeatureSet FeaturesAsMeasured(const RunScene& scene, size_t image, FeatureSet features) {
  const ModelImage& model = scene.model.images[image];
  for (size_t k = 0; k < model.pixels.size(); ++k) {
    const auto feature = static_cast<size_t>(scene.feature_of[image][k]);
    // Features may have been found anew since.
    if (model.points[k] >= 0 && feature < features.points.size())
      features.points[feature] = model.pixels[k].cast<float>();
  }
  return features;
}

}  // namespace

void WriteSceneDatabase(const RunScene& scene, const fs::path& file, const CancelToken& cancel) {
  const FeatureStore store(scene.features);
  ColmapDatabase database = ColmapDatabase::Create(file);
  database.Begin();
  std::map<uint32_t, uint32_t> camera_ids;
  for (const auto& [id, camera] : scene.model.cameras) camera_ids[id] = database.AddCamera(camera);
  std::vector<uint32_t> image_ids;
  for (const ModelImage& image : scene.model.images) {
    cancel.ThrowIfCancelled();
    const FeatureSet features = FeaturesAsMeasured(scene, image_ids.size(), store.Read(image.name));
    image_ids.push_back(database.AddImage(image.name, camera_ids.at(image.camera_id)));
    database.WriteFeatures(image_ids.back(), features);
  }
  std::map<std::pair<size_t, size_t>, std::vector<std::pair<int, int>>> matches;  // by indices of images
  for (const ModelPoint& point : scene.model.points) {
    for (size_t i = 0; i < point.track.size(); ++i) {
      for (size_t j = i + 1; j < point.track.size(); ++j) {
        auto a = point.track[i], b = point.track[j];
        if (a.first == b.first) continue;
        if (a.first > b.first) std::swap(a, b);
        const size_t of_a = a.first - 1, of_b = b.first - 1;
        matches[{of_a, of_b}].emplace_back(scene.feature_of[of_a][a.second], scene.feature_of[of_b][b.second]);
      }
    }
  }
  for (const auto& [pair, rows] : matches) {
    database.WriteVerifiedMatches(image_ids[pair.first], image_ids[pair.second], rows);
  }
  database.Commit();
}

void ExportScene(const Project& project, const ExportRequest& request, const std::string& run, const fs::path& out,
                 ExportReport* report, const CancelToken& cancel) {
  const RunScene scene = ReadRunScene(project, run, request.variant, request.frame);
  const std::vector<std::string> comments = FrameComments(scene);
  if (scene.world_from_odom) {
    const LocalFrame enu(scene.solution.georeference->origin);
    WarnOfOtherOrigin(project, enu, "run " + run, &report->warnings);
  }
  if (request.to == "colmap") {
    ExportColmap(scene, out, report, cancel);
  } else if (request.to == "ply") {
    ExportPly(scene, out / "points.ply");
    report->files.push_back(out / "points.ply");
  } else {
    WriteG2oPoseGraph(out / "pose_graph.g2o", MakePoseGraph(scene), comments);
    WriteG2oBundle(out / "bundle.g2o", MakeBundle(scene), comments);
    report->files.insert(report->files.end(), {out / "pose_graph.g2o", out / "bundle.g2o"});
  }
  report->lines.push_back(fmt::format("{}: {}, {}, frame {}", run, Counted(scene.model.images.size(), "image"),
                                      Counted(scene.model.points.size(), "point"),
                                      scene.world_from_odom ? "world (ENU)" : "odom"));
}

}  // namespace trigpoint
