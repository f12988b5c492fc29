// crosscheck: COLMAP on the same run, and anybody's models and trajectories of it, held against ours.
#include "app/pipeline/crosscheck_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "app/pipeline/drawn_views.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/project/reference_parts.h"
#include "eval/exchange/colmap_run.h"
#include "eval/exchange/crosscheck.h"
#include "eval/exchange/crosscheck_figures.h"
#include "eval/exchange/crosscheck_panoramas.h"

namespace trigpoint {

StageInfo CrosscheckStage() {
  StageInfo info;
  info.name = "crosscheck";
  info.help = "compare a run with COLMAP, and with models/ and estimates/";
  info.variants = true;
  info.only_on_request = true;
  info.needs = {"localize"};
  info.metric = "compared";
  UseOptions<CrosscheckOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<CrosscheckOptions>(project, "crosscheck", target);
    StageTarget plain = target;
    plain.variant.clear();
    StageRequest request;
    request.version = 3;
    request.options = JsonFromOptions(options);
    request.inputs = RunInputs(project, project.run(target.run));
    request.inputs.push_back(ManifestOf(project, "features", plain));
    request.inputs.push_back(ManifestOf(project, "localize", target));
    request.inputs.push_back(ResultOf(project, "localize", target) / "panoramas.csv");  // as it is now
    if (std::filesystem::exists(project.dir() / "models")) request.inputs.push_back(project.dir() / "models");
    if (std::filesystem::exists(project.dir() / "estimates")) request.inputs.push_back(project.dir() / "estimates");
    request.values["colmap"] = FindProgram("colmap").string();
    request.body = [=, run = target.run, variant = target.variant](StageContext& context) {
      Crosscheck(run, variant, options, ViewOptionsOf(context.project), context);
    };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit&) {
    return ReadTextFile(outcome.dir / "crosscheck.md") + "\n";
  };
  return info;
}

}  // namespace trigpoint
