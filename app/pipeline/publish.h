// Releases: releases/<name>, frozen copies of what results rest on.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/project/project.h"

namespace trigpoint {

struct Release {
  std::filesystem::path dir;
  size_t files = 0;
  int tags = 0;                       // of its map
  std::vector<std::string> runs;      // behind the map
  std::vector<std::string> evidence;  // control points, geotags behind it
};

// Copies map, covariances, reference poses, tables, localized poses, report and tables of the site, and writes
// release.json with every file's sha256, and options, inputs and versions of every stage. All of it or nothing; files
// are read-only. Throws OptionError for a name that is no folder's, InputError if the release is there already (it is
// never overwritten), if there is nothing to publish, or if a result is out of date.
Release Publish(const Project& project, const std::string& name, const std::string& variant, uint64_t seed);

}  // namespace trigpoint
