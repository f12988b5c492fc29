#include "app/cli/ending.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "datasets/io/lines.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLabelWidth = 10;
constexpr size_t kLeastProblems = 3;  // that are shown where facts compete with them for room

// A line break within a text would add a line that the limit of lines does not count.
std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::string Labelled(const std::string& label, const std::string& text) {
  return OneLine(label + std::string(label.size() < kLabelWidth ? kLabelWidth - label.size() : 1, ' ') + text);
}

// At most `room` of the lines; the last one counts those that are left out.
std::vector<std::string> Fitted(const std::vector<std::string>& lines, size_t room, const std::string& rest_in) {
  if (lines.size() <= room) return lines;
  if (room == 0) return {};
  std::vector<std::string> fitted(lines.begin(), lines.begin() + static_cast<ptrdiff_t>(room - 1));
  fitted.push_back(Labelled("And", fmt::format("{} more: {}", lines.size() - fitted.size(), rest_in)));
  return fitted;
}

}  // namespace

Ending& Ending::Headline(const std::string& text) {
  headline_ = text;
  return *this;
}

Ending& Ending::Fact(const std::string& label, const std::string& text) {
  facts_.push_back(Labelled(label, text));
  return *this;
}

Ending& Ending::Row(const std::string& text) {
  rows_.push_back(OneLine(text));
  return *this;
}

Ending& Ending::Rows(const std::string& text) {
  for (const std::string_view line : Lines(text)) {
    if (!line.empty()) Row(std::string(line));
  }
  return *this;
}

Ending& Ending::Problem(const std::string& label, const std::string& text) {
  std::string line = Labelled(label, text);
  if (std::find(problems_.begin(), problems_.end(), line) == problems_.end()) problems_.push_back(std::move(line));
  return *this;
}

Ending& Ending::Look(const std::string& label, const fs::path& path) {
  places_.push_back(Labelled(label, ShownPath(path)));
  return *this;
}

Ending& Ending::Next(const std::string& text) {
  next_ = Labelled("Next", text);
  return *this;
}

Ending& Ending::RestIn(const std::string& where) {
  rest_in_ = where;
  return *this;
}

std::string Ending::Text(size_t lines) const {
  const size_t fixed = (headline_.empty() ? 0 : 1) + places_.size() + (next_.empty() ? 0 : 1);
  size_t room = lines > fixed ? lines - fixed : 0;
  const size_t wanted = facts_.size() + rows_.size();
  // Problems may fill what the others leave, and have a few lines in any case.
  const size_t for_problems =
      std::min({problems_.size(), std::max(room > wanted ? room - wanted : 0, kLeastProblems), room});
  room -= for_problems;
  // One row of a table is of no use, so facts are kept before rows.
  const size_t for_facts = std::min(facts_.size(), room);
  room -= for_facts;

  std::vector<std::string> all;
  const auto add = [&](const std::vector<std::string>& some) { all.insert(all.end(), some.begin(), some.end()); };
  if (!headline_.empty()) all.push_back(OneLine(headline_));
  add(Fitted(facts_, for_facts, "--verbose"));
  add(Fitted(rows_, room, "--verbose"));
  add(Fitted(problems_, for_problems, rest_in_));
  add(places_);
  if (!next_.empty()) all.push_back(next_);
  std::string text;
  for (const std::string& line : all) text += line + "\n";
  return text;
}

std::string ShownPath(const fs::path& path) {
  std::error_code failure;
  const fs::path here = fs::current_path(failure);
  if (failure || here == here.root_path()) return path.string();
  const fs::path whole = fs::absolute(path, failure).lexically_normal();
  const fs::path below = whole.lexically_relative(here);
  return below.empty() || *below.begin() == ".." || failure ? path.string() : below.string();
}

std::string Capitalised(std::string text) {
  if (!text.empty()) text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text;
}

std::string TakenText(double seconds) {
  if (seconds < 10) return fmt::format("{:.1f} s", std::max(0.0, seconds));
  const auto s = static_cast<int64_t>(std::llround(seconds));
  if (s < 120) return fmt::format("{} s", s);
  if (s < 7200) return fmt::format("{} min {} s", s / 60, s % 60);
  return fmt::format("{} h {} min", s / 3600, s / 60 % 60);
}

}  // namespace trigpoint
