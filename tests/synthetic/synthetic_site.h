// Sites without pixels: a drive past facades with everything a localizer's back end takes, and the truth beside it.
//
// Truth and observations are separate, and every error is drawn from a stated normal distribution, so that normalised
// errors can be tested: MakeSyntheticSite draws the geometry once, RedrawNoise draws new observations of it.
//
// The noise, factor by factor (all independent unless said otherwise; sigmas are 1 sigma):
// - image observation: pixel = projection + N(0, pixel_sigma_px^2 I2). Correspondences are right, except for a share
//   `outlier_fraction` whose pixel is uniform over the image.
// - panorama observation: the same in the view's pixels with view_pixel_sigma_px; a share `alias_fraction` of those on
//   facades is of the same spot one repetition (alias_shift_m) along the facade, as repeated windows give.
// - odometry, per step k -> k+1: M = b_k_from_b_k+1 (b: body). With s ~ N(0, odometry_scale_sigma^2), one draw a site,
//   and delta ~ N(0, diag(sigma^2)):
//     M_observed = Rigid3d(R, (1 + s) t).Plus(delta),
//   sigma = OdometrySigma(options, |t|): for each rotation axis odometry_rotation_sigma_rad +
//   odometry_rotation_sigma_per_m * |t|, for each translation axis likewise. Then, only if odometry_heading_drift_per_m
//   is not zero, a turn of Normal(one draw a site) * odometry_heading_drift_per_m * |t| about the body's z is put on
//   M's right: an error that no per-step covariance describes. The chain starts with the identity: the odometry's frame
//   is the first body pose, tilt included, so that world_from_odom = world_from_body[0].
// - geotag: position ENU + N(0, diag(h^2, h^2, v^2)), heading, pitch and roll + N(0, their sigma^2) each, on the angles
//   themselves. Of `geotag_outliers` panoramas (which ones is drawn anew) the position is geotag_outlier_m off besides,
//   in a random horizontal direction, with sigmas that do not say so.
// - GPS: antenna position ENU + N(0, diag(h^2, h^2, v^2)), white.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/camera/rig.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/site.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

struct SyntheticOptions {
  std::string path = "loop";  // loop: round a lot with facades on four sides; street: facades on both sides
  double length_m = 120;      // of the drive
  double step_m = 0.5;        // between images
  double step_s = 0.5;
  double tilt_deg = 1.5;  // amplitude of the body's smooth pitch and roll

  int points_per_image = 120;   // tracks kept alive
  double track_survival = 0.9;  // chance that a track is matched into the next image
  int min_track_length = 3;     // shorter ones are dropped
  double min_depth_m = 3;
  double max_depth_m = 60;
  double pixel_sigma_px = 0.7;
  double outlier_fraction = 0;

  double odometry_rotation_sigma_rad = 1e-3;
  double odometry_rotation_sigma_per_m = 1e-3;
  double odometry_translation_sigma_m = 5e-3;
  double odometry_translation_sigma_per_m = 5e-3;
  double odometry_scale_sigma = 0.01;
  double odometry_heading_drift_per_m = 0;  // rad/m

  int panoramas = 9;
  double panorama_offset_m = 4;  // from the path, to both sides in turn ...
  bool panoramas_left = false;   // ... or all to its left
  int views = 8;                 // 90 deg each, spread evenly over the circle
  int view_size_px = 1024;
  int points_per_view = 40;  // at most
  double view_pixel_sigma_px = 1.0;
  double match_angle_deg = 35;  // a point is matched if an image saw it from a direction within this ...
  double match_ratio = 2;       // ... and from a distance that differs by no more than this factor
  double alias_fraction = 0;
  double alias_shift_m = 3;

  double geotag_sigma_h_m = 0.3;
  double geotag_sigma_v_m = 0.5;
  double geotag_sigma_heading_deg = 1.0;
  double geotag_sigma_tilt_deg = 0.3;
  int geotag_outliers = 0;
  double geotag_outlier_m = 7;

  double gps_interval_s = 1;
  double gps_sigma_h_m = 3;
  double gps_sigma_v_m = 5;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.path, {"path", "", 0, 0, "loop or street"});
    visit(self.length_m, {"length_m", "m", 1, 1e5, "length of the drive"});
    visit(self.step_m, {"step_m", "m", 0.01, 100, "distance between images"});
    visit(self.step_s, {"step_s", "s", 0.001, 100, "time between images"});
    visit(self.tilt_deg, {"tilt_deg", "deg", 0, 30, "amplitude of the body's pitch and roll"});
    visit(self.points_per_image, {"points_per_image", "", 1, 1e5, "tracks kept alive"});
    visit(self.track_survival, {"track_survival", "", 0, 1, "chance of a match into the next image"});
    visit(self.min_track_length, {"min_track_length", "", 2, 1000, "shorter tracks are dropped"});
    visit(self.min_depth_m, {"min_depth_m", "m", 0.1, 1e4, "nearest point"});
    visit(self.max_depth_m, {"max_depth_m", "m", 0.1, 1e4, "farthest point"});
    visit(self.pixel_sigma_px, {"pixel_sigma_px", "px", 0, 100, "noise of an image observation"});
    visit(self.outlier_fraction, {"outlier_fraction", "", 0, 1, "wrong image observations"});
    visit(self.odometry_rotation_sigma_rad, {"odometry_rotation_sigma_rad", "rad", 0, 1, "per step"});
    visit(self.odometry_rotation_sigma_per_m, {"odometry_rotation_sigma_per_m", "rad/m", 0, 1, "per metre"});
    visit(self.odometry_translation_sigma_m, {"odometry_translation_sigma_m", "m", 0, 10, "per step"});
    visit(self.odometry_translation_sigma_per_m, {"odometry_translation_sigma_per_m", "", 0, 1, "per metre"});
    visit(self.odometry_scale_sigma, {"odometry_scale_sigma", "", 0, 0.3, "of the scale, one draw a site"});
    visit(self.odometry_heading_drift_per_m, {"odometry_heading_drift_per_m", "rad/m", 0, 1, "unmodelled drift"});
    visit(self.panoramas, {"panoramas", "", 0, 1e4, "number of panoramas"});
    visit(self.panorama_offset_m, {"panorama_offset_m", "m", 0, 100, "distance from the path"});
    visit(self.panoramas_left, {"panoramas_left", "", 0, 1, "all panoramas to the left of the path"});
    visit(self.views, {"views", "", 1, 64, "views of a panorama"});
    visit(self.view_size_px, {"view_size_px", "px", 64, 8192, "edge of a view"});
    visit(self.points_per_view, {"points_per_view", "", 0, 1e5, "matches of a view at most"});
    visit(self.view_pixel_sigma_px, {"view_pixel_sigma_px", "px", 0, 100, "noise of a view's observation"});
    visit(self.match_angle_deg, {"match_angle_deg", "deg", 0, 180, "largest angle between matched views of a point"});
    visit(self.match_ratio, {"match_ratio", "", 1, 100, "largest ratio of distances of matched views"});
    visit(self.alias_fraction, {"alias_fraction", "", 0, 1, "panorama matches one facade repetition off"});
    visit(self.alias_shift_m, {"alias_shift_m", "m", -100, 100, "length of that repetition"});
    visit(self.geotag_sigma_h_m, {"geotag_sigma_h_m", "m", 0, 1e3, "per horizontal axis"});
    visit(self.geotag_sigma_v_m, {"geotag_sigma_v_m", "m", 0, 1e3, "height"});
    visit(self.geotag_sigma_heading_deg, {"geotag_sigma_heading_deg", "deg", 0, 180, "heading"});
    visit(self.geotag_sigma_tilt_deg, {"geotag_sigma_tilt_deg", "deg", 0, 90, "pitch and roll"});
    visit(self.geotag_outliers, {"geotag_outliers", "", 0, 1e4, "panoramas with a wrong position"});
    visit(self.geotag_outlier_m, {"geotag_outlier_m", "m", 0, 1e6, "how wrong"});
    visit(self.gps_interval_s, {"gps_interval_s", "s", 0.01, 1e4, "time between fixes"});
    visit(self.gps_sigma_h_m, {"gps_sigma_h_m", "m", 0, 1e3, "per horizontal axis"});
    visit(self.gps_sigma_v_m, {"gps_sigma_v_m", "m", 0, 1e3, "height"});
  }
  std::vector<std::string> Check() const;
};

struct SyntheticObservation {
  int point = 0;                                    // index into SyntheticTruth::points
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // centre of the first pixel is (0, 0)
};

struct SyntheticImage {
  int camera = 0;  // index into SyntheticSite::cameras
  int step = 0;    // index into SyntheticTruth::world_from_body
  int64_t stamp_ns = 0;
  std::vector<SyntheticObservation> observations;  // ascending point
};

struct SyntheticViewObservation {
  int view = 0;  // index into SyntheticPanorama::rig.views
  int point = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // in the view
};

struct SyntheticPanorama {
  std::string name;
  ViewRig rig;  // rig frame = pano: camera axes at the image centre; view i looks 360 i / n deg to the right of it
  std::vector<SyntheticViewObservation> observations;
  GeoTag geotag;
};

// An upright wall on the ground, faced by who stands to the left of a -> b.
struct SyntheticWall {
  Eigen::Vector3d a, b;
  double height = 0;
};

// A point is one track: a spot of the scene that is lost and found again counts as a new point, as tracks do.
struct SyntheticTruth {
  std::vector<Rigid3d> world_from_body;  // one a step; world: ENU about SyntheticSite::frame
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> along;  // per point: unit vector along its facade, zero where there is none
  std::vector<Rigid3d> world_from_pano;
  std::vector<SyntheticWall> walls;
  double odometry_scale = 1;               // 1 + s: odometry's length of a true metre
  std::vector<bool> geotag_is_outlier;     // per panorama
  std::vector<std::vector<bool>> wrong;    // per image, per observation: an outlier
  std::vector<std::vector<bool>> aliased;  // per panorama, per observation
};

struct SyntheticSite {
  SyntheticOptions options;
  LocalFrame frame;
  std::vector<BodyCamera> cameras;
  std::vector<SyntheticImage> images;  // ascending time, then camera
  Trajectory odometry;                 // odom_from_body, one pose a step
  std::vector<SyntheticPanorama> panoramas;
  std::vector<GpsFix> gps;  // antenna at the body's origin
  SyntheticTruth truth;

  Rigid3d WorldFromCam(const SyntheticImage& image) const {
    return truth.world_from_body[image.step] * cameras[image.camera].cam_from_body.Inverse();
  }
};

// A pinhole without distortion, 960 x 600 px, 100 deg, 1.1 m above the body's origin, turned to the left by `yaw_rad`.
BodyCamera SyntheticCamera(const std::string& name, double yaw_rad);

// Sigmas [rotation (rad), translation (m)] of the odometry's step of `length_m`, per axis.
Vector6d OdometrySigma(const SyntheticOptions& options, double length_m);

// Geometry from `seed`, noise from RedrawNoise(seed). `cameras` empty: SyntheticCamera at 45 deg. Same arguments, same
// site on every platform. Throws OptionError with every violation of the options.
SyntheticSite MakeSyntheticSite(const SyntheticOptions& options, uint64_t seed, std::vector<BodyCamera> cameras = {});

// The same geometry, which image sees which point included, with every noise drawn anew.
SyntheticSite RedrawNoise(const SyntheticSite& site, uint64_t seed);

// Height of the site's ground, a slightly sloping plane, m.
double SyntheticGroundHeight(double x, double y);

// n views of `fov_rad` with `size_px` edge, evenly spread clockwise (seen from above) from the panorama's centre.
ViewRig EvenViewRig(const std::string& name, int n, int size_px, double fov_rad);

}  // namespace trigpoint
