// check: is it enough, while still on site?
#include <fmt/format.h>

#include <cstdlib>
#include <set>

#include "app/cli/field_commands.h"
#include "app/pipeline/check_project.h"
#include "eval/intake/watch.h"

namespace trigpoint {
namespace {

constexpr size_t kFindingsShown = 5;  // in the ending

struct Arguments {
  std::string dir;
  bool watch = false;
};

int ExitCodeOf(Light light) { return light == Light::kGreen ? 0 : kGateExitCode; }

Ending EndingOf(const CheckOutcome& outcome, const DisplayUnit& unit, const std::filesystem::path& out) {
  Ending ending("Check: " + CheckHeadline(outcome));
  ending.RestIn("the page");
  if (outcome.facts.prediction) {
    ending.Fact("Accuracy", fmt::format("tags {:.1f} mm (predicted RMS of the 3D sigma), datum: {}",
                                        1e3 * outcome.facts.prediction->RmsSigma(), outcome.facts.prediction->datum));
  }
  for (size_t k = 0; k < outcome.advice.size(); ++k) {
    ending.Fact(k > 0                            ? "  then"
                : outcome.light == Light::kGreen ? "To gain"
                                                 : "Do next",
                outcome.advice[k].what.In(unit.name, unit.metres));
  }
  size_t shown = 0, wrong = 0;
  for (const SiteFinding& f : outcome.findings) wrong += f.light != Light::kGreen ? 1 : 0;
  for (const SiteFinding& f : outcome.findings) {
    if (f.light == Light::kGreen || shown == kFindingsShown) break;
    ++shown;
    ending.Problem(Capitalised(LightName(f.light)), f.text.In(unit.name, unit.metres));
  }
  if (wrong > shown) ending.Problem("And", Counted(wrong - shown, "more finding", "more findings") + ": see the page");
  ending.Look("Page", out / "index.html");
  return ending;
}

// What became true, and what is no longer.
void SayChanges(const CheckOutcome& outcome, const DisplayUnit& unit, std::set<std::string>* said, std::string* advised,
                Terminal* terminal) {
  std::set<std::string> now;
  for (const SiteFinding& f : outcome.findings) {
    if (f.light == Light::kGreen) continue;
    const std::string line = fmt::format("{}: {}", LightName(f.light), f.text.In(unit.name, unit.metres));
    now.insert(line);
    if (!said->contains(line)) terminal->Say("  + " + line);
  }
  for (const std::string& line : *said) {
    if (!now.contains(line)) terminal->Say("  - " + line);
  }
  const std::string next = outcome.advice.empty() ? "" : outcome.advice.front().what.In(unit.name, unit.metres);
  if (!next.empty() && *advised != next) {
    *advised = next;
    terminal->Say("  next: " + *advised);
  }
  *said = std::move(now);
}

int Check(Session& session, const Arguments& a) {
  Terminal terminal = session.MakeTerminal();
  terminal.SetTitle("check");
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  // Of a video that is still being copied FFmpeg complains at each look; the findings name it once.
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  SiteCheck check(a.dir, SourcesOfProject(), session.options.threads, session.options.seed);
  CheckOutcome outcome = CheckSite(check, unit, a.watch, terminal, *session.cancel);
  terminal.ClearProgress();
  if (a.watch) {
    terminal.Say("Page: " + (check.out() / "index.html").string() + " (refreshes itself); end with Ctrl-C");
    terminal.Say(CheckHeadline(outcome));
    std::set<std::string> said;
    std::string advised;
    SayChanges(outcome, unit, &said, &advised, &terminal);
    outcome = WatchSite(check, unit, std::move(outcome), terminal, *session.cancel,
                        [&](const CheckOutcome& now, size_t looked) {
                          terminal.ClearProgress();
                          if (looked > 0) terminal.Say(CheckHeadline(now));
                          SayChanges(now, unit, &said, &advised, &terminal);
                        });
    terminal.ClearProgress();
  }
  session.End(EndingOf(outcome, unit, check.out()));
  nlohmann::json json = {
      {"command", "check"},           {"ok", outcome.light == Light::kGreen}, {"light", LightName(outcome.light)},
      {"pictures", outcome.pictures}, {"waiting", outcome.waiting},           {"dir", check.out().string()}};
  for (const SiteFinding& f : outcome.findings) {
    json["findings"].push_back({{"light", LightName(f.light)}, {"topic", f.topic}, {"text", f.text.In()}});
  }
  for (const Advice& advice : outcome.advice) json["next"].push_back(advice.what.In());
  session.PrintJson(json);
  return ExitCodeOf(outcome.light);
}

}  // namespace

void AddCheckCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "check", "while still on site: judge what was copied so far, and list what to photograph next",
      "Looks at every picture that was copied to DIR so far (tags, blur, exposure), maps the tags, and lists what is\n"
      "missing, what does not fit, how accurate the survey would be, and what to photograph next. Masks of run.yaml "
      "are\n"
      "applied. Pictures that are still being copied are left until they are whole. results/check/pictures.jsonl\n"
      "records what was looked at, so that a check that was stopped goes on where it ended. Writes results/check/: "
      "index.html, findings.csv, tags.csv, next.csv.\n"
      "With --watch it goes on until Ctrl-C, and the page refreshes itself in a browser on this machine.\n"
      "Exit code 0: green, 3: amber or red.\n\n"
      "Examples:\n"
      "  trigpoint check my_site\n"
      "  trigpoint check my_site --watch\n");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the site's folder, which may still grow")->required();
  command.add_flag("--watch", a->watch, "go on as the folder grows, until Ctrl-C");
  command.callback([&session, a] { session.action = [a](Session& s) { return Check(s, *a); }; });
}

}  // namespace trigpoint
