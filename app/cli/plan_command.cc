// plan: the accuracy of a survey before the trip.
#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "app/cli/calibrate_command.h"
#include "app/cli/field_commands.h"
#include "app/cli/stage_command.h"
#include "app/pipeline/command_line.h"
#include "app/pipeline/plan_stage.h"
#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

struct Arguments {
  std::string dir, sketch;
  std::vector<std::string> suggest, settings;
  bool gates = false;
};

// The summary's lines are "label: text".
Ending PlanEnding(const StageOutcome& outcome, const std::string& summary, const std::string& taken) {
  Ending ending(outcome.computed ? "Plan done in " + taken : "Plan is up to date");
  std::istringstream lines(summary);
  for (std::string line; std::getline(lines, line);) {
    const size_t colon = line.find(": ");
    const std::string label = line.substr(0, colon), text = line.substr(colon + 2);
    const bool wrong = label == "Unseen" || label == "Unchecked" || (label == "Gate" && !text.ends_with("passed"));
    wrong ? ending.Problem(label, text) : ending.Fact(label, text);
  }
  if (!outcome.computed) {  // else it was said while it was computed
    for (const nlohmann::json& warning : outcome.manifest.value("warnings", nlohmann::json::array())) {
      if (warning.is_string()) ending.Problem("Warning", warning.get<std::string>());
    }
  }
  return ending.Look("Page", outcome.dir / "index.html");
}

// "0-3,7" of ascending ids.
std::string IdsText(const std::vector<int>& ids) {
  std::string text;
  for (size_t k = 0; k < ids.size();) {
    size_t last = k;
    while (last + 1 < ids.size() && ids[last + 1] == ids[last] + 1) ++last;
    text += fmt::format("{}{}", text.empty() ? "" : ",", ids[k]);
    if (last > k) text += fmt::format("-{}", ids[last]);
    k = last + 1;
  }
  return text;
}

// The first sheets of a sketched site; a surveyed one has its tags.
std::string NextOfAccepted(const nlohmann::json& summary, const std::string& dir) {
  const nlohmann::json& sizes = summary.at("sketched_tags_mm");
  if (sizes.empty()) return "survey it as planned; on site: trigpoint check " + dir + " --watch";
  const double size_mm = sizes.front().at(1);
  std::vector<int> ids;
  for (const nlohmann::json& tag : sizes) {
    if (tag.at(1) == size_mm) ids.push_back(tag.at(0));
  }
  return fmt::format("trigpoint print {} --ids {} --size {:g}{}", dir, IdsText(ids), size_mm,
                     ids.size() < sizes.size() ? "   (then the tags of other sizes)" : "");
}

// What improves a plan whose gates are not reached.
std::string NextOfRefused(const nlohmann::json& summary, const std::string& dir, bool undecided) {
  if (undecided) return "trigpoint plan " + dir + " --suggest control 3   (gates need a datum: known points)";
  const nlohmann::json& unseen = summary.at("tags_not_seen");
  if (!unseen.empty()) {
    return fmt::format("add a path past tag {} to the sketch, then trigpoint plan {}", unseen.front().dump(), dir);
  }
  const nlohmann::json& gains = summary.at("gains");
  const std::string kind = gains.empty() ? "path" : gains.front().at("kind").get<std::string>();
  return fmt::format("trigpoint plan {} --suggest {} 2   (the gates are not reached)", dir, kind);
}

// `suggest`: what was asked for, tags, control or path; empty: nothing.
std::string NextStep(const nlohmann::json& summary, const std::filesystem::path& out, const std::string& dir,
                     const std::string& suggest) {
  if (!summary.at("suggestions").empty()) {
    const std::string rows = suggest == "tags" ? "tag,ID,..." : suggest == "control" ? "control,ID" : "path,NAME,...";
    return fmt::format("enter what you accept of {} in the sketch (rows {}), then trigpoint plan {}",
                       ShownPath(out / "suggestions.csv"), rows, dir);
  }
  const nlohmann::json& gates = summary.at("gates");
  const auto any = [&](const nlohmann::json& value) {
    return std::any_of(gates.begin(), gates.end(), [&](const auto& gate) { return gate.at("passed") == value; });
  };
  if (!any(nullptr) && !any(false)) return NextOfAccepted(summary, dir);
  if (suggest.empty()) return NextOfRefused(summary, dir, any(nullptr));
  return fmt::format("sketch more {}, then trigpoint plan {}",
                     suggest == "path"   ? "tags or known points"
                     : suggest == "tags" ? "paths or known points"
                                         : "tags, or paths that see them",
                     dir);
}

// Of --suggest KIND N.
void CheckSuggest(const std::vector<std::string>& suggest) {
  if (suggest.size() < 2) return;
  constexpr int kMost = 20;  // as PlanOptions::count
  const auto count = ParseInt(suggest[1]);
  if (count && *count >= 1 && *count <= kMost) return;
  throw OptionError(fmt::format("--suggest {} {}: expected a whole number from 1 to {}, as --suggest {} 2", suggest[0],
                                suggest[1], kMost, suggest[0]));
}

int PlanIn(Session& session, const Arguments& a) {
  const Project project = OpenProject(session, a.dir);
  std::vector<std::string> settings = a.settings;
  if (!a.sketch.empty()) settings.push_back("sketch=" + DumpJson(a.sketch));
  if (!a.suggest.empty()) {
    settings.push_back("suggest=" + DumpJson(a.suggest[0]));
    settings.push_back("count=" + (a.suggest.size() > 1 ? a.suggest[1] : "1"));
  }
  StageTarget target;
  target.overrides = ParseOverrides(settings, "plan");
  const StageInfo& stage = StageNamed("plan");
  const StageRequest request = MakeRequest(project, stage, target);
  if (a.gates) {
    const nlohmann::json& o = request.options;
    if (o["max_tag_sigma_m"] == 0.0 && o["max_camera_sigma_m"] == 0.0 && o["min_redundancy"] == 0.0) {
      throw OptionError(
          "--gates: no gate is set; expected max_tag_sigma_m, max_camera_sigma_m or min_redundancy, by "
          "--set or under stages: plan: in trigpoint.yaml");
    }
  }
  const StageOutcome outcome = RunStageShown(session, project, request, "plan");
  const nlohmann::json& metrics = outcome.manifest.at("metrics");
  const std::string dir = ShellWord(ShownPath(a.dir));
  const nlohmann::json result = nlohmann::json::parse(ReadTextFile(outcome.dir / "summary.json"));
  const bool passed = !a.gates || metrics.value("gates", "PASS") == "PASS";
  session.End(PlanEnding(outcome, stage.summary(outcome, DisplayUnitNamed(session.options.units)), session.Taken())
                  .Next(NextStep(result, outcome.dir, dir, a.suggest.empty() ? "" : a.suggest.front())));
  session.PrintJson({{"command", "plan"},
                     {"ok", passed},
                     {"dir", outcome.dir.string()},
                     {"metrics", metrics},
                     {"summary", result},
                     {"warnings", outcome.manifest.value("warnings", nlohmann::json::array())}});
  return passed ? 0 : kGateExitCode;
}

// A plan that fails leaves no project where there was none.
int Plan(Session& session, const Arguments& a) {
  CheckSuggest(a.suggest);
  const std::filesystem::path file = std::filesystem::path(a.dir) / "trigpoint.yaml";
  const bool fresh = !std::filesystem::exists(file);
  MakeBareProject(a.dir, "plan");
  try {
    return PlanIn(session, a);
  } catch (const Error&) {
    std::error_code ignored;
    if (fresh) std::filesystem::remove(file, ignored);
    throw;
  }
}

}  // namespace

void AddPlanCommand(CLI::App& app, Session& session) {
  const StageInfo& stage = StageNamed("plan");
  CLI::App& command = AddCommand(app, session, "plan", stage.help,
                                 OptionTable(stage) +
                                     "Reads plan.csv or plan.geojson (tags, control, stations, paths, places for more "
                                     "tags), else the site as its\n"
                                     "survey runs show it. The survey's own normal equations are built from simulated "
                                     "observations of the planned pictures.\n"
                                     "Writes results/plan/: tables, a map, index.html.\n\n"
                                     "Examples:\n"
                                     "  trigpoint plan my_site\n"
                                     "  trigpoint plan my_site --suggest control 2\n"
                                     "  trigpoint plan my_site --suggest tags 3 --set fov_deg=110\n"
                                     "  trigpoint plan my_site --gates --set max_tag_sigma_m=0.02\n");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the project, or a folder with a sketch")->required();
  command.add_option("--sketch", a->sketch, "the sketch, relative to DIR; default: plan.csv, plan.geojson");
  command.add_option("--suggest", a->suggest, "what to propose, and how many: tags, control or path, and a number")
      ->expected(1, 2);
  command.add_flag("--gates", a->gates, "exit code 3 unless the gates that are set pass");
  AddSetOption(command, &a->settings);
  command.callback([&session, a] { session.action = [a](Session& s) { return Plan(s, *a); }; });
}

}  // namespace trigpoint
