#include "app/pipeline/reference_parts.h"

#include <fmt/format.h>

#include <cstdio>

#include "calib/base/fnv.h"

namespace trigpoint {
namespace {

constexpr size_t kPerPart = 128;  // references, on average at most

// Of `count` parts the one with this number.
struct PartNumber {
  unsigned number = 0, count = 1;
};

std::string NameOf(const PartNumber& part) {
  return part.count == 1 ? "" : fmt::format("{:03}of{:03}", part.number, part.count);
}

PartNumber NumberOf(const std::string& name) {
  PartNumber part;
  if (name.empty()) return part;
  const bool read = std::sscanf(name.c_str(), "%uof%u", &part.number, &part.count) == 2;
  if (!read || part.number >= part.count || NameOf(part) != name)
    throw OptionError("there is no part '" + name + "' of the references; expected a name as 003of016");
  return part;
}

// Names differ in their last letters, which FNV's low bits hardly mix (the finaliser of MurmurHash3).
uint64_t Mixed(uint64_t hash) {
  hash = (hash ^ (hash >> 33U)) * 0xff51afd7ed558ccdU;
  hash = (hash ^ (hash >> 33U)) * 0xc4ceb9fe1a85ec53U;
  return hash ^ (hash >> 33U);
}

}  // namespace

ViewOptions ViewOptionsOf(const Project& project) {
  StageTarget first, as_made;
  first.part = ReferenceParts(project.site()).front();
  const auto manifest = ReadManifest(project, "references", ResultName(StageNamed("references"), first));
  if (manifest && manifest->contains("options") && (*manifest)["options"].contains("views"))
    as_made.overrides["references"]["views"] = (*manifest)["options"]["views"];
  return ResolveOptions<ReferenceOptions>(project, "references", as_made).views;
}

std::vector<std::string> ReferenceParts(const Site& site) {
  unsigned count = 1;
  while (count * kPerPart < site.references.size()) count *= 2;
  std::vector<std::string> parts;
  for (unsigned k = 0; k < count; ++k) parts.push_back(NameOf({k, count}));
  return parts;
}

Site SiteOfPart(Site site, const std::string& part) {
  const PartNumber its = NumberOf(part);
  std::erase_if(site.references, [&](const Reference& r) {
    return Mixed(Fnv1a(r.name.data(), r.name.size())) % its.count != its.number;
  });
  return site;
}

std::string ParentPart(const std::string& part) {
  PartNumber its = NumberOf(part);
  if (its.count > 1) its.count /= 2;
  its.number %= its.count;
  return NameOf(its);
}

std::vector<std::filesystem::path> ReferenceResults(const Project& project) {
  std::vector<std::filesystem::path> results;
  for (const std::string& part : ReferenceParts(project.site())) {
    StageTarget target;
    target.part = part;
    results.push_back(ResultOf(project, "references", target));
  }
  return results;
}

std::vector<std::filesystem::path> ReferenceManifests(const Project& project) {
  std::vector<std::filesystem::path> manifests = ReferenceResults(project);
  for (std::filesystem::path& path : manifests) path /= "manifest.json";
  return manifests;
}

}  // namespace trigpoint
