#include "app/cli/batch_list.h"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "app/cli/terminal.h"
#include "calib/base/error.h"
#include "datasets/io/csv.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/outputs.h"
#include "eval/text/markdown.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr const char* kBatchSchema = "trigpoint batch 1";

bool IsPattern(const std::string& text) { return text.find_first_of("*?[") != std::string::npos; }

// Folders that match, in order.
std::vector<fs::path> Matching(const std::string& pattern) {
  glob_t found{};
  std::vector<fs::path> folders;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) {
      if (fs::is_directory(found.gl_pathv[i])) folders.emplace_back(found.gl_pathv[i]);
    }
  }
  globfree(&found);
  return folders;
}

// Words of a line; "..." keeps spaces together.
std::vector<std::string> Words(const std::string& line, const std::string& where) {
  std::vector<std::string> words;
  std::string word;
  bool quoted = false, any = false;
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;
      any = true;
    } else if (!quoted && c == '#' && !any) {
      break;
    } else if (!quoted && (c == ' ' || c == '\t' || c == '\r')) {
      if (any) words.push_back(word);
      word.clear();
      any = false;
    } else {
      word += c;
      any = true;
    }
  }
  if (quoted) throw InputError(where + ": a quote is not closed");
  if (any) words.push_back(word);
  return words;
}

// `base` is left out of the name of a folder below it; empty: the name is the whole path.
void Add(const fs::path& dir, const fs::path& base, const std::vector<std::string>& arguments,
         std::vector<BatchEntry>* entries, std::set<std::string>* names) {
  BatchEntry entry;
  entry.dir = dir;
  entry.arguments = arguments;
  const fs::path below = base.empty() ? fs::path() : dir.lexically_relative(base);
  entry.name = below.empty() ? dir.string() : below.string();
  for (const std::string& argument : arguments) entry.name += " " + argument;
  if (names->insert(entry.name).second) entries->push_back(std::move(entry));
}

double MedianOf(const BatchResult& r, const char* key) {
  for (const json& stage : r.stages) {
    if (stage.value("stage", "") != "evaluate") continue;
    const json metrics = stage.value("metrics", json::object());
    if (metrics.contains(key) && metrics[key].is_number()) return metrics[key];
  }
  return std::numeric_limits<double>::quiet_NaN();
}

std::string TextOf(const BatchResult& r, const char* key) {
  for (const json& stage : r.stages) {
    const json metrics = stage.value("metrics", json::object());
    if (metrics.contains(key)) return metrics[key];
  }
  return "";
}

std::string VerdictOf(const BatchResult& r) { return TextOf(r, "verdict"); }

int Count(const std::vector<BatchResult>& results, const std::string& status) {
  return static_cast<int>(
      std::count_if(results.begin(), results.end(), [&](const BatchResult& r) { return r.status == status; }));
}

std::string Counts(const std::vector<BatchResult>& results) {
  std::string text = fmt::format("{} of {} done", Count(results, "done") + Count(results, "gate"), results.size());
  for (const char* status : {"gate", "failed", "cancelled", "running", "waiting"}) {
    if (const int n = Count(results, status); n > 0) {
      text += fmt::format(", {} {}", n, std::string(status) == "gate" ? "with a gate that is not passed" : status);
    }
  }
  return text;
}

// What the tasks of a stage took. A task that several entries share counts once.
struct StageCost {
  std::string stage;
  int tasks = 0, attempts = 0, repeated = 0;
  double wall_seconds = 0, cpu_seconds = 0;
  int64_t peak_memory_bytes = 0;
};

std::vector<StageCost> CostsOf(const std::vector<BatchResult>& results) {
  std::vector<StageCost> costs;
  std::set<std::pair<std::string, size_t>> counted;
  for (const BatchResult& r : results) {
    for (const json& stage : r.stages) {
      const std::string name = stage.value("stage", "");
      if (!counted.emplace(r.entry.dir.string(), stage.value("task", size_t{0})).second) continue;
      auto it = std::find_if(costs.begin(), costs.end(), [&](const StageCost& c) { return c.stage == name; });
      if (it == costs.end()) it = costs.insert(costs.end(), {name});
      const int attempts = stage.value("attempts", 0);
      ++it->tasks;
      it->attempts += attempts;
      it->repeated += std::max(0, attempts - 1);
      it->wall_seconds += stage.value("wall_seconds", 0.0);
      it->cpu_seconds += stage.value("cpu_seconds", 0.0);
      it->peak_memory_bytes = std::max(it->peak_memory_bytes, stage.value("peak_memory_bytes", int64_t{0}));
    }
  }
  return costs;
}

}  // namespace

std::vector<BatchEntry> ReadBatchList(const std::string& list) {
  std::vector<BatchEntry> entries;
  std::set<std::string> names;
  if (IsPattern(list) && !fs::exists(list)) {
    const fs::path shown = fs::path(list).is_absolute() ? fs::path() : fs::current_path();
    for (const fs::path& dir : Matching(list)) Add(fs::absolute(dir).lexically_normal(), shown, {}, &entries, &names);
    if (entries.empty()) throw InputError(list + ": no folder matches");
    return entries;
  }
  if (fs::is_directory(list)) {
    throw InputError(list + ": expected a list file or a pattern of folders (in quotes: \"" + list +
                     "/*\"), found a folder");
  }
  const std::string text = ReadTextFile(list);
  const fs::path base = fs::absolute(list).parent_path();
  int number = 0;
  for (const std::string_view line : Lines(text)) {
    const std::string where = FileLine(list, ++number);
    std::vector<std::string> words = Words(std::string(line), where);
    if (words.empty()) continue;
    if (words.front().starts_with("-"))
      throw InputError(where + ": expected a project's folder, found " + words.front());
    const fs::path written = words.front();
    const fs::path dir = (written.is_absolute() ? written : base / written).lexically_normal();
    words.erase(words.begin());
    const fs::path shown = written.is_absolute() ? fs::path() : base;
    if (!IsPattern(dir.string()) || fs::exists(dir)) {
      Add(dir, shown, words, &entries, &names);
      continue;
    }
    const std::vector<fs::path> matching = Matching(dir.string());
    if (matching.empty()) throw InputError(where + ": no folder matches " + dir.string());
    for (const fs::path& match : matching) Add(match, shown, words, &entries, &names);
  }
  if (entries.empty()) throw InputError(list + ": expected one project's folder a line, found none");
  return entries;
}

std::string FormatBatch(const std::vector<BatchResult>& results, const DisplayUnit& unit) {
  std::vector<std::vector<std::string>> lines{
      {"project", "status", "exit", "median " + unit.name, "against", "gate", "time", "CPU s", "memory MiB", "error"}};
  for (const BatchResult& r : results) {
    const double median = MedianOf(r, "median_m");
    std::string error = r.error;
    std::replace(error.begin(), error.end(), '|', '/');
    lines.push_back({r.entry.name, r.status, std::to_string(r.exit_code),
                     std::isfinite(median) ? fmt::format("{:.3f}", median / unit.metres) : "-",
                     TextOf(r, "median_against"), VerdictOf(r), DurationText(r.seconds),
                     fmt::format("{:.1f}", r.cpu_seconds), fmt::format("{:.0f}", Mebibytes(r.peak_memory_bytes)),
                     error});
  }
  std::vector<std::vector<std::string>> costs{{"stage", "tasks", "attempts", "time", "CPU s", "memory MiB"}};
  for (const StageCost& c : CostsOf(results)) {
    costs.push_back({c.stage, std::to_string(c.tasks), std::to_string(c.attempts), DurationText(c.wall_seconds),
                     fmt::format("{:.1f}", c.cpu_seconds), fmt::format("{:.0f}", Mebibytes(c.peak_memory_bytes))});
  }
  return AlignMarkdown(lines) + "\n" + Counts(results) + "\n\n" + AlignMarkdown(costs);
}

Ending BatchEnding(const std::vector<BatchResult>& results, const std::string& headline, const DisplayUnit& unit) {
  Ending ending(headline + ": " + Counts(results));
  for (const StageCost& c : CostsOf(results)) {
    if (c.attempts == 0) continue;
    ending.Row(fmt::format("{:<12}{}, {:.1f} s of CPU, at most {:.0f} MiB{}", c.stage, Counted(c.tasks, "task"),
                           c.cpu_seconds, Mebibytes(c.peak_memory_bytes),
                           c.repeated > 0 ? fmt::format(", {} restarted", c.repeated) : ""));
  }
  std::vector<std::pair<double, std::string>> medians;
  for (const BatchResult& r : results) {
    if (const double median = MedianOf(r, "median_m"); std::isfinite(median))
      medians.emplace_back(median / unit.metres, r.entry.name);
    if (r.status == "failed") ending.Problem("Failed", r.entry.name + ": " + r.error);
    if (r.status == "gate") ending.Problem("Gate", r.entry.name + ": " + VerdictOf(r));
  }
  if (medians.empty()) return ending;
  std::sort(medians.begin(), medians.end());
  const size_t n = medians.size();
  const double middle = 0.5 * (medians[(n - 1) / 2].first + medians[n / 2].first);
  const auto named = [&](const auto& median) {
    return fmt::format("{:.2f} {} ({})", median.first, unit.name, median.second);
  };
  return ending.Fact("Median", fmt::format("{:.2f} {} of {}; best {}, worst {}", middle, unit.name,
                                           Counted(n, "project"), named(medians.front()), named(medians.back())));
}

json BatchJson(const std::vector<BatchResult>& results) {
  json entries = json::array(), costs = json::object();
  for (const StageCost& c : CostsOf(results)) {
    costs[c.stage] = {{"tasks", c.tasks},
                      {"attempts", c.attempts},
                      {"wall_seconds", c.wall_seconds},
                      {"cpu_seconds", c.cpu_seconds},
                      {"peak_memory_bytes", c.peak_memory_bytes}};
  }
  for (const BatchResult& r : results) {
    entries.push_back({{"name", r.entry.name},
                       {"dir", r.entry.dir.string()},
                       {"arguments", r.entry.arguments},
                       {"status", r.status},
                       {"exit_code", r.exit_code},
                       {"error", r.error},
                       {"attempts", r.attempts},
                       {"seconds", r.seconds},
                       {"cpu_seconds", r.cpu_seconds},
                       {"peak_memory_bytes", r.peak_memory_bytes},
                       {"stages", r.stages}});
  }
  return {{"schema", kBatchSchema},
          {"done", Count(results, "done") + Count(results, "gate")},
          {"gate", Count(results, "gate")},
          {"failed", Count(results, "failed")},
          {"stages", costs},
          {"entries", entries}};
}

void RequireBatchFolder(const fs::path& folder) {
  RequireOutputPlace(folder / "summary.json");
  std::error_code ignored;
  bool empty = true;
  for (fs::directory_iterator it(folder, ignored), end; it != end; it.increment(ignored)) {
    empty = empty && it->path().filename().string().starts_with('.');
  }
  if (empty) return;
  const fs::path summary = folder / "summary.json";
  if (fs::is_regular_file(summary, ignored)) {
    const json old = json::parse(ReadTextFile(summary), nullptr, false);
    if (old.is_object() && old.value("schema", json()) == kBatchSchema) return;
  }
  throw InputError(folder.string() +
                   ": expected a new folder or one with a batch's summary.json, found other files; "
                   "give another --out");
}

void WriteBatchSummary(const std::vector<BatchResult>& results, const fs::path& folder) {
  WriteFileAtomically(folder / "summary.json", DumpJson(BatchJson(results), 2) + "\n");
  WriteFileAtomically(folder / "summary.md", FormatBatch(results));
  CsvWriter csv(
      {"name", "dir", "status", "exit_code", "median_m", "verdict", "seconds", "peak_memory_bytes", "attempts", "error",
       "cpu_seconds"},
      {"trigpoint batch 1; median_m: of the 3D errors `evaluate` shows first; seconds, cpu_seconds: sums over its "
       "tasks"});
  for (const BatchResult& r : results) {
    csv.Text(r.entry.name).Text(r.entry.dir.string()).Text(r.status).Integer(r.exit_code);
    csv.Number(MedianOf(r, "median_m"), 6).Text(VerdictOf(r)).Number(r.seconds, 1).Integer(r.peak_memory_bytes);
    csv.Integer(r.attempts).Text(r.error).Number(r.cpu_seconds, 1).EndRow();
  }
  csv.Save(folder / "summary.csv");
}

}  // namespace trigpoint
