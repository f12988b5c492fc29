// Paths, points, cameras, panoramas and tags.
#include <vtkBillboardTextActor3D.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkProperty2D.h>
#include <vtkRenderer.h>
#include <vtkScalarBarActor.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "eval/scene/scene_parts.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

// The bar of the points' colours, in heights of the scene's text: its texts are smaller than others, and its numbers
// are as wide as "0.00123".
constexpr double kBarText = 0.8, kBarColours_text = 1.2, kBarNumbers_text = 3.4, kBarHeight_text = 12;
constexpr double kBarRight = 0.985, kBarBottom = 0.04;  // shares of the picture
constexpr double kBarShare = 0.36;                      // of the picture's height, at most

Colour ColourOf(ScenePath::Kind kind) {
  switch (kind) {
    case ScenePath::Kind::kOdometry: return kOrange;
    case ScenePath::Kind::kOptimised: return kBlue;
    case ScenePath::Kind::kTruth: return kBlack;
    case ScenePath::Kind::kReference: return kVermilion;
    case ScenePath::Kind::kEstimate: return kPurple;
    case ScenePath::Kind::kGps: return kGreen;
  }
  return kBlack;
}

// Directions of an equirectangular picture, row by row: a pixel stands in the direction in which it was taken.
std::vector<Eigen::Vector3d> Sphere(const Rigid3d& world_from_pano, double radius, int columns, int rows) {
  std::vector<Eigen::Vector3d> vertices;
  for (int r = 0; r < rows; ++r) {
    const double latitude = std::numbers::pi * (0.5 - static_cast<double>(r) / (rows - 1));
    for (int c = 0; c < columns; ++c) {
      const double longitude = 2 * std::numbers::pi * (static_cast<double>(c) / (columns - 1) - 0.5);
      const Eigen::Vector3d d(std::sin(longitude) * std::cos(latitude), -std::sin(latitude),
                              std::cos(longitude) * std::cos(latitude));
      vertices.push_back(world_from_pano * (radius * d));
    }
  }
  return vertices;
}

// Viridis, which stays readable in grey and to colour-blind eyes.
vtkSmartPointer<vtkLookupTable> Viridis(double low, double high) {
  static constexpr double kAnchors[][3] = {{0.267, 0.005, 0.329}, {0.275, 0.195, 0.496}, {0.213, 0.359, 0.552},
                                           {0.153, 0.497, 0.558}, {0.122, 0.632, 0.531}, {0.290, 0.758, 0.428},
                                           {0.622, 0.854, 0.226}, {0.993, 0.906, 0.144}};
  auto table = vtkSmartPointer<vtkLookupTable>::New();
  table->SetNumberOfTableValues(256);
  for (int i = 0; i < 256; ++i) {
    const double at = i / 255.0 * 7;
    const int k = std::min(6, static_cast<int>(at));
    double c[3];
    for (int j = 0; j < 3; ++j) c[j] = kAnchors[k][j] + (at - k) * (kAnchors[k + 1][j] - kAnchors[k][j]);
    table->SetTableValue(i, c[0], c[1], c[2], 1);
  }
  table->SetRange(low, high);
  table->SetNanColor(0.6, 0.6, 0.6, 1);
  return table;
}

std::string TitleOf(PointColour colour, bool by_rank, const DisplayUnit& unit) {
  const std::string length = by_rank ? ", %" : " (" + unit.name + ")";
  switch (colour) {
    case PointColour::kHeight: return "height" + length;
    case PointColour::kTrackLength: return by_rank ? "images, %" : "images";
    case PointColour::kUncertainty: return "sigma" + length;
    case PointColour::kResidual: return by_rank ? "residual, %" : "residual (px)";
    case PointColour::kPicture: break;
  }
  return "";
}

}  // namespace

const char* LayerOf(ScenePath::Kind kind) {
  switch (kind) {
    case ScenePath::Kind::kOdometry: return "odometry";
    case ScenePath::Kind::kOptimised: return "optimised";
    case ScenePath::Kind::kTruth: return "truth";
    case ScenePath::Kind::kReference: return "reference";
    case ScenePath::Kind::kEstimate: return "estimates";
    case ScenePath::Kind::kGps: return "gps";
  }
  return "";
}

void SceneView::Parts::BuildPaths() {
  for (const ScenePath& path : model.paths) {
    std::vector<Eigen::Vector3d> line;
    for (const TimedPose& pose : path.poses) line.push_back(pose.target_from_body.translation);
    if (line.size() < 2) continue;
    const double width = path.kind == ScenePath::Kind::kOptimised ? 4 : 3;
    Add(LayerOf(path.kind), FlatActor(Lines({line}), ColourOf(path.kind), width), path.run);
    if (path.kind != ScenePath::Kind::kGps) continue;
    const vtkSmartPointer<vtkActor> fixes = FlatActor(Dots(line), kGreen, 5);  // each was measured by itself
    Add("gps", fixes, path.run);
  }
}

void SceneView::Parts::BuildPoints() {
  if (model.points.empty()) return;
  points = FlatActor(Dots({}), kBlack, 2);
  all_points = static_cast<vtkPolyDataMapper*>(points->GetMapper());
  Add("points", points);
  vtkNew<vtkScalarBarActor> bar;
  bar->SetOrientationToVertical();
  bar->SetNumberOfLabels(5);
  bar->SetPosition(0.93, 0.04);
  bar->SetWidth(0.055);
  bar->SetHeight(0.36);
  bar->UnconstrainedFontSizeOn();
  bar->SetLabelFormat("%.3g");
  bar->DrawBackgroundOn();
  bar->GetBackgroundProperty()->SetColor(1, 1, 1);
  bar->GetBackgroundProperty()->SetOpacity(0.75);
  bar_title = vtkSmartPointer<vtkTextActor>::New();  // the bar's own stands half above its plate
  bar_title->GetTextProperty()->SetJustificationToRight();
  bar_title->GetTextProperty()->SetBackgroundColor(1, 1, 1);
  bar_title->GetTextProperty()->SetBackgroundOpacity(0.75);
  for (vtkTextProperty* text : {bar->GetLabelTextProperty(), bar_title->GetTextProperty()}) {
    text->SetFontFamilyToArial();
    text->ItalicOff();
    text->BoldOff();
    text->ShadowOff();
    text->SetColor(0.1, 0.1, 0.1);
    text->SetFontSize(static_cast<int>(kBarText * style.text_px));
  }
  points_bar = bar.Get();
  Add("points", bar);
  Add("points", bar_title);
  points_by = style.points;
  ChoosePoints();
}

void SceneView::Parts::PlaceBar(vtkRenderer* of) const {
  auto* bar = static_cast<vtkScalarBarActor*>(points_bar.Get());
  if (bar == nullptr) return;
  const double wide = kBarColours_text + kBarNumbers_text;
  const double width = std::min(0.5, wide * style.text_px / std::max(1, of->GetSize()[0]));
  bar->SetTextPositionToPrecedeScalarBar();
  bar->SetBarRatio(kBarColours_text / wide);
  bar->SetWidth(width);
  const double height = std::min(kBarShare, kBarHeight_text * style.text_px / std::max(1, of->GetSize()[1]));
  bar->SetHeight(height);
  bar->SetPosition(kBarRight - width, kBarBottom);
  const double above = kBarBottom + height;
  bar_title->SetPosition(std::round(kBarRight * of->GetSize()[0]),
                         std::round(above * of->GetSize()[1] + kBarText * style.text_px));  // over the first number
}

void SceneView::Parts::ChoosePoints() {
  if (!points) return;
  shown.clear();
  std::vector<bool> hidden;
  for (const std::string& run : model.runs) hidden.push_back(hidden_runs.count(run) > 0);
  std::vector<Eigen::Vector3d> positions;
  for (size_t i = 0; i < model.points.size(); ++i) {
    const ScenePoint& point = model.points[i];
    if (!filter.Passes(point) || hidden[static_cast<size_t>(point.run)]) continue;
    shown.push_back(i);
    positions.push_back(point.position);
  }
  all_points->SetInputData(Dots(positions));
  ColourPoints();
}

double SceneView::Parts::ValueOf(const ScenePoint& point) const {
  switch (points_by) {
    case PointColour::kHeight: return point.position.z() / unit.metres;
    case PointColour::kTrackLength: return point.track_length;
    case PointColour::kUncertainty: return point.sigma_m / unit.metres;
    case PointColour::kResidual: return point.residual_px;
    case PointColour::kPicture: break;
  }
  return 0;
}

void SceneView::Parts::ColourPoints() {
  if (!points) return;
  few_points = nullptr;
  points->SetMapper(all_points);
  auto* bar = static_cast<vtkScalarBarActor*>(points_bar.Get());
  ShowLayer("points");
  if (points_by == PointColour::kPicture) {
    vtkNew<vtkUnsignedCharArray> colours;
    colours->SetNumberOfComponents(3);
    for (const size_t i : shown) {
      const std::array<uint8_t, 3> c = rgb.empty() ? std::array<uint8_t, 3>{160, 160, 160} : rgb[i];
      colours->InsertNextTuple3(c[0], c[1], c[2]);
    }
    return DrawColoured(all_points, colours);
  }
  std::vector<double> values, sorted;
  for (const size_t i : shown) {
    values.push_back(ValueOf(model.points[i]));
    if (std::isfinite(values.back())) sorted.push_back(values.back());
  }
  std::sort(sorted.begin(), sorted.end());
  lowest = 0, highest = by_rank ? 100 : 1;
  if (!by_rank && !sorted.empty()) lowest = Quantile(sorted, 0.02), highest = Quantile(sorted, 0.95);
  if (style.heights_m && !by_rank && points_by == PointColour::kHeight) {
    lowest = style.heights_m->front() / unit.metres, highest = style.heights_m->back() / unit.metres;
  }
  if (highest <= lowest) highest = lowest + 1;
  vtkNew<vtkFloatArray> scalars;
  for (double value : values) {
    if (by_rank && std::isfinite(value)) {
      value = 100.0 * static_cast<double>(std::lower_bound(sorted.begin(), sorted.end(), value) - sorted.begin()) /
              static_cast<double>(sorted.size());
    }
    scalars->InsertNextValue(static_cast<float>(value));
  }
  point_colours = Viridis(lowest, highest);
  DrawColoured(all_points, scalars);
  bar->SetLookupTable(point_colours);
  bar_title->SetInput(Words(TitleOf(points_by, by_rank, unit)).c_str());
}

// Values of the points, not of the cells they are drawn as: a vertex carries its colour, where a cell's must be looked
// up for each pixel.
void SceneView::Parts::DrawColoured(vtkPolyDataMapper* mapper, vtkDataArray* values) const {
  mapper->GetInput()->GetPointData()->SetScalars(values);
  mapper->SetScalarModeToUsePointData();
  mapper->SetColorMode(points_by == PointColour::kPicture ? VTK_COLOR_MODE_DIRECT_SCALARS : VTK_COLOR_MODE_MAP_SCALARS);
  mapper->SetLookupTable(point_colours);
  mapper->SetScalarRange(lowest, highest);
  mapper->ScalarVisibilityOn();
}

void SceneView::Parts::ThinPoints(int most) {
  if (!points) return;
  if (most <= 0 || shown.size() <= static_cast<size_t>(most)) {
    points->SetMapper(all_points);
    return;
  }
  // A mapper of its own, so that neither is sent to the graphics card again when the view stops or starts to move.
  if (!few_points || few != most) {
    few = most;
    std::vector<Eigen::Vector3d> positions;
    vtkDataArray* all = all_points->GetInput()->GetPointData()->GetScalars();
    const auto values = vtkSmartPointer<vtkDataArray>::Take(all->NewInstance());
    values->SetNumberOfComponents(all->GetNumberOfComponents());
    for (size_t k = 0; k < static_cast<size_t>(most); ++k) {  // evenly, however many there are
      const size_t i = k * shown.size() / static_cast<size_t>(most);
      positions.push_back(model.points[shown[i]].position);
      values->InsertNextTuple(static_cast<vtkIdType>(i), all);
    }
    few_points = vtkSmartPointer<vtkPolyDataMapper>::New();
    few_points->SetInputData(Dots(positions));
    DrawColoured(few_points, values);
  }
  points->SetMapper(few_points);
}

void SceneView::Parts::BuildCameras() {
  std::map<std::string, std::vector<std::vector<Eigen::Vector3d>>> lines_of;
  for (const SceneCamera& camera : model.cameras) {
    auto& lines = lines_of[camera.run];
    std::vector<Eigen::Vector3d> corners;
    for (const Eigen::Vector3d& ray : camera.corner_rays) {
      corners.push_back(camera.world_from_cam * (style.frustum_depth_m * ray));
    }
    const Eigen::Vector3d& centre = camera.world_from_cam.translation;
    lines.push_back({corners[0], corners[1], corners[2], corners[3], corners[0], centre, corners[1]});
    lines.push_back({corners[2], centre, corners[3]});
  }
  for (const auto& [run, lines] : lines_of) Add("cameras", FlatActor(Lines(lines), kCameraBlue, 1), run);
}

void SceneView::Parts::BuildPanoramas() {
  std::map<std::string, std::vector<Eigen::Vector3d>> dots;  // by run
  std::map<std::string, std::vector<Eigen::Vector3d>> geotags;
  std::map<std::string, std::vector<std::vector<Eigen::Vector3d>>> to_geotag;
  std::set<std::string> spheres;
  for (const ScenePanorama& panorama : model.panoramas) {
    const Rigid3d& pose = panorama.world_from_pano;
    if (panorama.geotag) {
      geotags[panorama.run].push_back(*panorama.geotag);
      to_geotag[panorama.run].push_back({*panorama.geotag, pose.translation});
    }
    const bool picture = !panorama.texture.empty() && static_cast<int>(spheres.size()) < style.max_spheres &&
                         spheres.insert(panorama.panorama).second;
    if (!picture) {
      dots[panorama.run].push_back(pose.translation);
    } else if (panorama.kind == ReferenceKind::kPanorama) {
      Add("panoramas",
          TexturedActor(TexturedGrid(Sphere(pose, style.sphere_radius_m, 49, 25), 49, 25), panorama.texture, false),
          panorama.run);
    } else {  // a photo stands upright before its centre, as large as it would be seen
      const double h = style.sphere_radius_m * panorama.texture.rows / std::max(1, panorama.texture.cols);
      const double w = style.sphere_radius_m;
      std::vector<Eigen::Vector3d> corners;
      for (const Eigen::Vector3d& c : {Eigen::Vector3d(-w, -h, w), Eigen::Vector3d(w, -h, w), Eigen::Vector3d(-w, h, w),
                                       Eigen::Vector3d(w, h, w)}) {
        corners.push_back(pose * c);
      }
      Add("panoramas", TexturedActor(TexturedGrid(corners, 2, 2), panorama.texture, false), panorama.run);
    }
  }
  for (const auto& [run, places] : dots) {
    vtkSmartPointer<vtkActor> actor = FlatActor(Dots(places), kBlue, 9);
    actor->GetProperty()->SetRenderPointsAsSpheres(true);
    Add("panoramas", actor, run);
  }
  for (const auto& [run, places] : geotags) {
    vtkSmartPointer<vtkActor> actor = FlatActor(Dots(places), kSky, 10);
    actor->GetProperty()->SetRenderPointsAsSpheres(true);
    Add("geotags", actor, run);
    Add("geotags", FlatActor(Lines(to_geotag[run]), kSky, 2), run);
  }
  BuildStationLabels();
}

void SceneView::Parts::BuildStationLabels() {
  std::set<std::string> stations;
  for (const ScenePanorama& panorama : model.panoramas) stations.insert(panorama.station);
  if (static_cast<int>(stations.size()) > style.max_labels) return;
  for (const ScenePanorama& panorama : model.panoramas) {
    const Eigen::Vector3d at = panorama.world_from_pano.translation + Eigen::Vector3d(0, 0, style.sphere_radius_m);
    if (const auto known = station_labels.find(panorama.station); known != station_labels.end()) {
      known->second.places.emplace_back(panorama.run, at);
      continue;
    }
    const bool taken = std::any_of(station_labels.begin(), station_labels.end(), [&](const auto& other) {
      return (other.second.places.front().second - at).norm() < 3 * style.sphere_radius_m;
    });
    if (stations.erase(panorama.station) == 0 || taken) continue;
    const auto label = Label(panorama.station, at, style.text_px);
    station_labels[panorama.station] = {label, {{panorama.run, at}}};
    AddLabel("labels", label);
  }
  PlaceStationLabels();
}

void SceneView::Parts::PlaceStationLabels() {
  for (const auto& [station, labelled] : station_labels) {
    const auto& places = labelled.places;
    auto place =
        std::find_if(places.begin(), places.end(), [&](const auto& at) { return hidden_runs.count(at.first) == 0; });
    if (place == places.end()) place = places.begin();
    run_of[labelled.label] = place->first;
    labelled.label->SetPosition(place->second.x(), place->second.y(), place->second.z());
  }
}

void SceneView::Parts::BuildTags() {
  for (const SceneTag& tag : model.tags) {
    const double h = 0.5 * tag.pattern_size_m;
    std::vector<Eigen::Vector3d> corners;
    for (const Eigen::Vector3d& c :
         {Eigen::Vector3d(-h, -h, 0), Eigen::Vector3d(h, -h, 0), Eigen::Vector3d(-h, h, 0), Eigen::Vector3d(h, h, 0)}) {
      corners.push_back(tag.world_from_tag * c);
    }
    if (tag.pattern.empty()) {
      std::swap(corners[2], corners[3]);
      Add("tags", FlatActor(Polygon(corners), kGreen, 1));
    } else {
      Add("tags", TexturedActor(TexturedGrid(corners, 2, 2), tag.pattern, true));
    }
    if (static_cast<int>(model.tags.size()) <= style.max_labels) {
      auto label =
          Label(std::to_string(tag.id), tag.world_from_tag.translation - Eigen::Vector3d(0, 0, h), 0.8 * style.text_px);
      label->GetTextProperty()->SetVerticalJustificationToTop();
      label->SetDisplayOffset(0, static_cast<int>(-0.5 * style.text_px));
      AddLabel("labels", label);
    }
  }
}

}  // namespace trigpoint
