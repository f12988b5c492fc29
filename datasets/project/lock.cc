#include "datasets/project/lock.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/task_lock.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr double kInputPatience_s = 10;  // far more than an input file takes to write

struct flock WholeFile(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

LockHolder Parse(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return {"unknown", 0, "unknown", "unknown", ""};  // read while it was being written
  return {json.value("host", "unknown"), json.value("process", int64_t{0}), json.value("user", "unknown"),
          json.value("since", "unknown"), json.value("stage", "")};
}

// Opens and locks a file; -1 if another one has it for longer than `patience_s`.
int OpenLocked(const fs::path& file, short type, double patience_s) {
  std::error_code failure;
  fs::create_directories(file.parent_path(), failure);
  if (failure) throw IoErrorFor(file.parent_path(), "created", failure.value());
  const int fd = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0) throw IoErrorFor(file, "written", errno);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience_s);
  while (true) {
    struct flock lock = WholeFile(type);
    if (fcntl(fd, F_OFD_SETLK, &lock) == 0) return fd;
    const int reason = errno;
    if (reason != EAGAIN && reason != EACCES) {
      close(fd);
      throw IoErrorFor(file, "locked", reason);
    }
    if (std::chrono::steady_clock::now() >= deadline) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  close(fd);
  return -1;
}

[[noreturn]] void ThrowInUse(const std::string& object, const std::string& meanwhile, const fs::path& file) {
  const LockHolder other = Parse(ReadTextFile(file));
  throw IoError(object + " is in use by process " + std::to_string(other.process) + " of " + other.user + " on " +
                other.host + " since " + other.since + (other.stage.empty() ? "" : " (making " + other.stage + ")") +
                "; wait until it is done, or stop it. `" + meanwhile + "` works meanwhile");
}

[[noreturn]] void ThrowProjectInUse(const fs::path& results, const fs::path& file) {
  ThrowInUse("project " + results.parent_path().string(), "trigpoint status", file);
}

void WriteHolder(int fd, const fs::path& file, const LockHolder& holder) {
  const std::string text = DumpJson({{"host", holder.host},
                                     {"process", holder.process},
                                     {"user", holder.user},
                                     {"since", holder.since},
                                     {"stage", holder.stage}});
  if (ftruncate(fd, 0) != 0 || pwrite(fd, text.data(), text.size(), 0) != static_cast<ssize_t>(text.size())) {
    throw IoErrorFor(file, "written", errno);
  }
}

std::optional<LockHolder> HolderOf(const fs::path& file) {
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return std::nullopt;
  struct flock lock = WholeFile(F_WRLCK);
  const bool held = fcntl(fd, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
  close(fd);
  if (!held) return std::nullopt;
  return Parse(ReadTextFile(file));
}

fs::path FileOfResult(const fs::path& results, std::string result) {
  for (char& c : result) c = c == '/' ? '+' : c;
  return results / ".locks" / result;
}

// A maker that was killed between the two steps of a replacement: the old result is put back.
void RecoverResult(const fs::path& result) {
  std::error_code ignored;
  const fs::path old = result.parent_path() / (std::string(kReplacedPrefix) + result.filename().string());
  if (!fs::exists(result, ignored)) fs::rename(old, result, ignored);
  fs::remove_all(old, ignored);
}

}  // namespace

std::string HostName() {
  char name[256] = {};
  return gethostname(name, sizeof name - 1) == 0 ? name : "unknown";
}

ProjectLock::ProjectLock(const fs::path& results) : file_(results / ".lock") {
  fd_ = OpenLocked(file_, F_WRLCK, 0);
  if (fd_ < 0) ThrowProjectInUse(results, file_);
  holder_ = {HostName(), getpid(), UserName(), UtcTimeText(), ""};
  try {
    Announce("");
  } catch (const IoError&) {
    close(fd_);
    throw;
  }
  std::error_code ignored;
  fs::remove_all(results / ".locks", ignored);
  RecoverFolder(results);
  for (fs::directory_iterator it(results, ignored), end; it != end; it.increment(ignored)) {
    if (it->is_directory(ignored)) RecoverFolder(it->path());
  }
}

ProjectLock::~ProjectLock() {
  [[maybe_unused]] const int ignored = ftruncate(fd_, 0);  // the content says nothing once the lock is gone
  close(fd_);
}

void ProjectLock::Announce(const std::string& stage) {
  holder_.stage = stage;
  WriteHolder(fd_, file_, holder_);
}

std::optional<LockHolder> ProjectLock::Holder(const fs::path& results) { return HolderOf(results / ".lock"); }

FileLock::FileLock(const fs::path& file, const std::string& object, const std::string& meanwhile, double patience_s) {
  fd_ = OpenLocked(file, F_WRLCK, patience_s);
  if (fd_ < 0) ThrowInUse(object, meanwhile, file);
  try {
    WriteHolder(fd_, file, {HostName(), getpid(), UserName(), UtcTimeText(), ""});
  } catch (const IoError&) {
    close(fd_);
    throw;
  }
}

// Unlocked, not only closed: a child that was forked meanwhile has the file open, too.
FileLock::~FileLock() {
  [[maybe_unused]] const int ignored = ftruncate(fd_, 0);  // the content says nothing once the lock is gone
  struct flock none = WholeFile(F_UNLCK);
  fcntl(fd_, F_OFD_SETLK, &none);
  close(fd_);
}

InputLock::InputLock(const fs::path& results)
    : FileLock(results / ".inputs.lock", "project " + results.parent_path().string(), "trigpoint status",
               kInputPatience_s) {}

BatchLock::BatchLock(const fs::path& folder)
    : FileLock(folder / ".lock", "batch " + folder.string(), "trigpoint batch status", 0) {}

std::optional<LockHolder> BatchLock::Holder(const fs::path& folder) { return HolderOf(folder / ".lock"); }

TaskLock::TaskLock(const fs::path& results, const std::string& result, double patience_s) {
  const fs::path project_file = results / ".lock", file = FileOfResult(results, result);
  const LockHolder holder{HostName(), getpid(), UserName(), UtcTimeText(), result};
  project_fd_ = OpenLocked(project_file, F_RDLCK, patience_s);
  if (project_fd_ < 0) ThrowProjectInUse(results, project_file);
  try {
    result_fd_ = OpenLocked(file, F_WRLCK, patience_s);
    if (result_fd_ < 0) ThrowProjectInUse(results, file);
    WriteHolder(result_fd_, file, holder);
    WriteHolder(project_fd_, project_file, holder);  // one of those who hold it together is named
  } catch (const IoError&) {
    if (result_fd_ >= 0) close(result_fd_);
    close(project_fd_);
    throw;
  }
  RecoverResult(results / result);
}

TaskLock::~TaskLock() {
  close(result_fd_);
  close(project_fd_);
}

bool TaskLock::IsHeld(const fs::path& results, const std::string& result) {
  return HolderOf(FileOfResult(results, result)).has_value();
}

}  // namespace trigpoint
