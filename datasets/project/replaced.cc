#include "datasets/project/replaced.h"

#include "datasets/io/kept_input.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;

fs::path ReplaceInputFile(const fs::path& dir, const std::string& name, const std::string& text) {
  const fs::path file = dir / name;
  fs::path kept;
  if (fs::exists(file)) {
    if (ReadTextFile(file) == text) return {};
    kept = KeepInputFile(dir, name);
  }
  WriteFileAtomically(file, text);
  return kept;
}

}  // namespace trigpoint
