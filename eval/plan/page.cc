#include "eval/plan/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/plan/map.h"
#include "eval/report/document.h"
#include "eval/report/plan.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kMm = 1e3;
constexpr size_t kShown = 3;  // of each kind, in a summary
constexpr double kInfinite = std::numeric_limits<double>::infinity();

Eigen::Matrix3d Position(const Matrix6d& covariance) { return covariance.bottomRightCorner<3, 3>(); }

// Covariance of a station's centre by its tag: the offset turns with nothing, it is given along the world's axes.
std::optional<Eigen::Matrix3d> StationCovariance(const PlanStationItem& station, const NetworkPrediction& prediction) {
  for (const TagPrediction& tag : prediction.tags) {
    if (tag.tag_id != station.tag_id || !tag.tied) continue;
    return Eigen::Matrix3d(Position(tag.covariance) + station.sigma_m * station.sigma_m * Eigen::Matrix3d::Identity());
  }
  return std::nullopt;
}

// Of the long axis, deg from north, 0 to 180.
double Bearing(const HorizontalEllipse& e) { return std::fmod(450 - e.angle * kRadToDeg, 180); }

void WriteTagsTable(const PlanFindings& findings, const fs::path& file) {
  CsvWriter csv(
      {"tag_id", "x", "y", "z", "sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_rx_deg", "sigma_ry_deg", "sigma_rz_deg",
       "ellipse_a_m", "ellipse_b_m", "ellipse_bearing_deg", "images", "images_needed", "passes", "role", "status"},
      {"trigpoint plan tags 1; frame=enu; datum=" + findings.prediction.datum +
       "; sigma=1, predicted; rotation about the tag's axes; ellipse: horizontal, bearing of its long axis"});
  const std::map<int, Rigid3d>& world_from_tag = findings.layout.network.world_from_tag;
  for (const TagPrediction& tag : findings.prediction.tags) {
    csv.Integer(tag.tag_id);
    for (int k = 0; k < 3; ++k) csv.Number(tag.world_m[k], 4);
    if (tag.tied) {
      const HorizontalEllipse e = EllipseOf(Position(tag.covariance));
      for (int k = 0; k < 3; ++k) csv.Number(tag.Sigma()[k], 6);
      const Eigen::Matrix3d r = world_from_tag.at(tag.tag_id).rotation.toRotationMatrix();
      const Eigen::Matrix3d about_tag = r.transpose() * tag.covariance.topLeftCorner<3, 3>() * r;
      for (int k = 0; k < 3; ++k) csv.Number(std::sqrt(std::max(0.0, about_tag(k, k))) * kRadToDeg, 5);
      csv.Number(e.a, 6).Number(e.b, 6).Number(Bearing(e), 1);
    } else {
      csv.Empty(9);
    }
    csv.Integer(tag.images);
    if (const auto needed = findings.images_needed.find(tag.tag_id); needed != findings.images_needed.end()) {
      csv.Integer(needed->second);
    } else {
      csv.Empty();
    }
    csv.Integer(tag.passes).Text(tag.role).Text(tag.tied ? "ok" : "not seen");
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteCamerasTable(const PlanFindings& findings, const fs::path& file) {
  CsvWriter csv({"pass", "timestamp", "x", "y", "z", "sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_rx_deg",
                 "sigma_ry_deg", "sigma_rz_deg", "tags"},
                {"trigpoint plan cameras 1; frame=enu; the body that carries the cameras; sigma=1, predicted; rotation "
                 "about the world's axes"});
  for (const BodyPrediction& body : findings.prediction.bodies) {
    csv.Text(findings.layout.network.passes[static_cast<size_t>(body.pass)].name).Stamp(body.stamp_ns);
    for (int k = 0; k < 3; ++k) csv.Number(body.world_from_body.translation[k], 4);
    for (int k = 3; k < 6; ++k) csv.Number(std::sqrt(std::max(0.0, body.covariance(k, k))), 6);
    for (int k = 0; k < 3; ++k) csv.Number(std::sqrt(std::max(0.0, body.covariance(k, k))) * kRadToDeg, 5);
    csv.Integer(body.tags);
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteStationsTable(const PlanFindings& findings, const fs::path& file) {
  CsvWriter csv({"station", "tag_id", "sigma_x_m", "sigma_y_m", "sigma_z_m"},
                {"trigpoint plan stations 1; frame=enu; sigma=1, predicted, of the centre by its tag and offset"});
  for (const PlanStationItem& station : findings.layout.stations) {
    const auto covariance = StationCovariance(station, findings.prediction);
    csv.Text(station.name).Integer(station.tag_id);
    for (int k = 0; k < 3; ++k) {
      if (covariance) {
        csv.Number(std::sqrt((*covariance)(k, k)), 6);
      } else {
        csv.Empty();
      }
    }
    csv.EndRow();
  }
  csv.Save(file);
}

std::string MatchWords(const NetworkOptions& noise) {
  return fmt::format(
      "expected, that is scene points seen from at most {:g} m away, {:g} deg from the panorama's direction and {:g} "
      "times as near or as far; {} are needed",
      noise.match_reach_m, noise.match_angle_deg, noise.match_ratio, kMatchesNeeded);
}

void WritePanoramasTable(const PlanFindings& findings, const fs::path& file) {
  CsvWriter csv(
      {"pass", "station", "sigma_x_m", "sigma_y_m", "sigma_z_m", "points", "matches"},
      {"trigpoint plan panoramas 1; frame=enu; sigma=1, as `localize` would state it from this pass by itself if it "
       "finds the panorama, held by the panoramas' geotags; points: of the scene, shared with the pass; matches: " +
       MatchWords(findings.layout.noise)});
  for (const PanoramaPrediction& panorama : findings.panoramas) {
    csv.Text(findings.layout.network.passes[static_cast<size_t>(panorama.pass)].name).Text(panorama.name);
    for (int k = 0; k < 3; ++k) csv.Number(panorama.Sigma()[k], 6);
    csv.Integer(panorama.points).Integer(panorama.matches);
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteObservationTables(const PlanFindings& findings, const fs::path& folder) {
  CsvWriter sights(
      {"pass", "timestamp", "camera", "tag_id", "side_px", "angle_deg", "sigma_px", "redundancy", "blunder_px"},
      {"trigpoint plan observations 1; of the least controlled of a tag's eight coordinates: redundancy 0 "
       "to 1, smallest blunder found with 80 % probability by a test at 0.1 %"});
  for (const SightPrediction& s : findings.prediction.sights) {
    sights.Text(findings.layout.network.passes[static_cast<size_t>(s.pass)].name).Stamp(s.stamp_ns).Integer(s.camera);
    sights.Integer(s.tag_id).Number(s.side_px, 1).Number(s.angle_deg, 1).Number(s.sigma_px, 3);
    sights.Number(s.worst.redundancy, 4).Number(s.worst.blunder, 3);
    sights.EndRow();
  }
  sights.Save(folder / "observations.csv");
  CsvWriter points({"point", "tag_id", "role", "used", "redundancy_h", "blunder_h_m", "effect_h_m", "redundancy_v",
                    "blunder_v_m", "effect_v_m"},
                   {"trigpoint plan known points 1; smallest blunder found with 80 % probability by a test at 0.1 % "
                    "(empty: none is found), and how far one of that size moves the tag"});
  for (const PointPrediction& p : findings.prediction.points) {
    const char* role = p.role == PointRole::kControl ? "control" : p.role == PointRole::kCheck ? "check" : "geotag";
    points.Text(p.name).Integer(p.tag_id).Text(role).Integer(p.used ? 1 : 0);
    for (const Reliability& r : {p.horizontal, p.vertical}) {
      if (p.used) {
        points.Number(r.redundancy, 4).Number(r.blunder, 4).Number(r.effect_m, 4);
      } else {
        points.Empty(3);
      }
    }
    points.EndRow();
  }
  points.Save(folder / "known_points.csv");
}

void WriteDistances(const std::vector<DistancePrediction>& distances, const fs::path& file) {
  CsvWriter csv({"from", "to", "sigma_m", "redundancy", "blunder_m", "effect_m"},
                {"trigpoint plan distances 1; smallest blunder found with 80 % probability by a test at 0.1 % (empty: "
                 "none is found), and how far one of that size moves the first tag"});
  for (const DistancePrediction& d : distances) {
    csv.Integer(d.distance.from).Integer(d.distance.to).Number(d.distance.sigma_m, 4);
    csv.Number(d.reliability.redundancy, 4).Number(d.reliability.blunder, 4).Number(d.reliability.effect_m, 4);
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteGains(const std::vector<PlanGain>& gains, const NetworkPrediction& plan, const fs::path& file) {
  CsvWriter csv(
      {"rank", "what", "rms_before_m", "rms_after_m", "x", "y", "z", "heading_deg"},
      {"trigpoint plan gains 1; root mean square 3D sigma of the tags; heading: the way a tag faces, clockwise "
       "from north; empty rms: not determined"});
  int rank = 0;
  for (const PlanGain& gain : gains) {
    csv.Integer(++rank).Text(gain.what).Number(gain.Before(plan), 6).Number(gain.rms_after_m, 6);
    if (gain.world_m) {
      for (int k = 0; k < 3; ++k) csv.Number((*gain.world_m)[k], 3);
    } else {
      csv.Empty(3);
    }
    if (gain.heading_rad) {
      csv.Number(std::fmod(*gain.heading_rad * kRadToDeg + 360, 360), 1);
    } else {
      csv.Empty();
    }
    csv.EndRow();
  }
  csv.Save(file);
}

const TagPrediction* Weakest(const NetworkPrediction& prediction) {
  const TagPrediction* weakest = nullptr;
  for (const TagPrediction& tag : prediction.tags) {
    if (tag.tied && (weakest == nullptr || TagSigma(tag) > TagSigma(*weakest))) weakest = &tag;
  }
  return weakest;
}

nlohmann::json Finite(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr); }

nlohmann::json SummaryOf(const PlanFindings& f) {
  const NetworkPrediction& p = f.prediction;
  std::vector<double> cameras;
  for (const BodyPrediction& body : p.bodies) cameras.push_back(BodySigma(body));
  nlohmann::json json = {{"schema", 1},
                         {"source", f.layout.source},
                         {"noise_of_earlier_survey", f.layout.learned},
                         {"datum", p.datum},
                         {"gauge", p.gauge},
                         {"in_world", p.in_world},
                         {"rms_tag_sigma_m", p.RmsSigma()},
                         {"camera_sigma_median_m", Percentile(cameras, 0.5)},
                         {"camera_sigma_p95_m", Percentile(cameras, 0.95)},
                         {"warnings", p.warnings},
                         {"suggestion_note", f.suggestion_note}};
  json["tags"] = std::count_if(p.tags.begin(), p.tags.end(), [](const TagPrediction& t) { return t.tied; });
  json["tags_not_seen"] = json["why_not_seen"] = nlohmann::json::array();
  for (const TagPrediction& tag : p.tags) {
    if (tag.tied) continue;
    json["tags_not_seen"].push_back(tag.tag_id);
    json["why_not_seen"].push_back(f.unseen.at(tag.tag_id));
  }
  const TagPrediction* weakest = Weakest(p);
  json["weakest_tag"] = weakest != nullptr ? nlohmann::json(weakest->tag_id) : nlohmann::json(nullptr);
  json["weakest_tag_sigma_m"] = weakest != nullptr ? nlohmann::json(TagSigma(*weakest)) : nlohmann::json(nullptr);
  json["uncontrolled_points"] = nlohmann::json::array();
  for (const PointPrediction& point : p.points) {
    constexpr double kControlled = 0.1;
    if (point.used && std::min(point.horizontal.redundancy, point.vertical.redundancy) < kControlled) {
      json["uncontrolled_points"].push_back(point.name);
    }
  }
  for (const char* list : {"gains", "suggestions"}) {
    json[list] = nlohmann::json::array();
    for (const PlanGain& gain : std::string(list) == "gains" ? f.gains : f.suggestions) {
      json[list].push_back({{"kind", gain.kind}, {"what", gain.what}, {"rms_after_m", Finite(gain.rms_after_m)}});
    }
  }
  json["sketched_tags_mm"] = nlohmann::json::array();  // id and size; a surveyed site has its tags
  for (const auto& [tag_id, pose] : f.layout.network.world_from_tag) {
    if (!f.layout.learned) json["sketched_tags_mm"].push_back({tag_id, kMm * f.layout.network.sizes.SizeOf(tag_id)});
  }
  // The panoramas least likely to be found.
  std::vector<PanoramaPrediction> by_matches = f.panoramas;
  std::stable_sort(by_matches.begin(), by_matches.end(),
                   [](const auto& a, const auto& b) { return a.matches < b.matches; });
  json["fewest_matches"] = nlohmann::json::array();
  for (size_t k = 0; k < std::min(kShown, by_matches.size()); ++k) {
    json["fewest_matches"].push_back(fmt::format("{}/{} {}",
                                                 f.layout.network.passes[static_cast<size_t>(by_matches[k].pass)].name,
                                                 by_matches[k].name, by_matches[k].matches));
  }
  json["gates"] = nlohmann::json::array();
  for (const PlanGate& gate : f.gates) {
    json["gates"].push_back({{"gate", gate.gate},
                             {"value", Finite(gate.value)},
                             {"passed", gate.undecided ? nlohmann::json(nullptr) : nlohmann::json(gate.passed)}});
  }
  return json;
}

TableCell Number(double value, int decimals, Tone tone = Tone::kPlain) {
  if (!std::isfinite(value)) return {"-", 1e99, tone};
  return {fmt::format("{:.{}f}", value, decimals), value, tone};
}
TableCell Text(const std::string& text, Tone tone = Tone::kPlain) { return {text, std::nullopt, tone}; }

// Of the horizontal part of a covariance (m^2).
std::string Ellipse95(const Eigen::Matrix3d& covariance) {
  const HorizontalEllipse e = EllipseOf(covariance);
  return fmt::format("{:.1f} x {:.1f}, {:.0f} deg", kMm * kSigmas95 * e.a, kMm * kSigmas95 * e.b, Bearing(e));
}

Table TagTable(const PlanFindings& f) {
  Table table{
      "",
      "Predicted standard deviations (1 sigma) of the tags' centres, site east-north-up; horizontal 95 % ellipse with "
      "the bearing of its long axis. Needed: pictures, spread as the planned ones, for the gate's sigma, or without a "
      "gate for one within 10 % of that predicted"};
  constexpr const char* kUnseen = "no planned picture shows the tag";
  constexpr const char* kNotByPictures = "no planned picture shows the tag, or no number of pictures reaches the gate";
  table.columns = {{"tag", true},
                   {"role"},
                   {"pictures", true},
                   {"needed", true, kNotByPictures},
                   {"passes", true},
                   {"east (mm)", true, kUnseen},
                   {"north (mm)", true, kUnseen},
                   {"up (mm)", true, kUnseen},
                   {"3D (mm)", true, kUnseen},
                   {"95 % ellipse, half axes (mm)", false, kUnseen}};
  if (f.layout.learned) table.columns.push_back({"pictures in the survey", true, "the survey has not seen it"});
  for (const TagPrediction& tag : f.prediction.tags) {
    const Eigen::Vector3d sigma = kMm * tag.Sigma();
    std::vector<TableCell> row = {Number(tag.tag_id, 0),
                                  Text(tag.tied ? tag.role : "not seen", tag.tied ? Tone::kPlain : Tone::kBad),
                                  Number(tag.images, 0)};
    const auto needed = f.images_needed.find(tag.tag_id);
    row.push_back(needed != f.images_needed.end() ? Number(needed->second, 0) : Text(""));
    row.push_back(Number(tag.passes, 0));
    for (int k = 0; k < 3; ++k) row.push_back(tag.tied ? Number(sigma[k], 1) : Text(""));
    row.push_back(tag.tied ? Number(sigma.norm(), 1) : Text(""));
    row.push_back(Text(tag.tied ? Ellipse95(Position(tag.covariance)) : ""));
    if (f.layout.learned) {
      const auto seen = f.layout.images_seen.find(tag.tag_id);
      row.push_back(seen != f.layout.images_seen.end() ? Number(seen->second, 0) : Text(""));
    }
    table.rows.push_back(row);
  }
  return table;
}

Table StationTable(const PlanFindings& f) {
  Table table{
      "",
      "Predicted standard deviations (1 sigma) of the stations' centres by their tags and measured offsets, site "
      "east-north-up"};
  constexpr const char* kUnseen = "no planned picture shows the station's tag";
  table.columns = {{"station"},
                   {"tag", true},
                   {"east (mm)", true, kUnseen},
                   {"north (mm)", true, kUnseen},
                   {"up (mm)", true, kUnseen},
                   {"95 % ellipse, half axes (mm)", false, kUnseen}};
  for (const PlanStationItem& station : f.layout.stations) {
    const auto covariance = StationCovariance(station, f.prediction);
    std::vector<TableCell> row = {Text(station.name), Number(station.tag_id, 0)};
    for (int k = 0; k < 3; ++k) row.push_back(covariance ? Number(kMm * std::sqrt((*covariance)(k, k)), 1) : Text(""));
    row.push_back(Text(covariance ? Ellipse95(*covariance) : ""));
    table.rows.push_back(row);
  }
  return table;
}

Table PanoramaTable(const PlanFindings& f) {
  Table table{"",
              "Predicted standard deviations (1 sigma) of panoramas as `localize` would state them from one pass by "
              "itself if it finds them, site east-north-up, held by their geotags. Matches: " +
                  MatchWords(f.layout.noise) +
                  ". They must also agree on a pose, which changed light, moved cars and repeated structure prevent: "
                  "this is not predicted"};
  table.columns = {{"pass"},          {"station"},       {"east (mm)", true},    {"north (mm)", true},
                   {"up (mm)", true}, {"3D (mm)", true}, {"scene points", true}, {"matches", true}};
  for (const PanoramaPrediction& p : f.panoramas) {
    const Eigen::Vector3d sigma = kMm * p.Sigma();
    std::vector<TableCell> row = {Text(f.layout.network.passes[static_cast<size_t>(p.pass)].name), Text(p.name)};
    for (int k = 0; k < 3; ++k) row.push_back(Number(sigma[k], 1));
    row.push_back(Number(sigma.norm(), 1));
    row.push_back(Number(p.points, 0));
    row.push_back(Number(p.matches, 0, p.matches < kMatchesNeeded ? Tone::kWarning : Tone::kPlain));
    table.rows.push_back(row);
  }
  return table;
}

Table PointTable(const PlanFindings& f) {
  Table table{"",
              "Control of known points. Redundancy: the part of an error that shows in its residual. Detectable: the "
              "smallest error that a test at 0.1 % finds with 80 % probability (Baarda); effect: how far an error of "
              "that size moves the tag"};
  constexpr const char* kUnused = "the point is not used";
  constexpr const char* kHidden = "the point is not used, or no error of it would show";
  table.columns = {{"point"},
                   {"tag", true},
                   {"role"},
                   {"redundancy, horizontal", true, kUnused},
                   {"detectable (mm)", true, kHidden},
                   {"effect (mm)", true, kHidden},
                   {"redundancy, vertical", true, kUnused},
                   {"detectable (mm)", true, kHidden},
                   {"effect (mm)", true, kHidden}};
  for (const PointPrediction& p : f.prediction.points) {
    const char* role = p.role == PointRole::kControl ? "control" : p.role == PointRole::kCheck ? "check" : "geotag";
    std::vector<TableCell> row = {Text(p.name), Number(p.tag_id, 0),
                                  Text(p.used ? role : std::string(role) + ", not used")};
    for (const Reliability& r : {p.horizontal, p.vertical}) {
      const bool shows = p.used && std::isfinite(r.blunder);
      row.push_back(p.used ? Number(r.redundancy, 2, r.redundancy < 0.1 ? Tone::kBad : Tone::kPlain) : Text(""));
      row.push_back(shows ? Number(kMm * r.blunder, 0) : Text(""));
      row.push_back(shows ? Number(kMm * r.effect_m, 0) : Text(""));
    }
    table.rows.push_back(row);
  }
  return table;
}

Table DistanceTable(const PlanFindings& f) {
  Table table{"", "Control of measured distances, as of known points"};
  table.columns = {{"from tag", true},
                   {"to tag", true},
                   {"redundancy", true},
                   {"detectable (mm)", true, "no error of it would show"},
                   {"effect (mm)", true, "no error of it would show"}};
  for (const DistancePrediction& d : f.prediction.distances) {
    const Reliability& r = d.reliability;
    const bool shows = std::isfinite(r.blunder);
    table.rows.push_back({Number(d.distance.from, 0), Number(d.distance.to, 0),
                          Number(r.redundancy, 2, r.redundancy < 0.1 ? Tone::kBad : Tone::kPlain),
                          shows ? Number(kMm * r.blunder, 0) : Text(""),
                          shows ? Number(kMm * r.effect_m, 0) : Text("")});
  }
  return table;
}

// How well the tags' corners in the pictures are controlled.
Paragraph SightParagraph(const std::vector<SightPrediction>& sights) {
  std::vector<double> redundancies, blunders;
  for (const SightPrediction& s : sights) {
    redundancies.push_back(s.worst.redundancy);
    blunders.push_back(s.worst.blunder);
  }
  return Paragraph{fmt::format(
      "{} tags in pictures. Redundancy of the least controlled coordinate of each: median {:.2f}, least {:.2f}; an "
      "error of {:.2f} px (median) in it is detected. All are in observations.csv.",
      sights.size(), Percentile(redundancies, 0.5), Percentile(redundancies, 0), Percentile(blunders, 0.5))};
}

// What the prediction rests on.
Paragraph AssumptionParagraph(const PlanFindings& f) {
  const NetworkOptions& n = f.layout.noise;
  return Paragraph{fmt::format(
      "Visibility is computed from geometry alone, without occlusion. A tag is found in {:.0f} % of the pictures that "
      "show it with a side of at least {:g} px, at most {:g} deg from its normal, and with at most {:g} px of motion "
      "blur at an exposure of {:g} ms. Corners: {:.3f} px (1 sigma) for a sharp tag of 100 px, and {:g} px in "
      "quadrature. Odometry: {:g} deg and {:g} m per square root of a metre, heading drift {:g} deg/m{}. {} scene "
      "points a picture at {:g} to {:g} m, seen {:g} pictures on average, {:g} px; a panorama shares at most {}, {:g} "
      "deg each. All sigmas are predicted, none is a measured accuracy.",
      100 * n.detected, n.min_side_px, n.max_angle_deg, n.max_blur_px, n.exposure_ms, n.corner_sigma_px,
      n.extra_sigma_px, n.odometry_rot_deg, n.odometry_m, n.heading_drift_deg_m,
      f.layout.learned ? ", times the factors that the survey of the same site found" : "", n.ties_per_image,
      n.tie_near_m, n.tie_far_m, n.tie_length, n.tie_sigma_px, n.panorama_points, n.panorama_sigma_deg)};
}

Table GainTable(const std::vector<PlanGain>& gains, const NetworkPrediction& plan, const std::string& caption) {
  Table table{"", caption};
  table.columns = {{"rank", true}, {"what"}, {"RMS of the tags (mm)", true}, {"gain (%)", true}};
  for (size_t k = 0; k < gains.size(); ++k) {
    const double after = gains[k].rms_after_m, before = gains[k].Before(plan);
    const TableCell rms = std::isfinite(after) ? Number(kMm * after, 2) : TableCell{"not determined", 1e99};
    table.rows.push_back({Number(static_cast<double>(k) + 1, 0), Text(gains[k].what), rms,
                          Number(std::isfinite(after / before) ? 100 * (1 - after / before) : kInfinite, 1)});
  }
  return table;
}

std::string Joined(const nlohmann::json& names) {
  std::string all;
  for (const nlohmann::json& name : names) all += (all.empty() ? "" : ", ") + name.get<std::string>();
  return all;
}

Document PageOf(const PlanFindings& f, const Drawing& map, const nlohmann::json& summary) {
  const NetworkPrediction& p = f.prediction;
  Document page;
  page.title = "Plan";
  page.subtitle = "Accuracy that the survey would state, predicted from " + f.layout.source + ". Datum: " + p.datum +
                  "; gauge: " + p.gauge + ".";
  const TagPrediction* weakest = Weakest(p);
  Facts facts;
  facts.facts.push_back({"Tags, RMS of the 3D sigma", fmt::format("{:.1f} mm", kMm * p.RmsSigma()),
                         fmt::format("{} of {} tags are seen", summary["tags"].get<int>(), p.tags.size())});
  if (weakest != nullptr) {
    facts.facts.push_back({"Weakest tag", fmt::format("{}", weakest->tag_id),
                           fmt::format("{:.1f} mm (3D, 1 sigma)", kMm * TagSigma(*weakest))});
  }
  facts.facts.push_back({"Cameras, median 3D sigma",
                         fmt::format("{:.1f} mm", kMm * summary["camera_sigma_median_m"].get<double>()),
                         fmt::format("95 %: {:.1f} mm", kMm * summary["camera_sigma_p95_m"].get<double>())});
  page.blocks.push_back(facts);
  for (const PlanGate& gate : f.gates) {
    page.blocks.push_back(
        Paragraph{fmt::format("Gate: {}: {:.4g}{}, {}", gate.gate, gate.value, gate.gate.ends_with(" m") ? " m" : "",
                              gate.undecided ? "undecided: the plan has no datum in the world"
                              : gate.passed  ? "passed"
                                             : "failed"),
                  gate.passed ? Tone::kGood : Tone::kBad});
  }
  for (const std::string& warning : p.warnings) page.blocks.push_back(Paragraph{warning, Tone::kWarning});
  for (const auto& [tag_id, why] : f.unseen) {
    page.blocks.push_back(Paragraph{fmt::format("Tag {} has no prediction: {}.", tag_id, why), Tone::kBad});
  }
  const auto section = [&](const char* title, const char* anchor, Block block) {
    page.blocks.push_back(Heading{2, title, anchor});
    page.blocks.push_back(std::move(block));
  };
  section("Map", "map", Figure{"map", "Tags, planned paths and predicted 95 % ellipses.", map});
  section("Tags", "tags", TagTable(f));
  page.blocks.push_back(SightParagraph(p.sights));
  if (!f.layout.stations.empty()) section("Stations", "stations", StationTable(f));
  if (!f.panoramas.empty()) section("Panoramas", "panoramas", PanoramaTable(f));
  if (!p.points.empty()) section("Known points", "points", PointTable(f));
  if (!p.distances.empty()) section("Distances", "distances", DistanceTable(f));
  if (f.suggestions.empty() && !f.suggestion_note.empty()) {
    page.blocks.push_back(Paragraph{"No suggestion: " + f.suggestion_note, Tone::kWarning});
  }
  if (!f.suggestions.empty()) {
    section("Suggestion", "suggestion", GainTable(f.suggestions, p, "After each, in this order; " + f.suggestion_note));
  }
  section("Gain of one more tag, point or pass", "gains",
          GainTable(f.gains, p, fmt::format("Each alone, best first; now {:.2f} mm", kMm * p.RmsSigma())));
  section("Assumptions", "assumptions", AssumptionParagraph(f));
  return page;
}

}  // namespace

void WritePlan(const PlanFindings& findings, const fs::path& folder) {
  WriteTagsTable(findings, folder / "tags.csv");
  WriteCamerasTable(findings, folder / "cameras.csv");
  WriteStationsTable(findings, folder / "stations.csv");
  WritePanoramasTable(findings, folder / "panoramas.csv");
  WriteObservationTables(findings, folder);
  WriteDistances(findings.prediction.distances, folder / "distances.csv");
  WriteGains(findings.gains, findings.prediction, folder / "gains.csv");
  if (!findings.suggestions.empty()) WriteGains(findings.suggestions, findings.prediction, folder / "suggestions.csv");
  const nlohmann::json summary = SummaryOf(findings);
  WriteFileAtomically(folder / "summary.json", DumpJson(summary, 2) + "\n");
  const Drawing map = PlanMap(findings);
  constexpr double kPngScale = 2;
  WriteFileAtomically(folder / "map.svg", SvgFileOf(map, "Plan of the site with predicted accuracy"));
  WriteFileAtomically(folder / "map.png", PngOf(map, kPngScale));
  WriteFileAtomically(folder / "index.html", HtmlOf(PageOf(findings, map, summary)));
}

std::string PlanSummary(const nlohmann::json& s, const DisplayUnit& unit) {
  const auto length = [&](const nlohmann::json& metres) {
    return metres.is_number() ? fmt::format("{:.4f} {}", metres.get<double>() / unit.metres, unit.name)
                              : "not determined";
  };
  std::string text =
      fmt::format("Layout: {}; datum: {}\n", s.at("source").get<std::string>(), s.at("datum").get<std::string>());
  text +=
      fmt::format("Tags: {} seen, RMS of the predicted 3D sigma {}; weakest: {} with {}\n", s.at("tags").get<int>(),
                  length(s.at("rms_tag_sigma_m")), s.at("weakest_tag").is_null() ? "none" : s.at("weakest_tag").dump(),
                  length(s.at("weakest_tag_sigma_m")));
  const nlohmann::json& unseen = s.at("tags_not_seen");
  for (size_t k = 0; k < std::min(kShown, unseen.size()); ++k) {
    text += fmt::format("Unseen: tag {}: {}\n", unseen[k].dump(), s.at("why_not_seen")[k].get<std::string>());
  }
  if (unseen.size() > kShown) text += fmt::format("Unseen: {} more tags, see the page\n", unseen.size() - kShown);
  text += fmt::format("Cameras: predicted 3D sigma, median {}, 95 % {}\n", length(s.at("camera_sigma_median_m")),
                      length(s.at("camera_sigma_p95_m")));
  if (!s.at("uncontrolled_points").empty()) {
    text += "Unchecked: no other measurement checks these known points: " + Joined(s.at("uncontrolled_points")) + "\n";
  }
  if (!s.at("fewest_matches").empty()) {
    text += fmt::format("Matches: fewest expected of panoramas: {}; their sigmas hold if {} or more agree\n",
                        Joined(s.at("fewest_matches")), kMatchesNeeded);
  }
  const nlohmann::json& suggestions = s.at("suggestions");
  // Who asked for a suggestion is told why there is none, not what else would gain.
  const bool asked = !s.at("suggestion_note").get<std::string>().empty();
  const nlohmann::json& shown = asked ? suggestions : s.at("gains");
  for (size_t k = 0; k < std::min(kShown, shown.size()); ++k) {
    text += fmt::format("{} {}: {}: RMS {}\n", asked ? "Suggest" : "Gain", k + 1,
                        shown[k].at("what").get<std::string>(), length(shown[k].at("rms_after_m")));
  }
  if (!s.at("suggestion_note").get<std::string>().empty())
    text += "Note: " + s.at("suggestion_note").get<std::string>() + "\n";
  for (const nlohmann::json& gate : s.at("gates")) {
    text += fmt::format("Gate: {}: {}\n", gate.at("gate").get<std::string>(),
                        gate.at("passed").is_null()     ? "undecided: the plan has no datum in the world"
                        : gate.at("passed").get<bool>() ? "passed"
                                                        : "failed");
  }
  return text;
}

}  // namespace trigpoint
