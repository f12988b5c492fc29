#include "app/pipeline/export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

#include "app/pipeline/command_line.h"
#include "app/pipeline/stages.h"
#include "calib/base/counted.h"
#include "datasets/export/crs.h"
#include "datasets/export/gpano.h"
#include "datasets/export/layer_files.h"
#include "datasets/export/scene_files.h"
#include "datasets/io/camchain.h"
#include "datasets/io/credits.h"
#include "datasets/io/csv.h"
#include "datasets/io/tag_layout.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/manifest.h"
#include "datasets/project/outputs.h"
#include "eval/errors/results.h"
#include "localize/reconstruct/image_motion.h"

namespace trigpoint {

ExportReport ExportResults(const Project& project, const ExportRequest& request, ProgressSink& progress,
                           const CancelToken& cancel) {
  const auto variant_of = [&](const std::string& run) {
    return TargetRead(project, StageNamed("reconstruct"), "localize", {run, request.variant}).variant;
  };
  return ExportResults(project, request, variant_of, progress, cancel);
}

}  // namespace trigpoint
