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

int64_t AvailableMemoryBytes() {
  int64_t available = FieldOf("/proc/meminfo", "MemAvailable:").value_or(int64_t{2} << 30);
  const auto below = [&](std::optional<int64_t> limit, std::optional<int64_t> used) {
    if (limit && used) available = std::min(available, std::max<int64_t>(0, *limit - *used));
  };
  below(NumberIn("/sys/fs/cgroup/memory.max"), NumberIn("/sys/fs/cgroup/memory.current"));
  const std::pair<int, const char*> limits[] = {{RLIMIT_AS, "VmSize:"}, {RLIMIT_DATA, "VmData:"}};
  for (const auto& [resource, used] : limits) {
    rlimit limit{};
    if (getrlimit(static_cast<__rlimit_resource>(resource), &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) continue;
    const auto most = static_cast<rlim_t>(std::numeric_limits<int64_t>::max());
    below(static_cast<int64_t>(std::min(limit.rlim_cur, most)), FieldOf("/proc/self/status", used));
  }
  return available;
}

}  // namespace trigpoint
