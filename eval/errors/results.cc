#include "eval/errors/results.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/solution/reference_rows.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"

namespace trigpoint {
namespace {

// A number, or nothing for an empty cell, a missing column or "nan".
std::optional<double> Given(const CsvRow& row, const std::string& column) {
  if (!row.Has(column)) return std::nullopt;
  const std::optional<double> value = ParseDouble(row.Text(column));
  if (value && !std::isfinite(*value)) return std::nullopt;
  return row.Number(column);
}

std::optional<Eigen::Vector3d> GivenVector(const CsvRow& row, const std::string& prefix, const std::string& suffix = "",
                                           const std::string& axes = "xyz") {
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) {
    const auto value = Given(row, fmt::format("{}{}{}", prefix, axes[static_cast<size_t>(i)], suffix));
    if (!value) return std::nullopt;
    v[i] = *value;
  }
  return v;
}

// <prefix>x, y, z, qx, qy, qz, qw. A position without a rotation is no pose.
std::optional<Rigid3d> GivenPose(const CsvRow& row, const std::string& prefix) {
  const auto t = GivenVector(row, prefix);
  const auto v = GivenVector(row, prefix + "q");
  const auto w = Given(row, prefix + "qw");
  if (!t || !v || !w) return std::nullopt;
  const Eigen::Quaterniond q(*w, v->x(), v->y(), v->z());
  if (std::abs(q.norm() - 1) > 1e-3) {
    row.Fail(fmt::format("{}qx..qw is no unit quaternion: its norm is {:.6f}, expected 1", prefix, q.norm()));
  }
  return Rigid3d(q, *t);
}

// c00..c55; unset unless complete.
std::optional<Matrix6d> GivenCovariance(const CsvRow& row) {
  Matrix6d c;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const auto value = Given(row, fmt::format("c{}{}", i, j));
      if (!value) return std::nullopt;
      c(i, j) = *value;
    }
  }
  return c;
}

int Count(const CsvRow& row, const char* column) { return static_cast<int>(Given(row, column).value_or(0)); }

std::vector<TimedPose> ReadPosesIfThere(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  if (!std::filesystem::exists(file)) return {};
  Trajectory trajectory = ReadTrajectory(file);
  warnings->insert(warnings->end(), trajectory.warnings.begin(), trajectory.warnings.end());
  return std::move(trajectory.poses);
}

std::vector<PanoramaResult> ReadPanoramaResults(const std::filesystem::path& panoramas_csv) {
  std::vector<PanoramaResult> results;
  const CsvTable table = CsvTable::Read(panoramas_csv, {"panorama", "station", "status", "odom_x", "odom_y", "odom_z"});
  for (const CsvRow& row : table.rows()) {
    results.push_back({.panorama = row.Text("panorama"),
                       .station = row.Text("station"),
                       .status = row.Text("status"),
                       .reason = row.Has("reason") ? row.Text("reason") : "",
                       .world_from_pano = GivenPose(row, ""),
                       .sigma_m = GivenVector(row, "sigma_", "_m"),
                       .odom_from_pano = GivenPose(row, "odom_"),
                       .odom_sigma_m = GivenVector(row, "odom_sigma_", "_m")});
  }
  return results;
}

std::vector<ViewResult> ReadViewResults(const std::filesystem::path& views_csv) {
  std::vector<ViewResult> results;
  const CsvTable table =
      CsvTable::Read(views_csv, {"panorama", "view", "status", "odom_x", "odom_y", "odom_z", "inliers"});
  for (const CsvRow& row : table.rows()) {
    results.push_back({.panorama = row.Text("panorama"),
                       .view = row.Text("view"),
                       .status = row.Text("status"),
                       .reason = row.Has("reason") ? row.Text("reason") : "",
                       .odom_from_view = GivenPose(row, "odom_"),
                       .inliers = Count(row, "inliers"),
                       .distance_m = Given(row, "distance_m").value_or(0)});
  }
  return results;
}

std::vector<CameraResult> ReadCameraResults(const std::filesystem::path& cameras_csv) {
  std::vector<CameraResult> results;
  const CsvTable table = CsvTable::Read(cameras_csv, {"timestamp", "x", "y", "z"});
  for (const CsvRow& row : table.rows()) {
    results.push_back({.stamp_ns = row.StampNs("timestamp"),
                       .image = row.Has("image") ? row.Text("image") : "",
                       .camera = row.Has("camera") ? row.Text("camera") : "",
                       .world_from_cam = GivenPose(row, ""),
                       .sigma_m = GivenVector(row, "sigma_", "_m", "enu")});
  }
  return results;
}

Eigen::Vector3d PositionSigma(const Matrix6d& covariance) {
  return covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
}

void SetPoses(const Solution& s, LocalizeResult* result) {
  for (const SolutionImage& image : s.images) {
    const Rigid3d odom_from_cam = OdomFromCam(s, image);
    if (s.cameras[static_cast<size_t>(image.camera)].IsFurtherView()) continue;  // its 360 image reports the pose
    if (image.camera == 0) result->cameras_odom.push_back({image.stamp_ns, odom_from_cam});
    if (!s.georeference) continue;
    const Rigid3d world_from_cam =
        s.georeference->world_from_odom.TransformPose(OdomFromRig(s, image.pose)) * BodyFromCam(s, image);
    if (image.camera == 0) result->cameras.push_back({image.stamp_ns, world_from_cam});
    CameraResult& camera = result->images.emplace_back();
    camera.stamp_ns = image.stamp_ns, camera.image = image.name;
    camera.camera = s.cameras[static_cast<size_t>(image.camera)].name;
    camera.world_from_cam = world_from_cam;
    if (s.covariances.empty()) continue;
    const Matrix6d covariance = ImageWorldCovariance(s, image);
    camera.covariance_m2 = covariance.bottomRightCorner<3, 3>();
    camera.sigma_m = PositionSigma(covariance);
  }
}

void SetPanoramas(const Solution& s, LocalizeResult* result) {
  for (const ReferenceRow& row : ReferenceRows(s)) {
    const SolutionReference& shown = s.references[row.shown];
    PanoramaResult& answer = result->panoramas.emplace_back();
    answer.panorama = row.name;
    answer.station = shown.station, answer.status = shown.status, answer.reason = shown.reason;
    if (row.localized.empty()) continue;
    answer.odom_from_pano = row.odom_from_pano;
    if (s.georeference) answer.world_from_pano = s.georeference->world_from_odom.TransformPose(row.odom_from_pano);
    if (s.covariances.empty()) continue;
    answer.odom_sigma_m = PositionSigma(OdomCovariance(s, row));
    if (!s.georeference) continue;
    const Matrix6d covariance = WorldCovariance(s, row);
    answer.covariance_m2 = covariance.bottomRightCorner<3, 3>();
    answer.sigma_m = PositionSigma(covariance);
  }
}

}  // namespace

std::string CommentValue(const std::vector<std::string>& comments, const std::string& key) {
  for (const std::string& comment : comments) {
    const size_t at = comment.find(key + "=");
    if (at == std::string::npos) continue;
    const size_t begin = at + key.size() + 1;
    return std::string(Trim(std::string_view(comment).substr(begin, comment.find(';', begin) - begin)));
  }
  return "";
}

std::string TagMapFrame(const std::filesystem::path& tags_csv) {
  return CommentValue(CsvTable::Read(tags_csv, {"tag_id"}).comments(), "frame");
}

std::vector<TagResult> ReadTagResults(const std::filesystem::path& tags_csv,
                                      const std::filesystem::path& tags_cov_csv) {
  std::vector<TagResult> results;
  std::map<int, size_t> index;
  const CsvTable table = CsvTable::Read(tags_csv, {"tag_id", "x", "y", "z", "qx", "qy", "qz", "qw"});
  for (const CsvRow& row : table.rows()) {
    TagResult tag;
    tag.tag_id = static_cast<int>(row.Integer("tag_id"));
    if (row.Has("family")) tag.family = row.Text("family");
    tag.size_m = Given(row, "size_m").value_or(0);
    tag.map_from_tag = GivenPose(row, "");
    tag.sigma_m = GivenVector(row, "sigma_", "_m");
    if (const auto deg = GivenVector(row, "sigma_r", "_deg")) tag.sigma_rot_rad = kDegToRad * *deg;
    tag.images = Count(row, "images");
    tag.runs = Count(row, "runs");
    tag.rms_px = Given(row, "rms_px").value_or(0);
    if (row.Has("role")) tag.role = row.Text("role");
    if (row.Has("status")) tag.status = row.Text("status");
    if (!index.emplace(tag.tag_id, results.size()).second) {
      row.Fail(fmt::format("tag {} stands twice; keep one of its rows", tag.tag_id));
    }
    results.push_back(std::move(tag));
  }
  if (tags_cov_csv.empty() || !std::filesystem::exists(tags_cov_csv)) return results;
  const CsvTable covariances = CsvTable::Read(tags_cov_csv, {"tag_a", "tag_b", "c00", "c55"});
  for (const CsvRow& row : covariances.rows()) {
    if (row.Integer("tag_a") != row.Integer("tag_b")) continue;
    const auto it = index.find(static_cast<int>(row.Integer("tag_a")));
    if (it == index.end()) continue;
    if (const auto c = GivenCovariance(row)) results[it->second].covariance = 0.5 * (*c + c->transpose());
  }
  return results;
}

TagCovariances ReadTagCovariances(const std::filesystem::path& tags_cov_csv) {
  TagCovariances results;
  if (tags_cov_csv.empty() || !std::filesystem::exists(tags_cov_csv)) return results;
  const CsvTable table = CsvTable::Read(tags_cov_csv, {"tag_a", "tag_b", "c00", "c55"});
  for (const CsvRow& row : table.rows()) {
    const int a = static_cast<int>(row.Integer("tag_a")), b = static_cast<int>(row.Integer("tag_b"));
    if (a == b) continue;
    const auto c = GivenCovariance(row);
    if (c) results[{std::min(a, b), std::max(a, b)}] = a < b ? *c : Matrix6d(c->transpose());
  }
  return results;
}

LocalizeResult ReadLocalizeResult(const std::filesystem::path& dir) {
  if (!std::filesystem::exists(dir / kSolutionFile)) return ReadLocalizeResult(dir, nullptr);
  const Solution solution = ReadSolution(dir / kSolutionFile);
  return ReadLocalizeResult(dir, &solution);
}

LocalizeResult ReadLocalizeResult(const std::filesystem::path& dir, const Solution* solution) {
  LocalizeResult result;
  if (solution != nullptr) {
    SetPoses(*solution, &result);
    SetPanoramas(*solution, &result);
    if (solution->georeference) result.world_from_odom = solution->georeference->world_from_odom;
  } else {
    result.panoramas = ReadPanoramaResults(dir / "panoramas.csv");
    result.cameras_odom = ReadPosesIfThere(dir / "cameras_odom.tum", &result.warnings);
    result.cameras = ReadPosesIfThere(dir / "cameras.tum", &result.warnings);
    if (std::filesystem::exists(dir / "cameras.csv")) result.images = ReadCameraResults(dir / "cameras.csv");
    result.world_from_odom = WorldFromOdom(result.cameras_odom, result.cameras);
  }
  if (std::filesystem::exists(dir / "views.csv")) result.views = ReadViewResults(dir / "views.csv");
  const auto placed = [](const PanoramaResult& p) { return p.status == "localized" && p.world_from_pano; };
  const auto bare = [&](const PanoramaResult& p) { return placed(p) && !p.sigma_m; };
  if (const auto n = std::count_if(result.panoramas.begin(), result.panoramas.end(), bare); n > 0) {
    result.warnings.push_back(
        fmt::format("panoramas.csv: {} of {} answers have no finite sigma_x_m, sigma_y_m, sigma_z_m: their consistency "
                    "cannot be tested",
                    n, std::count_if(result.panoramas.begin(), result.panoramas.end(), placed)));
  }
  return result;
}

std::optional<Sim3d> WorldFromOdom(const std::vector<TimedPose>& odom, const std::vector<TimedPose>& world) {
  std::map<int64_t, const Rigid3d*> by_stamp;
  for (const TimedPose& pose : world) by_stamp.emplace(pose.stamp_ns, &pose.target_from_body);
  std::vector<std::pair<const Rigid3d*, const Rigid3d*>> pairs;
  for (const TimedPose& pose : odom) {
    if (const auto it = by_stamp.find(pose.stamp_ns); it != by_stamp.end()) {
      pairs.emplace_back(&pose.target_from_body, it->second);
    }
  }
  if (pairs.empty()) return std::nullopt;
  const double n = static_cast<double>(pairs.size());
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d mean_odom = Eigen::Vector3d::Zero(), mean_world = Eigen::Vector3d::Zero();
  for (const auto& [a, b] : pairs) {
    sum += (b->rotation * a->rotation.conjugate()).toRotationMatrix();
    mean_odom += a->translation / n;
    mean_world += b->translation / n;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1.0 : 1.0;
  Sim3d fit;
  fit.rotation = Eigen::Quaterniond(
      Eigen::Matrix3d(svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose()));
  double along = 0, square = 0;
  for (const auto& [a, b] : pairs) {
    along += (fit.rotation * (a->translation - mean_odom)).dot(b->translation - mean_world);
    square += (a->translation - mean_odom).squaredNorm();
  }
  fit.scale = square > 1e-6 && along > 0 ? along / square : 1;
  fit.translation = mean_world - fit.scale * (fit.rotation * mean_odom);
  return fit;
}

}  // namespace trigpoint
