// One writer at a time in a project: results/.lock.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace trigpoint {

// Who writes, as the lock file says.
struct LockHolder {
  std::string host;
  int64_t process = 0;
  std::string user;
  std::string since;  // UTC
  std::string stage;  // the result being made, "localize/run1", or empty
};

// Held from construction to destruction. It is a lock of the kernel on an open file, so that it ends with its process
// however that ends: the lock of a dead holder needs no clearing. The file's content is only what others are told.
class ProjectLock {
 public:
  // Creates `results` if needed, and removes what killed processes left in it. Throws IoError naming the holder if
  // another one (also of this process) has it, or if `results` cannot be written.
  explicit ProjectLock(const std::filesystem::path& results);
  ~ProjectLock();
  ProjectLock(const ProjectLock&) = delete;
  ProjectLock& operator=(const ProjectLock&) = delete;

  // Says which result is being made (`status` shows it as running).
  void Announce(const std::string& stage);

  // Who holds the lock now; nothing if nobody does. Never creates or changes anything.
  static std::optional<LockHolder> Holder(const std::filesystem::path& results);

 private:
  std::filesystem::path file_;
  LockHolder holder_;
  int fd_ = -1;
};

// A file that is locked in the same way, for one at a time who needs nothing more.
class FileLock {
 public:
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 protected:
  // Waits for another holder up to `patience_s`; then throws IoError saying that `object` ("project /site") is in use,
  // by whom, and that the command `meanwhile` works all the same.
  FileLock(const std::filesystem::path& file, const std::string& object, const std::string& meanwhile,
           double patience_s);

 private:
  int fd_ = -1;
};

// One writer at a time of the input files that a command reads, changes and writes again: results/.inputs.lock. It is
// not the project's lock, so that a point can be marked while a run goes on.
class InputLock : public FileLock {
 public:
  // Waits for another writer; throws IoError naming it if that takes longer than a file takes to write.
  explicit InputLock(const std::filesystem::path& results);
};

// One process at a time that runs, submits or cancels the tasks of a batch: .lock in the batch's folder. The tasks
// themselves do not need it.
class BatchLock : public FileLock {
 public:
  // Creates `folder` if needed. Throws IoError naming the holder if another one (also of this process) has it.
  explicit BatchLock(const std::filesystem::path& folder);

  // Who holds the lock now; nothing if nobody does. Never creates or changes anything.
  static std::optional<LockHolder> Holder(const std::filesystem::path& folder);
};

}  // namespace trigpoint
