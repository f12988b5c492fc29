// Points and camera poses from tracks and odometry (docs/method.md section 2), and how well they are known.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/estimation/bundle.h"
#include "datasets/solution/reconstruction.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/tracks.h"

namespace trigpoint {

struct ReconstructOptions {
  double sigma_px = 0.6;                    // first guess of the features' noise, px; estimated afterwards
  bool estimate_sigma = true;               // from the residuals (variance factor)
  std::string loss = "dcs";                 // robust kernel of observations: none, huber, cauchy, tukey, dcs
  double loss_chi2 = 3;                     // its threshold, chi-square with 2 dof: tests/benchmarks/loss_efficiency.py
  double outlier_chi2 = 13.8;               // observations beyond it are dropped (2 dof, 0.1 %)
  double min_parallax_deg = 0.5;            // points seen under less are kept out of the bundle
  double max_depth_m = 500;                 // points farther away are kept out of the bundle
  double odometry_rotation_deg = 0.1;       // odometry's noise a step, constant part, 1 sigma per axis
  double odometry_rotation_deg_m = 0.3;     // and its part per metre travelled
  double odometry_translation_m = 0.005;    // translation noise a step, constant part, 1 sigma per axis
  double odometry_translation_part = 0.02;  // and its part of the distance travelled
  bool estimate_odometry = true;            // both scaled by factors estimated from the data
  int rounds = 3;                           // outlier removal and re-triangulation rounds

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.sigma_px, {"sigma_px", "px", 0.01, 20, "first guess of the features' noise, 1 sigma"});
    visit(self.estimate_sigma, {"estimate_sigma", "", 0, 1, "estimate the features' noise from the residuals"});
    visit(self.loss, {"loss", "", 0, 0, "robust kernel of observations: none, huber, cauchy, tukey, dcs"});
    visit(self.loss_chi2, {"loss_chi2", "", 0.1, 1000, "threshold of the kernel: chi-square, 2 degrees of freedom"});
    visit(self.outlier_chi2, {"outlier_chi2", "", 1, 10000, "observations above this chi-square (2 dof) are dropped"});
    visit(self.min_parallax_deg,
          {"min_parallax_deg", "deg", 0, 30, "points with a smaller parallax angle are not used"});
    visit(self.max_depth_m, {"max_depth_m", "m", 1, 1e6, "points farther away are not used"});
    visit(self.odometry_rotation_deg, {"odometry_rotation_deg", "deg", 1e-6, 90, "odometry noise per step, rotation"});
    visit(self.odometry_rotation_deg_m,
          {"odometry_rotation_deg_m", "deg/m", 0, 90, "odometry noise per metre travelled, rotation"});
    visit(self.odometry_translation_m,
          {"odometry_translation_m", "m", 1e-6, 10, "odometry noise per step, translation"});
    visit(self.odometry_translation_part,
          {"odometry_translation_part", "", 0, 1, "odometry noise as a part of the distance, translation"});
    visit(self.estimate_odometry, {"estimate_odometry", "", 0, 1, "scale both noises by factors from the data"});
    visit(self.rounds, {"rounds", "", 1, 20, "rounds of outlier removal"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// Factors between consecutive body poses: odometry with the noise of the options times `noise_factor` (of the body's
// axes, rotation first). Without odometry one more holds the length.
std::vector<PoseFactor> OdometryFactors(const LocalizeInput& input, const ReconstructOptions& options,
                                        const Vector6d& noise_factor);

// What the noise of these adds up to in rotation from the first pose to each, rad^2 per axis.
std::vector<double> RotationVariances(const std::vector<PoseFactor>& odometry, size_t poses);

// Errors of a track's observations are taken to be correlated from image to image by at most kMostCorrelation. A mean's
// standard deviation under first-order autoregressive noise is larger by this factor.
inline constexpr double kMostCorrelation = 0.9;
inline double InflationBy(double correlation) { return std::sqrt((1 + correlation) / (1 - correlation)); }

// Where odometry contradicts images, their noise is widened by at least this: in one good run of forty by chance.
inline constexpr double kLeastWidening = 1.4;
// How many times wider the noise of the images acts than any correlation explains.
inline double WiderThanExplained(const Reconstruction& r) {
  return r.correlation_inflation / InflationBy(kMostCorrelation);
}

// Where a reconstruction starts.
struct ReconstructStart {
  std::vector<Rigid3d> odom_from_body;  // first guess of the poses; the gauge is the first one, held there
  OdometryNoise odometry_noise;         // until it is estimated
  bool near = false;                    // the poses are solved from almost the same observations
};

// Of `tracks` tracks, whose observations are given up: a long run has no room for them twice.
Reconstruction Reconstruct(const LocalizeInput& input, const ReconstructStart& start, int tracks,
                           std::vector<TrackObservation> track_observations, const ReconstructOptions& options,
                           bool paper, int threads, ProgressSink& progress, const CancelToken& cancel);

// A track's observation as the bundle adjustment takes it. Nothing where the camera has no ray for it.
std::optional<BearingObservation> ObservationOf(const LocalizeInput& input, const TrackObservation& t, double sigma_px);

// Observations that are new, put in their places: all stay sorted by point.
struct ImageObservation {
  BearingObservation o;
  int image = 0, feature = 0;
};
void AddObservations(const std::vector<ImageObservation>& added, Reconstruction* reconstruction);

// Points anew with the poses as they are; observations beyond the threshold (chi-square, 2 dof) and points that are
// not fit for the bundle are set aside.
void Settle(const ReconstructOptions& options, double chi2, Reconstruction* reconstruction, int threads,
            const CancelToken& cancel);

// Point of several rays by linear least squares on the rays' normal planes. Nothing if the system is singular.
// view_from_world poses, unit rays in the view.
bool TriangulateRays(const std::vector<Rigid3d>& view_from_world, const std::vector<Eigen::Vector3d>& rays,
                     Eigen::Vector3d* point);

}  // namespace trigpoint
