// The cameras of a COLMAP database.
#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "calib/camera/camera.h"

namespace trigpoint {

// By id, ascending. Throws IoError if it cannot be read, InputError for a camera we cannot represent, naming it.
std::vector<std::pair<uint32_t, Camera>> ReadDatabaseCameras(const std::filesystem::path& database);

}  // namespace trigpoint
