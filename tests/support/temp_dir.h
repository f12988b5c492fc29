// A folder that is gone when the test ends, and what tests of readers look for.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "calib/base/error.h"

namespace trigpoint {

class TempDir {
 public:
  explicit TempDir(const std::string& prefix = "trigpoint_test_") {
    std::string name = (std::filesystem::temp_directory_path() / (prefix + "XXXXXX")).string();
    dir_ = mkdtemp(name.data());
  }
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(dir_, ignored);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  const std::filesystem::path& path() const { return dir_; }
  operator const std::filesystem::path&() const { return dir_; }  // NOLINT(google-explicit-constructor)
  std::string string() const { return dir_.string(); }
  std::filesystem::path operator/(const std::filesystem::path& name) const { return dir_ / name; }
  std::filesystem::path Write(const std::filesystem::path& name, const std::string& content) const {
    std::filesystem::create_directories((dir_ / name).parent_path());
    std::ofstream(dir_ / name, std::ios::binary) << content;
    return dir_ / name;
  }
  // "" if there is no such file.
  std::string Read(const std::filesystem::path& name) const {
    std::ostringstream text;
    text << std::ifstream(dir_ / name, std::ios::binary).rdbuf();
    return text.str();
  }

 private:
  std::filesystem::path dir_;
};

inline std::string Joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

// The message of the Error thrown, "" if none is.
template <typename Exception, typename Call>
std::string MessageOf(Call&& call) {
  try {
    call();
  } catch (const Exception& e) {
    return e.what();
  }
  return "";
}

}  // namespace trigpoint
