// Georeferencing of the run's frame (docs/method.md section 5): rotation, translation, odometry's scale from geotags.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct GeoRegistrationOptions {
  std::string use_gps = "auto";   // GPS: never, always, or auto (only without geotagged references)
  double outlier_chi2 = 11.3;     // a geotag beyond it (3 dof, 1 %) is marked as an outlier
  double loss_chi2 = 4.1;         // knee of the robust kernel, chi-square with 3 dof (75 %)
  double tilt_sigma_deg = 10;     // how level an undeclared odometry frame is, 1 sigma
  double gps_correlation_s = 30;  // GPS errors wander: fixes closer than this count once
  double gps_clock_doubt = 0.1;   // share of recordings whose GPS clock is wrong by up to 20 s; 0: synchronised
  int iterations = 50;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.use_gps, {"use_gps", "", 0, 0, "GPS: never, always, auto (only without geotagged references)"});
    visit(self.outlier_chi2, {"outlier_chi2", "", 1, 10000, "a geotag above this chi-square (3 dof) is an outlier"});
    visit(self.loss_chi2, {"loss_chi2", "", 0.1, 10000, "scale of the robust kernel: chi-square, 3 dof"});
    visit(self.tilt_sigma_deg,
          {"tilt_sigma_deg", "deg", 0.001, 90, "tilt of an odometry frame that is not declared level, 1 sigma"});
    visit(self.gps_correlation_s, {"gps_correlation_s", "s", 0, 3600, "GPS fixes within this time count as one"});
    visit(self.gps_clock_doubt, {"gps_clock_doubt", "", 0, 1,
                                 "probability that the clock of GPS is off by up to 20 s; 0: it is synchronised"});
    visit(self.iterations, {"iterations", "", 1, 1000, "iterations at most"});
  }
  std::vector<std::string> Check() const;
};

// A place in the run's frame with what is said about it in the world.
struct GeoObservation {
  Rigid3d odom_from_rig;     // rotation is used only with has_attitude parts
  Eigen::Vector3d position;  // said, world (ENU), m; without a height z is what is assumed
  bool has_position = true;
  bool has_height = true;
  bool has_heading = false;
  bool has_tilt = false;
  Attitude attitude;  // said, of the rig's optical axis
  double sigma_h_m = 1, sigma_v_m = 1, sigma_heading_rad = 1, sigma_tilt_rad = 1;
  double sigma_sea_m = 0;  // beside sigma_v_m: of the one error that all such heights share
  std::string source;      // service that it is from; empty: none, and its sigmas are the user's statement
};

// What the run shows of the positions of one source.
struct SourceEstimate {
  std::string source;
  int positions = 0, outliers = 0;
  double stated_sigma_m = 0;  // per horizontal axis; the median
  double sigma_m = 0;         // as estimated; 0: there are too few
  double relative_sigma = 0;  // 1 sigma of that estimate, a share of it
};

struct GeoRegistration {
  bool solved = false;
  std::string reason;     // when not solved; else what is to be known about it, or nothing
  Sim3d world_from_odom;  // scale: true length / length in the run's frame
  // Tangent [rotation (rad, left), translation (m), scale], 7 x 7.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  // d estimate / d (errors of the places in the run's frame), 7 x 6n: for covariances of things in the run's frame.
  Eigen::MatrixXd sensitivity;
  std::vector<double> weights;             // of each observation's position, 0 to 1
  std::vector<bool> outlier;               // position beyond the gate
  int tilts = 0, wrong_tilts = 0;          // used pitches and rolls; of these beyond the gate
  double tilt_factor = 1;                  // by which their sigmas are too small, by their scatter
  std::vector<Eigen::Vector3d> residuals;  // said - estimated, world, m
  std::vector<SourceEstimate> sources;     // of observations that have one, by name
  int iterations = 0;
};

// Robust generalised least squares. `odom_covariance` (6n x 6n): of the places' odom_from_rig (left tangent, odom
// axes), jointly. Gauge: none left where attitudes or three places that are not on a line are given; else the tilt and
// scale priors. scale prior: 1 +- scale_sigma relative to `odometry_scale` already applied in the run's frame. Where
// nothing says a height, the mean of the assumed ones stands in, +- kUnknownHeightSigma.
GeoRegistration RegisterToEarth(const std::vector<GeoObservation>& observations, const Eigen::MatrixXd& odom_covariance,
                                double scale_prior, double scale_sigma, bool levelled,
                                const GeoRegistrationOptions& options);

// The same, where positions of sources with at least 10 of them get the sigma that their residuals show in place of the
// stated one (in `observations`): the median of the horizontal residuals, whose chi-square has two degrees of freedom,
// corrected for the freedom of the fit. Those that are wrong take no part in a median.
GeoRegistration RegisterBySources(std::vector<GeoObservation>* observations, const Eigen::MatrixXd& odom_covariance,
                                  double scale_prior, double scale_sigma, bool levelled,
                                  const GeoRegistrationOptions& options);

// Which other way the headings of geotags seem to count, in words, where the places alone show that they do not count
// clockwise from north; nothing if they do, or if fewer than four places far enough apart say where the run lies.
std::optional<std::string> OtherHeadings(const std::vector<GeoObservation>& observations);

}  // namespace trigpoint
