// Releases: releases/<name>, frozen copies of what results rest on, complete enough to compute them again.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/project.h"
#include "eval/release/certificate.h"

namespace trigpoint {

struct PublishOptions {
  std::string name;
  std::string variant;
  bool copy_inputs = false;  // pictures and videos too; else their hashes
  ReleaseStatement statement;
  std::optional<std::string> sign;  // with which key, see SignRelease
};

struct Release {
  std::filesystem::path dir;
  std::string sha256;  // of its record
  size_t files = 0;
  size_t inputs = 0, inputs_by_hash = 0;
  int tags = 0;                       // of its map
  std::vector<std::string> runs;      // behind the map
  std::vector<std::string> evidence;  // control points, geotags behind it
};

// Copies map, covariances, reference poses, tables, localized poses, report and everything they were computed from
// (pictures and videos as hashes unless asked for), writes the certificate, and release.json: every file's sha256;
// options, inputs and versions of every result behind them. All of it or nothing; files are read-only. Throws
// OptionError for a name that is no folder's, InputError if the release is there already (it is never overwritten), if
// there is nothing to publish, or if any result behind it is out of date.
Release Publish(const Project& project, const PublishOptions& options, const CancelToken& cancel);

}  // namespace trigpoint
