#include "datasets/project/outputs.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <sstream>

#include "calib/base/error.h"
#include "datasets/io/site_inputs.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/hash.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kStagingPrefix = ".tmp-output-";

using OutputHashes = std::map<std::string, std::string>;  // by name relative to the folder

OutputHashes ReadOutputRecord(const fs::path& folder) {
  OutputHashes record;
  std::error_code ignored;
  if (!fs::is_regular_file(folder / kOutputRecord, ignored)) return record;
  std::istringstream text(ReadTextFile(folder / kOutputRecord));
  constexpr size_t kHash = 64, kName = 66;
  for (std::string line; std::getline(text, line);) {
    if (line.size() > kName) record[line.substr(kName)] = line.substr(0, kHash);
  }
  return record;
}

bool IsProjectFolder(const fs::path& dir) {
  std::error_code ignored;
  if (fs::is_regular_file(dir / "trigpoint.yaml", ignored)) return true;
  for (fs::directory_iterator it(dir / "runs", ignored), end; it != end; it.increment(ignored)) {
    for (const char* name : {"images.txt", "camchain.yaml", "detections.csv"}) {
      if (fs::exists(it->path() / name, ignored)) return true;
    }
  }
  return false;
}

// What killed processes left half-made.
void RemoveDeadStaging(const fs::path& folder) {
  std::error_code ignored;
  std::vector<fs::path> dead;
  for (fs::directory_iterator it(folder, ignored), end; it != end; it.increment(ignored)) {
    const std::string name = it->path().filename().string();
    if (!name.starts_with(kStagingPrefix)) continue;
    const auto pid = ParseInt(name.substr(kStagingPrefix.size()));
    if (pid && kill(static_cast<pid_t>(*pid), 0) != 0 && errno == ESRCH) dead.push_back(it->path());
  }
  for (const fs::path& path : dead) fs::remove_all(path, ignored);
}

std::vector<fs::path> StagedFiles(const fs::path& staging) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(staging)) {
    if (!entry.is_directory()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

void RequireOutputPlace(const fs::path& file) {
  std::error_code failure;
  fs::path place = fs::weakly_canonical(fs::absolute(file).parent_path(), failure) / file.filename();
  if (failure) place = fs::absolute(file).lexically_normal();
  for (fs::path dir = place.parent_path();; dir = dir.parent_path()) {
    if (IsProjectFolder(dir)) {
      const fs::path inside = place.lexically_relative(dir);
      if (IsInputPath(inside)) {
        throw InputError(file.string() + ": project " + dir.string() +
                         " reads its input there; expected another place, such as " +
                         (dir / "results/export" / file.filename()).string());
      }
      const auto below = std::next(inside.begin());
      if (*inside.begin() == "results" && (below == inside.end() || *below != "export")) {
        throw InputError(file.string() + ": the folder belongs to the stages of project " + dir.string() +
                         "; expected another place, such as " + (dir / "results/export" / file.filename()).string());
      }
    }
    if (dir == dir.parent_path()) return;
  }
}

OutputFiles::OutputFiles(fs::path folder, bool force)
    : folder_(fs::absolute(folder).lexically_normal()), force_(force) {
  std::error_code failure;
  made_folder_ = !fs::exists(folder_, failure);
  staging_ = folder_ / (std::string(kStagingPrefix) + std::to_string(getpid()));
  RemoveDeadStaging(folder_);
  fs::create_directories(staging_, failure);
  if (failure) throw IoErrorFor(folder_, "written", failure.value());
}

OutputFiles::~OutputFiles() {
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  if (made_folder_ && fs::is_empty(folder_, ignored)) fs::remove(folder_, ignored);
}

fs::path OutputFiles::Final(const fs::path& staged) const { return folder_ / staged.lexically_relative(staging_); }

void OutputFiles::CheckReplaceable(const fs::path& file, const OutputHashes& record) const {
  RequireOutputPlace(file);
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(file, ignored);
  if (status.type() == fs::file_type::not_found) return;
  const auto own = record.find(file.lexically_relative(folder_).generic_string());
  if (own == record.end() || status.type() != fs::file_type::regular) {
    throw InputError(file.string() +
                     ": is there already and was not written by trigpoint; expected a new place: give another --out, "
                     "or move the file");
  }
  if (!force_ && Sha256OfFile(file) != own->second) {
    throw InputError(file.string() +
                     ": was written by trigpoint and changed since; give another --out, or --force to replace it");
  }
}

std::vector<fs::path> OutputFiles::Publish() {
  OutputHashes record = ReadOutputRecord(folder_);
  const std::vector<fs::path> staged = StagedFiles(staging_);
  std::vector<fs::path> files;
  for (const fs::path& from : staged) {
    files.push_back(Final(from));
    CheckReplaceable(files.back(), record);
    record[files.back().lexically_relative(folder_).generic_string()] = Sha256OfFile(from);
  }
  // Recorded first: whatever moment this ends at, each file is the old one or the new one, and the record knows it
  // by name.
  std::string text;
  for (const auto& [name, hash] : record) text += hash + "  " + name + "\n";
  if (!staged.empty()) WriteFileAtomically(folder_ / kOutputRecord, text);
  for (size_t i = 0; i < staged.size(); ++i) {
    std::error_code failure;
    fs::create_directories(files[i].parent_path(), failure);
    if (!failure) fs::rename(staged[i], files[i], failure);
    if (failure) throw IoErrorFor(files[i], "written", failure.value());
  }
  return files;
}

}  // namespace trigpoint
