#include "app/pipeline/publish.h"

#include <algorithm>

#include "app/pipeline/released_results.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

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
