// Small text tools the readers and writers share: numbers, names, paths, whole files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/io/path_error.h"

namespace trigpoint {

// Without surrounding spaces, tabs and line ends.
std::string_view Trim(std::string_view text);
std::string LowerCase(std::string text);                                       // of ASCII letters
std::string LowerExtension(const std::filesystem::path& file);                 // ".jpg"
std::vector<std::string_view> SplitFields(std::string_view text);              // at runs of spaces and tabs
std::vector<std::string_view> SplitAt(std::string_view text, char separator);  // trimmed; what is empty, too

// A whole field as a number, dot decimal whatever the locale says; nothing if anything else stands there.
// "nan" and "inf" are numbers here: callers decide.
std::optional<double> ParseDouble(std::string_view text);
std::optional<int64_t> ParseInt(std::string_view text);
// A year-month-day, and a UTC time "2026-05-12T09:43:20[.5][Z|+02:00]" (no zone: UTC), as ns since 1970.
std::optional<int64_t> ParseUtcToNs(std::string_view text);

// The candidate most like `name` (edit distance), or "" if there are none.
std::string NearestName(std::string_view name, const std::vector<std::string>& candidates);
// "; nearest: 'x'" for the end of a message, or "" if there are none.
std::string NearestHint(std::string_view name, const std::vector<std::string>& candidates,
                        const std::string& nearest = "nearest");

std::string CommentLines(const std::vector<std::string>& comments);  // each as a line after "# "

// A word as a POSIX shell needs it: quoted only where it must be.
std::string ShellWord(const std::string& word);

// "path:line", as every message begins.
std::string FileLine(const std::filesystem::path& file, int line);

// `written`, a path as it stands in `file`, below `base` (which lies in `root`). Throws PathError if it is absolute
// or its ".." climb out of `root`. Links are followed by nobody here: a user may link image folders in.
std::filesystem::path ResolveInside(const std::filesystem::path& root, const std::filesystem::path& base,
                                    std::string_view written, const std::string& file);

// The whole file without a byte order mark. Throws InputError if it does not exist, IoError if it cannot be read.
std::string ReadTextFile(const std::filesystem::path& file);

// Writes beside `file` and renames, so that a kill leaves the old content or the new. Makes missing folders.
// Throws IoError naming the file and the system's reason.
void WriteFileAtomically(const std::filesystem::path& file, std::string_view content);

}  // namespace trigpoint
