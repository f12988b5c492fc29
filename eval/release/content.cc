#include "eval/release/content.h"

#include <algorithm>
#include <map>

#include "datasets/io/credits.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/hash.h"
#include "datasets/project/release_files.h"
#include "eval/errors/reference_maps.h"
#include "eval/release/release_signature.h"
#include "eval/release/versions.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr uintmax_t kLargestTable = 100'000'000;  // bytes of an input that is always copied

bool HasExtension(const fs::path& file, const std::vector<std::string>& extensions) {
  return std::find(extensions.begin(), extensions.end(), LowerExtension(file)) != extensions.end();
}

// Large or private to the computation: features, sparse models, overlays. Their hashes are in the record.
bool BelongsIn(const fs::path& file) {
  return HasExtension(file, {".csv", ".tum", ".json", ".md", ".html", ".pdf", ".png", ".txt", ".yaml", ".xml"});
}

bool IsPictureOrVideo(const fs::path& file) {
  return HasExtension(file,
                      {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", ".heic", ".heif", ".avif", ".dng",
                       ".ppm", ".pgm",  ".mp4", ".mov", ".avi",  ".mkv", ".m4v",  ".webm", ".bag",  ".mcap"});
}

// What a project's folder has at its top, whether a stage names it or not.
const std::vector<std::string>& SiteFiles() {
  static const std::vector<std::string> kFiles = {"trigpoint.yaml",
                                                  "review.jsonl",
                                                  "origin.json",
                                                  "tags.yaml",
                                                  "stations.csv",
                                                  "control_points.csv",
                                                  "control_observations.csv",
                                                  "ground_control_points.json",
                                                  "gcp_list.txt",
                                                  "distances.csv",
                                                  "total_station.csv",
                                                  "panoramas.csv",
                                                  "photos.csv"};
  return kFiles;
}

void CopyFile(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  fs::copy_file(from, to, fs::copy_options::overwrite_existing);
}

// Files of a result that its manifest names, with the manifest and the log.
void CopyResult(const ReleasedResult& result, const fs::path& to) {
  const json files = result.manifest.value("files", json::object());
  for (const auto& [file, hash] : files.items()) {
    if (BelongsIn(file)) CopyFile(result.dir / file, to / file);
  }
  for (const char* file : {"manifest.json", "log.txt"}) {
    if (fs::exists(result.dir / file)) CopyFile(result.dir / file, to / file);
  }
}

json RecordOf(const ReleasedResult& result) {
  json record = json::object();
  for (const char* key : {"stage", "name", "version", "identity", "options", "given", "values", "inputs", "seed",
                          "threads", "warnings", "files", "start", "end"}) {
    if (result.manifest.contains(key)) record[key] = result.manifest[key];
  }
  if (!result.place.empty()) record["copied_to"] = result.place;
  return record;
}

// The files that the results were computed from: path as in the manifests -> file.
std::map<std::string, fs::path> InputsOf(const Project& project, const ReleaseContent& content) {
  std::map<std::string, fs::path> inputs;
  const auto add = [&](const fs::path& input) {
    const fs::path path = input.is_absolute() ? input : project.dir() / input;
    std::error_code ignored;
    if (fs::is_regular_file(path, ignored)) inputs[RelativeTo(project.dir(), path)] = path;
  };
  for (const ReleasedResult& result : content.results) {
    const json its = result.manifest.value("inputs", json::object());
    for (const auto& [input, hash] : its.items()) {
      if (!input.starts_with("results/")) add(input);
    }
  }
  for (const fs::path& input : content.inputs) add(input);
  for (const std::string& file : SiteFiles()) add(file);
  return inputs;
}

// Copies what belongs into the release, and records the rest by hash.
json CopyInputs(const Project& project, const ReleaseContent& content, bool all, const fs::path& to,
                const CancelToken& cancel, Release* release) {
  json record = json::object();
  for (const auto& [path, file] : InputsOf(project, content)) {
    cancel.ThrowIfCancelled();
    const uintmax_t bytes = fs::file_size(file);
    const bool inside = StaysInside(path);
    if (all && !inside) {
      throw InputError(file.string() + ": lies outside the project's folder, so that the release cannot carry it; " +
                       "move it into " + project.dir().string() + ", or publish without --copy-inputs");
    }
    const bool copied = inside && (all || (!IsPictureOrVideo(file) && bytes < kLargestTable));
    if (copied) CopyFile(file, to / path);
    record[path] = {{"sha256", project.hashes().Of(file)}, {"bytes", bytes}, {"copied", copied}};
    ++release->inputs;
    if (!copied) ++release->inputs_by_hash;
  }
  return record;
}

// The map's frame, and what fixes it.
json MapRecord(const Project& project, const std::string& at, Release* release) {
  json record = {{"runs", json::array()}, {"evidence", json::array()}};
  const fs::path map = project.ResultDir("survey", at);
  if (!fs::exists(map / "tags.csv")) return record;
  const std::string frame = TagMapFrame(map / "tags.csv");
  record["frame"] = frame.empty() ? "enu" : frame;
  if (!IsSiteFrame(frame)) return record;
  const ReferenceMap reference = ReadReferenceMap(project, map, "survey" + at);
  release->tags = static_cast<int>(reference.tags.size());
  release->runs = reference.runs;
  release->evidence = reference.evidence;
  record["runs"] = reference.runs;
  record["evidence"] = reference.evidence;
  return record;
}

// Records the hash of every file, which none may change afterwards, and writes the record.
void SealFiles(const fs::path& fresh, const Project& project, json record, const CancelToken& cancel,
               Release* release) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(fresh)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  for (const fs::path& file : files) {
    cancel.ThrowIfCancelled();
    record["files"][RelativeTo(fresh, file)] = {{"sha256", Sha256OfFile(file)}, {"bytes", fs::file_size(file)}};
    fs::permissions(file, fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write,
                    fs::perm_options::remove);
  }
  for (const auto& [path, input] : record["inputs"].items()) {
    if (input["copied"] && record["files"]["site/" + path]["sha256"] != input["sha256"]) {
      throw InputError((project.dir() / path).string() + ": was changed while it was published; publish again");
    }
  }
  release->files = files.size();
  WriteReleaseRecord(fresh, record);
  release->sha256 = Sha256OfFile(fresh / kReleaseRecord);
  fs::permissions(fresh / kReleaseRecord, fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read);
}

// Writes the whole release into the folder `fresh`.
void WriteInto(const fs::path& fresh, const Project& project, const PublishOptions& options,
               const ReleaseContent& content, const CancelToken& cancel, Release* release) {
  const std::string at = options.variant.empty() ? "" : "@" + options.variant;
  json stages = json::object();
  for (const ReleasedResult& result : content.results) {
    if (!result.place.empty()) CopyResult(result, fresh / result.place);
    stages[result.key] = RecordOf(result);
  }
  json record = {{"schema", "trigpoint release 2"},
                 {"name", options.name},
                 {"project", project.name()},
                 {"folder", project.dir().filename().string()},
                 {"variant", options.variant},
                 {"published", UtcTimeText()},
                 {"user", UserName()},
                 {"program", ProgramVersions()},
                 {"map", MapRecord(project, at, release)},
                 {"stages", stages},
                 {"order", content.order},
                 {"inputs", CopyInputs(project, content, options.copy_inputs, fresh / "site", cancel, release)},
                 {"files", json::object()}};
  if (project.has_frame()) {
    const Geodetic& o = project.frame().origin();
    record["origin"] = {o.latitude_deg, o.longitude_deg, o.height_m};
  }
  const ReleaseStatement& statement = options.statement;
  record["certificate"] = {
      {"author", statement.author}, {"instrument", statement.instrument}, {"note", statement.note}};
  // So that a signature that was taken away is missed.
  if (options.sign) record["signature"] = options.sign->starts_with("gpg:") ? kGpgSignature : kSshSignature;
  WriteCertificate(project, record, statement, fresh);
  SealFiles(fresh, project, record, cancel, release);
}

}  // namespace

void CheckReleaseName(const Project& project, const std::string& name) {
  if (name.empty() || name.front() == '.' || name.find_first_of(std::string("/\\@\n\0", 5)) != std::string::npos) {
    throw OptionError("the release's name '" + name + "' cannot be a folder's; use letters, digits, '-' and '_'");
  }
  for (const char* taken : {"self", "control", "survey"}) {
    if (name == taken) throw OptionError("the name '" + name + "' has a meaning of its own; choose another one");
  }
  const fs::path target = ReleaseFolder(project, name);
  if (fs::exists(target)) {
    throw InputError(target.string() + " is published already; a release is never overwritten: choose another name");
  }
}

void CheckReleasable(const Project& project, const std::string& variant) {
  const std::string at = variant.empty() ? "" : "@" + variant;
  const fs::path map = project.ResultDir("survey", at), tables = project.ResultDir("evaluate", at);
  if (!fs::exists(map / "tags.csv") && !fs::exists(tables / "errors.csv")) {
    throw InputError("there is nothing to publish: neither " + (map / "tags.csv").string() + " nor " +
                     (tables / "errors.csv").string() + "; run `trigpoint run " + project.dir().string() + "` first");
  }
  for (const auto& [file, credit] : ReadCredits(project.dir())) {
    if (credit.keep_until.empty()) continue;
    throw InputError((project.dir() / "panoramas.csv").string() + ": " + file + " is from " + credit.source +
                     ", whose terms forbid to keep it, and a release keeps its inputs; take its rows out of the table "
                     "and run `trigpoint run` again");
  }
}

Release WriteRelease(const Project& project, const PublishOptions& options, const ReleaseContent& content,
                     const CancelToken& cancel) {
  const fs::path target = ReleaseFolder(project, options.name);
  RecoverFolder(project.dir() / "releases");
  const fs::path fresh = target.parent_path() / (std::string(kTemporaryPrefix) + options.name);
  Release release;
  release.dir = target;
  try {
    fs::remove_all(fresh);
    fs::create_directories(fresh);
    WriteInto(fresh, project, options, content, cancel, &release);
    if (options.sign) SignRelease(fresh, *options.sign, cancel);
    fs::rename(fresh, target);  // fails if somebody was faster: a folder that is there and not empty stays
  } catch (const fs::filesystem_error& e) {
    std::error_code ignored;
    fs::remove_all(fresh, ignored);
    throw IoErrorFor(target, "published", e.code().value());
  } catch (const Error&) {
    std::error_code ignored;
    fs::remove_all(fresh, ignored);
    throw;
  }
  return release;
}

}  // namespace trigpoint
