// The accuracy that a survey would state, before it is made.
//
// The normal equations of the tag map (calib/estimation/sparse_least_squares.h, survey_costs.h) are built at the
// planned places with the observations that the layout gives, and inverted: covariance of every tag and body,
// redundancy and smallest detectable blunder of every observation (Baarda, "A testing procedure for use in geodetic
// networks", 1968).
#pragma once

#include "survey/network/layout.h"

namespace trigpoint {

struct TagPrediction {
  int tag_id = -1;
  Eigen::Vector3d world_m = Eigen::Vector3d::Zero();
  Matrix6d covariance = Matrix6d::Zero();  // left tangent, world axes, rotation first
  int images = 0, passes = 0;
  std::string role = "free";  // control, check, free
  bool tied = false;          // to the rest of the map; else there is no covariance
  Eigen::Vector3d Sigma() const { return covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt(); }
};

struct BodyPrediction {
  int pass = 0;
  int64_t stamp_ns = 0;
  Rigid3d world_from_body;
  Matrix6d covariance = Matrix6d::Zero();
  int tags = 0;  // seen by its pictures
};

// Of one observation: redundancy is the part of its variance that the residual keeps (0: nothing controls it, 1: all).
// `blunder`: the error that a test at 0.1 % finds with 80 % probability, in the observation's unit; infinite where
// nothing controls it. `effect_m`: how far an error of that size moves the tag or point it concerns.
struct Reliability {
  double redundancy = 0, blunder = 0, effect_m = 0;
};
struct SightPrediction {
  int pass = 0;
  int64_t stamp_ns = 0;
  int camera = 0, tag_id = -1;
  double side_px = 0, angle_deg = 0, sigma_px = 0;
  Reliability worst;  // of its eight coordinates; px
};
struct PointPrediction {
  std::string name;
  int tag_id = -1;
  PointRole role = PointRole::kControl;
  bool used = false;
  Reliability horizontal, vertical;  // m
};
struct DistancePrediction {
  SurveyDistance distance;
  Reliability reliability;  // m
};

struct NetworkPrediction {
  std::string datum, gauge;
  bool in_world = false;
  std::vector<TagPrediction> tags;  // ascending id; all of the layout
  std::vector<BodyPrediction> bodies;
  std::vector<SightPrediction> sights;
  std::vector<PointPrediction> points;
  std::vector<DistancePrediction> distances;
  // Joint covariance of the positions of the tags that are tied, in the order of `tags`: three rows each, m^2.
  Eigen::MatrixXd joint;
  std::vector<std::string> left_out;  // passes that share no tag with the others: nothing is predicted of them
  std::map<int, std::string> apart;   // tags that only such passes see, with the name of one
  std::vector<std::string> warnings;
  // Root mean square over tied tags of the 3D position sigma; infinite without one.
  double RmsSigma() const;
  // The same over the tags that `before` has tied, so that more tags are not counted as better or worse by themselves.
  // Infinite where one of them, or the datum in the world, is lost.
  double RmsSigmaOf(const NetworkPrediction& before) const;
};

// Throws InputError where nothing can be predicted (no pass sees a tag), OptionError, NumericError, Cancelled.
NetworkPrediction PredictNetwork(const NetworkLayout& layout, const NetworkOptions& options, uint64_t seed, int threads,
                                 const CancelToken& cancel);

// A panorama as `localize` would state it.
struct PanoramaPrediction {
  int pass = 0;
  std::string name;
  int points = 0;                          // scene points that it shares with the pass, and its covariance rests on
  int matches = 0;                         // all scene points of the pass with which it can be matched
  Matrix6d covariance = Matrix6d::Zero();  // left tangent, world axes, rotation first
  Eigen::Vector3d Sigma() const { return covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt(); }
};

// Matches that `localize` needs for an answer. They must agree on a pose, which changed light, moved cars and repeated
// structure prevent: this is not predicted.
inline constexpr int kMatchesNeeded = 20;

// What `localize` would state of the layout's panoramas if it finds them, from each pass by itself and without tags:
// odometry and scene points, held to the world by the panoramas' geotags. Panoramas that share too few scene points
// with a pass are left out. Throws as PredictNetwork does.
std::vector<PanoramaPrediction> PredictPanoramas(const NetworkLayout& layout, const NetworkOptions& options,
                                                 uint64_t seed, int threads, const CancelToken& cancel);

// What more known points would gain. Each candidate is the centre of a tag whose place gets the given sigmas.
struct ControlSuggestion {
  std::vector<int> tag_ids;  // best first
  // RMS sigma of the tags in the world; infinite where no datum holds it.
  double rms_before_m = 0, rms_after_m = 0;
  std::vector<double> rms_steps_m;           // after each
  double bound_m = 0;                        // no choice of so many can be below this
  bool exact = false;                        // every choice was tried; else the best one after the other
  std::vector<std::pair<int, double>> each;  // tags that could be control, RMS with each alone
  size_t needed = 0;                         // fewest more points with which a datum is reached; 0 where there is one
  bool reachable = true;                     // some choice of candidates reaches a datum
};

// `free`: prediction of the layout without its known points, so that its joint covariance is relative to a camera.
// `known`: the layout's points; tags with control or check points are no candidates. The world's position and attitude
// g are unknown without prior: positions are x = e + T g with cov(e) = free.joint and T of a rigid motion, observed
// with variances V at the points, A x. By generalised least squares, with M = A C A' + V, H = A T, K = T - C A' M^-1 H:
//   cov(x) = C - C A' M^-1 A C + K (H' M^-1 H)^-1 K'
// (universal kriging: Cressie, "Statistics for Spatial Data", 1993, eq. 3.4.5). Offsets of known points from their
// tags' centres are taken as exact. With fewer than `needed` asked for, tag_ids is the smallest set that reaches a
// datum; where none does it is empty.
ControlSuggestion SuggestControl(const NetworkPrediction& free, const std::vector<SurveyPoint>& known, int count,
                                 double sigma_h_m, double sigma_v_m);

}  // namespace trigpoint
