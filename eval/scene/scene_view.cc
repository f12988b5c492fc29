#include "eval/scene/scene_view.h"

#include <fmt/format.h>
#include <vtkCamera.h>
#include <vtkCoordinate.h>
#include <vtkMatrix4x4.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkTextProperty.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "eval/scene/scene_parts.h"
#include "eval/text/method_name.h"

namespace trigpoint {
namespace {

constexpr double kPickRadiusPx = 5;
constexpr size_t kLabelsAtOnce = 80;  // more are not read, and cost as much as the scene

// Says what an entry of the model is, lengths in one unit.
class Words {
 public:
  explicit Words(const DisplayUnit& unit) : unit_(unit) {}

  std::string Length(double metres) const { return fmt::format("{:.3f} {}", metres / unit_.metres, unit_.name); }
  std::string Place(const Eigen::Vector3d& p) const {
    return fmt::format("{:.3f} {:.3f} ", p.x() / unit_.metres, p.y() / unit_.metres) + Length(p.z());
  }
  std::string Sigma(const std::optional<Eigen::Vector3d>& sigma) const {
    return sigma ? "; 1 sigma " + Place(*sigma) + " (x, y, z)" : "; sigma not known";
  }

 private:
  DisplayUnit unit_;
};

// Fills in names and the line of text of a pick in one of the model's vectors.
void FillIn(const SceneModel& model, const Words& say, ScenePick* pick) {
  const auto i = static_cast<size_t>(pick->index);
  const std::string& layer = pick->layer;
  if (layer == "points") {
    const ScenePoint& p = model.points[i];
    pick->run = model.runs[static_cast<size_t>(p.run)];
    pick->name = std::to_string(p.id);
    pick->position = p.position;
    pick->text = fmt::format("point {} of {} at {}, seen by {}, 1 sigma {} (largest axis, cameras held)", p.id,
                             pick->run, say.Place(p.position), Counted(p.track_length, "image"), say.Length(p.sigma_m));
    if (std::isfinite(p.residual_px)) pick->text += fmt::format(", residual {:.2f} px", p.residual_px);
  } else if (layer == "cameras") {
    const SceneCamera& c = model.cameras[i];
    pick->run = c.run, pick->name = c.image;
    pick->position = c.world_from_cam.translation;
    pick->sigma_m = c.sigma_m;
    pick->text = c.run + " " + c.image + " at " + say.Place(pick->position) + say.Sigma(c.sigma_m);
  } else if (layer == "panoramas" || layer == "geotags") {
    const ScenePanorama& p = model.panoramas[i];
    pick->run = p.run, pick->name = p.panorama;
    if (layer == "geotags") {
      if (!p.geotag) throw InputError(p.panorama + " has no geotag");
      pick->position = *p.geotag;
      pick->text = "geotag of " + p.panorama + " at " + say.Place(*p.geotag);
    } else {
      pick->position = p.world_from_pano.translation;
      pick->sigma_m = p.sigma_m;
      pick->text = p.panorama + " by " + p.run + " at " + say.Place(pick->position) + say.Sigma(p.sigma_m);
    }
  } else if (layer == "tags") {
    const SceneTag& t = model.tags[i];
    pick->name = std::to_string(t.id);
    pick->position = t.world_from_tag.translation;
    pick->sigma_m = t.sigma_m;
    pick->text = fmt::format("tag {} ({} wide, {}) from {} at ", t.id, say.Length(t.size_m), t.family, t.source) +
                 say.Place(pick->position) + say.Sigma(t.sigma_m);
  } else if (layer == "control") {
    const SceneControl& c = model.control[i];
    pick->name = c.name;
    pick->position = c.position;
    pick->sigma_m = c.sigma_m;
    pick->text = c.role + " point " + c.name + " at " + say.Place(c.position) + say.Sigma(pick->sigma_m);
    if (c.residual_m) {
      pick->text += "; map minus stated " + say.Length(c.residual_m->norm()) + " = " + say.Place(*c.residual_m);
    }
  } else if (layer == "errors" || layer == "ellipsoids") {
    const SceneError& e = model.errors[i];
    pick->run = e.run, pick->name = e.panorama;
    pick->position = e.reference_position;
    pick->text = fmt::format("{} by {} ({}) against {}: error ", e.panorama, e.run, MethodName(e.method), e.reference) +
                 say.Length(e.difference.norm()) + " = " + say.Place(e.difference) + say.Sigma(e.sigma_m);
  } else {
    const ScenePath& path = model.paths[i];
    pick->run = path.run, pick->name = path.source;
    pick->text = path.source + " of " + path.run;
  }
}

// Of the place that was hit, which isn't always that of the thing.
void TakeDrawnPlace(const SceneModel& model, ScenePick* pick) {
  if (pick->layer != "errors") {
    pick->position = pick->drawn_at;  // of a path its nearest pose
  } else if (pick->drawn_at != pick->position) {
    pick->position += model.errors[static_cast<size_t>(pick->index)].difference;  // its tip, not enlarged
  }
}

// Where things are drawn, by the renderer's camera alone: no picture is needed, so that it works everywhere.
class Projector {
 public:
  explicit Projector(vtkRenderer* renderer) {
    const int* size = renderer->GetSize();
    const int* origin = renderer->GetOrigin();
    half_ = {0.5 * size[0], 0.5 * size[1]};
    middle_ = Eigen::Vector2d(origin[0], origin[1]) + half_;
    const vtkMatrix4x4* m =
        renderer->GetActiveCamera()->GetCompositeProjectionTransformMatrix(renderer->GetTiledAspectRatio(), -1, 1);
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) matrix_(r, c) = m->GetElement(r, c);
    }
  }
  // Display x, y and depth; nothing for what lies outside the picture's depth.
  std::optional<Eigen::Vector3d> operator()(const Eigen::Vector3d& p) const {
    const Eigen::Vector4d clip = matrix_ * p.homogeneous();
    if (!(clip.w() > 0) || std::abs(clip.z()) > clip.w()) return std::nullopt;
    const Eigen::Vector3d d = clip.hnormalized();
    return Eigen::Vector3d(middle_.x() + half_.x() * d.x(), middle_.y() + half_.y() * d.y(), d.z());
  }
  // Pixels a metre at p, across the line of sight.
  double PixelsPerMetre(const Eigen::Vector3d& p) const {
    const auto at = (*this)(p);
    double most = 0;
    for (int k = 0; at && k < 3; ++k) {
      if (const auto beside = (*this)(p + Eigen::Vector3d::Unit(k)))
        most = std::max(most, (*beside - *at).head<2>().norm());
    }
    return most;
  }

 private:
  Eigen::Matrix4d matrix_;
  Eigen::Vector2d half_, middle_;
};

}  // namespace

double RoundNumber(double value) {
  if (!(value > 0) || !std::isfinite(value)) return 1;
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  const double lead = value / decade;
  return decade * (lead >= 5 ? 5 : lead >= 2 ? 2 : 1);
}

std::string ShortNumber(double value) { return fmt::format("{:g}", value); }

void SceneView::Parts::Add(const std::string& layer, vtkProp* prop, const std::string& run) {
  layers[layer].emplace_back(prop);
  if (!run.empty()) run_of[prop] = run;
  Fade(layer, prop);
}

bool SceneView::Parts::IsOfHiddenRun(const vtkProp* prop) const {
  const auto run = run_of.find(prop);
  return run != run_of.end() && hidden_runs.count(run->second) > 0;
}

void SceneView::Parts::Fade(const std::string& layer, vtkProp* prop) const {
  const auto set = opacities.find(layer);
  if (set == opacities.end()) return;
  if (auto* actor = vtkActor::SafeDownCast(prop)) {
    // Ellipsoids are translucent already.
    actor->GetProperty()->SetOpacity(layer.ends_with("ellipsoids") ? kVeil * set->second : set->second);
  } else if (auto* label = vtkBillboardTextActor3D::SafeDownCast(prop)) {
    FadeText(label->GetTextProperty(), set->second);
  } else if (auto* line = vtkTextActor::SafeDownCast(prop)) {
    FadeText(line->GetTextProperty(), set->second);
  }
}

void SceneView::Parts::ShowLayer(const std::string& layer) {
  // A single translucent thing costs three pictures of the window's size and their sum.
  const bool drawn = visible[layer] && !(moving && layer.ends_with("ellipsoids"));
  for (const auto& prop : layers[layer]) {
    const bool is_bar = prop == points_bar || prop == bar_title;
    const bool no_bar = is_bar && points_by == PointColour::kPicture;  // it has no scale
    prop->SetVisibility(drawn && !no_bar && !IsOfHiddenRun(prop));
  }
}

void SceneView::Parts::AddLabel(const std::string& layer, vtkBillboardTextActor3D* label) {
  labels.emplace_back(label);
  Add(layer, label);
}

SceneView::SceneView(const SceneModel& model, const SceneStyle& style) : parts_(std::make_unique<Parts>(model, style)) {
  const auto [low, high] = model.Bounds();
  parts_->extent_m = std::max(2.0, (high - low).head<2>().maxCoeff());
  for (const std::string& layer : Layers()) parts_->visible[layer] = ShownAtFirst(layer);
  parts_->BuildGround();
  parts_->BuildPaths();
  parts_->BuildPoints();
  parts_->BuildCameras();
  parts_->BuildPanoramas();
  parts_->BuildTags();
  parts_->BuildErrors();
  parts_->BuildControl();
  parts_->BuildEllipsoids();
  parts_->BuildLegend();
  for (const std::string& layer : Layers()) parts_->ShowLayer(layer);
  parts_->PlaceLegend();
}

SceneView::~SceneView() = default;

const std::vector<std::string>& SceneView::Layers() {
  static const std::vector<std::string> kLayers = {
      "aerial",     "odometry",       "optimised",         "truth",   "reference", "estimates", "gps",
      "points",     "cameras",        "panoramas",         "geotags", "tags",      "control",   "errors",
      "ellipsoids", "tag ellipsoids", "camera ellipsoids", "labels",  "axes",      "legend"};
  return kLayers;
}

bool SceneView::ShownAtFirst(const std::string& layer) {
  return layer != "gps" && layer != "tag ellipsoids" && layer != "camera ellipsoids";
}

bool SceneView::HasContent(const std::string& layer) const {
  const auto it = parts_->layers.find(layer);
  return it != parts_->layers.end() && !it->second.empty();
}

void SceneView::SetVisible(const std::string& layer, bool visible) {
  const auto it = parts_->visible.find(layer);
  if (it == parts_->visible.end()) {
    throw OptionError("unknown layer '" + layer + "'; nearest known one: '" + NearestName(layer, Layers()) + "'");
  }
  it->second = visible;
  parts_->ShowLayer(layer);
  parts_->PlaceLegend();
}

void SceneView::SetRunVisible(const std::string& run, bool visible) {
  if (visible == (parts_->hidden_runs.count(run) == 0)) return;
  if (visible) {
    parts_->hidden_runs.erase(run);
  } else {
    parts_->hidden_runs.insert(run);
  }
  parts_->PlaceStationLabels();
  for (const std::string& layer : Layers()) parts_->ShowLayer(layer);
  parts_->PlaceLegend();
  parts_->ChoosePoints();
}

void SceneView::SetOpacity(const std::string& layer, double opacity) {
  if (parts_->visible.count(layer) == 0) {
    throw OptionError("unknown layer '" + layer + "'; nearest known one: '" + NearestName(layer, Layers()) + "'");
  }
  parts_->opacities[layer] = opacity;
  for (const auto& prop : parts_->layers[layer]) parts_->Fade(layer, prop);
}

void SceneView::SetPointSize(double pixels) {
  if (parts_->points) parts_->points->GetProperty()->SetPointSize(static_cast<float>(pixels));
}

std::string SceneView::ColourOfLayer(const std::string& layer) {
  static const std::map<std::string, Colour> kColours = {{"odometry", kOrange},
                                                         {"optimised", kBlue},
                                                         {"truth", kBlack},
                                                         {"reference", kVermilion},
                                                         {"estimates", kPurple},
                                                         {"geotags", kSky},
                                                         {"errors", kVermilion},
                                                         {"ellipsoids", kVermilion},
                                                         {"cameras", kCameraBlue},
                                                         {"panoramas", kBlue},
                                                         {"gps", kGreen},
                                                         {"control", kPurple},
                                                         {"tag ellipsoids", kGreen},
                                                         {"camera ellipsoids", kCameraBlue}};
  const auto it = kColours.find(layer);
  if (it == kColours.end()) return "";
  const auto byte = [&](size_t k) { return static_cast<int>(std::lround(255 * it->second[k])); };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(0), byte(1), byte(2));
}

bool SceneView::Visible(const std::string& layer) const {
  const auto it = parts_->visible.find(layer);
  return it != parts_->visible.end() && it->second;
}

void SceneView::AddTo(vtkRenderer* renderer) {
  for (const auto& [layer, props] : parts_->layers) {
    for (const auto& prop : props) renderer->AddViewProp(prop);
  }
  renderer->SetBackground(1, 1, 1);
  parts_->renderer = renderer;
}

void SceneView::RemoveFrom(vtkRenderer* renderer) {
  parts_->renderer = nullptr;
  for (const auto& [layer, props] : parts_->layers) {
    for (const auto& prop : props) {
      prop->ReleaseGraphicsResources(renderer->GetVTKWindow());
      renderer->RemoveViewProp(prop);
    }
  }
  // Of the two that draw the points the actor releases only the one it holds.
  for (const auto& mapper : {parts_->all_points, parts_->few_points}) {
    if (mapper) mapper->ReleaseGraphicsResources(renderer->GetVTKWindow());
  }
}

void SceneView::ColourPointsBy(PointColour colour, bool by_rank) {
  if (parts_->points_by == colour && parts_->by_rank == by_rank) return;
  parts_->points_by = colour;
  parts_->by_rank = by_rank;
  parts_->ColourPoints();
}

void SceneView::FilterPoints(const PointFilter& filter) {
  if (parts_->filter == filter) return;
  parts_->filter = filter;
  parts_->ChoosePoints();
}

size_t SceneView::PointsShown() const { return parts_->shown.size(); }

size_t SceneView::PointsDrawn() const {
  if (!parts_->points) return 0;
  auto* mapper = static_cast<vtkPolyDataMapper*>(parts_->points->GetMapper());
  return static_cast<size_t>(mapper->GetInput()->GetNumberOfPoints());
}

void SceneView::SetPointRgb(std::vector<std::array<uint8_t, 3>> rgb) {
  parts_->rgb = std::move(rgb);
  parts_->ColourPoints();
}

std::vector<Eigen::AlignedBox2d> SceneView::LegendBoxes(vtkRenderer* renderer) const {
  std::vector<Eigen::AlignedBox2d> boxes;
  for (const auto& [layer, line] : parts_->legend) {
    if (line->GetVisibility() == 0) continue;
    double box[4];  // about its position
    line->GetBoundingBox(renderer, box);
    const int* at = line->GetPositionCoordinate()->GetComputedDisplayValue(renderer);
    boxes.emplace_back(Eigen::Vector2d(at[0] + box[0], at[1] + box[2]),
                       Eigen::Vector2d(at[0] + box[1], at[1] + box[3]));
  }
  return boxes;
}

void SceneView::MakeRoomForLabels(vtkRenderer* renderer) const {
  parts_->PlaceBar(renderer);
  const Projector project(renderer);
  const bool shown = Visible("labels");
  std::vector<Eigen::AlignedBox2d> taken = LegendBoxes(renderer);
  const size_t most = taken.size() + kLabelsAtOnce;
  for (const auto& prop : parts_->layers["labels"]) {
    auto* label = vtkBillboardTextActor3D::SafeDownCast(prop);
    if (label == nullptr || !shown || parts_->IsOfHiddenRun(label)) continue;
    const auto at = project(Eigen::Vector3d(label->GetPosition()));
    const double height = label->GetTextProperty()->GetFontSize();
    const double half = 0.3 * height * static_cast<double>(std::strlen(label->GetInput())) + 2;
    bool room = at.has_value() && taken.size() < most;
    if (room) {
      const int* offset = label->GetDisplayOffset();
      const Eigen::Vector2d middle = at->head<2>() + Eigen::Vector2d(offset[0], offset[1]);
      const Eigen::AlignedBox2d box(middle - Eigen::Vector2d(half, 0.7 * height),
                                    middle + Eigen::Vector2d(half, 0.7 * height));
      room = std::none_of(taken.begin(), taken.end(), [&](const auto& other) { return other.intersects(box); });
      if (room) taken.push_back(box);
    }
    label->SetVisibility(room);
  }
}

void SceneView::DrawMoving(bool moving) {
  parts_->moving = moving;
  parts_->ThinPoints(moving ? kMovingPoints : 0);
  for (const char* layer : {"ellipsoids", "tag ellipsoids", "camera ellipsoids"}) parts_->ShowLayer(layer);
  for (const auto& label : parts_->labels) label->SetForceOpaque(moving);
}

double SceneView::ErrorScale() const { return parts_->error_scale; }

std::optional<std::array<double, 2>> SceneView::HeightsOfColours() const {
  if (parts_->shown.empty() || parts_->by_rank || parts_->points_by != PointColour::kHeight) return std::nullopt;
  return std::array{parts_->lowest * parts_->unit.metres, parts_->highest * parts_->unit.metres};
}

void SceneView::LookDown(vtkRenderer* renderer) const {
  auto [low, high] = parts_->model.Bounds();
  const Eigen::Vector3d middle = 0.5 * (low + high);
  const double margin = 0.08 * parts_->extent_m + 1;
  const int* size = renderer->GetSize();
  const double aspect = size[1] > 0 ? static_cast<double>(size[0]) / size[1] : 1.5;
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetFocalPoint(middle.x(), middle.y(), middle.z());
  camera->SetPosition(middle.x(), middle.y(), middle.z() + 500);
  camera->SetViewUp(0, 1, 0);
  camera->SetParallelScale(
      std::max(0.5 * (high.y() - low.y()) + margin, (0.5 * (high.x() - low.x()) + margin) / aspect));
  renderer->ResetCameraClippingRange();
}

namespace {

void LookFrom(const Eigen::Vector3d& from, const Eigen::Vector3d& at, double angle_deg, vtkRenderer* renderer) {
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOff();
  camera->SetViewAngle(angle_deg);
  camera->SetFocalPoint(at.x(), at.y(), at.z());
  camera->SetPosition(from.x(), from.y(), from.z());
  camera->SetViewUp(0, 0, 1);
  renderer->ResetCameraClippingRange();
}

}  // namespace

void SceneView::LookOblique(vtkRenderer* renderer) const {
  auto [low, high] = parts_->model.Bounds();
  const Eigen::Vector3d middle = 0.5 * (low + high);
  // So far away that a ball about the box fits into the picture's lower side.
  const double radius = std::max(2.0, 0.5 * (high - low).norm());
  const double angle_deg = 35;
  const int* size = renderer->GetSize();
  const double aspect = size[0] > 0 && size[1] > 0 ? static_cast<double>(size[0]) / size[1] : 1.5;
  const double distance = 0.8 * std::max(1.0, 1.5 / aspect) * radius / std::sin(0.5 * angle_deg * 3.14159265 / 180);
  const Eigen::Vector3d from = middle + distance * Eigen::Vector3d(-0.42, -0.72, 0.55).normalized();
  LookFrom(from, middle, angle_deg, renderer);
}

void SceneView::LookAtStation(vtkRenderer* renderer, const std::string& station) const {
  std::vector<std::string> names;
  for (const ScenePanorama& panorama : parts_->model.panoramas) {
    names.push_back(panorama.station);
    if (panorama.station != station) continue;
    const Eigen::Vector3d at = panorama.world_from_pano.translation;
    // From the side on which the nearest camera of the run is.
    Eigen::Vector3d side(-1, -1, 0);
    double nearest = std::numeric_limits<double>::max();
    for (const SceneCamera& camera : parts_->model.cameras) {
      const Eigen::Vector3d d = camera.world_from_cam.translation - at;
      if (camera.run != panorama.run || d.norm() >= nearest || d.head<2>().norm() < 0.1) continue;
      nearest = d.norm();
      side = d;
    }
    side.z() = 0;
    const Eigen::Vector3d from = at + 9 * side.normalized() + Eigen::Vector3d(0, 0, 4);
    return LookFrom(from, {at.x(), at.y(), at.z() - 0.5}, 40, renderer);
  }
  throw InputError("no answer for station '" + station + "' is in the scene" +
                   (names.empty() ? "" : "; nearest: '" + NearestName(station, names) + "'"));
}

std::optional<ScenePick> SceneView::Pick(vtkRenderer* renderer, double x, double y) const {
  const SceneModel& model = parts_->model;
  const Projector project(renderer);
  const Eigen::Vector2d pixel(x, y);
  std::optional<ScenePick> best;
  double best_depth = 0;
  // A hit: within the object's drawn size or a few pixels of it. The nearest to the eye wins within a layer.
  const auto offer = [&](const char* layer, size_t index, const Eigen::Vector3d& p, double radius_m) {
    const auto d = project(p);
    if (!d || (d->head<2>() - pixel).norm() > 400) return;
    const double radius_px = std::max(kPickRadiusPx, radius_m > 0 ? radius_m * project.PixelsPerMetre(p) : 0);
    if ((d->head<2>() - pixel).norm() > radius_px || (best && d->z() >= best_depth)) return;
    best = ScenePick{layer, static_cast<int>(index)};
    best->position = p;
    best_depth = d->z();
  };
  const auto hidden = [&](const std::string& run) { return parts_->hidden_runs.count(run) > 0; };
  // Of one layer: the nearest of its items, where `at` has a place for them.
  const auto offer_all = [&](const char* layer, const auto& items, const auto& at, const auto& radius_m) {
    if (best || !Visible(layer)) return;
    for (size_t i = 0; i < items.size(); ++i) {
      if (const std::optional<Eigen::Vector3d> p = at(items[i])) offer(layer, i, *p, radius_m(items[i]));
    }
  };
  const auto small = [](const auto&) { return 0.0; };
  using Place = std::optional<Eigen::Vector3d>;
  const auto where = [&](const std::string& run, const Eigen::Vector3d& p) { return hidden(run) ? Place() : Place(p); };
  // Small objects come first, so that a tag among points can be picked.
  offer_all(
      "tags", model.tags, [](const auto& t) { return Place(t.world_from_tag.translation); },
      [](const auto& t) { return 0.5 * t.pattern_size_m; });
  offer_all(
      "panoramas", model.panoramas, [&](const auto& p) { return where(p.run, p.world_from_pano.translation); },
      [&](const auto& p) { return p.texture.empty() ? 0 : parts_->style.sphere_radius_m; });
  offer_all(
      "control", model.control, [](const auto& c) { return Place(c.position); }, small);
  offer_all(
      "geotags", model.panoramas, [&](const auto& p) { return hidden(p.run) ? Place() : Place(p.geotag); }, small);
  offer_all(
      "errors", model.errors,
      [&](const auto& e) { return where(e.run, e.reference_position + parts_->error_scale * e.difference); }, small);
  offer_all(
      "errors", model.errors, [&](const auto& e) { return where(e.run, e.reference_position); }, small);
  offer_all(
      "cameras", model.cameras, [&](const auto& c) { return where(c.run, c.world_from_cam.translation); }, small);
  for (size_t i = 0; !best && i < model.paths.size(); ++i) {
    const char* layer = LayerOf(model.paths[i].kind);
    if (!Visible(layer) || hidden(model.paths[i].run)) continue;
    for (const TimedPose& pose : model.paths[i].poses) offer(layer, i, pose.target_from_body.translation, 0);
  }
  if (!best && Visible("points")) {
    for (const size_t i : parts_->shown) offer("points", i, model.points[i].position, 0);
  }
  if (!best) return best;
  best->drawn_at = best->position;
  FillIn(model, Words(parts_->unit), &*best);
  TakeDrawnPlace(model, &*best);
  return best;
}

ScenePick SceneView::Describe(const std::string& layer, int index) const {
  const SceneModel& m = parts_->model;
  size_t size = m.paths.size();
  if (layer == "points") size = m.points.size();
  if (layer == "cameras") size = m.cameras.size();
  if (layer == "panoramas" || layer == "geotags") size = m.panoramas.size();
  if (layer == "tags") size = m.tags.size();
  if (layer == "control") size = m.control.size();
  if (layer == "errors" || layer == "ellipsoids") size = m.errors.size();
  if (index < 0 || static_cast<size_t>(index) >= size) {
    throw InputError(fmt::format("layer {} has {} entries, none with index {}", layer, size, index));
  }
  ScenePick pick{layer, index};
  FillIn(m, Words(parts_->unit), &pick);
  pick.drawn_at = pick.position;
  return pick;
}

void SceneView::SetUnit(const DisplayUnit& unit) {
  const bool same = unit.name == parts_->unit.name;
  parts_->unit = unit;
  if (same) return;
  parts_->BuildScaleBar();
  parts_->ColourPoints();
}

}  // namespace trigpoint
