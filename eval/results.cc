#include "eval/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"

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

}  // namespace

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
                       .odom_sigma_m = GivenVector(row, "odom_sigma_", "_m"),
                       .inliers = Count(row, "inliers"),
                       .views = Count(row, "views")});
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

LocalizeResult ReadLocalizeResult(const std::filesystem::path& dir) {
  LocalizeResult result;
  result.panoramas = ReadPanoramaResults(dir / "panoramas.csv");
  const auto placed = [](const PanoramaResult& p) { return p.status == "localized" && p.world_from_pano; };
  const auto bare = [&](const PanoramaResult& p) { return placed(p) && !p.sigma_m; };
  if (const auto n = std::count_if(result.panoramas.begin(), result.panoramas.end(), bare); n > 0) {
    result.warnings.push_back(fmt::format(
        "panoramas.csv: {} of {} answers have no finite sigma_x_m, sigma_y_m, sigma_z_m: nothing can be said "
        "of their consistency",
        n, std::count_if(result.panoramas.begin(), result.panoramas.end(), placed)));
  }
  if (std::filesystem::exists(dir / "views.csv")) result.views = ReadViewResults(dir / "views.csv");
  result.cameras_odom = ReadPosesIfThere(dir / "cameras_odom.tum", &result.warnings);
  result.cameras = ReadPosesIfThere(dir / "cameras.tum", &result.warnings);
  return result;
}

}  // namespace trigpoint
