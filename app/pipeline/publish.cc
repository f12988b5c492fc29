#include "app/pipeline/publish.h"

#include <algorithm>
#include <optional>
#include <set>

#include "app/pipeline/jobs.h"
#include "datasets/project/manifest.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// A result that a release rests on: it must record it, and be able to make it again.
struct RestedOn {
  Job job;
  std::string name;  // of the result: run1@paper
  nlohmann::json manifest;
  std::filesystem::path dir;
  std::string Title() const { return job.Title(); }
};

// Of a stage for one run and variant; nothing if it isn't there.
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

// The results named, those whose manifests or files they read, and so on down; each after those it reads. Ones without
// a manifest are left out: who reads them is out of date.
std::vector<RestedOn> ResultsBehind(const Project& project, const std::vector<RestedOn>& roots) {
  std::vector<RestedOn> all;
  std::set<std::string> known;
  for (const RestedOn& root : roots) AddBehind(project, root, &known, &all);
  return all;
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

// Throws InputError naming every result that its inputs, its options or trigpoint.yaml have left behind. Options given
// on the command line are the result's own, as its manifest has them.
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

// Where a published result lies in the release; empty: only its record is kept.
std::string PlaceInRelease(const RestedOn& result, const std::string& variant) {
  const std::string& stage = result.job.stage->name;
  if (result.job.stage->variants && result.job.target.variant != variant) return "";
  if (stage == "survey") return "map";
  if (stage == "evaluate" || stage == "gates" || stage == "report") return stage;
  if (stage == "localize" || stage == "reference") return stage + "/" + result.job.target.run;
  return "";
}

// What is published itself.
std::vector<RestedOn> Published(const Project& project, const std::string& variant) {
  std::vector<RestedOn> results;
  const auto add = [&](const std::string& stage, const StageTarget& target) {
    if (std::optional<RestedOn> result = ResultNow(project, stage, target)) results.push_back(std::move(*result));
  };
  for (const std::string& run : project.RunNames()) {
    add("localize", {run, variant});
    add("reference", {run, ""});
  }
  add("survey", {"", variant});
  add("evaluate", {"", variant});
  // Verdicts of limits that are no longer set are left behind.
  if (std::optional<RestedOn> gates = ResultNow(project, "gates", {"", variant})) {
    const StageTarget target{"", variant, gates->manifest.value("given", json::object())};
    if (gates->job.stage->not_needed(project, target).empty()) results.push_back(std::move(*gates));
  }
  add("report", {});
  return results;
}

// The report shows results; nothing is computed from it.
std::vector<RestedOn> WithoutReport(std::vector<RestedOn> results) {
  std::erase_if(results, [](const RestedOn& result) { return result.job.stage->name == "report"; });
  return results;
}

// The release's own variant goes without its name, so that releases of variants can be compared.
std::string KeyOf(const RestedOn& result, const std::string& at) {
  std::string key = result.Title();
  if (!at.empty() && key.ends_with(at)) key.resize(key.size() - at.size());
  return key;
}

// What goes into the release of the published results and those behind them.
ReleaseContent ContentOf(const Project& project, const std::string& variant, const std::vector<RestedOn>& published,
                         const std::vector<RestedOn>& behind) {
  const std::string at = variant.empty() ? "" : "@" + variant;
  ReleaseContent content;
  for (const RestedOn& result : behind) {
    const bool itself = std::any_of(published.begin(), published.end(),
                                    [&](const RestedOn& other) { return other.Title() == result.Title(); });
    content.results.push_back(
        {KeyOf(result, at), result.manifest, result.dir, itself ? PlaceInRelease(result, variant) : ""});
    // A calibration is taken over as it is: its board's pictures are behind it, and it serves as an input.
    if (result.job.stage->name == "calibrate") {
      for (const char* file : {"camchain.yaml", "manifest.json"}) content.inputs.push_back(result.dir / file);
    }
  }
  for (const RestedOn& result : ResultsBehind(project, WithoutReport(published)))
    content.order.push_back(KeyOf(result, at));
  const auto add = [&](const std::vector<fs::path>& files) {
    content.inputs.insert(content.inputs.end(), files.begin(), files.end());
  };
  for (const std::string& name : project.RunNames()) {
    if (project.site().broken_runs.count(name) == 0) add(RunInputs(project, project.run(name)));
  }
  add(ReferenceInputs(project, project.site()));
  return content;
}

}  // namespace

Release Publish(const Project& project, const PublishOptions& options, const CancelToken& cancel) {
  CheckReleaseName(project, options.name);
  const auto lock = project.Lock();
  CheckReleasable(project, options.variant);
  const std::vector<RestedOn> published = Published(project, options.variant);
  const std::vector<RestedOn> behind = ResultsBehind(project, published);
  RequireCurrent(project, behind);
  project.hashes().Save();
  return WriteRelease(project, options, ContentOf(project, options.variant, published, behind), cancel);
}

}  // namespace trigpoint
