// check: is it enough, while still on site?
#include <fmt/format.h>

#include <chrono>
#include <set>
#include <thread>

#include "app/cli/field_commands.h"
#include "app/pipeline/check.h"

namespace trigpoint {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kAtATime = 60;       // pictures, between two looks at the folder
constexpr int kRefresh_s = 3;         // of the page
constexpr double kQuietShare = 3;     // times what a judgement takes, before the next one: pictures come first
constexpr size_t kFindingsShown = 5;  // in the ending

double Seconds(Clock::time_point since) { return std::chrono::duration<double>(Clock::now() - since).count(); }

struct Arguments {
  std::string dir;
  bool watch = false;
};

int ExitCodeOf(Light light) { return light == Light::kGreen ? 0 : kGateExitCode; }

Ending EndingOf(const CheckOutcome& outcome, const std::filesystem::path& out) {
  Ending ending("Check: " + CheckHeadline(outcome));
  ending.RestIn("the page");
  if (outcome.facts.prediction) {
    ending.Fact("Accuracy", fmt::format("tags {:.1f} mm (predicted RMS of the 3D sigma), datum: {}",
                                        1e3 * outcome.facts.prediction->RmsSigma(), outcome.facts.prediction->datum));
  }
  for (size_t k = 0; k < outcome.advice.size(); ++k) {
    ending.Fact(k == 0 ? "Do next" : "  then", outcome.advice[k].what);
  }
  size_t shown = 0, wrong = 0;
  for (const SiteFinding& f : outcome.findings) wrong += f.light != Light::kGreen ? 1 : 0;
  for (const SiteFinding& f : outcome.findings) {
    if (f.light == Light::kGreen || shown == kFindingsShown) break;
    ++shown;
    ending.Problem(Capitalised(LightName(f.light)), f.text);
  }
  if (wrong > shown) ending.Problem("And", Counted(wrong - shown, "more finding", "more findings") + ": see the page");
  ending.Look("Page", out / "index.html");
  return ending;
}

// What became true, and what is no longer.
void SayChanges(const CheckOutcome& outcome, std::set<std::string>* said, Terminal* terminal) {
  std::set<std::string> now;
  for (const SiteFinding& f : outcome.findings) {
    if (f.light == Light::kGreen) continue;
    const std::string line = fmt::format("{}: {}", LightName(f.light), f.text);
    now.insert(line);
    if (!said->contains(line)) terminal->Say("  + " + line);
  }
  for (const std::string& line : *said) {
    if (!now.contains(line)) terminal->Say("  - " + line);
  }
  *said = std::move(now);
}

// Goes on until Ctrl-C. A judgement takes a while: pictures come first.
CheckOutcome Watch(SiteCheck& check, CheckOutcome outcome, Terminal& terminal, const CancelToken& cancel) {
  std::set<std::string> said;
  terminal.Say(CheckHeadline(outcome));
  SayChanges(outcome, &said, &terminal);
  auto judged = Clock::now();
  double took = 0;
  size_t looked = 0;
  bool waited = outcome.waiting > 0;
  try {
    while (true) {
      size_t now = check.Look(kAtATime, terminal, cancel);
      if (now < kAtATime) now += check.Compare(kAtATime, terminal, cancel);
      looked += now;
      const bool news = looked > 0 || waited || check.OthersChanged();
      if (news && Seconds(judged) > kQuietShare * took) {
        const auto begun = Clock::now();
        outcome = check.Judge(terminal, cancel);
        took = Seconds(begun);
        judged = Clock::now();
        waited = outcome.waiting > 0;
        WriteCheck(outcome, kRefresh_s, check.out());
        terminal.ClearProgress();
        if (looked > 0) terminal.Say(CheckHeadline(outcome));
        SayChanges(outcome, &said, &terminal);
        looked = 0;
      }
      constexpr auto kPause = std::chrono::milliseconds(500);
      if (now == 0) std::this_thread::sleep_for(kPause);
      cancel.ThrowIfCancelled();
    }
  } catch (const Cancelled&) {  // how a watch ends
  }
  return outcome;
}

int Check(Session& session, const Arguments& a) {
  Terminal terminal = session.MakeTerminal();
  terminal.SetTitle("check");
  SiteCheck check(a.dir, session.options.threads, session.options.seed);
  while (check.Look(kAtATime, terminal, *session.cancel) > 0 ||
         check.Compare(kAtATime, terminal, *session.cancel) > 0) {
  }
  CheckOutcome outcome = check.Judge(terminal, *session.cancel);
  WriteCheck(outcome, a.watch ? kRefresh_s : 0, check.out());
  terminal.ClearProgress();
  if (a.watch) {
    terminal.Say("Page: " + (check.out() / "index.html").string() + " (refreshes itself); end with Ctrl-C");
    outcome = Watch(check, std::move(outcome), terminal, *session.cancel);
    WriteCheck(outcome, 0, check.out());
    terminal.ClearProgress();
  }
  session.End(EndingOf(outcome, check.out()));
  nlohmann::json json = {
      {"command", "check"},           {"ok", outcome.light == Light::kGreen}, {"light", LightName(outcome.light)},
      {"pictures", outcome.pictures}, {"waiting", outcome.waiting},           {"dir", check.out().string()}};
  for (const SiteFinding& f : outcome.findings) {
    json["findings"].push_back({{"light", LightName(f.light)}, {"topic", f.topic}, {"text", f.text}});
  }
  for (const Advice& advice : outcome.advice) json["next"].push_back(advice.what);
  session.PrintJson(json);
  return ExitCodeOf(outcome.light);
}

}  // namespace

void AddCheckCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "check", "is it enough, while still on site: what was copied so far, and what to photograph next",
      "Looks at every picture that was copied to DIR so far: tags, blur, exposure; maps the tags, and says what is\n"
      "missing, what does not fit, how accurate the survey would be, and what to photograph next. Pictures that are\n"
      "still being copied are left until they are whole. What was looked at stands in results/check/pictures.jsonl:\n"
      "a check that was stopped goes on there. Writes results/check/: index.html, findings.csv, tags.csv, next.csv.\n"
      "--watch goes on until Ctrl-C; the page then refreshes itself in a browser on this machine.\n"
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
