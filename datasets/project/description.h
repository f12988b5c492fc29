// What a folder holds and what it lacks, without writing anything.
#pragma once

#include "datasets/project/project.h"

namespace trigpoint {

// As Project::Init reports it. Throws InputError if nothing of the folder is known.
InitReport DescribeFolder(const std::filesystem::path& dir);

}  // namespace trigpoint
