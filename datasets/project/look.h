// What `init` would find in a folder, without writing anything.
#pragma once

#include "datasets/project/project.h"

namespace trigpoint {

// Throws InputError if there is no such folder. A folder with nothing to work with finds nothing.
InitReport LookAt(const std::filesystem::path& dir);

}  // namespace trigpoint
