// What fuzz targets share.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "calib/base/error.h"

namespace trigpoint {

// A refusal must be one sentence.
inline void ExpectOneSentence(const Error& e) {
  const std::string text = e.what();
  if (text.empty() || text.find('\n') != std::string::npos) std::abort();
}

// A file with the input, in memory where there is such a place. `name` may begin with folders.
inline std::filesystem::path FuzzFile(const std::string& name, const uint8_t* data, size_t size) {
  const std::filesystem::path dir = std::filesystem::path(std::filesystem::exists("/dev/shm") ? "/dev/shm" : "/tmp") /
                                    ("trigpoint_fuzz_" + std::to_string(getpid()));
  std::filesystem::create_directories((dir / name).parent_path());
  std::ofstream(dir / name, std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  return dir / name;
}

}  // namespace trigpoint
