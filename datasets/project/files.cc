#include "datasets/project/files.h"

#include <fcntl.h>
#include <pwd.h>
#include <stdio.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <vector>

#include "datasets/io/capture_date.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;

IoError IoErrorFor(const fs::path& file, std::string_view done, int error_number) {
  std::string text = file.string() + ": cannot be " + std::string(done) + ": " + std::strerror(error_number);
  switch (error_number) {
    case ENOSPC:
    case EDQUOT: text += "; free some space on that disk and run the same command again"; break;
    case EFBIG: text += "; raise the limit of a file's size (ulimit -f)"; break;
    case EROFS:
    case EACCES:
    case EPERM: text += "; make the place writable or work in a copy of the project"; break;
    default: break;
  }
  return IoError(text);
}

void ReplaceFolder(const fs::path& fresh, const fs::path& target) {
  std::error_code ignored;
  if (rename(fresh.c_str(), target.c_str()) == 0) return;  // nothing was there, or an empty folder
  if (renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) {
    fs::remove_all(fresh, ignored);  // if this is cut short, RecoverFolder does the rest
    return;
  }
  const fs::path old = target.parent_path() / (std::string(kReplacedPrefix) + target.filename().string());
  fs::remove_all(old, ignored);
  if (rename(target.c_str(), old.c_str()) != 0 || rename(fresh.c_str(), target.c_str()) != 0) {
    throw IoErrorFor(target, "replaced", errno);
  }
  fs::remove_all(old, ignored);
}

void RecoverFolder(const fs::path& folder) {
  std::error_code ignored;
  std::vector<fs::path> leftovers;
  for (fs::directory_iterator it(folder, ignored), end; it != end; it.increment(ignored)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with(kTemporaryPrefix) || name.starts_with(kReplacedPrefix)) leftovers.push_back(it->path());
  }
  for (const fs::path& path : leftovers) {
    const std::string name = path.filename().string();
    const fs::path target = folder / name.substr(kReplacedPrefix.size());
    if (name.starts_with(kReplacedPrefix) && !fs::exists(target, ignored)) {
      fs::rename(path, target, ignored);
    } else {
      fs::remove_all(path, ignored);
    }
  }
}

std::string RelativeTo(const fs::path& root, const fs::path& path) {
  const fs::path relative = path.lexically_normal().lexically_relative(root);
  if (relative.empty() || *relative.begin() == "..") return path.lexically_normal().generic_string();
  return relative.generic_string();
}

std::string DumpJson(const nlohmann::json& value, int indent) {
  return value.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

nlohmann::json ReadJsonOrNothing(const fs::path& file) {
  if (!fs::exists(file)) return nlohmann::json::object();
  nlohmann::json value = nlohmann::json::parse(ReadTextFile(file), nullptr, false);
  return value.is_object() ? value : nlohmann::json::object();
}

std::string UserName() {
  const passwd* entry = getpwuid(getuid());
  return entry != nullptr ? entry->pw_name : std::to_string(getuid());
}

std::string UtcTimeText() { return UtcOfSeconds(std::time(nullptr)); }

}  // namespace trigpoint
