#include "datasets/project/release_files.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/base/parallel.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/hash.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr uintmax_t kLargestRecord = 256'000'000;  // bytes; a project of a million inputs has half of it
constexpr const char* kOwnHash = "sha256";

[[noreturn]] void ThrowDamaged(const fs::path& file, const std::string& what) {
  throw InputError(file.string() + ": " + what + "; the release is damaged or was not written by trigpoint publish: " +
                   "get it again from where it came from");
}

bool IsHash(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

ReleaseFile ReadEntry(const fs::path& file, const std::string& path, const json& value) {
  if (!StaysInside(path)) ThrowDamaged(file, "file '" + CleanPath(path) + "' leaves the release");
  ReleaseFile entry;
  const json* hash = &value;
  if (value.is_object()) {
    const auto sha256 = value.find("sha256"), bytes = value.find("bytes");
    if (sha256 == value.end() || bytes == value.end() || !bytes->is_number_unsigned()) {
      ThrowDamaged(file, "file '" + path + "': expected sha256 and bytes");
    }
    hash = &*sha256;
    entry.bytes = bytes->get<uintmax_t>();
  }
  if (!hash->is_string() || !IsHash(hash->get<std::string>())) {
    ThrowDamaged(file, "file '" + path + "': expected a SHA-256 of 64 hexadecimal digits");
  }
  entry.sha256 = hash->get<std::string>();
  return entry;
}

bool IsOfRelease(const std::string& path) {
  return path == kReleaseRecord || path == kSshSignature || path == kGpgSignature;
}

}  // namespace

std::string CleanPath(const std::string& path) {
  std::string text = path.substr(0, 200);
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';
  }
  return text;
}

bool StaysInside(const std::string& path) {
  if (path.empty() || path.size() > 4096 || path.front() == '/' || path.back() == '/') return false;
  for (const char c : path) {
    if (static_cast<unsigned char>(c) < 32 || c == 127) return false;
  }
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view part = std::string_view(path).substr(begin, end - begin);
    if (part.empty() || part == "." || part == ".." || part.size() > 255) return false;
    begin = end + 1;
  }
  return true;
}

std::optional<fs::path> PlainFile(const fs::path& folder, const std::string& path) {
  fs::path at = folder;
  std::error_code failure;
  for (const fs::path& part : fs::path(path)) {
    at /= part;
    const fs::file_status status = fs::symlink_status(at, failure);
    if (failure || fs::is_symlink(status)) return std::nullopt;
  }
  return fs::is_regular_file(fs::symlink_status(at, failure)) ? std::optional<fs::path>(at) : std::nullopt;
}

ReleaseRecord ReadReleaseRecord(const fs::path& release) {
  const fs::path file = release / kReleaseRecord;
  std::error_code failure;
  const fs::file_status status = fs::symlink_status(file, failure);
  if (!fs::exists(status)) {
    throw InputError(release.string() + ": expected a release (a folder with release.json), found none; `trigpoint " +
                     "publish` makes one");
  }
  if (!fs::is_regular_file(status)) ThrowDamaged(file, "expected a regular file, found a link or something else");
  if (const uintmax_t bytes = fs::file_size(file, failure); failure || bytes > kLargestRecord) {
    ThrowDamaged(file, fmt::format("expected at most {} bytes, found {}", kLargestRecord, bytes));
  }
  ReleaseRecord record;
  record.json = json::parse(ReadTextFile(file), nullptr, false);
  json& j = record.json;
  if (!j.is_object()) ThrowDamaged(file, "expected a JSON object");
  const std::string schema = j.contains("schema") && j["schema"].is_string() ? j["schema"].get<std::string>() : "";
  if (schema != "trigpoint release 1" && schema != "trigpoint release 2") {
    ThrowDamaged(file, "expected schema 'trigpoint release 2', found '" + CleanPath(schema) + "'");
  }
  const std::pair<const char*, json::value_t> members[] = {
      {"name", json::value_t::string},      {"project", json::value_t::string}, {"variant", json::value_t::string},
      {"folder", json::value_t::string},    {"map", json::value_t::object},     {"published", json::value_t::string},
      {"stages", json::value_t::object},    {"inputs", json::value_t::object},  {"certificate", json::value_t::object},
      {"signature", json::value_t::string}, {"program", json::value_t::object}};
  for (const auto& [name, type] : members) {
    if (j.contains(name) && j[name].type() != type) {
      ThrowDamaged(file, fmt::format("'{}': expected another kind of value", name));
    }
  }
  if (!j.contains("files") || !j["files"].is_object()) ThrowDamaged(file, "expected the list 'files'");
  for (const auto& [path, value] : j["files"].items()) record.files[path] = ReadEntry(file, path, value);
  if (j.contains(kOwnHash)) {
    const json own = j[kOwnHash];
    j.erase(kOwnHash);
    record.damaged = own != Sha256(DumpJson(j));
  } else {
    record.damaged = schema != "trigpoint release 1";
  }
  return record;
}

void WriteReleaseRecord(const fs::path& release, json record) {
  record.erase(kOwnHash);
  // What cannot be read back as it is (a file's name that is not UTF-8) must not be promised.
  for (const auto& [path, value] : record.at("files").items()) {
    if (!StaysInside(path) || DumpJson(json(path)) != json(path).dump(-1, ' ', false, json::error_handler_t::ignore)) {
      throw InputError("file '" + CleanPath(path) + "': its name cannot be kept in a release; rename it in UTF-8 " +
                       "without control characters");
    }
  }
  record[kOwnHash] = Sha256(DumpJson(record));
  WriteFileAtomically(release / kReleaseRecord, DumpJson(record, 2) + "\n");
}

ReleaseDifferences CompareRelease(const fs::path& release, const ReleaseRecord& record, int threads,
                                  const CancelToken& cancel) {
  ReleaseDifferences differences;
  std::vector<std::pair<std::string, fs::path>> same_size;
  std::error_code failure;
  const std::string signature = record.json.value("signature", "");
  if (!signature.empty() && !PlainFile(release, CleanPath(signature)))
    differences.missing.push_back(CleanPath(signature));
  for (const auto& [path, entry] : record.files) {
    if (!fs::exists(fs::symlink_status(release / path, failure))) {
      differences.missing.push_back(path);
      continue;
    }
    const std::optional<fs::path> file = PlainFile(release, path);
    if (!file) {
      differences.changed.push_back(path + ": expected a file, found a link or something else");
      continue;
    }
    const uintmax_t bytes = fs::file_size(*file, failure);
    if (entry.bytes && bytes != *entry.bytes) {
      differences.changed.push_back(fmt::format("{}: expected {} bytes, found {}", path, *entry.bytes, bytes));
      continue;
    }
    same_size.emplace_back(path, *file);
  }
  std::vector<char> same(same_size.size(), 0);
  ParallelFor(static_cast<int64_t>(same_size.size()), threads, cancel, [&](int64_t i) {
    const auto& [path, file] = same_size[static_cast<size_t>(i)];
    same[static_cast<size_t>(i)] = Sha256OfFile(file) == record.files.at(path).sha256 ? 1 : 0;
  });
  for (size_t i = 0; i < same_size.size(); ++i) {
    if (same[i] == 0) differences.changed.push_back(same_size[i].first + ": its content was changed");
  }
  std::sort(differences.changed.begin(), differences.changed.end());
  try {
    for (const auto& entry : fs::recursive_directory_iterator(release)) {
      if (entry.symlink_status().type() == fs::file_type::directory) continue;
      const std::string path = RelativeTo(release, entry.path());
      if (path == kReleaseRecord || path == signature) continue;
      // Whoever was asked may sign a release that came without a signature; one signature counts.
      if (IsOfRelease(path) && signature.empty()) continue;
      if (record.files.count(path) == 0) differences.added.push_back(CleanPath(path));
    }
  } catch (const fs::filesystem_error& e) {
    throw IoErrorFor(e.path1(), "read", e.code().value());
  }
  std::sort(differences.added.begin(), differences.added.end());
  return differences;
}

}  // namespace trigpoint
