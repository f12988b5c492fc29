#include "datasets/io/site.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/gps.h"
#include "datasets/io/path_error.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/site_inputs.h"
#include "datasets/io/survey_tables.h"
#include "datasets/io/tables.h"

namespace trigpoint {
namespace {

std::vector<std::filesystem::path> FoldersIn(const std::filesystem::path& dir) {
  std::vector<std::filesystem::path> folders;
  if (!std::filesystem::is_directory(dir)) return folders;
  for (const auto& entry : std::filesystem::directory_iterator(dir)) {
    if (entry.is_directory() && !entry.path().filename().string().starts_with('.')) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

// Without a place for problems, those of settings end it, and so do those of data where no run has any.
void ReadRuns(Site* site, std::vector<std::string>* problems) {
  std::optional<InputError> first;
  const auto leave_out = [&](const std::filesystem::path& folder, const InputError& e) {
    if (!first) first = e;
    const std::string name = folder.filename().string();
    site->broken_runs[name] = e.what();
    site->warnings.push_back(std::string(e.what()) + "; run '" + name + "' is left out");
  };
  for (const std::filesystem::path& folder : FoldersIn(site->dir / "runs")) {
    Run run;
    try {
      run = ReadRunSettings(folder, site->dir);
    } catch (const InputError& e) {
      if (problems == nullptr) throw;
      leave_out(folder, e);
      continue;
    }
    try {
      ReadRunData(site->dir, &run);
      site->runs.push_back(std::move(run));
    } catch (const PathError& e) {
      if (problems == nullptr) throw;
      leave_out(folder, e);
    } catch (const InputError& e) {
      leave_out(folder, e);
    }
  }
  if (problems == nullptr && site->runs.empty() && first) throw *first;
}

// A picture belongs to one reference: its features go by its name.
void Append(std::vector<Reference> more, Site* site) {
  std::map<std::filesystem::path, std::string> owners;
  for (const Reference& r : site->references) {
    for (const std::filesystem::path& file : r.files) owners.emplace(file.lexically_normal(), r.name);
  }
  for (Reference& reference : more) {
    std::string problem;
    for (const std::filesystem::path& file : reference.files) {
      const auto owner = owners.find(file.lexically_normal());
      if (owner == owners.end()) continue;
      problem = "panorama or photo '" + reference.name + "' is listed twice";
      if (owner->second != reference.name)
        problem += ": its file " + file.string() + " belongs to '" + owner->second + "'";
    }
    if (!problem.empty()) {
      site->warnings.push_back(problem + "; the second entry is skipped, remove one of them");
      continue;
    }
    for (const std::filesystem::path& file : reference.files) owners.emplace(file.lexically_normal(), reference.name);
    site->references.push_back(std::move(reference));
  }
}

// Tables and pictures. Returns of each table that gave nothing why: it is left out like a bad row is, as the site may
// do without it.
std::vector<std::string> ReadTables(Site* site) {
  std::vector<std::string> unused;
  const auto lenient = [&](const char* name, const auto& read) {
    const std::filesystem::path file = site->dir / name;
    if (!std::filesystem::exists(file)) return false;
    try {
      if (read(file) > 0) return true;
      unused.push_back(file.string() + ": expected rows below the header, found none");
    } catch (const PathError&) {
      throw;
    } catch (const InputError& e) {
      unused.push_back(e.what());
    }
    site->warnings.push_back(unused.back() + "; nothing of this file is used");
    return true;
  };
  const auto append = [&](std::vector<Reference> more) {
    const size_t count = more.size();
    Append(std::move(more), site);
    return count;
  };
  std::vector<std::string>* warnings = &site->warnings;
  const bool table = lenient("panoramas.csv", [&](const std::filesystem::path& file) {
    return append(ReadPanoramaTable(file, site->dir, warnings));
  });
  if (!table) append(ReadPanoramaFolder(site->dir / "panoramas", site->dir, warnings));
  lenient("photos.csv",
          [&](const std::filesystem::path& file) { return append(ReadPhotoTable(file, site->dir, warnings)); });
  append(ReadPhotoSets(site->dir / "photos", warnings));
  lenient("stations.csv",
          [&](const std::filesystem::path& file) { return (site->stations = ReadStations(file, warnings)).size(); });
  lenient("control_points.csv", [&](const std::filesystem::path& file) {
    return (site->control_points = ReadControlPoints(file, warnings)).size();
  });
  return unused;
}

Site ReadParts(const std::filesystem::path& dir, std::vector<std::string>* problems) {
  Site site;
  site.dir = std::filesystem::absolute(dir).lexically_normal();
  if (!site.dir.has_filename()) site.dir = site.dir.parent_path();
  if (!std::filesystem::is_directory(site.dir)) {
    throw InputError(site.dir.string() + ": there is no such folder");
  }
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (const InputError& e) {
      if (problems == nullptr) throw;
      problems->emplace_back(e.what());
    }
  };
  const auto present = [&](const char* name) { return std::filesystem::exists(site.dir / name); };
  if (present("origin.json")) attempt([&] { site.origin = ReadOrigin(site.dir / "origin.json"); });
  if (present("tags.yaml")) attempt([&] { site.tags = ReadTagSizes(site.dir / "tags.yaml"); });
  ReadRuns(&site, problems);
  attempt([&] { ReadTables(&site); });
  LeaveOutFarPlaces(&site);
  if (present("aerial.tif")) {
    if (IsGeoTiff(site.dir / "aerial.tif")) {
      site.aerial = site.dir / "aerial.tif";
    } else {
      site.warnings.push_back((site.dir / "aerial.tif").string() +
                              ": expected a georeferenced TIFF (GeoTIFF); it is not used");
    }
  }
  return site;
}

}  // namespace

Site ReadSite(const std::filesystem::path& dir) { return ReadParts(dir, nullptr); }

Site ReadSiteTolerant(const std::filesystem::path& dir, std::vector<std::string>* problems) {
  return ReadParts(dir, problems);
}

std::vector<std::string> UnusedTables(const std::filesystem::path& site_dir, const std::vector<std::string>& runs) {
  Site site;
  site.dir = site_dir;
  std::vector<std::string> unused = ReadTables(&site), ignored;
  const auto look = [&](const std::filesystem::path& file, const auto& read, size_t least = 1) {
    if (!std::filesystem::exists(file)) return;
    try {
      if (read(file) < least) unused.push_back(file.string() + ": expected rows below the header, found none");
    } catch (const InputError& e) {
      unused.push_back(e.what());
    }
  };
  look(site_dir / "distances.csv",
       [&](const std::filesystem::path& file) { return ReadDistances(file, &ignored).size(); });
  look(
      site_dir / "control_observations.csv",
      [&](const std::filesystem::path& file) { return ReadControlObservations(file, &ignored).size(); },
      0);  // `mark` leaves the header where the last mark is removed
  for (const std::string& run : runs) {
    const std::filesystem::path dir = site_dir / "runs" / run;
    const auto gps = GpsFile(dir);
    if (!gps) continue;
    look(*gps, [&](const std::filesystem::path& file) {
      return ReadGpsFile(file, ReadRunConfig(dir / "run.yaml")).fixes.size();
    });
  }
  return unused;
}

bool IsInputPath(const std::filesystem::path& relative) {
  static const std::set<std::string> folders = {"runs", "panoramas", "photos", "models", "releases", "estimates"};
  static const std::set<std::string> files = {"trigpoint.yaml",
                                              "review.jsonl",
                                              "origin.json",
                                              "tags.yaml",
                                              "panoramas.csv",
                                              "photos.csv",
                                              "stations.csv",
                                              "distances.csv",
                                              "control_points.csv",
                                              "aerial.tif",
                                              "control_observations.csv",
                                              "total_station.csv",
                                              "gcp_list.txt",
                                              "ground_control_points.json",
                                              "plan.csv",
                                              "plan.geojson"};
  const std::filesystem::path normal = relative.lexically_normal();
  if (normal.empty()) return false;
  return folders.count(normal.begin()->string()) > 0 || files.count(normal.string()) > 0;
}

}  // namespace trigpoint
