#include "datasets/project/hash.h"

#include <openssl/evp.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <memory>
#include <sstream>
#include <vector>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

class Digest {
 public:
  Digest() : context_(EVP_MD_CTX_new()) {
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1) {
      throw Error("SHA-256 is not available in this machine's OpenSSL");
    }
  }
  void Add(const char* data, size_t size) { EVP_DigestUpdate(context_.get(), data, size); }
  std::string Hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> bytes{};
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), bytes.data(), &size);
    std::string hex;
    for (unsigned int i = 0; i < size; ++i) {
      hex += "0123456789abcdef"[bytes[i] >> 4];
      hex += "0123456789abcdef"[bytes[i] & 15];
    }
    return hex;
  }

 private:
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

}  // namespace

std::string Sha256(std::string_view text) {
  Digest digest;
  digest.Add(text.data(), text.size());
  return digest.Hex();
}

std::string Sha256OfFile(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoErrorFor(file, "read", errno);
  Digest digest;
  std::vector<char> buffer(1 << 20);
  do {
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    digest.Add(buffer.data(), static_cast<size_t>(in.gcount()));
  } while (in);
  if (in.bad()) throw IoErrorFor(file, "read", errno);
  return digest.Hex();
}

FileHashes::FileHashes(std::filesystem::path root, std::filesystem::path store)
    : root_(std::move(root)), store_(std::move(store)) {
  std::ifstream in(store_);
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream fields(line);
    Entry entry;
    std::string path;
    fields >> entry.sha256 >> entry.size >> entry.mtime_ns;
    if (fields.get() == ' ' && std::getline(fields, path) && entry.sha256.size() == 64) entries_[path] = entry;
  }
}

FileHashes::Entry FileHashes::StatusOf(const std::filesystem::path& file) {
  struct stat info {};
  if (stat(file.c_str(), &info) != 0) throw IoErrorFor(file, "read", errno);
  return {
      static_cast<uintmax_t>(info.st_size), int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec, {}};
}

std::string FileHashes::Of(const std::filesystem::path& file) {
  Entry entry = StatusOf(file);
  {
    const std::lock_guard lock(mutex_);
    const auto it = entries_.find(RelativeTo(root_, file));
    if (it != entries_.end() && it->second.size == entry.size && it->second.mtime_ns == entry.mtime_ns) {
      return it->second.sha256;
    }
  }
  entry.sha256 = Sha256OfFile(file);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const int64_t now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  if (now_ns - entry.mtime_ns > 2'000'000'000) Keep(file, entry);
  return entry.sha256;
}

void FileHashes::Keep(const std::filesystem::path& file, const std::string& sha256) {
  Entry entry = StatusOf(file);
  entry.sha256 = sha256;
  Keep(file, entry);
}

void FileHashes::Keep(const std::filesystem::path& file, const Entry& entry) {
  const std::string key = RelativeTo(root_, file);
  if (key.find('\n') != std::string::npos) return;  // a line of the store holds one entry
  const std::lock_guard lock(mutex_);
  entries_[key] = entry;
  changed_ = true;
}

void FileHashes::Save() {
  const std::lock_guard lock(mutex_);
  if (!changed_) return;
  std::ostringstream text;
  for (const auto& [path, entry] : entries_) {
    text << entry.sha256 << ' ' << entry.size << ' ' << entry.mtime_ns << ' ' << path << '\n';
  }
  try {
    WriteFileAtomically(store_, text.str());
    changed_ = false;
  } catch (const IoError&) {  // only a cache: the next command computes the hashes again
  }
}

}  // namespace trigpoint
