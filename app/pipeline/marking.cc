#include "app/pipeline/marking.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "app/pipeline/stages.h"
#include "calib/base/counted.h"
#include "datasets/io/csv.h"
#include "datasets/io/csv_dialect.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/lock.h"
#include "datasets/project/replaced.h"
#include "eval/errors/results.h"

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

// Below the project; `named` itself where it is no image of a run.
std::string FullName(const std::vector<NamedImage>& images, const std::string& named) {
  for (const NamedImage& image : images) {
    if (image.entry->file == named || NamesPath(named, image.image)) return image.image;
  }
  return named;
}

const std::vector<std::string> kMarkColumns = {"point", "image", "u", "v"};

std::string MarkLine(const std::vector<std::string>& columns, const PointMark& mark) {
  CsvWriter csv(columns);
  const size_t header = csv.text().size();
  for (const std::string& column : columns) {
    if (column == "point") {
      csv.Text(mark.point);
    } else if (column == "image") {
      csv.Text(mark.image);
    } else if (column == "u" || column == "v") {
      csv.Number(column == "u" ? mark.pixel.x() : mark.pixel.y(), 3);
    } else if (column == "sigma_px" && mark.sigma_px != PointMark().sigma_px) {
      csv.Number(mark.sigma_px, 3);
    } else {
      csv.Empty();
    }
  }
  csv.EndRow();
  return csv.text().substr(header);
}

// Marks are added as lines with commas and decimal points.
void RequireCommas(const fs::path& file, const std::string& text) {
  const std::vector<DataLine> lines = DataLines(text);
  if (lines.empty() || DelimiterOf(lines.front().text) == ',') return;
  throw InputError(file.string() + ": its cells are separated by '" + DelimiterOf(lines.front().text) +
                   "'; marks are added to a table with commas and decimal points alone: save it so first");
}

// Takes the marks of a point in an image out of control_observations.csv and adds one. The file as it was is kept in
// results/replaced/; returns that copy in `kept`, and whether one was taken out.
bool EditMarks(const Project& project, const std::string& point, const std::string& image, const PointMark* added,
               fs::path* kept) {
  const fs::path file = FileOf(project);
  const InputLock lock(project.results());
  const CsvWriter none(kMarkColumns, {"trigpoint control_observations 1; pixels from the centre of the first"});
  if (!fs::exists(file)) {
    if (added == nullptr) return false;
    WriteFileAtomically(file, none.text() + MarkLine(kMarkColumns, *added));
    return false;
  }
  const CsvTable table = CsvTable::Read(file, kMarkColumns);
  const auto is_mark = [&, images = ImagesOf(project)](const CsvRow& row) {
    return row.Text("point") == point && FullName(images, row.Text("image")) == image;
  };
  const bool there = std::any_of(table.rows().begin(), table.rows().end(), is_mark);
  RequireCommas(file, ReadTextFile(file));
  std::string text = table.TextWithout(is_mark);
  if (added != nullptr) {
    if (!text.empty() && text.back() != '\n') text += '\n';
    text += MarkLine(table.columns(), *added);
  }
  const fs::path old = ReplaceInputFile(project.dir(), file.filename().string(), text);
  if (kept != nullptr) *kept = old;
  if (text == none.text()) fs::remove(file);  // as it was before the first mark: results are up to date again
  return there;
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
    const fs::path dir = ResultOf(project, "localize", target);
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

std::vector<PointMark> ReadPointMarks(const Project& project) {
  std::vector<PointMark> marks;
  if (!fs::exists(FileOf(project))) return marks;
  const CsvTable table = CsvTable::Read(FileOf(project), kMarkColumns, {"sigma_px"});
  const std::vector<NamedImage> images = ImagesOf(project);
  for (const CsvRow& row : table.rows()) {
    PointMark mark{row.Text("point"), FullName(images, row.Text("image")), {row.Number("u"), row.Number("v")}};
    mark.sigma_px = row.Number("sigma_px", mark.sigma_px);
    marks.push_back(std::move(mark));
  }
  return marks;
}

PointMark SavePointMark(const Project& project, const std::string& point, const std::string& image,
                        const Eigen::Vector2d& pixel, fs::path* kept, double sigma_px) {
  if (Trim(point).empty()) throw InputError("a mark needs the name of its point");
  const NamedImage named = FindImage(project, image);
  const auto camera = static_cast<size_t>(named.entry->camera);
  if (!pixel.allFinite() ||
      (camera < named.run->cameras.size() && !named.run->cameras[camera].camera.Contains(pixel))) {
    throw InputError(named.image + ": the mark lies outside the image");
  }
  PointMark mark{std::string(Trim(point)), named.image, pixel};
  mark.sigma_px = sigma_px;
  EditMarks(project, mark.point, mark.image, &mark, kept);
  return mark;
}

void RemovePointMark(const Project& project, const std::string& point, const std::string& image, fs::path* kept) {
  const NamedImage named = FindImage(project, image);
  if (!EditMarks(project, point, named.image, nullptr, kept)) {
    throw InputError(FileOf(project).string() + ": point '" + point + "' is not marked in " + named.image);
  }
}

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
