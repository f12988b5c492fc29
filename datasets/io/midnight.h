// Times of day that pass midnight.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace trigpoint {

// stamps: of the rows of a file as they are, ns. Throws InputError where these are in order but for one place, at which
// seconds of the day begin again within an hour: sorted by time, what comes later would be first.
void RequireNoMidnight(const std::filesystem::path& file, const std::vector<int64_t>& stamps);

}  // namespace trigpoint
