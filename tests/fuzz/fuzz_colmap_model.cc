// Input: files one after the other, each "name\0length(4 bytes)bytes"; what doesn't parse so is taken as one binary
// file each way round.
#include <cstring>

#include "datasets/colmap/model.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::map<std::string, std::string> files;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  for (size_t at = 0; at < bytes.size();) {
    const size_t end = bytes.find('\0', at);
    if (end == std::string::npos || bytes.size() - end < 5) break;
    uint32_t length = 0;
    std::memcpy(&length, bytes.data() + end + 1, sizeof length);
    const std::string content = bytes.substr(end + 5, length);
    files[bytes.substr(at, end - at)] = content;
    at = end + 5 + content.size();
  }
  try {
    trigpoint::ParseColmapModel(files, "model");
  } catch (const trigpoint::Error& e) {
    trigpoint::ExpectOneSentence(e);
  }
  return 0;
}
