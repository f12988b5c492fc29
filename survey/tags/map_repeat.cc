#include "survey/tags/map_repeat.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

// The map of some of the runs, quietly.
SurveyResult MapOf(const SurveyInput& input, const SurveyOptions& options, const std::vector<size_t>& runs, int threads,
                   const CancelToken& cancel) {
  SurveyInput part = input;
  part.runs.clear();
  for (size_t r : runs) part.runs.push_back(input.runs[r]);
  for (SurveyPoint& p : part.points) {
    std::vector<SurveyMark> marks;
    for (SurveyMark m : p.marks) {
      const auto at = std::find(runs.begin(), runs.end(), static_cast<size_t>(m.run));
      if (at == runs.end()) continue;
      m.run = static_cast<int>(at - runs.begin());
      marks.push_back(m);
    }
    p.marks = marks;
  }
  ProgressSink silent;
  return SurveyTags(part, options, threads, silent, cancel);
}

}  // namespace

MapRepeats RepeatMap(const SurveyInput& input, const SurveyOptions& options, const SurveyResult& whole, int threads,
                     ProgressSink& progress, const CancelToken& cancel) {
  const std::vector<SurveyRun>& runs = input.runs;
  const auto n = static_cast<size_t>(std::count_if(runs.begin(), runs.end(), [](const auto& r) { return !r.stills; }));
  if (n < 2) return {};
  MapRepeats repeats;
  std::vector<size_t> all(runs.size());  // photo sets come last
  for (size_t r = 0; r < all.size(); ++r) all[r] = r;
  std::map<std::vector<size_t>, std::optional<SurveyResult>> maps;
  const auto map_of = [&](const std::vector<size_t>& part) -> const std::optional<SurveyResult>& {
    const auto [it, fresh] = maps.try_emplace(part);
    if (fresh) {
      try {
        it->second = MapOf(input, options, part, threads, cancel);
      } catch (const Cancelled&) {
        throw;
      } catch (const Error&) {  // too little in it: nothing to compare
      }
    }
    return it->second;
  };
  progress.Begin("maps of fewer runs", static_cast<int64_t>(n));
  std::vector<std::pair<SurveyResult, SurveyResult>> pairs;
  for (size_t r = 0; r < n; ++r) {
    std::vector<size_t> others = all;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(r));
    if (const auto& map = map_of(others)) {
      pairs.emplace_back(*map, whole);
      repeats.without[runs[r].name] = CompareMaps({pairs.back()});
    }
    progress.Advance(1);
  }
  repeats.repeatability = CompareMaps(pairs);
  std::map<std::string, std::vector<size_t>> days;
  for (size_t r = 0; r < n; ++r) {
    const SurveyRun& run = runs[r];
    days[run.date.empty() ? "run " + run.name : run.date].push_back(r);
  }
  pairs.clear();
  for (auto a = days.begin(); a != days.end(); ++a) {
    for (auto b = std::next(a); b != days.end(); ++b) {
      const auto &one = map_of(a->second), &two = map_of(b->second);
      if (one && two) pairs.emplace_back(*one, *two);
    }
  }
  if (!pairs.empty()) repeats.reproducibility = CompareMaps(pairs);
  return repeats;
}

}  // namespace trigpoint
