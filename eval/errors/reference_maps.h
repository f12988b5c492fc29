// Tag maps that results can be held against: surveyed points, the survey's map, published maps.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/project.h"
#include "eval/errors/evaluate.h"

namespace trigpoint {

// Control and check points as a map, named "control". A point says nothing about how its tag is turned, so that only
// stations whose offset is east, north, up can be held against it. No tags if there are no points.
ReferenceMap ControlMap(const Project& project);

// The map in a folder with tags.csv, tags_cov.csv and the manifest.json of the survey, or of a release
// (release.json). Tags that moved, stand twice, or have no certain pose are unusable. Throws InputError if it is not
// there, not in the site's frame, or was changed after it was published.
ReferenceMap ReadReferenceMap(const Project& project, const std::filesystem::path& folder, const std::string& name);
// One sentence on tags whose covariance tags_cov.csv should give and does not; empty if all is well.
std::string MissingCovariances(const ReferenceMap& map, const std::filesystem::path& folder);

// May a map of this frame (see TagMapFrame) serve as the site's? "enu" or nothing, or the surveyor's own, "local".
bool IsSiteFrame(const std::string& frame);

// Where the map of this name is: results/survey[@V] for "survey" and "survey@V", else releases/<name>/map.
std::filesystem::path ReferenceMapFolder(const Project& project, const std::string& name);

// Every name that ReferenceMapFolder finds something for, and "self" and "control".
std::vector<std::string> ReferenceNames(const Project& project);

// releases/<name>
std::filesystem::path ReleaseFolder(const Project& project, const std::string& name);
std::vector<std::string> ReleaseNames(const Project& project);
// Throws InputError naming the first file of a release that is missing or was changed since.
void CheckRelease(const std::filesystem::path& release);

// The maps to hold results against: the one asked for ("self": none), without a name control points and survey. One
// that cannot be read is named and left out, unless it was asked for: InputError then.
std::vector<ReferenceMap> ReferencesFor(const Project& project, const std::string& asked, ProgressSink& progress);

}  // namespace trigpoint
