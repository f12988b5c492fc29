// Exiv2's XMP parser has global state.
#pragma once

#include <mutex>

namespace trigpoint {

// Held by whoever reads or writes the headers of a picture, one thread at a time. The first call begins the parser and
// silences its warnings.
std::unique_lock<std::mutex> LockExiv2();

}  // namespace trigpoint
