#include "app/pipeline/command_line.h"

#include "datasets/project/files.h"

namespace trigpoint {
namespace {

void AddSettings(const nlohmann::json& values, const std::string& prefix, std::string& line) {
  for (const auto& [name, value] : values.items()) {
    if (value.is_object()) {
      AddSettings(value, prefix + name + ".", line);
    } else {
      line += " --set " + ShellWord(prefix + name + "=" + DumpJson(value));
    }
  }
}

}  // namespace

std::string ShellWord(const std::string& word) {
  const std::string plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:@%+,";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

std::string CommandLine(const std::string& dir, const JobQuery& query, int threads, uint64_t seed) {
  const bool single = query.stages.size() == 1;
  const StageInfo* stage = single ? &StageNamed(query.stages.front()) : nullptr;
  std::string line = "trigpoint " + (single ? query.stages.front() : "run") + " " + ShellWord(dir);
  for (const std::string& run : query.runs) line += " --run " + ShellWord(run);
  if (!single || stage->variants) {
    for (const std::string& variant : query.variants) {
      if (!variant.empty()) line += " --variant " + ShellWord(variant);
    }
  }
  for (const auto& [name, values] : query.overrides.items()) {
    AddSettings(values, single && name == query.stages.front() ? "" : name + ".", line);
  }
  if (threads != 0) line += " --threads " + std::to_string(threads);
  if (seed != 1) line += " --seed " + std::to_string(seed);
  return line;
}

}  // namespace trigpoint
