#include "datasets/project/project.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <set>

#include "calib/base/counted.h"
#include "datasets/io/expired_panoramas.h"
#include "datasets/io/geodetic_mean.h"
#include "datasets/io/kept_input.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/picture_parts.h"
#include "datasets/io/site_inputs.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"
#include "datasets/project/description.h"
#include "datasets/project/files.h"
#include "datasets/project/look.h"
#include "datasets/project/replaced.h"
#include "datasets/project/yaml_json.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

constexpr int kSchema = 1;
constexpr const char* kProjectFile = "trigpoint.yaml";
const std::vector<std::string> kKeys = {"schema", "name",  "origin",   "crs",   "runs",
                                        "roles",  "gates", "variants", "stages"};
const std::vector<std::string> kRoles = {"survey", "evaluation", "both"};

struct ProjectFile {
  std::string name;
  std::optional<Geodetic> origin;
  std::string crs;
  std::optional<std::vector<std::string>> runs;
  std::map<std::string, std::string> roles;
  nlohmann::json stages = nlohmann::json::object();
  nlohmann::json variants = nlohmann::json::object();
  nlohmann::json gates = nlohmann::json::object();
};

// {name: {key: value}}, so that what comes later can rely on two levels of maps.
nlohmann::json ReadNestedMap(const YamlMap& map) {
  nlohmann::json json = nlohmann::json::object();
  for (const std::string& key : map.Keys()) {
    map.MapOfAnyKeys(key);
    const nlohmann::json value = JsonFromYaml(map.Node(key));
    json[key] = value.is_null() ? nlohmann::json::object() : value;
  }
  return json;
}

Geodetic ReadOrigin(const YamlMap& map) {
  const YamlMap origin = map.Map("origin", {"latitude_deg", "longitude_deg", "height_m"});
  for (const char* key : {"latitude_deg", "longitude_deg"}) {
    if (!origin.Has(key)) map.Fail("origin", std::string("expected latitude_deg and longitude_deg, found no ") + key);
  }
  const Geodetic result{origin.Number("latitude_deg", 0), origin.Number("longitude_deg", 0),
                        origin.Number("height_m", 0)};
  try {
    LocalFrame{result};
  } catch (const InputError& e) {
    map.Fail("origin", e.what());
  }
  return result;
}

std::vector<std::string> ReadRuns(const YamlMap& map, const fs::path& dir) {
  const YAML::Node list = map.Node("runs");
  if (!list.IsSequence()) map.Fail("runs", "expected a list of folders below runs/, such as [run1, run2]");
  std::vector<std::string> runs;
  for (const YAML::Node& item : list) {
    if (!item.IsScalar()) map.Fail("runs", "expected a list of names");
    const std::string& written = item.Scalar();
    const fs::path run = ResolveInside(dir, dir / "runs", written, map.Where("runs"));
    if (run.parent_path() != dir / "runs") {
      map.Fail("runs", "expected the names of folders below runs/, found '" + written + "'");
    }
    runs.push_back(run.filename().string());
  }
  return runs;
}

ProjectFile ReadProjectFile(const fs::path& dir) {
  const fs::path file = dir / kProjectFile;
  const YamlMap map(file, LoadYaml(file), kKeys);
  ProjectFile result;
  if (const int schema = map.Integer("schema", kSchema); schema != kSchema) {
    map.Fail("schema",
             fmt::format("expected {}, found {}: the file is of another version of Trigpoint", kSchema, schema));
  }
  result.name = map.Text("name");
  if (result.name.find_first_of("\n\r") != std::string::npos) {
    map.Fail("name", "expected one line, found a line break in it");
  }
  result.crs = map.Text("crs");
  if (!result.crs.empty() && (!result.crs.starts_with("EPSG:") || !ParseInt(result.crs.substr(5)))) {
    map.Fail("crs", "expected EPSG:<number>, found '" + result.crs + "'");
  }
  if (map.Has("origin")) result.origin = ReadOrigin(map);
  if (map.Has("runs")) result.runs = ReadRuns(map, dir);
  const YamlMap roles = map.MapOfAnyKeys("roles");
  for (const std::string& run : roles.Keys()) {
    const std::string role = roles.Text(run);
    if (std::find(kRoles.begin(), kRoles.end(), role) == kRoles.end()) {
      roles.Fail(run, "expected survey, evaluation or both, found '" + role + "'");
    }
    result.roles[run] = role;
  }
  map.MapOfAnyKeys("gates");
  if (map.Has("gates")) result.gates = JsonFromYaml(map.Node("gates"));
  result.stages = ReadNestedMap(map.MapOfAnyKeys("stages"));
  const YamlMap variants = map.MapOfAnyKeys("variants");
  for (const std::string& variant : variants.Keys()) {
    try {
      CheckVariantName(variant);
    } catch (const OptionError& e) {
      variants.Fail(variant, e.what());
    }
    result.variants[variant] = ReadNestedMap(variants.MapOfAnyKeys(variant));
  }
  return result;
}

bool KnowsAnything(const Site& site) {
  return !site.runs.empty() || !site.broken_runs.empty() || !site.references.empty() || !site.control_points.empty() ||
         !PhotoSetFolders(site.dir).empty();
}

// As they end up in trigpoint.yaml, so that a folder opened bare has the same frame as after `init`.
Geodetic Rounded(const Geodetic& g) {
  return {std::round(g.latitude_deg * 1e9) / 1e9, std::round(g.longitude_deg * 1e9) / 1e9,
          std::round(g.height_m * 1e4) / 1e4};
}

std::string Quoted(const std::string& text) { return DumpJson(text); }  // JSON's strings are YAML's

std::string QuotedList(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + Quoted(name);
  return "[" + text + "]";
}

std::vector<std::string> NamesOfRuns(const Site& site) {
  std::vector<std::string> names;
  for (const Run& run : site.runs) names.push_back(run.name);
  for (const auto& [name, reason] : site.broken_runs) names.push_back(name);
  std::sort(names.begin(), names.end());
  return names;
}

std::string DescribeRun(const Run& run) {
  std::vector<std::string> parts;
  if (!run.images.empty()) {
    const bool video = run.images.front().video_frame >= 0;
    const auto pictures =
        static_cast<size_t>(std::count_if(run.images.begin(), run.images.end(), [&](const ImageEntry& image) {
          return PictureOf(run, image) == image.file;
        }));
    parts.push_back(Counted(pictures, video ? "video frame" : "image", video ? "video frames" : "images"));
  }
  if (!run.detections.empty()) parts.push_back("detections.csv");
  const auto views = static_cast<size_t>(std::count_if(
      run.cameras.begin(), run.cameras.end(), [](const BodyCamera& camera) { return camera.IsFurtherView(); }));
  if (!run.cameras.empty()) parts.push_back(Counted(run.cameras.size() - views, "camera"));
  if (views > 0) parts.push_back(fmt::format("360 images in {} views each", views + 1));
  if (!run.odometry.poses.empty()) parts.push_back(Counted(run.odometry.poses.size(), "odometry pose"));
  if (!run.gps.empty()) parts.push_back(Counted(run.gps.size(), "GPS fix", "GPS fixes"));
  return fmt::format("run {}: {}", run.name,
                     parts.empty() ? "nothing that can be used" : fmt::format("{}", fmt::join(parts, ", ")));
}

void DescribeControl(const Site& site, InitReport& report) {
  if (!site.control_points.empty()) {
    const auto control = std::count_if(site.control_points.begin(), site.control_points.end(),
                                       [](const ControlPoint& p) { return p.control; });
    report.found.push_back(fmt::format("{}, {} of them for checks only",
                                       Counted(site.control_points.size(), "control point"),
                                       site.control_points.size() - static_cast<size_t>(control)));
  }
  if (fs::exists(site.dir / "total_station.csv")) report.found.push_back("readings of a total station");
}

void Describe(const Site& site, const std::optional<SiteOrigin>& origin, InitReport& report) {
  for (const Run& run : site.runs) {
    report.found.push_back(DescribeRun(run));
    const std::string prefix = "run " + run.name + ": ";
    if (run.images.empty() && run.detections.empty()) {
      report.missing.push_back(prefix + "images (images.txt with its pictures, or a video)");
    }
    if (run.cameras.empty()) report.missing.push_back(prefix + "camchain.yaml, the camera's calibration");
    if (!run.cameras.empty() && run.cameras.front().focal_sigma_share > 0) {
      report.missing.push_back(prefix +
                               "camchain.yaml: without it the lens is estimated from the images, with less accuracy");
    }
    if (run.odometry.poses.empty()) {
      report.missing.push_back(
          prefix +
          "odometry.tum: without it the motion is estimated from the images alone, and its scale from GPS or "
          "geotagged panoramas");
    }
    for (const std::string& warning : run.warnings) report.warnings.push_back(warning);
  }
  for (const auto& [run, reason] : site.broken_runs) report.warnings.push_back("run " + run + ": " + reason);
  size_t kinds[3] = {};
  size_t positions = 0;
  for (const Reference& reference : site.references) {
    ++kinds[static_cast<size_t>(reference.kind)];
    positions += reference.geotag.has_position ? 1 : 0;
  }
  if (kinds[0] > 0) report.found.push_back(Counted(kinds[0], "panorama"));
  if (kinds[1] > 0) report.found.push_back(Counted(kinds[1], "geotagged photo"));
  if (kinds[2] > 0) report.found.push_back(Counted(kinds[2], "hand-held photo set"));
  if (!site.stations.empty()) report.found.push_back(Counted(site.stations.size(), "station"));
  if (site.tags.Given()) {
    report.found.push_back(fmt::format("tags of family {}{}", site.tags.family,
                                       site.tags.size_m > 0 ? fmt::format(", {} m", site.tags.size_m) : ""));
  }
  DescribeControl(site, report);
  if (!site.aerial.empty()) report.found.push_back("aerial image " + site.aerial.filename().string());
  if (origin) {
    report.found.push_back(fmt::format("origin {:.9f}, {:.9f}, {:.3f} m ({})", origin->position.latitude_deg,
                                       origin->position.longitude_deg, origin->position.height_m, origin->source));
  }
  if (NamesOfRuns(site).empty())
    report.missing.push_back("runs: runs/<run>/ with images.txt, camchain.yaml, odometry.tum");
  if (site.references.empty()) {
    report.missing.push_back(
        "panoramas (panoramas.csv), geotagged photos (photos.csv) or photo sets (photos/<set>/): "
        "without them `localize` gives only each run's own frame");
  } else if (positions == 0) {
    report.missing.push_back("positions of the panoramas: without them the results are not georeferenced");
  }
  if (!origin) report.missing.push_back("an origin: no control point, panorama or GPS fix georeferences this site");
  if (site.stations.empty() || !site.tags.Given()) {
    report.missing.push_back("stations.csv and tags.yaml: `evaluate` needs tags at the stations as ground truth");
  }
  for (const std::string& warning : site.warnings) report.warnings.push_back(warning);
}

std::string NewProjectFile(const fs::path& dir, const Site& site, const std::optional<SiteOrigin>& origin) {
  std::string text =
      "# A Trigpoint project. Every key has a default; docs/file_formats.md lists them.\n"
      "schema: 1\n";
  text += "name: " + Quoted(dir.filename().string()) + "\n";
  if (origin) {
    const Geodetic& g = origin->position;
    text += fmt::format("# Where the site's east-north-up frame begins: {}.\n", origin->source);
    text += fmt::format("origin: {{latitude_deg: {:.9f}, longitude_deg: {:.9f}, height_m: {:.4f}}}\n", g.latitude_deg,
                        g.longitude_deg, g.height_m);
    if (std::abs(g.latitude_deg) < 80) text += fmt::format("crs: EPSG:{}\n", UtmFromGeodetic(g).EpsgCode());
  }
  text += "# Folders below runs/ that take part.\nruns: " + QuotedList(NamesOfRuns(site)) + "\n";
  text +=
      "# survey, evaluation or both; overrides the role in the run's run.yaml.\n"
      "roles: {}\n"
      "gates: {}\n"
      "# Further sets of results: {<variant>: {<stage>: {<option>: value}}}.\n"
      "variants: {}\n"
      "# Options that differ from their defaults: {<stage>: {<option>: value}}; `trigpoint <stage> --help` lists "
      "them.\n"
      "stages: {}\n";
  return text;
}

// Adds runs to a one-line `runs: [...]` of a file that is otherwise the user's own; false if it has another form.
bool AddRuns(std::string& text, const std::vector<std::string>& all) {
  size_t begin = text.starts_with("runs:") ? 0 : text.find("\nruns:");
  if (begin == std::string::npos) return false;
  if (text[begin] == '\n') ++begin;
  const size_t end = std::min(text.find('\n', begin), text.size());
  const std::string_view value = Trim(std::string_view(text).substr(begin + 5, end - begin - 5));
  if (!value.starts_with('[') || !value.ends_with(']')) return false;
  text.replace(begin, end - begin, "runs: " + QuotedList(all));
  return true;
}

fs::path ExistingFolder(const fs::path& dir) {
  std::error_code failure;
  if (!fs::exists(dir, failure)) throw InputError(dir.string() + ": there is no such folder");
  if (!fs::is_directory(dir, failure)) throw InputError(dir.string() + ": expected a project folder, found a file");
  const fs::path canonical = fs::canonical(dir, failure);
  if (failure) throw InputError(dir.string() + ": cannot be opened: " + failure.message());
  return canonical;
}

// With what each file that is there lacks: it is often the one that was meant.
[[noreturn]] void ThrowNothingFound(const Site& site) {
  const std::vector<std::string> unused = UnusedTables(site.dir);
  const std::vector<std::string>& reasons = unused.empty() ? site.warnings : unused;
  constexpr size_t kNamed = 3;
  std::string text;
  for (size_t i = 0; i < std::min(reasons.size(), kNamed); ++i) text += (i == 0 ? " Found: " : "; ") + reasons[i];
  if (reasons.size() > kNamed) text += fmt::format("; and {} more", reasons.size() - kNamed);
  throw InputError(site.dir.string() +
                   ": expected a folder in the layout of docs/file_formats.md, with a usable runs/<run>/ (images.txt), "
                   "panoramas.csv, photos.csv, photos/ or control_points.csv, found none." +
                   text);
}

}  // namespace

struct Project::Shared {
  explicit Shared(const fs::path& dir) : hashes(dir, dir / "results" / ".hashes") {}
  FileHashes hashes;
  std::mutex mutex;
  std::weak_ptr<ProjectLock> lock;
};

std::optional<SiteOrigin> FindOrigin(const Site& site) {
  if (site.origin) return SiteOrigin{*site.origin, "from origin.json"};
  GeodeticMean control, references, gps;
  for (const ControlPoint& point : site.control_points) {
    if (point.geodetic) control.Add(*point.geodetic, true);
  }
  if (control.count() > 0) {
    return SiteOrigin{Rounded(control.Mean()), "the mean of " + Counted(control.count(), "control point")};
  }
  for (const Reference& reference : site.references) {
    if (reference.geotag.has_position) references.Add(reference.geotag.position, reference.geotag.has_height);
  }
  if (references.count() > 0) {
    return SiteOrigin{Rounded(references.Mean()), "the mean of " + Counted(references.count(), "geotag")};
  }
  for (const Run& run : site.runs) {
    for (const GpsFix& fix : run.gps) gps.Add(fix.position, fix.sigma_v_m < kUnknownHeightSigma);
  }
  if (gps.count() > 0) {
    return SiteOrigin{Rounded(gps.Mean()), "the mean of " + Counted(gps.count(), "GPS fix", "GPS fixes")};
  }
  return std::nullopt;
}

void CheckVariantName(const std::string& variant) {
  const bool fits = !variant.empty() && variant.front() != '.' &&
                    variant.find_first_of(std::string("/\\@\n\0", 5)) == std::string::npos;
  if (!fits) {
    throw OptionError("the name '" + variant + "' cannot be part of a folder's name; use letters, digits, '-' and '_'");
  }
}

Project Project::Open(const fs::path& dir) { return OpenWith(dir, nullptr); }

Project Project::OpenToCompute(const fs::path& dir) {
  const int expired = ForgetExpiredPanoramas(dir);
  Project project = Open(dir);
  if (expired > 0) {
    project.warnings_.push_back(
        Counted(expired, "panorama was", "panoramas were") +
        " deleted: their source forbids to keep them longer; import them again (panoramas.csv as it was: " +
        "results/replaced/)");
  }
  return project;
}

Project Project::OpenTolerant(const fs::path& dir, std::vector<std::string>* problems) {
  return OpenWith(dir, problems);
}

namespace {

void KeepListedRuns(const std::vector<std::string>& runs, const std::vector<std::string>& there, Site* site,
                    std::vector<std::string>* warnings) {
  const std::set<std::string> listed(runs.begin(), runs.end());
  for (const std::string& run : there) {
    if (listed.count(run) > 0) continue;
    warnings->push_back("run " + run + " is not listed in " + kProjectFile +
                        " and takes no part; `trigpoint init` adds it");
  }
  std::erase_if(site->runs, [&](const Run& run) { return listed.count(run.name) == 0; });
  std::erase_if(site->broken_runs, [&](const auto& run) { return listed.count(run.first) == 0; });
}

// `key` of the project's file names a run.
void RequireRun(const std::string& run, const std::string& key, const std::vector<std::string>& there,
                const fs::path& dir) {
  if (std::find(there.begin(), there.end(), run) != there.end()) return;
  throw InputError((dir / kProjectFile).string() + ": key '" + key + "': there is no run '" + run + "' below runs/" +
                   NearestHint(run, there));
}

void TakeControlRoles(const Review& review, Site* site) {
  for (ControlPoint& point : site->control_points) {
    const auto role = review.roles().find("control:" + ReviewControlName(point));
    if (role == review.roles().end()) continue;
    point.control = role->second == "control";
    point.has_role = true;
  }
}

// The project's own against that of the site's origin.json.
void CompareOrigins(const Geodetic& own, const Geodetic& site, std::vector<std::string>* warnings) {
  const double apart = (EcefFromGeodetic(own) - EcefFromGeodetic(site)).norm();
  if (apart > 1e-3) {
    warnings->push_back(fmt::format("origin.json and {} name origins {:.3f} m apart; the one in {} is used",
                                    kProjectFile, apart, kProjectFile));
  }
}

}  // namespace

Project Project::OpenWith(const fs::path& dir_in, std::vector<std::string>* problems) {
  // Without a place for them, problems end it.
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (const Error& e) {
      if (problems == nullptr) throw;
      problems->emplace_back(e.what());
    }
  };
  Project project;
  project.dir_ = ExistingFolder(dir_in);
  const fs::path& dir = project.dir_;
  ProjectFile file;
  const bool has_file = fs::exists(dir / kProjectFile);
  attempt([&] {  // before the site: its errors come first and fast
    if (has_file) file = ReadProjectFile(dir);
  });
  attempt([&] { project.site_ = problems == nullptr ? ReadSite(dir) : ReadSiteTolerant(dir, problems); });
  attempt([&] {
    if (!has_file && !KnowsAnything(project.site_)) ThrowNothingFound(project.site_);
  });
  project.name_ = file.name.empty() ? dir.filename().string() : file.name;
  project.crs_ = file.crs;
  project.stages_ = std::move(file.stages);
  project.variants_ = std::move(file.variants);
  project.gates_ = std::move(file.gates);
  project.warnings_ = project.site_.warnings;

  const std::vector<std::string> there = NamesOfRuns(project.site_);
  if (file.runs) {
    for (const std::string& run : *file.runs) attempt([&] { RequireRun(run, "runs", there, dir); });
    KeepListedRuns(*file.runs, there, &project.site_, &project.warnings_);
  }
  for (const auto& [run, role] : file.roles) {
    attempt([&, &run = run] { RequireRun(run, "roles", there, dir); });
    for (Run& r : project.site_.runs) {
      if (r.name == run) r.config.role = role;
    }
  }
  project.review_ = Review::Read(dir / "review.jsonl", &project.warnings_);
  TakeControlRoles(project.review_, &project.site_);
  const std::optional<SiteOrigin> found = FindOrigin(project.site_);
  if (file.origin || found) {
    project.has_frame_ = true;
    project.frame_ = LocalFrame(file.origin ? *file.origin : found->position);
  }
  if (file.origin && project.site_.origin) CompareOrigins(*file.origin, *project.site_.origin, &project.warnings_);
  project.shared_ = std::make_shared<Shared>(dir);
  return project;
}

InitReport DescribeFolder(const fs::path& dir_in) {
  const fs::path dir = ExistingFolder(dir_in);
  InitReport report;
  report.file = dir / kProjectFile;
  const Site site = ReadSite(dir);
  if (!KnowsAnything(site)) ThrowNothingFound(site);
  std::optional<SiteOrigin> origin = FindOrigin(site);
  if (fs::exists(report.file)) {
    if (const ProjectFile file = ReadProjectFile(dir); file.origin)
      origin = SiteOrigin{*file.origin, std::string("from ") + kProjectFile};
  }
  Describe(site, origin, report);
  return report;
}

InitReport Project::Init(const fs::path& dir_in) {
  const fs::path dir = ExistingFolder(dir_in);
  InitReport report;
  report.file = dir / kProjectFile;
  report.created = !fs::exists(report.file);
  ProjectFile old;
  if (!report.created) old = ReadProjectFile(dir);
  const Site site = ReadSite(dir);
  if (!KnowsAnything(site)) ThrowNothingFound(site);
  std::optional<SiteOrigin> origin = FindOrigin(site);
  if (origin) origin->position = Rounded(origin->position);
  if (report.created) {
    WriteFileAtomically(report.file, NewProjectFile(dir, site, origin));
  } else if (old.runs) {
    std::vector<std::string> runs = *old.runs;
    std::vector<std::string> added;
    for (const std::string& run : NamesOfRuns(site)) {
      if (std::find(runs.begin(), runs.end(), run) == runs.end()) added.push_back(run);
    }
    runs.insert(runs.end(), added.begin(), added.end());
    std::string text = ReadTextFile(report.file);
    if (added.empty()) {
      // nothing new
    } else if (AddRuns(text, runs)) {
      report.kept = ReplaceInputFile(dir, kProjectFile, text);
      report.added = AddedLines(report.kept, report.file);
    } else {
      report.warnings.push_back(fmt::format("add {} to `runs:` in {} to use it", fmt::join(added, ", "), kProjectFile));
    }
  }
  if (old.origin) origin = SiteOrigin{*old.origin, std::string("from ") + kProjectFile};
  Describe(site, origin, report);
  Open(dir);  // what was written must be readable, and what the user wrote before is checked in full
  return report;
}

InitReport LookAt(const fs::path& dir_in) {
  InitReport report;
  const fs::path dir = ExistingFolder(dir_in);
  report.file = dir / kProjectFile;
  const Site site = ReadSite(dir);
  Describe(site, FindOrigin(site), report);
  return report;
}

const Run& Project::run(const std::string& name) const {
  for (const Run& run : site_.runs) {
    if (run.name == name) return run;
  }
  if (const auto broken = site_.broken_runs.find(name); broken != site_.broken_runs.end()) {
    throw InputError(broken->second);
  }
  throw InputError("project " + dir_.string() + " has no run '" + name + "'" + NearestHint(name, RunNames()));
}

std::vector<std::string> Project::RunNames() const { return NamesOfRuns(site_); }

fs::path Project::ResultDir(const std::string& stage, const std::string& name) const {
  if (name.empty() || name.front() == '@') return results() / (stage + name);
  return results() / stage / name;
}

std::shared_ptr<ProjectLock> Project::Lock() const {
  const std::lock_guard guard(shared_->mutex);
  std::shared_ptr<ProjectLock> lock = shared_->lock.lock();
  if (!lock) shared_->lock = lock = std::make_shared<ProjectLock>(results());
  return lock;
}

FileHashes& Project::hashes() const { return shared_->hashes; }

}  // namespace trigpoint
