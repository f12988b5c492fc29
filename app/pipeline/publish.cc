#include "app/pipeline/publish.h"

#include <algorithm>
#include <set>

#include "app/pipeline/released_results.h"
#include "datasets/io/credits.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/hash.h"
#include "datasets/project/release_files.h"
#include "eval/errors/reference_maps.h"
#include "eval/release/certificate.h"
#include "eval/release/release_signature.h"
#include "eval/release/versions.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr uintmax_t kLargestTable = 100'000'000;  // bytes of an input that is always copied

bool HasExtension(const fs::path& file, const std::vector<std::string>& extensions) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
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
void CopyResult(const RestedOn& result, const fs::path& to) {
  const json files = result.manifest.value("files", json::object());
  for (const auto& [file, hash] : files.items()) {
    if (BelongsIn(file)) CopyFile(result.dir / file, to / file);
  }
  for (const char* file : {"manifest.json", "log.txt"}) {
    if (fs::exists(result.dir / file)) CopyFile(result.dir / file, to / file);
  }
}

json RecordOf(const RestedOn& result, const std::string& copied_to) {
  json record = json::object();
  for (const char* key : {"stage", "name", "version", "identity", "options", "given", "values", "inputs", "seed",
                          "threads", "warnings", "files", "start", "end"}) {
    if (result.manifest.contains(key)) record[key] = result.manifest[key];
  }
  if (!copied_to.empty()) record["copied_to"] = copied_to;
  return record;
}

// Where a published result lies in the release; empty: only its record is kept.
std::string PlaceInRelease(const RestedOn& result, const std::string& variant) {
  const std::string& stage = result.job.stage->name;
  if (result.job.stage->variants && result.job.target.variant != variant) return "";
  if (stage == "survey") return "map";
  if (stage == "evaluate" || stage == "gates" || stage == "report") return stage;
  if (stage == "localize" || stage == "reference") return stage + "/" + result.job.target.run;
  return "";
}

// What is published itself.
std::vector<RestedOn> Published(const Project& project, const std::string& variant) {
  std::vector<RestedOn> results;
  const auto add = [&](const std::string& stage, const StageTarget& target) {
    if (std::optional<RestedOn> result = ResultNow(project, stage, target)) results.push_back(std::move(*result));
  };
  for (const std::string& run : project.RunNames()) {
    add("localize", {run, variant});
    add("reference", {run, ""});
  }
  add("survey", {"", variant});
  add("evaluate", {"", variant});
  // Verdicts of limits that are no longer set are left behind.
  if (std::optional<RestedOn> gates = ResultNow(project, "gates", {"", variant})) {
    const StageTarget target{"", variant, gates->manifest.value("given", json::object())};
    if (gates->job.stage->not_needed(project, target).empty()) results.push_back(std::move(*gates));
  }
  add("report", {});
  return results;
}

// The report shows results; nothing is computed from it.
std::vector<RestedOn> WithoutReport(std::vector<RestedOn> results) {
  std::erase_if(results, [](const RestedOn& result) { return result.job.stage->name == "report"; });
  return results;
}

// The release's own variant goes without its name, so that releases of variants can be compared.
std::string KeyOf(const RestedOn& result, const std::string& at) {
  std::string key = result.Title();
  if (!at.empty() && key.ends_with(at)) key.resize(key.size() - at.size());
  return key;
}

// The files that the results were computed from: path as in the manifests -> file.
std::map<std::string, fs::path> InputsOf(const Project& project, const std::vector<RestedOn>& results) {
  std::map<std::string, fs::path> inputs;
  const auto add = [&](const fs::path& input) {
    const fs::path path = input.is_absolute() ? input : project.dir() / input;
    std::error_code ignored;
    if (fs::is_regular_file(path, ignored)) inputs[RelativeTo(project.dir(), path)] = path;
  };
  for (const RestedOn& result : results) {
    const json its = result.manifest.value("inputs", json::object());
    for (const auto& [input, hash] : its.items()) {
      if (!input.starts_with("results/")) add(input);
    }
    // A calibration is taken over as it is: its board's pictures are behind it, and it serves as an input.
    if (result.job.stage->name == "calibrate") {
      for (const char* file : {"camchain.yaml", "manifest.json"}) add(result.dir / file);
    }
  }
  for (const std::string& name : project.RunNames()) {
    if (project.site().broken_runs.count(name) > 0) continue;
    for (const fs::path& input : RunInputs(project, project.run(name))) add(input);
  }
  for (const fs::path& input : ReferenceInputs(project, project.site())) add(input);
  for (const std::string& file : SiteFiles()) add(file);
  return inputs;
}

// Copies what belongs into the release, and records the rest by hash.
json CopyInputs(const Project& project, const std::vector<RestedOn>& results, bool all, const fs::path& to,
                const CancelToken& cancel, Release* release) {
  json record = json::object();
  for (const auto& [path, file] : InputsOf(project, results)) {
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

void CheckName(const Project& project, const std::string& name) {
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

// Writes the whole release into the folder `fresh`.
void WriteRelease(const Project& project, const PublishOptions& options, const std::vector<RestedOn>& published,
                  const std::vector<RestedOn>& behind, const fs::path& fresh, const CancelToken& cancel,
                  Release* release) {
  const std::string at = options.variant.empty() ? "" : "@" + options.variant;
  json stages = json::object();
  for (const RestedOn& result : behind) {
    const bool itself = std::any_of(published.begin(), published.end(),
                                    [&](const RestedOn& other) { return other.Title() == result.Title(); });
    const std::string place = itself ? PlaceInRelease(result, options.variant) : "";
    if (!place.empty()) CopyResult(result, fresh / place);
    stages[KeyOf(result, at)] = RecordOf(result, place);
  }
  json order = json::array();
  for (const RestedOn& result : ResultsBehind(project, WithoutReport(published))) order.push_back(KeyOf(result, at));
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
                 {"order", order},
                 {"inputs", CopyInputs(project, behind, options.copy_inputs, fresh / "site", cancel, release)},
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

}  // namespace

Release Publish(const Project& project, const PublishOptions& options, const CancelToken& cancel) {
  CheckName(project, options.name);
  const fs::path target = ReleaseFolder(project, options.name);
  const auto lock = project.Lock();
  const std::string at = options.variant.empty() ? "" : "@" + options.variant;
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
  const std::vector<RestedOn> published = Published(project, options.variant);
  const std::vector<RestedOn> behind = ResultsBehind(project, published);
  RequireCurrent(project, behind);
  project.hashes().Save();
  RecoverFolder(project.dir() / "releases");
  const fs::path fresh = target.parent_path() / (std::string(kTemporaryPrefix) + options.name);
  Release release;
  release.dir = target;
  try {
    fs::remove_all(fresh);
    fs::create_directories(fresh);
    WriteRelease(project, options, published, behind, fresh, cancel, &release);
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
