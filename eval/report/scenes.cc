#include "eval/report/scenes.h"

#include <fmt/format.h>
#include <vtkCamera.h>
#include <vtkRenderer.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "eval/report/plan.h"
#include "eval/scene/offscreen.h"
#include "eval/scene/props.h"
#include "eval/scene/scene_parts.h"
#include "eval/scene/scene_view.h"

namespace trigpoint {
namespace {

constexpr int kSamples = 2;      // a picture is drawn so many times larger and averaged
constexpr size_t kStations = 4;  // that get a view of their own

Picture Photograph(OffscreenWindow& window, int width, int height) {
  cv::Mat picture;
  cv::resize(window.Render(kSamples * width, kSamples * height), picture, {width, height}, 0, 0, cv::INTER_AREA);
  std::vector<uchar> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 88});
  return {std::string(bytes.begin(), bytes.end()), true, width, height};
}

std::string ErrorsCaption(double scale, double confidence) {
  return fmt::format(
      " Red: differences from references, {:g} times enlarged, with {:.0f} % ellipsoids at the same scale.", scale,
      100 * confidence);
}

// Of a colour "#rrggbb", as WCAG 2 has it: 0 is black, 1 white.
double Luminance(const std::string& colour) {
  constexpr double kShares[] = {0.2126, 0.7152, 0.0722};
  double luminance = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double c = std::stoi(colour.substr(1 + 2 * k, 2), nullptr, 16) / 255.0;
    luminance += kShares[k] * (c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
  }
  return luminance;
}

// Broader lines behind the visible paths as the camera sees them from above, white behind dark ones and black behind
// light ones, so that they stand out from any ground. Taken away with the object.
class Halos {
 public:
  Halos(const SceneModel& model, const SceneView& view, vtkRenderer* renderer)
      : renderer_(renderer), camera_(renderer->GetActiveCamera()) {
    std::vector<const ScenePath*> paths;
    double level = std::numeric_limits<double>::infinity();
    for (const ScenePath& path : model.paths) {
      if (path.poses.size() < 2 || SceneView::ColourOfLayer(LayerOf(path.kind)).empty()) continue;
      if (!view.Visible(LayerOf(path.kind))) continue;
      paths.push_back(&path);
      for (const TimedPose& pose : path.poses) level = std::min(level, pose.target_from_body.translation.z());
    }
    level = std::max(level, model.ground_z + 3 * kBelow);  // else the ground hides them
    for (const ScenePath* path : paths) {
      const bool light = Luminance(SceneView::ColourOfLayer(LayerOf(path->kind))) > kLight;
      std::vector<Eigen::Vector3d> line;
      for (const TimedPose& pose : path->poses)
        line.push_back(Behind(pose.target_from_body.translation, level - (light ? 2 : 1) * kBelow));
      actors_.push_back(FlatActor(Lines({line}), light ? kBlack : kWhite, kSamples * kWidth));
      renderer_->AddViewProp(actors_.back());
    }
  }
  ~Halos() {
    for (const auto& actor : actors_) renderer_->RemoveViewProp(actor);
  }
  Halos(const Halos&) = delete;
  Halos& operator=(const Halos&) = delete;

 private:
  static constexpr double kLight = 0.3;
  static constexpr double kBelow = 0.05;  // m
  static constexpr double kWidth = 6;     // pixels of the picture

  // Where the ray through a point reaches the height `z`: the same pixel, behind all paths.
  Eigen::Vector3d Behind(const Eigen::Vector3d& point, double z) const {
    Eigen::Vector3d ray(camera_->GetDirectionOfProjection());
    if (camera_->GetParallelProjection() == 0) ray = point - Eigen::Vector3d(camera_->GetPosition());
    constexpr double kSteep = 0.05;  // of a ray that reaches the ground near the site
    if (ray.z() > -kSteep * ray.norm() || point.z() <= z) return point;
    return point + (z - point.z()) / ray.z() * ray;
  }

  vtkRenderer* renderer_;
  vtkCamera* camera_;
  std::vector<vtkSmartPointer<vtkActor>> actors_;
};

// Stations of the largest differences, then others; no more than are shown, each once.
std::vector<std::string> WorstStations(const SceneModel& model) {
  std::vector<const SceneError*> worst;
  for (const SceneError& e : model.errors) worst.push_back(&e);
  std::stable_sort(worst.begin(), worst.end(),
                   [](const auto* a, const auto* b) { return a->difference.norm() > b->difference.norm(); });
  // An errors.csv that is older than the answers may name stations that have none now.
  std::set<std::string> answered, seen;
  for (const ScenePanorama& p : model.panoramas) answered.insert(p.station);
  std::vector<std::string> stations;
  const auto add = [&](const std::string& station) {
    if (stations.size() < kStations && seen.insert(station).second) stations.push_back(station);
  };
  for (const SceneError* e : worst) {
    if (answered.count(e->station) > 0) add(e->station);
  }
  for (const ScenePanorama& p : model.panoramas) add(p.station);
  return stations;
}

}  // namespace

Scenes DrawScenes(const ReportInput& input, bool images, int width, std::vector<std::string>* notes,
                  std::string* renderer, ProgressSink& progress, const CancelToken& cancel) {
  Scenes scenes;
  std::vector<Block>& blocks = scenes.pictures;
  const int height = width * 2 / 3;
  progress.Begin("the scene", 0);
  SceneOptions options;
  if (!images) options.panorama_width_px = options.aerial_px = 0;
  const SceneModel model = LoadScene(*input.project, options, cancel);
  for (const std::string& note : model.notes) notes->push_back("scene: " + note);
  if (model.Empty()) {
    blocks.push_back(Paragraph{"There is nothing to draw yet: no run has a result."});
    return scenes;
  }
  Plan plan = PlanOf(model);
  scenes.plan = Figure{"plan", plan.caption, std::move(plan.drawing)};
  std::string reason;
  const std::unique_ptr<OffscreenWindow> window = OffscreenWindow::Create(&reason);
  if (!window) {
    blocks.push_back(
        Paragraph{"The scene could not be rendered on this machine: " + reason + ". Everything else is complete.",
                  Tone::kWarning});
    notes->push_back("the scene was not rendered: " + reason);
    return scenes;
  }
  *renderer = window->Device();
  SceneStyle style;
  style.text_px = std::max(8.0, 18.0 * width / 1280) * kSamples;
  const auto [low, high] = model.Bounds();
  style.sphere_radius_m = std::clamp(0.01 * (high - low).head<2>().maxCoeff(), 0.25, 2.0);
  SceneView view(model, style);
  view.AddTo(window->renderer());
  window->Render(kSamples * width, kSamples * height);  // gives the renderer its size
  const std::string lines = std::string(" Blue: optimised cameras; ochre: odometry from the first camera on") +
                            (std::any_of(model.paths.begin(), model.paths.end(),
                                         [](const auto& p) { return p.kind == ScenePath::Kind::kTruth; })
                                 ? "; black: reference poses."
                                 : ".");
  const std::string frame =
      "Frame: " + model.frame + (model.on_earth ? " (x east, y north, z up, metres)" : " (metres)");
  const std::string errors = model.errors.empty() ? "" : ErrorsCaption(view.ErrorScale(), style.confidence);
  const auto show = [&](std::initializer_list<const char*> hidden) {
    for (const std::string& layer : SceneView::Layers()) view.SetVisible(layer, SceneView::ShownAtFirst(layer));
    for (const char* layer : hidden) view.SetVisible(layer, false);
  };
  show({"points", "cameras"});
  view.LookDown(window->renderer());
  auto halos = std::make_unique<Halos>(model, view, window->renderer());
  blocks.push_back(Figure{"plan_rendered",
                          "Plan, north up" + std::string(model.aerial ? ", over the project's aerial image" : "") +
                              ". Panoramas as spheres at their estimated places, geotags as pale dots." + lines +
                              errors + " " + frame + ".",
                          Photograph(*window, width, height), true});
  halos.reset();
  cancel.ThrowIfCancelled();
  const std::pair<PointColour, const char*> colours[] = {
      {PointColour::kHeight, "height (m)"},
      {PointColour::kTrackLength, "number of images that see them"},
      {PointColour::kUncertainty, "largest standard deviation of their position with the cameras held (m, 1 sigma)"}};
  const char* names[] = {"oblique", "oblique_track_length", "oblique_uncertainty"};
  for (size_t i = 0; i < 3; ++i) {
    if (i > 0 && model.points.empty()) break;
    show({"ellipsoids", "geotags"});
    if (i > 0) {
      for (const char* layer : {"aerial", "cameras", "errors", "panoramas"}) view.SetVisible(layer, false);
    }
    view.ColourPointsBy(colours[i].first);
    view.LookOblique(window->renderer());
    const Halos behind(model, view, window->renderer());
    blocks.push_back(
        Figure{names[i],
               "From the south-west, 33 degrees above the horizon. Points by " + std::string(colours[i].second) +
                   "; colours from their 2nd to their 95th percentile." +
                   (i == 0 && model.aerial ? " The height of the ground is estimated from the points." : "") + lines +
                   " " + frame + ".",
               Photograph(*window, width, height), true});
    cancel.ThrowIfCancelled();
  }
  show({"points", "ellipsoids", "geotags", "axes"});
  const std::vector<std::string> stations = WorstStations(model);
  for (size_t k = 0; k < stations.size(); ++k) {
    view.LookAtStation(window->renderer(), stations[k]);
    blocks.push_back(Figure{
        fmt::format("station_view_{}", k + 1),
        "Station " + stations[k] +
            " with its surroundings: the panorama as it was taken, the tag at its real size, frusta of the cameras." +
            errors + " " + frame + ".",
        Photograph(*window, width, height), true});
    cancel.ThrowIfCancelled();
  }
  view.RemoveFrom(window->renderer());
  return scenes;
}

}  // namespace trigpoint
