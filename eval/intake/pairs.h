// What pictures of a run share with the one before, and with those of an earlier traversal.
#pragma once

#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "datasets/project/json_lines.h"
#include "localize/reconstruct/odometry_clock.h"
#include "localize/reconstruct/shared_features.h"
#include "survey/field/findings.h"

namespace trigpoint {

// results/check/pairs.jsonl: a line for each pair that was compared.
class PairLog {
 public:
  explicit PairLog(const std::filesystem::path& file);
  void Read();
  const SharedView* Find(const std::string& run, const FieldPicture& a, const FieldPicture& b) const;
  const std::filesystem::path& file() const { return lines_.file(); }

 private:
  JsonLines lines_;
  std::map<std::tuple<std::string, std::string, std::string>, std::pair<std::string, SharedView>> shared_;  // versions
};

// Pairs of keyframes of a run: each with the one before, and with the nearest of an earlier traversal, by odometry.
// `shared` is that of the log, -1 where it is not there yet.
std::vector<FieldPair> PairsOf(const FieldRun& run, const PairLog& log);

// Rotations between pictures in a row, as far as they were compared.
std::vector<MeasuredTurn> TurnsOf(const FieldRun& run, const PairLog& log);

// Whether odometry is meant in another way than file_formats.md states: a message that names the reading with which it
// turns as the pictures do, and what to do. Nothing where it agrees as it is, where no other reading does, and where
// too few pictures turn. `odometry` names the file.
std::optional<std::string> FindOtherReading(const Run& run, const std::vector<MeasuredTurn>& turns,
                                            const std::string& odometry);

// Compares pairs of one run, at most `most` of those that are not in the log. Returns how many.
size_t ComparePairs(const FieldRun& run, size_t most, PairLog* log, int threads, ProgressSink& progress,
                    const CancelToken& cancel);

}  // namespace trigpoint
