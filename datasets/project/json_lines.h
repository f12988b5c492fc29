// A file of JSON documents, one a line, that grows: a kill loses the line in hand.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>

namespace trigpoint {

class JsonLines {
 public:
  // The first line is `identity`: a file that begins with another one is begun anew. A line that a kill cut off is
  // removed. Throws IoError.
  JsonLines(std::filesystem::path file, const nlohmann::json& identity);
  // Calls `use` for each line that was added since the last call, by whatever process; a line that is no JSON, or that
  // `use` finds to be another (nlohmann::json::exception), is passed over.
  void Read(const std::function<void(const nlohmann::json&)>& use);
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  int64_t read_to_ = 0;
};

// Adds lines to such a file. Thread safe.
class JsonAppender {
 public:
  explicit JsonAppender(const std::filesystem::path& file);  // throws IoError
  JsonAppender(const JsonAppender&) = delete;
  JsonAppender& operator=(const JsonAppender&) = delete;
  ~JsonAppender();
  void Add(const nlohmann::json& line);  // throws IoError

 private:
  std::filesystem::path file_;
  int fd_ = -1;
  std::mutex mutex_;
};

}  // namespace trigpoint
