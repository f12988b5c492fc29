// Progress, messages and tables on a terminal.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "calib/base/progress.h"

namespace trigpoint {

// "debug", "info", "warning", "error"; throws OptionError.
LogLevel LogLevelNamed(const std::string& name);

// Messages on standard error; where that is a terminal, a progress line with the time left is kept below them.
class Terminal final : public ProgressSink {
 public:
  Terminal(LogLevel level, bool quiet);
  ~Terminal() override;
  void Begin(std::string_view task, int64_t total) override;
  void Advance(int64_t steps) override;
  void Log(LogLevel level, std::string_view text) override;
  // A line of its own, whatever the level; not with --quiet.
  void Say(const std::string& text);
  // What stands before the task in the progress line.
  void SetTitle(const std::string& title);
  void ClearProgress();

 private:
  using Clock = std::chrono::steady_clock;
  void Line(const std::string& text);
  void Draw(bool force);

  LogLevel level_;
  bool quiet_;
  bool draws_;
  std::mutex mutex_;
  std::string title_, task_;
  int64_t total_ = 0, done_ = 0;
  Clock::time_point begun_, drawn_;
  bool drawn_any_ = false;
};

// "0:12", "1:02:03".
std::string DurationText(double seconds);
// "12 s", "5 min", "3 h", "2 days".
std::string AgeText(double seconds);

// Columns as wide as their widest cell; characters, not bytes, are counted. Numbers to the right.
std::string TableText(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows);

}  // namespace trigpoint
