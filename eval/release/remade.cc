#include "eval/release/remade.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/hash.h"
#include "datasets/project/project.h"
#include "eval/release/versions.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr uintmax_t kLargestCompared = 200'000'000;  // bytes of a file that is compared number by number

[[noreturn]] void ThrowDamaged(const RerunOptions& options, const std::string& what) {
  throw InputError((options.release / kReleaseRecord).string() + ": " + what +
                   "; the release is damaged or was not written by trigpoint publish: get it again from where it came "
                   "from");
}

void CopyInput(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  fs::copy_file(from, to);
  fs::permissions(to, fs::perms::owner_write, fs::perm_options::add);
}

// A file of the user's own, which stages only read: no second copy for a folder that goes again.
void LinkInput(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  std::error_code failure;
  fs::create_hard_link(fs::canonical(from), to, failure);
  if (failure) fs::copy_file(from, to);
}

void Gather(const RerunOptions& options, const std::vector<ReleasedInput>& inputs, const fs::path& project,
            ProgressSink& progress, const CancelToken& cancel) {
  const fs::path there =
      options.inputs.empty() ? fs::canonical(options.release).parent_path().parent_path() : options.inputs;
  std::vector<std::string> wrong;
  progress.Begin("gathering the inputs", static_cast<int64_t>(inputs.size()));
  for (const ReleasedInput& input : inputs) {
    cancel.ThrowIfCancelled();
    progress.Advance(1);
    if (input.copied) {
      const std::optional<fs::path> file = PlainFile(options.release, "site/" + input.path);
      if (!file || fs::file_size(*file) != input.bytes || Sha256OfFile(*file) != input.sha256) {
        ThrowDamaged(options, "site/" + CleanPath(input.path) + " is not the input that it records");
      }
      CopyInput(*file, project / input.path);
      continue;
    }
    const fs::path file = there / input.path;  // an absolute path stays as it is
    std::error_code failure;
    if (!fs::is_regular_file(file, failure)) {
      wrong.push_back(CleanPath(file.string()) + " is not there");
    } else if (fs::file_size(file, failure) != input.bytes || Sha256OfFile(file) != input.sha256) {
      wrong.push_back(CleanPath(file.string()) + " was changed");
    } else if (wrong.empty() && StaysInside(input.path)) {
      if (options.out.empty()) {
        LinkInput(file, project / input.path);
      } else {
        CopyInput(file, project / input.path);
      }
    }
  }
  if (wrong.empty()) return;
  throw InputError(
      fmt::format("{} of {} inputs are not as they were published, first: {}; the release has them by hash "
                  "alone: give the folder that has them by --inputs",
                  wrong.size(), inputs.size(), wrong.front()));
}

bool IsText(const fs::path& file) {
  for (const char* extension : {".csv", ".tum", ".json", ".md", ".txt", ".yaml", ".xml"}) {
    if (file.extension() == extension) return true;
  }
  return false;
}

RerunDifference CompareFiles(const fs::path& release, const RecordedResult& result, const std::string& file,
                             const fs::path& now) {
  RerunDifference difference;
  const std::optional<fs::path> then =
      result.copied_to.empty() ? std::nullopt : PlainFile(release, result.copied_to + "/" + file);
  if (!then || !IsText(file) || fs::file_size(*then) > kLargestCompared || fs::file_size(now) > kLargestCompared) {
    difference.text = then ? "the bytes differ" : "the bytes differ; the release has only the hash of the file";
  } else {
    difference = CompareTexts(ReadTextFile(*then), ReadTextFile(now), fs::path(file).extension() == ".csv");
  }
  return difference;
}

// Words of a line between separators, with the number of each where it is one.
std::vector<std::string_view> Words(std::string_view line, bool csv) {
  const char* const separators = csv ? "," : " ,;:[]{}()|\"\t";
  std::vector<std::string_view> words;
  for (size_t begin = 0; begin <= line.size();) {
    const size_t end = std::min(line.find_first_of(separators, begin), line.size());
    if (csv || end > begin) words.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

}  // namespace

ReleaseRecord ReadWholeRelease(const fs::path& release, int threads, const CancelToken& cancel) {
  ReleaseRecord record = ReadReleaseRecord(release);
  const json& j = record.json;
  if (!j.contains("inputs") || !j.contains("stages") || !j.contains("order") || !j["order"].is_array()) {
    throw InputError(
        (release / kReleaseRecord).string() +
        ": expected a release with its inputs, found one of an earlier version; publish the project again");
  }
  const ReleaseDifferences differences = CompareRelease(release, record, threads, cancel);
  if (record.damaged || !differences.changed.empty() || !differences.missing.empty()) {
    throw InputError(release.string() +
                     ": is not as it was published; `trigpoint verify` names what differs; get it again from where it "
                     "came from");
  }
  return record;
}

std::vector<ReleasedInput> ReadInputs(const RerunOptions& options, const ReleaseRecord& record) {
  std::vector<ReleasedInput> inputs;
  for (const auto& [path, value] : record.json.at("inputs").items()) {
    const bool complete = value.is_object() && value.contains("sha256") && value["sha256"].is_string() &&
                          value.contains("bytes") && value["bytes"].is_number_unsigned() && value.contains("copied") &&
                          value["copied"].is_boolean();
    if (!complete) ThrowDamaged(options, "input '" + CleanPath(path) + "': expected sha256, bytes and copied");
    inputs.push_back({path, value["sha256"].get<std::string>(), value["bytes"].get<uintmax_t>(), value["copied"]});
    const ReleasedInput& input = inputs.back();
    if (StaysInside(path)) continue;
    if (input.copied || path.front() != '/')
      ThrowDamaged(options, "input '" + CleanPath(path) + "' leaves the project");
  }
  return inputs;
}

WorkFolder::WorkFolder(const fs::path& asked, const std::string& name) : keep_(!asked.empty()) {
  std::error_code failure;
  if (keep_) {
    if (fs::exists(asked, failure) && !fs::is_empty(asked, failure)) {
      throw InputError(asked.string() + ": expected a new or an empty folder, found files in it");
    }
    fs::create_directories(asked, failure);
    if (failure) throw IoErrorFor(asked, "created", failure.value());
    root_ = project_ = asked;
    return;
  }
  std::string made = (fs::temp_directory_path() / "trigpoint-rerun-XXXXXX").string();
  if (mkdtemp(made.data()) == nullptr) throw IoErrorFor(made, "created", errno);
  root_ = made;
  project_ = root_ / name;
}

WorkFolder::~WorkFolder() {
  std::error_code ignored;
  if (!keep_) fs::remove_all(root_, ignored);
}

void GatherInputs(const RerunOptions& options, const std::vector<ReleasedInput>& inputs, const fs::path& project,
                  ProgressSink& progress, const CancelToken& cancel) {
  try {
    Gather(options, inputs, project, progress, cancel);
  } catch (const fs::filesystem_error& e) {
    throw IoErrorFor(e.path2().empty() ? e.path1() : e.path2(), "copied", e.code().value());
  }
}

RecordedResult ReadRecorded(const RerunOptions& options, const ReleaseRecord& record, const json& key) {
  const json& stages = record.json.at("stages");
  if (!key.is_string() || !stages.contains(key.get<std::string>())) ThrowDamaged(options, "'order' names no result");
  RecordedResult recorded;
  recorded.key = key.get<std::string>();
  recorded.record = stages[recorded.key];
  const json& its = recorded.record;
  const std::pair<const char*, json::value_t> members[] = {{"stage", json::value_t::string},
                                                           {"name", json::value_t::string},
                                                           {"options", json::value_t::object},
                                                           {"files", json::value_t::object}};
  for (const auto& [member, type] : members) {
    if (!its.is_object() || !its.contains(member) || its[member].type() != type) {
      ThrowDamaged(options, "result '" + CleanPath(recorded.key) + "': expected its " + member);
    }
  }
  const std::string name = its["name"];
  const size_t at = name.find('@');
  recorded.run = name.substr(0, at);
  if (at != std::string::npos) CheckVariantName(recorded.at = name.substr(at + 1));
  if (name.find('/') != std::string::npos || name.starts_with(".")) {
    ThrowDamaged(options, "result '" + CleanPath(recorded.key) + "' has a name that is no folder's");
  }
  if (its.contains("copied_to") && its["copied_to"].is_string() && StaysInside(its["copied_to"]))
    recorded.copied_to = its["copied_to"];
  return recorded;
}

void CompareResult(const RerunOptions& options, const RecordedResult& recorded, const json& manifest,
                   const fs::path& dir, RerunResult* result) {
  const json files = manifest.value("files", json::object());
  const auto add = [&](RerunDifference difference, const std::string& file) {
    difference.result = recorded.key;
    difference.file = file;
    if (!difference.only_numbers || !(difference.largest <= options.tolerance)) result->within_tolerance = false;
    result->other.push_back(std::move(difference));
  };
  for (const auto& [file, hash] : recorded.record["files"].items()) {
    if (!files.contains(file)) {
      add({.text = "was not made"}, CleanPath(file));
    } else if (files[file] == hash) {
      ++result->same_files;
    } else {
      add(CompareFiles(options.release, recorded, file, dir / file), file);
    }
  }
  for (const auto& [file, hash] : files.items()) {
    if (!recorded.record["files"].contains(file)) add({.text = "was not there before"}, file);
  }
  const int then = recorded.record.value("version", 0), now = manifest.value("version", 0);
  if (then != now)
    result->notes.push_back(
        fmt::format("{}: the release has version {} of the stage, this program has {}", recorded.key, then, now));
}

void CompareVersions(const ReleaseRecord& record, std::vector<std::string>* notes) {
  const json then = record.json.value("program", json::object()).flatten(), now = ProgramVersions().flatten();
  for (const auto& [key, value] : now.items()) {
    const json before = then.is_object() ? then.value(key, json()) : json();
    if (before == value || !before.is_string()) continue;
    notes->push_back(fmt::format("{}: {} then, {} now", key.substr(key.rfind('/') + 1),
                                 CleanPath(before.get<std::string>()), value.get<std::string>()));
  }
}

RerunDifference CompareTexts(const std::string& then, const std::string& now, bool csv) {
  RerunDifference difference;
  const std::vector<std::string_view> a = Lines(then), b = Lines(now);
  std::vector<std::string_view> header;
  size_t values = 0, texts = 0, largest_line = 0, first_text = 0;
  std::string largest_column;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    const std::vector<std::string_view> p = Words(a[i], csv), q = Words(b[i], csv);
    if (csv && header.empty() && !a[i].starts_with('#')) header = p;
    if (a[i] == b[i]) continue;
    bool text = p.size() != q.size();
    for (size_t k = 0; !text && k < p.size(); ++k) {
      if (p[k] == q[k]) continue;
      const std::optional<double> x = ParseDouble(p[k]), y = ParseDouble(q[k]);
      if (!x || !y || !std::isfinite(*x) || !std::isfinite(*y)) {
        text = true;
        continue;
      }
      const std::string column = csv && k < header.size() ? std::string(header[k]) : "";
      double& most = difference.columns[column];
      most = std::max(most, std::abs(*x - *y));
      ++values;
      if (std::abs(*x - *y) > difference.largest || largest_line == 0) {
        difference.largest = std::max(difference.largest, std::abs(*x - *y));
        largest_line = i + 1;
        largest_column = column;
      }
    }
    if (text && texts++ == 0) first_text = i + 1;
  }
  difference.only_numbers = texts == 0 && a.size() == b.size();
  if (values > 0) {
    difference.text =
        fmt::format("{} numbers differ, at most by {:.3g}{} in line {}", values, difference.largest,
                    largest_column.empty() ? "" : " in column " + CleanPath(largest_column), largest_line);
  }
  const char* const comma = difference.text.empty() ? "" : "; ";
  if (a.size() != b.size()) {
    difference.text += fmt::format("{}{} lines in the release, {} now", comma, a.size(), b.size());
  } else if (texts > 0) {
    difference.text += fmt::format("{}{} lines differ otherwise, first line {}", comma, texts, first_text);
  } else if (values == 0) {
    difference.text += "the bytes differ, words and numbers are the same";
  }
  return difference;
}

}  // namespace trigpoint
