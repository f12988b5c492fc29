// The command that does what a window is about to do.
#pragma once

#include <string>
#include <vector>

#include "app/pipeline/jobs.h"

namespace trigpoint {

// A word as a POSIX shell needs it: quoted only where it must be.
std::string ShellWord(const std::string& word);

// What a person would type: `trigpoint <stage> DIR ...` for one stage, `trigpoint run DIR ...` for all.
std::string CommandLine(const std::string& dir, const JobQuery& query, int threads, uint64_t seed);

}  // namespace trigpoint
