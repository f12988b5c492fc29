#include "eval/truth/score_truth.h"

#include "datasets/io/text.h"
#include "eval/truth/truth.h"

namespace trigpoint {

namespace fs = std::filesystem;

void ScoreTruth(const fs::path& given, const std::vector<EvaluatedRun>& runs, StageContext& context,
                std::vector<std::string>* notes) {
  const fs::path dir = given.is_absolute() ? given : context.project.dir() / given;
  if (!fs::is_directory(dir)) {
    throw InputError("truth " + dir.string() + ": expected a folder with runs/<run>_cameras.tum, found none");
  }
  nlohmann::json all = nlohmann::json::array();
  std::string first;
  for (const EvaluatedRun& run : runs) {
    const std::string name = ResultNameOf(run.run, run.variant);
    try {
      const TruthEvaluation truth = EvaluateAgainstTruth(run.result, ReadTruth(dir, run.run));
      all.push_back(TruthJson(truth));
      all.back()["run"] = run.run;
      all.back()["variant"] = run.variant;
      notes->push_back("Against true poses, " + name + ": " + Describe(truth));
    } catch (const InputError& e) {
      if (first.empty()) first = e.what();
      context.progress.Log(LogLevel::kWarning, "run " + name + " is not scored against true poses: " + e.what());
    }
  }
  if (all.empty() && !first.empty()) throw InputError("truth " + dir.string() + ": no run can be scored: " + first);
  WriteFileAtomically(context.out / "truth.json",
                      nlohmann::json{{"schema", "trigpoint truth 1"}, {"unit", "m"}, {"runs", all}}.dump(2) + "\n");
}

}  // namespace trigpoint
