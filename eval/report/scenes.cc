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

struct Colouring {
  PointColour by;
  const char *figure, *text;
};

constexpr Colouring kColourings[] = {
    {PointColour::kHeight, "oblique", "height (m)"},
    {PointColour::kTrackLength, "oblique_track_length", "number of images that see them"},
    {PointColour::kUncertainty, "oblique_uncertainty",
     "largest standard deviation of their position with the cameras held (m, 1 sigma)"}};

SceneStyle StyleOf(const SceneModel& model, int width) {
  SceneStyle style;
  style.text_px = std::max(8.0, 18.0 * width / 1280) * kSamples;
  const auto [low, high] = model.Bounds();
  style.sphere_radius_m = std::clamp(0.01 * (high - low).head<2>().maxCoeff(), 0.25, 2.0);
  return style;
}

// The scene in a window, from the sides that the report shows.
class RenderedScene {
 public:
  RenderedScene(const SceneModel& model, OffscreenWindow& window, int width)
      : model_(model), window_(window), width_(width), style_(StyleOf(model, width)), view_(model, style_) {
    view_.AddTo(window_.renderer());
    window_.Render(kSamples * width_, kSamples * height_);  // gives the renderer its size
    const auto has = [&](ScenePath::Kind kind) {
      return std::any_of(model.paths.begin(), model.paths.end(), [&](const auto& p) { return p.kind == kind; });
    };
    lines_ = std::string(" Blue: optimised cameras; ochre: odometry from the first camera on") +
             (has(ScenePath::Kind::kTruth) ? "; black: true poses" : "") +
             (has(ScenePath::Kind::kReference) ? "; vermilion: reference poses." : ".");
    frame_ = " Frame: " + model.frame + (model.on_earth ? " (x east, y north, z up, metres)." : " (metres).");
    if (!model.errors.empty()) errors_ = ErrorsCaption(view_.ErrorScale(), style_.confidence);
  }
  ~RenderedScene() { view_.RemoveFrom(window_.renderer()); }

  // All that is shown at first but `hidden`.
  void Show(std::initializer_list<const char*> hidden) {
    for (const std::string& layer : SceneView::Layers()) view_.SetVisible(layer, SceneView::ShownAtFirst(layer));
    for (const char* layer : hidden) view_.SetVisible(layer, false);
  }

  Figure FromAbove() {
    Show({"points", "cameras"});
    view_.LookDown(window_.renderer());
    const Halos behind(model_, view_, window_.renderer(), kSamples * kHalo_px);
    return {"plan_rendered",
            std::string(model_.on_earth ? "Plan, north up" : "From above") +
                (model_.aerial ? ", over the project's aerial image" : "") + ReferencesCaption(model_) + lines_ +
                errors_ + frame_,
            Photograph(window_, width_, height_), true};
  }

  Figure Oblique(const Colouring& colouring) {
    const bool by_height = colouring.by == PointColour::kHeight;
    Show({"ellipsoids", "geotags"});
    if (!by_height) {
      for (const char* layer : {"aerial", "cameras", "errors", "panoramas"}) view_.SetVisible(layer, false);
    }
    view_.ColourPointsBy(colouring.by);
    view_.LookOblique(window_.renderer());
    const Halos behind(model_, view_, window_.renderer(), kSamples * kHalo_px);
    return {colouring.figure,
            "From the south-west, 33 degrees above the horizon. Points by " + std::string(colouring.text) +
                "; colours from their 2nd to their 95th percentile." +
                (by_height && model_.aerial ? " The height of the ground is estimated from the points." : "") + lines_ +
                frame_,
            Photograph(window_, width_, height_), true};
  }

  Figure AtStation(const std::string& station, size_t number) {
    view_.LookAtStation(window_.renderer(), station);
    return {fmt::format("station_view_{}", number),
            "Station " + station + " with its surroundings: the panorama or photo as it was taken, " +
                (model_.tags.empty() ? "" : "the tag at its real size, ") + "frusta of the cameras." + errors_ + frame_,
            Photograph(window_, width_, height_), true};
  }

 private:
  const SceneModel& model_;
  OffscreenWindow& window_;
  const int width_, height_ = width_ * 2 / 3;
  SceneStyle style_;
  SceneView view_;
  std::string lines_, frame_, errors_;  // of the captions
};

}  // namespace

Scenes DrawScenes(const ReportInput& input, const DisplayUnit& unit, bool images, int width,
                  std::vector<std::string>* notes, std::string* renderer, ProgressSink& progress,
                  const CancelToken& cancel) {
  Scenes scenes;
  std::vector<Block>& blocks = scenes.pictures;
  progress.Begin("the scene", 0);
  SceneOptions options;
  if (!images) options.panorama_width_px = options.aerial_px = 0;
  const SceneModel model = LoadScene(*input.project, options, cancel);
  for (const std::string& note : model.notes) notes->push_back("scene: " + note);
  if (model.Empty()) {
    blocks.push_back(Paragraph{"There is nothing to draw yet: no run has a result."});
    return scenes;
  }
  Plan plan = PlanOf(model, unit);
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
  RenderedScene scene(model, *window, width);
  blocks.push_back(scene.FromAbove());
  cancel.ThrowIfCancelled();
  for (const Colouring& colouring : kColourings) {
    if (colouring.by != PointColour::kHeight && model.points.empty()) break;
    blocks.push_back(scene.Oblique(colouring));
    cancel.ThrowIfCancelled();
  }
  scene.Show({"points", "ellipsoids", "geotags", "axes"});
  const std::vector<std::string> stations = WorstStations(model);
  for (size_t k = 0; k < stations.size(); ++k) {
    blocks.push_back(scene.AtStation(stations[k], k + 1));
    cancel.ThrowIfCancelled();
  }
  return scenes;
}

}  // namespace trigpoint
