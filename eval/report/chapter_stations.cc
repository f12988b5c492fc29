#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "eval/report/chapters.h"

namespace trigpoint {
namespace {

// With more than this many stations their tables are closed at first, so that the page stays light to read.
constexpr size_t kOpenStations = 24;

struct StationPart {
  std::vector<const ErrorRecord*> errors;
  std::vector<std::pair<const RunData*, const RunData::Answer*>> answers;
};

std::string SigmaText(const ChapterContext& c, const ErrorRecord& e) {
  if (!e.sigma_e_m || !e.sigma_n_m || !e.sigma_u_m) return "";
  return c.Length(e.sigma_e_m, 3) + " " + c.Length(e.sigma_n_m, 3) + " " + c.Length(e.sigma_u_m, 3);
}

// "localized", "rejected: why".
TableCell AnswerCell(const std::string& status, const std::string& reason) {
  return {reason.empty() ? status : status + ": " + reason, {}, status == "localized" ? Tone::kPlain : Tone::kWarning};
}

Table ErrorsOf(const ChapterContext& c, const StationPart& part) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{"",
              "Differences of the answers from their reference. Sigma: 1 sigma of the difference; east, north, up.",
              {{"run"},
               {"method"},
               {"against"},
               {"3D" + u, true},
               {"horizontal" + u, true},
               {"vertical" + u, true},
               {"sigma e n u" + u},
               {"NEES", true},
               {"largest part"},
               {"answer"}},
              {}};
  // A station may have a panorama and photo sets.
  std::set<std::string> panoramas;
  for (const ErrorRecord* e : part.errors) panoramas.insert(e->panorama);
  const bool several = panoramas.size() > 1;
  if (several) table.columns.insert(table.columns.begin() + 1, {"panorama"});
  for (const ErrorRecord* e : part.errors) {
    const bool beyond = e->nees && e->dof > 0 && *e->nees > 5.5 * e->dof;
    table.rows.push_back({{c.RunName(e->run, e->variant)},
                          {e->method},
                          {e->reference + ", " + e->kind},
                          c.LengthCell(e->error_3d_m),
                          c.LengthCell(e->error_h_m),
                          c.LengthCell(e->error_v_m),
                          {SigmaText(c, *e)},
                          {e->nees ? fmt::format("{:.1f}", *e->nees) : "", e->nees, beyond ? Tone::kBad : Tone::kPlain},
                          {e->dominant},
                          AnswerCell(e->status, e->reason)});
    if (several)
      table.rows.back().insert(table.rows.back().begin() + 1,
                               TableCell{std::filesystem::path(e->panorama).filename().string()});
  }
  return table;
}

Table AnswersOf(const ChapterContext& c, const StationPart& part) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{"",
              "What localize answered, before any comparison. Sigma: 1 sigma of the largest axis in site ENU. Geotag: "
              "horizontal distance of "
              "what the picture says about itself from the answer.",
              {{"run"},
               {"panorama"},
               {"inliers", true},
               {"matches", true},
               {"views", true},
               {"sigma" + u, true},
               {"geotag off" + u, true},
               {"geotag"},
               {"answer"}},
              {}};
  for (const auto& [run, a] : part.answers) {
    table.rows.push_back({{c.RunName(run->run, run->variant)},
                          {a->panorama},
                          {std::to_string(a->inliers), a->inliers},
                          {std::to_string(a->matches), a->matches},
                          {std::to_string(a->views), a->views},
                          c.LengthCell(a->sigma_m),
                          c.LengthCell(a->geotag_off_m),
                          {a->geotag_status, {}, a->geotag_status == "outlier" ? Tone::kWarning : Tone::kPlain},
                          AnswerCell(a->status, a->reason)});
  }
  return table;
}

}  // namespace

void AddStations(const ChapterContext& c, std::vector<Block>* blocks) {
  blocks->push_back(Heading{2, "Stations", "stations", true});
  std::map<std::string, StationPart> parts;
  for (const VariantData& v : c.data.variants) {
    for (const ErrorRecord& e : v.errors) parts[e.station].errors.push_back(&e);
  }
  for (const RunData& run : c.data.runs) {
    for (const RunData::Answer& a : run.answers) {
      if (c.station_anchor.count(a.station) > 0) parts[a.station].answers.emplace_back(&run, &a);
    }
  }
  if (c.data.stations.empty()) {
    blocks->push_back(Paragraph{"There are no stations."});
    return;
  }
  const std::string u = " (" + c.unit.name + ")";
  Table index{"stations",
              "Every station, over all runs and variants; differences of our own answers (not G1). Press a name to go "
              "to its page.",
              {{"station"},
               {"answers", true},
               {"refused", true},
               {"smallest 3D" + u, true},
               {"largest 3D" + u, true},
               {"largest NEES / dof", true}},
              {}};
  for (const std::string& station : c.data.stations) {
    const StationPart& part = parts[station];
    int answers = 0, refused = 0;
    for (const auto& [run, a] : part.answers) ++(a->status == "localized" ? answers : refused);
    std::optional<double> least, most, nees;
    for (const ErrorRecord* e : part.errors) {
      if (!e->Answered() || e->method == "g1") continue;
      least = std::min(least.value_or(*e->error_3d_m), *e->error_3d_m);
      most = std::max(most.value_or(*e->error_3d_m), *e->error_3d_m);
      if (e->nees && e->dof > 0) nees = std::max(nees.value_or(0), *e->nees / e->dof);
    }
    TableCell name{station};
    name.anchor = c.station_anchor.at(station);
    index.rows.push_back(
        {name,
         {std::to_string(answers), answers, answers == 0 ? Tone::kWarning : Tone::kPlain},
         {std::to_string(refused), refused},
         c.LengthCell(least),
         c.LengthCell(most),
         {nees ? fmt::format("{:.1f}", *nees) : "", nees, nees && *nees > 5.5 ? Tone::kBad : Tone::kPlain}});
  }
  blocks->push_back(index);
  const bool many = c.data.stations.size() > kOpenStations;
  for (const std::string& station : c.data.stations) {
    const StationPart& part = parts[station];
    std::vector<Block> body;
    std::vector<const Figure*> figures;
    for (const auto& [run, a] : part.answers) {
      const auto it = c.match_figures.find(CellKey(run->run, run->variant, a->panorama));
      if (it != c.match_figures.end()) figures.push_back(&it->second);
    }
    blocks->push_back(Heading{3, "Station " + station, c.station_anchor.at(station), !many});
    for (const Station& s : c.input.project->site().stations) {
      if (s.name != station) continue;
      blocks->push_back(Paragraph{fmt::format(
          "Tag {}; the panorama's centre lies {} {} {} {} from the tag's centre ({}), 1 sigma {} per axis.", s.tag_id,
          c.Length(s.offset_m.x()), c.Length(s.offset_m.y()), c.Length(s.offset_m.z()), c.unit.name,
          s.in_tag_frame ? "right, out, up in the tag's levelled frame" : "east, north, up", c.LengthUnit(s.sigma_m))});
    }
    if (many)
      blocks->push_back(FoldBegin{
          fmt::format("Numbers of {}: {} answers, {} comparisons", station, part.answers.size(), part.errors.size())});
    if (!part.errors.empty()) blocks->push_back(ErrorsOf(c, part));
    if (!part.answers.empty()) blocks->push_back(AnswersOf(c, part));
    if (part.errors.empty() && part.answers.empty()) blocks->push_back(Paragraph{"No run says anything about it."});
    if (many) blocks->push_back(FoldEnd{});
    for (const Figure* figure : figures) blocks->push_back(*figure);
  }
}

}  // namespace trigpoint
