#include "datasets/io/site.h"

#include <algorithm>
#include <optional>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/path_error.h"
#include "datasets/io/run_parts.h"
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

void ReadRuns(Site* site) {
  std::optional<InputError> first;
  for (const std::filesystem::path& folder : FoldersIn(site->dir / "runs")) {
    Run run = ReadRunSettings(folder, site->dir);
    try {
      ReadRunData(site->dir, &run);
      site->runs.push_back(std::move(run));
    } catch (const PathError&) {
      throw;
    } catch (const InputError& e) {
      if (!first) first = e;
      const std::string name = folder.filename().string();
      site->broken_runs[name] = e.what();
      site->warnings.push_back(std::string(e.what()) + "; run '" + name + "' is left out");
    }
  }
  if (site->runs.empty() && first) throw *first;
}

void Append(std::vector<Reference> more, Site* site) {
  for (Reference& reference : more) {
    const bool taken = std::any_of(site->references.begin(), site->references.end(),
                                   [&](const Reference& other) { return other.name == reference.name; });
    if (taken) {
      site->warnings.push_back("reference '" + reference.name + "' is brought twice; the second is skipped");
    } else {
      site->references.push_back(std::move(reference));
    }
  }
}

}  // namespace

Site ReadSite(const std::filesystem::path& dir) {
  Site site;
  site.dir = std::filesystem::absolute(dir).lexically_normal();
  if (!site.dir.has_filename()) site.dir = site.dir.parent_path();
  if (!std::filesystem::is_directory(site.dir)) {
    throw InputError(site.dir.string() + ": there is no such folder");
  }
  const auto present = [&](const char* name) { return std::filesystem::exists(site.dir / name); };
  if (present("origin.json")) site.origin = ReadOrigin(site.dir / "origin.json");
  if (present("tags.yaml")) site.tags = ReadTagSizes(site.dir / "tags.yaml");
  ReadRuns(&site);
  // A table none of whose rows can be used is left out like a bad row is: the site may do without it.
  const auto lenient = [&](const auto& read) {
    try {
      read();
    } catch (const PathError&) {
      throw;
    } catch (const InputError& e) {
      site.warnings.push_back(std::string(e.what()) + "; nothing of this file is used");
    }
  };
  if (present("panoramas.csv")) {
    lenient([&] { Append(ReadPanoramaTable(site.dir / "panoramas.csv", site.dir, &site.warnings), &site); });
  } else {
    Append(ReadPanoramaFolder(site.dir / "panoramas", site.dir, &site.warnings), &site);
  }
  if (present("photos.csv")) {
    lenient([&] { Append(ReadPhotoTable(site.dir / "photos.csv", site.dir, &site.warnings), &site); });
  }
  Append(ReadPhotoSets(site.dir / "photos", &site.warnings), &site);
  if (present("stations.csv")) {
    lenient([&] { site.stations = ReadStations(site.dir / "stations.csv", &site.warnings); });
  }
  if (present("control_points.csv")) {
    lenient([&] { site.control_points = ReadControlPoints(site.dir / "control_points.csv", &site.warnings); });
  }
  if (present("aerial.tif")) site.aerial = site.dir / "aerial.tif";
  return site;
}

}  // namespace trigpoint
