// Writes a release: which results are published, and what they rest on.
#pragma once

#include "eval/release/content.h"

namespace trigpoint {

// Publishes map, covariances, reference poses, tables, localized poses, report and everything they were computed from.
// Throws what eval/release/content.h names, and InputError if any result behind it is out of date.
Release Publish(const Project& project, const PublishOptions& options, const CancelToken& cancel);

}  // namespace trigpoint
