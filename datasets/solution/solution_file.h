// solution.db: a Solution in one SQLite file (docs/file_formats.md). Numbers come back bit by bit, the same solution
// gives the same bytes.
#pragma once

#include <filesystem>

#include "datasets/solution/solution.h"

namespace trigpoint {

// Its name in a result's folder.
constexpr const char* kSolutionFile = "solution.db";
// The newest format: 2 holds what was measured in the world, too, 3 several runs and which cameras are views of a 360
// camera, 4 an error that all observations share, 5 what images leave open of a lens. The lowest that has room is
// written.
constexpr int kSolutionVersion = 5;

// Replaces an existing file. Throws IoError.
void WriteSolution(const Solution& solution, const std::filesystem::path& file);
// Throws IoError for a file that cannot be read, InputError for one that is no solution, is damaged, or comes from a
// newer program.
Solution ReadSolution(const std::filesystem::path& file);

}  // namespace trigpoint
