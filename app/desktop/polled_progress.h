// How far work in another thread is, for a window that looks now and then; and a way to cancel it.
#pragma once

#include <QString>
#include <mutex>

#include "calib/base/progress.h"

namespace trigpoint {

class PolledProgress final : public ProgressSink {
 public:
  void Begin(std::string_view task, int64_t total) override {
    const std::lock_guard guard(mutex_);
    task_ = QString::fromUtf8(task.data(), static_cast<int>(task.size()));
    total_ = total, done_ = 0;
  }
  void Advance(int64_t steps) override {
    const std::lock_guard guard(mutex_);
    done_ += steps;
  }
  QString Text() {
    const std::lock_guard guard(mutex_);
    return total_ > 0 ? QString("%1: %2 / %3").arg(task_).arg(done_).arg(total_) : task_;
  }

  CancelToken cancel;

 private:
  std::mutex mutex_;
  QString task_;
  int64_t total_ = 0, done_ = 0;
};

}  // namespace trigpoint
