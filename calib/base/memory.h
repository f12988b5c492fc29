// What the allocator keeps.
#pragma once

#include <cstdlib>  // says whose library it is

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace trigpoint {

// Gives free memory back to the system. Threads leave much of it behind, in pieces that the next step cannot use: a
// run's steps would need the sum of what each needs.
inline void ReturnFreeMemory() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

}  // namespace trigpoint
