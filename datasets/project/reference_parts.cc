#include "datasets/project/reference_parts.h"

#include <fmt/format.h>

#include <set>

#include "calib/base/fnv.h"
#include "datasets/io/photo_sets.h"
#include "datasets/project/files.h"
#include "datasets/project/manifest.h"
#include "datasets/project/result_part.h"
#include "datasets/project/stage.h"

namespace trigpoint {
namespace {

constexpr size_t kPerPart = 128;  // references, on average at most

ResultPart PartNamed(const std::string& name) {
  const auto part = ParsePartName(name);
  if (!part) throw OptionError("there is no part '" + name + "' of the references; expected a name as 003of016");
  return *part;
}

// Names differ in their last letters, which FNV's low bits hardly mix (the finaliser of MurmurHash3).
uint64_t Mixed(uint64_t hash) {
  hash = (hash ^ (hash >> 33U)) * 0xff51afd7ed558ccdU;
  hash = (hash ^ (hash >> 33U)) * 0xc4ceb9fe1a85ec53U;
  return hash ^ (hash >> 33U);
}

}  // namespace

std::vector<std::string> ReferenceParts(const Site& site) {
  unsigned count = 1;
  while (count * kPerPart < site.references.size()) count *= 2;
  std::vector<std::string> parts;
  for (unsigned k = 0; k < count; ++k) parts.push_back(PartName({k, count}));
  return parts;
}

Site SiteOfPart(Site site, const std::string& part) {
  const ResultPart its = PartNamed(part);
  std::erase_if(site.references, [&](const Reference& r) {
    return Mixed(Fnv1a(r.name.data(), r.name.size())) % its.count != its.number;
  });
  return site;
}

std::string ParentPart(const std::string& part) {
  ResultPart its = PartNamed(part);
  if (its.count > 1) its.count /= 2;
  its.number %= its.count;
  return PartName(its);
}

std::vector<std::filesystem::path> ReferenceResults(const Project& project) {
  std::vector<std::filesystem::path> results;
  for (const std::string& part : ReferenceParts(project.site()))
    results.push_back(project.ResultDir("references", part.empty() ? "" : "@" + part));
  return results;
}

std::vector<std::filesystem::path> ReferenceManifests(const Project& project) {
  std::vector<std::filesystem::path> manifests = ReferenceResults(project);
  for (std::filesystem::path& path : manifests) path /= "manifest.json";
  return manifests;
}

void RemoveFormerParts(const Project& project, ProgressSink& progress) {
  if (project.site().references.empty()) return;
  const std::string stage = "references";
  std::set<std::string> present;
  for (const std::filesystem::path& result : ReferenceResults(project)) {
    const std::string folder = result.filename().string();
    present.insert(folder);
    if (!ReadManifest(project, stage, folder.substr(stage.size()))) return;
  }
  std::set<std::string> former;
  std::error_code ignored;
  for (std::filesystem::directory_iterator it(project.results(), ignored), end; it != end; it.increment(ignored)) {
    const std::string folder = it->path().filename().string();
    if (PartOfResult(folder) && present.count(folder) == 0) former.insert(folder);
  }
  for (const std::string& folder : former) {
    const std::string shown = RelativeTo(project.dir(), project.results() / folder);
    const std::string now = fmt::format("the site's references are made in {} now",
                                        present.size() == 1 ? "one part" : fmt::format("{} parts", present.size()));
    try {
      if (RemoveResult(project, stage, folder.substr(stage.size()))) {
        progress.Log(LogLevel::kInfo, shown + " is removed: " + now);
      } else {
        progress.Log(LogLevel::kWarning, shown + ": expected only what `references` wrote, found other files or a " +
                                             "damaged manifest.json. Nothing reads this folder: " + now +
                                             ". Move what is yours and delete it");
      }
    } catch (const IoError& e) {
      progress.Log(LogLevel::kWarning, e.what());
    }
  }
}

std::map<std::string, std::filesystem::path> StitchedRigs(const Project& project) {
  std::map<std::string, std::filesystem::path> rigs;
  for (const std::filesystem::path& set : PhotoSetFolders(project.dir())) {
    const std::string name = set.filename().string();
    rigs[name] = project.ResultDir("stitch", name);
  }
  return rigs;
}

}  // namespace trigpoint
