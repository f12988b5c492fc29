#include "eval/truth/marked_point.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/project/files.h"
#include "datasets/project/marking.h"
#include "eval/errors/results.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr int kIterations = 30;
constexpr double kFarthest_m = 500;  // no mark is predicted in cameras farther away

// A localized image.
struct LocalizedView {
  const Run* run;
  const ImageEntry* entry;
  std::string image;
  const Camera* camera;
  Rigid3d cam_from_world;
  std::optional<Eigen::Vector2d> marked;
};

std::vector<LocalizedView> LocalizedViews(const Project& project, const std::string& variant,
                                          const std::vector<PointMark>& marks, const std::string& point) {
  const std::string at = variant.empty() ? "" : "@" + variant;
  std::vector<LocalizedView> views;
  for (const Run& run : project.site().runs) {
    const fs::path dir = project.ResultDir("localize", run.name + at);
    if (!fs::exists(dir / "cameras.csv")) continue;
    std::map<std::string, Rigid3d> poses;
    for (const CameraResult& camera : ReadLocalizeResult(dir).images) {
      if (camera.world_from_cam) poses[camera.image] = camera.world_from_cam->Inverse();
    }
    for (const ImageEntry& entry : run.images) {
      const auto pose = poses.find(entry.file);
      if (pose == poses.end() || static_cast<size_t>(entry.camera) >= run.cameras.size()) continue;
      LocalizedView view{&run,
                         &entry,
                         RelativeTo(project.dir(), entry.path),
                         &run.cameras[static_cast<size_t>(entry.camera)].camera,
                         pose->second,
                         std::nullopt};
      for (const PointMark& mark : marks) {
        if (mark.point == point && mark.image == view.image) view.marked = mark.pixel;
      }
      views.push_back(std::move(view));
    }
  }
  return views;
}

// Midpoint of all rays: minimises the sum of squared distances to them.
Eigen::Vector3d MeetingPoint(const std::vector<const LocalizedView*>& views) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const LocalizedView* view : views) {
    const auto ray = view->camera->Unproject(*view->marked);
    if (!ray) {
      throw InputError(view->image +
                       ": the camera model is not defined at the mark's pixel; move the mark towards the image centre");
    }
    const Eigen::Vector3d d = view->cam_from_world.rotation.conjugate() * ray->normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * view->cam_from_world.TargetOriginInSource();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(a);
  if (eigen.eigenvalues().x() < 1e-6) {
    throw NumericError("the marks' rays are nearly parallel; mark the point in images farther apart");
  }
  return a.ldlt().solve(b);
}

}  // namespace

PointSolution PredictPoint(const Project& project, const std::string& point, const std::string& variant) {
  const std::vector<LocalizedView> views = LocalizedViews(project, variant, ReadPointMarks(project), point);
  std::vector<const LocalizedView*> marked;
  for (const LocalizedView& view : views) {
    if (view.marked) marked.push_back(&view);
  }
  if (marked.size() < 2) {
    throw InputError("point '" + point + "' is marked in " + Counted(marked.size(), "localized image") +
                     "; expected at least two to predict it in the others");
  }
  PointSolution solution;
  solution.marks = static_cast<int>(marked.size());
  Eigen::Vector3d x = MeetingPoint(marked);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double cost = 0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    information.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    cost = 0;
    for (const LocalizedView* view : marked) {
      Eigen::Matrix<double, 2, 3> j;
      const auto predicted = view->camera->Project(view->cam_from_world * x, &j);
      if (!predicted) {
        throw NumericError("the rays of the marks of point '" + point +
                           "' do not intersect in front of the cameras; check the marks");
      }
      j = (j * view->cam_from_world.rotation.toRotationMatrix()).eval();
      const Eigen::Vector2d r = *predicted - *view->marked;
      information += j.transpose() * j;
      gradient += j.transpose() * r;
      cost += r.squaredNorm();
    }
    const Eigen::Vector3d step = information.ldlt().solve(gradient);
    x -= step;
    if (!x.allFinite()) throw NumericError("the marks of point '" + point + "' do not fit one point; check the marks");
    if (step.norm() < 1e-9) break;
  }
  solution.world_m = x;
  solution.covariance = information.inverse();
  solution.rms_px = std::sqrt(cost / static_cast<double>(marked.size()));
  std::vector<std::pair<double, PredictedMark>> ranked;
  for (const LocalizedView& view : views) {
    Eigen::Matrix<double, 2, 3> j;
    const auto pixel = view.camera->Project(view.cam_from_world * x, &j);
    const double distance = (view.cam_from_world * x).norm();
    if (!pixel || !view.camera->Contains(*pixel) || distance > kFarthest_m) continue;
    j = (j * view.cam_from_world.rotation.toRotationMatrix()).eval();
    ranked.push_back(
        {distance,
         {view.run->name, view.entry->file, view.image, *pixel, j * solution.covariance * j.transpose(), view.marked}});
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (auto& [distance, prediction] : ranked) solution.images.push_back(std::move(prediction));
  return solution;
}

}  // namespace trigpoint
