// Input: a letter that says which reader, then a file of that kind: those of a project, its results and its releases.
#include "datasets/io/site_sketch.h"
#include "datasets/project/files.h"
#include "datasets/project/manifest.h"
#include "datasets/project/release_files.h"
#include "datasets/project/review.h"
#include "datasets/project/stage.h"
#include "eval/errors/evaluation_files.h"
#include "eval/errors/results.h"
#include "eval/trajectory/estimates.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/total_station.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using namespace trigpoint;
namespace fs = std::filesystem;

// Makes the file's folder one that opens as a project.
fs::path ProjectOf(const fs::path& folder) {
  if (!fs::exists(folder / "control_points.csv")) {
    std::ofstream(folder / "control_points.csv") << "tag_id,role,latitude_deg,longitude_deg,height_m,sigma_h_m\n"
                                                    "1,control,48.0,7.8,240,0.01\n";
  }
  return folder;
}

void OpenProject(const fs::path& folder) {
  std::vector<std::string> problems;
  Project::OpenTolerant(ProjectOf(folder), &problems);
  Project::Open(folder);
}

// As somebody would write it who wants it to be believed: with its hash.
void ReadManifestOf(const fs::path& file) {
  const fs::path folder = file.parent_path();
  nlohmann::json manifest = nlohmann::json::parse(std::ifstream(file), nullptr, false);
  if (manifest.is_object()) {
    manifest.erase("sha256");
    manifest["sha256"] = Sha256(DumpJson(manifest));
    std::ofstream(file) << DumpJson(manifest);
  }
  const Project project = Project::Open(ProjectOf(folder.parent_path().parent_path()));
  StageRequest request;
  request.stage = folder.filename().string();
  request.inputs = {file};  // as a later stage names it
  StateOf(project, request, 1);
  const bool damaged = !ManifestDamage(project, request.stage, "").empty();
  if (damaged == ReadManifest(project, request.stage, "").has_value()) std::abort();
}

void ReadRelease(const fs::path& folder) {
  const ReleaseRecord record = ReadReleaseRecord(folder);
  for (const auto& [path, file] : record.files) {
    if (!StaysInside(path)) std::abort();
  }
  CompareRelease(folder, record, 1, {});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  static constexpr const char* kNames[] = {"yaml/trigpoint.yaml",
                                           "review/review.jsonl",
                                           "manifest/results/survey/manifest.json",
                                           "plan.geojson",
                                           "total_station.csv",
                                           "release/release.json",
                                           "hashes/results/.hashes",
                                           "reference.csv",
                                           "tags.csv",
                                           "tags_cov.csv",
                                           "errors.csv",
                                           "system.yaml",
                                           "poses.csv"};
  const size_t kind = data[0] % std::size(kNames);
  const fs::path file = FuzzFile(kNames[kind], data + 1, size - 1), folder = file.parent_path();
  std::vector<std::string> warnings;
  try {
    switch (kind) {
      case 0:
      case 1: OpenProject(folder); break;
      case 2: ReadManifestOf(file); break;
      case 3: ReadSiteSketch(file); break;
      case 4: ReadTotalStation(file, &warnings); break;
      case 5: ReadRelease(folder); break;
      case 6: OpenProject(folder.parent_path()); break;
      case 7: ReadReferencePoses(file); break;
      case 8: ReadTagResults(file); break;
      case 9: ReadTagCovariances(file); break;
      case 10: ReadErrors(file); break;
      case 11: ReadSystemConfig(file); break;
      default: ReadPoseSequence(file);
    }
  } catch (const Error& e) {
    ExpectOneSentence(e);
  }
  return 0;
}
