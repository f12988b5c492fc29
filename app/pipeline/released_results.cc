#include "app/pipeline/released_results.h"

#include <algorithm>
#include <set>

#include "datasets/project/files.h"
#include "datasets/project/manifest.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// "results/localize/run1@paper/manifest.json", "results/survey/tags.csv": whose it is. Nothing for a path of another
// kind.
std::optional<RestedOn> OwnerOf(const Project& project, const std::string& input) {
  const fs::path path(input);
  std::vector<std::string> parts;
  for (const fs::path& part : path) parts.push_back(part.string());
  if (parts.size() < 3 || parts[0] != "results") return std::nullopt;
  const std::string stage = parts[1].substr(0, parts[1].find('@'));
  try {
    const StageInfo& info = StageNamed(stage);
    const std::string name = info.per_run ? parts[2] : parts[1].substr(stage.size());
    const size_t at = name.find('@');
    StageTarget target;
    if (info.per_run) target.run = name.substr(0, at);
    if (at != std::string::npos) (info.parts ? target.part : target.variant) = name.substr(at + 1);
    return ResultNow(project, stage, target);
  } catch (const OptionError&) {
    return std::nullopt;  // a folder of results that is no stage's
  }
}

void AddBehind(const Project& project, const RestedOn& result, std::set<std::string>* known,
               std::vector<RestedOn>* all) {
  if (!known->insert(result.Title()).second) return;
  const json inputs = result.manifest.value("inputs", json::object());
  for (const auto& [input, hash] : inputs.items()) {
    if (const std::optional<RestedOn> owner = OwnerOf(project, input)) AddBehind(project, *owner, known, all);
  }
  all->push_back(result);
}

// Empty if it is as its inputs, options and version make it now.
std::string WhyNotCurrent(const Project& project, const RestedOn& result) {
  const StageInfo& stage = *result.job.stage;
  StageTarget target = result.job.target;
  target.overrides = result.manifest.value("given", json::object());
  // A calibration has no options but those of its command.
  if (stage.name == "calibrate") target.overrides[stage.name] = result.manifest.value("options", json::object());
  try {
    const std::string damage = ManifestDamage(project, stage.name, result.name);
    if (!damage.empty()) return "its manifest.json is damaged: " + damage;
    StageRequest request = MakeRequest(project, stage, target);
    if (!target.variant.empty() && !project.variants().contains(target.variant))
      request.options = result.manifest.value("options", request.options);
    const StageState state = StateOf(project, request, result.manifest.value("seed", uint64_t{1}));
    return state == StageState::kDone ? "" : std::string(StageStateName(state));
  } catch (const InputError& e) {
    return e.what();
  } catch (const OptionError& e) {
    return e.what();
  }
}

}  // namespace

std::optional<RestedOn> ResultNow(const Project& project, const std::string& stage, const StageTarget& target) {
  RestedOn result;
  result.job = {&StageNamed(stage), target};
  result.name = ResultName(*result.job.stage, target);
  result.dir = project.ResultDir(stage, result.name);
  const std::optional<json> manifest = ReadManifest(project, stage, result.name);
  if (!manifest) return std::nullopt;
  result.manifest = *manifest;
  return result;
}

std::vector<RestedOn> ResultsBehind(const Project& project, const std::vector<RestedOn>& roots) {
  std::vector<RestedOn> all;
  std::set<std::string> known;
  for (const RestedOn& root : roots) AddBehind(project, root, &known, &all);
  return all;
}

void RequireCurrent(const Project& project, const std::vector<RestedOn>& results) {
  std::vector<std::string> stale;
  for (const RestedOn& result : results) {
    const std::string why = WhyNotCurrent(project, result);
    if (!why.empty()) stale.push_back(result.Title() + ": " + why);
  }
  if (stale.empty()) return;
  constexpr size_t kMostNamed = 5;
  std::string text;
  for (size_t i = 0; i < std::min(stale.size(), kMostNamed); ++i) text += (i > 0 ? "; " : "") + stale[i];
  if (stale.size() > kMostNamed) text += " and " + std::to_string(stale.size() - kMostNamed) + " more";
  throw InputError("a release needs results that are up to date, found " + text + ". Run `trigpoint run " +
                   project.dir().string() + "` first");
}

}  // namespace trigpoint
