// init, status, run: what concerns a project as a whole.
#include <fmt/format.h>

#include <chrono>

#include "app/cli/command.h"
#include "app/cli/run_command.h"
#include "app/pipeline/command_line.h"
#include "app/pipeline/stitch_stage.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

double AgeSeconds(const nlohmann::json& manifest) {
  const auto end = ParseUtcToNs(manifest.value("end", ""));
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return end ? std::chrono::duration<double>(now).count() - 1e-9 * static_cast<double>(*end) : 0;
}

// Photo sets first: localize reads their rigs.
std::vector<Job> AllJobs(const Project& project, const JobQuery& query) {
  std::vector<Job> jobs = StitchJobs(project, {}, query.overrides);
  for (const Job& job : PlanJobs(project, query)) jobs.push_back(job);
  return jobs;
}

int Init(const Session& session, const std::string& dir) {
  const InitReport report = Project::Init(dir);
  Ending ending(report.created         ? "Wrote " + ShownPath(report.file)
                : report.added.empty() ? ShownPath(report.file) + " was there and is kept"
                                       : "Added runs to " + ShownPath(report.file));
  if (!report.kept.empty()) ShowChange(report.kept, report.added, &ending);
  for (const std::string& line : report.found) ending.Fact("Found", line);
  for (const std::string& line : report.missing) ending.Problem("Missing", line);
  for (const std::string& line : report.warnings) ending.Problem("Warning", line);
  session.End(ending.Next("trigpoint run " + ShellWord(ShownPath(dir))));
  session.PrintJson({{"command", "init"},
                     {"ok", true},
                     {"file", report.file.string()},
                     {"created", report.created},
                     {"kept", report.kept.string()},
                     {"added", report.added},
                     {"found", report.found},
                     {"missing", report.missing},
                     {"warnings", report.warnings}});
  return 0;
}

// A line for each state that results are in.
void EndStatus(const Session& session, const Project& project,
               const std::map<std::string, std::vector<std::string>>& by_state, Ending ending) {
  const auto in = [&](const char* state) {
    const auto it = by_state.find(state);
    return it == by_state.end() ? std::vector<std::string>() : it->second;
  };
  size_t all = 0, needed = 0;
  for (const auto& [state, titles] : by_state) {
    all += titles.size();
    if (state != "not needed") needed += titles.size();
  }
  const size_t done = in("done").size();
  ending.Headline(all == 0
                      ? ShownPath(project.dir()) + ": there is nothing to compute yet"
                      : fmt::format("{}: {} of {} done", ShownPath(project.dir()), done, Counted(needed, "result")));
  for (const char* state : {"running", "failed", "out of date", "missing", "done", "not needed"}) {
    if (const auto titles = in(state); !titles.empty()) ending.Fact(Capitalised(state), Listed(titles, 8));
  }
  session.End(done < needed ? ending.Next("trigpoint run " + ShellWord(ShownPath(project.dir()))) : ending);
}

int Status(const Session& session, const std::string& dir) {
  const Project project = OpenProject(session, dir);
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  JobQuery query;
  query.variants = KnownVariants(project);
  Ending ending("");
  std::vector<std::vector<std::string>> rows;
  nlohmann::json stages = nlohmann::json::array();
  std::string reasons;
  std::map<std::string, std::vector<std::string>> by_state;
  for (const JobState& state : StatesOf(project, AllJobs(project, query), session.options.seed)) {
    const StageInfo& stage = *state.job.stage;
    const bool there = state.manifest.is_object();
    const std::string name = ResultName(stage, state.job.target);
    const std::string shown = state.needed ? std::string(StageStateName(state.state)) : "not needed";
    const nlohmann::json metrics =
        there ? state.manifest.value("metrics", nlohmann::json::object()) : nlohmann::json::object();
    rows.push_back({stage.name, name, shown, there ? AgeText(AgeSeconds(state.manifest)) : "",
                    MetricText(metrics, stage.metric, unit)});
    by_state[shown].push_back(state.job.Title());
    if (shown == "failed") ending.Problem("Failed", state.job.Title() + ": " + state.reason);
    if (shown == "missing" && !state.reason.empty()) ending.Problem("Damaged", state.job.Title() + ": " + state.reason);
    if (!state.reason.empty()) reasons += state.job.Title() + ": " + state.reason + "\n";
    stages.push_back(
        {{"stage", stage.name}, {"name", name}, {"state", shown}, {"reason", state.reason}, {"metrics", metrics}});
    if (there) stages.back()["age_seconds"] = AgeSeconds(state.manifest);
  }
  const auto holder = ProjectLock::Holder(project.results());
  if (holder) {
    ending.Problem("Note", fmt::format("in use by process {} of {} on {} since {}", holder->process, holder->user,
                                       holder->host, holder->since));
  }
  session.PrintDetails(TableText({"stage", "name", "state", "age", "main metric"}, rows) +
                       (reasons.empty() ? "" : "\n" + reasons) + "\n");
  EndStatus(session, project, by_state, std::move(ending));
  session.PrintJson({{"command", "status"}, {"ok", true}, {"project", project.dir().string()}, {"stages", stages}});
  return 0;
}

}  // namespace

void AddInitCommand(CLI::App& app, Session& session) {
  CLI::App& command =
      AddCommand(app, session, "init", "look at a folder, write trigpoint.yaml, list what is there and what is missing",
                 "A trigpoint.yaml that is there is kept; runs it does not list yet are added to it, and the file as\n"
                 "it was goes to results/replaced/. The other files you brought are never changed.\n\n"
                 "Example:\n  trigpoint init my_site");
  const auto dir = std::make_shared<std::string>();
  command.add_option("DIR", *dir, "your folder: runs/<run>/, panoramas.csv, stations.csv, ...")->required();
  command.callback([&session, dir] { session.action = [dir](Session& s) { return Init(s, *dir); }; });
}

void AddStatusCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(app, session, "status", "show each stage: done, out of date, failed, running, missing",
                                 "Works while another process computes, and writes nothing.\n\n"
                                 "Examples:\n  trigpoint status my_site\n  trigpoint status my_site --json");
  const auto dir = std::make_shared<std::string>();
  command.add_option("DIR", *dir, "the project")->required();
  command.callback([&session, dir] { session.action = [dir](Session& s) { return Status(s, *dir); }; });
}

void AddRunOptions(CLI::App& app, RunArguments* arguments) {
  app.add_option("--run", arguments->runs, "only this run (may be given several times)")->allow_extra_args(false);
  app.add_option("--variant", arguments->variants,
                 "only this variant (may be given several times); default: the default "
                 "results and the variants of trigpoint.yaml")
      ->allow_extra_args(false);
  app.add_option("--set", arguments->settings, "stage.option=value, over trigpoint.yaml (may be given several times)")
      ->allow_extra_args(false);
}

std::vector<Job> JobsOf(const Project& project, const RunArguments& arguments) {
  JobQuery query;
  query.overrides = ParseOverrides(arguments.settings, "");
  query.runs = arguments.runs;
  if (arguments.variants.empty()) {
    for (const auto& [variant, stages] : project.variants().items()) query.variants.push_back(variant);
  } else {
    query.variants = arguments.variants;
    for (const std::string& variant : query.variants) CheckVariantName(variant);
  }
  return AllJobs(project, query);
}

void AddRunCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "run", "make every result that is missing or out of date",
      "Results whose inputs, options and version are unchanged are not computed again. What fails for one run does "
      "not\n"
      "stop the others. It may be stopped at any time, also by a power cut: finished stages are kept, the same command "
      "goes on.\n\n"
      "Examples:\n"
      "  trigpoint run my_site\n"
      "  trigpoint run my_site --run run1 --run run2\n"
      "  trigpoint run my_site --set localize.registration.max_distance_m=20");
  const auto dir = std::make_shared<std::string>();
  const auto arguments = std::make_shared<RunArguments>();
  command.add_option("DIR", *dir, "the project")->required();
  AddRunOptions(command, arguments.get());
  command.callback([&session, dir, arguments] {
    session.action = [dir, arguments](Session& s) {
      ParseOverrides(arguments->settings, "");  // a mistake there is said before the project is read
      const Project project = OpenProjectToCompute(s, *dir);
      return RunAndReport(s, "run", project, JobsOf(project, *arguments));
    };
  });
}

}  // namespace trigpoint
