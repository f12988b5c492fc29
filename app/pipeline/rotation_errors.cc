#include "app/pipeline/rotation_errors.h"

#include <map>

#include "app/pipeline/reference_maps.h"
#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

using Rotations = std::map<std::string, Eigen::Quaterniond>;  // of world_from_pano, by panorama

Rotations ReadRotations(const fs::path& file) {
  Rotations rotations;
  if (!fs::exists(file)) return rotations;
  const CsvTable table = CsvTable::Read(file, {"panorama", "status"}, {"qx", "qy", "qz", "qw"});
  for (const CsvRow& row : table.rows()) {
    if (row.Text("status") == "unseen" || !row.Has("qw")) continue;
    rotations[row.Text("panorama")] =
        Eigen::Quaterniond(row.Number("qw"), row.Number("qx"), row.Number("qy"), row.Number("qz")).normalized();
  }
  return rotations;
}

const PanoramaResult* AnswerOf(const ErrorRow& row, const std::vector<EvaluatedRun>& runs) {
  for (const EvaluatedRun& run : runs) {
    if (run.run != row.run || run.variant != row.variant || run.method != row.method) continue;
    for (const PanoramaResult& panorama : run.result.panoramas) {
      if (panorama.panorama == row.panorama && panorama.world_from_pano) return &panorama;
    }
  }
  return nullptr;
}

}  // namespace

void FillRotationErrors(const Project& project, const std::vector<EvaluatedRun>& runs, Evaluation* evaluation) {
  std::map<std::string, Rotations> of_map;
  for (ErrorRow& row : evaluation->rows) {
    if (row.kind != "absolute" || row.reference == "control" || !row.error_3d_m) continue;
    auto known = of_map.find(row.reference);
    if (known == of_map.end()) {
      known = of_map.emplace(row.reference, ReadRotations(ReferenceMapFolder(project, row.reference) / "stations.csv"))
                  .first;
    }
    const auto rotation = known->second.find(row.panorama);
    const PanoramaResult* answer = AnswerOf(row, runs);
    if (rotation == known->second.end() || answer == nullptr) continue;
    row.error_rot_deg = AngleBetween(answer->world_from_pano->rotation, rotation->second) * kRadToDeg;
  }
}

}  // namespace trigpoint
