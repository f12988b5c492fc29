// init, status, run: what concerns a project as a whole.
#include <fmt/format.h>

#include <chrono>

#include "app/cli/command.h"
#include "app/pipeline/stitch_stage.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

double AgeSeconds(const nlohmann::json& manifest) {
  const auto end = ParseUtcToNs(manifest.value("end", ""));
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return end ? std::chrono::duration<double>(now).count() - 1e-9 * static_cast<double>(*end) : 0;
}

// A metric as people read it; the name's end says whether it is a length.
std::string MetricText(const nlohmann::json& metrics, const std::string& name, const DisplayUnit& unit) {
  const auto it = metrics.find(name);
  if (name.empty() || it == metrics.end() || it->is_null()) return "";
  if (!it->is_number()) return name + " " + (it->is_string() ? it->get<std::string>() : it->dump());
  if (name.ends_with("_m")) {
    return fmt::format("{} {:.3f} {}", name.substr(0, name.size() - 2), it->get<double>() / unit.metres, unit.name);
  }
  if (it->is_number_integer()) return fmt::format("{} {}", name, it->get<int64_t>());
  return fmt::format("{} {:.4g}", name, it->get<double>());
}

int Init(const Session& session, const std::string& dir) {
  const InitReport report = Project::Init(dir);
  std::string text =
      report.created ? "Wrote " + report.file.string() + "\n" : report.file.string() + " was there and is kept\n";
  for (const std::string& line : report.found) text += "found    " + line + "\n";
  for (const std::string& line : report.missing) text += "missing  " + line + "\n";
  for (const std::string& line : report.warnings) text += "warning  " + line + "\n";
  text += "Next: trigpoint run " + dir + "\n";
  session.Print(text);
  session.PrintJson({{"command", "init"},
                     {"ok", true},
                     {"file", report.file.string()},
                     {"created", report.created},
                     {"found", report.found},
                     {"missing", report.missing},
                     {"warnings", report.warnings}});
  return 0;
}

int Status(const Session& session, const std::string& dir) {
  const Project project = OpenProject(session, dir);
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  JobQuery query;
  query.variants = KnownVariants(project);
  std::vector<std::vector<std::string>> rows;
  nlohmann::json stages = nlohmann::json::array();
  std::string reasons;
  // Photo sets first: localize reads their rigs.
  std::vector<Job> jobs = StitchJobs(project, {}, query.overrides);
  for (const Job& job : PlanJobs(project, query)) jobs.push_back(job);
  for (const JobState& state : StatesOf(project, jobs, session.options.seed)) {
    const StageInfo& stage = *state.job.stage;
    const bool there = state.manifest.is_object();
    const std::string name = ResultName(stage, state.job.target);
    const std::string shown = state.needed ? std::string(StageStateName(state.state)) : "not needed";
    const nlohmann::json metrics =
        there ? state.manifest.value("metrics", nlohmann::json::object()) : nlohmann::json::object();
    rows.push_back({stage.name, name, shown, there ? AgeText(AgeSeconds(state.manifest)) : "",
                    MetricText(metrics, stage.metric, unit)});
    if (!state.reason.empty()) reasons += state.job.Title() + ": " + state.reason + "\n";
    stages.push_back(
        {{"stage", stage.name}, {"name", name}, {"state", shown}, {"reason", state.reason}, {"metrics", metrics}});
    if (there) stages.back()["age_seconds"] = AgeSeconds(state.manifest);
  }
  const auto holder = ProjectLock::Holder(project.results());
  session.Print(TableText({"stage", "name", "state", "age", "main metric"}, rows) +
                (reasons.empty() ? "" : "\n" + reasons));
  if (holder) {
    session.Print(fmt::format("\nin use by process {} of {} on {} since {}\n", holder->process, holder->user,
                              holder->host, holder->since));
  }
  session.PrintJson({{"command", "status"}, {"ok", true}, {"project", project.dir().string()}, {"stages", stages}});
  return 0;
}

}  // namespace

void AddInitCommand(CLI::App& app, Session& session) {
  CLI::App& command =
      AddCommand(app, session, "init", "look at a folder, write trigpoint.yaml, say what is there and what is missing",
                 "A trigpoint.yaml that is there is kept; runs it does not list yet are added to it.\n"
                 "Nothing but trigpoint.yaml is written, and the files you brought are never changed.\n\n"
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

void AddRunCommand(CLI::App& app, Session& session) {
  struct Arguments {
    std::string dir;
    std::vector<std::string> runs, variants, settings;
  };
  CLI::App& command = AddCommand(
      app, session, "run", "make every result that is missing or out of date",
      "Results whose inputs, options and version are unchanged are not computed again. What fails for one run does "
      "not\n"
      "stop the others. Stop it with Ctrl-C, or pull the plug: finished stages are kept, the same command goes on.\n\n"
      "Examples:\n"
      "  trigpoint run my_site\n"
      "  trigpoint run my_site --run run1 --run run3\n"
      "  trigpoint run my_site --set localize.max_distance_m=20");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("DIR", arguments->dir, "the project")->required();
  command.add_option("--run", arguments->runs, "only this run (may be given several times)")->allow_extra_args(false);
  command
      .add_option("--variant", arguments->variants,
                  "only this variant (may be given several times); default: the first "
                  "results and the variants of trigpoint.yaml")
      ->allow_extra_args(false);
  command
      .add_option("--set", arguments->settings, "stage.option=value, over trigpoint.yaml (may be given several times)")
      ->allow_extra_args(false);
  command.callback([&session, arguments] {
    session.action = [arguments](Session& s) {
      JobQuery query;
      query.overrides = ParseOverrides(arguments->settings, "");
      const Project project = OpenProject(s, arguments->dir);
      query.runs = arguments->runs;
      if (arguments->variants.empty()) {
        for (const auto& [variant, stages] : project.variants().items()) query.variants.push_back(variant);
      } else {
        query.variants = arguments->variants;
        for (const std::string& variant : query.variants) CheckVariantName(variant);
      }
      // Photo sets first: localize reads their rigs.
      std::vector<Job> jobs = StitchJobs(project, {}, query.overrides);
      for (const Job& job : PlanJobs(project, query)) jobs.push_back(job);
      return RunAndReport(s, "run", project, jobs);
    };
  });
}

}  // namespace trigpoint
