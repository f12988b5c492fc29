#include "eval/report/scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "eval/report/plan.h"
#include "eval/scene/halos.h"
#include "eval/scene/offscreen.h"
#include "eval/scene/scene_view.h"

namespace trigpoint {
namespace {

constexpr int kSamples = 2;      // a picture is drawn so many times larger and averaged
constexpr size_t kStations = 4;  // that get a view of their own
constexpr double kHalo_px = 6;   // width of what stands behind lines

Picture Photograph(OffscreenWindow& window, int width, int height) {
  cv::Mat picture;
  cv::resize(window.Render(kSamples * width, kSamples * height), picture, {width, height}, 0, 0, cv::INTER_AREA);
  std::vector<uchar> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 88});
  return {std::string(bytes.begin(), bytes.end()), true, width, height};
}

// How references are drawn, of the kinds that there are.
std::string ReferencesCaption(const SceneModel& model) {
  const auto has = [&](bool panorama) {
    return std::any_of(model.panoramas.begin(), model.panoramas.end(),
                       [&](const ScenePanorama& p) { return (p.kind == ReferenceKind::kPanorama) == panorama; });
  };
  std::string text = ".";
  if (has(true)) text += " Panoramas as spheres at their estimated places.";
  if (has(false)) text += " Photos upright before their estimated places.";
  const bool geotags = std::any_of(model.panoramas.begin(), model.panoramas.end(),
                                   [](const ScenePanorama& p) { return p.geotag.has_value(); });
  return text + (geotags ? " Geotags as pale dots." : "");
}

std::string ErrorsCaption(double scale, double confidence) {
  return fmt::format(" Red: differences from references, {}, with {:.0f} % ellipsoids at the same scale.",
                     EnlargedText(scale), 100 * confidence);
}

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
  auto halos = std::make_unique<Halos>(model, view, window->renderer(), kSamples * kHalo_px);
  blocks.push_back(Figure{"plan_rendered",
                          std::string(model.on_earth ? "Plan, north up" : "From above") +
                              (model.aerial ? ", over the project's aerial image" : "") + ReferencesCaption(model) +
                              lines + errors + " " + frame + ".",
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
    const Halos behind(model, view, window->renderer(), kSamples * kHalo_px);
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
    blocks.push_back(Figure{fmt::format("station_view_{}", k + 1),
                            "Station " + stations[k] +
                                " with its surroundings: the panorama or photo as it was taken, " +
                                (model.tags.empty() ? "" : "the tag at its real size, ") + "frusta of the cameras." +
                                errors + " " + frame + ".",
                            Photograph(*window, width, height), true});
    cancel.ThrowIfCancelled();
  }
  view.RemoveFrom(window->renderer());
  return scenes;
}

}  // namespace trigpoint
