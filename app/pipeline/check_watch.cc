#include "app/pipeline/check_watch.h"

#include <thread>

namespace trigpoint {

namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kAtATime = 60;                          // pictures, between two looks at the folder
constexpr int kRefresh_s = 3;                            // of the page
constexpr double kQuietShare = 3;                        // times what a judgement takes, before the next one
constexpr auto kPause = std::chrono::milliseconds(500);  // where nothing is new

double Seconds(Clock::time_point since) { return std::chrono::duration<double>(Clock::now() - since).count(); }

}  // namespace

CheckOutcome CheckSite(SiteCheck& check, bool watched, ProgressSink& progress, const CancelToken& cancel) {
  while (check.Look(kAtATime, progress, cancel) > 0 || check.Compare(kAtATime, progress, cancel) > 0) {
  }
  CheckOutcome outcome = check.Judge(progress, cancel);
  WriteCheck(outcome, watched ? kRefresh_s : 0, check.out());
  return outcome;
}

CheckOutcome WatchSite(SiteCheck& check, CheckOutcome outcome, ProgressSink& progress, const CancelToken& cancel,
                       const Judged& judged) {
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
        outcome = check.Judge(progress, cancel);
        took = Seconds(begun);
        judged_at = Clock::now();
        waited = outcome.waiting > 0;
        WriteCheck(outcome, kRefresh_s, check.out());
        judged(outcome, looked);
        looked = 0;
      }
      if (now == 0) std::this_thread::sleep_for(kPause);
      cancel.ThrowIfCancelled();
    }
  } catch (const Cancelled&) {
  }
  WriteCheck(outcome, 0, check.out());
  return outcome;
}

}  // namespace trigpoint
