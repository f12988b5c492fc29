// A survey before it is made: where tags stand, what is known of them, and how the cameras will pass.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/estimation/random.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// A tag in a picture, as it should appear.
struct PlannedSight {
  int pass = 0, frame = 0, camera = 0;  // index into passes, world_from_body, cameras
  int tag_id = -1;
  double side_px = 0, angle_deg = 0, blur_px = 0;
  TagDetection detection;  // exact corners with their sigma
};

// One run past the site.
struct PlannedPass {
  std::string name;
  std::string date;  // passes of one date are one session
  std::vector<BodyCamera> cameras;
  std::vector<TimedPose> world_from_body;  // of every picture, ascending time
  double scale_sigma = 0.01;               // of odometry's scale
  // Factors on the options' sigmas, as an earlier survey found them (RunAgreement): corners; odometry's rotation and
  // translation, body axes.
  double corner_factor = 1;
  Vector6d odometry_factor = Vector6d::Ones();
  // What its pictures showed, if they are taken: sigmas as they are, `pass` means nothing. Else geometry says it.
  std::optional<std::vector<PlannedSight>> seen;
};

// A panorama or photo of known place that `localize` will look for in the pictures of a pass; 1 sigma, world axes.
struct PlannedPanorama {
  std::string name;  // its station
  Rigid3d world_from_pano;
  double sigma_h_m = 1, sigma_v_m = 2, sigma_heading_rad = 2 * kDegToRad, sigma_tilt_rad = kDegToRad;  // of its geotag
};

struct NetworkLayout {
  TagSizes sizes;
  std::map<int, Rigid3d> world_from_tag;
  std::vector<PlannedPass> passes;
  std::vector<SurveyPoint> points;  // on tags: control, check, geotags of stations; world_m is where they are
  std::vector<SurveyDistance> distances;
  std::vector<PlannedPanorama> panoramas;
};

struct NetworkOptions {
  // What is seen of a tag.
  double min_side_px = 12;        // shortest side of its picture
  double max_angle_deg = 72;      // between its normal and the line of sight
  double max_blur_px = 4;         // motion during the exposure beyond which it is not decoded
  double exposure_ms = 3;         // exposure of a picture
  double detected = 0.9;          // share of the pictures in which a tag is found that should be
  double corner_sigma_px = 0.05;  // 1 sigma of a corner per axis, of a tag of 100 px in a sharp picture
  double extra_sigma_px = 0.05;   // added in quadrature, as in the survey
  // How the cameras move.
  double odometry_rot_deg = 0.3;      // 1 sigma per square root of a metre
  double odometry_m = 0.02;           // the same for position
  double heading_drift_deg_m = 0.05;  // 1 sigma of a constant drift of the heading
  // Scene points that pictures share.
  int ties_per_image = 150;  // 0: none, tags and odometry alone
  double tie_sigma_px = 1;   // 1 sigma of such a point per axis, what is common to a track included
  double tie_near_m = 3;     // distances of these points
  double tie_far_m = 30;
  double tie_length = 8;  // pictures in a row that see one, mean
  // Of these points, what a panorama shows.
  int panorama_points = 100;         // at most
  double panorama_sigma_deg = 0.08;  // 1 sigma of one in a panorama, per axis
  // With which of them `localize` can match a panorama: it searches for points that one of the pictures shows from much
  // the same direction and distance, as descriptors stand no larger change.
  double match_angle_deg = 40;  // between the directions in which picture and panorama see the point
  double match_ratio = 2.5;     // of their distances from it
  double match_reach_m = 30;    // of the picture from the panorama
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.min_side_px, {"min_side_px", "px", 1.0, 1000.0, "shortest side, in the picture, of a tag that is used"});
    visit(self.max_angle_deg,
          {"max_angle_deg", "deg", 1.0, 89.0, "largest angle between a tag's normal and the line of sight"});
    visit(self.max_blur_px, {"max_blur_px", "px", 0.1, 100.0, "motion blur beyond which a tag is not decoded"});
    visit(self.exposure_ms, {"exposure_ms", "ms", 0.0, 1000.0, "exposure of a picture"});
    visit(self.detected, {"detected", "", 0.01, 1.0, "share of the pictures in which a visible tag is found"});
    visit(self.corner_sigma_px,
          {"corner_sigma_px", "px", 0.001, 10.0, "1 sigma of a corner of a sharp tag of 100 px, per axis"});
    visit(self.extra_sigma_px, {"extra_sigma_px", "px", 0.0, 10.0, "added to each corner's sigma in quadrature"});
    visit(self.odometry_rot_deg,
          {"odometry_rot_deg", "deg", 1e-4, 90.0, "1 sigma of odometry's rotation per square root of a metre"});
    visit(self.odometry_m,
          {"odometry_m", "m", 1e-5, 10.0, "1 sigma of odometry's position per square root of a metre"});
    visit(self.heading_drift_deg_m, {"heading_drift_deg_m", "deg/m", 0.0, 10.0, "1 sigma of odometry's heading drift"});
    visit(self.ties_per_image, {"ties_per_image", "", 0, 2000, "scene points seen in a picture; 0: none"});
    visit(self.tie_sigma_px, {"tie_sigma_px", "px", 0.01, 100.0, "1 sigma of a scene point in a picture, per axis"});
    visit(self.tie_near_m, {"tie_near_m", "m", 0.1, 1000.0, "distance of the nearest scene points"});
    visit(self.tie_far_m, {"tie_far_m", "m", 0.2, 10000.0, "distance of the farthest scene points"});
    visit(self.tie_length, {"tie_length", "", 2.0, 1000.0, "pictures in a row that see a scene point, mean"});
    visit(self.panorama_points,
          {"panorama_points", "", 10, 10000, "most scene points that a panorama shares with a pass"});
    visit(self.panorama_sigma_deg,
          {"panorama_sigma_deg", "deg", 0.001, 10.0, "1 sigma of a scene point in a panorama, per axis"});
    visit(self.match_angle_deg, {"match_angle_deg", "deg", 1.0, 180.0,
                                 "largest angle between the directions in which picture and panorama see a match"});
    visit(self.match_ratio,
          {"match_ratio", "", 1.0, 1000.0, "largest ratio of the distances of picture and panorama from a match"});
    visit(self.match_reach_m,
          {"match_reach_m", "m", 0.1, 10000.0, "largest distance of a picture from a panorama that it matches"});
  }
  std::vector<std::string> Check() const;
};

// A scene point in a picture.
struct PlannedTie {
  int point = 0, frame = 0, camera = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};
struct PassTies {
  std::vector<Eigen::Vector3d> points;  // world
  std::vector<PlannedTie> ties;         // sorted by point
};

// What each picture shows, from geometry alone: nothing hides anything. `seed` draws which visible tags are missed and
// where scene points are, by names of passes and ids of tags: what is added changes no draw of what is there.
std::vector<PlannedSight> PlanSights(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed);
// Why no picture shows a tag of which PlanSights gives none: what keeps it from the picture that comes nearest to
// showing it. Empty where what pictures showed is given.
std::string WhyUnseen(const NetworkLayout& layout, const NetworkOptions& options, int tag_id);
PassTies PlanTies(const PlannedPass& pass, const NetworkOptions& options, uint64_t seed);

// What a survey would be given: the observations of a layout, exact, or with noise of the stated sigmas if `noise`.
// world_m of points is noisy, too; tags, poses and scene points are where the layout has them.
SurveyInput SimulateSurvey(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed, Random* noise);
// The survey's options that believe these sigmas.
SurveyOptions OptionsOfSurvey(const NetworkOptions& options);

}  // namespace trigpoint
