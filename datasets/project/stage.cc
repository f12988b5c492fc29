#include "datasets/project/stage.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>

#include "calib/base/cpu_seconds.h"
#include "calib/base/memory.h"
#include "calib/base/parallel.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/forked.h"
#include "datasets/project/kept.h"
#include "datasets/project/manifest.h"
#include "datasets/project/stage_task.h"
#include "datasets/project/task_lock.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// Of schema 1, older versions wrote manifests without a hash of themselves.
constexpr int kManifestSchema = 2, kSchemaWithoutHash = 1;
constexpr const char* kManifest = "manifest.json";
constexpr const char* kLog = "log.txt";
constexpr const char* kOwnHash = "sha256";
constexpr std::string_view kBeforePrefix = ".before-";  // the result before the last decision of the review

fs::path Beside(const fs::path& dir, std::string_view prefix) {
  return dir.parent_path() / (std::string(prefix) + dir.filename().string());
}

std::string Title(const std::string& stage, const std::string& name) {
  return name.empty() || name.front() == '@' ? stage + name : stage + "/" + name;
}

// False where the file system cannot.
bool Exchange(const fs::path& a, const fs::path& b) {
  return renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0;
}

// Whether the same computation was made with other decisions.
bool DiffersByDecisions(const json& one, const json& other) {
  const auto review = [](const json& m) { return m.value("values", json::object()).value("review", json()); };
  if (review(one) == review(other) || one.value("status", "") != "done") return false;
  for (const char* member : {"version", "options", "seed"}) {
    if (one.value(member, json()) != other.value(member, json())) return false;
  }
  return true;
}

// With a hash of itself, so that damage is noticed.
void WriteManifest(const fs::path& dir, json manifest) {
  manifest.erase(kOwnHash);
  manifest[kOwnHash] = Sha256(DumpJson(manifest));
  WriteFileAtomically(dir / kManifest, DumpJson(manifest, 2) + "\n");
}

// Has it a list of the result's files, each in its folder and with its hash?
bool HasFileHashes(const json& m) {
  const auto files = m.find("files");
  if (files == m.end() || !files->is_object()) return false;
  for (const auto& [file, hash] : files->items()) {
    const fs::path normal = fs::path(file).lexically_normal();
    if (normal.empty() || normal.is_absolute() || *normal.begin() == "..") return false;
    if (!hash.is_string() || hash.get_ref<const std::string&>().size() != Sha256("").size()) return false;
  }
  return true;
}

// Empty if it is as a stage writes it: its members of their types, with the hashes of its files and of itself.
std::string DamageOf(const json& m) {
  if (!m.is_object()) return "it is no JSON object";
  const json schema = m.value("schema", json());
  const bool old = schema == kSchemaWithoutHash;
  if (!old && schema != kManifestSchema)
    return fmt::format("its schema is {}, not {}", Excerpt(schema.dump()), kManifestSchema);
  const std::pair<const char*, json::value_t> members[] = {
      {"stage", json::value_t::string},   {"identity", json::value_t::string}, {"status", json::value_t::string},
      {"files", json::value_t::object},   {"metrics", json::value_t::object},  {"inputs", json::value_t::object},
      {"warnings", json::value_t::array}, {"end", json::value_t::string}};
  for (const auto& [name, type] : members) {
    if (m.contains(name) && m[name].type() != type) return fmt::format("its '{}' is of another type", name);
  }
  if (m.contains("version") && !m["version"].is_number_integer()) return "its 'version' is of another type";
  if (!old && !HasFileHashes(m)) return "it does not list the result's files, each with its SHA-256";
  const auto own = m.find(kOwnHash);
  if (own == m.end()) return old ? "" : "it has no SHA-256 of itself";
  json rest = m;
  rest.erase(kOwnHash);
  return *own == Sha256(DumpJson(rest)) ? "" : "it does not have the SHA-256 that it states";
}

// A manifest that is not there or damaged counts as none: its result is made again.
std::optional<json> ReadManifestIn(const fs::path& dir, std::string* damage = nullptr) {
  std::error_code ignored;
  if (!fs::is_regular_file(dir / kManifest, ignored)) return std::nullopt;
  json manifest = json::parse(ReadTextFile(dir / kManifest), nullptr, false);
  const std::string found = DamageOf(manifest);
  if (damage != nullptr) *damage = found;
  if (!found.empty()) return std::nullopt;
  manifest.erase(kOwnHash);
  return manifest;
}

// All regular files below a folder, in order, without half-made ones.
std::vector<fs::path> FilesBelow(const fs::path& dir) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(dir)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// What an earlier stage's result holds; its times and resources say nothing about that.
std::string ResultHash(const fs::path& manifest_file) {
  const std::optional<json> manifest = ReadManifestIn(manifest_file.parent_path());
  if (!manifest) return "missing";
  return Sha256(DumpJson({{"stage", manifest->value("stage", "")},
                          {"version", manifest->value("version", 0)},
                          {"files", manifest->value("files", json::object())}}));
}

// Hash of every input file, by its path relative to the project.
json HashInputs(const Project& project, const StageRequest& request, int threads, const CancelToken& cancel) {
  std::vector<fs::path> files;
  json hashes = json::object();
  for (const fs::path& input : request.inputs) {
    const fs::path path = input.is_absolute() ? input : project.dir() / input;
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) {
      const std::vector<fs::path> below = FilesBelow(path);
      files.insert(files.end(), below.begin(), below.end());
    } else if (!fs::exists(path, ignored)) {
      hashes[RelativeTo(project.dir(), path)] = "missing";
    } else if (path.filename() == kManifest) {
      hashes[RelativeTo(project.dir(), path)] = ResultHash(path);
    } else {
      files.push_back(path);
    }
  }
  std::vector<std::string> file_hashes(files.size());
  ParallelFor(static_cast<int64_t>(files.size()), threads, cancel, [&](int64_t i) {
    file_hashes[static_cast<size_t>(i)] = project.hashes().Of(files[static_cast<size_t>(i)]);
  });
  for (size_t i = 0; i < files.size(); ++i) hashes[RelativeTo(project.dir(), files[i])] = file_hashes[i];
  return hashes;
}

std::string Identity(const StageRequest& request, uint64_t seed, const json& inputs) {
  return Sha256(DumpJson({{"stage", request.stage},
                          {"version", request.version},
                          {"options", request.options},
                          {"values", request.values},
                          {"seed", seed},
                          {"inputs", inputs}}));
}

// Files of a result that are gone or no longer what was written.
std::vector<std::string> ChangedFiles(const Project& project, const json& manifest, const fs::path& dir) {
  std::vector<std::string> changed;
  const json files = manifest.value("files", json::object());
  for (const auto& [file, hash] : files.items()) {
    std::error_code ignored;
    if (!fs::exists(dir / file, ignored) || hash != project.hashes().Of(dir / file)) changed.push_back(file);
  }
  return changed;
}

// Files that somebody else put into a result's folder.
std::vector<std::string> ForeignFiles(const fs::path& dir, const json& manifest) {
  const json files = manifest.value("files", json::object());
  std::vector<std::string> foreign;
  for (const fs::path& file : FilesBelow(dir)) {
    const std::string name = RelativeTo(dir, file);
    if (name != kLog && name != kManifest && !files.contains(name)) foreign.push_back(name);
  }
  return foreign;
}

// They are carried over to the folder that replaces it.
void KeepForeignFiles(const fs::path& old, const fs::path& fresh) {
  const std::optional<json> manifest = ReadManifestIn(old);
  if (!manifest) return;
  for (const std::string& name : ForeignFiles(old, *manifest)) {
    if (fs::exists(fresh / name)) continue;
    fs::create_directories((fresh / name).parent_path());
    fs::copy_file(old / name, fresh / name);
  }
}

// A folder of the user's own at a result's place is never replaced.
void RequireResultFolder(const fs::path& dir) {
  std::error_code ignored;
  if (!fs::exists(dir, ignored) || fs::exists(dir / kManifest, ignored)) return;
  if (fs::is_directory(dir, ignored) && fs::is_empty(dir, ignored)) return;
  throw InputError(dir.string() +
                   ": expected a result with its manifest.json, found something that trigpoint did not "
                   "write; move it elsewhere");
}

// Made of the same, with success; its files may have changed since.
bool IsOf(const std::optional<json>& manifest, const std::string& identity) {
  return manifest && manifest->value("identity", "") == identity && manifest->value("status", "") == "done";
}

// CPU seconds of this process and of the programs it has run.
double CpuSeconds() {
  double seconds = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    seconds += CpuSecondsOf(usage);
  }
  return seconds;
}

// The kernel's high-water mark of this process' memory, since the last reset where it allows one.
void ResetPeakMemory() {
  ReturnFreeMemory();
  std::ofstream("/proc/self/clear_refs") << "5";
}

int64_t PeakMemoryBytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return ParseInt(SplitFields(line).at(1)).value_or(0) * 1024;
  }
  return 0;
}

// Writes log.txt, collects the warnings, and passes everything on.
class StageLog final : public ProgressSink {
 public:
  StageLog(const fs::path& file, ProgressSink& outer) : file_(file), out_(file), outer_(outer) {
    if (!out_) throw IoErrorFor(file_, "written", errno);
  }
  void Begin(std::string_view task, int64_t total) override {
    Write("task", task);
    outer_.Begin(task, total);
  }
  void Advance(int64_t steps) override { outer_.Advance(steps); }
  void Log(LogLevel level, std::string_view text) override {
    static constexpr const char* kNames[] = {"debug", "info", "warning", "error"};
    const std::string shown = level >= LogLevel::kWarning ? WithExcerpts(text) : std::string(text);
    Write(kNames[static_cast<size_t>(level)], shown);
    if (level == LogLevel::kWarning && !Count(shown)) return;
    outer_.Log(level, shown);
  }
  void Write(std::string_view kind, std::string_view text) {
    const std::lock_guard guard(mutex_);
    out_ << UtcTimeText() << ' ' << kind << ' ' << text << '\n' << std::flush;
  }
  // Each once, in the order of their first time.
  std::vector<std::string> warnings() const {
    std::vector<std::string> texts;
    for (const auto& [text, count] : warnings_) {
      texts.push_back(count > 1 ? fmt::format("{} ({} times)", text, count) : text);
    }
    return texts;
  }
  void Close() {
    out_.close();
    if (!out_) throw IoErrorFor(file_, "written", errno == 0 ? EIO : errno);
  }

 private:
  // Counts a warning; true the first time.
  bool Count(const std::string& text) {
    const std::lock_guard guard(mutex_);
    const auto [known, fresh] = known_.try_emplace(text, warnings_.size());
    if (fresh) warnings_.emplace_back(text, 0);
    ++warnings_[known->second].second;
    return fresh;
  }

  fs::path file_;
  std::ofstream out_;
  ProgressSink& outer_;
  std::mutex mutex_;
  std::vector<std::pair<std::string, int>> warnings_;
  std::map<std::string, size_t> known_;
};

// Writers deep inside a stage may not notice that their last block didn't fit.
void RequireSpaceLeft(const fs::path& dir) {
  std::error_code failure;
  const fs::space_info space = fs::space(dir, failure);
  if (!failure && space.available == 0) throw IoErrorFor(dir, "written", ENOSPC);
}

json HashOutputs(const fs::path& out, int threads, const CancelToken& cancel) {
  const std::vector<fs::path> files = FilesBelow(out);
  std::vector<std::string> hashes(files.size());
  ParallelFor(static_cast<int64_t>(files.size()), threads, cancel,
              [&](int64_t i) { hashes[static_cast<size_t>(i)] = Sha256OfFile(files[static_cast<size_t>(i)]); });
  json result = json::object();
  for (size_t i = 0; i < files.size(); ++i) {
    const std::string name = RelativeTo(out, files[i]);
    if (name != kLog) result[name] = hashes[i];
  }
  return result;
}

// Calls `body`, and turns what is not a trigpoint::Error into one.
void CallTranslated(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error&) {
    throw;
  } catch (const fs::filesystem_error& e) {
    throw IoErrorFor(e.path1(), "used", e.code().value());
  } catch (const std::exception& e) {
    if (const auto said = OutOfMemory(e)) throw MemoryError(*said);
    throw Error(std::string("unexpected error: ") + e.what());
  }
}

// The result that is asked for is there: an attempt that failed before is nothing to warn of any more.
void ForgetFailure(const fs::path& dir) {
  std::error_code failure;
  fs::remove_all(Beside(dir, kFailedPrefix), failure);
}

// Runs one request whose result is not up to date; the lock is held.
class Attempt {
 public:
  Attempt(const Project& project, const StageRequest& request, const json& manifest)
      : project_(project),
        request_(request),
        dir_(project.ResultDir(request.stage, request.name)),
        temporary_(Beside(dir_, kTemporaryPrefix)),
        manifest_(manifest) {}

  json Run(int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
    std::error_code failure;
    fs::remove_all(temporary_, failure);
    fs::create_directories(temporary_, failure);
    if (failure) throw IoErrorFor(temporary_, "created", failure.value());
    try {
      StageLog log(temporary_ / kLog, progress);
      const auto start = std::chrono::steady_clock::now();
      const double cpu_start = CpuSeconds();
      ResetPeakMemory();
      manifest_["start"] = UtcTimeText();
      const auto finish = [&](const char* status) {
        const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
        manifest_["end"] = UtcTimeText();
        manifest_["wall_seconds"] = wall.count();
        manifest_["cpu_seconds"] = CpuSeconds() - cpu_start;
        manifest_["peak_memory_bytes"] = PeakMemoryBytes();
        manifest_["warnings"] = log.warnings();
        manifest_["status"] = status;
      };
      try {
        CallTranslated([&] {
          StageContext context{project_, temporary_, threads, seed, log, cancel, manifest_["metrics"]};
          request_.body(context);
          cancel.ThrowIfCancelled();
          RequireSpaceLeft(temporary_);
          manifest_["files"] = HashOutputs(temporary_, threads, cancel);
        });
        finish("done");
        log.Write("done", fmt::format("in {:.1f} s", manifest_["wall_seconds"].get<double>()));
        log.Close();
      } catch (const Cancelled&) {
        throw;
      } catch (const Error& e) {
        finish("failed");
        manifest_["error"] = WithExcerpts(e.what());
        if (const auto* refused = dynamic_cast<const RefusedInput*>(&e))
          manifest_["refused"] = refused->what_is_refused;
        manifest_["metrics"] = json::object();
        log.Write("error", e.what());
        LeaveRecord();
        throw;
      }
      WriteManifest(temporary_, manifest_);
      CallTranslated([&] { KeepForeignFiles(dir_, temporary_); });
      PutInPlace();
    } catch (const Error&) {
      fs::remove_all(temporary_, failure);
      throw;
    }
    for (const auto& [file, hash] : manifest_["files"].items()) project_.hashes().Keep(dir_ / file, hash);
    project_.hashes().Save();
    ForgetFailure(dir_);
    return manifest_;
  }

 private:
  // What another decision replaces is kept: taken back, it is there at once.
  void PutInPlace() {
    const auto old = ReadManifestIn(dir_);
    if (!old || !DiffersByDecisions(*old, manifest_) || !Exchange(temporary_, dir_)) {
      return ReplaceFolder(temporary_, dir_);
    }
    ReplaceFolder(temporary_, Beside(dir_, kBeforePrefix));
  }

  // Only the manifest and the log of a failed attempt are kept. No room for them must not hide the error itself.
  void LeaveRecord() {
    std::error_code ignored;
    try {
      for (const auto& entry : fs::directory_iterator(temporary_)) {
        if (entry.path().filename() != kLog) fs::remove_all(entry.path(), ignored);
      }
      WriteManifest(temporary_, manifest_);
      ReplaceFolder(temporary_, Beside(dir_, kFailedPrefix));
    } catch (const std::exception&) {
      fs::remove_all(temporary_, ignored);
    }
  }

  const Project& project_;
  const StageRequest& request_;
  fs::path dir_, temporary_;
  json manifest_;
};

// The result before the last decision, in the place of the present one, if it is what is asked for. The present one is
// kept in turn.
std::optional<json> BringBack(const Project& project, const std::string& identity, const fs::path& dir) {
  const fs::path before = Beside(dir, kBeforePrefix);
  const auto manifest = ReadManifestIn(before);
  if (!IsOf(manifest, identity) || !ChangedFiles(project, *manifest, before).empty()) return std::nullopt;
  KeepForeignFiles(dir, before);
  if (!Exchange(before, dir)) return std::nullopt;
  for (const auto& [file, hash] : (*manifest)["files"].items()) project.hashes().Keep(dir / file, hash);
  project.hashes().Save();
  return manifest;
}

// The lock is held.
StageOutcome RunLocked(const Project& project, const StageRequest& request, int threads, uint64_t seed,
                       ProgressSink& progress, const CancelToken& cancel) {
  const std::string title = Title(request.stage, request.name);
  StageOutcome outcome;
  outcome.dir = project.ResultDir(request.stage, request.name);
  json inputs;
  CallTranslated([&] { inputs = HashInputs(project, request, threads, cancel); });
  project.hashes().Save();
  const std::string identity = Identity(request, seed, inputs);
  RequireResultFolder(outcome.dir);
  std::string damage;
  const auto old = ReadManifestIn(outcome.dir, &damage);
  if (!damage.empty()) {
    progress.Log(LogLevel::kWarning,
                 fmt::format("{}: expected a manifest as it was written, found a damaged one ({}); {} is "
                             "computed again",
                             (outcome.dir / kManifest).string(), damage, title));
  }
  if (IsOf(old, identity)) {
    std::vector<std::string> changed;
    CallTranslated([&] { changed = ChangedFiles(project, *old, outcome.dir); });
    if (changed.empty()) {
      ForgetFailure(outcome.dir);
      outcome.manifest = *old;
      return outcome;
    }
    progress.Log(LogLevel::kWarning, fmt::format("{} is not what was written there any more; {} is computed again",
                                                 RelativeTo(project.dir(), outcome.dir / changed.front()), title));
  }
  std::optional<json> before;
  CallTranslated([&] { before = BringBack(project, identity, outcome.dir); });
  if (before) {
    progress.Log(LogLevel::kInfo,
                 fmt::format("{}: the result from before the last review decision is used again", title));
    ForgetFailure(outcome.dir);
    outcome.manifest = *before;
    return outcome;
  }
  json manifest = {{"schema", kManifestSchema},
                   {"stage", request.stage},
                   {"name", request.name},
                   {"version", request.version},
                   {"identity", identity},
                   {"options", request.options},
                   {"values", request.values},
                   {"inputs", inputs},
                   {"seed", seed},
                   {"threads", ResolveThreads(threads)},
                   {"metrics", json::object()},
                   {"warnings", json::array()},
                   {"files", json::object()},
                   {"status", "running"},
                   {"error", nullptr}};
  if (!request.given.empty()) manifest["given"] = request.given;
  outcome.manifest = Attempt(project, request, manifest).Run(threads, seed, progress, cancel);
  outcome.computed = true;
  return outcome;
}

}  // namespace

std::string_view StageStateName(StageState state) {
  switch (state) {
    case StageState::kMissing: return "missing";
    case StageState::kDone: return "done";
    case StageState::kOutOfDate: return "out of date";
    case StageState::kFailed: return "failed";
    case StageState::kRunning: return "running";
  }
  return "";
}

StageOutcome RunStage(const Project& project, const StageRequest& request, int threads, uint64_t seed,
                      ProgressSink& progress, const CancelToken& cancel) {
  const std::shared_ptr<ProjectLock> lock = project.Lock();
  lock->Announce(Title(request.stage, request.name));
  // Resets the announcement however this ends.
  const std::shared_ptr<void> announced(nullptr, [&](void*) {
    try {
      lock->Announce("");
    } catch (const IoError&) {  // a full disk is reported by what needed the space
    }
  });
  return RunLocked(project, request, threads, seed, progress, cancel);
}

StageOutcome RunStageAsTask(const Project& project, const StageRequest& request, int threads, uint64_t seed,
                            ProgressSink& progress, const CancelToken& cancel) {
  const TaskLock lock(project.results(), Title(request.stage, request.name));
  return RunLocked(project, request, threads, seed, progress, cancel);
}

StageState StateOf(const Project& project, const StageRequest& request, uint64_t seed) {
  const fs::path dir = project.ResultDir(request.stage, request.name);
  if (const auto holder = ProjectLock::Holder(project.results());
      holder && (holder->stage == Title(request.stage, request.name) ||
                 TaskLock::IsHeld(project.results(), Title(request.stage, request.name)))) {
    return StageState::kRunning;
  }
  const auto manifest = ReadManifestIn(dir);
  const auto failure = ReadManifestIn(Beside(dir, kFailedPrefix));
  if (!manifest && !failure) return StageState::kMissing;
  const std::string identity = Identity(request, seed, HashInputs(project, request, 0, CancelToken()));
  if (IsOf(manifest, identity) && ChangedFiles(project, *manifest, dir).empty()) return StageState::kDone;
  if (failure && failure->value("identity", "") == identity) return StageState::kFailed;
  return manifest ? StageState::kOutOfDate : StageState::kMissing;
}

std::string ManifestDamage(const Project& project, const std::string& stage, const std::string& name) {
  std::string damage;
  ReadManifestIn(project.ResultDir(stage, name), &damage);
  return damage;
}

bool RemoveResult(const Project& project, const std::string& stage, const std::string& name) {
  const fs::path dir = project.ResultDir(stage, name), aside = Beside(dir, kTemporaryPrefix);
  bool foreign = true;
  CallTranslated([&] {
    const auto manifest = ReadManifestIn(dir);
    foreign = !manifest || manifest->value("stage", "") != stage || !ForeignFiles(dir, *manifest).empty();
    if (foreign) return;
    fs::remove_all(aside);
    fs::rename(dir, aside);  // what a killed process leaves of it goes with the next lock
    fs::remove_all(aside);
    for (const std::string_view prefix : {kFailedPrefix, kBeforePrefix}) fs::remove_all(Beside(dir, prefix));
  });
  return !foreign;
}

std::optional<json> ReadManifest(const Project& project, const std::string& stage, const std::string& name) {
  return ReadManifestIn(project.ResultDir(stage, name));
}

std::optional<json> ReadFailure(const Project& project, const std::string& stage, const std::string& name) {
  return ReadManifestIn(Beside(project.ResultDir(stage, name), kFailedPrefix));
}

std::optional<json> ReadKept(const Project& project, const std::string& stage, const std::string& name) {
  return ReadManifestIn(Beside(project.ResultDir(stage, name), kBeforePrefix));
}

}  // namespace trigpoint
