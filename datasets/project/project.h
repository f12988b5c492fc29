// The project: a user's folder, its trigpoint.yaml, its results.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

// A project as opened. Inputs are never written; everything made goes below results/.
class Project {
 public:
  // Opens DIR (its trigpoint.yaml, or a bare folder in the known layout: defaults then). Throws InputError.
  static Project Open(const std::filesystem::path& dir);

  const std::filesystem::path& dir() const { return dir_; }
  const Site& site() const { return site_; }
  const Run& run(const std::string& name) const;  // throws InputError naming the nearest run
  // Site ENU: from trigpoint.yaml or origin.json, else the mean of control points, panoramas, GPS. None: no geo data.
  bool has_frame() const { return has_frame_; }
  const LocalFrame& frame() const { return frame_; }
  // Option values of a stage from trigpoint.yaml (stages: <stage>: {key: value}), as JSON; empty object if none.
  const nlohmann::json& StageOptions(const std::string& stage) const;
  // results/<stage>/<name>
  std::filesystem::path ResultDir(const std::string& stage, const std::string& name) const;

 private:
  std::filesystem::path dir_;
  Site site_;
  LocalFrame frame_;
  bool has_frame_ = false;
  std::map<std::string, nlohmann::json> stage_options_;
};

}  // namespace trigpoint
