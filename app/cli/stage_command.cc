// One command per stage, made from its entry in Stages().
#include "app/cli/stage_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "app/cli/command.h"
#include "calib/base/error.h"
#include "datasets/project/files.h"

namespace trigpoint {
std::string OptionTable(const StageInfo& stage, bool brief) {
  const auto columns = [&](std::vector<std::string> row) {
    if (brief) row.erase(row.end() - 2);
    return row;
  };
  std::vector<std::vector<std::string>> rows;
  for (const OptionDescription& option : stage.options("")) {
    std::string range;
    if (option.type == "a number" || option.type == "a whole number") {
      if (std::isfinite(option.min)) range = fmt::format("from {:g} ", option.min);
      if (std::isfinite(option.max)) range += fmt::format("to {:g}", option.max);
    }
    rows.push_back(
        columns({"  " + option.name, " " + DumpJson(option.default_value), option.unit, range, option.help}));
  }
  if (rows.empty()) return "";
  return "Options for --set, and for stages: " + stage.name + ": in trigpoint.yaml" +
         (brief ? "\n" : " (in a variant under variants:)\n") +
         TableText(columns({"  name", " default", "unit", "range", "meaning"}), rows) + "\n";
}

namespace {

std::string Examples(const StageInfo& stage) {
  const std::string command = "  trigpoint " + CommandOf(stage);
  std::string text = "Examples:\n" + command + " my_site\n";
  if (stage.per_run) text += command + " my_site --run run1\n";
  if (stage.name == "site") text += command + " my_site --run run1 --run run2\n";
  if (stage.variants) text += command + " my_site --variant trial\n";
  return text;
}

}  // namespace

void AddStageCommand(CLI::App& app, Session& session, const StageInfo& stage) {
  struct Arguments {
    std::string dir, variant;
    std::vector<std::string> runs, settings;
    struct Flag {
      std::string value;
      bool is_text = true;
    };
    std::map<std::string, Flag> flags;  // by option
  };
  using Flag = Arguments::Flag;
  CLI::App& command = AddCommand(app, session, CommandOf(stage), stage.help, OptionTable(stage) + Examples(stage));
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("DIR", arguments->dir, "the project")->required();
  const std::vector<OptionDescription> options = stage.options("");
  const bool joins_runs = std::any_of(options.begin(), options.end(), [](const auto& o) { return o.name == "runs"; });
  if (stage.per_run || joins_runs) {
    command.add_option("--run", arguments->runs, "only this run (may be given several times)")->allow_extra_args(false);
  }
  if (stage.variants) {
    command.add_option("--variant", arguments->variant,
                       "write to another set of results, beside the default one: results/" + stage.name +
                           (stage.per_run ? "/<run>@V" : "@V"));
  }
  for (const std::string& entry : stage.flags) {
    const std::string flag = entry.substr(0, entry.find('='));
    const std::string name = entry.substr(entry.find('=') + 1);  // the whole of it without '='
    for (const OptionDescription& option : options) {
      if (option.name != name) continue;
      Flag& value = arguments->flags[name];
      value.is_text = option.type == "text";
      if (option.type == "true or false") {
        command.add_flag_callback(
            "--" + flag, [&value, off = flag.starts_with("no-")] { value.value = off ? "false" : "true"; },
            (flag.starts_with("no-") ? "without: " : "") + option.help);
        continue;
      }
      command.add_option("--" + flag, value.value, option.help + (option.unit.empty() ? "" : ", " + option.unit));
    }
  }
  AddSetOption(command, &arguments->settings);
  command.callback([&session, &stage, arguments, joins_runs] {
    session.action = [&stage, arguments, joins_runs](Session& s) {
      JobQuery query;
      std::vector<std::string> settings = arguments->settings;
      if (joins_runs && !arguments->runs.empty()) {
        settings.push_back("runs=" + DumpJson(fmt::format("{}", fmt::join(arguments->runs, ","))));
      }
      for (const auto& [name, flag] : arguments->flags) {
        if (flag.value.empty()) continue;
        settings.push_back(name + "=" + (flag.is_text ? DumpJson(flag.value) : flag.value));  // quoted: text
      }
      const std::vector<OptionDescription> known = stage.options("");
      const bool has_units = std::any_of(known.begin(), known.end(), [](const auto& o) { return o.name == "units"; });
      if (has_units && s.options.units != "m") settings.push_back("units=" + DumpJson(s.options.units));
      query.overrides = ParseOverrides(settings, stage.name);
      query.stages = {stage.name};
      query.runs = arguments->runs;
      query.variants = {arguments->variant};
      // As published, beside our own: a mode other than the default is a variant of its name unless one is named.
      const auto mode = arguments->flags.find("mode");
      if (arguments->variant.empty() && mode != arguments->flags.end() && mode->second.value == "paper") {
        query.variants = {"paper"};
      }
      if (!query.variants.front().empty()) CheckVariantName(query.variants.front());
      const Project project = OpenProjectToCompute(s, arguments->dir);
      const std::vector<Job> jobs = PlanJobs(project, query);
      if (std::none_of(jobs.begin(), jobs.end(), [&](const Job& job) { return job.stage == &stage; })) {
        throw InputError(arguments->dir + ": there is no run, so there is nothing for `" + CommandOf(stage) +
                         "` to do; expected runs/<run>/ with images.txt and its images (docs/file_formats.md)");
      }
      return RunAndReport(s, stage.name, project, jobs);
    };
  });
}

}  // namespace trigpoint
