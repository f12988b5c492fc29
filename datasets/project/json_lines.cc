#include "datasets/project/json_lines.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>

#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;

JsonLines::JsonLines(fs::path file, const nlohmann::json& identity) : file_(std::move(file)) {
  const std::string first = DumpJson(identity) + "\n";
  std::string text;
  if (fs::exists(file_)) text = ReadTextFile(file_);
  if (!text.starts_with(first)) {
    WriteFileAtomically(file_, first);
  } else if (text.back() != '\n') {
    fs::resize_file(file_, text.rfind('\n') + 1);
  }
  read_to_ = static_cast<int64_t>(first.size());
}

void JsonLines::Read(const std::function<void(const nlohmann::json&)>& use) {
  std::ifstream in(file_, std::ios::binary);
  in.seekg(read_to_);
  for (std::string line; std::getline(in, line) && !in.eof();) {
    read_to_ += static_cast<int64_t>(line.size()) + 1;
    try {
      use(nlohmann::json::parse(line));
    } catch (const nlohmann::json::exception&) {  // what it was about is looked at again
    }
  }
}

JsonAppender::JsonAppender(const fs::path& file)
    : file_(file), fd_(open(file.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)) {
  if (fd_ < 0) throw IoErrorFor(file_, "written", errno);
}

JsonAppender::~JsonAppender() { close(fd_); }

void JsonAppender::Add(const nlohmann::json& line) {
  const std::string text = DumpJson(line) + "\n";
  const std::lock_guard guard(mutex_);
  if (write(fd_, text.data(), text.size()) != static_cast<ssize_t>(text.size())) {
    throw IoErrorFor(file_, "written", errno);
  }
}

}  // namespace trigpoint
