// The tag map: how well it agrees with surveyed points, distances and itself.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/counted.h"
#include "eval/report/chapters.h"
#include "eval/report/survey_plan.h"

namespace trigpoint {
namespace {

constexpr double kClassStep = 0.005;  // m

const nlohmann::json& ListAt(const nlohmann::json& value, const char* key) {
  static const nlohmann::json kNone = nlohmann::json::array();
  if (!value.is_object()) return kNone;
  const auto it = value.find(key);
  return it != value.end() && it->is_array() ? *it : kNone;
}

std::optional<Eigen::Vector3d> VectorAt(const nlohmann::json& value, const char* key) {
  const nlohmann::json& list = ListAt(value, key);
  Eigen::Vector3d v;
  if (list.size() != 3) return std::nullopt;
  for (size_t k = 0; k < 3; ++k) {
    if (!list[k].is_number()) return std::nullopt;
    v[static_cast<Eigen::Index>(k)] = list[k];
  }
  return v;
}

class SurveyChapter {
 public:
  SurveyChapter(const ChapterContext& c, std::vector<Block>* blocks)
      : c_(c), survey_(c.data.survey), blocks_(*blocks), u_(" (" + c.unit.name + ")") {}

  void Add() {
    blocks_.push_back(Heading{2, "Survey", "survey"});
    About();
    Accuracy();
    PlanOfPoints();
    Points("check", "survey_check",
           "Check points: surveyed, but no part of the solution. d: map minus stated; sigma: of that difference, H: of "
           "each axis; standardised: the difference in its sigmas, in space (3 degrees of freedom: 95 % are below "
           "2.8). Moved: not counted above.");
    Points("control", "survey_control",
           "Control points: part of the solution, so that their residuals are smaller than the map's errors. Left out: "
           "the difference in space if the map were made without the point, linearly; - where nothing else holds a "
           "direction.");
    ControlEpochs();
    Distances();
    Sessions();
    Budget();
    Tags();
  }

 private:
  void About() {
    const std::string frame = TextAt(survey_, "frame");
    std::string text = "Datum: " + TextAt(survey_, "datum") + ". " +
                       (frame == "enu"     ? "Coordinates are the site's: east, north, up."
                        : frame == "local" ? "Coordinates are those of the surveyed points' own frame."
                                           : "The map has a frame of its own: nothing ties it to surveyed points.");
    const auto repeatability = At(survey_, {"repeatability", "rms_m"});
    if (repeatability && At(survey_, {"repeatability", "differences"}).value_or(0) > 0) {
      text += fmt::format(" Repeatability: maps of all runs but one lie {} (RMS over {:.0f} tags) from the map of all.",
                          c_.LengthUnit(repeatability, 4), *At(survey_, {"repeatability", "differences"}));
    }
    blocks_.push_back(Paragraph{text});
  }

  // Words for the class of the ASPRS standard, or why there is none.
  std::string ClassOf(const nlohmann::json& check, int n, double rmse_h, double rmse_v) const {
    if (!FlagAt(check, "conformant")) {
      return fmt::format(
          "No accuracy class of the ASPRS Positional Accuracy Standards (edition 2): they ask for 30 check points, the "
          "map has {}.",
          n);
    }
    const auto up = [](double m) { return 100 * std::ceil(m / kClassStep - 1e-9) * kClassStep; };
    return fmt::format(
        "Tested as the ASPRS Positional Accuracy Standards (edition 2) ask for, with {} check points: it meets the "
        "{:g} cm horizontal (RMSE_H) and the {:g} cm vertical (RMSE_V) accuracy class, rounded up to 0.5 cm.",
        n, up(rmse_h), up(rmse_v));
  }

  void Accuracy() {
    const nlohmann::json& check = ObjectAt(survey_, "check");
    const int n = static_cast<int>(At(check, {"n"}).value_or(0));
    const auto h = At(check, {"rmse_h_m"}), v = At(check, {"rmse_v_m"}), d = At(check, {"rmse_3d_m"});
    const std::string note = TextAt(check, "note");
    if (n == 0 || !h || !v || !d) {
      blocks_.push_back(Paragraph{"No check point: how accurate the map is was not measured. " + note, Tone::kWarning});
      return;
    }
    const auto fact = [&](const char* label, const std::optional<double>& value, const char* differences) {
      return Fact{label, c_.LengthUnit(value, 4),
                  fmt::format("{}; differences alone {}", Counted(n, "check point"),
                              c_.LengthUnit(At(check, {differences}), 4))};
    };
    blocks_.push_back(Facts{{fact("RMSE_H", h, "differences_rmse_h_m"), fact("RMSE_V", v, "differences_rmse_v_m"),
                             fact("RMSE_3D", d, "differences_rmse_3d_m")}});
    blocks_.push_back(Paragraph{ClassOf(check, n, *h, *v) +
                                " The check points' own uncertainty is part of these numbers, in quadrature." +
                                (note.empty() ? "" : " Note: " + note + ".")});
    Table table{"survey_accuracy",
                "Root mean square of map minus stated at check points; total: with the check points' own sigma in "
                "quadrature.",
                {{"component"},
                 {"differences" + u_, true},
                 {"check points' own" + u_, true},
                 {"total" + u_, true},
                 {"n", true}},
                {}};
    const bool nssda = At(check, {"nssda_horizontal_95_m"}).has_value();
    if (nssda) table.columns.insert(table.columns.end() - 1, {"NSSDA 95 %" + u_, true});
    const auto row = [&](const char* name, const char* differences, const std::optional<double>& own,
                         const std::optional<double>& total, const char* of_95) {
      table.rows.push_back(
          {{name}, c_.LengthCell(At(check, {differences}), 4), c_.LengthCell(own, 4), c_.LengthCell(total, 4)});
      if (nssda) table.rows.back().push_back(c_.LengthCell(At(check, {of_95}), 4));
      table.rows.back().push_back({std::to_string(n), n});
    };
    const auto own_h = At(check, {"check_points_sigma_h_m"}), own_v = At(check, {"check_points_sigma_v_m"});
    row("horizontal", "differences_rmse_h_m", own_h, h, "nssda_horizontal_95_m");
    row("vertical", "differences_rmse_v_m", own_v, v, "nssda_vertical_95_m");
    row("3D", "differences_rmse_3d_m", std::hypot(own_h.value_or(0), own_v.value_or(0)), d, "");
    blocks_.push_back(table);
  }

  void PlanOfPoints() {
    std::vector<SurveyPlanPoint> points;
    std::vector<std::string> surveyed;
    for (const nlohmann::json& p : ListAt(survey_, "points")) {
      const auto place = VectorAt(p, "stated_m"), residual = VectorAt(p, "map_minus_stated_m");
      const nlohmann::json& cov = ListAt(p, "covariance_h_m2");
      const std::string role = TextAt(p, "role");
      if (!place || !residual || cov.size() != 3 || (role != "control" && role != "check")) continue;
      SurveyPlanPoint& point = points.emplace_back();
      point.name = TextAt(p, "name");
      point.control = role == "control";
      point.place_m = place->head<2>();
      point.residual_m = residual->head<2>();
      const auto entry = [&](size_t k) { return cov[k].is_number() ? cov[k].get<double>() : 0; };
      point.covariance_m2 << entry(0), entry(1), entry(1), entry(2);
      if (const auto tag = At(p, {"tag_id"}); tag && *tag >= 0) surveyed.push_back(fmt::format("{:.0f}", *tag));
    }
    if (points.empty()) return;
    std::vector<Eigen::Vector2d> tags;
    for (const TagLine& tag : c_.data.tags) {
      const bool has_point = std::find(surveyed.begin(), surveyed.end(), std::to_string(tag.id)) != surveyed.end();
      if (tag.source == "survey" && tag.place_m && !has_point) tags.push_back(tag.place_m->head<2>());
    }
    Plan plan = SurveyPlanOf(points, tags, c_.unit.name, c_.unit.metres);
    blocks_.push_back(Figure{"survey_plan", plan.caption, std::move(plan.drawing)});
  }

  void Points(const std::string& role, const std::string& name, const std::string& caption) {
    const bool control = role == "control";
    Table table{name,
                caption,
                {{"point"},
                 {"dE" + u_, true},
                 {"dN" + u_, true},
                 {"dU" + u_, true},
                 {"H" + u_, true},
                 {"V" + u_, true},
                 {"3D" + u_, true},
                 {"sigma H" + u_, true},
                 {"sigma V" + u_, true},
                 {"standardised", true},
                 {"status"}},
                {}};
    if (control) table.columns.insert(table.columns.end() - 1, {"left out 3D" + u_, true});
    for (const nlohmann::json& p : ListAt(survey_, "points")) {
      const auto e = VectorAt(p, "map_minus_stated_m");
      if (TextAt(p, "role") != role || !e) continue;
      const double chi2 = At(p, {"chi2_3dof"}).value_or(0), standardised = std::sqrt(std::max(0.0, chi2));
      std::vector<TableCell> row = {{TextAt(p, "name")}};
      for (const double v : {e->x(), e->y(), e->z(), e->head<2>().norm(), std::abs(e->z()), e->norm()})
        row.push_back(c_.LengthCell(v, 4));
      row.push_back(c_.LengthCell(At(p, {"sigma_h_m"}), 4));
      row.push_back(c_.LengthCell(At(p, {"sigma_v_m"}), 4));
      row.push_back({fmt::format("{:.2f}", standardised), standardised, chi2 > 16.27 ? Tone::kWarning : Tone::kPlain});
      if (control) {
        const auto left_out = VectorAt(p, "left_out_m");
        row.push_back(left_out ? c_.LengthCell(left_out->norm(), 4) : TableCell{});
      }
      row.push_back({TextAt(p, "status"), {}, FlagAt(p, "excluded") ? Tone::kBad : Tone::kPlain});
      table.rows.push_back(std::move(row));
    }
    if (table.rows.empty()) return;
    blocks_.push_back(table);
  }

  void ControlEpochs() {
    Table table{
        "survey_control_epochs",
        "Points surveyed at several epochs: the newest is used; d: newest minus earlier, with its 1 sigma. Moved: "
        "beyond 99.9 % (chi-square, 3 degrees of freedom).",
        {{"point"},
         {"earlier epoch"},
         {"epoch used"},
         {"dE" + u_, true},
         {"dN" + u_, true},
         {"dU" + u_, true},
         {"sigma E" + u_, true},
         {"sigma N" + u_, true},
         {"sigma U" + u_, true},
         {"standardised", true},
         {"status"}},
        {}};
    for (const nlohmann::json& p : ListAt(ObjectAt(survey_, "control"), "epoch_differences")) {
      const auto d = VectorAt(p, "used_minus_earlier_m"), sigma = VectorAt(p, "sigma_m");
      if (!d || !sigma) continue;
      const bool moved = FlagAt(p, "moved");
      const double standardised = std::sqrt(std::max(0.0, At(p, {"chi2_3dof"}).value_or(0)));
      std::vector<TableCell> row = {{TextAt(p, "point")}, {TextAt(p, "earlier")}, {TextAt(p, "used")}};
      for (const auto& v : {*d, *sigma}) {
        for (int k = 0; k < 3; ++k) row.push_back(c_.LengthCell(v[k], 4));
      }
      row.push_back({fmt::format("{:.2f}", standardised), standardised});
      row.push_back({moved ? "moved" : "same", {}, moved ? Tone::kWarning : Tone::kPlain});
      table.rows.push_back(std::move(row));
    }
    if (!table.rows.empty()) blocks_.push_back(table);
  }

  void Distances() {
    Table table{"survey_distances",
                "Measured distances between tags: map minus measured, sigma of that difference.",
                {{"from"},
                 {"to"},
                 {"role"},
                 {"measured" + u_, true},
                 {"map" + u_, true},
                 {"difference" + u_, true},
                 {"sigma" + u_, true},
                 {"status"}},
                {}};
    for (const nlohmann::json& d : ListAt(survey_, "distances")) {
      const auto measured = At(d, {"measured_m"}), map = At(d, {"map_m"});
      if (!measured || !map) continue;
      table.rows.push_back({{NumberText(At(d, {"from"}), 0)},
                            {NumberText(At(d, {"to"}), 0)},
                            {TextAt(d, "role")},
                            c_.LengthCell(measured, 4),
                            c_.LengthCell(map, 4),
                            c_.LengthCell(*map - *measured, 4),
                            c_.LengthCell(At(d, {"sigma_m"}), 4),
                            {FlagAt(d, "excluded") ? "taken out" : ""}});
    }
    if (!table.rows.empty()) blocks_.push_back(table);
  }

  void Sessions() {
    Table table{"survey_sessions",
                "Runs and photo sets of the survey. Repeatability: root mean square of tags, the map without this run "
                "against the map of all.",
                {{"run"},
                 {"session"},
                 {"images", true},
                 {"observations", true},
                 {"rejected", true},
                 {"corners (px rms)", true},
                 {"odometry scale", true},
                 {"odometry jumps", true},
                 {"repeatability" + u_, true}},
                {}};
    for (const nlohmann::json& r : ListAt(survey_, "runs")) {
      const auto number = [&](const char* key, int decimals) { return NumberCell(At(r, {key}), decimals); };
      const bool scaled = At(r, {"scale_sigma"}).value_or(0) > 0;
      table.rows.push_back({{TextAt(r, "name")},
                            {TextAt(r, "date")},
                            number("frames", 0),
                            number("sights", 0),
                            number("rejected", 0),
                            number("rms_px", 3),
                            scaled ? number("scale", 5) : TableCell{},
                            number("odometry_jumps", 0),
                            c_.LengthCell(At(r, {"repeatability_m"}), 4)});
    }
    if (!table.rows.empty()) blocks_.push_back(table);
    Moved();
  }

  void Moved() {
    const nlohmann::json& against = ObjectAt(survey_, "against");
    Table table{"survey_moved",
                "Tags that moved since " + TextAt(against, "survey") + " (chi-square, 6 degrees of freedom, 99.9 %).",
                {{"tag", true}, {"dE" + u_, true}, {"dN" + u_, true}, {"dU" + u_, true}, {"turned (deg)", true}},
                {}};
    for (const nlohmann::json& t : ListAt(against, "tags")) {
      const auto shift = VectorAt(t, "shift_m");
      if (!FlagAt(t, "moved") || !shift) continue;
      table.rows.push_back({NumberCell(At(t, {"tag_id"}), 0), c_.LengthCell(shift->x(), 4),
                            c_.LengthCell(shift->y(), 4), c_.LengthCell(shift->z(), 4),
                            NumberCell(At(t, {"turn_deg"}), 3)});
    }
    if (!table.rows.empty()) blocks_.push_back(table);
  }

  // Where the tags' uncertainty comes from, and which point would lower it most.
  void Budget() {
    const nlohmann::json& budget = ObjectAt(survey_, "budget");
    const std::vector<std::pair<std::string, std::string>> sources = {
        {"control_m", "control"},     {"geotags_m", "geotags"},   {"gps_m", "GPS"},
        {"corners_m", "corners"},     {"odometry_m", "odometry"}, {"scene_points_m", "scene points"},
        {"distances_m", "distances"}, {"other_m", "other"}};
    const nlohmann::json& tags = ListAt(budget, "tags");
    if (tags.empty()) return;
    Table table{"survey_budget",
                "Where the uncertainty of each tag's centre comes from: 1 sigma, three axes in quadrature. Squares of "
                "the sources add up to that of the total. Corners: of tags in pictures; distances: measured ones and "
                "total stations; other: priors, and contradictions that were added.",
                {{"tag", true}, {"total" + u_, true}},
                {}};
    std::vector<std::string> shown;
    for (const auto& [key, title] : sources) {
      if (std::none_of(tags.begin(), tags.end(), [&, k = key](const auto& t) { return At(t, {k.c_str()}) > 5e-5; }))
        continue;
      shown.push_back(key);
      table.columns.push_back({title + u_, true});
    }
    table.columns.push_back({"limited by"});
    for (const nlohmann::json& t : tags) {
      std::vector<TableCell> row = {NumberCell(At(t, {"tag_id"}), 0), c_.LengthCell(At(t, {"sigma_3d_m"}), 4)};
      for (const std::string& key : shown) row.push_back(c_.LengthCell(At(t, {key.c_str()}), 4));
      row.push_back({WithSpaces(TextAt(t, "limited_by"))});
      table.rows.push_back(std::move(row));
    }
    blocks_.push_back(table);
    NextPoint(ObjectAt(budget, "next_point"));
  }

  static std::string WithSpaces(std::string text) {
    std::replace(text.begin(), text.end(), '_', ' ');
    return text;
  }

  void NextPoint(const nlohmann::json& next) {
    if (!At(next, {"tag_id"})) return;
    const auto length = [&](const char* key) { return c_.LengthUnit(At(next, {key}), 4); };
    blocks_.push_back(
        Paragraph{fmt::format("To measure next: tag {:.0f} as control. Surveyed to {} horizontally and {} vertically "
                              "(1 sigma, each axis), it would lower the tags' uncertainty from {} to {} (predicted, 1 "
                              "sigma in 3D, root mean square of all tags), that of the worst from {} to {}.",
                              *At(next, {"tag_id"}), length("sigma_h_m"), length("sigma_v_m"), length("rms_now_m"),
                              length("rms_then_m"), length("worst_now_m"), length("worst_then_m"))});
  }

  void Tags() {
    Table table{"survey_tags",
                "Tags of the map: place of the centre, 1 sigma of each axis, and the corners' residual in images.",
                {{"tag", true},
                 {"role"},
                 {"x" + u_, true},
                 {"y" + u_, true},
                 {"z" + u_, true},
                 {"sigma x" + u_, true},
                 {"sigma y" + u_, true},
                 {"sigma z" + u_, true},
                 {"images", true},
                 {"runs", true},
                 {"corners (px rms)", true},
                 {"status"}},
                {}};
    for (const TagLine& t : c_.data.tags) {
      if (t.source != "survey") continue;
      std::vector<TableCell> row = {{std::to_string(t.id), t.id}, {t.role}};
      for (const auto& v : {t.place_m, t.sigmas_m}) {
        for (int k = 0; k < 3; ++k) row.push_back(v ? c_.LengthCell((*v)[k], 4) : TableCell{});
      }
      row.push_back({std::to_string(t.images), t.images});
      row.push_back({std::to_string(t.runs), t.runs});
      row.push_back(NumberCell(t.rms_px, 3));
      row.push_back({t.status, {}, t.status == "ok" ? Tone::kPlain : Tone::kWarning});
      table.rows.push_back(std::move(row));
    }
    if (table.rows.empty()) return;
    blocks_.push_back(FoldBegin{fmt::format("Tags of the map ({})", table.rows.size())});
    blocks_.push_back(table);
    blocks_.push_back(FoldEnd{});
  }

  const ChapterContext& c_;
  const nlohmann::json& survey_;
  std::vector<Block>& blocks_;
  const std::string u_;
};

}  // namespace

void AddSurvey(const ChapterContext& c, std::vector<Block>* blocks) {
  if (!c.data.survey.is_object()) return;
  SurveyChapter(c, blocks).Add();
}

}  // namespace trigpoint
