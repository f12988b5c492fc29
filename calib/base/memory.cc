#include "calib/base/memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <string>

namespace trigpoint {
namespace {

// "VmSize:    1234 kB" of a file of /proc, bytes.
std::optional<int64_t> FieldOf(const char* file, const std::string& name) {
  std::ifstream in(file);
  for (std::string word; in >> word;) {
    int64_t kibibytes = 0;
    if (word == name && in >> kibibytes) return kibibytes * 1024;
  }
  return std::nullopt;
}

std::optional<int64_t> NumberIn(const char* file) {
  std::ifstream in(file);
  int64_t value = 0;
  return in >> value ? std::optional<int64_t>(value) : std::nullopt;
}

}  // namespace

int64_t MemoryWithinLimitsBytes() {
  int64_t left = std::numeric_limits<int64_t>::max();
  const std::pair<int, const char*> limits[] = {{RLIMIT_AS, "VmSize:"}, {RLIMIT_DATA, "VmData:"}};
  for (const auto& [resource, used] : limits) {
    rlimit limit{};
    if (getrlimit(static_cast<__rlimit_resource>(resource), &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) continue;
    const auto most = static_cast<int64_t>(std::min<rlim_t>(limit.rlim_cur, std::numeric_limits<int64_t>::max()));
    left = std::min(left, std::max<int64_t>(0, most - FieldOf("/proc/self/status", used).value_or(0)));
  }
  return left;
}

int64_t AvailableMemoryBytes() {
  const int64_t machine = FieldOf("/proc/meminfo", "MemAvailable:").value_or(int64_t{2} << 30);
  const int64_t available = std::min(machine, MemoryWithinLimitsBytes());
  const auto most = NumberIn("/sys/fs/cgroup/memory.max"), used = NumberIn("/sys/fs/cgroup/memory.current");
  return most && used ? std::min(available, std::max<int64_t>(0, *most - *used)) : available;
}

}  // namespace trigpoint
