#include "datasets/solution/solution_model.h"

#include <cmath>

namespace trigpoint {

Solution PartOfRun(const Solution& site, size_t index) {
  const SolutionRun& run = site.runs.at(index);
  const SolutionRun* const next = index + 1 < site.runs.size() ? &site.runs[index + 1] : nullptr;
  const auto part = [](const auto& all, int first, int end, auto* out) {
    out->assign(all.begin() + first, end < 0 ? all.end() : all.begin() + end);
  };
  Solution s;
  s.run = run.name;
  s.mode = site.mode;
  part(site.cameras, run.first_camera, next ? next->first_camera : -1, &s.cameras);
  part(site.images, run.first_image, next ? next->first_image : -1, &s.images);
  for (SolutionImage& image : s.images) image.camera -= run.first_camera;
  s.problem.poses = site.problem.poses;
  s.problem.scales = {site.problem.scales[index]};
  s.covariances = site.covariances;
  s.sigma_px = run.sigma_px;
  s.correlation_inflation = run.correlation_inflation;
  s.odometry_noise_factor = run.odometry_noise_factor;
  s.references = site.references;
  s.georeference = site.georeference;
  return s;
}

SolutionModel ModelOf(const Solution& s) {
  SolutionModel out;
  SparseModel& model = out.model;
  for (size_t c = 0; c < s.cameras.size(); ++c) {
    model.cameras.emplace_back(static_cast<uint32_t>(c + 1), s.cameras[c].camera);
  }
  for (const SolutionImage& image : s.images) {
    ModelImage& m = model.images.emplace_back();
    m.id = static_cast<uint32_t>(model.images.size());
    m.name = image.name;
    m.camera_id = static_cast<uint32_t>(image.camera + 1);
    m.cam_from_world =
        s.cameras[static_cast<size_t>(image.camera)].cam_from_body * s.problem.poses[static_cast<size_t>(image.pose)];
  }
  out.feature_of.resize(model.images.size());
  const std::vector<BearingObservation>& observations = s.problem.observations;
  size_t k = 0;
  for (size_t j = 0; j < s.problem.points.size(); ++j) {
    ModelPoint point;
    point.id = static_cast<int64_t>(j + 1);
    point.position = s.problem.points[j];
    double sum = 0;
    for (; k < observations.size() && observations[k].point == static_cast<int>(j); ++k) {
      const BearingObservation& o = observations[k];
      if (!o.active || s.image_of[k] < 0 || !s.point_valid[j]) continue;
      const auto index = static_cast<size_t>(s.image_of[k]);
      ModelImage& image = model.images[index];
      const auto pixel = model.cameras[image.camera_id - 1].second.Project(o.ray.cast<double>());
      if (!pixel) continue;
      point.track.emplace_back(image.id, static_cast<uint32_t>(image.pixels.size()));
      image.pixels.push_back(*pixel);
      image.points.push_back(point.id);
      out.feature_of[index].push_back(s.feature_of[k]);
      sum += std::sqrt(SquaredError(s.problem, o)) * s.sigma_px;
    }
    if (point.track.size() < 2) {
      // Not kept: its observations go without a point.
      for (const auto& [image, pixel] : point.track) model.images[image - 1].points[pixel] = -1;
      continue;
    }
    point.error_px = sum / static_cast<double>(point.track.size());
    model.points.push_back(std::move(point));
  }
  return out;
}

}  // namespace trigpoint
