#include "eval/release/compared.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/result_part.h"
#include "eval/errors/evaluation_files.h"
#include "eval/errors/reference_maps.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

json ReadJsonOrNothing(const fs::path& file) {
  if (!fs::exists(file)) return json::object();
  json value = json::parse(ReadTextFile(file), nullptr, false);
  return value.is_object() ? value : json::object();
}

namespace {

void ReadRows(const fs::path& errors_csv, const std::string& variant, Compared* compared) {
  if (!fs::exists(errors_csv)) {
    compared->notes.push_back(compared->label + " has no " + errors_csv.filename().string() +
                              ": its errors are not compared");
    return;
  }
  for (ErrorRow& row : ReadErrors(errors_csv)) {
    if (row.variant == variant) compared->rows.push_back(std::move(row));
  }
  if (compared->rows.empty()) {
    compared->notes.push_back(errors_csv.string() + " has no row" + (variant.empty() ? "" : " of variant " + variant));
  }
}

void ReadTags(const fs::path& folder, Compared* compared) {
  if (fs::exists(folder / "tags.csv")) compared->tags = ReadTagResults(folder / "tags.csv", folder / "tags_cov.csv");
}

// "run1@trial" without the variant, so that the same stage of two variants meets.
std::string WithoutVariant(const std::string& name) { return name.substr(0, name.find('@')); }

void ReadStages(const fs::path& results, const std::string& variant, Compared* compared) {
  std::map<std::string, fs::path> parts;  // the first one of each number of parts
  std::error_code ignored;
  for (fs::recursive_directory_iterator it(results, ignored), end; it != end; it.increment(ignored)) {
    if (it->path().filename().string().front() == '.') {
      it.disable_recursion_pending();
      continue;
    }
    if (it->path().filename() != "manifest.json") continue;
    const std::string name = RelativeTo(results, it->path().parent_path());
    const size_t at = name.find('@');
    const std::string its = at == std::string::npos || name[at - 1] == '/' ? "" : name.substr(at + 1);
    // What has no variant of its own serves all.
    const std::string key = WithoutVariant(name);
    if (const auto part = PartOfResult(name); part && part->count > 1) {
      if (part->number == 0) parts[name] = it->path();
    } else if (its == variant || (its.empty() && compared->stages.count(key) == 0)) {
      compared->stages[key] = ReadJsonOrNothing(it->path());
    }
  }
  // All parts have the same options.
  for (const auto& [name, manifest] : parts) compared->stages[WithoutVariant(name)] = ReadJsonOrNothing(manifest);
}

// Names behind an @ of result folders.
std::vector<std::string> VariantsWithResults(const fs::path& results) {
  std::set<std::string> variants;
  std::error_code ignored;
  for (fs::recursive_directory_iterator it(results, ignored), end; it != end; it.increment(ignored)) {
    const std::string name = it->path().filename().string();
    const size_t at = name.find('@');
    if (name.front() == '.' || it.depth() > 0) it.disable_recursion_pending();
    if (name.front() != '.' && at != std::string::npos && !PartOfResult(name) && it->is_directory(ignored))
      variants.insert(name.substr(at + 1));
  }
  return {variants.begin(), variants.end()};
}

std::string Short(const json& value) {
  const std::string text = DumpJson(value);
  return text.size() > 60 ? text.substr(0, 57) + "..." : text;
}

}  // namespace

Compared OpenCompared(const std::string& written) {
  Compared compared;
  compared.label = written;
  while (compared.label.size() > 1 && compared.label.back() == '/') compared.label.pop_back();
  fs::path dir = compared.label;
  std::string variant;
  if (const size_t at = compared.label.rfind('@'); !fs::exists(dir) && at != std::string::npos) {
    dir = compared.label.substr(0, at);
    variant = compared.label.substr(at + 1);
    CheckVariantName(variant);
  }
  if (!fs::is_directory(dir)) {
    throw InputError(written + ": expected a project, a release or a folder with errors.csv, found no such folder");
  }
  if (fs::exists(dir / "release.json")) {
    CheckRelease(dir);
    const json release = ReadJsonOrNothing(dir / "release.json");
    ReadRows(dir / "evaluate" / "errors.csv", variant.empty() ? release.value("variant", "") : variant, &compared);
    const json stages = release.value("stages", json::object());
    // Other variants stand in it where the evaluation read them.
    for (const auto& [name, record] : stages.items()) {
      if (name.find('@') == std::string::npos) compared.stages[name] = record;
    }
    ReadTags(dir / "map", &compared);
    return compared;
  }
  if (fs::exists(dir / "errors.csv")) {
    ReadRows(dir / "errors.csv", variant, &compared);
    compared.stages["evaluate"] = ReadJsonOrNothing(dir / "manifest.json");
    return compared;
  }
  const Project project = Project::Open(dir);
  const std::string at = variant.empty() ? "" : "@" + variant;
  const std::vector<std::string> known = VariantsWithResults(project.results());
  if (!variant.empty() && std::find(known.begin(), known.end(), variant) == known.end()) {
    throw InputError(
        written + ": variant '" + variant + "' has no results; expected " +
        (known.empty() ? "results of a variant, found none" : fmt::format("one of {}", fmt::join(known, ", "))) +
        "; run `trigpoint run " + dir.string() + " --variant " + variant + "` first");
  }
  // A variant's own tables, else its rows in those of the first set.
  const fs::path own = project.ResultDir("evaluate", at) / "errors.csv";
  ReadRows(fs::exists(own) ? own : project.ResultDir("evaluate", "") / "errors.csv", variant, &compared);
  ReadStages(project.results(), variant, &compared);
  const fs::path map = project.ResultDir("survey", at);
  compared.map = fs::exists(map) ? map : project.ResultDir("survey", "");
  ReadTags(compared.map, &compared);
  if (compared.stages.empty() && compared.rows.empty())
    throw InputError(written + ": has no results; run `trigpoint run " + dir.string() + "` first");
  return compared;
}

std::vector<std::string> ChangesBetween(const Compared& a, const Compared& b) {
  std::vector<std::string> changes;
  std::set<std::string> names;
  for (const auto& [name, manifest] : a.stages) names.insert(name);
  for (const auto& [name, manifest] : b.stages) names.insert(name);
  for (const std::string& name : names) {
    const auto in_a = a.stages.find(name), in_b = b.stages.find(name);
    if (in_a == a.stages.end() || in_b == b.stages.end()) {
      const bool release = name.starts_with("features") || name.starts_with("references");  // not kept in releases
      if (!release) changes.push_back(name + ": only in " + (in_a == a.stages.end() ? b.label : a.label));
      continue;
    }
    const json &x = in_a->second, &y = in_b->second;
    if (x.value("version", 0) != y.value("version", 0)) {
      changes.push_back(name + ": version " + std::to_string(x.value("version", 0)) + " -> " +
                        std::to_string(y.value("version", 0)));
    }
    for (const char* part : {"options", "values"}) {
      const json p = x.value(part, json::object()).flatten(), q = y.value(part, json::object()).flatten();
      std::set<std::string> keys;
      for (const auto& [key, value] : p.items()) keys.insert(key);
      for (const auto& [key, value] : q.items()) keys.insert(key);
      for (const std::string& key : keys) {
        const json from = p.value(key, json()), to = q.value(key, json());
        if (from == to) continue;
        std::string dotted = key.substr(std::min<size_t>(1, key.size()));
        std::replace(dotted.begin(), dotted.end(), '/', '.');
        changes.push_back(name + ": " + std::string(part == std::string("options") ? "option " : "") + dotted + " " +
                          Short(from) + " -> " + Short(to));
      }
    }
    if (x.value("seed", 0) != y.value("seed", 0)) changes.push_back(name + ": another seed");
    const json p = x.value("inputs", json::object()), q = y.value("inputs", json::object());
    std::set<std::string> files;
    for (const auto& [file, hash] : p.items()) files.insert(file);
    for (const auto& [file, hash] : q.items()) files.insert(file);
    std::vector<std::string> changed, added, removed;
    for (const std::string& file : files) {
      if (!p.contains(file)) {
        added.push_back(file);
      } else if (!q.contains(file)) {
        removed.push_back(file);
      } else if (p[file] != q[file]) {
        changed.push_back(file);
      }
    }
    const auto list = [&](const char* what, const std::vector<std::string>& paths) {
      if (paths.empty()) return;
      std::string text;
      for (size_t i = 0; i < std::min<size_t>(paths.size(), 5); ++i) text += (i > 0 ? ", " : "") + paths[i];
      if (paths.size() > 5) text += " and " + std::to_string(paths.size() - 5) + " more";
      changes.push_back(name + ": " + what + " " + text);
    };
    list("input changed:", changed);
    list("input added:", added);
    list("input gone:", removed);
  }
  return changes;
}

}  // namespace trigpoint
