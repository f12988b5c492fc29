// What a release holds: releases/<name>, a frozen copy of what results rest on, complete enough to compute them again.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
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

// A result that a release rests on.
struct ReleasedResult {
  std::string key;  // in the record: "localize/run1"
  nlohmann::json manifest;
  std::filesystem::path dir;
  std::string place;  // of the copy below the release; empty: only its record is kept
};
struct ReleaseContent {
  std::vector<ReleasedResult> results;        // published ones and those behind them
  std::vector<std::string> order;             // keys of what can be computed again, each after those it reads
  std::vector<std::filesystem::path> inputs;  // files of the project besides those that the manifests name
};

// Throws OptionError for a name that is no folder's, InputError if such a release is there already.
void CheckReleaseName(const Project& project, const std::string& name);
// Throws InputError if a variant has neither a map nor errors, or if an input's source forbids to keep it.
void CheckReleasable(const Project& project, const std::string& variant);
// Copies results and inputs (pictures and videos as hashes unless asked for), writes the certificate, and release.json:
// every file's sha256; options, inputs and versions of every result. All of it or nothing; files are read-only. The
// caller has the project's lock. Throws InputError for an input that changes meanwhile; IoError.
Release WriteRelease(const Project& project, const PublishOptions& options, const ReleaseContent& content,
                     const CancelToken& cancel);

}  // namespace trigpoint
