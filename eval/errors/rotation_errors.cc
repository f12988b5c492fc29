#include "eval/errors/rotation_errors.h"

#include <cmath>
#include <map>
#include <optional>

#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "eval/errors/reference_maps.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct MeasuredRotation {
  Eigen::Quaterniond world_from_pano;
  std::optional<double> sigma_deg;
};
using Rotations = std::map<std::string, MeasuredRotation>;  // by panorama

Rotations ReadRotations(const fs::path& file) {
  Rotations rotations;
  if (!fs::exists(file)) return rotations;
  const CsvTable table = CsvTable::Read(file, {"panorama", "status"}, {"qx", "qy", "qz", "qw", "sigma_rot_deg"});
  for (const CsvRow& row : table.rows()) {
    if (row.Text("status") == "unseen" || !row.Has("qw")) continue;
    MeasuredRotation& r = rotations[row.Text("panorama")];
    r.world_from_pano =
        Eigen::Quaterniond(row.Number("qw"), row.Number("qx"), row.Number("qy"), row.Number("qz")).normalized();
    if (row.Has("sigma_rot_deg")) r.sigma_deg = row.Number("sigma_rot_deg");
  }
  return rotations;
}

struct AnsweredRotation {
  Eigen::Quaterniond world_from_pano;
  std::optional<double> sigma_rad;
};

std::optional<AnsweredRotation> AnswerOf(const ErrorRow& row, const std::vector<EvaluatedRun>& runs) {
  for (const EvaluatedRun& run : runs) {
    if (run.run != row.run || run.variant != row.variant || run.method != row.method) continue;
    for (const PanoramaResult& panorama : run.result.panoramas) {
      if (panorama.panorama != row.panorama || !panorama.world_from_pano) continue;
      AnsweredRotation answer{panorama.world_from_pano->rotation, {}};
      if (const auto it = run.sigma_rot_rad.find(row.panorama); it != run.sigma_rot_rad.end()) {
        answer.sigma_rad = it->second;
      }
      return answer;
    }
  }
  return std::nullopt;
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
    const auto answer = AnswerOf(row, runs);
    if (rotation == known->second.end() || !answer) continue;
    const MeasuredRotation& measured = rotation->second;
    row.error_rot_deg = AngleBetween(answer->world_from_pano, measured.world_from_pano) * kRadToDeg;
    if (measured.sigma_deg && answer->sigma_rad) {
      row.sigma_rot_deg = std::hypot(*measured.sigma_deg, *answer->sigma_rad * kRadToDeg);
    }
  }
}

}  // namespace trigpoint
