#include "survey/input/datum.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "survey/input/control.h"
#include "survey/input/satellites.h"
#include "survey/input/site_frame.h"
#include "survey/input/total_stations.h"

namespace trigpoint {
namespace {

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

// Datum tag: the tag that is held.
void HoldTag(const DatumOptions& options, SurveyInput* held) {
  SurveyInput& input = *held;
  if (options.fixed_tag < 0) throw OptionError("datum tag needs the tag that is held: --set fixed_tag=ID");
  FixedTag fixed;
  fixed.tag_id = options.fixed_tag;
  if (!options.fixed_pose.empty()) {
    const std::vector<double> n = Numbers(options.fixed_pose, "fixed_pose");
    const Eigen::Quaterniond q =
        n.size() == 7 ? Eigen::Quaterniond(n[6], n[3], n[4], n[5]) : Eigen::Quaterniond(0, 0, 0, 0);
    if (std::abs(q.norm() - 1) > 1e-3) {
      throw OptionError("option fixed_pose: expected seven numbers, x y z qx qy qz qw with a unit quaternion, found '" +
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

// Datum plane: tags on one horizontal plane.
void LevelTags(const DatumOptions& options, SurveyInput* level) {
  SurveyInput& input = *level;
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

// What was asked for and isn't there is never replaced by something else.
void RequireDatum(const std::string& datum, bool has_control, bool has_geotags, bool levelled) {
  if (datum == "control" && !has_control) {
    throw InputError(
        "datum control: no surveyed point can be used as control; give control_points.csv, or another datum");
  }
  if (datum == "geotags" && !has_geotags) {
    throw InputError(
        "datum geotags: no panorama with a position belongs to a station of stations.csv; give them, or another datum");
  }
  if (datum == "gravity" && !levelled) {
    throw InputError(
        "datum gravity: no survey run's odometry is levelled; set odometry: {levelled: true} in its run.yaml, if its z "
        "axis is up");
  }
}

}  // namespace

std::vector<std::string> DatumOptions::Check() const {
  if (std::find(kDatums.begin(), kDatums.end(), datum) != kDatums.end()) return {};
  return {"option datum is '" + datum + "'; nearest known: '" + NearestName(datum, kDatums) + "'"};
}

void SetDatum(const Project& project, const DatumOptions& options, const CancelToken& cancel, SurveyJob* job) {
  SurveyInput& input = job->input;
  const std::string& datum = options.datum;
  input.use_geotags = datum == "auto" || datum == "geotags";
  input.use_control = datum == "auto" || datum == "control";
  if (input.use_control) AddStations(project, FrameOfControl(project, input), cancel, job);
  AddControl(project, input.use_control, job);
  const auto gives_datum = [](const SurveyPoint& p) { return p.role != PointRole::kCheck; };
  const bool has_control = std::any_of(input.points.begin(), input.points.end(), gives_datum);
  const std::vector<SurveyPoint> geotags = GeotagPoints(project);
  const bool has_geotags = std::any_of(geotags.begin(), geotags.end(), gives_datum), known = has_control || has_geotags;
  input.points.insert(input.points.end(), geotags.begin(), geotags.end());
  bool fixes = false, levelled = false;
  for (const SurveyRun& run : input.runs) levelled |= run.levelled;
  RequireDatum(datum, has_control, has_geotags, levelled);
  for (const SurveyRun& run : input.runs) fixes |= !run.gps.empty();
  input.use_gps = datum == "gps" || (datum == "auto" && !known && fixes);
  if (datum == "gps" && !fixes) throw InputError("datum gps: no survey run has GPS fixes at the time of its pictures");
  input.use_gravity = datum == "gravity" || input.use_gps || (datum == "auto" && !known);
  if (datum == "tag") HoldTag(options, &input);
  if (datum == "plane") LevelTags(options, &input);
}

}  // namespace trigpoint
