// Every result that others rest on: what a release must record, and be able to make again.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/pipeline/jobs.h"

namespace trigpoint {

struct RestedOn {
  Job job;
  std::string name;  // of the result: run1@paper
  nlohmann::json manifest;
  std::filesystem::path dir;
  std::string Title() const { return job.Title(); }
};

// The results named, those whose manifests or files they read, and so on down; each after those it reads. Ones without
// a manifest are left out: who reads them is out of date.
std::vector<RestedOn> ResultsBehind(const Project& project, const std::vector<RestedOn>& roots);
// Of a stage for one run and variant; nothing if it isn't there.
std::optional<RestedOn> ResultNow(const Project& project, const std::string& stage, const StageTarget& target);

// Throws InputError naming every result that its inputs, its options or trigpoint.yaml have left behind. Options given
// on the command line are the result's own, as its manifest has them.
void RequireCurrent(const Project& project, const std::vector<RestedOn>& results);

}  // namespace trigpoint
