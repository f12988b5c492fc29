// What was estimated for a run, with everything that further estimates need: later stages extend it or read it, and
// every table for people and other programs is written from it.
//
// Frames: `odom` is the run's own, optimised one; its gauge is the first body pose. Poses are rig_from_odom (a body or
// a reference), covariances of their left tangent [rotation (rad), translation (m)].
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/geo/geodetic.h"
#include "datasets/io/site.h"
#include "datasets/solution/reconstruction.h"

namespace trigpoint {

struct SolutionImage {
  int64_t stamp_ns = 0;
  std::string name;
  int camera = 0;  // index into Solution::cameras
  int pose = 0;    // of the body; images of the same instant share one
};

// How a solution came about: numbers of tracks, pairs, loops, by name.
using SolutionCounts = std::vector<std::pair<std::string, double>>;

// A panorama, photo or stitched photo set.
struct SolutionReference {
  std::string name;
  std::string row;  // of panoramas.csv: photos of a set that was not stitched share one
  std::string station;
  std::string status;  // localized, rejected, unmatched
  std::string reason;  // why not localized
  int pose = -1;       // index into Solution::problem.poses; -1: not part of the solution
  // The evidence.
  int view_matches = 0;  // matches before the geometry decided
  int agreeing = 0;      // of these, with the best pose
  int second = 0;        // with the best pose elsewhere
  double support = 0;    // points found where the pose predicts them, beyond what chance would find
  double inlier_ratio = 0;
  double distance_m = 0;  // to the nearest camera
  std::string geotag;     // "ok", "outlier": its part in the georeference; "": none
  Eigen::Vector3d geotag_difference = Eigen::Vector3d::Zero();  // stated - estimated, ENU, m; up: NaN without a height
};

// One of several runs that were adjusted together: which of the solution's cameras, images and body poses are its. Each
// begins where the one before ends.
struct SolutionRun {
  std::string name;
  int first_camera = 0, first_image = 0, first_pose = 0;
  // Of its features and odometry, as below.
  double sigma_px = 0;
  double correlation_inflation = 1;
  Vector6d odometry_noise_factor = Vector6d::Ones();
};

// Where the run's frame lies in the site's ENU.
struct SolutionGeoreference {
  std::string source;  // "geotags", "gps", "geotags and gps", "geotags, tags and control"
  // What it rests on beyond the run's own references and GPS, one name each ("control:57", "tags:run3"): what is no
  // longer independent of the run. Empty unless tags, control or GPS were asked for.
  std::vector<std::string> evidence;
  Geodetic origin;  // of the ENU
  Sim3d world_from_odom;
  // Tangent [rotation (rad, left), translation (m), scale].
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  // Covariance of every pose's odom_from_rig with that tangent, as the poses are part of the fit.
  std::vector<Eigen::Matrix<double, 6, 7>> with_poses;
};

struct Solution : Reconstruction {
  std::string run;
  // Of a site, whose runs were adjusted together: `odom` is the world then, the georeference is the identity without
  // uncertainty, and covariances are those in the world. The problem has a scale for each run. Empty: one run.
  std::vector<SolutionRun> runs;
  std::string mode = "trigpoint";  // trigpoint, paper

  std::vector<BodyCamera> cameras;  // without masks
  std::vector<SolutionImage> images;
  std::vector<int64_t> pose_stamps;  // of the body poses, which are the first of problem.poses

  std::vector<Matrix6d> covariances;  // of problem.poses, at the scale held; empty: not computed
  SolutionCounts counts;

  std::vector<SolutionReference> references;
  std::optional<SolutionGeoreference> georeference;
};

// The part of a site's run `index`, for tables: its cameras and images, all poses with their covariances, no points.
Solution PartOfRun(const Solution& site, size_t index);

inline Rigid3d OdomFromRig(const Solution& s, int pose) { return s.problem.poses[static_cast<size_t>(pose)].Inverse(); }
inline Rigid3d BodyFromCam(const Solution& s, const SolutionImage& image) {
  return s.cameras[static_cast<size_t>(image.camera)].cam_from_body.Inverse();
}
inline Rigid3d OdomFromCam(const Solution& s, const SolutionImage& image) {
  return OdomFromRig(s, image.pose) * BodyFromCam(s, image);
}

}  // namespace trigpoint
