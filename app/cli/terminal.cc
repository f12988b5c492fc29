#include "app/cli/terminal.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "datasets/io/readable.h"

namespace trigpoint {
namespace {

constexpr auto kRedraw = std::chrono::milliseconds(200);
constexpr auto kPlainLine = std::chrono::seconds(30);

size_t TerminalWidth() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

bool IsContinuation(char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; }

size_t Width(std::string_view text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) { return !IsContinuation(c); }));
}

std::string Cut(std::string text, size_t width) {
  size_t seen = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    if (!IsContinuation(text[i]) && ++seen > width) return text.substr(0, i);
  }
  return text;
}

// "0.17", "8 min", "12 of 14"; not a sentence that begins with a number.
bool LooksLikeNumber(const std::string& text) {
  return !text.empty() && std::count(text.begin(), text.end(), ' ') <= 2 &&
         (std::isdigit(static_cast<unsigned char>(text.front())) != 0 || (text.size() > 1 && text.front() == '-'));
}

}  // namespace

LogLevel LogLevelNamed(const std::string& name) {
  if (name == "debug") return LogLevel::kDebug;
  if (name == "info") return LogLevel::kInfo;
  if (name == "warning") return LogLevel::kWarning;
  if (name == "error") return LogLevel::kError;
  throw OptionError("unknown log level '" + name + "'; expected debug, info, warning or error");
}

void Messages::Add(LogLevel level, const std::string& text) {
  const std::lock_guard guard(mutex_);
  said_.emplace_back(level, text);
}

std::vector<std::pair<LogLevel, std::string>> Messages::said() const {
  const std::lock_guard guard(mutex_);
  return said_;
}

Terminal::Terminal(LogLevel level, bool quiet, std::shared_ptr<Messages> messages, bool holds_warnings)
    : level_(level),
      quiet_(quiet),
      draws_(!quiet && isatty(STDERR_FILENO) == 1),
      holds_warnings_(holds_warnings),
      messages_(std::move(messages)) {}

Terminal::~Terminal() { ClearProgress(); }

void Terminal::Begin(std::string_view task, int64_t total) {
  const std::lock_guard guard(mutex_);
  task_ = task;
  total_ = total;
  done_ = 0;
  begun_ = Clock::now();
  Draw(true);
}

void Terminal::Advance(int64_t steps) {
  const std::lock_guard guard(mutex_);
  done_ += steps;
  Draw(false);
}

void Terminal::Log(LogLevel level, std::string_view text) {
  static constexpr const char* kPrefixes[] = {"debug: ", "", "warning: ", "error: "};
  if (level < level_ || (quiet_ && level < LogLevel::kError)) return;
  const std::lock_guard guard(mutex_);
  const std::string shown = level >= LogLevel::kWarning ? WithExcerpts(text) : std::string(text);
  const std::string titled = title_.empty() ? shown : title_ + ": " + shown;
  if (level >= LogLevel::kWarning) messages_->Add(level, titled);
  if (level == LogLevel::kWarning && holds_warnings_) return;
  Line(kPrefixes[static_cast<size_t>(level)] + titled);
}

void Terminal::Say(const std::string& text) {
  if (quiet_) return;
  const std::lock_guard guard(mutex_);
  Line(text);
}

void Terminal::SetTitle(const std::string& title) {
  const std::lock_guard guard(mutex_);
  title_ = title;
  task_.clear();
  total_ = done_ = 0;
}

void Terminal::ClearProgress() {
  const std::lock_guard guard(mutex_);
  if (drawn_any_) std::fputs("\r\033[K", stderr);
  drawn_any_ = false;
}

void Terminal::Line(const std::string& text) {
  if (drawn_any_) std::fputs("\r\033[K", stderr);
  drawn_any_ = false;
  std::fputs((text + "\n").c_str(), stderr);
}

std::string Terminal::ProgressText(Clock::time_point now) const {
  std::string text = title_.empty() ? task_ : title_ + ": " + task_;
  if (total_ > 0) {
    const double share = std::min(1.0, static_cast<double>(done_) / static_cast<double>(total_));
    text += fmt::format("  {}/{}  {:.0f} %", done_, total_, 100 * share);
    const double seconds = std::chrono::duration<double>(now - begun_).count();
    if (seconds > 1 && share > 0) text += fmt::format("  {} left", DurationText(seconds * (1 - share) / share));
  } else if (done_ > 0) {
    text += fmt::format("  {}", done_);
  }
  return text;
}

void Terminal::Draw(bool force) {
  const Clock::time_point now = Clock::now();
  if (!draws_) {  // a log file gets a line now and then
    if (quiet_ || now - written_ < kPlainLine) return;
    written_ = now;
    std::fputs((ProgressText(now) + "\n").c_str(), stderr);
    return;
  }
  if (!force && now - drawn_ < kRedraw) return;
  drawn_ = now;
  std::fputs(fmt::format("\r{}\033[K", Cut(ProgressText(now), TerminalWidth() - 1)).c_str(), stderr);
  std::fflush(stderr);
  drawn_any_ = true;
}

std::string DurationText(double seconds) {
  const auto s = static_cast<int64_t>(std::llround(std::max(0.0, seconds)));
  if (s < 3600) return fmt::format("{}:{:02}", s / 60, s % 60);
  return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

std::string AgeText(double seconds) {
  if (seconds < 120) return fmt::format("{:.0f} s", std::max(0.0, seconds));
  if (seconds < 7200) return fmt::format("{:.0f} min", seconds / 60);
  if (seconds < 2 * 86400) return fmt::format("{:.0f} h", seconds / 3600);
  return fmt::format("{:.0f} days", seconds / 86400);
}

std::string TableText(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows) {
  std::vector<size_t> widths;
  for (const std::string& cell : header) widths.push_back(Width(cell));
  for (const auto& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], Width(row[i]));
  }
  std::string text;
  const auto add = [&](const std::vector<std::string>& row) {
    std::string line;
    for (size_t i = 0; i < row.size(); ++i) {
      const std::string fill(widths[i] - Width(row[i]), ' ');
      line += (i > 0 ? "  " : "") + (LooksLikeNumber(row[i]) ? fill + row[i] : row[i] + fill);
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  };
  add(header);
  for (const auto& row : rows) add(row);
  return text;
}

}  // namespace trigpoint
