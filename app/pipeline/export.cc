#include "app/pipeline/export.h"

#include "app/pipeline/stages.h"

namespace trigpoint {

ExportReport ExportResults(const Project& project, const ExportRequest& request, ProgressSink& progress,
                           const CancelToken& cancel) {
  const auto variant_of = [&](const std::string& run) {
    return TargetRead(project, StageNamed("reconstruct"), "localize", {run, request.variant}).variant;
  };
  return ExportResults(project, request, variant_of, progress, cancel);
}

}  // namespace trigpoint
