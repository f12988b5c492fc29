// The project: a user's folder, its trigpoint.yaml, its results.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site.h"
#include "datasets/project/hash.h"
#include "datasets/project/lock.h"
#include "datasets/project/review.h"

namespace trigpoint {

// What `Project::Init` saw in a folder, in words.
struct InitReport {
  std::filesystem::path file;         // trigpoint.yaml
  bool created = false;               // false: it was there before, and is kept
  std::filesystem::path kept;         // where runs were added to it: as it was, in results/replaced/
  std::vector<std::string> added;     // its lines that are new then
  std::vector<std::string> found;     // one sentence each
  std::vector<std::string> missing;   // what would make more possible, and what it would make possible
  std::vector<std::string> warnings;  // what was found but cannot be used as it is
};

// A project as opened. Inputs are never written; everything made goes below results/. Copies share lock and hashes.
class Project {
 public:
  // Opens DIR (its trigpoint.yaml, or a bare folder in the known layout: defaults then). Throws InputError.
  static Project Open(const std::filesystem::path& dir);
  // The same for a command that reads panoramas and writes results: pictures whose source forbids to keep them longer
  // are deleted first, with a warning (datasets/io/expired_panoramas.h). Open() leaves them, and nothing uses them.
  static Project OpenToCompute(const std::filesystem::path& dir);
  // As far as it can be opened, to be looked at: what is broken counts as absent and is named in `problems`. Throws
  // InputError only if there is no such folder.
  static Project OpenTolerant(const std::filesystem::path& dir, std::vector<std::string>* problems);
  // Looks at DIR and writes trigpoint.yaml; one that is there is kept, only runs that it doesn't list yet are added to
  // it, and it is kept as it was. Throws InputError if the folder holds nothing to work with, IoError if it cannot be
  // written.
  static InitReport Init(const std::filesystem::path& dir);

  const std::filesystem::path& dir() const { return dir_; }
  const std::string& name() const { return name_; }
  const std::string& crs() const { return crs_; }  // "EPSG:32632" or empty
  // As read, reduced to the runs of trigpoint.yaml (without a list: all), with its roles.
  const Site& site() const { return site_; }
  // Throws InputError naming the nearest run, or why nothing of a broken one can be used.
  const Run& run(const std::string& name) const;
  // All runs that take part, broken ones (site().broken_runs) among them, so that these are named as failures.
  std::vector<std::string> RunNames() const;
  // Site ENU: from trigpoint.yaml or origin.json, else the mean of control points, panoramas, GPS. None: no geo data.
  bool has_frame() const { return has_frame_; }
  const LocalFrame& frame() const { return frame_; }
  // Option values of trigpoint.yaml: {stage: {option: value}}, and those of variants, which are laid over them:
  // {variant: {stage: {option: value}}}.
  const nlohmann::json& stages() const { return stages_; }
  const nlohmann::json& variants() const { return variants_; }
  // Thresholds of `evaluate`, {name: limit}.
  const nlohmann::json& gates() const { return gates_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  // What people decided (review.jsonl). The roles of site().control_points are already those of the review; what is
  // excluded is still there, and left out by the stages.
  const Review& review() const { return review_; }

  std::filesystem::path results() const { return dir_ / "results"; }
  // results/<stage>/<name>; a name that is empty or begins with '@' stands for the stage's single result:
  // results/<stage>[@variant].
  std::filesystem::path ResultDir(const std::string& stage, const std::string& name) const;

  // The right to write below results/, shared by everything that uses this project, until the last one lets go.
  // Throws IoError if another process has it.
  std::shared_ptr<ProjectLock> Lock() const;
  // Hashes of input files, kept in results/.hashes.
  FileHashes& hashes() const;

 private:
  struct Shared;
  static Project OpenWith(const std::filesystem::path& dir, std::vector<std::string>* problems);

  std::filesystem::path dir_;
  std::string name_;
  std::string crs_;
  Site site_;
  LocalFrame frame_;
  bool has_frame_ = false;
  nlohmann::json stages_ = nlohmann::json::object();
  nlohmann::json variants_ = nlohmann::json::object();
  nlohmann::json gates_ = nlohmann::json::object();
  std::vector<std::string> warnings_;
  Review review_;
  std::shared_ptr<Shared> shared_;
};

// Where the site's frame begins, from what the folder holds, and from what it was taken ("the mean of 6 control
// points"). Nothing without coordinates on the Earth.
struct SiteOrigin {
  Geodetic position;
  std::string source;
};
std::optional<SiteOrigin> FindOrigin(const Site& site);

// A result's name below results/<stage>: RUN or RUN@VARIANT; of a stage with one result for all runs, `run` is empty.
inline std::string ResultNameOf(const std::string& run, const std::string& variant) {
  return variant.empty() ? run : run + "@" + variant;
}

// A variant's or result's name must be usable as part of a file name. Throws OptionError.
void CheckVariantName(const std::string& variant);

}  // namespace trigpoint
