// A release computed again from what it holds.
#pragma once

#include "eval/release/remade.h"

namespace trigpoint {

// Throws InputError, one message, if the release is not as it was published, keeps no inputs (schema 1), or an input
// that it has by hash alone is not there with that hash; what a stage throws; Cancelled.
RerunResult Rerun(const RerunOptions& options, int threads, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
