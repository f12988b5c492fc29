#include "datasets/project/lock.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <nlohmann/json.hpp>

#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

struct flock WholeFile(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

std::string HostName() {
  char name[256] = {};
  return gethostname(name, sizeof name - 1) == 0 ? name : "unknown";
}

LockHolder Parse(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return {"unknown", 0, "unknown", "unknown", ""};  // read while it was being written
  return {json.value("host", "unknown"), json.value("process", int64_t{0}), json.value("user", "unknown"),
          json.value("since", "unknown"), json.value("stage", "")};
}

}  // namespace

ProjectLock::ProjectLock(const fs::path& results) : file_(results / ".lock") {
  std::error_code failure;
  fs::create_directories(file_.parent_path(), failure);
  if (failure) throw IoErrorFor(file_.parent_path(), "created", failure.value());
  fd_ = open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd_ < 0) throw IoErrorFor(file_, "written", errno);
  struct flock lock = WholeFile(F_WRLCK);
  if (fcntl(fd_, F_OFD_SETLK, &lock) != 0) {
    const int reason = errno;
    close(fd_);
    if (reason != EAGAIN && reason != EACCES) throw IoErrorFor(file_, "locked", reason);
    const LockHolder other = Parse(ReadTextFile(file_));
    throw IoError("project " + file_.parent_path().parent_path().string() + " is in use by process " +
                  std::to_string(other.process) + " of " + other.user + " on " + other.host + " since " + other.since +
                  (other.stage.empty() ? "" : " (making " + other.stage + ")") +
                  "; wait until it is done, or stop it. `trigpoint status` works meanwhile");
  }
  holder_ = {HostName(), getpid(), UserName(), UtcTimeText(), ""};
  try {
    Announce("");
  } catch (const IoError&) {
    close(fd_);
    throw;
  }
  std::error_code ignored;
  RecoverFolder(file_.parent_path());
  for (fs::directory_iterator it(file_.parent_path(), ignored), end; it != end; it.increment(ignored)) {
    if (it->is_directory(ignored)) RecoverFolder(it->path());
  }
}

ProjectLock::~ProjectLock() {
  [[maybe_unused]] const int ignored = ftruncate(fd_, 0);  // the content says nothing once the lock is gone
  close(fd_);
}

void ProjectLock::Announce(const std::string& stage) {
  holder_.stage = stage;
  const std::string text = DumpJson({{"host", holder_.host},
                                     {"process", holder_.process},
                                     {"user", holder_.user},
                                     {"since", holder_.since},
                                     {"stage", holder_.stage}});
  if (ftruncate(fd_, 0) != 0 || pwrite(fd_, text.data(), text.size(), 0) != static_cast<ssize_t>(text.size())) {
    throw IoErrorFor(file_, "written", errno);
  }
}

std::optional<LockHolder> ProjectLock::Holder(const fs::path& results) {
  const fs::path file = results / ".lock";
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return std::nullopt;
  struct flock lock = WholeFile(F_WRLCK);
  const bool held = fcntl(fd, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
  close(fd);
  if (!held) return std::nullopt;
  return Parse(ReadTextFile(file));
}

}  // namespace trigpoint
