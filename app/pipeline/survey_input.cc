#include "app/pipeline/survey_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include "app/pipeline/image_motion.h"
#include "app/pipeline/reconstruct_stage.h"
#include "app/pipeline/rolling_tags.h"
#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/survey_tables.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "datasets/project/marking.h"
#include "survey/tags/control.h"
#include "survey/tags/excluded_detections.h"
#include "survey/tags/tie_points.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kOneSite_m = 50'000;  // surveyed points and satellite fixes of one site are nearer
constexpr double kSameFrame_m = 100;   // coordinates about the site's origin are nearer
constexpr double kGeoid_m = 130;       // heights above ellipsoid and sea differ by less, receivers' errors included
constexpr double kFoot_m = 0.3048;

const std::vector<std::string> kDatums = {"auto", "control", "geotags", "gps", "tag", "plane", "gravity", "none"};

// The numbers of a text, separated by blanks or commas. Throws OptionError.
std::vector<double> Numbers(const std::string& text, const char* option) {
  std::string blanks = text;
  std::replace(blanks.begin(), blanks.end(), ',', ' ');
  std::istringstream in(blanks);
  std::vector<double> numbers;
  for (std::string word; in >> word;) {
    const auto number = ParseDouble(word);
    if (!number) throw OptionError(fmt::format("option {}: expected numbers, found '{}'", option, word));
    numbers.push_back(*number);
  }
  return numbers;
}

std::optional<Eigen::Vector3d> WorldOf(const Project& project, const ControlPoint& point) {
  if (point.local_m) return point.local_m;
  if (point.geodetic && project.has_frame()) return project.frame().EnuFromGeodetic(*point.geodetic);
  return std::nullopt;
}

// Surveyed points as tables have them, and where they are marked in pictures.
struct KnownPoints {
  std::vector<ControlPoint> points;
  std::vector<PointMark> marks;
};

KnownPoints ReadKnownPoints(const Project& project, std::vector<std::string>* warnings) {
  KnownPoints known;
  known.points = project.site().control_points;
  const fs::path& dir = project.dir();
  if (fs::exists(dir / "control_observations.csv")) {
    known.marks = ReadControlObservations(dir / "control_observations.csv", warnings);
  }
  const auto add = [&](const OpenSfmControl& control) {
    known.points.insert(known.points.end(), control.points.begin(), control.points.end());
    known.marks.insert(known.marks.end(), control.marks.begin(), control.marks.end());
  };
  if (fs::exists(dir / "ground_control_points.json"))
    add(ReadOpenSfmJson(dir / "ground_control_points.json", warnings));
  if (fs::exists(dir / "gcp_list.txt")) add(ReadOpenSfmList(dir / "gcp_list.txt", warnings));
  return known;
}

size_t CameraNamed(const SurveyRun& run, const std::string& name) {
  for (size_t c = 0; c < run.cameras.size(); ++c) {
    if (run.cameras[c].name == name) return c;
  }
  return 0;
}

// The survey's pictures that a mark's image can mean.
std::vector<SurveyMark> MarksOf(const Project& project, const std::string& point, const KnownPoints& known,
                                const SurveyJob& job, std::vector<std::string>* warnings) {
  std::vector<SurveyMark> marks;
  for (const PointMark& mark : known.marks) {
    if (mark.point != point) continue;
    int found = 0;
    const auto add = [&](size_t r, const BodyCamera& camera, int index, int64_t stamp_ns) {
      SurveyMark m;
      m.run = static_cast<int>(r);
      m.stamp_ns = stamp_ns;
      m.camera = index;
      m.sigma_px = mark.sigma_px;
      const double w = camera.camera.width(), h = camera.camera.height();
      m.pixel = mark.normalised ? Eigen::Vector2d(mark.pixel * std::max(w, h) + 0.5 * Eigen::Vector2d(w - 1, h - 1))
                                : mark.pixel;
      if (found++ == 0) marks.push_back(m);
    };
    for (size_t r = 0; r < job.input.runs.size(); ++r) {
      const SurveyRun& its = job.input.runs[r];
      if (its.stills) {
        for (const ImageDetections& photo : its.images) {
          if (!NamesPath(mark.image, photo.image)) continue;
          const size_t camera = CameraNamed(its, photo.camera);
          add(r, its.cameras[camera], static_cast<int>(camera), photo.stamp_ns);
        }
        continue;
      }
      const Run& run = project.run(its.name);
      for (const ImageEntry& image : run.images) {
        if (image.file != mark.image && !NamesPath(mark.image, image.path.string())) continue;
        const BodyCamera& camera = run.cameras[static_cast<size_t>(image.camera)];
        add(r, camera, image.camera, BodyStamp(image.stamp_ns, camera));
      }
    }
    if (found != 1) {
      warnings->push_back(fmt::format("point {}: image '{}' is {}", point, mark.image,
                                      found == 0 ? "no picture of the survey; its mark is left out"
                                                 : "in the survey more than once; the first is taken"));
    }
  }
  return marks;
}

// Systems of the coordinates as control_points.csv and gcp_list.txt name them.
std::set<std::string> StatedSystems(const Project& project, const std::vector<ControlPoint>& points) {
  std::set<std::string> systems;
  for (const ControlPoint& c : points) {
    if (c.local_m) systems.insert("local x, y, z");
  }
  const fs::path table = project.dir() / "control_points.csv", list = project.dir() / "gcp_list.txt";
  if (fs::exists(table)) {
    const CsvTable csv = CsvTable::Read(table, {}, {"crs", "easting_m", "latitude_deg"});
    for (const CsvRow& row : csv.rows()) {
      if (row.Has("easting_m") && row.Has("crs")) systems.insert(row.Text("crs"));
      if (row.Has("latitude_deg")) systems.insert("WGS 84 latitude, longitude");
    }
  }
  if (fs::exists(list)) {
    std::istringstream in(ReadTextFile(list));
    for (std::string line; std::getline(in, line);) {
      if (Trim(line).empty() || Trim(line).front() == '#') continue;
      systems.insert(std::string(Trim(line)));
      break;
    }
  }
  return systems;
}

// The newest epoch of each point is used, earlier ones are compared with it. Points of several epochs may be apart by
// the motion of their plate.
void UseNewestEpochs(const Project& project, std::vector<ControlPoint>* points, SurveyJob* job) {
  constexpr double kApart_years = 1;
  const std::vector<ControlPoint> all = std::exchange(*points, AtNewestEpoch(*points));
  ControlSystems& control = job->control;
  control.crs = StatedSystems(project, all);
  for (const ControlPoint& c : all) {
    control.epochs.insert(c.epoch);
    if (c.geodetic) control.heights.insert(c.height_system);
    for (const ControlPoint& used : *points) {
      if (ReviewControlName(used) != ReviewControlName(c) || used.epoch == c.epoch) continue;
      const auto now = WorldOf(project, used), then = WorldOf(project, c);
      if (!now || !then) continue;
      EpochDifference d{ReviewControlName(c), c.epoch, used.epoch, *now - *then};
      const double h = std::hypot(c.sigma_h_m, used.sigma_h_m);
      d.sigma_m = {h, h, std::hypot(c.sigma_v_m, used.sigma_v_m)};
      d.chi2 = d.difference_m.cwiseQuotient(d.sigma_m).squaredNorm();
      control.epoch_differences.push_back(d);
      if (!d.Moved()) continue;
      job->warnings.push_back(fmt::format(
          "point {}: its coordinates of epoch {} are {:.3f} m from those of epoch {}, {:.1f} sigma: the newer ones are "
          "used; check whether the point moved and whether both epochs have the same coordinate system",
          d.point, d.earlier, d.difference_m.norm(), d.used, std::sqrt(d.chi2)));
    }
  }
  std::map<double, std::string> years;
  for (const ControlPoint& c : *points) {
    const auto year = YearOfEpoch(c.epoch);
    if (year && c.geodetic) years[*year] = c.epoch;
  }
  if (!years.empty() && years.rbegin()->first - years.begin()->first > kApart_years) {
    job->warnings.push_back(fmt::format(
        "the surveyed points are of epochs {} to {} and are used as stated; in a frame that does not move with the "
        "site's plate their coordinates change by centimetres a year: transform them to one epoch",
        years.begin()->second, years.rbegin()->second));
  }
}

// Control by the names that total_station.csv has for it.
std::vector<NetworkPoint> NetworkControl(const Project& project) {
  std::vector<NetworkPoint> control;
  for (const ControlPoint& c : AtNewestEpoch(project.site().control_points)) {
    const std::optional<Eigen::Vector3d> world = WorldOf(project, c);
    if (!world || !c.control) continue;
    std::string name = c.tag_id < 0 ? c.point : fmt::format("tag:{}", c.tag_id);
    if (c.tag_id >= 0 && c.corner >= 0) name += fmt::format("/{}", c.corner);
    control.push_back({name, *world, c.sigma_h_m, c.sigma_v_m});
  }
  return control;
}

// Readings of a total station, with the network that they make of the control points; where that has tags, the map
// begins. `enu`: world's frame; unset: world is a frame of the surveyor's own.
void AddStations(const Project& project, const std::optional<LocalFrame>& enu, const CancelToken& cancel,
                 SurveyJob* job) {
  const fs::path file = project.dir() / "total_station.csv";
  if (!fs::exists(file)) return;
  SurveyStations stations;
  stations.sightings = ReadTotalStation(file, &job->warnings);
  if (stations.sightings.empty()) return;
  stations.known = NetworkControl(project);
  stations.level_from_world = LevelFromWorld(stations.known, stations.sightings, enu);
  stations.network = AdjustNetwork(stations.sightings, stations.known, cancel, stations.level_from_world);
  const StationNetwork& network = stations.network;
  job->warnings.insert(job->warnings.end(), network.warnings.begin(), network.warnings.end());
  if (!network.unplaced.empty()) {
    job->warnings.push_back(
        fmt::format("total_station.csv: {} cannot be placed from the control points and take no part",
                    fmt::join(network.unplaced, ", ")));
  }
  for (size_t k = 0; k < network.points.size(); ++k) {
    const NetworkPoint& point = network.points[k];
    const auto tag = TagOfTarget(point.name);
    const bool known = std::any_of(stations.known.begin(), stations.known.end(),
                                   [&](const NetworkPoint& p) { return p.name == point.name; });
    if (!tag || known) continue;
    const auto at = 3 * static_cast<Eigen::Index>(k);
    const Eigen::Vector3d variance = network.covariance.diagonal().segment<3>(at);
    SurveyPoint p;
    p.name = point.name;
    p.start_only = true;
    p.tag_id = tag->first, p.corner = tag->second;
    p.world_m = point.position;
    p.sigma_h_m = std::sqrt(0.5 * (variance.x() + variance.y()));
    p.sigma_v_m = std::sqrt(variance.z());
    job->input.points.push_back(p);
  }
  job->input.stations = std::move(stations);
}

// Whether a control point is one that a total station reads or stands on.
bool IsInNetwork(const SurveyJob& job, const std::string& point) {
  if (!job.input.stations) return false;
  const std::vector<NetworkPoint>& points = job.input.stations->network.points;
  return std::any_of(points.begin(), points.end(), [&](const NetworkPoint& p) { return p.name == point; });
}

void AddControl(const Project& project, bool used, SurveyJob* job) {
  std::vector<SurveyPoint> points;
  bool roles = false;
  KnownPoints known = ReadKnownPoints(project, &job->warnings);
  UseNewestEpochs(project, &known.points, job);
  for (const ControlPoint& c : known.points) roles |= c.has_role;
  bool local = true;
  for (const ControlPoint& c : known.points) {
    const std::optional<Eigen::Vector3d> world = WorldOf(project, c);
    if (!world) continue;
    local &= c.local_m.has_value();
    SurveyPoint p;
    p.name = ReviewControlName(c);
    p.role = c.control && used ? PointRole::kControl : PointRole::kCheck;
    p.tag_id = c.tag_id;
    p.corner = c.corner;
    p.world_m = *world;
    p.sigma_h_m = c.sigma_h_m;
    p.sigma_v_m = c.sigma_v_m;
    if (c.tag_id < 0) {
      p.marks = MarksOf(project, c.point, known, *job, &job->warnings);
      if (p.marks.size() < 2 && IsInNetwork(*job, c.point)) continue;
      if (p.marks.size() < 2) {
        job->warnings.push_back(fmt::format("point {} is marked in {} of the survey runs; expected two or more",
                                            c.point, Counted(p.marks.size(), "picture")));
        continue;
      }
    }
    points.push_back(p);
  }
  if (points.empty()) return;
  job->local_frame = local;
  if (!used) {
    job->check_note = "control takes no part in this datum: all surveyed points are check points";
  } else if (!roles) {
    const int withheld = WithholdChecks(&points);
    job->check_note =
        withheld > 0 ? fmt::format(
                           "no roles are given: every third surveyed tag or point is withheld as check, {} of {} "
                           "points",
                           withheld, points.size())
                     : "no independent check: withholding a point would leave fewer than three well-spread control "
                       "points; leave-one-out residuals instead";
  }
  for (const SurveyPoint& p : points) job->has_check |= p.role == PointRole::kCheck;
  if (job->check_note.empty() && !job->has_check) {
    job->check_note =
        "no independent check: every surveyed point has the role control; leave-one-out residuals instead";
  }
  job->input.points.insert(job->input.points.end(), points.begin(), points.end());
}

// A panorama's geotag says where its station's tag is, less the measured offset.
void AddGeotags(const Project& project, SurveyJob* job) {
  if (!project.has_frame()) return;
  for (const Reference& reference : project.site().references) {
    if (!reference.geotag.has_position) continue;
    for (const Station& station : project.site().stations) {
      if (station.name != reference.station || project.review().ExcludesStation(station.name)) continue;
      SurveyPoint p;
      p.name = reference.name;
      p.role = PointRole::kGeotag;
      p.tag_id = station.tag_id;
      p.offset_m = station.offset_m;
      p.offset_in_tag_frame = station.in_tag_frame;
      p.world_m = project.frame().EnuFromGeodetic(reference.geotag.position);
      if (!reference.geotag.has_height) p.world_m.z() = 0;  // the site's origin is the best guess
      p.sigma_h_m = std::hypot(reference.geotag.sigma_h_m, station.sigma_m);
      p.sigma_v_m =
          reference.geotag.has_height ? std::hypot(reference.geotag.sigma_v_m, station.sigma_m) : kUnknownHeightSigma;
      job->input.points.push_back(p);
    }
  }
}

void AddGps(const Project& project, const Run& run, SurveyRun* survey) {
  if (!project.has_frame()) return;
  std::vector<int64_t> stamps;
  for (const ImageDetections& image : survey->images) {  // on the body's clock, as the map's frames are
    const size_t camera = CameraNamed(*survey, image.camera);
    if (camera >= survey->cameras.size()) continue;
    stamps.push_back(BodyStamp(image.stamp_ns, survey->cameras[camera]));
  }
  for (const SurveyTie& tie : survey->ties) stamps.push_back(tie.stamp_ns);
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  for (const GpsFix& fix : run.gps) {
    auto at = std::lower_bound(stamps.begin(), stamps.end(), fix.stamp_ns);
    if (at == stamps.end() || (at != stamps.begin() && fix.stamp_ns - *(at - 1) < *at - fix.stamp_ns)) {
      if (at == stamps.begin()) continue;
      --at;
    }
    if (std::llabs(*at - fix.stamp_ns) > 300'000'000) continue;
    survey->gps.push_back(
        {*at, run.config.gps_lever_arm_m, project.frame().EnuFromGeodetic(fix.position), fix.sigma_h_m, fix.sigma_v_m});
  }
}

void RequireKnownLens(const std::string& run, const std::vector<BodyCamera>& cameras, bool self_calibrate) {
  const bool known = std::none_of(cameras.begin(), cameras.end(),
                                  [](const BodyCamera& c) { return c.focal_sigma_share >= kWildGuess; });
  if (known || self_calibrate) return;
  throw InputError(
      "run " + run +
      ": the lens of its pictures is not known; expected camchain.yaml (`trigpoint calibrate`), photos "
      "whose EXIF states the focal length, a lens that `trigpoint reconstruct` found, or `trigpoint survey "
      "--set map.self_calibrate=true`");
}

void WarnOfGuessedLens(const SurveyRun& run, std::vector<std::string>* warnings) {
  double share = 0;
  for (const BodyCamera& camera : run.cameras) share = std::max(share, camera.focal_sigma_share);
  if (!(share > 0)) return;
  warnings->push_back(fmt::format(
      "run {}: its lens is taken from EXIF (focal length good to {:.0f} %, 1 sigma; no distortion), and the "
      "map's sigmas do not contain that error; calibrate the camera (trigpoint calibrate), run `trigpoint reconstruct` "
      "first, which estimates the lens, or run `trigpoint survey --set map.self_calibrate=true`",
      run.name, 100 * share));
}

// The scene points of a run's reconstruction, and the lenses found there; where it cannot be read, neither is used.
void UseReconstruction(const Project& project, const StageTarget& its, const SurveyStageOptions& options, Run* run,
                       SurveyRun* survey, std::vector<std::string>* warnings) {
  const bool points = UsesScenePoints(options, *run);
  if (!points && !UsesFoundLens(options, *run)) return;
  try {
    const std::vector<BodyCamera> found = FoundLenses(ReconstructionManifest(project, "survey", its).parent_path());
    if (points) AddTies(ReadReconstruction(project, "survey", its), options.ties_per_image, survey);
    TakeLenses(found, &run->cameras);
  } catch (const Error& e) {
    warnings->push_back(fmt::format(
        "run {}: {}: {}", run->name,
        points ? "no scene points, tags and odometry alone" : "the lens that `trigpoint reconstruct` found is not used",
        e.what()));
  }
}

void AddRun(const Project& project, const StageTarget& target, const SurveyStageOptions& options, const Run& run,
            const DetectionsOfRuns* detections, SurveyJob* job) {
  StageTarget its = target;
  its.run = run.name;
  const fs::path file = ResultOf(project, "detect", its) / "detections.csv";
  if (detections != nullptr && !detections->contains(run.name)) return;  // the caller names those without
  if (detections == nullptr && !fs::exists(file)) {
    job->warnings.push_back("run " + run.name + " has no detections and takes no part");
    return;
  }
  SurveyRun survey;
  survey.name = run.name;
  survey.date = run.config.date;
  survey.odometry = run.odometry;
  survey.scale_sigma = run.config.odometry_scale_sigma;
  survey.levelled = run.config.odometry_levelled;
  Run seen = run;  // through the lenses that `reconstruct` found
  UseReconstruction(project, its, options, &seen, &survey, &job->warnings);
  survey.cameras = seen.cameras;
  survey.images = detections != nullptr ? detections->at(run.name) : ReadDetections(file, 0.5, &job->warnings);
  LeaveOutExcluded(project.review(), run.name, survey.images);
  MoveToImageTimes(seen, project.site().tags, &survey.images);
  RequireKnownLens(run.name, survey.cameras, options.map.self_calibrate);
  if (!options.map.self_calibrate) WarnOfGuessedLens(survey, &job->warnings);
  AddGps(project, run, &survey);
  job->input.runs.push_back(std::move(survey));
}

// The photos of a stitched set: the rig takes odometry's place, one photo to the next.
void AddPhotoSet(const Project& project, const Reference& reference, const DetectTagsOptions& options,
                 const StageContext& context, SurveyJob* job) {
  ReferenceTags its = FindReferenceTags(project, reference, options, context);
  SurveyRun set;
  set.name = "photo set " + reference.name;
  set.stills = true;
  set.scale_sigma = its.rig_scale_sigma;
  set.max_gap_s = 2 * static_cast<double>(its.rig.views.size());
  for (size_t i = 0; i < its.rig.views.size(); ++i) {
    const View& view = its.rig.views[i];
    ImageDetections photo;
    photo.stamp_ns = static_cast<int64_t>(i) * 1'000'000'000;  // their order is all that is known
    photo.image = "photos/" + reference.name + "/" + view.name;
    photo.detections = its.tags[i].detections;
    const auto camera = std::find_if(set.cameras.begin(), set.cameras.end(), [&](const BodyCamera& c) {
      return c.camera.params() == view.camera.params() && c.camera.width() == view.camera.width() &&
             c.camera.height() == view.camera.height();
    });
    if (camera == set.cameras.end()) {
      BodyCamera lens;
      lens.name = "lens" + std::to_string(set.cameras.size());
      lens.camera = view.camera;
      photo.camera = lens.name;
      set.cameras.push_back(lens);
    } else {
      photo.camera = camera->name;
    }
    set.odometry.poses.push_back({photo.stamp_ns, view.rig_from_view});
    set.images.push_back(std::move(photo));
  }
  LeaveOutExcluded(project.review(), set.name, set.images);
  std::set<int> unknown;
  bool any = false;
  for (ImageDetections& photo : set.images) {
    std::erase_if(photo.detections, [&](const TagDetection& d) {
      const bool sized = job->input.sizes.SizeOf(d.id) > 0;
      if (!sized) unknown.insert(d.id);
      return !sized;
    });
    any |= !photo.detections.empty();
  }
  for (int id : unknown) {
    job->warnings.push_back(fmt::format("{}: tag {} has no size in tags.yaml and takes no part", set.name, id));
  }
  if (!any) return;  // none to be seen, or not stitched yet
  job->input.runs.push_back(std::move(set));
  job->sets[reference.name] = std::move(its);
}

void AddPhotoSets(const Project& project, const DetectTagsOptions& options, StageContext& context, SurveyJob* job) {
  for (const Reference& reference : project.site().references) {
    if (reference.kind != ReferenceKind::kPhotoSet || project.review().ExcludesStation(reference.station) ||
        project.review().ExcludesPanorama(reference.name)) {
      continue;
    }
    context.cancel.ThrowIfCancelled();
    try {
      AddPhotoSet(project, reference, options, context, job);
    } catch (const InputError& e) {
      job->warnings.push_back("photo set " + reference.name + " takes no part: " + e.what());
    }
  }
}

void AddDistances(const Project& project, SurveyJob* job) {
  const fs::path file = project.dir() / "distances.csv";
  if (!fs::exists(file)) return;
  for (const MeasuredDistance& d : ReadDistances(file, &job->warnings)) {
    job->input.distances.push_back({d.from, d.to, d.distance_m, d.sigma_m, d.check});
  }
}

// The frame that the control's coordinates are in. It is the site's, with two exceptions: the site has no origin, or
// all control is given as x_m, y_m, z_m and lies elsewhere than geotags and GPS (without them: far from the site's
// origin).
std::optional<LocalFrame> FrameOfControl(const Project& project, const SurveyJob& job) {
  if (!project.has_frame()) return std::nullopt;
  std::vector<double> control[2], satellites[2];
  for (const ControlPoint& c : AtNewestEpoch(project.site().control_points)) {
    if (!c.control) continue;
    if (!c.local_m) return project.frame();
    for (int k = 0; k < 2; ++k) control[k].push_back((*c.local_m)[k]);
  }
  SurveyJob geotags;
  AddGeotags(project, &geotags);
  for (const SurveyPoint& p : geotags.input.points) {
    for (int k = 0; k < 2; ++k) satellites[k].push_back(p.world_m[k]);
  }
  for (const SurveyRun& run : job.input.runs) {
    for (const SurveyFix& fix : run.gps) {
      for (int k = 0; k < 2; ++k) satellites[k].push_back(fix.world_m[k]);
    }
  }
  if (control[0].empty()) return project.frame();
  const bool fixed = !satellites[0].empty();
  const double east = fixed ? Median(satellites[0]) : 0, north = fixed ? Median(satellites[1]) : 0;
  if (std::hypot(Median(control[0]) - east, Median(control[1]) - north) > (fixed ? kSameFrame_m : kOneSite_m)) {
    return std::nullopt;
  }
  return project.frame();
}

void SetDatum(const Project& project, const SurveyStageOptions& options, const CancelToken& cancel, SurveyJob* job) {
  SurveyInput& input = job->input;
  const std::string& datum = options.datum;
  input.use_geotags = datum == "auto" || datum == "geotags";
  input.use_control = datum == "auto" || datum == "control";
  if (input.use_control) AddStations(project, FrameOfControl(project, *job), cancel, job);
  AddControl(project, input.use_control, job);
  AddGeotags(project, job);
  bool known = false, fixes = false, levelled = false;
  for (const SurveyPoint& p : input.points) known |= p.role != PointRole::kCheck;
  for (const SurveyRun& run : input.runs) levelled |= run.levelled;
  // What was asked for and isn't there is never replaced by something else.
  if (datum == "control" && !known) {
    throw InputError(
        "datum control: no surveyed point can be used as control; give control_points.csv, or another datum");
  }
  if (datum == "geotags" && !known) {
    throw InputError(
        "datum geotags: no panorama with a position belongs to a station of stations.csv; give them, or another datum");
  }
  if (datum == "gravity" && !levelled) {
    throw InputError(
        "datum gravity: no survey run's odometry is levelled; set odometry: {levelled: true} in its run.yaml, if its z "
        "axis is up");
  }
  for (const SurveyRun& run : input.runs) fixes |= !run.gps.empty();
  input.use_gps = datum == "gps" || (datum == "auto" && !known && fixes);
  if (datum == "gps" && !fixes) throw InputError("datum gps: no survey run has GPS fixes at the time of its pictures");
  input.use_gravity = datum == "gravity" || input.use_gps || (datum == "auto" && !known);
  if (datum == "tag") {
    if (options.fixed_tag < 0) throw OptionError("datum tag needs the tag that is held: --set fixed_tag=ID");
    FixedTag fixed;
    fixed.tag_id = options.fixed_tag;
    if (!options.fixed_pose.empty()) {
      const std::vector<double> n = Numbers(options.fixed_pose, "fixed_pose");
      const Eigen::Quaterniond q =
          n.size() == 7 ? Eigen::Quaterniond(n[6], n[3], n[4], n[5]) : Eigen::Quaterniond(0, 0, 0, 0);
      if (std::abs(q.norm() - 1) > 1e-3) {
        throw OptionError(
            "option fixed_pose: expected seven numbers, x y z qx qy qz qw with a unit quaternion, found '" +
            options.fixed_pose + "'");
      }
      fixed.world_from_tag = Rigid3d(q, {n[0], n[1], n[2]});
      input.fixed_in_world = true;
    } else {
      // Upright: x to the right is east, y down, into the tag north.
      fixed.world_from_tag.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX()));
    }
    input.fixed = fixed;
  }
  if (datum == "plane") {
    for (double id : Numbers(options.plane_tags, "plane_tags")) input.level_tags.push_back(static_cast<int>(id));
    if (input.level_tags.size() < 3)
      throw OptionError("datum plane needs three tags or more: --set plane_tags=\"3 6 9\"");
    for (int id : input.level_tags) {
      const bool seen = std::any_of(input.runs.begin(), input.runs.end(), [&](const SurveyRun& run) {
        return std::any_of(run.images.begin(), run.images.end(), [&](const ImageDetections& image) {
          return std::any_of(image.detections.begin(), image.detections.end(),
                             [&](const TagDetection& d) { return d.id == id; });
        });
      });
      if (!seen) throw InputError(fmt::format("option plane_tags: no picture shows tag {}", id));
    }
  }
}

// Requires that surveyed points and satellite positions agree on the site: same zone, hemisphere and unit of height.
// Throws InputError.
void RequireOneSite(const Project& project, SurveyJob* job) {
  if (!project.has_frame()) return;
  const bool local = job->local_frame;
  job->local_frame = false;  // about the site's origin, unless satellites contradict
  SurveyInput& input = job->input;
  struct Places {
    std::vector<double> east, north, height;
    void Add(const LocalFrame& frame, const Eigen::Vector3d& place, double sigma_v_m) {
      east.push_back(place.x()), north.push_back(place.y());
      if (sigma_v_m < kUnknownHeightSigma) height.push_back(frame.GeodeticFromEnu(place).height_m);
    }
  };
  Places surveyed, satellites;
  for (const SurveyPoint& p : input.points) {
    (p.role == PointRole::kGeotag ? satellites : surveyed).Add(project.frame(), p.world_m, p.sigma_v_m);
  }
  for (const SurveyRun& run : input.runs) {
    for (const SurveyFix& fix : run.gps) satellites.Add(project.frame(), fix.world_m, fix.sigma_v_m);
  }
  if (surveyed.east.empty() || satellites.east.empty()) return;
  const double apart =
      std::hypot(Median(surveyed.east) - Median(satellites.east), Median(surveyed.north) - Median(satellites.north));
  if (local && apart > kSameFrame_m && input.use_control) {
    job->local_frame = true;
    job->warnings.push_back(
        fmt::format("control_points.csv: x_m, y_m, z_m are {:.0f} m from the site's position by geotags and GPS, so "
                    "they are taken as coordinates of a local frame; the map is made in it, without geotags and GPS",
                    apart));
    std::erase_if(input.points, [](const SurveyPoint& p) { return p.role == PointRole::kGeotag; });
    for (SurveyRun& run : input.runs) run.gps.clear();
    return;
  }
  if (apart > kOneSite_m) {
    throw InputError(
        fmt::format("control_points.csv: the surveyed points lie {:.0f} km from the geotags and GPS fixes: "
                    "check the zone, the EPSG code, and whether latitude and longitude are swapped; "
                    "check_conventions=false omits this check",
                    1e-3 * apart));
  }
  if (surveyed.height.empty() || satellites.height.empty()) return;
  const double theirs = Median(surveyed.height), ours = Median(satellites.height);
  if (std::abs(theirs - ours) < kGeoid_m) return;
  const bool feet = std::abs(theirs * kFoot_m - ours) < kGeoid_m,
             geotag_feet = std::abs(ours * kFoot_m - theirs) < kGeoid_m;
  throw InputError(
      fmt::format("control_points.csv: the surveyed heights (median {:.0f} m) differ from those of geotags and GPS "
                  "(median {:.0f} m) by more than any geoid height{}; check_conventions=false omits this check",
                  theirs, ours,
                  feet          ? ": they seem to be in feet, expected metres"
                  : geotag_feet ? ": those of the geotags seem to be in feet, expected metres"
                                : ": check the unit, the sign and the height system"));
}

}  // namespace

std::vector<std::string> SurveyStageOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  if (std::find(kDatums.begin(), kDatums.end(), datum) == kDatums.end()) {
    problems.push_back("option datum is '" + datum + "'; nearest known: '" + NearestName(datum, kDatums) + "'");
  }
  return problems;
}

std::vector<const Run*> SurveyRuns(const Project& project) {
  std::vector<const Run*> runs;
  for (const Run& run : project.site().runs) {
    if (run.config.role != "evaluation") runs.push_back(&run);
  }
  return runs;
}

bool UsesScenePoints(const SurveyStageOptions& options, const Run& run) {
  return options.tie_points && !options.map.self_calibrate && !run.odometry.poses.empty() && !run.images.empty();
}

bool UsesFoundLens(const SurveyStageOptions& options, const Run& run) {
  return !options.map.self_calibrate && !run.images.empty() &&
         std::any_of(run.cameras.begin(), run.cameras.end(),
                     [](const BodyCamera& c) { return c.focal_sigma_share > 0; });
}

std::map<std::string, std::string> RunsOfRefusedOdometry(const Project& project, const StageTarget& target,
                                                         const SurveyStageOptions& options) {
  std::map<std::string, std::string> refused;
  for (const Run* run : SurveyRuns(project)) {
    StageTarget its = target;
    its.run = run->name;
    if (!options.map.check_conventions) break;
    if (const auto why = WhyOdometryIsRefused(project, "survey", its)) refused[run->name] = *why;
  }
  return refused;
}

SurveyJob MakeSurveyJob(const Project& project, const StageTarget& target, const SurveyStageOptions& options,
                        StageContext& context, const DetectionsOfRuns* detections) {
  SurveyJob job;
  job.input.sizes = project.site().tags;
  // Detections of the caller's: it has looked at odometry itself.
  const auto refused =
      detections == nullptr ? RunsOfRefusedOdometry(project, target, options) : std::map<std::string, std::string>();
  for (const auto& [run, why] : refused) {
    job.warnings.push_back("run " + run + " takes no part, as `trigpoint reconstruct` refused its odometry: " + why);
  }
  for (const Run* run : SurveyRuns(project)) {
    if (!refused.contains(run->name)) AddRun(project, target, options, *run, detections, &job);
  }
  if (job.input.runs.empty() && !refused.empty()) throw InputError("no run is left: " + job.warnings.front());
  if (options.photo_sets) AddPhotoSets(project, DetectorOptions(project, target), context, &job);
  if (job.input.runs.empty()) throw InputError("no run has detections: run `trigpoint detect` first");
  AddDistances(project, &job);
  SetDatum(project, options, context.cancel, &job);
  if (options.map.check_conventions) RequireOneSite(project, &job);
  return job;
}

}  // namespace trigpoint
