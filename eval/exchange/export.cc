#include "eval/exchange/export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

#include "calib/base/counted.h"
#include "datasets/export/crs.h"
#include "datasets/export/gpano.h"
#include "datasets/export/layer_files.h"
#include "datasets/export/scene_files.h"
#include "datasets/io/camchain.h"
#include "datasets/io/credits.h"
#include "datasets/io/csv.h"
#include "datasets/io/tag_layout.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/manifest.h"
#include "datasets/project/outputs.h"
#include "datasets/project/stage.h"
#include "eval/errors/results.h"
#include "eval/exchange/layers.h"
#include "eval/exchange/scene.h"
#include "localize/reconstruct/image_motion.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kLayers = {"tags",    "control",      "check",    "stations", "panoramas",
                                          "cameras", "trajectories", "ellipses", "residuals"};

// A layout of tags, for programs that find their place by them.
bool IsLayout(const std::string& format) { return format == "wpilib" || format == "fmap"; }

bool IsMap(const std::string& format) {
  return format == "gpkg" || format == "geojson" || format == "kml" || format == "gpx" || format == "csv";
}

bool IsScene(const std::string& format) { return format == "colmap" || format == "ply" || format == "g2o"; }

const ExportFormat& FormatNamed(const std::string& name) {
  std::vector<std::string> names;
  for (const ExportFormat& format : ExportFormats()) {
    if (format.name == name) return format;
    for (const std::string& alias : format.aliases) {
      if (alias == name) return format;
    }
    names.push_back(format.name);
  }
  throw OptionError("--to " + name + ": unknown format, nearest known one: '" + NearestName(name, names) + "'");
}

// Runs to write: those asked for, else those that are localized; the others are named.
std::vector<std::string> LocalizedRuns(const Project& project, const ExportRequest& request, ExportReport* report) {
  std::vector<std::string> runs;
  for (const std::string& run : request.runs.empty() ? project.RunNames() : request.runs) {
    if (request.runs.empty() && project.site().broken_runs.count(run) > 0) continue;
    project.run(run);  // throws naming the nearest one
    const fs::path dir = project.ResultDir("localize", ResultNameOf(run, request.variant));
    if (fs::exists(dir / "cameras_odom.tum")) {
      runs.push_back(run);
    } else {
      report->warnings.push_back("run " + run + " is left out: not localized yet (trigpoint localize)");
    }
  }
  if (runs.empty()) {
    std::string why;
    for (const std::string& warning : report->warnings) why += "; " + warning;
    throw InputError(project.dir().string() + ": nothing to export" + why);
  }
  return runs;
}

// Throws InputError if a result that is there is not what its stage wrote, by the hashes of its manifest.
void RequireAsWritten(const Project& project, const std::string& stage, const std::string& run,
                      const std::string& variant) {
  const std::string name = ResultNameOf(run, variant);
  const fs::path dir = project.ResultDir(stage, name);
  const std::string again = "; run the stage again: trigpoint " + stage + " " + ShellWord(project.dir().string()) +
                            (run.empty() ? "" : " --run " + run) + (variant.empty() ? "" : " --variant " + variant);
  if (const std::string damage = ManifestDamage(project, stage, name); !damage.empty()) {
    throw InputError((dir / "manifest.json").string() + ": expected what the stage wrote, found a damaged file (" +
                     damage + ")" + again);
  }
  const std::optional<nlohmann::json> manifest = ReadManifest(project, stage, name);
  const nlohmann::json files = manifest ? manifest->value("files", nlohmann::json::object()) : nlohmann::json();
  for (const auto& [file, hash] : files.items()) {
    std::error_code ignored;
    const bool there = fs::is_regular_file(dir / file, ignored);
    if (there && hash == project.hashes().Of(dir / file)) continue;
    throw InputError((dir / file).string() + ": expected what the stage wrote, found " +
                     (there ? "another content (by the SHA-256 in manifest.json)" : "no such file") + again);
  }
}

using VariantOfRun = std::function<std::string(const std::string& run)>;

// Of everything that an export reads.
void RequireResultsAsWritten(const Project& project, const ExportRequest& request, const VariantOfRun& variant_of) {
  if (IsMap(request.to) || IsLayout(request.to)) RequireAsWritten(project, "survey", "", request.variant);
  if (IsMap(request.to)) RequireAsWritten(project, "evaluate", "", request.variant);
  if (IsLayout(request.to)) return;
  for (const std::string& run : request.runs.empty() ? project.RunNames() : request.runs) {
    if (request.to == "kalibr") {
      RequireAsWritten(project, "reconstruct", run, variant_of(run));
      continue;
    }
    RequireAsWritten(project, "localize", run, request.variant);
    if (IsScene(request.to)) RequireAsWritten(project, "features", run, "");
  }
}

// A trajectory of a run as localized.
struct Path {
  std::string name;       // cameras, cameras_odom, panoramas
  std::string frame, of;  // poses frame_from_of
  std::vector<TimedPose> poses;
};

std::vector<Path> PathsOf(const Project& project, const ExportRequest& request, const std::string& run) {
  const fs::path dir = project.ResultDir("localize", ResultNameOf(run, request.variant));
  const bool wants_odom = request.frame == "odom", wants_world = request.frame == "world";
  std::vector<Path> paths;
  for (const BodyCamera& camera : project.run(run).cameras) {
    if (camera.IsFurtherView()) continue;
    const std::string suffix = camera.name == project.run(run).cameras.front().name ? "" : "_" + camera.name;
    const fs::path world = dir / ("cameras" + suffix + ".tum"), odom = dir / ("cameras_odom" + suffix + ".tum");
    if (!wants_odom && fs::exists(world)) {
      paths.push_back({"cameras" + suffix, "world", camera.name, ReadTrajectory(world).poses});
    } else if (wants_world) {
      throw InputError("run " + run + ": is not georeferenced (see its log.txt); use --frame odom");
    }
    if (!wants_world && fs::exists(odom))
      paths.push_back({"cameras_odom" + suffix, "odom", camera.name, ReadTrajectory(odom).poses});
  }
  Path panoramas{"panoramas", wants_odom ? "odom" : "world", "pano", {}};
  std::map<std::string, int64_t> row_of;  // the solution may have them in another order than the table
  const CsvTable table = CsvTable::Read(dir / "panoramas.csv", {"panorama"});
  for (const CsvRow& row : table.rows()) row_of.try_emplace(row.Text("panorama"), static_cast<int64_t>(row_of.size()));
  for (const PanoramaResult& p : ReadLocalizeResult(dir).panoramas) {
    const auto& pose = wants_odom ? p.odom_from_pano : p.world_from_pano;
    const auto row = row_of.find(p.panorama);
    if (pose && row != row_of.end()) panoramas.poses.push_back({row->second * 1'000'000'000, *pose});
  }
  std::sort(panoramas.poses.begin(), panoramas.poses.end(),
            [](const TimedPose& a, const TimedPose& b) { return a.stamp_ns < b.stamp_ns; });
  if (!panoramas.poses.empty()) paths.push_back(std::move(panoramas));
  return paths;
}

void ExportTrajectories(const Project& project, const ExportRequest& request, const std::string& run,
                        const fs::path& out, ExportReport* report) {
  bool world = false;
  for (const Path& path : PathsOf(project, request, run)) {
    const std::string kind = path.name.substr(0, path.name.find('_'));
    if (!request.what.empty() && std::find(request.what.begin(), request.what.end(), kind) == request.what.end())
      continue;
    world |= path.frame == "world";
    if (request.to == "tum") {
      const std::string times =
          kind == "panoramas" ? "timestamp: row of panoramas.csv, from 0" : "timestamp: s, run's clock";
      report->files.push_back(out / (path.name + ".tum"));
      WriteTum(report->files.back(), path.poses,
               {"trigpoint trajectory 1; frame=" + path.frame + "; pose=" + path.frame + "_from_" + path.of, times,
                "timestamp tx ty tz qx qy qz qw"});
    } else {
      std::vector<Rigid3d> poses;
      std::string times;
      for (const TimedPose& pose : path.poses) {
        poses.push_back(pose.target_from_body);
        times += FormatNsAsSeconds(pose.stamp_ns) + "\n";
      }
      report->files.push_back(out / (path.name + ".txt"));
      WriteKitti(report->files.back(), poses);
      report->files.push_back(out / (path.name + "_times.txt"));
      WriteFileAtomically(report->files.back(), times);
    }
    report->lines.push_back(
        fmt::format("{}/{}: {}, frame {}", run, path.name, Counted(path.poses.size(), "pose"), path.frame));
  }
  if (!world) return;
  const LocalFrame enu = FrameOfResult(project, "localize", ResultNameOf(run, request.variant));
  WarnOfOtherOrigin(project, enu, "run " + run, &report->warnings);
}

// The localized panoramas of a run, each with its pose in its headers.
void ExportGPano(const Project& project, const ExportRequest& request, const std::string& run, const fs::path& out,
                 ExportReport* report, const CancelToken& cancel) {
  std::map<std::string, fs::path> pictures;
  for (const Reference& reference : project.site().references) {
    if (reference.kind == ReferenceKind::kPanorama) pictures[reference.name] = reference.files.front();
  }
  const std::string result = ResultNameOf(run, request.variant);
  const fs::path dir = project.ResultDir("localize", result);
  const LocalFrame enu = FrameOfResult(project, "localize", result);
  const std::map<std::string, PictureCredit> credits = ReadCredits(project.dir());
  int written = 0, withheld = 0;
  for (const PanoramaResult& answer : ReadLocalizeResult(dir).panoramas) {
    cancel.ThrowIfCancelled();
    const auto picture = pictures.find(answer.panorama);
    if (picture == pictures.end() || !answer.world_from_pano) continue;
    const auto credit = credits.find(answer.panorama);
    if (credit != credits.end() && !credit->second.keep_until.empty()) {
      ++withheld;
      continue;
    }
    PanoramaPose pose;
    pose.position = enu.GeodeticFromEnu(answer.world_from_pano->translation);
    pose.attitude = AttitudeOf(answer.world_from_pano->rotation);
    if (answer.sigma_m) pose.sigma_h_m = answer.sigma_m->head<2>().norm();
    if (credit != credits.end()) pose.copyright = credit->second.attribution;
    // Two folders may have pictures of the same name.
    fs::path file = out / picture->second.filename();
    if (std::find(report->files.begin(), report->files.end(), file) != report->files.end()) {
      file = out / fs::path(answer.panorama).relative_path();
      fs::create_directories(file.parent_path());
    }
    report->files.push_back(file);
    WritePanoramaWithPose(picture->second, report->files.back(), pose);
    ++written;
  }
  if (withheld > 0) {
    report->warnings.push_back(run + ": " + Counted(withheld, "panorama") +
                               " left out: their source forbids to copy them (keep_until in panoramas.csv)");
  }
  if (written == 0) throw InputError("run " + run + ": no panorama is georeferenced and may be copied");
  report->lines.push_back(run + ": " + Counted(written, "panorama"));
}

void ExportMap(const Project& project, const ExportRequest& request, ExportReport* report) {
  const std::vector<Layer> layers = MapLayers(project, request, &report->warnings);
  const bool any_system = request.to == "gpkg" || request.to == "csv";  // the others are WGS 84 by definition
  const Crs crs = Crs::Named(request.crs.empty() && any_system ? project.crs() : request.crs, project.frame().origin());
  const HeightSystem heights = HeightSystem::Named(request.heights);
  LayerFrame frame{crs, heights, ""};
  const LocalFrame enu = FrameOfResult(project, "survey", ResultNameOf("", request.variant));
  const Geodetic& o = enu.origin();  // of the columns x_m, y_m, z_m of tags
  frame.about =
      fmt::format("{}{}: written by trigpoint on {}; ENU origin {:.9f}, {:.9f}, {:.4f} m (WGS 84, ellipsoidal)",
                  project.name(), request.variant.empty() ? "" : " (variant " + request.variant + ")", UtcTimeText(),
                  o.latitude_deg, o.longitude_deg, o.height_m);
  if (crs.accuracy_m()) {
    report->warnings.push_back(
        fmt::format("EPSG:{} ({}): the transformation from WGS 84 is good to {:g} m; all of it "
                    "shifts together, beyond the sigmas in the file",
                    crs.epsg(), crs.name(), *crs.accuracy_m()));
  }
  if (request.to == "csv") {
    report->files = WriteLayerTables(request.out, layers, frame);
  } else {
    request.to == "gpkg"      ? WriteGeoPackage(request.out, layers, frame)
    : request.to == "geojson" ? WriteGeoJson(request.out, layers, frame)
    : request.to == "kml"     ? WriteKml(request.out, layers, frame)
                              : WriteGpx(request.out, layers, frame);
    report->files.push_back(request.out);
  }
  for (const Layer& layer : layers) {
    report->lines.push_back(layer.name + ": " + Counted(layer.features.size(), "feature"));
  }
  report->lines.push_back(fmt::format("EPSG:{} ({}), heights {}", crs.epsg(), crs.name(), heights.name()));
}

}  // namespace

LocalFrame FrameOfResult(const Project& project, const std::string& stage, const std::string& name) {
  const std::optional<nlohmann::json> manifest = ReadManifest(project, stage, name);
  if (!manifest) return project.frame();
  const nlohmann::json origin = manifest->value("values", nlohmann::json::object()).value("origin", nlohmann::json());
  if (!origin.is_array() || origin.size() != 3) return project.frame();
  return LocalFrame({origin[0].get<double>(), origin[1].get<double>(), origin[2].get<double>()});
}

void WarnOfOtherOrigin(const Project& project, const LocalFrame& frame, const std::string& what,
                       std::vector<std::string>* warnings) {
  constexpr double kRounded_m = 1e-3;  // as files of projects state an origin
  const Geodetic &o = frame.origin(), &now = project.frame().origin();
  const double apart_m = (EcefFromGeodetic(o) - EcefFromGeodetic(now)).norm();
  if (apart_m <= kRounded_m) return;
  warnings->push_back(fmt::format(
      "{}: east, north, up count from the origin of its result, {:.9f}, {:.9f}, {:.4f} m, which is {:.3f} m "
      "from the project's as it is now; they do not fit coordinates that count from the latter: run "
      "`trigpoint run` first",
      what, o.latitude_deg, o.longitude_deg, o.height_m, apart_m));
}

const std::vector<ExportFormat>& ExportFormats() {
  static const std::vector<ExportFormat> kFormats = {
      {"gpkg", {"geopackage"}, "GeoPackage with styles for QGIS", kLayers},
      {"geojson", {"json"}, "GeoJSON (RFC 7946)", kLayers},
      {"kml", {}, "KML 2.2", kLayers},
      {"gpx", {}, "GPX 1.1: waypoints and tracks", kLayers},
      {"csv", {}, "a table per layer", kLayers},
      {"colmap", {}, "COLMAP model (binary and text) and database", {}},
      {"tum", {}, "timestamp tx ty tz qx qy qz qw", {"cameras", "panoramas"}},
      {"kitti", {}, "3 x 4 matrices, one a line, with times beside them", {"cameras", "panoramas"}},
      {"ply", {}, "points with their covariances", {}},
      {"g2o", {}, "pose graph and bundle", {}},
      {"gpano", {}, "the localized panoramas, their poses in GPano XMP and EXIF", {}},
      {"wpilib", {}, "field layout of WPILib: the surveyed tags (JSON)", {}},
      {"fmap", {}, "field map of Limelight: the surveyed tags with their sizes", {}},
      {"kalibr", {}, "camchain.yaml of the cameras as used", {}}};
  return kFormats;
}

namespace {

// What cannot be asked for.
void CheckRequest(const ExportRequest& request, const ExportFormat& format) {
  for (const std::string& what : request.what) {
    if (std::find(format.what.begin(), format.what.end(), what) != format.what.end()) continue;
    throw OptionError(format.what.empty() ? "--what " + what + ": " + format.name + " has no parts to choose from"
                                          : "--what " + what + ": unknown for " + format.name + ", nearest: '" +
                                                NearestName(what, format.what) + "'");
  }
  if (!IsMap(request.to) && (!request.crs.empty() || !request.heights.empty())) {
    throw OptionError("--crs and --heights are for gpkg, geojson, kml, gpx and csv; " + request.to +
                      " has the site's frame or the run's own (--frame)");
  }
  if (!request.frame.empty() && request.frame != "world" && request.frame != "odom") {
    throw OptionError("--frame " + request.frame + ": expected world or odom");
  }
  if (!request.variant.empty()) CheckVariantName(request.variant);
}

void ExportLayout(const Project& project, const ExportRequest& request, ExportReport* report) {
  const fs::path dir = project.ResultDir("survey", ResultNameOf("", request.variant));
  if (!fs::exists(dir / "tags.csv"))
    throw InputError(dir.string() + ": there is no tag map yet; run `trigpoint survey`");
  std::vector<LayoutTag> tags;
  for (const TagResult& tag : ReadTagResults(dir / "tags.csv")) {
    if (tag.map_from_tag && (tag.status == "ok" || tag.status == "weak")) {
      tags.push_back({tag.tag_id, tag.family, tag.size_m, *tag.map_from_tag});
    } else {
      report->warnings.push_back(fmt::format("tag {} is left out: {}", tag.tag_id, tag.status));
    }
  }
  if (tags.empty()) throw InputError(dir.string() + ": no tag to export");
  request.to == "wpilib" ? WriteWpilibLayout(request.out, tags) : WriteFmap(request.out, tags);
  report->files.push_back(request.out);
  report->lines.push_back(Counted(tags.size(), "tag") + ", in the frame of the survey's map");
}

// With the lenses that the run's results rest on: those that `reconstruct` has found, if it has.
void ExportCameras(const Project& project, const VariantOfRun& variant_of, const std::string& name, const fs::path& out,
                   ExportReport* report) {
  Run run = project.run(name);
  TakeLenses(FoundLenses(project.ResultDir("reconstruct", ResultNameOf(name, variant_of(name)))), &run.cameras);
  report->files.push_back(out / "camchain.yaml");
  std::error_code ignored;
  fs::create_directories(out, ignored);
  WriteCamchain(report->files.back(), run.cameras, {"cameras of run " + name + ", written by trigpoint"});
  const auto cameras = std::count_if(run.cameras.begin(), run.cameras.end(),
                                     [](const BodyCamera& camera) { return !camera.IsFurtherView(); });
  report->lines.push_back(name + ": " + Counted(cameras, "camera"));
}

// Everything but maps: `request.out` is the folder of the one run, or of folders by run.
void ExportRuns(const Project& project, const ExportRequest& request, const VariantOfRun& variant_of, bool one_folder,
                ExportReport* report, ProgressSink& progress, const CancelToken& cancel) {
  std::vector<std::string> runs;
  if (request.to == "kalibr") {
    runs = request.runs.empty() ? project.RunNames() : request.runs;
  } else {
    runs = LocalizedRuns(project, request, report);
  }
  progress.Begin("export to " + request.to, static_cast<int64_t>(runs.size()));
  for (const std::string& run : runs) {
    cancel.ThrowIfCancelled();
    const fs::path out = runs.size() == 1 && one_folder ? request.out : request.out / run;
    if (request.to == "tum" || request.to == "kitti") {
      ExportTrajectories(project, request, run, out, report);
    } else if (request.to == "gpano") {
      ExportGPano(project, request, run, out, report, cancel);
    } else if (request.to == "kalibr") {
      ExportCameras(project, variant_of, run, out, report);
    } else {
      ExportScene(project, request, run, out, report, cancel);
    }
    progress.Advance(1);
  }
}

// Programs choose their reader by a file's ending: it is added, unless the name has that of another format.
fs::path WithEnding(const fs::path& file, const std::string& ending) {
  std::string given = file.extension().string();
  std::transform(given.begin(), given.end(), given.begin(), [](unsigned char c) { return std::tolower(c); });
  if (given == "." + ending || (ending == "geojson" && given == ".json")) return file;
  for (const char* other : {".gpkg", ".geojson", ".json", ".kml", ".kmz", ".gpx", ".fmap", ".csv"}) {
    if (given != other) continue;
    throw OptionError("--out " + file.string() + ": expected a file that ends in ." + ending + ", found " + given +
                      "; name it so, or choose another format by --to");
  }
  return fs::path(file) += "." + ending;
}

}  // namespace

ExportReport ExportResults(const Project& project, const ExportRequest& asked, const VariantOfRun& variant_of,
                           ProgressSink& progress, const CancelToken& cancel) {
  ExportRequest request = asked;
  const ExportFormat& format = FormatNamed(asked.to);
  request.to = format.name;
  CheckRequest(request, format);
  const std::string ending = request.to == "wpilib" ? "json" : request.to;
  const bool one_file = (IsMap(request.to) && request.to != "csv") || IsLayout(request.to),
             default_place = request.out.empty();
  if (default_place) {
    const std::string suffix = ResultNameOf("", request.variant);
    request.out = project.results() / "export" /
                  (one_file ? (IsLayout(request.to) ? "tags" : "site") + suffix + "." + ending : request.to + suffix);
  }
  fs::path place = fs::absolute(request.out).lexically_normal();
  if (one_file && (fs::is_directory(place) || !place.has_filename())) {
    throw OptionError("--out " + request.out.string() + ": expected a file for " + request.to + ", found a folder");
  }
  if (one_file) {
    if (place.has_extension()) RequireOutputPlace(place);
    place = WithEnding(place, ending);
  }
  if (!one_file) {  // by its own name, whatever links lead there
    place = fs::weakly_canonical(place);
    if (!place.has_filename()) place = place.parent_path();
  }
  RequireOutputPlace(place);
  RequireResultsAsWritten(project, request, variant_of);
  OutputFiles output(one_file ? place.parent_path() : place, request.force);
  request.out = one_file ? output.staging() / place.filename() : output.staging();
  ExportReport report;
  if (IsMap(request.to)) {
    ExportMap(project, request, &report);
  } else if (IsLayout(request.to)) {
    ExportLayout(project, request, &report);
  } else {
    ExportRuns(project, request, variant_of, !default_place, &report, progress, cancel);
  }
  for (fs::path& file : report.files) file = output.Final(file);
  output.Publish();
  return report;
}

}  // namespace trigpoint
