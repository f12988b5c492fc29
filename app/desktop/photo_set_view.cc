#include "app/desktop/photo_set_view.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "datasets/io/csv.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

std::optional<double> NumberAt(const json& document, const char* pointer) {
  const json::json_pointer at(pointer);
  if (!document.is_object() || !document.contains(at) || !document.at(at).is_number()) return std::nullopt;
  return document.at(at).get<double>();
}

}  // namespace

PhotoSetView LoadPhotoSet(const fs::path& dir, const std::vector<std::string>& photos) {
  PhotoSetView view;
  for (const std::string& name : photos) {
    PlacedPhoto photo;
    photo.name = name;
    view.photos.push_back(photo);
  }
  if (!fs::exists(dir)) return view;
  std::error_code ignored;
  for (fs::directory_iterator it(dir, ignored), end; it != end; it.increment(ignored)) {
    if (it->path().stem() == "panorama") view.panorama = it->path();
  }
  const auto attempt = [&](const char* file, const auto& read) {
    if (!fs::exists(dir / file)) return;
    try {
      read(dir / file);
    } catch (const Error& e) {
      view.problems.emplace_back(e.what());
    }
  };
  attempt("rig.csv", [&](const fs::path& file) {
    const CsvTable table = CsvTable::Read(file, {"photo", "tx", "ty", "tz", "qx", "qy", "qz", "qw"},
                                          {"sigma_tx_m", "sigma_ty_m", "sigma_tz_m", "focal_px"});
    for (const CsvRow& row : table.rows()) {
      for (PlacedPhoto& photo : view.photos) {
        if (fs::path(photo.name).filename() != fs::path(row.Text("photo")).filename()) continue;
        photo.placed = true;
        photo.x = row.Number("tx"), photo.y = row.Number("ty"), photo.z = row.Number("tz");
        photo.sigma_x = row.Number("sigma_tx_m", 0), photo.sigma_y = row.Number("sigma_ty_m", 0);
        photo.sigma_z = row.Number("sigma_tz_m", 0), photo.focal_px = row.Number("focal_px", 0);
        const double x = row.Number("qx"), y = row.Number("qy"), z = row.Number("qz"), w = row.Number("qw");
        photo.azimuth_rad = std::atan2(2 * (x * z + w * y), 1 - 2 * (x * x + y * y));  // of the rotated z axis
      }
    }
  });
  attempt("pairs.csv", [&](const fs::path& file) {
    const CsvTable table = CsvTable::Read(file, {"photo_a", "photo_b", "matches"});
    for (const CsvRow& row : table.rows()) {
      view.pairs[{row.Text("photo_a"), row.Text("photo_b")}] = static_cast<int>(row.Integer("matches"));
    }
  });
  attempt("rig.json", [&](const fs::path& file) {
    const json document = json::parse(ReadTextFile(file), nullptr, false);
    view.closure_deg = NumberAt(document, "/closure/error_deg");
    view.covered_share = NumberAt(document, "/panorama/covered_share");
    view.parallax_median_px = NumberAt(document, "/parallax/median_px");
  });
  return view;
}

}  // namespace trigpoint
