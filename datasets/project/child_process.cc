#include "datasets/project/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "calib/base/cpu_seconds.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// What a program said last; the stack trace of one that gave up says less than the line before it.
std::string LastLine(const fs::path& log) {
  std::ifstream in(log);
  std::string line, last;
  while (std::getline(in, line)) {
    const std::string_view text = Trim(line);
    if (!text.empty() && !text.starts_with("@ ") && !text.starts_with("*** ")) last = text;
  }
  return last.substr(0, 300);
}

}  // namespace

fs::path FindProgram(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::stringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path file = fs::path(folder) / name;
    if (access(file.c_str(), X_OK) == 0 && fs::is_regular_file(file)) return file;
  }
  return {};
}

ChildResult RunChild(const std::vector<std::string>& argv, const fs::path& log, double timeout_s,
                     const CancelToken& cancel) {
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (out < 0) throw IoErrorFor(log, "written", errno);
  const pid_t parent = getpid();
  const Clock::time_point begun = Clock::now();
  const pid_t child = fork();
  if (child < 0) {
    const int error = errno;
    close(out);
    throw IoErrorFor(argv[0], "started", error);
  }
  if (child == 0) {
    // Only calls that are safe between fork and exec.
    setpgid(0, 0);  // Ctrl-C reaches it through us
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    const int null = open("/dev/null", O_RDONLY);
    if (null >= 0) dup2(null, STDIN_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  close(out);
  ChildResult result;
  rusage usage{};
  int status = 0;
  bool asked = false;
  Clock::time_point asked_at;
  while (wait4(child, &status, WNOHANG, &usage) == 0) {
    const Clock::time_point now = Clock::now();
    const bool too_long = timeout_s > 0 && std::chrono::duration<double>(now - begun).count() > timeout_s;
    if (!asked && (cancel.IsCancelled() || too_long)) {
      kill(-child, SIGTERM);
      asked = true;
      asked_at = now;
    } else if (asked && now - asked_at > std::chrono::seconds(2)) {
      kill(-child, SIGKILL);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  cancel.ThrowIfCancelled();
  result.exit_code = asked ? 137 : WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.wall_seconds = std::chrono::duration<double>(Clock::now() - begun).count();
  result.cpu_seconds = CpuSecondsOf(usage);
  result.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024;
  result.last_line = LastLine(log);
  return result;
}

}  // namespace trigpoint
