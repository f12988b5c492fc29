// Two solutions of the same cameras held against each other: ours, with its covariance, and somebody else's.
//
// The other's frame is brought to ours by a least-squares fit (Umeyama 1991) or not at all. What remains, r = d - A x,
// is judged by our own covariance of the same quantity: with P the projector onto what the fit leaves free
// (P = I - A (A'A)^-1 A', A the derivative of the fit at our positions; an S-transformation, Baarda 1973),
// Cov(r) = P C P'. A normalised difference is sqrt(r' Cov(r)^-1 r / 3) of one camera: about 1 where the two differ as
// much as we say we may be wrong, far more where they disagree. The other solution's own errors are not in it: it rests
// on the same pictures.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

enum class CrossAlignment { kNone, kSE3, kSim3 };
std::string_view CrossAlignmentName(CrossAlignment alignment);  // none, se3, sim3

struct CrossPair {
  std::string name;
  Rigid3d ours;    // frame_from_cam
  Rigid3d theirs;  // frame_from_cam, their frame
  // Of our position, in our frame, m^2; for points outside the joint covariance (panoramas).
  std::optional<Eigen::Matrix3d> covariance;
};

struct CrossDifference {
  std::string name;
  Eigen::Vector3d difference_m = Eigen::Vector3d::Zero();  // theirs (aligned) minus ours, our frame
  double rotation_deg = 0;
  std::optional<double> normalised;  // see above
};

struct CrossStatistics {
  int count = 0;
  double rmse_m = 0, median_m = 0, max_m = 0;
  double rotation_median_deg = 0, rotation_max_deg = 0;
  std::optional<double> normalised_median, normalised_p95;
  // Their verdict: do the two differ by more than our covariance explains? Share of normalised differences beyond the
  // 99 % value of chi-square (3 degrees of freedom).
  std::optional<double> beyond_99;
};

struct CrossComparison {
  CrossAlignment alignment = CrossAlignment::kNone;
  Sim3d ours_from_theirs;
  std::vector<CrossDifference> differences;  // as the pairs
  CrossStatistics statistics;
};

// `covariance`: of our positions, 3n x 3n in the order of the pairs, in our frame, relative to a fixed gauge; empty:
// none. Throws NumericError when the alignment isn't determined (fewer than three cameras, all in one place).
CrossComparison CompareCameras(const std::vector<CrossPair>& pairs, const Eigen::MatrixXd& covariance,
                               CrossAlignment alignment);

// The same transform applied to others (panoramas, points): no fit of their own, normalised by each one's covariance.
CrossComparison ComparePlaces(const std::vector<CrossPair>& pairs, const Sim3d& ours_from_theirs,
                              CrossAlignment alignment);

// A panorama in both solutions.
struct CrossPanorama {
  std::string name;
  std::optional<Eigen::Vector3d> ours;        // our answer's centre, our frame, m; unset: refused or unmatched
  std::optional<Eigen::Matrix3d> covariance;  // of it, m^2
  std::optional<Eigen::Vector3d> theirs;      // their frame; unset: they did not find it
  int views = 0, points = 0;                  // of it, that they registered and saw
  bool changed = false;                       // our answer is not what was computed: its table was edited
};

// What a cross-check tells of one panorama.
enum class CrossVerdict {
  kAgrees,
  kContradicts,  // both answer, farther apart than both errors explain: one of the two is wrong
  kOnlyTheirs,   // we refuse where they have an answer
  kOnlyOurs,     // nothing said against or for our answer
  kNeither,
  kWeak,    // theirs rests on one view and few points, and does not agree with ours: not judged
  kChanged  // our answer was changed after it was computed, by too little for them to contradict it
};
std::string_view CrossVerdictName(CrossVerdict verdict);

struct PanoramaJudgement {
  std::string name;
  CrossVerdict verdict = CrossVerdict::kNeither;
  int views = 0, points = 0;
  std::optional<Eigen::Vector3d> theirs;        // in our frame
  std::optional<Eigen::Vector3d> difference_m;  // theirs minus ours
  std::optional<double> chi2;                   // of it, 3 degrees of freedom; beyond 16.27 (99.9 %) it contradicts
};

// 1 sigma per axis of their panoramas is taken from the median of the normalised differences of those that both have
// (three or more), so that single wrong answers do not widen it, and is at least `camera_sigma_m`, that of their
// cameras.
std::vector<PanoramaJudgement> JudgePanoramas(const std::vector<CrossPanorama>& panoramas,
                                              const Sim3d& ours_from_theirs, double camera_sigma_m);

}  // namespace trigpoint
