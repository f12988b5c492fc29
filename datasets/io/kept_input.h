// Input files that a command adds to: the file as it was is kept.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

// Copies SITE/NAME to SITE/results/replaced/, with the time before its name, and returns the copy; nothing if there is
// no such file. Throws IoError.
std::filesystem::path KeepInputFile(const std::filesystem::path& site, const std::string& name);

// The lines of `file` that are not in `kept`, its earlier copy.
std::vector<std::string> AddedLines(const std::filesystem::path& kept, const std::filesystem::path& file);

}  // namespace trigpoint
