#include "eval/report/drawing_memory.h"

#include <fmt/format.h>

#include "calib/base/memory.h"
#include "datasets/project/forked.h"

namespace trigpoint {

void RequireDrawingMemory(const std::string& what, double needed_mib) {
  constexpr double kMiB = 1 << 20;
  const double left_mib = static_cast<double>(MemoryWithinLimitsBytes()) / kMiB;
  if (left_mib >= needed_mib) return;
  throw MemoryError(
      fmt::format("{} needs about {:.0f} MiB of memory, the limit of this process leaves {:.0f} MiB; raise its limit "
                  "(ulimit -v)",
                  what, needed_mib, left_mib));
}

}  // namespace trigpoint
