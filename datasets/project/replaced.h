// Input files that a command adds to: the file as it was is kept.
#pragma once

#include <filesystem>
#include <string>

namespace trigpoint {

// Writes DIR/NAME if `text` is not what it holds already. The file as it was goes to DIR/results/replaced/, with the
// time before its name; returns that file, or nothing. Throws IoError.
std::filesystem::path ReplaceInputFile(const std::filesystem::path& dir, const std::string& name,
                                       const std::string& text);

}  // namespace trigpoint
