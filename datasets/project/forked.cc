#include "datasets/project/forked.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <mutex>
#include <new>
#include <opencv2/core.hpp>
#include <sstream>
#include <system_error>

#include "calib/base/error.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

// What goes through the pipe: a kind, a number, and a text of a given length.
struct FrameHead {
  char kind = 0;
  int64_t number = 0;
  uint64_t size = 0;
};
constexpr char kBegin = 'B', kAdvance = 'A', kLog = 'L', kResult = 'R', kError = 'E', kNoMemory = 'M';
enum ErrorKind : int64_t { kOther, kInput, kOption, kIo, kNumeric };

class FrameWriter final : public ProgressSink {
 public:
  explicit FrameWriter(int fd) : fd_(fd) {}
  void Begin(std::string_view task, int64_t total) override { Write(kBegin, total, task); }
  void Advance(int64_t steps) override { Write(kAdvance, steps, ""); }
  void Log(LogLevel level, std::string_view text) override { Write(kLog, static_cast<int64_t>(level), text); }
  void Write(char kind, int64_t number, std::string_view text) {
    const std::lock_guard guard(mutex_);
    const FrameHead head{kind, number, text.size()};
    WriteAll(reinterpret_cast<const char*>(&head), sizeof head);
    WriteAll(text.data(), text.size());
  }

 private:
  void WriteAll(const char* data, size_t size) const {
    while (size > 0) {
      const ssize_t written = write(fd_, data, size);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) _exit(1);  // nobody listens any more
      data += written;
      size -= static_cast<size_t>(written);
    }
  }

  int fd_;
  std::mutex mutex_;
};

ErrorKind KindOf(const Error& error) {
  if (dynamic_cast<const InputError*>(&error) != nullptr) return kInput;
  if (dynamic_cast<const OptionError*>(&error) != nullptr) return kOption;
  if (dynamic_cast<const IoError*>(&error) != nullptr) return kIo;
  if (dynamic_cast<const NumericError*>(&error) != nullptr) return kNumeric;
  return kOther;
}

[[noreturn]] void ThrowAs(int64_t kind, const std::string& text) {
  switch (kind) {
    case kInput: throw InputError(text);
    case kOption: throw OptionError(text);
    case kIo: throw IoError(text);
    case kNumeric: throw NumericError(text);
    default: throw Error(text);
  }
}

[[noreturn]] void RunInChild(const std::function<std::string(ProgressSink&)>& body, pid_t parent, int fd) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  std::signal(SIGINT, SIG_IGN);  // the parent ends us
  std::signal(SIGTERM, SIG_DFL);
  // The project's lock is an open file: kept open here, it would outlive the parent for a moment.
  constexpr int kPipe = 3;
  if (fd != kPipe && dup2(fd, kPipe) < 0) _exit(1);
  close_range(kPipe + 1, ~0U, 0);
  FrameWriter out(kPipe);
  out.Advance(0);  // it has started
  try {
    out.Write(kResult, 0, body(out));
  } catch (const Error& e) {
    out.Write(kError, KindOf(e), e.what());
  } catch (const std::exception& e) {
    if (OutOfMemory(e)) {
      out.Write(kNoMemory, 0, "");
    } else {
      out.Write(kError, kOther, std::string("unexpected error: ") + e.what());
    }
  }
  _exit(0);
}

// The child and the end of its pipe to read from. A lock that another thread holds during the fork stays locked in the
// child, and a library's handler may wait for it for ever (PROJ's does): a child that does not start is replaced.
std::pair<pid_t, int> Start(const std::string& what, const std::function<std::string(ProgressSink&)>& body) {
  constexpr int kAttempts = 10, kStart_ms = 3000;
  for (int attempt = 1;; ++attempt) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw IoErrorFor(what, "started", errno);
    const pid_t parent = getpid();
    const pid_t child = fork();
    if (child == 0) {
      close(ends[0]);
      RunInChild(body, parent, ends[1]);
    }
    const int fork_error = errno;
    close(ends[1]);
    if (child < 0) {
      close(ends[0]);
      throw IoErrorFor(what, "started", fork_error);
    }
    pollfd started{ends[0], POLLIN, 0};
    if (poll(&started, 1, kStart_ms) != 0 || attempt == kAttempts) return {child, ends[0]};
    kill(child, SIGKILL);
    while (waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
    }
    close(ends[0]);
  }
}

// Its processor time in clock ticks, all threads; nothing while it is ready to run, waits for a disk, or has ended.
std::optional<int64_t> TicksAsleep(pid_t process) {
  std::ifstream in("/proc/" + std::to_string(process) + "/stat");
  std::string line;
  std::getline(in, line);
  const size_t name_end = line.rfind(')');  // the name may hold blanks
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream fields(line.substr(name_end + 1));
  std::string state, skipped;
  fields >> state;
  for (int i = 0; i < 10; ++i) fields >> skipped;
  int64_t user = 0, system = 0;
  if (!(fields >> user >> system) || state != "S") return std::nullopt;
  return user + system;
}

}  // namespace

std::optional<std::string> OutOfMemory(const std::exception& error) {
  if (const auto* system = dynamic_cast<const std::system_error*>(&error);
      system != nullptr && system->code() == std::errc::resource_unavailable_try_again) {
    return "not enough memory for another thread, or too many threads are running; use fewer --threads";
  }
  const auto* opencv = dynamic_cast<const cv::Exception*>(&error);
  if (dynamic_cast<const std::bad_alloc*>(&error) == nullptr &&
      (opencv == nullptr || opencv->code != cv::Error::StsNoMem)) {
    return std::nullopt;
  }
  return "not enough memory; use fewer --threads or smaller images";
}

// The child's side of the conversation, read until it ends.
class ForkedTask::Listener {
 public:
  explicit Listener(int fd) : fd_(fd) {}
  ~Listener() { close(fd_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  bool IsReady(std::chrono::milliseconds patience) const {
    pollfd waiting{fd_, POLLIN, 0};
    return poll(&waiting, 1, static_cast<int>(patience.count())) > 0;
  }
  // False at the end.
  bool ReadSome(ProgressSink& progress) {
    char buffer[1 << 16];
    const ssize_t got = read(fd_, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) return true;
    if (got <= 0) return false;
    waiting_.append(buffer, static_cast<size_t>(got));
    size_t at = 0;
    FrameHead head;
    while (waiting_.size() - at >= sizeof head) {
      std::memcpy(&head, waiting_.data() + at, sizeof head);
      if (waiting_.size() - at - sizeof head < head.size) break;
      Take(progress, head, waiting_.substr(at + sizeof head, head.size));
      at += sizeof head + head.size;
    }
    waiting_.erase(0, at);
    return true;
  }
  char end() const { return end_; }  // kind of the last frame, 0 without one
  int64_t error_kind() const { return error_kind_; }
  std::string& text() { return text_; }

 private:
  void Take(ProgressSink& progress, const FrameHead& head, std::string text) {
    switch (head.kind) {
      case kBegin: progress.Begin(text, head.number); break;
      case kAdvance: progress.Advance(head.number); break;
      case kLog: progress.Log(static_cast<LogLevel>(head.number), text); break;
      default:
        end_ = head.kind;
        error_kind_ = head.number;
        text_ = std::move(text);
    }
  }

  int fd_;
  std::string waiting_, text_;
  char end_ = 0;
  int64_t error_kind_ = 0;
};

ForkedTask::ForkedTask(std::string what, Body body, std::chrono::milliseconds stuck)
    : what_(std::move(what)), body_(std::move(body)), stuck_(stuck) {
  Begin();
}

ForkedTask::~ForkedTask() {
  if (child_ >= 0) End();
}

void ForkedTask::Begin() {
  const auto [child, answers] = Start(what_, body_);
  child_ = child;
  listener_ = std::make_unique<Listener>(answers);
  ticks_asleep_.reset();
  changed_ = std::chrono::steady_clock::now();
  ++attempts_;
}

void ForkedTask::End() {
  Kill();
  while (waitpid(child_, nullptr, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
}

bool ForkedTask::IsStuck() {
  const std::optional<int64_t> ticks = TicksAsleep(child_);
  const auto now = std::chrono::steady_clock::now();
  if (!ticks || ticks != ticks_asleep_) changed_ = now;
  ticks_asleep_ = ticks;
  return now - changed_ > stuck_;
}

bool ForkedTask::Listen(ProgressSink& progress, std::chrono::milliseconds patience) {
  while (listener_->IsReady(patience)) {
    if (!listener_->ReadSome(progress)) return true;
    patience = std::chrono::milliseconds(0);
  }
  constexpr int kAttempts = 5;
  if (attempts_ < kAttempts && IsStuck()) {
    End();
    Begin();
  }
  return false;
}

void ForkedTask::Kill() { kill(child_, SIGKILL); }

ForkedResult ForkedTask::Take() {
  int status = 0;
  rusage usage{};
  while (wait4(child_, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  child_ = -1;
  if (listener_->end() == kError) ThrowAs(listener_->error_kind(), listener_->text());
  if (listener_->end() == kNoMemory) throw std::bad_alloc();
  if (listener_->end() != kResult) {
    const std::string end = WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "without a result";
    throw MemoryError(
        what_ + ": its process ended (" + end +
        "), most likely for lack of memory; use fewer --threads, smaller images, or a machine with more memory");
  }
  return {std::move(listener_->text()), static_cast<int64_t>(usage.ru_maxrss) * 1024};
}

ForkedResult RunForked(const std::string& what, const ForkedTask::Body& body, ProgressSink& progress,
                       const CancelToken& cancel, std::chrono::milliseconds stuck) {
  ForkedTask task(what, body, stuck);
  constexpr std::chrono::milliseconds kPoll(50);
  while (!task.Listen(progress, kPoll)) {
    if (cancel.IsCancelled()) task.Kill();
  }
  cancel.ThrowIfCancelled();
  return task.Take();
}

}  // namespace trigpoint
