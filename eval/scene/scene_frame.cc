// What a scene is measured by: errors and their ellipsoids, ground, axes, north arrow, scale bar, legend.
#include <fmt/format.h>
#include <vtkBillboardTextActor3D.h>
#include <vtkCoordinate.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <set>

#include "eval/scene/scene_parts.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {

// A round number by which errors, and ellipsoids that do not hide the site, are seen; without answers by the tag map.
double SceneView::Parts::ChooseScale(double radius) const {
  if (style.error_scale > 0) return style.error_scale;
  std::vector<double> lengths, radii;
  const auto add_radius = [&](const std::optional<Eigen::Vector3d>& sigma) {
    if (sigma && sigma->allFinite()) radii.push_back(radius * sigma->maxCoeff());
  };
  for (const SceneError& e : model.errors) {
    lengths.push_back(e.difference.norm());
    add_radius(e.sigma_m);
  }
  for (const SceneTag& tag : model.tags) {
    if (model.errors.empty()) add_radius(tag.sigma_m);
  }
  if (lengths.empty() && radii.empty()) return 1;
  double largest = lengths.empty() ? 0 : Quantile(lengths, 0.7);
  if (!radii.empty()) largest = std::max(largest, Quantile(radii, 0.7));
  return std::max(1.0, RoundNumber(0.06 * extent_m / std::max(1e-4, largest)));
}

void SceneView::Parts::BuildErrors() {
  const double radius = std::sqrt(ChiSquareQuantile(style.confidence, 3));  // of an ellipsoid, sigmas
  error_scale = ChooseScale(radius);
  std::map<std::string, std::vector<std::vector<Eigen::Vector3d>>> lines;  // by run
  std::map<std::string, std::vector<Eigen::Vector3d>> tips;
  std::map<std::string, std::vector<Ball>> balls;
  std::set<std::string> with_ellipsoid;
  const bool many = static_cast<int>(model.errors.size()) > style.max_spheres;
  for (const SceneError& e : model.errors) {
    const Eigen::Vector3d tip = e.reference_position + error_scale * e.difference;
    lines[e.run].push_back({e.reference_position, tip});
    tips[e.run].push_back(tip);
    if (!e.sigma_m || !e.sigma_m->allFinite()) continue;
    if (many && !with_ellipsoid.insert(e.panorama).second) continue;  // one for each place
    balls[e.run].push_back({tip, radius * error_scale * *e.sigma_m});
  }
  for (const auto& [run, of_run] : lines) {
    Add("errors", FlatActor(Lines(of_run), kVermilion, 3), run);
    vtkSmartPointer<vtkActor> ends = FlatActor(Dots(tips[run]), kVermilion, 7);
    ends->GetProperty()->SetRenderPointsAsSpheres(true);
    Add("errors", ends, run);
    if (!balls[run].empty()) Add("ellipsoids", SolidActor(Balls(balls[run]), kVermilion, kVeil), run);
  }
}

// Triangles that face up, as on a surveyor's plan, and how far the tag map is off there.
void SceneView::Parts::BuildControl() {
  const double side = 0.35;
  for (const SceneControl& point : model.control) {
    const Eigen::Vector3d& at = point.position;
    const std::vector<Eigen::Vector3d> corners = {at + Eigen::Vector3d(-side, -0.58 * side, 0),
                                                  at + Eigen::Vector3d(side, -0.58 * side, 0),
                                                  at + Eigen::Vector3d(0, 1.15 * side, 0)};
    if (point.role == "control") {
      Add("control", FlatActor(Polygon(corners), kPurple, 1));
    } else {
      Add("control", FlatActor(Lines({{corners[0], corners[1], corners[2], corners[0]}}), kPurple, 3));
    }
    if (point.residual_m) {
      Add("control", FlatActor(Lines({{at, at + error_scale * *point.residual_m}}), kPurple, 3));
    }
  }
}

void SceneView::Parts::BuildEllipsoids() {
  const double k = std::sqrt(ChiSquareQuantile(style.confidence, 3)) * error_scale;
  std::vector<Ball> tags;
  for (const SceneTag& tag : model.tags) {
    if (tag.sigma_m && tag.sigma_m->allFinite()) tags.push_back({tag.world_from_tag.translation, k * *tag.sigma_m});
  }
  if (!tags.empty()) Add("tag ellipsoids", SolidActor(Balls(tags), kGreen, kVeil));
  std::map<std::string, std::vector<Ball>> cameras;  // by run
  const size_t every = 1 + model.cameras.size() / static_cast<size_t>(std::max(1, style.max_spheres));
  for (size_t i = 0; i < model.cameras.size(); i += every) {
    const SceneCamera& c = model.cameras[i];
    if (c.sigma_m && c.sigma_m->allFinite()) cameras[c.run].push_back({c.world_from_cam.translation, k * *c.sigma_m});
  }
  for (const auto& [run, balls] : cameras) {
    Add("camera ellipsoids", SolidActor(Balls(balls), kCameraBlue, kVeil), run);
  }
}

void SceneView::Parts::BuildGround() {
  if (model.aerial) {
    const SceneAerial& a = *model.aerial;
    Add("aerial", TexturedActor(TexturedGrid(a.vertices, a.columns, a.rows), a.picture, false));
  }
  if (model.Empty()) return;
  const auto [low, high] = model.Bounds();
  const double z = model.ground_z + 0.02;
  const double margin = 0.03 * extent_m + 0.5;
  BuildScaleBar();
  const Eigen::Vector3d corner(low.x(), low.y() - margin, z);
  // Axes beside it; in site ENU they are east, north, up.
  const double arm = 0.09 * extent_m;
  const Eigen::Vector3d origin(corner.x() + 1.25 * ScaleBarLength(), corner.y(), z);
  const char* names[] = {model.on_earth ? "E" : "x", model.on_earth ? "N" : "y", model.on_earth ? "U" : "z"};
  const Colour colours[] = {kVermilion, kGreen, kBlue};
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d d = Eigen::Vector3d::Unit(k);
    Add("axes", FlatActor(Lines({{origin, origin + arm * d}}), colours[k], 4));
    AddLabel("axes", Label(names[k], origin + 1.1 * arm * d, 0.9 * style.text_px));
  }
  if (!model.on_earth) return;
  const Eigen::Vector3d foot(high.x() + 0.2 * margin, high.y() - 1.6 * arm, z);
  const Eigen::Vector3d north = Eigen::Vector3d::UnitY(), wide = 0.3 * arm * Eigen::Vector3d::UnitX();
  // Two halves, dark and light, as on a chart.
  Add("axes", FlatActor(Polygon({foot - wide, foot + 0.35 * arm * north, foot + 1.6 * arm * north}), kBlack, 1));
  Add("axes", FlatActor(Polygon({foot + wide, foot + 1.6 * arm * north, foot + 0.35 * arm * north}), kWhite, 1));
  Add("axes",
      FlatActor(Lines({{foot + wide, foot + 1.6 * arm * north, foot + 0.35 * arm * north, foot + wide}}), kBlack, 2));
  AddLabel("axes", Label("N", foot + Eigen::Vector3d(0, 1.65 * arm, 0), 1.2 * style.text_px));
}

double SceneView::Parts::ScaleBarLength() const { return RoundNumber(0.3 * extent_m / unit.metres) * unit.metres; }

// Along the southern edge: four parts, dark and light, framed to be seen on any ground.
void SceneView::Parts::BuildScaleBar() {
  if (model.Empty()) return;
  auto& axes = layers["axes"];
  for (const auto& prop : scale_bar) {
    if (renderer != nullptr) {
      prop->ReleaseGraphicsResources(renderer->GetVTKWindow());
      renderer->RemoveViewProp(prop);
    }
    std::erase(axes, prop);
    std::erase_if(labels, [&](const auto& label) { return label.Get() == prop.Get(); });
  }
  const size_t before = axes.size();
  const auto [low, high] = model.Bounds();
  const double z = model.ground_z + 0.02, margin = 0.03 * extent_m + 0.5;
  const double length = ScaleBarLength(), height = 0.012 * extent_m;
  const Eigen::Vector3d corner(low.x(), low.y() - margin, z);
  for (int part = 0; part < 4; ++part) {
    const double x = corner.x() + 0.25 * part * length;
    Add("axes", FlatActor(Polygon({{x, corner.y(), z},
                                   {x + 0.25 * length, corner.y(), z},
                                   {x + 0.25 * length, corner.y() + height, z},
                                   {x, corner.y() + height, z}}),
                          part % 2 == 0 ? kBlack : kWhite, 1));
  }
  Add("axes",
      FlatActor(Lines({{corner, corner + Eigen::Vector3d(length, 0, 0), corner + Eigen::Vector3d(length, height, 0),
                        corner + Eigen::Vector3d(0, height, 0), corner}}),
                kBlack, 2));
  AddLabel("axes", Label(ShortNumber(length / unit.metres) + " " + unit.name,
                         corner + Eigen::Vector3d(length, 1.2 * height, 0), style.text_px));
  scale_bar.assign(axes.begin() + static_cast<std::ptrdiff_t>(before), axes.end());
  for (const auto& prop : scale_bar) {
    prop->SetVisibility(visible["axes"]);
    if (renderer != nullptr) renderer->AddViewProp(prop);
  }
}

void SceneView::Parts::BuildLegend() {
  const auto add = [&](const char* layer, const std::string& text, const Colour& colour) {
    if (layers.count(layer) == 0) return;
    const auto line = vtkSmartPointer<vtkTextActor>::New();
    line->SetInput(fmt::format(" {} ", Words(text)).c_str());
    line->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
    // Dark words in a frame of the colour: not every colour is read as text on white.
    StyleText(line->GetTextProperty(), 0.85 * style.text_px, kBlack);
    line->GetTextProperty()->FrameOn();
    line->GetTextProperty()->SetFrameWidth(std::max(2, static_cast<int>(std::lround(0.16 * style.text_px))));
    line->GetTextProperty()->SetFrameColor(colour[0], colour[1], colour[2]);
    line->GetTextProperty()->SetVerticalJustificationToTop();
    Add("legend", line);
    legend.emplace_back(layer, line);
  };
  add("optimised", "cameras, optimised", kBlue);
  add("odometry", "odometry, begun at the first camera", kOrange);
  for (const auto& [kind, colour] :
       {std::pair(ScenePath::Kind::kTruth, kBlack), std::pair(ScenePath::Kind::kReference, kVermilion)}) {
    std::set<std::string> sources;
    for (const ScenePath& path : model.paths) {
      if (path.kind == kind) sources.insert(path.source);
    }
    for (const std::string& name : sources) add(LayerOf(kind), name, colour);
  }
  add("estimates", "other systems, fitted rigidly", kPurple);
  add("geotags", "geotags of panoramas", kSky);
  add("errors",
      fmt::format("errors x {}", ShortNumber(error_scale)) + (model.comparison.empty() ? "" : ": " + model.comparison),
      kVermilion);
  const std::string scale = fmt::format(", {:.0f} %, x {}", 100 * style.confidence, ShortNumber(error_scale));
  add("ellipsoids", "ellipsoids of errors" + scale, kVermilion);
  add("gps", "GPS", kGreen);
  const bool off =
      std::any_of(model.control.begin(), model.control.end(), [](const auto& c) { return !!c.residual_m; });
  add("control",
      "control (full), check (open)" + (off ? fmt::format("; map minus stated x {}", ShortNumber(error_scale)) : ""),
      kPurple);
  add("tag ellipsoids", "ellipsoids of tags" + scale, kGreen);
  add("camera ellipsoids", "ellipsoids of cameras" + scale, kCameraBlue);
  PlaceLegend();
}

void SceneView::Parts::PlaceLegend() {
  double y = 0.98;
  for (const auto& [layer, line] : legend) {
    line->SetVisibility(visible["legend"] && visible[layer]);
    if (!visible[layer]) continue;
    line->SetPosition(0.012, y);
    y -= 0.04;
  }
}

}  // namespace trigpoint
