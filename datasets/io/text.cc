#include "datasets/io/text.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>
#include <random>
#include <sstream>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

constexpr std::string_view kSpace = " \t\r\n\f\v";

size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

std::optional<int> Digits(std::string_view text, size_t at, size_t count) {
  if (at + count > text.size()) return std::nullopt;
  int value = 0;
  for (char c : text.substr(at, count)) {
    if (c < '0' || c > '9') return std::nullopt;
    value = 10 * value + (c - '0');
  }
  return value;
}

[[noreturn]] void ThrowWrite(const std::filesystem::path& file, int error) {
  throw IoError(file.string() + ": cannot be written: " + std::strerror(error));
}

template <typename Number>
std::optional<Number> ParseNumber(std::string_view text) {
  text = Trim(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  Number value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::string_view Trim(std::string_view text) {
  const size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

std::string LowerCase(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

std::string CommentLines(const std::vector<std::string>& comments) {
  std::string text;
  for (const std::string& comment : comments) text += "# " + comment + "\n";
  return text;
}

std::string LowerExtension(const std::filesystem::path& file) { return LowerCase(file.extension().string()); }

std::vector<std::string_view> SplitFields(std::string_view text) {
  std::vector<std::string_view> fields;
  for (size_t at = text.find_first_not_of(kSpace); at != std::string_view::npos;) {
    const size_t end = std::min(text.find_first_of(kSpace, at), text.size());
    fields.push_back(text.substr(at, end - at));
    at = text.find_first_not_of(kSpace, end);
  }
  return fields;
}

std::vector<std::string_view> SplitAt(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(Trim(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return parts;
}

std::optional<double> ParseDouble(std::string_view text) { return ParseNumber<double>(text); }

std::optional<int64_t> ParseInt(std::string_view text) { return ParseNumber<int64_t>(text); }

std::optional<int64_t> ParseUtcToNs(std::string_view text) {
  text = Trim(text);
  const auto year = Digits(text, 0, 4), month = Digits(text, 5, 2), day = Digits(text, 8, 2);
  if (!year || !month || !day || text[4] != '-' || text[7] != '-') return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(*year), std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok()) return std::nullopt;
  int64_t seconds = std::chrono::sys_days(date).time_since_epoch().count() * int64_t{86400};
  int64_t fraction_ns = 0;
  size_t at = 10;
  if (at < text.size()) {
    const auto hour = Digits(text, 11, 2), minute = Digits(text, 14, 2), second = Digits(text, 17, 2);
    if ((text[10] != 'T' && text[10] != ' ') || !hour || !minute || !second || text[13] != ':' || text[16] != ':' ||
        *hour > 24 || *minute > 59 || *second > 60) {
      return std::nullopt;
    }
    seconds += *hour * 3600 + *minute * 60 + *second;
    at = 19;
    if (at < text.size() && text[at] == '.') {
      int64_t unit = 100'000'000;
      for (++at; at < text.size() && text[at] >= '0' && text[at] <= '9'; ++at, unit /= 10) {
        fraction_ns += (text[at] - '0') * unit;
      }
    }
    std::string_view zone = text.substr(at);
    if (zone.size() == 6 && (zone[0] == '+' || zone[0] == '-') && zone[3] == ':') {
      const auto zone_hour = Digits(zone, 1, 2), zone_minute = Digits(zone, 4, 2);
      if (!zone_hour || !zone_minute) return std::nullopt;
      seconds -= (zone[0] == '-' ? -1 : 1) * (*zone_hour * 3600 + *zone_minute * 60);
    } else if (!zone.empty() && zone != "Z" && zone != "z") {
      return std::nullopt;
    }
  }
  constexpr int64_t kMost_s = std::numeric_limits<int64_t>::max() / 1'000'000'000 - 1;  // nanoseconds end in 2262
  if (std::abs(seconds) > kMost_s) return std::nullopt;
  return seconds * 1'000'000'000 + fraction_ns;
}

std::string NearestName(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  size_t best_distance = std::string_view::npos;
  for (const std::string& candidate : candidates) {
    const size_t distance = EditDistance(name, candidate);
    if (distance < best_distance) best = candidate, best_distance = distance;
  }
  return best;
}

std::string NearestHint(std::string_view name, const std::vector<std::string>& candidates, const std::string& nearest) {
  const std::string found = NearestName(name, candidates);
  return found.empty() ? "" : "; " + nearest + ": '" + found + "'";
}

std::string FileLine(const std::filesystem::path& file, int line) { return file.string() + ":" + std::to_string(line); }

std::filesystem::path ResolveInside(const std::filesystem::path& root, const std::filesystem::path& base,
                                    std::string_view written, const std::string& file) {
  const std::filesystem::path path{std::string(written)};
  const std::filesystem::path resolved = (std::filesystem::absolute(base) / path).lexically_normal();
  const std::filesystem::path inside =
      resolved.lexically_relative((std::filesystem::absolute(root) / "").lexically_normal());
  if (path.is_absolute() || inside.empty() || *inside.begin() == "..") {
    throw PathError(file + ": the path '" + std::string(written) + "' leaves the project " + root.string() +
                    "; expected a path relative to it that stays inside: copy or link the file into the project");
  }
  return resolved;
}

std::string ReadTextFile(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) {
    throw InputError(file.string() + (std::filesystem::is_directory(file) ? ": expected a file, found a folder"
                                      : std::filesystem::exists(file)     ? ": expected a file, found a device"
                                                                          : ": there is no such file"));
  }
  std::ifstream in(file, std::ios::binary);
  std::ostringstream content;
  content << in.rdbuf();
  if (!in.good() && !in.eof()) throw IoError(file.string() + ": cannot be read: " + std::strerror(errno));
  std::string text = std::move(content).str();
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  return text;
}

void WriteFileAtomically(const std::filesystem::path& file, std::string_view content) {
  static std::atomic<int> counter{0};
  // Machines that share a file system may number their processes alike.
  static const std::string kMachine = std::to_string(std::random_device{}());
  std::error_code made;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), made);
  if (made) ThrowWrite(file, made.value());
  std::string name(1, '.');
  name.append(file.filename().string()).append(".").append(kMachine).append("-").append(std::to_string(getpid()));
  name.append("-").append(std::to_string(counter++));
  const std::filesystem::path temporary = file.parent_path() / name;
  const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) ThrowWrite(file, errno);
  int error = 0;
  while (!content.empty() && error == 0) {
    const ssize_t written = write(fd, content.data(), content.size());
    if (written >= 0) {
      content.remove_prefix(static_cast<size_t>(written));
    } else if (errno != EINTR) {
      error = errno;
    }
  }
  if (error == 0 && fsync(fd) != 0) error = errno;
  if (close(fd) != 0 && error == 0) error = errno;
  if (error == 0 && rename(temporary.c_str(), file.c_str()) != 0) error = errno;
  if (error != 0) {
    unlink(temporary.c_str());
    ThrowWrite(file, error);
  }
}

std::string ShellWord(const std::string& word) {
  const std::string plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:@%+,";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace trigpoint
