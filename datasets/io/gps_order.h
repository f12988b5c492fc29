// Shared by the GPS readers.
#pragma once

#include "datasets/io/gps.h"

namespace trigpoint {

// Throws InputError "where: ..." unless the position is on the Earth.
void CheckOnEarth(const Geodetic& position, const std::string& where);

// Sorts by time, drops doubled times, says so; throws InputError if no fix is left.
void PutFixesInOrder(const std::filesystem::path& file, GpsTrack* track);

}  // namespace trigpoint
