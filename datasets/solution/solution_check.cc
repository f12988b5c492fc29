#include "datasets/solution/solution_check.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

void CheckIndex(const char* what, size_t row, const char* of, int64_t index, size_t count) {
  if (index >= 0 && index < static_cast<int64_t>(count)) return;
  throw InputError(fmt::format("{} {} names {} {} of {}", what, row, of, index, count));
}

void CheckSize(const char* what, size_t size, const char* of, size_t expected) {
  if (size != expected) throw InputError(fmt::format("there are {} {} for {} {}", size, what, expected, of));
}

void CheckObservations(const Solution& s) {
  const BundleProblem& p = s.problem;
  for (size_t i = 0; i < p.observations.size(); ++i) {
    const BearingObservation& o = p.observations[i];
    CheckIndex("observation", i, "point", o.point, p.points.size());
    CheckIndex("observation", i, "pose", o.pose, p.poses.size());
    CheckIndex("observation", i, "view", o.view, p.views.size());
    const int image = s.image_of[i];
    image >= 0 ? CheckIndex("observation", i, "image", image, s.images.size())
               : CheckIndex("observation", i, "reference", -1 - int64_t{image}, s.references.size());
    if (i > 0 && o.point < p.observations[i - 1].point) {
      throw InputError(fmt::format("observation {} is not sorted by point", i));
    }
  }
}

}  // namespace

void CheckSolution(const Solution& s) {
  const BundleProblem& p = s.problem;
  for (size_t i = 0; i < s.images.size(); ++i) {
    CheckIndex("image", i, "camera", s.images[i].camera, s.cameras.size());
    CheckIndex("image", i, "pose", s.images[i].pose, s.pose_stamps.size());
  }
  if (s.pose_stamps.size() > p.poses.size()) CheckSize("times", s.pose_stamps.size(), "poses", p.poses.size());
  if (s.cameras.size() > p.views.size()) CheckSize("cameras", s.cameras.size(), "views", p.views.size());
  CheckSize("scales", p.scales.size(), "runs", std::max<size_t>(1, s.runs.size()));
  for (size_t i = 0; i < s.runs.size(); ++i) {
    const SolutionRun& run = s.runs[i];
    const SolutionRun before = i == 0 ? SolutionRun() : s.runs[i - 1];
    const auto within = [](int first, int least, size_t count) {
      return first >= least && static_cast<size_t>(first) <= count;
    };
    if (!within(run.first_camera, before.first_camera, s.cameras.size()) ||
        !within(run.first_image, before.first_image, s.images.size()) ||
        !within(run.first_pose, before.first_pose, s.pose_stamps.size())) {
      throw InputError(fmt::format("run {} begins before another run or after the end of all of them", i));
    }
  }
  CheckSize("depths", s.depth_m.size(), "points", p.points.size());
  CheckSize("marks of validity", s.point_valid.size(), "points", p.points.size());
  CheckSize("image indices", s.image_of.size(), "observations", p.observations.size());
  CheckSize("feature indices", s.feature_of.size(), "observations", p.observations.size());
  if (!s.covariances.empty()) CheckSize("covariances", s.covariances.size(), "poses", p.poses.size());
  if (!s.lens_errors.empty()) CheckSize("errors of lenses", s.lens_errors.size(), "cameras", s.cameras.size());
  if (!s.lens_roots.empty()) {
    constexpr size_t kErrors = std::tuple_size_v<LensParameters>;
    CheckSize("roots of lenses' covariances", s.lens_roots.size(), "cameras, five times", kErrors * s.cameras.size());
  }
  if (p.pose_shifts.size() > 0) {
    CheckSize("shifts", static_cast<size_t>(p.pose_shifts.rows() / 6), "poses", p.poses.size());
  }
  CheckObservations(s);
  for (size_t i = 0; i < p.factors.size(); ++i) {
    CheckIndex("factor", i, "pose", p.factors[i].a, p.poses.size());
    if (p.factors[i].b != -1) CheckIndex("factor", i, "pose", p.factors[i].b, p.poses.size());
    if (p.factors[i].scale != -1) CheckIndex("factor", i, "scale", p.factors[i].scale, p.scales.size());
    const PoseFactor::Kind kind = p.factors[i].kind;
    if (kind != PoseFactor::Kind::kTwoView && kind != PoseFactor::Kind::kRigPoint) continue;
    CheckIndex("factor", i, "view", p.factors[i].view_a, p.views.size());
    if (kind == PoseFactor::Kind::kRigPoint) {
      CheckIndex("factor", i, "pose", p.factors[i].b, p.poses.size());
      continue;
    }
    CheckIndex("factor", i, "view", p.factors[i].view_b, p.views.size());
  }
  if (p.map) {
    if (p.map->frame != -1) CheckIndex("map", 0, "pose", p.map->frame, p.poses.size());
    for (size_t i = 0; i < p.map->rigs.size(); ++i) CheckIndex("map", i, "pose", p.map->rigs[i], p.poses.size());
  }
  for (size_t i = 0; i < s.references.size(); ++i) {
    if (s.references[i].pose != -1) CheckIndex("reference", i, "pose", s.references[i].pose, p.poses.size());
  }
  if (s.georeference) {
    CheckSize("covariances with the georeference", s.georeference->with_poses.size(), "poses", p.poses.size());
  }
}

}  // namespace trigpoint
