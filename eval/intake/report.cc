// What `check` found, as tables and a page.
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <set>

#include "calib/base/counted.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/intake/check.h"
#include "eval/plan/findings.h"
#include "eval/report/document.h"
#include "survey/tags/map_start.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kMm = 1e3;
constexpr double kEmpty = std::numeric_limits<double>::quiet_NaN();  // an empty cell

Tone ToneOf(Light light) {
  return light == Light::kGreen ? Tone::kGood : light == Light::kAmber ? Tone::kWarning : Tone::kBad;
}

// Of the sets that were judged.
int PhotosOfSets(const CheckOutcome& outcome) {
  int photos = 0;
  for (const FieldSet& set : outcome.facts.sets) photos += set.photos;
  return photos;
}

PlanFindings MapFindings(const CheckOutcome& outcome) {
  PlanFindings findings;
  findings.layout.network = *outcome.facts.layout;
  findings.prediction = *outcome.facts.prediction;
  for (const Advice& advice : outcome.advice) {
    PlanGain gain;
    gain.what = advice.what.In();
    gain.world_m = advice.from ? advice.from : advice.at;
    if (advice.from) gain.heading_rad = advice.heading_rad;
    findings.suggestions.push_back(gain);
  }
  // Planned places are coordinates of the site: a map in a frame of its own has none of them.
  std::set<int> unseen;
  for (const auto& [id, planned] : outcome.facts.planned) {
    if (!findings.prediction.in_world || !planned.world_m || findings.layout.network.world_from_tag.contains(id))
      continue;
    TagPrediction& tag = findings.prediction.tags.emplace_back();
    tag.tag_id = id;
    unseen.insert(id);
    tag.world_m = *planned.world_m;
    findings.layout.network.world_from_tag[id].translation = tag.world_m;  // which way it faces is not known
  }
  for (const Station& station : outcome.facts.site->stations) {
    const auto tag = findings.layout.network.world_from_tag.find(station.tag_id);
    if (tag == findings.layout.network.world_from_tag.end()) continue;
    // In the frame of a tag of which only the place is known an offset has no direction: the tag's place stands for it.
    const bool unknown = station.in_tag_frame && unseen.contains(station.tag_id);
    findings.layout.stations.push_back({station.name, station.tag_id,
                                        unknown ? Eigen::Vector3d(0, 0, 0) : OffsetInWorld(station, tag->second),
                                        station.sigma_m});
  }
  return findings;
}

void WriteTables(const CheckOutcome& outcome, const fs::path& folder) {
  CsvWriter findings({"light", "topic", "finding"}, {"trigpoint check findings 1"});
  for (const SiteFinding& f : outcome.findings) {
    findings.Text(LightName(f.light)).Text(f.topic).Text(f.text.In());
    findings.EndRow();
  }
  findings.Save(folder / "findings.csv");
  CsvWriter tags(
      {"tag_id", "status", "pictures", "runs", "largest_px", "nearest_m", "left_deg", "right_deg", "sigma_x_m",
       "sigma_y_m", "sigma_z_m"},
      {"trigpoint check tags 1; sigma=1, predicted; left_deg to right_deg: directions from the tag's normal, "
       "to the right as one faces it"});
  for (const TagCoverage& tag : CoverTags(outcome.facts)) {
    tags.Integer(tag.tag_id).Text(tag.status).Integer(tag.pictures).Integer(tag.runs).Number(tag.largest_px, 1);
    tags.Number(tag.nearest_m.value_or(kEmpty), 2);
    for (const double side_deg : {tag.left_deg, tag.right_deg}) tags.Number(tag.nearest_m ? side_deg : kEmpty, 1);
    for (int k = 0; k < 3; ++k) tags.Number(tag.sigma_m ? (*tag.sigma_m)[k] : kEmpty, 6);
    tags.EndRow();
  }
  tags.Save(folder / "tags.csv");
  CsvWriter next({"rank", "what", "why", "from_x", "from_y", "from_z", "heading_deg"},
                 {"trigpoint check next 1; m, frame of the map; heading: clockwise from its y axis"});
  int rank = 0;
  for (const Advice& advice : outcome.advice) {
    next.Integer(++rank).Text(advice.what.In()).Text(advice.why);
    for (int k = 0; k < 3; ++k) next.Number(advice.from ? (*advice.from)[k] : kEmpty, 2);
    next.Number(advice.heading_rad ? std::fmod(*advice.heading_rad * kRadToDeg + 360, 360) : kEmpty, 0);
    next.EndRow();
  }
  next.Save(folder / "next.csv");
}

nlohmann::json SummaryOf(const CheckOutcome& outcome) {
  nlohmann::json json = {{"schema", 1},
                         {"light", LightName(outcome.light)},
                         {"pictures", outcome.pictures},
                         {"photo_sets", outcome.facts.sets.size()},
                         {"photos_of_sets", PhotosOfSets(outcome)},
                         {"waiting", outcome.waiting},
                         {"planned_tags", outcome.facts.planned.size()},
                         {"planned_tags_seen", outcome.planned_seen},
                         {"findings", nlohmann::json::array()},
                         {"next", nlohmann::json::array()}};
  for (const SiteFinding& f : outcome.findings) {
    json["findings"].push_back({{"light", LightName(f.light)}, {"topic", f.topic}, {"text", f.text.In()}});
  }
  for (const Advice& a : outcome.advice) json["next"].push_back({{"what", a.what.In()}, {"why", a.why}});
  if (outcome.facts.prediction) {
    json["datum"] = outcome.facts.prediction->datum;
    json["rms_tag_sigma_m"] = outcome.facts.prediction->RmsSigma();
  }
  return json;
}

TableCell Text(const std::string& text, Tone tone = Tone::kPlain) { return {text, std::nullopt, tone}; }
TableCell Number(double value, int decimals) { return {fmt::format("{:.{}f}", value, decimals), value}; }

Table FindingTable(const CheckOutcome& outcome, const DisplayUnit& unit) {
  Table table{
      "", "Red: the recordings do not suffice yet. Amber: check it before you leave the site. Green: no problem found"};
  table.columns = {{"light"}, {"topic"}, {"finding"}};
  for (const SiteFinding& f : outcome.findings) {
    table.rows.push_back(
        {Text(LightName(f.light), ToneOf(f.light)), Text(f.topic), Text(f.text.In(unit.name, unit.metres))});
  }
  return table;
}

Table TagTable(const CheckOutcome& outcome, const DisplayUnit& unit) {
  Table table{
      "",
      "Directions: the directions that the tag was photographed from, as angles from its normal, positive to the right "
      "for a viewer who faces the tag. Sigmas: predicted, 1 sigma"};
  constexpr const char* kUnplaced = "the tag has no place in the map yet";
  table.columns = {{"tag", true},
                   {"status"},
                   {"pictures", true},
                   {"runs", true},
                   {"largest (px)", true},
                   {fmt::format("nearest ({})", unit.name), true, kUnplaced},
                   {"from (deg)", true, kUnplaced},
                   {"to (deg)", true, kUnplaced},
                   {"3D sigma (mm)", true, kUnplaced},
                   {"planned as", false, "tags.yaml lists it"}};
  for (const TagCoverage& tag : CoverTags(outcome.facts)) {
    const auto planned = outcome.facts.planned.find(tag.tag_id);
    const bool bad = tag.status != "ok" && !tag.status.empty();
    std::vector<TableCell> row = {Number(tag.tag_id, 0), Text(tag.status, bad ? Tone::kBad : Tone::kPlain),
                                  Number(tag.pictures, 0), Number(tag.runs, 0), Number(tag.largest_px, 0)};
    row.push_back(tag.nearest_m ? Number(*tag.nearest_m / unit.metres, 1) : Text(""));
    row.push_back(tag.nearest_m ? Number(tag.left_deg, 0) : Text(""));
    row.push_back(tag.nearest_m ? Number(tag.right_deg, 0) : Text(""));
    row.push_back(tag.sigma_m ? Number(kMm * tag.sigma_m->norm(), 1) : Text(""));
    row.push_back(Text(planned != outcome.facts.planned.end() ? planned->second.what : "not planned"));
    table.rows.push_back(row);
  }
  return table;
}

Document PageOf(const CheckOutcome& outcome, const DisplayUnit& unit) {
  const FieldFacts& facts = outcome.facts;
  const bool green = outcome.light == Light::kGreen;
  Document page;
  page.title = "Is it enough? " + std::string(LightName(outcome.light));
  page.subtitle = outcome.project->name() + ", " + UtcTimeText() + ": " + CheckHeadline(outcome);
  Facts few;
  few.facts.push_back({"Before leaving", LightName(outcome.light),
                       green                    ? "nothing to do"
                       : outcome.advice.empty() ? "see the findings"
                                                : "see what to do next",
                       ToneOf(outcome.light)});
  few.facts.push_back({"Pictures", std::to_string(outcome.pictures + PhotosOfSets(outcome)),
                       outcome.waiting > 0 ? fmt::format("{} not yet processed", outcome.waiting) : "all processed"});
  few.facts.push_back({"Tags seen", std::to_string(outcome.planned_seen),
                       facts.planned.empty() ? "none is planned" : fmt::format("of {}", facts.planned.size())});
  if (facts.prediction) {
    few.facts.push_back({"Tags, RMS of the 3D sigma", fmt::format("{:.1f} mm", kMm * facts.prediction->RmsSigma()),
                         "predicted, 1 sigma; datum: " + facts.prediction->datum});
  }
  page.blocks.push_back(few);
  page.blocks.push_back(Heading{2, green ? "What would still improve the survey" : "What to do next", "next"});
  if (outcome.advice.empty()) {
    page.blocks.push_back(Paragraph{NothingNext(facts, green), green ? Tone::kGood : Tone::kPlain});
  }
  int rank = 0;
  for (const Advice& advice : outcome.advice) {
    const std::string what = advice.what.In(unit.name, unit.metres);
    page.blocks.push_back(Paragraph{fmt::format("{}. {}. Why: {}.", ++rank, what, advice.why),
                                    advice.rms_after_m > 0 ? Tone::kPlain : Tone::kBad});
  }
  if (const auto map = CheckMap(outcome, unit)) {
    page.blocks.push_back(
        Figure{"map",
               "Tags, the path so far, and where to photograph next (numbers; the arrow shows the viewing "
               "direction).",
               *map});
  }
  page.blocks.push_back(Heading{2, "Findings", "findings"});
  page.blocks.push_back(FindingTable(outcome, unit));
  const Table tags = TagTable(outcome, unit);
  if (tags.rows.empty()) return page;  // a site without tags
  page.blocks.push_back(Heading{2, "Tags", "tags"});
  page.blocks.push_back(tags);
  page.footer =
      "The sigmas are predicted from the tags as detected, the odometry, and scene points as `trigpoint plan` assumes "
      "them.";
  return page;
}

}  // namespace

std::optional<Drawing> CheckMap(const CheckOutcome& outcome, const DisplayUnit& unit) {
  if (!outcome.facts.layout || !outcome.facts.prediction) return std::nullopt;
  return PlanMap(MapFindings(outcome), {"tag seen", "tag planned, not seen yet", "camera path",
                                        "photograph next: stand there, look along the arrow", unit});
}

std::string CheckHeadline(const CheckOutcome& outcome) {
  size_t runs = 0;
  for (const FieldRun& run : outcome.facts.runs) runs += run.pictures.empty() ? 0 : 1;
  std::string judged;
  if (runs > 0) judged = Counted(outcome.pictures, "picture") + " of " + Counted(runs, "run");
  if (!outcome.facts.sets.empty()) {
    judged += (judged.empty() ? "" : ", ") + Counted(PhotosOfSets(outcome), "picture") + " of " +
              Counted(outcome.facts.sets.size(), "photo set");
  }
  const std::string tags = outcome.facts.planned.empty()
                               ? Counted(outcome.planned_seen, "tag")
                               : fmt::format("{} of {} tags", outcome.planned_seen, outcome.facts.planned.size());
  return fmt::format("{}: {}, {} seen{}", LightName(outcome.light), judged.empty() ? "no picture" : judged, tags,
                     outcome.waiting > 0 ? fmt::format("; still to be looked at: {}", outcome.waiting) : "");
}

void WriteCheck(const CheckOutcome& outcome, const DisplayUnit& unit, int refresh_s, const fs::path& folder) {
  WriteTables(outcome, folder);
  if (const auto map = CheckMap(outcome, unit)) {
    WriteFileAtomically(folder / "map.svg", SvgFileOf(*map, "What to photograph next"));
  } else {
    fs::remove(folder / "map.svg");
  }
  std::string html = HtmlOf(PageOf(outcome, unit));
  if (refresh_s > 0) {
    html.insert(html.find("<title>"), fmt::format("<meta http-equiv=\"refresh\" content=\"{}\">\n", refresh_s));
  }
  WriteFileAtomically(folder / "index.html", html);
  // Written last: a program that waits for it finds the other files up to date.
  WriteFileAtomically(folder / "summary.json", DumpJson(SummaryOf(outcome), 2) + "\n");
}

}  // namespace trigpoint
