#include "eval/errors/crosscheck.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

constexpr double kChi2Of3At99 = 11.345;

CrossStatistics StatisticsOf(const std::vector<CrossDifference>& differences) {
  CrossStatistics s;
  s.count = static_cast<int>(differences.size());
  std::vector<double> lengths, angles, normalised;
  double sum = 0;
  for (const CrossDifference& d : differences) {
    lengths.push_back(d.difference_m.norm());
    angles.push_back(d.rotation_deg);
    sum += d.difference_m.squaredNorm();
    if (d.normalised) normalised.push_back(*d.normalised);
  }
  if (lengths.empty()) return s;
  s.rmse_m = std::sqrt(sum / static_cast<double>(lengths.size()));
  s.median_m = Quantile(lengths, 0.5);
  s.max_m = Quantile(lengths, 1);
  s.rotation_median_deg = Quantile(angles, 0.5);
  s.rotation_max_deg = Quantile(angles, 1);
  if (!normalised.empty()) {
    s.normalised_median = Quantile(normalised, 0.5);
    s.normalised_p95 = Quantile(normalised, 0.95);
    const auto beyond =
        std::count_if(normalised.begin(), normalised.end(), [](double v) { return 3 * v * v > kChi2Of3At99; });
    s.beyond_99 = static_cast<double>(beyond) / static_cast<double>(normalised.size());
  }
  return s;
}

CrossDifference DifferenceOf(const CrossPair& pair, const Sim3d& ours_from_theirs) {
  const Rigid3d theirs = ours_from_theirs.TransformPose(pair.theirs);
  CrossDifference d;
  d.name = pair.name;
  d.difference_m = theirs.translation - pair.ours.translation;
  d.rotation_deg = AngleBetween(theirs.rotation, pair.ours.rotation) * kRadToDeg;
  return d;
}

// sqrt(r' C^-1 r / 3) by the eigenvalues that are more than rounding; none if the covariance says nothing.
std::optional<double> Normalised(const Eigen::Vector3d& r, const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const double least = std::max(1e-16, 1e-9 * solver.eigenvalues().maxCoeff());
  if (!(solver.eigenvalues().minCoeff() > least)) return std::nullopt;
  const Eigen::Vector3d along = solver.eigenvectors().transpose() * r;
  return std::sqrt((along.cwiseAbs2().array() / solver.eigenvalues().array()).sum() / 3);
}

// Derivative of the fit at our positions: translation, rotation, and for Sim3 scale.
Eigen::MatrixXd FitJacobian(const std::vector<CrossPair>& pairs, CrossAlignment alignment) {
  const auto n = static_cast<Eigen::Index>(pairs.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const CrossPair& pair : pairs) mean += pair.ours.translation / static_cast<double>(n);
  Eigen::MatrixXd a(3 * n, alignment == CrossAlignment::kSim3 ? 7 : 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d p = pairs[static_cast<size_t>(i)].ours.translation - mean;
    a.block<3, 3>(3 * i, 0).setIdentity();
    a.block<3, 3>(3 * i, 3) = -Skew(p);
    if (alignment == CrossAlignment::kSim3) a.block<3, 1>(3 * i, 6) = p;
  }
  return a;
}

double Chi2(const Eigen::Vector3d& difference, const CrossPanorama& panorama, double their_sigma) {
  Eigen::Matrix3d covariance = their_sigma * their_sigma * Eigen::Matrix3d::Identity();
  if (panorama.covariance) covariance += *panorama.covariance;
  return difference.dot(covariance.ldlt().solve(difference));
}

// 1 sigma per axis of their panoramas: with it the median of the squared normalised differences is that of a
// chi-square. Ours is in these already, and must not be counted twice; single wrong answers do not move a median.
double TheirSigma(const std::vector<CrossPanorama>& panoramas, const std::vector<PanoramaJudgement>& judged,
                  double least) {
  constexpr double kMedianChi2 = 2.366;  // of 3 degrees of freedom
  constexpr size_t kFewest = 3;
  constexpr int kHalvings = 40;
  const auto median = [&](double sigma) {
    std::vector<double> chi2;
    for (size_t i = 0; i < judged.size(); ++i) {
      if (judged[i].difference_m) chi2.push_back(Chi2(*judged[i].difference_m, panoramas[i], sigma));
    }
    return chi2.size() < kFewest ? 0 : Quantile(chi2, 0.5);
  };
  if (median(least) <= kMedianChi2) return least;
  double low = least, high = least;
  while (median(high) > kMedianChi2) high *= 2;
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = 0.5 * (low + high);
    (median(middle) > kMedianChi2 ? low : high) = middle;
  }
  return high;
}

}  // namespace

std::string_view CrossAlignmentName(CrossAlignment alignment) {
  switch (alignment) {
    case CrossAlignment::kNone: return "none";
    case CrossAlignment::kSE3: return "se3";
    case CrossAlignment::kSim3: return "sim3";
  }
  return "";
}

CrossComparison CompareCameras(const std::vector<CrossPair>& pairs, const Eigen::MatrixXd& covariance,
                               CrossAlignment alignment) {
  CrossComparison result;
  result.alignment = alignment;
  if (alignment != CrossAlignment::kNone) {
    std::vector<Eigen::Vector3d> ours, theirs;
    for (const CrossPair& pair : pairs) {
      ours.push_back(pair.ours.translation);
      theirs.push_back(pair.theirs.translation);
    }
    result.ours_from_theirs =
        AlignPoints(theirs, ours, alignment == CrossAlignment::kSE3 ? AlignmentKind::kSE3 : AlignmentKind::kSim3);
  }
  for (const CrossPair& pair : pairs) result.differences.push_back(DifferenceOf(pair, result.ours_from_theirs));
  if (covariance.rows() == static_cast<Eigen::Index>(3 * pairs.size()) && !pairs.empty()) {
    Eigen::MatrixXd of_residual = covariance;
    if (alignment != CrossAlignment::kNone) {
      // P C P with P = I - Q Q', Q an orthonormal basis of the fit's directions.
      const Eigen::MatrixXd a = FitJacobian(pairs, alignment);
      const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(a);
      const Eigen::MatrixXd q = Eigen::MatrixXd(qr.householderQ() * Eigen::MatrixXd::Identity(a.rows(), qr.rank()));
      const Eigen::MatrixXd cq = covariance * q;
      of_residual -= cq * q.transpose() + q * cq.transpose() - q * (q.transpose() * cq) * q.transpose();
    }
    for (size_t i = 0; i < pairs.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(3 * i);
      CrossDifference& d = result.differences[i];
      d.normalised = Normalised(d.difference_m, of_residual.block<3, 3>(at, at));
    }
  }
  result.statistics = StatisticsOf(result.differences);
  return result;
}

std::string_view CrossVerdictName(CrossVerdict verdict) {
  switch (verdict) {
    case CrossVerdict::kAgrees: return "agrees";
    case CrossVerdict::kContradicts: return "contradicts";
    case CrossVerdict::kOnlyTheirs: return "found by them alone";
    case CrossVerdict::kOnlyOurs: return "found by us alone";
    case CrossVerdict::kNeither: return "found by neither";
    case CrossVerdict::kWeak: return "too weak to judge";
    case CrossVerdict::kChanged: return "changed since it was computed";
  }
  return "";
}

std::vector<PanoramaJudgement> JudgePanoramas(const std::vector<CrossPanorama>& panoramas,
                                              const Sim3d& ours_from_theirs, double camera_sigma_m) {
  constexpr double kLeastSigma_m = 0.01, kChi2Of3At999 = 16.27;
  constexpr int kFewPoints = 60;
  std::vector<PanoramaJudgement> judged;
  for (const CrossPanorama& p : panoramas) {
    PanoramaJudgement j;
    j.name = p.name;
    j.views = p.views, j.points = p.points;
    if (p.theirs) j.theirs = ours_from_theirs * *p.theirs;
    if (p.theirs && p.ours) j.difference_m = *j.theirs - *p.ours;
    judged.push_back(j);
  }
  const double sigma = TheirSigma(panoramas, judged, std::max(kLeastSigma_m, camera_sigma_m));
  for (size_t i = 0; i < panoramas.size(); ++i) {
    PanoramaJudgement& j = judged[i];
    const bool weak = j.views < 2 && j.points < kFewPoints;
    if (j.difference_m) {
      j.chi2 = Chi2(*j.difference_m, panoramas[i], sigma);
      j.verdict = *j.chi2 > kChi2Of3At999 ? (weak ? CrossVerdict::kWeak : CrossVerdict::kContradicts)
                  : panoramas[i].changed  ? CrossVerdict::kChanged
                                          : CrossVerdict::kAgrees;
    } else if (j.theirs) {
      j.verdict = weak ? CrossVerdict::kWeak : CrossVerdict::kOnlyTheirs;
    } else {
      j.verdict = panoramas[i].changed ? CrossVerdict::kChanged
                  : panoramas[i].ours  ? CrossVerdict::kOnlyOurs
                                       : CrossVerdict::kNeither;
    }
  }
  return judged;
}

CrossComparison ComparePlaces(const std::vector<CrossPair>& pairs, const Sim3d& ours_from_theirs,
                              CrossAlignment alignment) {
  CrossComparison result;
  result.alignment = alignment;
  result.ours_from_theirs = ours_from_theirs;
  for (const CrossPair& pair : pairs) {
    CrossDifference d = DifferenceOf(pair, ours_from_theirs);
    if (pair.covariance) d.normalised = Normalised(d.difference_m, *pair.covariance);
    result.differences.push_back(d);
  }
  result.statistics = StatisticsOf(result.differences);
  return result;
}

}  // namespace trigpoint
