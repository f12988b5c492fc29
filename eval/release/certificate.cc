#include "eval/release/certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/base/counted.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/errors/results.h"
#include "eval/release/compared.h"
#include "eval/report/document.h"
#include "eval/statistics/statistics.h"
#include "eval/text/json_values.h"
#include "eval/text/method_name.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr const char* kNotStated = "not stated";

// Distinct texts that are not empty, in order, by commas.
std::string Joined(const std::set<std::string>& texts, const char* none = kNotStated) {
  std::string text;
  for (const std::string& item : texts) {
    if (!item.empty()) text += (text.empty() ? "" : ", ") + item;
  }
  return text.empty() ? none : text;
}

std::string Millimetres(const json& metres) {
  return metres.is_number() ? fmt::format("{:.3f} m", metres.get<double>()) : "";
}

// Everything the page is made of.
struct Subject {
  const Project& project;
  const json& record;
  const ReleaseStatement& statement;
  json survey;    // map/summary.json
  json evaluate;  // evaluate/summary.json
  json gates;     // gates/gates.json
  std::vector<TagResult> tags;
};

class Page {
 public:
  explicit Page(const Subject& subject) : f_(subject) {}

  Document Make() {
    Document document;
    document.title = "Certificate of release " + f_.record.value("name", "") + ": " + f_.record.value("project", "");
    document.date = f_.record.value("published", "");
    document.subtitle = "Published " + document.date + " (UTC) by " + f_.record.value("user", "") + " with Trigpoint " +
                        f_.record["program"].value("trigpoint", "") + ". Lengths in metres, sigmas are 1 sigma.";
    document.footer =
        "`trigpoint verify RELEASE` checks this release against release.json and its signature; `trigpoint rerun "
        "RELEASE` computes it again.";
    Parties();
    Systems();
    Method();
    Accuracy();
    Gates();
    Limits();
    ToSign();
    document.blocks = std::move(blocks_);
    return document;
  }

  // The same for programs.
  json Data() const { return data_; }

 private:
  void Chapter(const char* title, const char* anchor) { blocks_.push_back(Heading{2, title, anchor}); }
  void Say(const std::string& text, Tone tone = Tone::kPlain) { blocks_.push_back(Paragraph{text, tone, ""}); }
  // Rows of a name and a value, also kept for programs.
  void Values(const char* section, const std::vector<std::pair<std::string, std::string>>& rows) {
    Table table{"", "", {{""}, {""}}, {}};
    for (const auto& [name, value] : rows) {
      if (value.empty()) continue;
      table.rows.push_back({{name}, {value}});
      data_[section][name] = value;
    }
    blocks_.push_back(table);
  }

  void Parties() {
    std::set<std::string> dates, cameras;
    for (const std::string& name : RunsOfMap()) {
      const Run& run = f_.project.run(name);
      dates.insert(run.config.date);
      for (const BodyCamera& camera : run.cameras) {
        cameras.insert(fmt::format("{} ({}, {} x {} px{})", camera.name, CameraModelName(camera.camera.model()),
                                   camera.camera.width(), camera.camera.height(),
                                   run.config.camera.empty() ? "" : ", calibration " + run.config.camera));
      }
    }
    Chapter("Who, when, with what", "parties");
    const auto stated = [](const std::string& text) { return text.empty() ? kNotStated : text; };
    Values("parties", {{"Responsible", stated(f_.statement.author)},
                       {"Dates of the runs", Joined(dates)},
                       {"Runs", Joined(RunsOfMap(), "none")},
                       {"Cameras", Joined(cameras, "none")},
                       {"Instrument of the control", stated(f_.statement.instrument)},
                       {"Note", f_.statement.note}});
  }

  void Systems() {
    Chapter("Reference system", "systems");
    const json control = f_.survey.value("control", json::object());
    const auto stated = [&](const char* key) {
      std::set<std::string> texts;
      for (const json& text : control.value(key, json::array())) texts.insert(text.get<std::string>());
      return texts;
    };
    const std::set<std::string> crs = stated("crs"), heights = stated("heights"), epochs = stated("epochs");
    const bool local = crs.count("local x, y, z") > 0, geodetic = !heights.empty();
    std::string frame = "a frame of its own, not georeferenced";
    if (const json origin = f_.record.value("origin", json()); origin.is_array() && origin.size() == 3) {
      frame =
          fmt::format("east, north, up about latitude {:.8f} deg, longitude {:.8f} deg, ellipsoidal height {:.3f} m",
                      origin[0].get<double>(), origin[1].get<double>(), origin[2].get<double>());
    } else if (local) {
      frame = "the local frame of the surveyed points, not georeferenced";
    }
    Values("systems", {{"Coordinates of this release", frame},
                       {"Reference ellipsoid", geodetic ? "WGS 84" : ""},
                       {"System for exports", f_.project.crs()},
                       {"System of the control as given", Joined(crs, "none")},
                       {"Heights of the control as given", geodetic ? Joined(heights) : ""},
                       {"Epoch of the control", crs.empty() ? "" : Joined(epochs)},
                       {"Epochs compared", Epochs(control)},
                       {"Datum of the map", f_.survey.value("datum", kNotStated)},
                       {"What fixes it", f_.survey.value("gauge", kNotStated)}});
  }

  // Of points surveyed at several epochs: how far they are apart.
  static std::string Epochs(const json& control) {
    const json differences = control.value("epoch_differences", json::array());
    if (differences.empty()) return "";
    size_t moved = 0;
    double largest = 0;
    for (const json& d : differences) {
      const json& v = d["used_minus_earlier_m"];
      moved += d.value("moved", false) ? 1 : 0;
      largest = std::max(largest, Eigen::Vector3d(v[0], v[1], v[2]).norm());
    }
    return fmt::format(
        "{} between the newest epoch of a point and earlier ones, largest {:.3f} m, {} beyond 99.9 %; the newest is "
        "used",
        Counted(differences.size(), "difference"), largest, moved);
  }

  void Method() {
    Chapter("Method", "method");
    std::string stages;
    for (const auto& [name, stage] : f_.record["stages"].items()) {
      if (name.find('/') != std::string::npos) continue;
      stages += fmt::format("{}{} (version {})", stages.empty() ? "" : ", ", name, stage.value("version", 0));
    }
    if (!f_.tags.empty()) {
      Say("Tags: one least-squares adjustment of all corners that the runs saw, their odometry, the control points and "
          "measured distances, each weighted by its sigma, with tests for outliers; covariances from the same "
          "adjustment, its datum included.");
    }
    Values("method", {{"Results", stages},
                      {"Program", "Trigpoint " + f_.record["program"].value("trigpoint", "")},
                      {"Computed on", f_.record["program"].value("system", "")},
                      {"Inputs", Inputs()}});
  }

  std::string Inputs() const {
    size_t copied = 0, all = 0;
    for (const auto& [path, input] : f_.record["inputs"].items()) {
      ++all;
      if (input.value("copied", false)) ++copied;
    }
    return fmt::format("{}, {} of them in the release, {} by SHA-256 alone", Counted(all, "file"), copied,
                       all - copied);
  }

  void Accuracy() {
    Chapter("Accuracy", "accuracy");
    if (!f_.tags.empty()) CheckPoints();
    if (!f_.tags.empty()) Predicted();
    Answers();
  }

  void CheckPoints() {
    const json check = f_.survey.value("check", json::object());
    const int n = check.value("n", 0);
    data_["check_points"] = check;
    if (n == 0) {
      Say("No check points took part: the accuracy of the map against the world was not tested. What the adjustment "
          "predicts is below.",
          Tone::kWarning);
      return;
    }
    Say(
        fmt::format("At {}, which took no part in the adjustment. RMSE with the check points' own sigma "
                    "in quadrature: horizontal {}, vertical {}, in space {}. Differences alone: {}, {}, {}.",
                    Counted(n, "check point"), Millimetres(check["rmse_h_m"]), Millimetres(check["rmse_v_m"]),
                    Millimetres(check["rmse_3d_m"]), Millimetres(check["differences_rmse_h_m"]),
                    Millimetres(check["differences_rmse_v_m"]), Millimetres(check["differences_rmse_3d_m"])));
    if (!check.value("conformant", false)) {
      Say(fmt::format(
              "No class of the ASPRS Positional Accuracy Standards (edition 2) is stated: they ask for 30 check "
              "points, this map has {}.",
              n),
          Tone::kWarning);
    }
    Table table{"check_points",
                "Check points: map less stated coordinates; sigma: of that difference, H: of each axis. Moved: the tag "
                "was seen at two places, so that the point does not count in the numbers above.",
                {{"point"},
                 {"dE (m)", true},
                 {"dN (m)", true},
                 {"dU (m)", true},
                 {"sigma H (m)", true},
                 {"sigma V (m)", true},
                 {"standardised", true},
                 {"status"}},
                {}};
    for (const json& point : f_.survey.value("points", json::array())) {
      if (point.value("role", "") != "check" || !point.contains("map_minus_stated_m")) continue;
      const json& d = point["map_minus_stated_m"];
      const bool counts = point.value("checked", true);
      std::vector<TableCell> row = {{point.value("name", "")}};
      for (const json& number : {d[0], d[1], d[2], point["sigma_h_m"], point["sigma_v_m"]}) {
        row.push_back({number.is_number() ? fmt::format("{:.4f}", number.get<double>()) : ""});
      }
      row.push_back({fmt::format("{:.1f}", std::sqrt(std::max(0.0, point.value("chi2_3dof", 0.0))))});
      row.push_back({counts ? "check" : "moved", {}, counts ? Tone::kPlain : Tone::kWarning});
      table.rows.push_back(std::move(row));
    }
    blocks_.push_back(table);
  }

  void Predicted() {
    std::vector<double> sigmas;
    for (const TagResult& tag : f_.tags) {
      if (tag.map_from_tag && tag.status == "ok" && tag.sigma_m && tag.sigma_m->allFinite())
        sigmas.push_back(tag.sigma_m->norm());
    }
    if (sigmas.empty()) return;
    const double median = Quantile(sigmas, 0.5), largest = Quantile(sigmas, 1);
    data_["predicted"] = {{"tags", sigmas.size()}, {"median_m", median}, {"largest_m", largest}};
    Say(
        fmt::format("Predicted by the adjustment, for {} in space (1 sigma, its datum included): median {:.3f} m, "
                    "largest {:.3f} m. A prediction, not a test.",
                    Counted(sigmas.size(), "tag"), median, largest));
  }

  // Of positions of panoramas and cameras, where they were held against something independent.
  void Answers() {
    Table table{"answers",
                "Positions of panoramas, compared with points that share no data with them.",
                {{"method"}, {"against"}, {"kind"}, {"answers", true}, {"median 3D (m)", true}, {"P90 3D (m)", true}},
                {}};
    for (const json& group : f_.evaluate.value("groups", json::array())) {
      if (group.value("shares_evidence", true)) continue;
      const json over = group.value("error_3d", json::object()).value("over_answers", json::object());
      const auto cell = [&](const char* key) {
        const json number = over.value(key, json());
        return TableCell{number.is_number() ? fmt::format("{:.3f}", number.get<double>()) : "too few"};
      };
      table.rows.push_back({{MethodName(group.value("method", ""))},
                            {ReferenceName(group.value("reference", ""))},
                            {group.value("kind", "")},
                            {fmt::format("{} of {}", group.value("answers", 0), group.value("attempts", 0))},
                            cell("median_m"),
                            cell("p90_m")});
      data_["answers"].push_back({{"method", group.value("method", "")},
                                  {"reference", group.value("reference", "")},
                                  {"kind", group.value("kind", "")},
                                  {"error_3d", over}});
    }
    if (!table.rows.empty()) blocks_.push_back(table);
    if (f_.tags.empty() && table.rows.empty()) {
      Say("No answer was compared with anything independent: the accuracy was not tested.", Tone::kWarning);
    }
  }

  // The limits that the project set, and how its results stand to them.
  void Gates() {
    const json gates = f_.gates.value("gates", json::array());
    Chapter("Quality gates", "gates");
    if (gates.empty()) {
      Say("No limits were set (gates: of trigpoint.yaml), so that nothing was judged.");
      return;
    }
    data_["gates"] = f_.gates;
    Table table{"gates",
                "Limits of the project, judged by the whole interval where the value was sampled: passed, failed, or "
                "undecided.",
                {{"gate"}, {"of"}, {"limit", true}, {"value", true}, {"interval"}, {"n", true}, {"verdict"}},
                {}};
    const auto number = [](const json& v) { return v.is_number() ? fmt::format("{:.4g}", v.get<double>()) : ""; };
    const auto ends = [&](const json& gate) -> std::string {
      const json interval = gate.value("interval", json());
      if (!interval.is_array()) return "";
      return fmt::format("{} ({:.0f} %)", EndsText(number(interval[0]), number(interval[1])),
                         100 * gate.value("confidence", 0.0));
    };
    for (const json& gate : gates) {
      const std::string unit = gate.value("unit", ""), verdict = gate.value("verdict", "");
      table.rows.push_back({{gate.value("gate", "")},
                            {gate.value("of", "")},
                            {(gate.value("limit_is", "") == "most" ? "at most " : "at least ") + number(gate["limit"]) +
                             (unit.empty() ? "" : " " + unit)},
                            {number(gate["value"])},
                            {ends(gate)},
                            {gate.value("n", 0) > 0 ? std::to_string(gate.value("n", 0)) : ""},
                            {verdict,
                             {},
                             verdict == "passed"   ? Tone::kGood
                             : verdict == "failed" ? Tone::kBad
                                                   : Tone::kWarning}});
    }
    Say("All together: " + f_.gates.value("verdict", "undecided") + ".");
    blocks_.push_back(table);
  }

  void AddGateLimits(std::vector<std::string>* limits) const {
    for (const json& gate : f_.gates.value("gates", json::array())) {
      if (gate.value("verdict", "") == "passed") continue;
      limits->push_back("A quality gate was not passed: " + gate.value("message", gate.value("gate", "")));
    }
  }

  void Limits() {
    std::vector<std::string> limits;
    const int n = f_.survey.value("check", json::object()).value("n", 0);
    const std::string datum = f_.survey.value("datum", "");
    if (!f_.tags.empty() && datum.find("control") == std::string::npos) {
      limits.push_back("No control holds the map (datum: " + (datum.empty() ? "none" : datum) +
                       "): distances between tags can be used; georeferenced coordinates are as good as what the datum "
                       "was taken from.");
    }
    if (!f_.tags.empty() && n < 30) {
      limits.push_back(n == 0 ? "The accuracy was not tested by check points; it must not be stated as tested."
                              : fmt::format("The accuracy was tested at {} only.", Counted(n, "check point")));
    }
    AddGateLimits(&limits);
    AddExtent(&limits);
    std::map<std::string, std::set<std::string>> unusable;
    for (const TagResult& tag : f_.tags) {
      if (tag.status != "ok") unusable[tag.status].insert(std::to_string(tag.tag_id));
    }
    for (const auto& [status, tags] : unusable)
      limits.push_back("Not to be used, status " + status + ": tags " + Joined(tags) + ".");
    AddSystemLimits(&limits);
    if (!f_.project.review().entries().empty()) {
      limits.push_back(fmt::format(
          "{}, see site/review.jsonl: what a decision excludes took no part.",
          Counted(f_.project.review().entries().size(), "decision of a review holds", "decisions of a review hold")));
    }
    AddWarnings(&limits);
    Chapter("Limits of use", "limits");
    for (const std::string& limit : limits) Say("- " + limit);
    data_["limits"] = limits;
  }

  // Ruled lines to write on, by hand; the caption states whom the release names as responsible.
  void ToSign() {
    constexpr double kWidth = 720, kHeight = 84, kLine = 60, kGap = 24;
    Drawing lines;
    lines.width = kWidth, lines.height = kHeight;
    double x = 0;
    const std::pair<const char*, double> columns[] = {{"Name", 0.38}, {"Date", 0.2}, {"Signature", 0.42}};
    for (const auto& [label, share] : columns) {
      const double end = x + share * (kWidth + kGap) - kGap;
      lines.Line({{x, kLine}, {end, kLine}}, "#1d2329");
      lines.Text(x, kLine + 16, label, -1, 12, "#1d2329");
      x = end + kGap;
    }
    Chapter("Signature", "signature");
    const std::string author = f_.statement.author.empty() ? kNotStated : f_.statement.author;
    blocks_.push_back(Figure{"signature", "To be signed by the person responsible (" + author + ").", lines});
  }

  // Tags beyond the control are extrapolated.
  void AddExtent(std::vector<std::string>* limits) const {
    std::vector<Eigen::Vector2d> control;
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
    for (const TagResult& tag : f_.tags) {
      if (!tag.map_from_tag) continue;
      low = low.cwiseMin(tag.map_from_tag->translation);
      high = high.cwiseMax(tag.map_from_tag->translation);
      if (tag.role == "control") control.push_back(tag.map_from_tag->translation.head<2>());
    }
    if (low.x() > high.x()) return;
    limits->push_back(
        fmt::format("Holds for the tags within east {:.1f} to {:.1f} m, north {:.1f} to {:.1f} m, up {:.1f} "
                    "to {:.1f} m of the site's frame.",
                    low.x(), high.x(), low.y(), high.y(), low.z(), high.z()));
    if (control.size() < 3) return;
    std::set<std::string> outside;
    for (const TagResult& tag : f_.tags) {
      if (tag.map_from_tag && tag.role != "control" && IsOutside(tag.map_from_tag->translation.head<2>(), control))
        outside.insert(std::to_string(tag.tag_id));
    }
    if (!outside.empty()) {
      limits->push_back("Outside the area that the control spans, and so extrapolated: tags " + Joined(outside) + ".");
    }
  }

  // Is there a line through the point with all of `points` strictly on one side?
  static bool IsOutside(const Eigen::Vector2d& point, const std::vector<Eigen::Vector2d>& points) {
    std::vector<double> angles;
    for (const Eigen::Vector2d& other : points) {
      if ((other - point).norm() < 1e-9) return false;
      angles.push_back(std::atan2(other.y() - point.y(), other.x() - point.x()));
    }
    std::sort(angles.begin(), angles.end());
    double widest = angles.front() + 2 * M_PI - angles.back();
    for (size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
    return widest > M_PI + 1e-9;
  }

  void AddSystemLimits(std::vector<std::string>* limits) const {
    const json control = f_.survey.value("control", json::object());
    std::set<std::string> geoids;
    for (const json& height : control.value("heights", json::array())) geoids.insert(height.get<std::string>());
    const bool geodetic = !geoids.empty();
    geoids.erase("ellipsoidal");
    const json epochs = control.value("epochs", json::array());
    if (geodetic && std::find(epochs.begin(), epochs.end(), json("")) != epochs.end()) {
      limits->push_back(
          "The epoch of the control is not stated: coordinates hold at the time of its measurement; plates "
          "move by centimetres a year.");
    }
    if (!geoids.empty()) limits->push_back("Heights of control points are given above " + Joined(geoids) + ".");
  }

  void AddWarnings(std::vector<std::string>* limits) const {
    constexpr size_t kMost = 10;
    std::set<std::string> warnings;
    for (const auto& [name, stage] : f_.record["stages"].items()) {
      for (const json& warning : stage.value("warnings", json::array())) {
        if (warning.is_string() && name != "report") warnings.insert(name + ": " + warning.get<std::string>());
      }
    }
    size_t shown = 0;
    for (const std::string& warning : warnings) {
      if (++shown > kMost) break;
      limits->push_back("Warning of " + warning);
    }
    if (warnings.size() > kMost)
      limits->push_back(fmt::format("{}, see release.json.", Counted(warnings.size() - kMost, "more warning")));
  }

  // Runs behind the release that can still be asked for.
  std::set<std::string> RunsOfMap() const {
    std::set<std::string> runs;
    for (const auto& [name, stage] : f_.record["stages"].items()) {
      const std::string its = stage.value("name", "");
      if (name.find('/') != std::string::npos) runs.insert(its.substr(0, its.find('@')));
    }
    std::erase_if(runs, [&](const std::string& run) {
      const auto& known = f_.project.site().runs;
      return std::none_of(known.begin(), known.end(), [&](const Run& r) { return r.name == run; });
    });
    return runs;
  }

  const Subject& f_;
  std::vector<Block> blocks_;
  json data_ = {{"schema", "trigpoint certificate 1"}};
};

}  // namespace

void WriteCertificate(const Project& project, const json& record, const ReleaseStatement& statement,
                      const fs::path& release) {
  Subject facts{project,
                record,
                statement,
                ReadJsonOrNothing(release / "map" / "summary.json"),
                ReadJsonOrNothing(release / "evaluate" / "summary.json"),
                ReadJsonOrNothing(release / "gates" / "gates.json"),
                {}};
  if (fs::exists(release / "map" / "tags.csv"))
    facts.tags = ReadTagResults(release / "map" / "tags.csv", release / "map" / "tags_cov.csv");
  Page page(facts);
  const Document document = page.Make();
  WriteFileAtomically(release / "certificate.html", HtmlOf(document));
  WriteFileAtomically(release / "certificate.json", DumpJson(page.Data(), 1) + "\n");
  WritePdf(document, Paper::kA4, (release / "certificate.pdf").string());
}

}  // namespace trigpoint
