// A release as a folder of files: its record, and what was changed since. Nothing here trusts the folder: it may have
// come from anywhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"

namespace trigpoint {

constexpr const char* kReleaseRecord = "release.json";
// Signatures of the record, beside it.
constexpr const char* kSshSignature = "release.json.sig";
constexpr const char* kGpgSignature = "release.json.asc";

struct ReleaseFile {
  std::string sha256;
  std::optional<uintmax_t> bytes;  // releases of schema 1 have none
};

struct ReleaseRecord {
  nlohmann::json json;                       // all of release.json, the types of its members as written
  std::map<std::string, ReleaseFile> files;  // by path relative to the release
  bool damaged = false;                      // its own hash does not hold
};

// Reads release.json. Throws InputError, one message, for a record that is no regular file, larger than 256 MB, no
// JSON, of another schema, or with a path that leaves the release.
ReleaseRecord ReadReleaseRecord(const std::filesystem::path& release);
// Adds the hash of the record itself, and writes it.
void WriteReleaseRecord(const std::filesystem::path& release, nlohmann::json record);

// A path relative to a folder that stays in it on any system: no "..", no root, no control character.
bool StaysInside(const std::string& path);
// A path for a message: control characters replaced, not too long.
std::string CleanPath(const std::string& path);
// `folder` / `path` if no part of it is a link and it is a regular file, else nothing.
std::optional<std::filesystem::path> PlainFile(const std::filesystem::path& folder, const std::string& path);

struct ReleaseDifferences {
  std::vector<std::string> changed, missing, added;  // "map/tags.csv: expected 12 bytes, found 14"
  bool Any() const { return !changed.empty() || !missing.empty() || !added.empty(); }
};
// Reads every file whose size is as recorded; links are never followed.
ReleaseDifferences CompareRelease(const std::filesystem::path& release, const ReleaseRecord& record, int threads,
                                  const CancelToken& cancel);

}  // namespace trigpoint
