#include "eval/plan/layout.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "datasets/io/camchain.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kRefSide_px = 100;     // of NetworkOptions::corner_sigma_px
constexpr double kUnknown_m = 1e4;      // 1 sigma of a height that no geotag has
constexpr double kMostPictures = 5000;  // of a sketched path: more are a mistake, and take hours

std::vector<double> YawsOf(const PlanOptions& options) {
  std::istringstream text(options.camera_yaws_deg);
  std::vector<double> yaws;
  for (std::string word; text >> word;) {
    const auto yaw = ParseDouble(word);
    if (yaw && std::isfinite(*yaw)) yaws.push_back(*yaw * kDegToRad);
  }
  return yaws;
}

std::vector<BodyCamera> CamerasOf(const Project& project, const PlanOptions& options) {
  if (!options.camera.empty()) {
    const fs::path calibrated = project.results() / "calibrate" / options.camera / "camchain.yaml";
    return ReadCamchain(fs::exists(calibrated) ? calibrated : project.dir() / options.camera);
  }
  std::vector<BodyCamera> cameras;
  for (const double yaw : YawsOf(options)) {
    BodyCamera camera;
    camera.name = "cam" + std::to_string(cameras.size());
    camera.camera = Camera::FromFieldOfView(options.width, options.height, options.fov_deg * kDegToRad);
    Eigen::Matrix3d rows;  // right, down, forward in the body's axes
    rows.row(0) = Eigen::Vector3d(std::sin(yaw), -std::cos(yaw), 0);
    rows.row(1) = Eigen::Vector3d(0, 0, -1);
    rows.row(2) = Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0);
    camera.cam_from_body = Rigid3d(Eigen::Quaterniond(rows), Eigen::Vector3d::Zero());
    camera.has_extrinsics = true;
    cameras.push_back(camera);
  }
  return cameras;
}

// A sketch's objects, added to a layout: an empty one, or the site as it was surveyed.
class SketchAdder {
 public:
  SketchAdder(const Project& project, const fs::path& file, const PlanOptions& options, PlanLayout* plan)
      : project_(project), file_(file), options_(options), plan_(*plan) {
    if (project.has_frame()) frame_ = project.frame();
  }

  void Add(const std::vector<SketchItem>& items) {
    CheckFrames(items);
    RequireTagIds(items, plan_.network.sizes.family);
    for (const SketchItem& item : items) {
      if (item.kind == "tag" || item.kind == "candidate") AddTag(item);
    }
    for (const SketchItem& item : items) {
      if (item.kind == "control" || item.kind == "check") AddPoint(item);
      if (item.kind == "station") AddStation(item);
    }
    AddPaths(items, "path", &plan_.network.passes);
    AddPaths(items, "candidate_path", &plan_.candidate_passes);
    if (!plan_.network.world_from_tag.empty() && !plan_.network.passes.empty()) return;
    throw InputError(fmt::format(
        "{}: expected tags and at least one path, found {} and {}; without tags of its own a sketch adds to the site's "
        "survey runs, of which there are none",
        file_.string(), Counted(plan_.network.world_from_tag.size(), "tag"),
        Counted(plan_.network.passes.size(), "path")));
  }

 private:
  void CheckFrames(const std::vector<SketchItem>& items) const {
    if (frame_) return;
    const auto in_metres = [](const SketchItem& item) { return item.local_m.has_value(); };
    const auto in_degrees = [](const SketchItem& item) { return item.geodetic.has_value(); };
    const auto metres = std::find_if(items.begin(), items.end(), in_metres);
    const auto degrees = std::find_if(items.begin(), items.end(), in_degrees);
    if (metres == items.end() || degrees == items.end()) return;
    throw InputError(
        fmt::format("{}: {} {} is given in degrees, {} {} ({}) in metres; expected one of both, or the "
                    "site's origin.json, from which metres count",
                    degrees->where, degrees->kind, degrees->name, metres->kind, metres->name, metres->where));
  }

  Eigen::Vector3d Place(const SketchItem& item) {
    if (item.local_m) return *item.local_m;
    if (!frame_) frame_ = LocalFrame(*item.geodetic);  // any origin near the site will do
    return frame_->EnuFromGeodetic(*item.geodetic);
  }

  void AddTag(const SketchItem& item) {
    const Rigid3d pose = UprightTag(Place(item), *item.heading_rad);
    if (item.kind == "candidate") {
      plan_.candidates[item.name] = pose;
      if (item.size_m > 0) plan_.candidate_size_m = item.size_m;
      return;
    }
    TagSizes& sizes = plan_.network.sizes;
    plan_.network.world_from_tag[item.tag_id] = pose;
    if (item.size_m > 0) sizes.sizes_m[item.tag_id] = item.size_m;
    if (!(sizes.SizeOf(item.tag_id) > 0)) {
      throw InputError(
          fmt::format("{}: tag {} has no size; give size_mm, or its entry in tags.yaml", item.where, item.tag_id));
    }
    plan_.candidate_size_m = std::max(plan_.candidate_size_m, sizes.SizeOf(item.tag_id));
  }

  void AddPoint(const SketchItem& item) {
    const auto tag = plan_.network.world_from_tag.find(item.tag_id);
    if (tag == plan_.network.world_from_tag.end()) {
      throw InputError(fmt::format("{}: {} on tag {}, which is not among the tags; add a row 'tag,{},...'", item.where,
                                   item.kind, item.tag_id, item.tag_id));
    }
    // What is planned for a tag replaces what the site had for it.
    std::erase_if(plan_.network.points,
                  [&](const SurveyPoint& p) { return p.tag_id == item.tag_id && p.role != PointRole::kGeotag; });
    SurveyPoint point;
    point.name = std::to_string(item.tag_id);
    point.role = item.kind == "control" ? PointRole::kControl : PointRole::kCheck;
    point.tag_id = item.tag_id;
    point.world_m = tag->second.translation;
    point.sigma_h_m = item.sigma_h_m;
    point.sigma_v_m = item.sigma_v_m;
    plan_.network.points.push_back(point);
  }

  void AddStation(const SketchItem& item) {
    const Eigen::Vector3d at = Place(item);
    plan_.network.panoramas.push_back(
        {item.name, {Eigen::Quaterniond::Identity(), at}, item.sigma_h_m, item.sigma_v_m});
    const auto tag = plan_.network.world_from_tag.find(item.tag_id);
    if (tag != plan_.network.world_from_tag.end()) {
      plan_.stations.push_back({item.name, item.tag_id, at - tag->second.translation, 0.01});
      return;
    }
    if (item.tag_id >= 0) {
      throw InputError(
          fmt::format("{}: station {} is beside tag {}, which is not among the tags; add a row 'tag,{},...'",
                      item.where, item.name, item.tag_id, item.tag_id));
    }
    plan_.notes.push_back("station " + item.name + " has no tag_id of a tag beside it: no accuracy of its own");
  }

  bool UsesSurveyedCameras() const { return plan_.learned && options_.camera.empty(); }

  // A surveyed camera is carried as its run carried it; a sketched one looks along its way.
  Eigen::Quaterniond WayFromCarrier() const {
    if (!UsesSurveyedCameras()) return Eigen::Quaterniond::Identity();
    const PlannedPass& like = plan_.network.passes.front();
    if (const auto way_from_body = WayFromBody(like.world_from_body)) return *way_from_body;
    throw InputError(
        fmt::format("{}: the cameras of run {} do not keep one direction relative to its way, so a sketched path "
                    "cannot repeat it; name a camera (--set camera=CALIBRATION)",
                    file_.string(), like.name));
  }

  PlannedPass EmptyPass() const {
    PlannedPass pass;
    if (!UsesSurveyedCameras()) {
      pass.cameras = CamerasOf(project_, options_);
      return pass;
    }
    const PlannedPass& like = plan_.network.passes.front();
    pass.date = "planned";
    pass.cameras = like.cameras;
    pass.corner_factor = like.corner_factor;
    pass.odometry_factor = like.odometry_factor;
    pass.scale_sigma = like.scale_sigma;
    return pass;
  }

  void AddPaths(const std::vector<SketchItem>& items, const std::string& kind, std::vector<PlannedPass>* passes) {
    std::vector<std::pair<std::string, std::vector<Eigen::Vector3d>>> paths;
    for (const SketchItem& item : items) {
      if (item.kind != kind) continue;
      if (paths.empty() || paths.back().first != item.name) paths.push_back({item.name, {}});
      paths.back().second.push_back(Place(item));
    }
    for (const auto& [name, corners] : paths) {
      PlannedPass pass = EmptyPass();
      pass.name = name;
      double length = 0;
      for (size_t k = 1; k < corners.size(); ++k) length += (corners[k] - corners[k - 1]).norm();
      const double pictures = length * options_.rate_hz / options_.speed_m_s;
      if (pictures > kMostPictures) {
        throw InputError(
            fmt::format("{}: path {} of {:.0f} m takes {:.0f} pictures at {:g} m/s and {:g} Hz; expected at "
                        "most {:.0f}: lower rate_hz",
                        file_.string(), name, length, pictures, options_.speed_m_s, options_.rate_hz, kMostPictures));
      }
      pass.world_from_body = PosesAlong(corners, options_.speed_m_s, options_.rate_hz, WayFromCarrier());
      if (pass.world_from_body.size() < 2) {
        throw InputError(fmt::format(
            "{}: path {} gives no two pictures: expected corners at least {:.2g} m apart "
            "({:g} m/s at {:g} Hz)",
            file_.string(), name, options_.speed_m_s / options_.rate_hz, options_.speed_m_s, options_.rate_hz));
      }
      passes->push_back(std::move(pass));
    }
  }

  const Project& project_;
  const fs::path& file_;
  const PlanOptions& options_;
  PlanLayout& plan_;
  std::optional<LocalFrame> frame_;
};

// Pictures between those that the map placed: along odometry, its drift spread over the gap.
std::vector<TimedPose> AllPoses(const Run& run, const std::vector<TimedPose>& placed) {
  std::vector<TimedPose> poses;
  constexpr int64_t kAnyGap = std::numeric_limits<int64_t>::max();
  const auto known = [&](int64_t stamp) -> std::optional<Rigid3d> {
    const auto after = std::lower_bound(placed.begin(), placed.end(), stamp,
                                        [](const TimedPose& p, int64_t s) { return p.stamp_ns < s; });
    if (after != placed.end() && after->stamp_ns == stamp) return after->target_from_body;
    const auto odom = run.odometry.At(stamp, kAnyGap);
    if (!odom) return std::nullopt;
    const auto from = [&](const TimedPose& p) -> std::optional<Rigid3d> {
      const auto its = run.odometry.At(p.stamp_ns, kAnyGap);
      if (!its) return std::nullopt;
      return p.target_from_body * its->Inverse() * *odom;
    };
    const auto next = after != placed.end() ? from(*after) : std::nullopt;
    const auto last = after != placed.begin() ? from(*std::prev(after)) : std::nullopt;
    if (!next || !last) return next ? next : last;
    const double share = static_cast<double>(stamp - std::prev(after)->stamp_ns) /
                         static_cast<double>(after->stamp_ns - std::prev(after)->stamp_ns);
    return Interpolate(*last, *next, share);
  };
  for (const ImageEntry& image : run.images) {
    const int64_t stamp = BodyStamp(image.stamp_ns, run.cameras[static_cast<size_t>(image.camera)]);
    if (!poses.empty() && poses.back().stamp_ns == stamp) continue;
    if (const auto pose = known(stamp)) poses.push_back({stamp, *pose});
  }
  return poses.size() > 1 ? poses : placed;
}

// What `localize` will look for in the pictures.
void AddPanoramas(const Project& project, PlanLayout* plan) {
  for (const Reference& reference : project.site().references) {
    if (!reference.geotag.has_position || !project.has_frame() || reference.kind == ReferenceKind::kPhotoSet) continue;
    const GeoTag& tag = reference.geotag;
    PlannedPanorama panorama{reference.station.empty() ? reference.name : reference.station};
    panorama.world_from_pano = {WorldFromCamRotation(tag.attitude), project.frame().EnuFromGeodetic(tag.position)};
    panorama.sigma_h_m = tag.sigma_h_m;
    panorama.sigma_v_m = tag.has_height ? tag.sigma_v_m : kUnknown_m;
    panorama.sigma_heading_rad = tag.has_heading ? tag.sigma_heading_rad : M_PI;
    panorama.sigma_tilt_rad = tag.has_tilt ? tag.sigma_tilt_rad : M_PI;
    plan->network.panoramas.push_back(panorama);
  }
}

}  // namespace

fs::path SketchFile(const Project& project, const PlanOptions& options) {
  if (!options.sketch.empty()) {
    const fs::path file = project.dir() / options.sketch;
    if (!fs::is_regular_file(file)) {
      throw InputError(file.string() + ": no such sketch; expected a CSV or GeoJSON file (docs/file_formats.md)");
    }
    return file;
  }
  for (const char* name : {"plan.csv", "plan.geojson"}) {
    if (fs::is_regular_file(project.dir() / name)) return project.dir() / name;
  }
  return {};
}

bool AddsToSurvey(const std::vector<SketchItem>& items, bool has_survey_runs) {
  return has_survey_runs &&
         std::none_of(items.begin(), items.end(), [](const SketchItem& item) { return item.kind == "tag"; });
}

PlanLayout LayoutOfSurvey(const Project& project, const SurveyInput& input, const NetworkOptions& noise,
                          const fs::path& to_add, StageContext& context) {
  const SurveyResult map = SurveyTags(input, SurveyOptions{}, context.threads, context.progress, context.cancel);
  PlanLayout plan = LayoutOfMap(project, input, map, noise);
  AddPanoramas(project, &plan);
  if (to_add.empty() || map.in_world) return plan;
  throw InputError(to_add.string() +
                   ": the site's survey has no datum, so a sketch cannot be added to it; add control or geotags to the "
                   "site, or sketch its tags, too");
}

PlanLayout LayoutOfSketch(const Project& project, const fs::path& file, const std::vector<SketchItem>& items,
                          const PlanOptions& options, PlanLayout plan) {
  if (plan.learned) {
    plan.source = file.filename().string() + " and " + plan.source;
  } else {
    plan.source = file.filename().string();
    plan.noise = options.network;
    plan.network.sizes = project.site().tags;
  }
  const size_t passes = plan.network.passes.size();
  SketchAdder(project, file, options, &plan).Add(items);
  if (options.earlier_runs || passes == 0) return plan;
  if (plan.network.passes.size() == passes) {
    throw InputError(file.string() + ": earlier_runs is false, and no path is sketched; expected a path");
  }
  plan.network.passes.erase(plan.network.passes.begin(),
                            plan.network.passes.begin() + static_cast<std::ptrdiff_t>(passes));
  plan.source += ", its runs left out";
  return plan;
}

PlanLayout LayoutOfMap(const Project& project, const SurveyInput& input, const SurveyResult& map,
                       const NetworkOptions& noise) {
  PlanLayout plan;
  plan.source = "the survey of " + Counted(input.runs.size(), "run");
  plan.learned = true;
  plan.noise = noise;
  NetworkLayout& network = plan.network;
  network.sizes = input.sizes;
  network.points = input.points;
  network.distances = input.distances;
  std::erase_if(network.points, [](const SurveyPoint& p) { return p.tag_id < 0; });
  for (const TagEstimate& tag : map.tags) {
    plan.images_seen[tag.tag_id] = tag.images;
    if (tag.HasPose()) network.world_from_tag[tag.tag_id] = *tag.world_from_tag;
    plan.candidate_size_m = std::max(plan.candidate_size_m, tag.size_m);
  }
  std::vector<double> sharp;  // corner sigmas as of a tag of 100 px
  for (size_t r = 0; r < input.runs.size(); ++r) {
    const SurveyRun& run = input.runs[r];
    const RunAgreement& found = map.runs[r];
    PlannedPass pass;
    pass.name = run.name;
    pass.date = run.date;
    pass.cameras = run.cameras;
    pass.world_from_body = AllPoses(project.run(run.name), found.world_from_body);
    pass.scale_sigma = run.scale_sigma;
    pass.corner_factor = found.corner_factor;
    pass.odometry_factor = found.odometry_factor;
    if (pass.world_from_body.size() > 1) network.passes.push_back(std::move(pass));
    for (const ImageDetections& image : run.images) {
      for (const TagDetection& d : image.detections) {
        double side = 1e9;
        for (size_t k = 0; k < 4; ++k) side = std::min(side, (d.corners[k] - d.corners[(k + 1) % 4]).norm());
        sharp.push_back(d.SigmaPx() * std::sqrt(side / kRefSide_px));
      }
    }
  }
  if (!sharp.empty()) plan.noise.corner_sigma_px = Median(sharp);
  plan.noise.exposure_ms = 0;  // its blur is in these sigmas
  for (const Station& station : project.site().stations) {
    const auto tag = network.world_from_tag.find(station.tag_id);
    if (tag == network.world_from_tag.end()) continue;
    plan.stations.push_back({station.name, station.tag_id, station.offset_m, station.sigma_m});
  }
  return plan;
}

std::vector<std::string> PlanOptions::Check() const {
  std::vector<std::string> problems = network.Check();
  for (const std::string& problem : CheckRanges(*this)) problems.push_back(problem);
  if (!suggest.empty() && suggest != "tags" && suggest != "control" && suggest != "path") {
    problems.push_back("suggest '" + suggest + "': expected tags, control or path");
  }
  if (camera.empty() && YawsOf(*this).empty()) {
    problems.push_back("camera_yaws_deg '" + camera_yaws_deg + "': expected degrees, as \"0 180\"");
  }
  return problems;
}

Rigid3d UprightTag(const Eigen::Vector3d& centre, double heading_rad) {
  Eigen::Matrix3d columns;
  columns.col(2) = -Eigen::Vector3d(std::sin(heading_rad), std::cos(heading_rad), 0);  // into the tag
  columns.col(1) = -Eigen::Vector3d::UnitZ();
  columns.col(0) = columns.col(1).cross(columns.col(2));
  return {Eigen::Quaterniond(columns), centre};
}

std::optional<Eigen::Quaterniond> WayFromBody(const std::vector<TimedPose>& poses) {
  constexpr double kKept = 0.5;  // length of the mean direction of each axis; 1: all are the same
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  double length = 0;
  for (size_t k = 1; k < poses.size(); ++k) {
    const Rigid3d& body = poses[k].target_from_body;
    const Eigen::Vector2d step = (body.translation - poses[k - 1].target_from_body.translation).head<2>();
    const Eigen::AngleAxisd way(std::atan2(step.y(), step.x()), Eigen::Vector3d::UnitZ());
    sum += step.norm() * (way.inverse() * body.rotation).toRotationMatrix();
    length += step.norm();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(length > 0) || svd.singularValues()(2) < kKept * length) return std::nullopt;
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose()));
}

std::vector<TimedPose> PosesAlong(const std::vector<Eigen::Vector3d>& corners, double speed_m_s, double rate_hz,
                                  const Eigen::Quaterniond& way_from_body) {
  std::vector<double> at = {0};
  for (size_t k = 1; k < corners.size(); ++k) at.push_back(at.back() + (corners[k] - corners[k - 1]).norm());
  const auto point = [&](double s) -> Eigen::Vector3d {
    const auto next = std::upper_bound(at.begin(), at.end(), s);
    const auto k = static_cast<size_t>(std::clamp<std::ptrdiff_t>(next - at.begin(), 1, std::ssize(at) - 1));
    const double length = at[k] - at[k - 1];
    const double share = length > 0 ? std::clamp((s - at[k - 1]) / length, 0.0, 1.0) : 0;
    return corners[k - 1] + share * (corners[k] - corners[k - 1]);
  };
  std::vector<TimedPose> poses;
  if (corners.size() < 2) return poses;
  constexpr double kTurn_m = 0.5;  // a corner is turned over a metre of way
  const double step = speed_m_s / rate_hz;
  for (int k = 0; k * step <= at.back() + 1e-9; ++k) {
    const double s = k * step;
    const Eigen::Vector3d ahead = point(std::min(at.back(), s + kTurn_m)) - point(std::max(0.0, s - kTurn_m));
    const double yaw = std::atan2(ahead.y(), ahead.x());
    poses.push_back({std::llround(1e9 * k / rate_hz),
                     Rigid3d(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * way_from_body, point(s))});
  }
  return poses;
}

}  // namespace trigpoint
