#include "eval/intake/watch.h"

#include <thread>

namespace trigpoint {

namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kAtATime = 60;                          // pictures, between two looks at the folder
constexpr int kRefresh_s = 3;                            // of the page
constexpr double kQuietShare = 3;                        // times what a judgement takes, before the next one
constexpr double kPatience_s = 4;                        // with files that are still being copied, when asked once
constexpr auto kPause = std::chrono::milliseconds(500);  // where nothing is new

double Seconds(Clock::time_point since) { return std::chrono::duration<double>(Clock::now() - since).count(); }

}  // namespace

CheckOutcome CheckSite(SiteCheck& check, const DisplayUnit& unit, bool watched, ProgressSink& progress,
                       const CancelToken& cancel) {
  const auto begun = Clock::now();
  while (true) {
    if (check.Look(kAtATime, progress, cancel) > 0 || check.Compare(kAtATime, progress, cancel) > 0) continue;
    // A file that changed a moment ago counts as complete only after a pause, so wait for it.
    const bool waits = check.MatchesSet() || (check.Waits() && Seconds(begun) <= kPatience_s);
    if (watched || !waits) break;
    std::this_thread::sleep_for(kPause);
    cancel.ThrowIfCancelled();
  }
  CheckOutcome outcome = check.Judge(progress, cancel);
  WriteCheck(outcome, unit, watched ? kRefresh_s : 0, check.out());
  return outcome;
}

namespace {

// A table that somebody is editing, say, makes a judgement impossible for a while.
CheckOutcome JudgeOrExplain(SiteCheck& check, const CheckOutcome& before, ProgressSink& progress,
                            const CancelToken& cancel) {
  try {
    return check.Judge(progress, cancel);
  } catch (const Cancelled&) {
    throw;
  } catch (const IoError&) {
    throw;
  } catch (const Error& e) {
    CheckOutcome outcome = before;
    const SiteFinding finding{Light::kRed, "files", e.what()};
    if (outcome.findings.empty() || outcome.findings.front().text != finding.text) {
      outcome.findings.insert(outcome.findings.begin(), finding);
    }
    outcome.light = Light::kRed;
    return outcome;
  }
}

}  // namespace

CheckOutcome WatchSite(SiteCheck& check, const DisplayUnit& unit, CheckOutcome outcome, ProgressSink& progress,
                       const CancelToken& cancel, const Judged& judged) {
  auto judged_at = Clock::now();
  double took = 0;
  size_t looked = 0;
  bool waited = outcome.waiting > 0;
  try {
    while (true) {
      size_t now = check.Look(kAtATime, progress, cancel);
      if (now < kAtATime) now += check.Compare(kAtATime, progress, cancel);
      looked += now;
      const bool news = looked > 0 || waited || check.OthersChanged();
      if (news && Seconds(judged_at) > kQuietShare * took) {
        const auto begun = Clock::now();
        outcome = JudgeOrExplain(check, outcome, progress, cancel);
        took = Seconds(begun);
        judged_at = Clock::now();
        waited = outcome.waiting > 0;
        WriteCheck(outcome, unit, kRefresh_s, check.out());
        judged(outcome, looked);
        looked = 0;
      }
      if (now == 0) std::this_thread::sleep_for(kPause);
      cancel.ThrowIfCancelled();
    }
  } catch (const Cancelled&) {
  }
  WriteCheck(outcome, unit, 0, check.out());
  return outcome;
}

}  // namespace trigpoint
