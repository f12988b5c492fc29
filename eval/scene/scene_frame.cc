// What a scene is measured by: errors and their ellipsoids, ground, axes, north arrow, scale bar, legend.
#include <fmt/format.h>
#include <vtkBillboardTextActor3D.h>
#include <vtkCoordinate.h>
#include <vtkMatrix4x4.h>
#include <vtkNew.h>
#include <vtkPolyDataNormals.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkSphereSource.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>

#include <set>

#include "eval/scene/scene_parts.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
void SceneView::Parts::BuildErrors() {
  if (model.errors.empty()) return;
  const double radius = std::sqrt(ChiSquareQuantile(style.confidence, 3));  // of an ellipsoid, sigmas
  std::vector<double> lengths, radii;
  for (const SceneError& e : model.errors) {
    lengths.push_back(e.difference.norm());
    if (e.sigma_m && e.sigma_m->allFinite()) radii.push_back(radius * e.sigma_m->maxCoeff());
  }
  if (style.error_scale > 0) {
    error_scale = style.error_scale;
  } else {
    // Errors that are seen, in ellipsoids that do not hide the site.
    double largest = Quantile(lengths, 0.7);
    if (!radii.empty()) largest = std::max(largest, Quantile(radii, 0.7));
    error_scale = std::max(1.0, RoundNumber(0.06 * extent_m / std::max(1e-4, largest)));
  }
  const double k = radius * error_scale;
  std::vector<std::vector<Eigen::Vector3d>> lines;
  std::vector<Eigen::Vector3d> tips;
  std::set<std::string> with_ellipsoid;
  const bool many = static_cast<int>(model.errors.size()) > style.max_spheres;
  for (const SceneError& e : model.errors) {
    const Eigen::Vector3d tip = e.reference_position + error_scale * e.difference;
    lines.push_back({e.reference_position, tip});
    tips.push_back(tip);
    if (!e.sigma_m || !e.sigma_m->allFinite()) continue;
    if (many && !with_ellipsoid.insert(e.panorama).second) continue;  // one for each place
    vtkNew<vtkSphereSource> ball;
    ball->SetThetaResolution(24);
    ball->SetPhiResolution(16);
    ball->Update();
    vtkSmartPointer<vtkActor> actor = SolidActor(ball->GetOutput(), kVermilion, kVeil);
    actor->SetPosition(tip.x(), tip.y(), tip.z());
    const Eigen::Vector3d size = (2 * k * e.sigma_m->array()).max(1e-3);  // the source's diameter is 1
    actor->SetScale(size.x(), size.y(), size.z());
    Add("ellipsoids", actor);
  }
  Add("errors", FlatActor(Lines(lines), kVermilion, 3));
  vtkSmartPointer<vtkActor> ends = FlatActor(Dots(tips), kVermilion, 7);
  ends->GetProperty()->SetRenderPointsAsSpheres(true);
  Add("errors", ends);
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
    line->SetInput((" " + text + " ").c_str());
    line->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
    StyleText(line->GetTextProperty(), 0.85 * style.text_px, colour);
    line->GetTextProperty()->BoldOn();
    line->GetTextProperty()->SetVerticalJustificationToTop();
    Add("legend", line);
    legend.emplace_back(layer, line);
  };
  add("optimised", "cameras, optimised", kBlue);
  add("odometry", "odometry, begun at the first camera", kOrange);
  std::set<std::string> truths;
  for (const ScenePath& path : model.paths) {
    if (path.kind == ScenePath::Kind::kTruth) truths.insert(path.source);
  }
  for (const std::string& name : truths) add("truth", name, kBlack);
  add("estimates", "other systems, fitted rigidly", kPurple);
  add("geotags", "geotags of panoramas", kSky);
  add("errors", fmt::format("errors x {}", ShortNumber(error_scale)), kVermilion);
  add("ellipsoids",
      fmt::format("ellipsoids of errors, {:.0f} %, x {}", 100 * style.confidence, ShortNumber(error_scale)),
      kVermilion);
  PlaceLegend();
}

void SceneView::Parts::PlaceLegend() {
  double y = 0.985;
  for (const auto& [layer, line] : legend) {
    line->SetVisibility(visible["legend"] && visible[layer]);
    if (!visible[layer]) continue;
    line->SetPosition(0.012, y);
    y -= 0.034;
  }
}

}  // namespace trigpoint
