// Progress, messages and tables on a terminal.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "calib/base/progress.h"

namespace trigpoint {

// "debug", "info", "warning", "error"; throws OptionError.
LogLevel LogLevelNamed(const std::string& name);

// Warnings and errors of a command, for its ending. Thread safe.
class Messages {
 public:
  void Add(LogLevel level, const std::string& text);
  std::vector<std::pair<LogLevel, std::string>> said() const;

 private:
  mutable std::mutex mutex_;
  std::vector<std::pair<LogLevel, std::string>> said_;
};

// Messages on standard error; where that is a terminal, a progress line with the time left is kept below them.
class Terminal final : public ProgressSink {
 public:
  // `holds_warnings`: they are kept in `messages` alone, for the ending to show.
  Terminal(LogLevel level, bool quiet, std::shared_ptr<Messages> messages = std::make_shared<Messages>(),
           bool holds_warnings = false);
  ~Terminal() override;
  void Begin(std::string_view task, int64_t total) override;
  void Advance(int64_t steps) override;
  void Log(LogLevel level, std::string_view text) override;
  // A line of its own, whatever the level; not with --quiet.
  void Say(const std::string& text);
  // What stands before the task in the progress line.
  void SetTitle(const std::string& title);
  void ClearProgress();
  bool draws() const { return draws_; }  // there is a progress line

 private:
  using Clock = std::chrono::steady_clock;
  void Line(const std::string& text);
  void Draw(bool force);
  std::string ProgressText(Clock::time_point now) const;

  LogLevel level_;
  bool quiet_;
  bool draws_, holds_warnings_;
  std::shared_ptr<Messages> messages_;
  std::mutex mutex_;
  std::string title_, task_;
  int64_t total_ = 0, done_ = 0;
  Clock::time_point begun_, drawn_, written_ = Clock::now();
  bool drawn_any_ = false;
};

// "0:12", "1:02:03".
std::string DurationText(double seconds);
// "12 s", "5 min", "3 h", "2 days".
std::string AgeText(double seconds);

// Columns as wide as their widest cell; characters, not bytes, are counted. Numbers to the right.
std::string TableText(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows);

}  // namespace trigpoint
