#include "datasets/project/replaced.h"

#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;

fs::path ReplaceInputFile(const fs::path& dir, const std::string& name, const std::string& text) {
  const fs::path file = dir / name;
  fs::path kept;
  if (fs::exists(file)) {
    const std::string old = ReadTextFile(file);
    if (old == text) return {};
    const fs::path folder = dir / "results" / "replaced";
    kept = folder / (UtcTimeText() + "-" + name);
    for (int k = 2; fs::exists(kept); ++k) kept = folder / (UtcTimeText() + "-" + std::to_string(k) + "-" + name);
    WriteFileAtomically(kept, old);
  }
  WriteFileAtomically(file, text);
  return kept;
}

}  // namespace trigpoint
