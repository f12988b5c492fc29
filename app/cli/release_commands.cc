// publish: releases/<name>. compare: projects, releases or variants against each other.
#include <fmt/format.h>

#include "app/cli/command.h"
#include "app/pipeline/compared.h"
#include "app/pipeline/publish.h"
#include "eval/epoch.h"

namespace trigpoint {
namespace {

int Compare(const Session& session, const std::vector<std::string>& sides, double significance) {
  if (sides.size() < 2) throw OptionError("compare needs at least two projects, releases or variants");
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  std::vector<Compared> opened;
  for (const std::string& side : sides) opened.push_back(OpenCompared(side));
  Terminal terminal = session.MakeTerminal();
  for (const Compared& side : opened) {
    for (const std::string& note : side.notes) terminal.Log(LogLevel::kWarning, note);
  }
  nlohmann::json pairs = nlohmann::json::array();
  const Compared& a = opened.front();
  for (size_t i = 1; i < opened.size(); ++i) {
    session.cancel->ThrowIfCancelled();
    const Compared& b = opened[i];
    const std::vector<ComparedGroup> groups = CompareErrors(a.rows, b.rows);
    std::string text = "## " + a.label + " against " + b.label + "\n\n";
    text += FormatComparison(groups, a.label, b.label, unit.name, unit.metres) + "\n";
    nlohmann::json pair = ComparisonJson(groups, a.label, b.label);
    const std::vector<std::string> changes = ChangesBetween(a, b);
    text += changes.empty() ? "Nothing changed in inputs, options and versions\n" : "### What changed\n\n";
    for (const std::string& change : changes) text += "- " + change + "\n";
    pair["changes"] = changes;
    if (!a.tags.empty() && !b.tags.empty()) {
      const EpochTest test = TestEpoch(a.tags, b.tags, significance);
      text += "\n" + FormatEpoch(test, a.label, b.label, unit.name, unit.metres);
      pair["map"] = EpochJson(test);
    }
    session.Print(text + "\n");
    pairs.push_back(std::move(pair));
  }
  session.PrintJson({{"command", "compare"}, {"ok", true}, {"comparisons", pairs}});
  return 0;
}

}  // namespace

void AddPublishCommand(CLI::App& app, Session& session) {
  struct Arguments {
    std::string dir, name, variant;
  };
  CLI::App& command = AddCommand(
      app, session, "publish", "freeze map, covariances, tables and hashes under a name",
      "A release is never overwritten and never changes: `evaluate --reference NAME` holds results against its\n"
      "map, so that next month's run does not move last month's truth; `compare` says what changed since.\n\n"
      "Examples:\n"
      "  trigpoint publish my_site --name 2026-05\n"
      "  trigpoint evaluate my_site --reference 2026-05\n"
      "  trigpoint compare my_site/releases/2026-05 my_site");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("DIR", arguments->dir, "the project")->required();
  command.add_option("--name", arguments->name, "the release's name, releases/NAME")->required();
  command.add_option("--variant", arguments->variant, "publish this variant's map and tables");
  command.callback([&session, arguments] {
    session.action = [arguments](Session& s) {
      const Project project = OpenProject(s, arguments->dir);
      const Release release = Publish(project, arguments->name, arguments->variant, s.options.seed);
      s.Print(
          fmt::format("Published {}: {} files, a map of {} tags\n", release.dir.string(), release.files, release.tags));
      s.PrintJson({{"command", "publish"},
                   {"ok", true},
                   {"dir", release.dir.string()},
                   {"files", release.files},
                   {"tags", release.tags},
                   {"runs", release.runs},
                   {"evidence", release.evidence}});
      return 0;
    };
  });
}

void AddCompareCommand(CLI::App& app, Session& session) {
  struct Arguments {
    std::vector<std::string> sides;
    double significance = 0.01;
  };
  CLI::App& command = AddCommand(
      app, session, "compare", "paired differences between projects, releases or variants, and what changed",
      "Each side is a project, a release's folder, or either with @VARIANT. The first is compared with every other:\n"
      "errors paired by run and station with confidence, what changed in inputs, options and versions, and which tags\n"
      "moved between their maps.\n\n"
      "Examples:\n"
      "  trigpoint compare my_site my_site@paper\n"
      "  trigpoint compare my_site/releases/2026-05 my_site/releases/2026-06");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("SIDE", arguments->sides, "two or more: PROJECT, PROJECT@VARIANT or PROJECT/releases/NAME")
      ->required();
  command.add_option("--significance", arguments->significance, "of naming any tag as moved when none did")
      ->check(CLI::Range(1e-9, 0.5))
      ->capture_default_str();
  command.callback([&session, arguments] {
    session.action = [arguments](Session& s) { return Compare(s, arguments->sides, arguments->significance); };
  });
}

}  // namespace trigpoint
