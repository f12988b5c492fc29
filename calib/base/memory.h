// What the allocator keeps, and what there is.
#pragma once

#include <cstdint>
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

// What the limits of this process (ulimit -v, -d) leave of its address space, bytes; the largest number without limits.
int64_t MemoryWithinLimitsBytes();

// How much more memory this process can get, bytes: of the machine, of its control group, and below its own limits
// (ulimit -v, -d).
int64_t AvailableMemoryBytes();

}  // namespace trigpoint
