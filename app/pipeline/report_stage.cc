// report: every result that is there, as pages for people.
#include "app/pipeline/report_stage.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/pipeline/drawn_views.h"
#include "app/pipeline/gates_stage.h"
#include "app/pipeline/jobs.h"
#include "app/pipeline/tags_wanted.h"
#include "calib/base/counted.h"
#include "calib/base/parallel.h"
#include "eval/release/versions.h"
#include "eval/report/drawing_memory.h"
#include "eval/report/report.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// Every other result the project could have, with its state.
std::vector<ResultRecord> OtherResults(const Project& project) {
  JobQuery query;
  query.variants = KnownVariants(project);
  for (const StageInfo& stage : Stages()) {
    if (stage.name != "report") query.stages.push_back(stage.name);
  }
  std::vector<Job> jobs = PlanJobs(project, query);
  std::erase_if(jobs,
                [&](const Job& job) { return job.stage->name == "detect" && !WantsTags(project, job.target.run); });
  const uint64_t seed = SeedOf(project, jobs);
  std::vector<ResultRecord> results;
  const auto add = [&](const JobState& state) {
    ResultRecord result;
    result.stage = state.job.stage->name;
    result.name = ResultName(*state.job.stage, state.job.target);
    result.state = state.needed ? std::string(StageStateName(state.state)) : "not needed";
    result.reason = state.reason;
    result.manifest = state.manifest;
    results.push_back(std::move(result));
  };
  try {
    for (const JobState& state : StatesOf(project, jobs, seed)) add(state);
  } catch (const Error&) {
    // One that cannot even be asked for must not hide the others.
    results.clear();
    for (const Job& job : jobs) {
      JobState state;
      try {
        state = StatesOf(project, {job}, seed).front();
      } catch (const Error& e) {
        state.job = job;
        state.state = StageState::kFailed;
        state.reason = e.what();
      }
      add(state);
    }
  }
  return results;
}

// Results that have names of their own: photo sets and calibrations.
void AddNamedResults(const Project& project, std::vector<ResultRecord>* results) {
  for (const char* stage : {"stitch", "calibrate"}) {
    for (const std::string& name : ResultsIn(project.results() / stage)) {
      const auto manifest = ReadManifest(project, stage, name);
      if (!manifest) continue;
      const auto failure = ReadFailure(project, stage, name);
      results->push_back(
          {stage, name, failure ? "failed" : "done", failure ? failure->value("error", "") : "", *manifest});
    }
  }
}

// What the pages show beside results: the user's tables and pictures.
std::vector<fs::path> Shown(const Project& project) {
  std::vector<fs::path> files = ReferenceInputs(project, project.site());
  for (const Run& run : project.site().runs) {
    const std::vector<fs::path> its = RunInputs(project, run);
    files.insert(files.end(), its.begin(), its.end());
    files.push_back(project.dir() / "truth" / "runs" / (run.name + "_cameras.tum"));
  }
  for (const char* file :
       {"trigpoint.yaml", "stations.csv", "tags.yaml", "control_points.csv", "origin.json", "review.jsonl"}) {
    files.push_back(project.dir() / file);
  }
  if (!project.site().aerial.empty()) files.push_back(project.site().aerial);
  std::erase_if(files, [](const fs::path& file) { return !fs::exists(file); });
  return files;
}

// A PDF that was asked for once is made again with the pages, until an option says otherwise.
void KeepPdf(const Project& project, const StageTarget& target, ReportOptions* options) {
  for (const OptionLayer& layer : OptionLayers(project, "report", target)) {
    if (layer.values.contains("pdf")) return;
  }
  const auto manifest = ReadManifest(project, "report", ResultName(StageNamed("report"), target));
  const nlohmann::json made =
      manifest ? manifest->value("options", nlohmann::json::object()) : nlohmann::json::object();
  if (!made.is_object() || !made.contains("pdf") || made["pdf"] != true) return;
  options->pdf = true;
  const bool has_paper = made.contains("paper") && made["paper"].is_string();
  if (has_paper) options->paper = made["paper"].get<std::string>();
}

// "Trigpoint 0.1.0 on Debian GNU/Linux 12 (bookworm), Linux 6.1".
std::string ProgramText() {
  const nlohmann::json versions = ProgramVersions();
  return "Trigpoint " + versions.value("trigpoint", "") + " on " + versions.value("system", "");
}

}  // namespace

StageInfo ReportStage() {
  StageInfo info;
  info.name = "report";
  info.help = "write a report of all results: index.html, figures, tables, and report.pdf with --pdf";
  info.per_run = false;
  info.metric = "pages";
  info.flags = {"pdf", "no-images=images", "paper"};
  UseOptions<ReportOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    auto options = ResolveOptions<ReportOptions>(project, "report", target);
    KeepPdf(project, target, &options);
    StageRequest request;
    request.version = 19;
    request.options = JsonFromOptions(options);
    request.inputs = Shown(project);
    ReportInput input;
    input.variants = KnownVariants(project);
    input.stages = OtherResults(project);
    AddNamedResults(project, &input.stages);
    input.command = "trigpoint report " + project.dir().filename().string() + (options.pdf ? " --pdf" : "") +
                    (options.images ? "" : " --no-images") + ", with " + ProgramText();
    for (const ResultRecord& s : input.stages) {
      if (s.manifest.is_object()) request.inputs.push_back(project.ResultDir(s.stage, s.name) / "manifest.json");
      // The pages show states and times too, not only what the results hold.
      request.values["results"].push_back(
          {s.stage, s.name, s.state, s.reason, s.manifest.is_object() ? s.manifest.value("end", "") : ""});
    }
    request.body = [=](StageContext& context) {
      RequireDrawingMemory("drawing the report", 800 + 80.0 * ResolveThreads(0));  // threads reserve theirs
      ReportInput its = input;
      its.project = &context.project;
      its.views = ViewOptionsOf(context.project);
      its.default_gates = DefaultGates(context.project);
      const ReportSummary summary =
          WriteReport(its, options, DisplayUnitNamed(options.units), context.out, context.progress, context.cancel);
      for (const std::string& note : summary.notes) context.progress.Log(LogLevel::kInfo, note);
      context.metrics["pages"] = "index.html";
      context.metrics["html_bytes"] = summary.html_bytes;
      context.metrics["figures"] = summary.figures;
      context.metrics["match_pictures"] = summary.match_pictures;
      context.metrics["match_pictures_left_out"] = summary.match_pictures_left_out;
      context.metrics["renderer"] = summary.renderer;
      context.metrics["notes"] = summary.notes.size();
    };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit&) {
    const nlohmann::json& m = outcome.manifest.at("metrics");
    std::string text = fmt::format("one page of {:.1f} MB, {}, {} of matches\n", m.at("html_bytes").get<double>() / 1e6,
                                   Counted(m.at("figures").get<int>(), "figure"),
                                   Counted(m.at("match_pictures").get<int>(), "picture"));
    if (m.at("renderer").get<std::string>().empty())
      text += "The scene was not rendered; the report gives the reason.\n";
    return text;
  };
  return info;
}

}  // namespace trigpoint
