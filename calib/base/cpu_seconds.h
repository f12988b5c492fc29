// CPU time of processes.
#pragma once

#include <sys/resource.h>

namespace trigpoint {

// User and system time, s.
inline double CpuSecondsOf(const rusage& usage) {
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace trigpoint
