// From a project's results to files of other programs: what `trigpoint export` does.
#pragma once

#include "eval/exchange/export.h"

namespace trigpoint {

// ExportResults of eval/exchange/export.h, with the lenses of the reconstructions that the runs' results rest on.
ExportReport ExportResults(const Project& project, const ExportRequest& request, ProgressSink& progress,
                           const CancelToken& cancel);

}  // namespace trigpoint
