#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "calib/base/counted.h"
#include "datasets/io/credits.h"
#include "datasets/project/files.h"
#include "datasets/project/hash.h"
#include "eval/report/chapters.h"
#include "eval/report/charts.h"

namespace trigpoint {
namespace {

constexpr size_t kFilesShown = 6;  // of one folder and kind; more are shown as one line
constexpr size_t kBars = 24;       // of the chart of times; with more results a bar stands for a stage

void AddStates(const ChapterContext& c, std::vector<Block>* blocks) {
  Table table{"results",
              "Every result of the project. Times are UTC.",
              {{"result"},
               {"state"},
               {"version", true, "no result"},
               {"seed", true, "no result"},
               {"threads", true, "no result"},
               {"finished", false, "no result"},
               {"wall time (s)", true, "no result"},
               {"peak memory (MiB)", true, "no result"},
               {"warnings and reasons", false, "none"}},
              {}};
  for (const ResultRecord& s : c.input.stages) {
    const nlohmann::json& m = s.manifest;
    const auto whole = [&](const char* key, double unit) -> TableCell {
      const auto v = At(m, {key});
      return NumberCell(v ? std::optional<double>(*v / unit) : std::nullopt, 0);
    };
    const std::string end = TextAt(m, "end");  // its Z says what the caption says
    std::string notes = s.reason;
    if (m.is_object() && m.contains("warnings") && m["warnings"].is_array()) {
      for (const nlohmann::json& w : m["warnings"]) {
        if (w.is_string()) notes += (notes.empty() ? "" : "; ") + w.get<std::string>();
        if (notes.size() > 400) break;
      }
      if (notes.size() > 400) notes = notes.substr(0, 400) + " ...";
    }
    table.rows.push_back({{s.stage + (s.name.empty() || s.name[0] == '@' ? s.name : "/" + s.name)},
                          {s.state,
                           {},
                           s.state == "done"         ? Tone::kGood
                           : s.state == "failed"     ? Tone::kBad
                           : s.state == "not needed" ? Tone::kPlain
                                                     : Tone::kWarning},
                          whole("version", 1),
                          whole("seed", 1),
                          whole("threads", 1),
                          {end.substr(0, end.find('Z'))},
                          NumberCell(At(m, {"wall_seconds"}), 1),
                          whole("peak_memory_bytes", 1024.0 * 1024.0),
                          {notes}});
  }
  blocks->push_back(table);
}

// Of many files in one folder one hash: of the list of their names and hashes.
void AddInputs(const ChapterContext& c, std::vector<Block>* blocks) {
  std::map<std::string, std::string> files;
  for (const ResultRecord& s : c.input.stages) {
    if (!s.manifest.is_object() || !s.manifest.contains("inputs") || !s.manifest["inputs"].is_object()) continue;
    for (const auto& [file, hash] : s.manifest["inputs"].items()) {
      if (!file.starts_with("results/") && hash.is_string()) files[file] = hash.get<std::string>();
    }
  }
  if (files.empty()) return;
  std::map<std::pair<std::string, std::string>, std::vector<std::string>> folders;
  for (const auto& [file, hash] : files) {
    const std::filesystem::path path(file);
    folders[{path.parent_path().string(), path.extension().string()}].push_back(file);
  }
  Table table{"inputs",
              "What was read, with SHA-256. Of a folder with many files: the hash of the lines 'hash  name' of all of "
              "them, in the order of names. "
              "The hash of each file is in the manifests.",
              {{"file"}, {"files", true}, {"SHA-256"}},
              {}};
  for (const auto& [folder, names] : folders) {
    if (names.size() <= kFilesShown) {
      for (const std::string& name : names) table.rows.push_back({{name}, {"1", 1}, {files[name]}});
      continue;
    }
    std::string list;
    for (const std::string& name : names) list += files[name] + "  " + name + "\n";
    table.rows.push_back({{folder.first + "/*" + folder.second},
                          {std::to_string(names.size()), static_cast<double>(names.size())},
                          {Sha256(list)}});
  }
  blocks->push_back(FoldBegin{"Inputs (" + Counted(files.size(), "file") + ")"});
  blocks->push_back(table);
  blocks->push_back(FoldEnd{});
}

// Pictures of other people: what must be written beside them.
void AddCredits(const ChapterContext& c, std::vector<Block>* blocks) {
  std::map<std::vector<std::string>, int> counts;
  for (const auto& [file, credit] : ReadCredits(c.input.project->dir())) {
    ++counts[{credit.attribution, credit.licence, credit.source}];
  }
  if (counts.empty()) return;
  Table table{
      "credits",
      "Panoramas and photos of others, as panoramas.csv and photos.csv state it. Their licences hold for what is "
      "shown of them here, too.",
      {{"attribution"}, {"licence"}, {"from"}, {"pictures", true}},
      {}};
  for (const auto& [text, count] : counts) {
    table.rows.push_back({{text[0]}, {text[1]}, {text[2]}, {std::to_string(count), static_cast<double>(count)}});
  }
  blocks->push_back(table);
}

void Flatten(const std::string& prefix, const nlohmann::json& json, std::map<std::string, std::string>* out) {
  if (json.is_object()) {
    for (const auto& [key, value] : json.items()) Flatten(prefix.empty() ? key : prefix + "." + key, value, out);
  } else if (!json.is_null()) {
    (*out)[prefix] = json.is_string() ? json.get<std::string>() : DumpJson(json);
  }
}

// Results of a stage with the same options share a column of values.
void AddOptions(const ChapterContext& c, std::vector<Block>* blocks) {
  std::map<std::string, std::map<std::string, std::vector<std::string>>> sets;  // stage -> options -> results
  for (const ResultRecord& s : c.input.stages) {
    if (s.manifest.is_object() && s.manifest.contains("options"))
      sets[s.stage][DumpJson(s.manifest["options"])].push_back(s.name);
  }
  if (sets.empty()) return;
  Table table{"options",
              "Every option in force. Results with the same options share lines.",
              {{"stage"}, {"results"}, {"option"}, {"value", false, "empty"}},
              {}};
  for (const auto& [stage, of_options] : sets) {
    for (const auto& [text, names] : of_options) {
      std::string results;
      for (size_t i = 0; i < names.size() && i < 6; ++i)
        results += (i == 0 ? "" : ", ") + (names[i].empty() ? "all" : names[i]);
      if (names.size() > 6) results += fmt::format(" and {} more", names.size() - 6);
      std::map<std::string, std::string> flat;
      Flatten("", nlohmann::json::parse(text), &flat);
      for (const auto& [key, value] : flat) table.rows.push_back({{stage}, {results}, {key}, {value}});
    }
  }
  blocks->push_back(FoldBegin{fmt::format("Options ({} values)", table.rows.size()), false});
  blocks->push_back(table);
  blocks->push_back(FoldEnd{});
}

void AddTiming(const ChapterContext& c, std::vector<Block>* blocks) {
  std::vector<std::pair<std::string, double>> rows;
  std::map<std::string, std::pair<double, int>> of_stage;
  for (const ResultRecord& s : c.input.stages) {
    const auto seconds = At(s.manifest, {"wall_seconds"});
    if (!seconds) continue;
    rows.emplace_back(s.stage + (s.name.empty() || s.name[0] == '@' ? s.name : "/" + s.name), *seconds);
    of_stage[s.stage].first += *seconds;
    ++of_stage[s.stage].second;
  }
  if (rows.empty()) return;
  std::string which = "each result";
  if (rows.size() > kBars) {
    rows.clear();
    for (const auto& [stage, sum] : of_stage)
      rows.emplace_back(fmt::format("{} ({})", stage, Counted(sum.second, "result")), sum.first);
    which = "each stage, all its results together";
  }
  blocks->push_back(Figure{"timing", "Wall time of " + which + " (s), with the threads of the table.",
                           BarChart(rows, "wall time (s)", 1)});
}

}  // namespace

void AddProvenance(const ChapterContext& c, std::vector<Block>* blocks) {
  blocks->push_back(Heading{2, "Appendix: provenance", "provenance"});
  blocks->push_back(Paragraph{"To make this report again: " + c.input.command});
  if (c.input.project->has_frame()) {
    const Geodetic& o = c.input.project->frame().origin();
    blocks->push_back(Paragraph{
        fmt::format("Site ENU (x east, y north, z up, metres) has its origin at latitude {:.8f}, longitude {:.8f} "
                    "deg, ellipsoidal height {:.3f} m, WGS 84.",
                    o.latitude_deg, o.longitude_deg, o.height_m)});
  }
  AddCredits(c, blocks);
  AddStates(c, blocks);
  AddTiming(c, blocks);
  if (!c.data.reviews.empty()) {
    Table table{"reviews",
                "Decisions of the review, from review.jsonl.",
                {{"time"}, {"user"}, {"action"}, {"object"}, {"reason"}},
                {}};
    for (const nlohmann::json& r : c.data.reviews) {
      const std::string action = TextAt(r, "action");
      table.rows.push_back(
          {{TextAt(r, "time")}, {TextAt(r, "user")}, {action}, {TextAt(r, "object")}, {TextAt(r, "reason")}});
    }
    blocks->push_back(table);
  }
  AddInputs(c, blocks);
  AddOptions(c, blocks);
}

}  // namespace trigpoint
