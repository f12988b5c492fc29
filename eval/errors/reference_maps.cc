#include "eval/errors/reference_maps.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "datasets/io/csv.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "datasets/project/release_files.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

json ReadJson(const fs::path& file) {
  json value = json::parse(ReadTextFile(file), nullptr, false);
  if (!value.is_object()) throw InputError(file.string() + ": expected a JSON object; make the result again");
  return value;
}

// What fixes a map to the world, one name each.
std::vector<std::string> DatumEvidence(const Project& project, const ReferenceMap& map, const std::string& datum) {
  std::set<std::string> evidence;
  if (datum.find("control") != std::string::npos) {
    for (const TagResult& tag : map.tags) {
      if (tag.role == "control") evidence.insert("control:" + std::to_string(tag.tag_id));
    }
  }
  if (datum.find("geotag") != std::string::npos) {
    for (const Reference& reference : project.site().references) {
      const std::string station = StationNamed(reference.station, project.site().stations);
      if (reference.geotag.has_position && !station.empty()) evidence.insert("geotag:" + reference.name);
    }
  }
  if (datum.find("gps") != std::string::npos) {
    for (const std::string& run : map.runs) evidence.insert("gps:" + run);
  }
  return {evidence.begin(), evidence.end()};
}

// Runs whose detections went into a survey, from its manifest.
std::vector<std::string> RunsOf(const json& manifest) {
  std::set<std::string> runs;
  for (const json& run : manifest.value("values", json::object()).value("runs", json::array())) {
    if (run.is_string()) runs.insert(run.get<std::string>());
  }
  const json inputs = manifest.value("inputs", json::object());
  for (const auto& [input, hash] : inputs.items()) {
    for (const std::string prefix : {"results/detect/", "runs/"}) {
      if (!input.starts_with(prefix)) continue;
      const size_t end = input.find('/', prefix.size());
      if (end != std::string::npos) runs.insert(input.substr(prefix.size(), end - prefix.size()));
    }
  }
  return {runs.begin(), runs.end()};
}

}  // namespace

ReferenceMap ControlMap(const Project& project) {
  ReferenceMap map;
  map.name = "control";
  for (const ControlPoint& point : AtNewestEpoch(project.site().control_points)) {
    if (point.tag_id < 0 || point.corner >= 0 || !(point.local_m || (point.geodetic && project.has_frame()))) continue;
    bool turned = false;
    for (const Station& station : project.site().stations)
      turned |= station.tag_id == point.tag_id && station.in_tag_frame;
    if (turned) {
      map.unusable[point.tag_id] = "the station's offset is in the tag's frame, and a point has none";
      continue;
    }
    TagResult tag;
    tag.tag_id = point.tag_id;
    tag.map_from_tag = Rigid3d{Eigen::Quaterniond::Identity(),
                               point.local_m ? *point.local_m : project.frame().EnuFromGeodetic(*point.geodetic)};
    tag.sigma_m = Eigen::Vector3d(point.sigma_h_m, point.sigma_h_m, point.sigma_v_m);
    tag.role = point.control ? "control" : "check";
    tag.status = "ok";
    map.evidence.push_back((point.control ? "control:" : "check:") + std::to_string(point.tag_id));
    map.own_evidence[point.tag_id] = map.evidence.back();
    map.tags.push_back(std::move(tag));
  }
  return map;
}

ReferenceMap ReadReferenceMap(const Project& project, const fs::path& folder, const std::string& name) {
  ReferenceMap map;
  map.name = name;
  const fs::path tags = folder / "tags.csv";
  if (!fs::exists(tags)) {
    throw InputError("reference " + name + ": " + tags.string() + " is not there" +
                     (name.starts_with("survey") ? "; run `trigpoint survey` first" : ""));
  }
  const bool released = fs::exists(folder.parent_path() / "release.json");
  if (released) CheckRelease(folder.parent_path());
  const std::vector<std::string> comments = CsvTable::Read(tags, {"tag_id"}).comments();
  const std::string frame = CommentValue(comments, "frame");
  if (!IsSiteFrame(frame)) {
    throw InputError(tags.string() + ": its frame is '" + frame +
                     "', expected the site's (enu); give the survey control points or geotags");
  }
  map.tags = ReadTagResults(tags, folder / "tags_cov.csv");
  map.cross = ReadTagCovariances(folder / "tags_cov.csv");
  for (TagResult& tag : map.tags) {
    static const std::set<std::string> kUncertain = {"moved", "duplicate", "ambiguous", "unsolved", "rejected"};
    if (kUncertain.count(tag.status) == 0) continue;
    map.unusable[tag.tag_id] = "its status there is " + tag.status;
    tag.map_from_tag.reset();
  }
  if (released) {
    const json release = ReadJson(folder.parent_path() / "release.json");
    for (const json& run : release.at("map").at("runs")) map.runs.push_back(run.get<std::string>());
    for (const json& item : release.at("map").at("evidence")) map.evidence.push_back(item.get<std::string>());
    const json origin = release.value("origin", json());
    if (origin.is_array() && project.has_frame()) {
      const Geodetic there{origin.at(0).get<double>(), origin.at(1).get<double>(), origin.at(2).get<double>()};
      const double apart = (EcefFromGeodetic(there) - EcefFromGeodetic(project.frame().origin())).norm();
      if (apart > 1e-3) {
        throw InputError("release " + name + " has its origin " + std::to_string(apart) +
                         " m from this project's; give both the same `origin` in trigpoint.yaml");
      }
    }
    return map;
  }
  if (fs::exists(folder / "manifest.json")) map.runs = RunsOf(ReadJson(folder / "manifest.json"));
  map.evidence = DatumEvidence(project, map, CommentValue(comments, "datum"));
  if (fs::exists(folder / "summary.json")) {
    for (const json& set : ReadJson(folder / "summary.json").value("photo_sets", json::array())) {
      map.evidence.push_back("photos:" + set.get<std::string>());
    }
  }
  return map;
}

std::string MissingCovariances(const ReferenceMap& map, const fs::path& folder) {
  std::string tags;
  if (!fs::exists(folder / "tags_cov.csv")) return tags;
  for (const TagResult& tag : map.tags) {
    if (tag.map_from_tag && !tag.covariance) tags += " " + std::to_string(tag.tag_id);
  }
  if (tags.empty()) return tags;
  return (folder / "tags_cov.csv").string() + ": no finite covariance of tag" + tags +
         "; the sigmas of tags.csv stand in, axes taken as independent";
}

bool IsSiteFrame(const std::string& frame) { return frame.empty() || frame == "enu" || frame == "local"; }

fs::path ReferenceMapFolder(const Project& project, const std::string& name) {
  if (name == "survey") return project.ResultDir("survey", "");
  if (name.starts_with("survey@")) return project.ResultDir("survey", name.substr(6));
  return ReleaseFolder(project, name) / "map";
}

std::vector<std::string> ReferenceNames(const Project& project) {
  std::vector<std::string> names = {"self", "control"};
  std::error_code ignored;
  for (fs::directory_iterator it(project.results(), ignored), end; it != end; it.increment(ignored)) {
    const std::string name = it->path().filename().string();
    if (name == "survey" || name.starts_with("survey@")) names.push_back(name);
  }
  std::sort(names.begin() + 2, names.end());
  for (const std::string& name : ReleaseNames(project)) names.push_back(name);
  return names;
}

fs::path ReleaseFolder(const Project& project, const std::string& name) { return project.dir() / "releases" / name; }

std::vector<std::string> ReleaseNames(const Project& project) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (fs::directory_iterator it(project.dir() / "releases", ignored), end; it != end; it.increment(ignored)) {
    if (fs::exists(it->path() / "release.json", ignored)) names.push_back(it->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

void CheckRelease(const fs::path& release) {
  const ReleaseRecord record = ReadReleaseRecord(release);
  const ReleaseDifferences differences = CompareRelease(release, record, 1, CancelToken());
  const char* const kRestore = "; `trigpoint verify` names all that differs; restore the release from a copy";
  if (record.damaged) {
    throw InputError((release / kReleaseRecord).string() + ": was changed after it was published" + kRestore);
  }
  if (!differences.missing.empty()) {
    throw InputError((release / differences.missing.front()).string() + ": is missing from the release" + kRestore);
  }
  if (!differences.changed.empty()) {
    throw InputError(release.string() + ": was changed after it was published: " + differences.changed.front() +
                     kRestore);
  }
}

std::vector<ReferenceMap> ReferencesFor(const Project& project, const std::string& asked, ProgressSink& progress) {
  std::vector<ReferenceMap> maps;
  const auto add = [&](const std::string& name) {
    const fs::path folder = ReferenceMapFolder(project, name);
    maps.push_back(ReadReferenceMap(project, folder, name));
    const std::string missing = MissingCovariances(maps.back(), folder);
    if (!missing.empty()) progress.Log(LogLevel::kWarning, missing);
  };
  if (asked == "self") return maps;
  if (!asked.empty() && asked != "control") {
    const std::vector<std::string> names = ReferenceNames(project);
    if (std::find(names.begin(), names.end(), asked) == names.end()) {
      throw InputError("there is no reference '" + asked + "'; nearest: '" + NearestName(asked, names) +
                       "' (there are " + fmt::format("{}", fmt::join(names, ", ")) + ")");
    }
    add(asked);
    return maps;
  }
  if (ReferenceMap control = ControlMap(project); !control.tags.empty()) maps.push_back(std::move(control));
  if (asked == "control" && maps.empty()) throw InputError("there is no reference 'control': no control_points.csv");
  if (asked.empty() && fs::exists(ReferenceMapFolder(project, "survey") / "tags.csv")) {
    try {
      add("survey");
    } catch (const InputError& e) {
      progress.Log(LogLevel::kWarning, std::string("the survey cannot be used as reference: ") + e.what());
    }
  }
  return maps;
}

}  // namespace trigpoint
