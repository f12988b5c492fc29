#include "app/pipeline/plan_report.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "app/pipeline/display_unit.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/report/document.h"
#include "eval/report/plan.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kMm = 1e3;
constexpr const char* kBlue = "#0072b2";
constexpr const char* kOrange = "#d55e00";
constexpr const char* kGreen = "#009e73";
constexpr const char* kGrey = "#8a939b";

// Of a 2 x 2 covariance: half axes of the ellipse of one standard deviation and the first one's angle.
struct Ellipse {
  double a = 0, b = 0, angle = 0;
};
Ellipse EllipseOf(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(Eigen::Matrix2d(covariance.topLeftCorner<2, 2>()));
  const Eigen::Vector2d axis = solver.eigenvectors().col(1);
  return {std::sqrt(std::max(0.0, solver.eigenvalues()(1))), std::sqrt(std::max(0.0, solver.eigenvalues()(0))),
          std::atan2(axis.y(), axis.x())};
}

Eigen::Matrix3d Position(const Matrix6d& covariance) { return covariance.bottomRightCorner<3, 3>(); }

// Covariance of a station's centre by its tag: the offset turns with nothing, it is given along the world's axes.
std::optional<Eigen::Matrix3d> StationCovariance(const PlanStationItem& station, const NetworkPrediction& prediction) {
  for (const TagPrediction& tag : prediction.tags) {
    if (tag.tag_id != station.tag_id || !tag.tied) continue;
    return Eigen::Matrix3d(Position(tag.covariance) + station.sigma_m * station.sigma_m * Eigen::Matrix3d::Identity());
  }
  return std::nullopt;
}

void WriteTagsTable(const PlanFindings& findings, const fs::path& file) {
  CsvWriter csv(
      {"tag_id", "x", "y", "z", "sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_rx_deg", "sigma_ry_deg", "sigma_rz_deg",
       "ellipse_a_m", "ellipse_b_m", "ellipse_bearing_deg", "images", "images_needed", "passes", "role", "status"},
      {"trigpoint plan tags 1; frame=enu; datum=" + findings.prediction.datum +
       "; sigma=1, predicted; rotation about the world's axes; ellipse: horizontal, bearing of its long axis"});
  for (const TagPrediction& tag : findings.prediction.tags) {
    csv.Integer(tag.tag_id);
    for (int k = 0; k < 3; ++k) csv.Number(tag.world_m[k], 4);
    if (tag.tied) {
      const Ellipse e = EllipseOf(Position(tag.covariance));
      for (int k = 0; k < 3; ++k) csv.Number(tag.Sigma()[k], 6);
      for (int k = 0; k < 3; ++k) csv.Number(std::sqrt(std::max(0.0, tag.covariance(k, k))) * kRadToDeg, 5);
      csv.Number(e.a, 6).Number(e.b, 6).Number(std::fmod(450 - e.angle * kRadToDeg, 180), 1);
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

void WritePanoramasTable(const PlanFindings& findings, const fs::path& file) {
  CsvWriter csv(
      {"pass", "station", "sigma_x_m", "sigma_y_m", "sigma_z_m", "points"},
      {"trigpoint plan panoramas 1; frame=enu; sigma=1, as `localize` would state it from this pass by itself, "
       "held by the panoramas' geotags; points: of the scene, shared with the pass"});
  for (const PanoramaPrediction& panorama : findings.panoramas) {
    csv.Text(findings.layout.network.passes[static_cast<size_t>(panorama.pass)].name).Text(panorama.name);
    for (int k = 0; k < 3; ++k) csv.Number(panorama.Sigma()[k], 6);
    csv.Integer(panorama.points);
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

void WriteGains(const std::vector<PlanGain>& gains, double before, const fs::path& file) {
  CsvWriter csv(
      {"rank", "what", "rms_before_m", "rms_after_m", "x", "y", "z", "heading_deg"},
      {"trigpoint plan gains 1; root mean square 3D sigma of the tags; heading: the way a tag faces, clockwise "
       "from north"});
  int rank = 0;
  for (const PlanGain& gain : gains) {
    csv.Integer(++rank).Text(gain.what).Number(before, 6).Number(gain.rms_after_m, 6);
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

// The site from above with ellipses of one standard deviation, enlarged.
class Map {
 public:
  explicit Map(const PlanFindings& findings) : findings_(findings) {
    for (const auto& [id, pose] : findings.layout.network.world_from_tag) Extend(pose.translation);
    for (const BodyPrediction& body : findings.prediction.bodies) Extend(body.world_from_body.translation);
    for (const PlanGain& suggestion : findings.suggestions) {
      if (suggestion.world_m) Extend(*suggestion.world_m);
    }
    const double pad = 0.06 * std::max({high_.x() - low_.x(), high_.y() - low_.y(), 5.0}) + 0.5;
    low_ -= Eigen::Vector2d(pad, pad);
    high_ += Eigen::Vector2d(pad, pad);
    drawing_.width = 760;
    scale_ = std::min(drawing_.width / (high_.x() - low_.x()), 620 / (high_.y() - low_.y()));
    const double wider = 0.5 * (drawing_.width / scale_ - (high_.x() - low_.x()));  // the width is used in full
    low_.x() -= wider, high_.x() += wider;
    drawing_.height = scale_ * (high_.y() - low_.y()) + 62;
    double largest = 1e-6;
    for (const TagPrediction& tag : findings.prediction.tags) {
      if (tag.tied) largest = std::max(largest, EllipseOf(Position(tag.covariance)).a);
    }
    // The largest one is at most 34 pixels; a round factor is easier to read off.
    factor_ = RoundDown(34 / (scale_ * largest));
  }

  Drawing Draw() {
    drawing_.Rectangle(0, 0, drawing_.width, drawing_.height, "#ffffff");
    Paths();
    for (const PlanStationItem& station : findings_.layout.stations) DrawStation(station);
    for (const TagPrediction& tag : findings_.prediction.tags) DrawTag(tag);
    int rank = 0;
    for (const PlanGain& gain : findings_.suggestions) {
      ++rank;
      if (!gain.world_m) continue;
      const auto [x, y] = At(*gain.world_m);
      if (gain.heading_rad) {
        const double length = 20;
        drawing_.Line({{x, y}, {x + length * std::sin(*gain.heading_rad), y - length * std::cos(*gain.heading_rad)}},
                      kGreen, 3);
      }
      drawing_.Circle(x, y, 8, kGreen, 0.9);
      drawing_.Text(x, y + 4, std::to_string(rank), 0, 11, "#ffffff", true);
    }
    Legend();
    return drawing_;
  }

 private:
  void Extend(const Eigen::Vector3d& p) {
    low_ = low_.cwiseMin(p.head<2>());
    high_ = high_.cwiseMax(p.head<2>());
  }
  std::pair<double, double> At(const Eigen::Vector3d& p) const {
    return {scale_ * (p.x() - low_.x()), scale_ * (high_.y() - p.y())};
  }
  void Paths() {
    std::map<int, std::vector<std::pair<double, double>>> lines;
    for (const BodyPrediction& body : findings_.prediction.bodies) {
      lines[body.pass].push_back(At(body.world_from_body.translation));
    }
    for (const auto& [pass, line] : lines) {
      drawing_.Line(line, kGrey, 1.2);
      const std::string& name = findings_.layout.network.passes[static_cast<size_t>(pass)].name;
      drawing_.Text(line.front().first + 6, line.front().second + 14, name, -1, 11, "#5a6570");
    }
    const size_t every = std::max<size_t>(1, findings_.prediction.bodies.size() / 60);
    for (size_t k = 0; k < findings_.prediction.bodies.size(); k += every) {
      const BodyPrediction& body = findings_.prediction.bodies[k];
      DrawEllipse(body.world_from_body.translation, Position(body.covariance), kGrey, 0.8);
    }
  }
  void DrawEllipse(const Eigen::Vector3d& centre, const Eigen::Matrix3d& covariance, const char* colour, double width) {
    const Ellipse e = EllipseOf(covariance);
    std::vector<std::pair<double, double>> line;
    for (int k = 0; k <= 48; ++k) {
      const double t = 2 * M_PI * k / 48;
      const Eigen::Vector2d p(factor_ * e.a * std::cos(t), factor_ * e.b * std::sin(t));
      line.push_back(At(centre + Eigen::Vector3d(std::cos(e.angle) * p.x() - std::sin(e.angle) * p.y(),
                                                 std::sin(e.angle) * p.x() + std::cos(e.angle) * p.y(), 0)));
    }
    drawing_.Line(line, colour, width);
  }
  // The stroke shows which way the printed side faces; the id stands behind it.
  void DrawTag(const TagPrediction& tag) {
    const auto [x, y] = At(tag.world_m);
    const bool control = tag.role == "control";
    const char* colour = !tag.tied ? kOrange : kBlue;
    double behind = 14;
    if (tag.tied) {
      DrawEllipse(tag.world_m, Position(tag.covariance), colour, 1.6);
      behind += scale_ * factor_ * EllipseOf(Position(tag.covariance)).a;
    }
    const Rigid3d& pose = findings_.layout.network.world_from_tag.at(tag.tag_id);
    Eigen::Vector2d out = -(pose.rotation * Eigen::Vector3d::UnitZ()).head<2>();
    if (out.norm() > 1e-3) {
      constexpr double kStroke = 11;
      out.normalize();
      drawing_.Line({{x, y}, {x + kStroke * out.x(), y - kStroke * out.y()}}, colour, 2);
    }
    if (control) {
      drawing_.Area({{x, y - 6}, {x + 5.5, y + 4}, {x - 5.5, y + 4}}, colour);
    } else {
      drawing_.Circle(x, y, tag.tied ? 3 : 5, colour);
    }
    drawing_.Text(x - behind * out.x(), y + behind * out.y() + 4, std::to_string(tag.tag_id), 0, 12, "#1d2329", true);
    drawing_.spots.push_back({x, y, "tag:" + std::to_string(tag.tag_id)});
  }
  void DrawStation(const PlanStationItem& station) {
    constexpr double kHalf = 4;
    const auto [x, y] = At(findings_.layout.network.world_from_tag.at(station.tag_id).translation + station.offset_m);
    drawing_.Rectangle(x - kHalf, y - kHalf, 2 * kHalf, 2 * kHalf, kGreen);
    drawing_.Text(x + 2 * kHalf, y + kHalf, station.name, -1, 11);
    drawing_.spots.push_back({x, y, "station:" + station.name});
  }
  void Legend() {
    const double y = drawing_.height - 30;
    const double metres = RoundDown(0.3 * (high_.x() - low_.x()));
    drawing_.Line({{10, y}, {10 + metres * scale_, y}}, "#1d2329", 2);
    drawing_.Text(10, y - 6, fmt::format("{:g} m", metres), -1, 11);
    drawing_.Text(10, y + 22,
                  fmt::format("ellipses: 1 sigma, {:g} times enlarged; triangle: control; square: station; stroke: the "
                              "way a tag faces; orange: in no planned picture",
                              factor_),
                  -1, 11);
    drawing_.Text(drawing_.width - 14, 16, "N", 0, 12, "#1d2329", true);
    drawing_.Line({{drawing_.width - 14, 40}, {drawing_.width - 14, 20}}, "#1d2329", 1.5);
  }

  const PlanFindings& findings_;
  Drawing drawing_;
  Eigen::Vector2d low_{1e12, 1e12}, high_{-1e12, -1e12};
  double scale_ = 1, factor_ = 1;
};

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
  json["tags_not_seen"] = nlohmann::json::array();
  for (const TagPrediction& tag : p.tags) {
    if (!tag.tied) json["tags_not_seen"].push_back(tag.tag_id);
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
      json[list].push_back({{"what", gain.what}, {"rms_after_m", Finite(gain.rms_after_m)}});
    }
  }
  json["gates"] = nlohmann::json::array();
  for (const PlanGate& gate : f.gates) {
    json["gates"].push_back({{"gate", gate.gate}, {"value", Finite(gate.value)}, {"passed", gate.passed}});
  }
  return json;
}

TableCell Number(double value, int decimals, Tone tone = Tone::kPlain) {
  if (!std::isfinite(value)) return {"-", 1e99, tone};
  return {fmt::format("{:.{}f}", value, decimals), value, tone};
}
TableCell Text(const std::string& text, Tone tone = Tone::kPlain) { return {text, std::nullopt, tone}; }

Table TagTable(const PlanFindings& f) {
  Table table{
      "",
      "Predicted standard deviations (1 sigma) of the tags' centres, site east-north-up. Needed: pictures, spread "
      "as the planned ones, for the gate's sigma, or without a gate for one within 10 % of that predicted"};
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
                   {"3D (mm)", true, kUnseen}};
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
    if (f.layout.learned) {
      const auto seen = f.layout.images_seen.find(tag.tag_id);
      row.push_back(seen != f.layout.images_seen.end() ? Number(seen->second, 0) : Text(""));
    }
    table.rows.push_back(row);
  }
  return table;
}

Table PanoramaTable(const PlanFindings& f) {
  Table table{"",
              "Predicted standard deviations (1 sigma) of panoramas as `localize` would find them from one pass by "
              "itself, site east-north-up, held by their geotags"};
  table.columns = {{"pass"},          {"station"},       {"east (mm)", true},   {"north (mm)", true},
                   {"up (mm)", true}, {"3D (mm)", true}, {"scene points", true}};
  for (const PanoramaPrediction& p : f.panoramas) {
    const Eigen::Vector3d sigma = kMm * p.Sigma();
    std::vector<TableCell> row = {Text(f.layout.network.passes[static_cast<size_t>(p.pass)].name), Text(p.name)};
    for (int k = 0; k < 3; ++k) row.push_back(Number(sigma[k], 1));
    row.push_back(Number(sigma.norm(), 1));
    row.push_back(Number(p.points, 0));
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

Table GainTable(const std::vector<PlanGain>& gains, double before, const std::string& caption) {
  Table table{"", caption};
  table.columns = {{"rank", true}, {"what"}, {"RMS of the tags (mm)", true}, {"gain (%)", true}};
  for (size_t k = 0; k < gains.size(); ++k) {
    table.rows.push_back({Number(static_cast<double>(k) + 1, 0), Text(gains[k].what),
                          Number(kMm * gains[k].rms_after_m, 2), Number(100 * (1 - gains[k].rms_after_m / before), 1)});
  }
  return table;
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
        Paragraph{fmt::format("Gate: {}: {:.4g}, {}", gate.gate, gate.value, gate.passed ? "passed" : "failed"),
                  gate.passed ? Tone::kGood : Tone::kBad});
  }
  for (const std::string& warning : p.warnings) page.blocks.push_back(Paragraph{warning, Tone::kWarning});
  for (const auto& id : summary["tags_not_seen"]) {
    page.blocks.push_back(Paragraph{fmt::format("Tag {} is seen by no planned picture.", id.get<int>()), Tone::kBad});
  }
  page.blocks.push_back(Heading{2, "Map", "map"});
  page.blocks.push_back(Figure{"map", "Tags, planned paths and ellipses of one standard deviation.", map});
  page.blocks.push_back(Heading{2, "Tags", "tags"});
  page.blocks.push_back(TagTable(f));
  if (!f.panoramas.empty()) {
    page.blocks.push_back(Heading{2, "Panoramas", "panoramas"});
    page.blocks.push_back(PanoramaTable(f));
  }
  if (!p.points.empty()) {
    page.blocks.push_back(Heading{2, "Known points", "points"});
    page.blocks.push_back(PointTable(f));
  }
  if (!f.suggestions.empty()) {
    page.blocks.push_back(Heading{2, "Suggestion", "suggestion"});
    page.blocks.push_back(GainTable(f.suggestions, p.RmsSigma(), "After each, in this order; " + f.suggestion_note));
  }
  page.blocks.push_back(Heading{2, "Gain of one more tag, point or pass", "gains"});
  page.blocks.push_back(
      GainTable(f.gains, p.RmsSigma(), fmt::format("Each alone, best first; now {:.2f} mm", kMm * p.RmsSigma())));
  page.blocks.push_back(Heading{2, "Assumptions", "assumptions"});
  const NetworkOptions& n = f.layout.noise;
  page.blocks.push_back(Paragraph{fmt::format(
      "Visibility is computed from geometry alone, without occlusion. Corners: {:.3f} px (1 sigma) for a "
      "sharp "
      "tag of 100 px; odometry: {:g} deg and {:g} m per square root of a metre{}; {} scene points a picture at {:g} to "
      "{:g} m, seen {:g} pictures on average, {:g} px.",
      n.corner_sigma_px, n.odometry_rot_deg, n.odometry_m,
      f.layout.learned ? ", times the factors that the survey of the same site found" : "", n.ties_per_image,
      n.tie_near_m, n.tie_far_m, n.tie_length, n.tie_sigma_px)});
  return page;
}

}  // namespace

Drawing PlanMap(const PlanFindings& findings) { return Map(findings).Draw(); }

double TagSigma(const TagPrediction& tag) { return tag.Sigma().norm(); }
double BodySigma(const BodyPrediction& body) {
  return std::sqrt(std::max(0.0, body.covariance.diagonal().tail<3>().sum()));
}

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

void WritePlan(const PlanFindings& findings, const fs::path& folder) {
  WriteTagsTable(findings, folder / "tags.csv");
  WriteCamerasTable(findings, folder / "cameras.csv");
  WriteStationsTable(findings, folder / "stations.csv");
  WritePanoramasTable(findings, folder / "panoramas.csv");
  WriteObservationTables(findings, folder);
  const double before = findings.prediction.RmsSigma();
  WriteGains(findings.gains, before, folder / "gains.csv");
  if (!findings.suggestions.empty()) WriteGains(findings.suggestions, before, folder / "suggestions.csv");
  const nlohmann::json summary = SummaryOf(findings);
  WriteFileAtomically(folder / "summary.json", DumpJson(summary, 2) + "\n");
  const Drawing map = PlanMap(findings);
  constexpr double kPngScale = 2;
  WriteFileAtomically(folder / "map.svg", SvgOf(map, "Plan of the site with predicted accuracy"));
  WriteFileAtomically(folder / "map.png", PngOf(map, kPngScale));
  WriteFileAtomically(folder / "index.html", HtmlOf(PageOf(findings, map, summary)));
}

std::string PlanSummary(const nlohmann::json& s, const DisplayUnit& unit) {
  const auto length = [&](const nlohmann::json& metres) {
    return metres.is_number() ? fmt::format("{:.4f} {}", metres.get<double>() / unit.metres, unit.name) : "unknown";
  };
  std::string text =
      fmt::format("Layout: {}; datum: {}\n", s.at("source").get<std::string>(), s.at("datum").get<std::string>());
  text +=
      fmt::format("Tags: {} seen, RMS of the predicted 3D sigma {}; weakest: {} with {}\n", s.at("tags").get<int>(),
                  length(s.at("rms_tag_sigma_m")), s.at("weakest_tag").is_null() ? "none" : s.at("weakest_tag").dump(),
                  length(s.at("weakest_tag_sigma_m")));
  const auto names = [](const nlohmann::json& list) {
    std::string all;
    for (const nlohmann::json& name : list)
      all += (all.empty() ? "" : ", ") + (name.is_string() ? name.get<std::string>() : name.dump());
    return all;
  };
  if (!s.at("tags_not_seen").empty())
    text += "Unseen: tags in no planned picture: " + names(s.at("tags_not_seen")) + "\n";
  text += fmt::format("Cameras: predicted 3D sigma, median {}, 95 % {}\n", length(s.at("camera_sigma_median_m")),
                      length(s.at("camera_sigma_p95_m")));
  if (!s.at("uncontrolled_points").empty()) {
    text += "Unchecked: known points whose errors would not show: " + names(s.at("uncontrolled_points")) + "\n";
  }
  const nlohmann::json& suggestions = s.at("suggestions");
  const nlohmann::json& shown = suggestions.empty() ? s.at("gains") : suggestions;
  constexpr size_t kShown = 3;
  for (size_t k = 0; k < std::min(kShown, shown.size()); ++k) {
    text += fmt::format("{} {}: {}: RMS {}\n", suggestions.empty() ? "Gain" : "Suggest", k + 1,
                        shown[k].at("what").get<std::string>(), length(shown[k].at("rms_after_m")));
  }
  if (!suggestions.empty()) text += "Note: " + s.at("suggestion_note").get<std::string>() + "\n";
  for (const nlohmann::json& gate : s.at("gates")) {
    text += fmt::format("Gate: {}: {}\n", gate.at("gate").get<std::string>(),
                        gate.at("passed").get<bool>() ? "passed" : "failed");
  }
  return text;
}

}  // namespace trigpoint
