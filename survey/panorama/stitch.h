// From the photos of a hand-held panorama to their rig: which belong, how they are turned, where each was taken.
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "survey/panorama/photo_set.h"
#include "survey/panorama/rig_bundle.h"

namespace trigpoint {

struct StitchOptions {
  int max_features = 3000;      // features kept a photo, the strongest
  int feature_size_px = 1600;   // longer side at which features are looked for
  double ratio = 0.8;           // ratio test of descriptors
  int all_pairs_up_to = 60;     // photos; above: neighbours in order and retrieval
  double focal_sigma = 0.1;     // 1 sigma of EXIF's focal length, share of it
  bool distortion = true;       // estimate radial distortion k1, k2
  std::string lens = "auto";    // auto, rectilinear, fisheye
  double guided_share = 0.03;   // largest displacement by parallax searched for, share of the longer side
  double radius_m = 0.15;       // circle about the holder on which the photos were taken
  double radius_factor = 2;     // 1 sigma of the radius, as a factor
  double circle_share = 0.25;   // 1 sigma of a photo's place off the circle, share of the radius; 0: no circle
  double min_distance_m = 0.3;  // nearest point believed
  double hold_out = 0;          // share of the verified matches kept apart, to measure with
  std::string level = "auto";   // auto, tags (EXIF), lines (vertical edges), horizon (photos held without roll), none

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_features, {"max_features", "", 100, 50000, "strongest features kept of each photo"});
    visit(self.feature_size_px, {"feature_size_px", "px", 200, 20000, "longer side at which features are looked for"});
    visit(self.ratio, {"ratio", "", 0.3, 1.0, "ratio test: best / second-best descriptor distance"});
    visit(self.all_pairs_up_to,
          {"all_pairs_up_to", "photos", 2, 1000,
           "sets of up to this many photos: all pairs are tried; else pairs by order and similarity"});
    visit(self.focal_sigma, {"focal_sigma", "", 0.0001, 10, "1 sigma of EXIF's focal length, share of it"});
    visit(self.distortion, {"distortion", "", 0, 1, "estimate radial distortion k1, k2"});
    visit(self.lens,
          {"lens", "", 0, 0, "kind of lens: auto (by the picture's shape and by which fits), rectilinear, fisheye"});
    visit(self.guided_share,
          {"guided_share", "", 0.001, 0.2, "largest displacement by parallax, share of the longer side"});
    visit(self.radius_m,
          {"radius_m", "m", 0.001, 5, "radius of the circle about the holder on which the photos were taken"});
    visit(self.radius_factor, {"radius_factor", "", 1, 100, "1 sigma of the radius, as a factor; 1: known exactly"});
    visit(self.circle_share,
          {"circle_share", "", 0, 10, "1 sigma of a photo's place off the circle, share of the radius; 0: no circle"});
    visit(self.min_distance_m, {"min_distance_m", "m", 0.01, 100, "points nearer than this are rejected"});
    visit(self.hold_out,
          {"hold_out", "", 0, 0.9, "share of the verified matches withheld to measure the result's errors"});
    visit(self.level, {"level", "", 0, 0,
                       "how the vertical is found: auto, tags (EXIF), lines (vertical edges), horizon (photos held "
                       "without roll), none"});
  }
  std::vector<std::string> Check() const;
};

// A pair of features in two photos, px.
struct HeldOutMatch {
  int a = 0, b = 0;
  Eigen::Vector2d pixel_a, pixel_b;
};

struct ParallaxBudget {
  double median_px = 0, p95_px = 0, max_px = 0;  // displacement of points against a common centre, px
  double rms_central_px = 0;                     // of all observations, one centre for all photos
  double rms_rig_px = 0;                         // with each photo's own centre
  double spread_m = 0, largest_m = 0;            // rms and largest distance of the photos' centres from their mean
  double median_distance_m = 0;                  // of the points with a distance
  int points_with_distance = 0;                  // known to a third of itself
  Eigen::Vector3d axes_centre =
      Eigen::Vector3d::Zero();  // nearest to all optical axes, from the mean centre, rig frame
};

struct Closure {
  bool full_turn = false;      // the main row goes all the way round
  double sum_deg = 0;          // of the pairs' own turns about the vertical, before any adjustment to each other
  double error_deg = 0;        // sum - 360
  double largest_gap_deg = 0;  // widest part of the horizon that no photo sees
  int photos = 0;              // of the main row
};

struct StitchedRig {
  std::vector<Photo> photos;           // those that were looked at, in order; state.photos as many
  std::vector<std::string> reason;     // why a photo is not placed; empty if it is
  std::vector<LeftOutPhoto> left_out;  // never looked at: damaged, copies, panoramas
  std::vector<PhotoFeatures> features;
  std::vector<PairView> views;   // into features
  RigState state;                // rig frame: x right, y down, z forward at the panorama's centre, levelled
  RigBundleResult bundle;        // with covariance
  std::vector<PhotoPair> pairs;  // verified
  std::vector<HeldOutMatch> held_out;
  int placed = 0;
  int pairs_tried = 0;
  bool focal_from_exif = false;
  double focal_start_px = 0;
  ParallaxBudget parallax;
  Closure closure;
  std::string level_source;  // tags, lines, horizon, none
  // Of roll and of pitch, 1 sigma; none: not levelled, the first photo's top is up.
  std::optional<double> level_sigma_deg;
  std::optional<double> heading_rad;  // of the rig's z axis, clockwise from north
  double heading_sigma_rad = 0;
  std::string heading_source;
  std::vector<std::string> warnings;
};

// `load_grey` gives a photo 8-bit grey with its orientation applied, or throws InputError (the photo is left out and
// named); it is called from several threads. Throws InputError when fewer than two photos hang together, saying why.
StitchedRig StitchPhotos(const PhotoSet& set, const std::function<cv::Mat(const Photo&)>& load_grey,
                         const StitchOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                         const CancelToken& cancel);

// rig_from_cam of a placed photo.
Rigid3d RigFromCam(const RigPhoto& photo);
// The photo's camera: Brown-Conrady with k1, k2, or Kannala-Brandt with k1, k2 for a fisheye; principal point at the
// centre of the picture, or of a fisheye's circle.
Camera CameraOf(const StitchedRig& rig, int photo);

}  // namespace trigpoint
