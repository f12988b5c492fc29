// Folders that are replaced as a whole, and the small things every writer of results needs.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "calib/base/error.h"

namespace trigpoint {

// "FILE: cannot be <done>: <the system's reason>", and what to do where that is known (full disk, read-only).
IoError IoErrorFor(const std::filesystem::path& file, std::string_view done, int error_number);

// Puts the folder `fresh` in the place of `target` (which may exist): at every moment `target` is the old folder or
// the new one. The old one is removed. Both must lie in the same parent. Throws IoError.
void ReplaceFolder(const std::filesystem::path& fresh, const std::filesystem::path& target);

// Removes what killed processes left in `folder`: half-made folders, and a replacement between its two steps (on file
// systems that cannot exchange names) is undone. Only the holder of the project's lock may call it.
void RecoverFolder(const std::filesystem::path& folder);

// The path relative to `root` with '/' where it lies below it, else the absolute path.
std::string RelativeTo(const std::filesystem::path& root, const std::filesystem::path& path);

// JSON as text; bytes of a file name that are not UTF-8 are replaced instead of failing.
std::string DumpJson(const nlohmann::json& value, int indent = -1);

// A JSON object; an empty one where there is no such file or something else is in it.
nlohmann::json ReadJsonOrNothing(const std::filesystem::path& file);

// The user of this process.
std::string UserName();

// Now, as 2026-05-12T09:43:20Z.
std::string UtcTimeText();

// Names of half-made and of failed results beside the finished ones.
constexpr std::string_view kTemporaryPrefix = ".tmp-";
constexpr std::string_view kReplacedPrefix = ".old-";
constexpr std::string_view kFailedPrefix = ".failed-";

}  // namespace trigpoint
