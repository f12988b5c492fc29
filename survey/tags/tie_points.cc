#include "survey/tags/tie_points.h"

#include <algorithm>

#include "calib/estimation/loss.h"

namespace trigpoint {
namespace {

// The points seen longest, as long as one of their pictures still needs some: what more of them would add is little,
// since their errors are alike.
std::vector<bool> ChoosePoints(const Solution& s, int per_image) {
  const BundleProblem& p = s.problem;
  std::vector<size_t> first(p.points.size() + 1, 0);
  std::vector<int> length(p.points.size(), 0);
  for (const BearingObservation& o : p.observations) {
    ++first[static_cast<size_t>(o.point) + 1];
    length[static_cast<size_t>(o.point)] += o.active ? 1 : 0;
  }
  for (size_t j = 1; j < first.size(); ++j) first[j] += first[j - 1];
  std::vector<size_t> order;
  for (size_t j = 0; j < p.points.size(); ++j) {
    if (s.point_valid[j] && length[j] >= 2) order.push_back(j);
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return length[a] > length[b]; });
  std::vector<int> count(s.images.size(), 0);
  std::vector<bool> chosen(p.points.size(), false);
  for (size_t j : order) {
    for (size_t k = first[j]; k < first[j + 1]; ++k) {
      if (p.observations[k].active && count[static_cast<size_t>(s.image_of[k])] < per_image) chosen[j] = true;
    }
    for (size_t k = first[j]; chosen[j] && k < first[j + 1]; ++k) {
      if (p.observations[k].active) ++count[static_cast<size_t>(s.image_of[k])];
    }
  }
  return chosen;
}

}  // namespace

void AddTies(const Solution& solution, int ties_per_image, SurveyRun* survey) {
  const BundleProblem& p = solution.problem;
  for (size_t k = 0; k < solution.pose_stamps.size(); ++k) {
    survey->start.poses.push_back({solution.pose_stamps[k], p.poses[k].Inverse()});
  }
  const std::vector<bool> chosen = ChoosePoints(solution, ties_per_image);
  std::vector<int> index(p.points.size(), -1);
  for (const BearingObservation& o : p.observations) {
    const auto j = static_cast<size_t>(o.point);
    if (!o.active || !chosen[j]) continue;
    if (index[j] < 0) {
      index[j] = static_cast<int>(survey->tie_points.size());
      survey->tie_points.push_back(p.points[j]);
    }
    SurveyTie tie;
    tie.point = index[j];
    tie.stamp_ns = solution.pose_stamps[static_cast<size_t>(o.pose)];
    tie.camera = o.view;
    tie.w = o.w;
    survey->ties.push_back(tie);
  }
  // The threshold counts the correlation of the features' errors, as the weights do.
  const auto* loss = dynamic_cast<const Chi2Loss*>(p.loss.get());
  if (loss != nullptr) survey->tie_loss_chi2 = loss->threshold();
}

}  // namespace trigpoint
