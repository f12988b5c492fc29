// The references of a large site are looked at in parts, each a result of its own: many machines can make them, and
// one panorama more costs one part. A small site has one part.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/project.h"

namespace trigpoint {

// Names of the parts: "", or "000of004" and so on. A reference belongs to one by its name alone, so that others may
// come and go; the number of parts doubles where the site outgrows it.
std::vector<std::string> ReferenceParts(const Site& site);
// The site with the references of a part alone.
Site SiteOfPart(Site site, const std::string& part);
// The part of half as many that a part was cut from.
std::string ParentPart(const std::string& part);

// The folders and manifests of all parts' results.
std::vector<std::filesystem::path> ReferenceResults(const Project& project);
std::vector<std::filesystem::path> ReferenceManifests(const Project& project);

// Removes the parts of a former number of parts once all of the present ones are there: until then, features are taken
// over from them. Nothing goes while the site has no reference: its pictures may be on a disk that is not mounted. A
// folder that holds more than the stage wrote stays, with a warning. The caller has the project's lock.
void RemoveFormerParts(const Project& project, ProgressSink& progress);

// The stitched rigs there are, by the name of their set: results/stitch/<set>.
std::map<std::string, std::filesystem::path> StitchedRigs(const Project& project);

}  // namespace trigpoint
