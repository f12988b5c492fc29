// The results that are held against references, read with everything that the evaluation wants to know of them.
#pragma once

#include <string>
#include <vector>

#include "datasets/project/stage.h"
#include "eval/errors/evaluate.h"
#include "survey/tags/tag_poses.h"

namespace trigpoint {

// Runs whose results are held against something.
std::vector<const Run*> EvaluatedRuns(const Project& project);
// Of these variants the first one, and the others that some of these runs are localized in.
std::vector<std::string> EvaluatedVariants(const Project& project, const std::vector<std::string>& known);

// All localized runs of all variants side by side, the one that was asked for first; a run that cannot be read is named
// in the log, and the others go on. A result whose newest attempt failed is an older one: `notes` say so, too, so that
// it does not pass for the new. `own_tags`: how the tags that a run's own images show are placed, for a comparison with
// them, with a table of them below context.out; null: none is wanted.
std::vector<EvaluatedRun> ReadEvaluatedRuns(const TagPosesOptions* own_tags, const std::vector<std::string>& variants,
                                            const std::vector<Station>& stations, StageContext& context,
                                            std::vector<std::string>* notes);

// What several runs were adjusted to: its panoramas as one result, its cameras for each run.
struct EvaluatedSite {
  std::vector<EvaluatedRun> answers, cameras;
};
EvaluatedSite ReadEvaluatedSites(const std::vector<std::string>& variants, const std::vector<Station>& stations,
                                 StageContext& context);

}  // namespace trigpoint
