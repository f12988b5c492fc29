#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "calib/base/counted.h"
#include "eval/report/chapters.h"
#include "eval/text/method_name.h"

namespace trigpoint {
namespace {

// With more than this many stations their tables are closed at first, so that the page stays light to read.
constexpr size_t kOpenStations = 24;

constexpr const char* kNoReference = "no_reference";  // localized, with nothing to hold it against

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
  const std::string word = status == "rejected" ? "refused" : status == "unmatched" ? "no match" : status;
  return {reason.empty() ? word : word + ": " + reason, {}, status == "localized" ? Tone::kPlain : Tone::kWarning};
}

// The first variant before others, our own answers before G1.
std::vector<const ErrorRecord*> OwnFirst(std::vector<const ErrorRecord*> errors) {
  std::stable_sort(errors.begin(), errors.end(), [](const ErrorRecord* a, const ErrorRecord* b) {
    return std::pair(!a->variant.empty(), a->method == "g1") < std::pair(!b->variant.empty(), b->method == "g1");
  });
  return errors;
}

Table ErrorsOf(const ChapterContext& c, const StationPart& part) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{"station_errors",
              "Differences of the answers from their references.",
              {{"run"},
               {"method"},
               {"against"},
               {"3D" + u, true},
               {"horizontal" + u, true},
               {"vertical" + u, true},
               {"sigma e n u" + u, false, "the answer has no covariance, as each view (G1)"},
               {"NEES", true, "the answer has no covariance, as each view (G1)"},
               {"largest part"}},
              {}};
  // A station may have a panorama and photo sets.
  std::set<std::string> panoramas;
  for (const ErrorRecord* e : part.errors) panoramas.insert(e->panorama);
  const bool several = panoramas.size() > 1;
  if (several) table.columns.insert(table.columns.begin() + 1, {"panorama"});
  for (const ErrorRecord* e : OwnFirst(part.errors)) {
    if (!e->Answered()) continue;
    const bool beyond = e->nees && e->dof > 0 && *e->nees > 5.5 * e->dof;
    table.rows.push_back({{c.RunName(e->run, e->variant)},
                          {MethodName(e->method)},
                          {ReferenceName(e->reference)},
                          c.LengthCell(e->error_3d_m),
                          c.LengthCell(e->error_h_m),
                          c.LengthCell(e->error_v_m),
                          {SigmaText(c, *e)},
                          NumberCell(e->nees, 1, beyond ? Tone::kBad : Tone::kPlain),
                          {e->dominant}});
    if (several)
      table.rows.back().insert(table.rows.back().begin() + 1,
                               TableCell{std::filesystem::path(e->panorama).filename().string()});
  }
  return table;
}

// What no number stands for: "No answer: too few matches (run3 single); ...". Whatever an abstention would be held
// against, it is said once.
void AddReasons(const ChapterContext& c, const StationPart& part, std::vector<Block>* blocks) {
  constexpr size_t kNames = 8;
  std::map<std::string, std::vector<std::string>> abstained, not_compared;
  for (const ErrorRecord* e : OwnFirst(part.errors)) {
    if (e->Answered()) continue;
    const bool no_reference = e->status == kNoReference;
    std::vector<std::string>& names =
        no_reference ? not_compared[e->reason] : abstained[AnswerCell(e->status, e->reason).text];
    const std::string name = c.RunName(e->run, e->variant) + " " + MethodName(e->method);
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  const auto say = [&](const std::string& what, const std::map<std::string, std::vector<std::string>>& of_reason,
                       Tone tone) {
    std::string text;
    for (const auto& [reason, names] : of_reason) {
      text += (text.empty() ? what : "; ") + reason + " (";
      for (size_t i = 0; i < std::min(kNames, names.size()); ++i) text += (i > 0 ? ", " : "") + names[i];
      text += names.size() > kNames ? fmt::format(" and {} more)", names.size() - kNames) : ")";
    }
    if (!text.empty()) blocks->push_back(Paragraph{text + ".", tone});
  };
  say("No answer: ", abstained, Tone::kWarning);
  say("Answered, but not compared: ", not_compared, Tone::kPlain);
}

Table AnswersOf(const ChapterContext& c, const StationPart& part) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{"station_answers",
              "What localize answered, before any comparison.",
              {{"run"},
               {"panorama"},
               {"inliers", true},
               {"first matches", true},
               {"views", true},
               {"sigma" + u, true, "no answer in the site's frame"},
               {"geotag off" + u, true, "no answer, or no geotag"},
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

// Pictures of the worst answers' matches, each station once.
void AddWorstMatches(const ChapterContext& c, std::vector<Block>* blocks) {
  constexpr size_t kShown = 4;
  std::vector<const Figure*> figures;
  std::set<std::string> stations;
  for (const ErrorRecord* e : WorstFirst(c.data)) {
    const auto it = c.match_figures.find(CellKey(e->run, e->variant, e->panorama));
    if (it == c.match_figures.end() || figures.size() == kShown || !stations.insert(e->station).second) continue;
    figures.push_back(&it->second);
  }
  const bool compared = !figures.empty();
  if (!compared) {
    for (const auto& [key, figure] : c.match_figures) {
      if (figures.size() < kShown) figures.push_back(&figure);
    }
  }
  if (figures.empty()) return;
  blocks->push_back(
      Paragraph{std::string(compared ? "Matches of the answers with the largest differences."
                                     : "Matches of the first answers; nothing was surveyed to compare them with.") +
                " Every station with its numbers and pictures: in index.html below, in report.pdf in the appendix."});
  for (const Figure* figure : figures) blocks->push_back(*figure);
}

// A row a station.
Table IndexOf(const ChapterContext& c, std::map<std::string, StationPart>& parts) {
  const std::string u = " (" + c.unit.name + ")";
  std::set<std::string> others;
  for (const RunData& run : c.data.runs) others.insert(run.variant);
  const bool has_first = others.erase("") > 0;  // numbers are the first variant's, or those of the only ones there are
  if (!has_first) others.clear();
  Table index{
      "stations",
      "Every station, over all runs; the largest 3D differences of our own answers (not G1), absolute in site ENU "
      "and relative in the run's own frame. Press a name to go to its page.",
      {{"station"},
       {"answers", true},
       {"refused", true},
       {"absolute" + u, true},
       {"relative" + u, true},
       {"largest NEES / dof", true}},
      {}};
  for (const std::string& variant : others) {
    index.columns.push_back({variant + ": answers", true});
    index.columns.push_back({variant + ": largest" + u, true});
  }
  for (const std::string& station : c.data.stations) {
    const StationPart& part = parts[station];
    const auto count = [&](const std::string& variant, bool localized) {
      return std::count_if(part.answers.begin(), part.answers.end(), [&](const auto& answer) {
        return (!has_first || answer.first->variant == variant) && (answer.second->status == "localized") == localized;
      });
    };
    const auto largest = [&](const std::string& variant, const std::string& kind) {
      std::optional<double> most;
      for (const ErrorRecord* e : part.errors) {
        if (!e->Answered() || e->method == "g1" || (has_first && e->variant != variant)) continue;
        if (kind.empty() || e->kind == kind) most = std::max(most.value_or(*e->error_3d_m), *e->error_3d_m);
      }
      return most;
    };
    std::optional<double> nees;
    for (const ErrorRecord* e : part.errors) {
      if (!e->Answered() || e->method == "g1" || (has_first && !e->variant.empty())) continue;
      if (e->nees && e->dof > 0) nees = std::max(nees.value_or(0), *e->nees / e->dof);
    }
    TableCell name{station};
    name.anchor = c.station_anchor.at(station);
    const auto answers = static_cast<double>(count("", true)), refused = static_cast<double>(count("", false));
    std::vector<TableCell> row = {
        name,
        {fmt::format("{:.0f}", answers), answers, answers == 0 ? Tone::kWarning : Tone::kPlain},
        {fmt::format("{:.0f}", refused), refused},
        c.LengthCell(largest("", "absolute")),
        c.LengthCell(largest("", "relative")),
        NumberCell(nees, 1, nees && *nees > 5.5 ? Tone::kBad : Tone::kPlain)};
    for (const std::string& variant : others) {
      const auto theirs = static_cast<double>(count(variant, true));
      row.push_back({fmt::format("{:.0f}", theirs), theirs});
      row.push_back(c.LengthCell(largest(variant, "")));
    }
    index.rows.push_back(std::move(row));
  }
  return index;
}

// Its numbers, and the pictures of its matches. `folded`: the numbers are closed at first.
void AddStation(const ChapterContext& c, const std::string& station, const StationPart& part, bool folded,
                std::vector<Block>* blocks) {
  std::vector<const Figure*> figures;
  for (const auto& [run, a] : part.answers) {
    const auto it = c.match_figures.find(CellKey(run->run, run->variant, a->panorama));
    if (it != c.match_figures.end()) figures.push_back(&it->second);
  }
  blocks->push_back(Heading{3, "Station " + station, c.station_anchor.at(station)});
  for (const Station& s : c.input.project->site().stations) {
    if (s.name != station) continue;
    blocks->push_back(Paragraph{fmt::format(
        "Tag {}; offset of the panorama's centre from the tag's centre: {} {} {} {} ({}), 1 sigma {} per axis.",
        s.tag_id, c.Length(s.offset_m.x()), c.Length(s.offset_m.y()), c.Length(s.offset_m.z()), c.unit.name,
        s.in_tag_frame ? "right, out, up in the tag's levelled frame" : "east, north, up", c.LengthUnit(s.sigma_m))});
  }
  if (folded)
    blocks->push_back(FoldBegin{fmt::format("Numbers of {}: {}, {}", station, Counted(part.answers.size(), "answer"),
                                            Counted(part.errors.size(), "comparison"))});
  if (Table errors = ErrorsOf(c, part); !errors.rows.empty()) blocks->push_back(std::move(errors));
  AddReasons(c, part, blocks);
  if (!part.answers.empty()) blocks->push_back(AnswersOf(c, part));
  if (part.errors.empty() && part.answers.empty()) blocks->push_back(Paragraph{"No run has a result for it."});
  if (folded) blocks->push_back(FoldEnd{});
  for (const Figure* figure : figures) blocks->push_back(*figure);
}

// What the columns of each station's tables are, once.
void Explain(const std::map<std::string, StationPart>& parts, std::vector<Block>* blocks) {
  const bool compared = std::any_of(parts.begin(), parts.end(), [](const auto& p) { return !p.second.errors.empty(); });
  if (compared) {
    blocks->push_back(Paragraph{
        "In the tables of differences, those against the run's own tags are in the run's own frame, as its cameras see "
        "the tags; others are absolute, in site ENU. Sigma is 1 sigma of the difference: east, north, up. Largest part "
        "names what contributes most to this sigma. NEES is the squared error in its own sigmas, 3 on average where "
        "these are right."});
  }
  blocks->push_back(Paragraph{
      "In the tables of answers, sigma is 1 sigma of the largest axis in site ENU, and geotag off is the horizontal "
      "distance of the geotag from the answer. First matches are those of the views before any geometric test; the "
      "guided search adds further ones, so that there may be more inliers than first matches. Pictures of matches "
      "count a feature once for each image."});
}

}  // namespace

void AddStations(const ChapterContext& c, std::vector<Block>* blocks) {
  const std::vector<Reference>& references = c.input.project->site().references;
  if (references.empty() && c.data.stations.empty()) return;
  const bool photos = !references.empty() && std::all_of(references.begin(), references.end(), [](const Reference& r) {
    return r.kind == ReferenceKind::kPhoto;
  });
  blocks->push_back(Heading{2, photos ? "Photos with matches" : "Panoramas with matches", "stations"});
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
  blocks->push_back(IndexOf(c, parts));
  AddWorstMatches(c, blocks);
  blocks->push_back(AppendixBegin{"stations", "stations-each"});
  Explain(parts, blocks);
  const bool many = c.data.stations.size() > kOpenStations;
  for (const std::string& station : c.data.stations) AddStation(c, station, parts[station], many, blocks);
  blocks->push_back(AppendixEnd{});
}

}  // namespace trigpoint
