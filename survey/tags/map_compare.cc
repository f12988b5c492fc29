#include "survey/tags/map_compare.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <map>

#include "calib/base/median.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/alignment.h"

namespace trigpoint {
namespace {

constexpr double kMovedChi2 = 22.46;  // 99.9 % of chi-square with 6 degrees of freedom

struct Pair {
  const TagEstimate* before;
  const TagEstimate* now;
};

std::vector<Pair> Common(const std::vector<TagEstimate>& before, const std::vector<TagEstimate>& now) {
  std::map<int, const TagEstimate*> earlier;
  for (const TagEstimate& t : before) {
    if (t.HasPose()) earlier[t.tag_id] = &t;
  }
  std::vector<Pair> pairs;
  for (const TagEstimate& t : now) {
    const auto it = earlier.find(t.tag_id);
    if (t.HasPose() && it != earlier.end()) pairs.push_back({it->second, &t});
  }
  return pairs;
}

Rigid3d Fit(const std::vector<Pair>& pairs) {
  std::vector<Eigen::Vector3d> a, b;
  for (const Pair& p : pairs) {
    a.push_back(p.before->world_from_tag->translation);
    b.push_back(p.now->world_from_tag->translation);
  }
  const Sim3d fit = AlignPoints(a, b, AlignmentKind::kSE3);
  return Rigid3d(fit.rotation, fit.translation);
}

// The rigid motion most tags agree on: every triple proposes, the median decides, the nearer half is fitted.
Rigid3d RobustFit(const std::vector<Pair>& pairs) {
  Rigid3d best = Fit(pairs);
  const auto distances = [&](const Rigid3d& t) {
    std::vector<double> d;
    for (const Pair& p : pairs) {
      d.push_back((t * p.before->world_from_tag->translation - p.now->world_from_tag->translation).norm());
    }
    return d;
  };
  double best_median = Median(distances(best));
  const size_t n = std::min<size_t>(pairs.size(), 20);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      for (size_t k = j + 1; k < n; ++k) {
        const Rigid3d fit = Fit({pairs[i], pairs[j], pairs[k]});
        const double m = Median(distances(fit));
        if (m < best_median) best_median = m, best = fit;
      }
    }
  }
  const std::vector<double> d = distances(best);
  std::vector<Pair> near;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (d[i] <= 2.5 * best_median + 1e-9) near.push_back(pairs[i]);
  }
  return near.size() >= 3 ? Fit(near) : best;
}

Matrix6d Turned(const Matrix6d& covariance, const Eigen::Quaterniond& rotation) {
  Matrix6d r = Matrix6d::Zero();
  r.topLeftCorner<3, 3>() = r.bottomRightCorner<3, 3>() = rotation.toRotationMatrix();
  return r * covariance * r.transpose();
}

}  // namespace

SurveyEpochs TestEpochs(const std::vector<TagEstimate>& before, const std::vector<TagEstimate>& now, bool same_datum) {
  SurveyEpochs test;
  const std::vector<Pair> pairs = Common(before, now);
  if (pairs.empty()) {
    test.problem = "the two maps have no tag in common";
    return test;
  }
  Rigid3d now_from_before;
  if (!same_datum) {
    if (pairs.size() < 4) {
      test.problem = "maps with datums of their own need four common tags, found " + std::to_string(pairs.size());
      return test;
    }
    now_from_before = RobustFit(pairs);
    test.aligned = true;
  }
  for (const Pair& p : pairs) {
    const Rigid3d moved = now_from_before * *p.before->world_from_tag;
    const Vector6d d = p.now->world_from_tag->Minus(moved);
    const Matrix6d covariance =
        p.now->covariance + Turned(p.before->covariance, now_from_before.rotation) + 1e-14 * Matrix6d::Identity();
    TagChange change;
    change.tag_id = p.now->tag_id;
    change.shift_m = d.tail<3>();
    change.turn_deg = d.head<3>().norm() * kRadToDeg;
    change.chi2 = d.dot(covariance.ldlt().solve(d));
    change.moved = change.chi2 > kMovedChi2;
    test.tags.push_back(change);
  }
  return test;
}

Repeatability CompareMaps(const std::vector<std::pair<SurveyResult, SurveyResult>>& pairs) {
  Repeatability result;
  double square = 0;
  for (const auto& [a, b] : pairs) {
    const std::vector<Pair> common = Common(a.tags, b.tags);
    const bool fit = !a.in_world || !b.in_world;
    if (common.empty() || (fit && common.size() < 4)) continue;
    const Rigid3d b_from_a = fit ? Fit(common) : Rigid3d();
    ++result.maps;
    for (const Pair& p : common) {
      square += (b_from_a * p.before->world_from_tag->translation - p.now->world_from_tag->translation).squaredNorm();
      ++result.differences;
    }
  }
  if (result.differences > 0) result.rms_m = std::sqrt(square / result.differences);
  return result;
}

}  // namespace trigpoint
