#include "app/pipeline/publish.h"

#include <algorithm>

#include "app/pipeline/reference_maps.h"
#include "app/pipeline/stages.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// Large or private to the computation: features, sparse models, overlays.
bool BelongsIn(const fs::path& file) {
  const std::string extension = file.extension().string();
  for (const char* kept : {".csv", ".tum", ".json", ".md", ".html", ".pdf", ".png", ".txt", ".yaml"}) {
    if (extension == kept) return true;
  }
  return false;
}

void CopyFile(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  fs::copy_file(from, to, fs::copy_options::overwrite_existing);
}

void CopyResult(const fs::path& from, const fs::path& to) {
  if (!fs::is_directory(from)) return;
  for (const auto& entry : fs::recursive_directory_iterator(from)) {
    if (entry.is_regular_file() && BelongsIn(entry.path()))
      CopyFile(entry.path(), to / fs::relative(entry.path(), from));
  }
}

json StageRecord(const fs::path& manifest_file) {
  const json manifest = json::parse(ReadTextFile(manifest_file), nullptr, false);
  json record = json::object();
  for (const char* key : {"stage", "name", "version", "options", "values", "inputs", "seed", "start", "end"}) {
    if (manifest.is_object() && manifest.contains(key)) record[key] = manifest[key];
  }
  return record;
}

// Refuses to freeze what its inputs have left behind. Options given on the command line are the result's own.
void RequireUpToDate(const Project& project, const std::string& variant) {
  for (const char* name : {"survey", "evaluate"}) {
    const StageInfo& stage = StageNamed(name);
    StageTarget target;
    target.variant = variant;
    const auto manifest = ReadManifest(project, name, ResultName(stage, target));
    if (!manifest || (stage.not_needed && !stage.not_needed(project, target).empty())) continue;
    target.overrides[name] = manifest->value("options", json::object());
    const StageState state =
        StateOf(project, MakeRequest(project, stage, target), manifest->value("seed", uint64_t{1}));
    if (state == StageState::kDone) continue;
    throw InputError(std::string(name) + " is " + std::string(StageStateName(state)) + "; run `trigpoint " + name +
                     " " + project.dir().string() + "` first");
  }
}

}  // namespace

Release Publish(const Project& project, const std::string& name, const std::string& variant, uint64_t /*seed*/) {
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
  const auto lock = project.Lock();
  const std::string at = variant.empty() ? "" : "@" + variant;
  const fs::path map = project.ResultDir("survey", at), tables = project.ResultDir("evaluate", at);
  if (!fs::exists(map / "tags.csv") && !fs::exists(tables / "errors.csv")) {
    throw InputError("there is nothing to publish: neither " + (map / "tags.csv").string() + " nor " +
                     (tables / "errors.csv").string() + "; run `trigpoint run " + project.dir().string() + "` first");
  }
  RequireUpToDate(project, variant);
  RecoverFolder(project.dir() / "releases");
  const fs::path fresh = target.parent_path() / (std::string(kTemporaryPrefix) + name);
  Release release;
  release.dir = target;
  try {
    fs::remove_all(fresh);
    fs::create_directories(fresh);
    CopyResult(map, fresh / "map");
    CopyResult(tables, fresh / "evaluate");
    CopyResult(project.ResultDir("report", ""), fresh / "report");
    json stages = json::object();
    for (const char* stage : {"localize", "reference", "detect"}) {
      for (const std::string& run : project.RunNames()) {
        const std::string result = run + (std::string(stage) == "localize" ? at : "");
        const fs::path from = project.ResultDir(stage, result);
        if (fs::exists(from / "manifest.json")) {
          stages[std::string(stage) + "/" + run] = StageRecord(from / "manifest.json");
          if (std::string(stage) != "detect") CopyResult(from, fresh / stage / run);
        }
      }
    }
    if (fs::exists(map / "manifest.json")) stages["survey"] = StageRecord(map / "manifest.json");
    if (fs::exists(tables / "manifest.json")) stages["evaluate"] = StageRecord(tables / "manifest.json");
    for (const char* file : {"trigpoint.yaml", "origin.json", "tags.yaml", "stations.csv", "control_points.csv",
                             "distances.csv", "panoramas.csv"}) {
      if (fs::exists(project.dir() / file)) CopyFile(project.dir() / file, fresh / "site" / file);
    }
    json record = {{"schema", "trigpoint release 1"},
                   {"name", name},
                   {"project", project.name()},
                   {"variant", variant},
                   {"published", UtcTimeText()},
                   {"map", {{"runs", json::array()}, {"evidence", json::array()}}},
                   {"stages", stages},
                   {"files", json::object()}};
    if (fs::exists(map / "tags.csv")) {
      const std::string frame = TagMapFrame(map / "tags.csv");
      record["map"]["frame"] = frame.empty() ? "enu" : frame;
      if (IsSiteFrame(frame)) {
        const ReferenceMap reference = ReadReferenceMap(project, map, "survey" + at);
        release.tags = static_cast<int>(reference.tags.size());
        release.runs = reference.runs;
        release.evidence = reference.evidence;
        record["map"]["runs"] = reference.runs;
        record["map"]["evidence"] = reference.evidence;
      }
    }
    if (project.has_frame()) {
      const Geodetic& o = project.frame().origin();
      record["origin"] = {o.latitude_deg, o.longitude_deg, o.height_m};
    }
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(fresh)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    for (const fs::path& file : files) {
      record["files"][RelativeTo(fresh, file)] = Sha256OfFile(file);
      fs::permissions(file, fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write,
                      fs::perm_options::remove);
    }
    release.files = files.size();
    WriteFileAtomically(fresh / "release.json", DumpJson(record, 2) + "\n");
    fs::permissions(fresh / "release.json", fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read);
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
