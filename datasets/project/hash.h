// SHA-256 of texts and files (OpenSSL), and a cache of file hashes, so that large inputs are read once.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

namespace trigpoint {

// 64 lower-case hexadecimal digits.
std::string Sha256(std::string_view text);
// Throws IoError naming the file.
std::string Sha256OfFile(const std::filesystem::path& file);

// Hashes of files by path, size and modification time. Thread safe. A file that `Of` finds changed within the last two
// seconds is hashed again next time, since a later change could leave size and time as they are.
class FileHashes {
 public:
  // `root`: paths below it are stored relative to it, so that a folder can be moved. Loads `store` if it is there; a
  // store that cannot be read counts as empty.
  FileHashes(std::filesystem::path root, std::filesystem::path store);

  // Throws IoError naming the file.
  std::string Of(const std::filesystem::path& file);
  // For a file that was just written with a known content.
  void Keep(const std::filesystem::path& file, const std::string& sha256);
  // Writes the store if something was added. Without a place to write to, the cache is just not kept.
  void Save();

 private:
  struct Entry {
    uintmax_t size = 0;
    int64_t mtime_ns = 0;
    std::string sha256;
  };
  static Entry StatusOf(const std::filesystem::path& file);
  void Keep(const std::filesystem::path& file, const Entry& entry);

  std::filesystem::path root_, store_;
  std::mutex mutex_;
  std::map<std::string, Entry> entries_;
  bool changed_ = false;
};

}  // namespace trigpoint
