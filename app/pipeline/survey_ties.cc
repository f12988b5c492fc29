#include "app/pipeline/survey_ties.h"

#include <algorithm>

#include "app/pipeline/localize_files.h"

namespace trigpoint {
namespace {

// The points seen longest, as long as one of their pictures still needs some: what more of them would add is little,
// since their errors are alike.
std::vector<bool> ChoosePoints(const Reconstruction& r, int images, int per_image) {
  const BundleProblem& p = r.problem;
  std::vector<size_t> first(p.points.size() + 1, 0);
  std::vector<int> length(p.points.size(), 0);
  for (const BearingObservation& o : p.observations) {
    ++first[static_cast<size_t>(o.point) + 1];
    length[static_cast<size_t>(o.point)] += o.active ? 1 : 0;
  }
  for (size_t j = 1; j < first.size(); ++j) first[j] += first[j - 1];
  std::vector<size_t> order;
  for (size_t j = 0; j < p.points.size(); ++j) {
    if (r.point_valid[j] && length[j] >= 2) order.push_back(j);
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return length[a] > length[b]; });
  std::vector<int> count(static_cast<size_t>(images), 0);
  std::vector<bool> chosen(p.points.size(), false);
  for (size_t j : order) {
    for (size_t k = first[j]; k < first[j + 1]; ++k) {
      if (p.observations[k].active && count[static_cast<size_t>(r.image_of[k])] < per_image) chosen[j] = true;
    }
    for (size_t k = first[j]; chosen[j] && k < first[j + 1]; ++k) {
      if (p.observations[k].active) ++count[static_cast<size_t>(r.image_of[k])];
    }
  }
  return chosen;
}

}  // namespace

void AddTies(const Run& run, const std::filesystem::path& features, const ReconstructRunOptions& options,
             int ties_per_image, int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel,
             SurveyRun* survey) {
  const LocalizeJob job = MakeRunJob(run, features);
  progress.Begin("points and poses of " + run.name, 0);
  const Reconstruction r = ReconstructRun(job.input, options, false, threads, seed, progress, cancel).reconstruction;
  const BundleProblem& p = r.problem;
  for (size_t k = 0; k < p.poses.size(); ++k) {
    survey->start.poses.push_back({job.input.pose_stamps[k], p.poses[k].Inverse()});
  }
  const std::vector<bool> chosen = ChoosePoints(r, static_cast<int>(job.input.images.size()), ties_per_image);
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
    tie.stamp_ns = job.input.pose_stamps[static_cast<size_t>(o.pose)];
    tie.camera = o.view;
    tie.w = o.w;
    survey->ties.push_back(tie);
  }
  survey->tie_loss_chi2 = options.reconstruct.loss_chi2 / (r.correlation_inflation * r.correlation_inflation);
}

}  // namespace trigpoint
