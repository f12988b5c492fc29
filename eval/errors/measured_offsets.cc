#include "eval/errors/measured_offsets.h"

#include <fmt/format.h>

#include <map>

#include "calib/base/error.h"
#include "datasets/io/csv.h"

namespace trigpoint {

namespace fs = std::filesystem;

std::vector<std::string> CheckOffsets(const std::string& how) {
  if (how == "stated" || how == "estimated" || how == "combined") return {};
  return {"offsets: expected stated, estimated or combined, found '" + how + "'"};
}

std::set<std::string> UseMeasuredOffsets(const Project& project, const std::string& how, const std::string& variant,
                                         std::vector<Station>* stations, std::vector<std::string>* notes) {
  if (how == "stated") return {};
  const fs::path file = project.ResultDir("survey", ResultNameOf("", variant)) / "stations.csv";
  if (!fs::exists(file)) {
    throw InputError(file.string() + ": expected the offsets that `trigpoint survey` measures where panoramas show " +
                     "tags, found no such file; evaluate with --offsets stated");
  }
  const std::string value = how == "combined" ? "combined" : "estimated";
  const std::string sigma = how == "combined" ? "combined_sigma" : "sigma";
  const auto vector = [](const CsvRow& row, const std::string& name) {
    return Eigen::Vector3d(row.Number(name + "_east_m"), row.Number(name + "_north_m"), row.Number(name + "_up_m"));
  };
  std::map<std::string, Station> measured;
  const CsvTable table = CsvTable::Read(file, {"station", "status", value + "_east_m", sigma + "_east_m"});
  for (const CsvRow& row : table.rows()) {
    const std::string status = row.Text("status");
    if (status == "unseen" || (how == "combined" && status == "contradicts")) continue;
    Station offset;
    offset.offset_m = vector(row, value);
    offset.sigma_m = vector(row, sigma).maxCoeff();
    measured.emplace(row.Text("station"), offset);  // of several panoramas the first
  }
  std::set<std::string> replaced;
  for (Station& station : *stations) {
    const auto it = measured.find(station.name);
    if (it == measured.end()) continue;
    station.offset_m = it->second.offset_m;
    station.in_tag_frame = false;
    station.sigma_m = it->second.sigma_m;
    replaced.insert(station.name);
  }
  if (replaced.empty()) return replaced;
  notes->push_back(
      fmt::format("Offsets of {} of {} stations are {} by the tags that their panoramas show: images and map are part "
                  "of the reference, so that it is not independent of answers that rest on the same panoramas.",
                  replaced.size(), stations->size(), how));
  return replaced;
}

}  // namespace trigpoint
