#include "app/pipeline/marking.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>

#include "app/pipeline/stages.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/results.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr int kIterations = 30;
constexpr double kFarthest_m = 500;  // no mark is predicted in cameras farther away

fs::path FileOf(const Project& project) { return project.dir() / "control_observations.csv"; }

struct NamedImage {
  const Run* run;
  const ImageEntry* entry;
  std::string image;
};

std::vector<NamedImage> ImagesOf(const Project& project) {
  std::vector<NamedImage> images;
  for (const Run& run : project.site().runs) {
    for (const ImageEntry& entry : run.images) {
      images.push_back({&run, &entry, RelativeTo(project.dir(), entry.path)});
    }
  }
  return images;
}

NamedImage FindImage(const Project& project, const std::string& text) {
  std::vector<std::string> names;
  for (const NamedImage& image : ImagesOf(project)) {
    if (image.image == text || image.run->name + "/" + image.entry->file == text) return image;
    names.push_back(image.run->name + "/" + image.entry->file);
  }
  const std::string nearest = NearestName(text, names);
  throw InputError("there is no image '" + text + "'" + (nearest.empty() ? "" : "; nearest: '" + nearest + "'"));
}

void Save(const Project& project, const std::vector<PointMark>& marks) {
  CsvWriter csv({"point", "image", "u", "v"},
                {"trigpoint control_observations 1; pixels from the centre of the first"});
  for (const PointMark& mark : marks) {
    csv.Text(mark.point).Text(mark.image).Number(mark.pixel.x(), 3).Number(mark.pixel.y(), 3).EndRow();
  }
  csv.Save(FileOf(project));
}

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
  std::vector<LocalizedView> views;
  for (const Run& run : project.site().runs) {
    StageTarget target;
    target.run = run.name;
    target.variant = variant;
    const fs::path file = ResultOf(project, "localize", target) / "cameras.csv";
    if (!fs::exists(file)) continue;
    std::map<std::string, Rigid3d> poses;
    for (const CameraResult& camera : ReadCameraResults(file)) {
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
    if (!ray) throw InputError(view->image + ": the mark lies where the camera has no rays");
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

std::vector<PointMark> ReadPointMarks(const Project& project) {
  std::vector<PointMark> marks;
  if (!fs::exists(FileOf(project))) return marks;
  const CsvTable table = CsvTable::Read(FileOf(project), {"point", "image", "u", "v"});
  for (const CsvRow& row : table.rows()) {
    marks.push_back({row.Text("point"), row.Text("image"), {row.Number("u"), row.Number("v")}});
  }
  return marks;
}

PointMark SavePointMark(const Project& project, const std::string& point, const std::string& image,
                        const Eigen::Vector2d& pixel) {
  if (Trim(point).empty()) throw InputError("a mark needs the name of its point");
  const NamedImage named = FindImage(project, image);
  const auto camera = static_cast<size_t>(named.entry->camera);
  if (!pixel.allFinite() ||
      (camera < named.run->cameras.size() && !named.run->cameras[camera].camera.Contains(pixel))) {
    throw InputError(named.image + ": the mark lies outside the image");
  }
  std::vector<PointMark> marks = ReadPointMarks(project);
  const PointMark mark{std::string(Trim(point)), named.image, pixel};
  const auto same = std::find_if(marks.begin(), marks.end(),
                                 [&](const PointMark& m) { return m.point == mark.point && m.image == mark.image; });
  if (same == marks.end()) {
    marks.push_back(mark);
  } else {
    *same = mark;
  }
  Save(project, marks);
  return mark;
}

void RemovePointMark(const Project& project, const std::string& point, const std::string& image) {
  const NamedImage named = FindImage(project, image);
  std::vector<PointMark> marks = ReadPointMarks(project);
  if (std::erase_if(marks, [&](const PointMark& m) { return m.point == point && m.image == named.image; }) == 0) {
    throw InputError(FileOf(project).string() + ": point '" + point + "' is not marked in " + named.image);
  }
  Save(project, marks);
}

PointSolution PredictPoint(const Project& project, const std::string& point, const std::string& variant) {
  const std::vector<LocalizedView> views = LocalizedViews(project, variant, ReadPointMarks(project), point);
  std::vector<const LocalizedView*> marked;
  for (const LocalizedView& view : views) {
    if (view.marked) marked.push_back(&view);
  }
  if (marked.size() < 2) {
    throw InputError("point '" + point + "' is marked in " + std::to_string(marked.size()) +
                     " localized images; expected at least two, then it is predicted in the others");
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
      if (!predicted) throw NumericError("the marks of point '" + point + "' don't meet before the cameras");
      j = (j * view->cam_from_world.rotation.toRotationMatrix()).eval();
      const Eigen::Vector2d r = *predicted - *view->marked;
      information += j.transpose() * j;
      gradient += j.transpose() * r;
      cost += r.squaredNorm();
    }
    const Eigen::Vector3d step = information.ldlt().solve(gradient);
    x -= step;
    if (!x.allFinite()) throw NumericError("the marks of point '" + point + "' have no common point");
    if (step.norm() < 1e-9) break;
  }
  solution.world_m = x;
  solution.covariance = information.inverse();
  solution.rms_px = std::sqrt(cost / static_cast<double>(marked.size()));
  std::vector<std::pair<double, PointPrediction>> ranked;
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
