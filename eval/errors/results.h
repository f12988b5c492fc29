// What `localize` and `survey` found, as plain values: from localize's solution, and from tables (docs/file_formats.md;
// columns that a reader does not know are ignored, so that a newer file still reads).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/geometry/rigid3.h"
#include "datasets/io/trajectory.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

// A row of panoramas.csv: what was estimated for a panorama, photo or photo set.
struct PanoramaResult {
  std::string panorama;
  std::string station;
  std::string status;  // localized, rejected, unmatched
  std::string reason;
  std::optional<Rigid3d> world_from_pano;
  std::optional<Eigen::Vector3d> sigma_m;        // of the world position, per axis of world
  std::optional<Eigen::Matrix3d> covariance_m2;  // of it; unset from tables
  std::optional<Rigid3d> odom_from_pano;         // in the run's own optimised frame
  // Of the odom position, per axis of odom (optional columns odom_sigma_x_m, odom_sigma_y_m, odom_sigma_z_m).
  std::optional<Eigen::Vector3d> odom_sigma_m;
};

// A row of views.csv: one view of a panorama by itself (G1 of the paper).
struct ViewResult {
  std::string panorama;
  std::string view;
  std::string status;
  std::string reason;
  std::optional<Rigid3d> odom_from_view;
  int inliers = 0;
  double distance_m = 0;
};

// A row of tags.csv: map_from_tag, where map is `world` (a tag map) or `odom` (a run's own tags).
struct TagResult {
  int tag_id = -1;
  std::string family;
  double size_m = 0;
  std::optional<Rigid3d> map_from_tag;
  std::optional<Eigen::Vector3d> sigma_m;        // per axis of the map
  std::optional<Eigen::Vector3d> sigma_rot_rad;  // about the tag's own axes
  // Of the left tangent of map_from_tag, rotation first (tags_cov.csv, rows with tag_a = tag_b).
  std::optional<Matrix6d> covariance;
  int images = 0;
  int runs = 0;
  double rms_px = 0;
  std::string role;  // control, check, free
  std::string status;
};

// Covariances between different tags (tags_cov.csv, a < b): rows of tag a.
using TagCovariances = std::map<std::pair<int, int>, Matrix6d>;

// An image's pose in world, as in cameras.csv.
struct CameraResult {
  int64_t stamp_ns = 0;
  std::string image;
  std::string camera;
  std::optional<Rigid3d> world_from_cam;
  std::optional<Eigen::Vector3d> sigma_m;        // east, north, up
  std::optional<Eigen::Matrix3d> covariance_m2;  // unset from tables
};

// What results/localize/<run>[@V] holds.
struct LocalizeResult {
  std::vector<PanoramaResult> panoramas;
  std::vector<ViewResult> views;        // empty without views.csv
  std::vector<TimedPose> cameras_odom;  // odom_from_cam, first camera
  std::vector<TimedPose> cameras;       // world_from_cam, first camera; empty: no global fit
  std::vector<CameraResult> images;     // of all cameras; empty: no global fit
  std::optional<Sim3d> world_from_odom;
  std::vector<std::string> warnings;  // rows that could not be used, one sentence each
};

// Each throws InputError naming file, line, expected and found when a needed column is missing or a value is not a
// number. An empty or NaN number is "not given".
// What a table's comments say: "enu" of "frame" in "trigpoint tags 1; frame=enu; datum=control". Empty if nothing.
std::string CommentValue(const std::vector<std::string>& comments, const std::string& key);
// What a tags.csv says of its frame ("enu", "map"), empty if nothing.
std::string TagMapFrame(const std::filesystem::path& tags_csv);
// `tags_cov_csv` may be empty or missing: then `covariance` stays unset.
std::vector<TagResult> ReadTagResults(const std::filesystem::path& tags_csv,
                                      const std::filesystem::path& tags_cov_csv = {});
TagCovariances ReadTagCovariances(const std::filesystem::path& tags_cov_csv);
// Of a folder: from its solution.db; of an older program's result without one, from its tables. views.csv may be
// missing.
LocalizeResult ReadLocalizeResult(const std::filesystem::path& dir);
// The same with the folder's solution as read before; null: there is none.
LocalizeResult ReadLocalizeResult(const std::filesystem::path& dir, const Solution* solution);

// The similarity between two trajectories of the same stamps: mean rotation (chordal), then scale and place by least
// squares (a scale of 1 if the path has no length). Unset without a common stamp.
std::optional<Sim3d> WorldFromOdom(const std::vector<TimedPose>& odom, const std::vector<TimedPose>& world);

}  // namespace trigpoint
