#include "eval/exchange/layers.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>

#include "datasets/io/credits.h"
#include "datasets/io/csv.h"
#include "eval/errors/evaluate.h"
#include "eval/errors/evaluation_files.h"
#include "eval/errors/reference_maps.h"
#include "eval/errors/results.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

LayerField Real(const char* name, int decimals = 4) { return {name, FieldType::kReal, decimals}; }
LayerField Text(const char* name) { return {name, FieldType::kText, 0}; }
LayerField Whole(const char* name) { return {name, FieldType::kInteger, 0}; }

Layer SurveyedLayer(const char* name, const char* title, const char* colour) {
  return {name,
          title,
          LayerGeometry::kPoint,
          colour,
          {Text("status"), Whole("tag_id"), Real("stated_sigma_h_m", 5), Real("stated_sigma_v_m", 5), Real("de_m", 5),
           Real("dn_m", 5), Real("du_m", 5), Real("error_h_m", 5), Real("error_v_m", 5), Real("error_3d_m", 5),
           Real("sigma_e_m", 5), Real("sigma_n_m", 5), Real("sigma_u_m", 5), Real("standardised", 3)},
          {}};
}

struct Sources {
  const Project& project;
  const ExportRequest& request;
  std::map<std::string, PictureCredit> credits;
  Layer tags, stations, panoramas, cameras, trajectories, ellipses, residuals;
  Layer control = SurveyedLayer("control", "control points of the survey (1 sigma)", "#0072b2");
  Layer check = SurveyedLayer("check", "check points of the survey (1 sigma)", "#a8420a");
  std::vector<Layer*> All() {
    return {&tags, &control, &check, &stations, &panoramas, &cameras, &trajectories, &ellipses, &residuals};
  }
};

// Cells of a table's row in the order of the fields; empty ones are not known.
void AppendCells(const CsvRow& row, const std::vector<LayerField>& fields, size_t first, std::vector<LayerValue>* out) {
  for (size_t i = first; i < fields.size(); ++i) {
    const LayerField& field = fields[i];
    if (!row.Has(field.name)) {
      out->emplace_back();
    } else if (field.type == FieldType::kText) {
      out->emplace_back(row.Text(field.name));
    } else if (field.type == FieldType::kInteger) {
      out->emplace_back(row.Integer(field.name));
    } else {
      out->emplace_back(row.Number(field.name));
    }
  }
}

Layer PanoramaLayer() {
  return {"panoramas",
          "panoramas as the cameras see them (1 sigma)",
          LayerGeometry::kPoint,
          "#d62728",
          {Text("run"),           Text("station"),         Text("status"),
           Text("reason"),        Real("sigma_x_m", 5),    Real("sigma_y_m", 5),
           Real("sigma_z_m", 5),  Real("latitude_deg", 9), Real("longitude_deg", 9),
           Real("height_m"),      Real("heading_deg"),     Real("pitch_deg"),
           Real("roll_deg"),      Whole("inliers"),        Whole("views"),
           Real("geotag_de_m"),   Real("geotag_dn_m"),     Real("geotag_du_m"),
           Text("geotag_status"), Text("source"),          Text("captured_at"),
           Text("licence"),       Text("attribution")},
          {}};
}

Layer TagLayer() {
  return {"tags",
          "tags of the map, their centres",
          LayerGeometry::kPoint,
          "#1f77b4",
          {Whole("tag_id"),
           Text("family"),
           Real("size_m"),
           Text("role"),
           Text("status"),
           Real("x_m"),
           Real("y_m"),
           Real("z_m"),
           Real("sigma_e_m", 5),
           Real("sigma_n_m", 5),
           Real("sigma_u_m", 5),
           Real("sigma_rx_deg"),
           Real("sigma_ry_deg"),
           Real("sigma_rz_deg"),
           Whole("images"),
           Whole("runs"),
           Real("rms_px"),
           Real("latitude_deg", 9),
           Real("longitude_deg", 9),
           Real("height_m")},
          {}};
}

// The last four of a panorama's values: whose picture it is.
void PutCredit(const std::map<std::string, PictureCredit>& credits, const std::string& panorama,
               std::vector<LayerValue>* values) {
  const auto credit = credits.find(panorama);
  if (credit == credits.end()) return;
  const PictureCredit& c = credit->second;
  size_t at = values->size() - 4;
  for (const std::string& text : {c.source, c.captured_at, c.licence, c.attribution}) {
    if (!text.empty()) (*values)[at] = text;
    ++at;
  }
}

// `enu`: the frame of the result that `from` and `to` are taken from.
void AddResidual(Sources* s, const LocalFrame& enu, const std::string& run, const std::string& name,
                 const std::string& kind, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d d = to - from;
  s->residuals.features.push_back({name,
                                   {enu.GeodeticFromEnu(from), enu.GeodeticFromEnu(to)},
                                   {run, kind, d.x(), d.y(), d.z(), d.head<2>().norm(), d.norm()},
                                   {}});
}

// The ellipse of a place; `covariance` of its position, else what its sigmas say of the axes alone.
void AddEllipse(Sources* s, const LocalFrame& enu, const std::string& layer, const std::string& run,
                const std::string& name, const Rigid3d& pose, const std::optional<Eigen::Matrix3d>& covariance,
                const std::optional<Eigen::Vector3d>& sigma) {
  if (!covariance && !sigma) return;
  const Eigen::Matrix2d of_plan = covariance ? Eigen::Matrix2d(covariance->topLeftCorner<2, 2>())
                                             : Eigen::Matrix2d(sigma->head<2>().cwiseAbs2().asDiagonal());
  const double chi2 = -2 * std::log(1 - s->request.confidence);  // two degrees of freedom
  constexpr int kVertices = 48;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(of_plan);
  const Eigen::Vector2d half = (chi2 * solver.eigenvalues().cwiseMax(0)).cwiseSqrt();  // minor, major
  const Eigen::Vector2d major = solver.eigenvectors().col(1);
  double azimuth = std::atan2(major.x(), major.y()) * kRadToDeg;
  if (azimuth < 0) azimuth += 180;
  LayerFeature feature;
  feature.name = name;
  for (int i = 0; i < kVertices; ++i) {
    const double angle = 2 * 3.14159265358979323846 * i / kVertices;
    const Eigen::Vector2d d = s->request.ellipse_scale * solver.eigenvectors() *
                              Eigen::Vector2d(half.x() * std::cos(angle), half.y() * std::sin(angle));
    feature.geometry.push_back(enu.GeodeticFromEnu(pose.translation + Eigen::Vector3d(d.x(), d.y(), 0)));
  }
  feature.values = {layer,
                    run,
                    s->request.confidence,
                    half.y(),
                    half.x(),
                    azimuth,
                    std::string(covariance ? "full" : "axes only"),
                    s->request.ellipse_scale};
  s->ellipses.features.push_back(std::move(feature));
}

Eigen::Vector3d PlaceIn(const CsvRow& row) { return {row.Number("x"), row.Number("y"), row.Number("z")}; }

// The images of a run and the paths of its cameras.
void AddCameras(Sources* s, const LocalFrame& enu, const std::string& run, const fs::path& dir) {
  const RunConfig& config = s->project.run(run).config;
  std::map<std::string, LayerFeature> tracks;
  const CsvTable cameras = CsvTable::Read(dir / "cameras.csv", {"timestamp", "image", "camera", "x", "y", "z"});
  for (const CsvRow& row : cameras.rows()) {
    LayerFeature feature;
    feature.name = row.Text("image");
    feature.values = {run};
    AppendCells(row, s->cameras.fields, 1, &feature.values);
    const Eigen::Vector3d at = PlaceIn(row);
    feature.geometry = {enu.GeodeticFromEnu(at)};
    LayerFeature& track = tracks[row.Text("camera")];
    track.geometry.push_back(feature.geometry.front());
    if (config.time_zero_utc_ns) {
      feature.times_ns = {row.StampNs("timestamp") + *config.time_zero_utc_ns};
      track.times_ns.push_back(feature.times_ns.front());
    }
    s->cameras.features.push_back(std::move(feature));
  }
  for (auto& [camera, track] : tracks) {
    if (track.geometry.size() < 2) continue;
    double length = 0;
    for (size_t i = 1; i < track.geometry.size(); ++i) {
      length += (EcefFromGeodetic(track.geometry[i]) - EcefFromGeodetic(track.geometry[i - 1])).norm();
    }
    track.name = run + "/" + camera;
    track.values = {run, camera, static_cast<int64_t>(track.geometry.size()), length};
    s->trajectories.features.push_back(std::move(track));
  }
}

void AddRun(Sources* s, const std::string& run, const fs::path& dir) {
  const LocalFrame enu = FrameOfResult(s->project, "localize", ResultNameOf(run, s->request.variant));
  const LocalizeResult result = ReadLocalizeResult(dir);
  for (const PanoramaResult& p : result.panoramas) {
    if (!p.world_from_pano) continue;
    AddEllipse(s, enu, "panoramas", run, p.panorama, *p.world_from_pano, p.covariance_m2, p.sigma_m);
  }
  for (const CameraResult& c : result.images) {
    if (!c.world_from_cam) continue;
    AddEllipse(s, enu, "cameras", run, c.image, *c.world_from_cam, c.covariance_m2, c.sigma_m);
  }
  const CsvTable panoramas = CsvTable::Read(dir / "panoramas.csv", {"panorama", "status"});
  for (const CsvRow& row : panoramas.rows()) {
    LayerFeature feature;
    feature.name = row.Text("panorama");
    feature.values = {run};
    AppendCells(row, s->panoramas.fields, 1, &feature.values);
    PutCredit(s->credits, feature.name, &feature.values);
    if (row.Has("x") && row.Has("latitude_deg")) {
      const Eigen::Vector3d at = PlaceIn(row);
      feature.geometry = {enu.GeodeticFromEnu(at)};
      if (row.Has("geotag_de_m") && row.Has("geotag_dn_m")) {
        AddResidual(
            s, enu, run, feature.name, "geotag minus estimate (" + row.Text("geotag_status") + ")", at,
            at + Eigen::Vector3d(row.Number("geotag_de_m"), row.Number("geotag_dn_m"), row.Number("geotag_du_m", 0)));
      }
    }
    s->panoramas.features.push_back(std::move(feature));
  }
  AddCameras(s, enu, run, dir);
}

// Control or check points of the survey where they were surveyed, with how the map differs.
void AddSurveyed(Sources* s, const LocalFrame& enu, const fs::path& dir, Layer* layer) {
  const fs::path file = dir / (layer->name + ".csv");
  if (!fs::exists(file)) return;
  const CsvTable table = CsvTable::Read(file, {"point", "status", "x", "y", "z", "stated_x", "stated_y", "stated_z"});
  for (const CsvRow& row : table.rows()) {
    const Eigen::Vector3d stated(row.Number("stated_x"), row.Number("stated_y"), row.Number("stated_z"));
    LayerFeature feature;
    feature.name = row.Text("point");
    feature.geometry = {enu.GeodeticFromEnu(stated)};
    AppendCells(row, layer->fields, 0, &feature.values);
    layer->features.push_back(std::move(feature));
    AddResidual(s, enu, "", row.Text("point"),
                row.Text("status") == "used" ? "map minus control point: a residual, not an accuracy"
                                             : "map minus " + layer->name + " point (" + row.Text("status") + ")",
                stated, {row.Number("x"), row.Number("y"), row.Number("z")});
  }
}

void AddTags(Sources* s, const fs::path& dir, std::vector<std::string>* warnings) {
  const LocalFrame enu = FrameOfResult(s->project, "survey", ResultNameOf("", s->request.variant));
  WarnOfOtherOrigin(s->project, enu, "tag map (x_m, y_m, z_m of tags; positions on the Earth are right)", warnings);
  std::map<int, Rigid3d> world_from_tag;
  for (const TagResult& tag : ReadTagResults(dir / "tags.csv", dir / "tags_cov.csv")) {
    LayerFeature feature;
    feature.name = std::to_string(tag.tag_id);
    const auto known = [](const std::optional<Eigen::Vector3d>& v, int i, double factor = 1) {
      return v ? LayerValue((*v)[i] * factor) : LayerValue();
    };
    feature.values = {int64_t{tag.tag_id}, tag.family, tag.size_m, tag.role, tag.status};
    std::optional<Eigen::Vector3d> at;
    if (tag.map_from_tag) at = tag.map_from_tag->translation;
    for (int i = 0; i < 3; ++i) feature.values.push_back(known(at, i));
    for (int i = 0; i < 3; ++i) feature.values.push_back(known(tag.sigma_m, i));
    for (int i = 0; i < 3; ++i) feature.values.push_back(known(tag.sigma_rot_rad, i, kRadToDeg));
    feature.values.insert(feature.values.end(), {int64_t{tag.images}, int64_t{tag.runs}, tag.rms_px});
    if (at) {
      feature.geometry = {enu.GeodeticFromEnu(*at)};
      const Geodetic& g = feature.geometry.front();
      feature.values.insert(feature.values.end(), {g.latitude_deg, g.longitude_deg, g.height_m});
      world_from_tag[tag.tag_id] = *tag.map_from_tag;
      std::optional<Eigen::Matrix3d> covariance;
      if (tag.covariance) covariance = tag.covariance->bottomRightCorner<3, 3>();
      AddEllipse(s, enu, "tags", "", feature.name, *tag.map_from_tag, covariance, tag.sigma_m);
    } else {
      feature.values.resize(s->tags.fields.size());
    }
    s->tags.features.push_back(std::move(feature));
  }
  for (const Station& station : s->project.site().stations) {
    LayerFeature feature;
    feature.name = station.name;
    feature.values = {int64_t{station.tag_id}, station.sigma_m};
    const auto tag = world_from_tag.find(station.tag_id);
    std::string reason = fmt::format("tag {} is not in the map", station.tag_id);
    std::optional<Eigen::Vector3d> centre;
    if (tag != world_from_tag.end()) {
      centre = StationCentre(station, tag->second, Eigen::Matrix3d::Identity(), Eigen::Vector3d::UnitZ(), &reason);
    }
    if (centre) feature.geometry = {enu.GeodeticFromEnu(*centre)};
    feature.values.push_back(centre ? LayerValue() : LayerValue(reason));
    s->stations.features.push_back(std::move(feature));
  }
  AddSurveyed(s, enu, dir, &s->control);
  AddSurveyed(s, enu, dir, &s->check);
}

void AddErrors(Sources* s, const fs::path& errors_csv) {
  const LocalFrame enu = FrameOfResult(s->project, "evaluate", ResultNameOf("", s->request.variant));
  std::map<std::pair<std::string, std::string>, Geodetic> places;
  for (const LayerFeature& f : s->panoramas.features) {
    if (!f.geometry.empty()) places[{std::get<std::string>(f.values[0]), f.name}] = f.geometry.front();
  }
  const CsvTable table =
      CsvTable::Read(errors_csv, {"run", "method", "panorama", "reference", "kind", "de_m", "dn_m", "du_m"});
  for (const CsvRow& row : table.rows()) {
    const auto place = places.find({row.Text("run"), row.Text("panorama")});
    if (row.Text("kind") != "absolute" || row.Text("method") == "g1" || !row.Has("de_m") || place == places.end())
      continue;
    if (row.Has("variant") && row.Text("variant") != s->request.variant) continue;
    const Eigen::Vector3d at = enu.EnuFromGeodetic(place->second);
    AddResidual(s, enu, row.Text("run"), row.Text("panorama"), "estimate minus tag of " + row.Text("reference"),
                at - Eigen::Vector3d(row.Number("de_m"), row.Number("dn_m"), row.Number("du_m")), at);
  }
}

Sources EmptyLayers(const Project& project, const ExportRequest& request) {
  Sources s{.project = project, .request = request, .credits = ReadCredits(project.dir())};
  s.tags = TagLayer();
  s.stations = {"stations", "panorama stations as measured from their tags",    LayerGeometry::kPoint,
                "#9467bd",  {Whole("tag_id"), Real("sigma_m"), Text("reason")}, {}};
  s.panoramas = PanoramaLayer();
  s.cameras = {
      "cameras",
      "images of the runs (1 sigma)",
      LayerGeometry::kPoint,
      "#2ca02c",
      {Text("run"), Text("camera"), Text("timestamp"), Real("sigma_e_m", 5), Real("sigma_n_m", 5), Real("sigma_u_m", 5),
       Real("latitude_deg", 9), Real("longitude_deg", 9), Real("height_m"), Real("heading_deg"), Real("pitch_deg"),
       Real("roll_deg"), Real("sigma_heading_deg", 5), Real("sigma_pitch_deg", 5), Real("sigma_roll_deg", 5)},
      {}};
  s.trajectories = {"trajectories",
                    "paths of the cameras",
                    LayerGeometry::kLine,
                    "#2ca02c",
                    {Text("run"), Text("camera"), Whole("images"), Real("length_m", 3)},
                    {}};
  s.ellipses = {"ellipses",
                fmt::format("{:g} % error ellipses, horizontal", 100 * request.confidence),
                LayerGeometry::kPolygon,
                "#ff7f0e",
                {Text("of"), Text("run"), Real("confidence"), Real("semi_major_m", 5), Real("semi_minor_m", 5),
                 Real("azimuth_deg", 2), Text("correlation"), Real("drawn_scale", 1)},
                {}};
  s.residuals = {
      "residuals",
      "differences as vectors, in the direction that `kind` names",
      LayerGeometry::kLine,
      "#e377c2",
      {Text("run"), Text("kind"), Real("de_m"), Real("dn_m"), Real("du_m"), Real("horizontal_m"), Real("length_m")},
      {}};
  return s;
}

void AddRuns(Sources* s, std::vector<std::string>* warnings) {
  const Project& project = s->project;
  const std::vector<std::string> runs = s->request.runs.empty() ? project.RunNames() : s->request.runs;
  for (const std::string& run : runs) {
    if (project.site().broken_runs.count(run) == 0) project.run(run);  // throws naming the nearest one
    const fs::path dir = project.ResultDir("localize", ResultNameOf(run, s->request.variant));
    if (!fs::exists(dir / "panoramas.csv")) {
      warnings->push_back("run " + run + " is left out: not localized yet (trigpoint localize)");
    } else if (!fs::exists(dir / "cameras.csv")) {
      warnings->push_back("run " + run + " is left out: it is not georeferenced (see its log.txt)");
    } else {
      AddRun(s, run, dir);
    }
  }
}

}  // namespace

std::vector<Layer> MapLayers(const Project& project, const ExportRequest& request, std::vector<std::string>* warnings) {
  if (!project.has_frame()) {
    throw InputError(project.dir().string() +
                     ": is not georeferenced; add origin.json, or panoramas, control points or GPS with positions");
  }
  Sources s = EmptyLayers(project, request);
  AddRuns(&s, warnings);
  const std::string of_all = ResultNameOf("", request.variant);
  const fs::path survey = project.ResultDir("survey", of_all);
  if (fs::exists(survey / "tags.csv")) {
    if (const std::string frame = TagMapFrame(survey / "tags.csv"); frame.empty() || frame == "enu") {
      AddTags(&s, survey, warnings);
    } else {
      warnings->push_back(
          "no tags and stations: the tag map is in a frame of its own, not georeferenced (give the "
          "survey control points or geotags)");
    }
  } else if (!project.site().stations.empty() || !project.site().control_points.empty()) {
    warnings->push_back("no tags and stations: there is no tag map yet (trigpoint survey)");
  }
  const fs::path errors = project.ResultDir("evaluate", of_all) / "errors.csv";
  if (fs::exists(errors)) AddErrors(&s, errors);
  std::vector<Layer> layers;
  for (Layer* layer : s.All()) {
    const bool wanted =
        request.what.empty() || std::find(request.what.begin(), request.what.end(), layer->name) != request.what.end();
    if (wanted && !layer->features.empty()) layers.push_back(std::move(*layer));
  }
  if (layers.empty()) {
    std::string why;
    for (const std::string& warning : *warnings) why += "; " + warning;
    throw InputError(project.dir().string() + ": nothing to export" + why);
  }
  return layers;
}

}  // namespace trigpoint
