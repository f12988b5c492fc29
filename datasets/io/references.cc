// Panoramas, photos and photo sets.
#include <algorithm>
#include <map>
#include <set>

#include "calib/base/error.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif_positions.h"
#include "datasets/io/expired_panoramas.h"
#include "datasets/io/geodetic_mean.h"
#include "datasets/io/gps_order.h"
#include "datasets/io/table_position.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

std::vector<std::string> GeoTagColumns() {
  std::vector<std::string> columns = {"station",   "heading_deg",       "pitch_deg",      "roll_deg",  "sigma_h_m",
                                      "sigma_v_m", "sigma_heading_deg", "sigma_tilt_deg", "source",    "captured_at",
                                      "licence",   "attribution",       "mask",           "keep_until"};
  columns.insert(columns.end(), PositionColumns().begin(), PositionColumns().end());
  return columns;
}

double PositiveSigma(const CsvRow& row, const char* column, double missing) {
  const double sigma = row.Number(column, missing);
  if (!(sigma > 0)) row.Fail(std::string("column ") + column + ": expected a sigma above 0, found " + row.Text(column));
  return sigma;
}

GeoTag ReadGeoTag(const CsvRow& row) {
  GeoTag tag;
  if (const auto stated = PositionOfRow(row)) {
    tag.has_position = true;
    tag.position = stated->position;
    tag.has_height = stated->has_height;
  }
  tag.has_heading = row.Has("heading_deg");
  tag.attitude.heading_rad = row.Number("heading_deg", 0) * kDegToRad;
  tag.has_tilt = row.Has("pitch_deg") || row.Has("roll_deg");
  tag.attitude.pitch_rad = row.Number("pitch_deg", 0) * kDegToRad;
  tag.attitude.roll_rad = row.Number("roll_deg", 0) * kDegToRad;
  tag.sigma_h_m = PositiveSigma(row, "sigma_h_m", tag.sigma_h_m);
  tag.sigma_v_m = PositiveSigma(row, "sigma_v_m", tag.sigma_v_m);
  tag.sigma_heading_rad = PositiveSigma(row, "sigma_heading_deg", tag.sigma_heading_rad * kRadToDeg) * kDegToRad;
  tag.sigma_tilt_rad = PositiveSigma(row, "sigma_tilt_deg", tag.sigma_tilt_rad * kRadToDeg) * kDegToRad;
  return tag;
}

// What the row does not say at all is taken from the file, if that can be read.
GeoTag GeoTagOfRow(const CsvRow& row, const std::filesystem::path& file, std::vector<std::string>* warnings) {
  GeoTag tag = ReadGeoTag(row);
  if (tag.has_position || tag.has_heading || tag.has_tilt) return tag;
  try {
    return GeoTagFromMetadata(ReadPhotoMetadata(file), file, warnings);
  } catch (const InputError&) {
    return tag;  // the picture itself is judged on use
  }
}

Reference OneFile(ReferenceKind kind, const std::string& name, const std::string& station,
                  const std::filesystem::path& file) {
  Reference reference;
  reference.kind = kind;
  reference.name = name;
  reference.station = station.empty() ? name : station;
  reference.files = {file};
  return reference;
}

std::filesystem::path MaskOfRow(const CsvRow& row, const std::filesystem::path& site_dir) {
  if (!row.Has("mask")) return {};
  const std::filesystem::path mask = ResolveInside(site_dir, site_dir, row.Text("mask"), row.Where("mask"));
  CheckPresent(mask, row.Where("mask"));
  return mask;
}

void WarnIfNoPosition(const Reference& reference, std::vector<std::string>* warnings) {
  if (!reference.geotag.has_position) {
    warnings->push_back(reference.name + ": no geotag, neither in a table nor in its EXIF; it can be localized, but " +
                        "does not georeference the site");
  }
}

}  // namespace

void CheckPresent(const std::filesystem::path& file, const std::string& where) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (error) throw InputError(where + ": there is no file " + file.string());
  if (size == 0) throw InputError(where + ": the file " + file.string() + " is empty (0 bytes)");
}

std::vector<Reference> ReadPanoramaTable(const std::filesystem::path& file, const std::filesystem::path& site_dir,
                                         std::vector<std::string>* warnings) {
  std::vector<Reference> references;
  std::set<std::string> names;
  const CsvTable table = CsvTable::Read(file, {"file"}, GeoTagColumns());
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    const std::string& name = row.Text("file");
    const std::filesystem::path path = ResolveInside(site_dir, site_dir, name, row.Where());
    if (IsOver(row.Text("keep_until"))) {
      row.Fail("its source allows to keep it until " + row.Text("keep_until") + "; import it again");
    }
    CheckPresent(path, row.Where());
    Reference reference = OneFile(ReferenceKind::kPanorama, name, row.Text("station"), path);
    reference.mask = MaskOfRow(row, site_dir);
    reference.geotag = GeoTagOfRow(row, path, warnings);
    if (!names.insert(name).second) row.Fail("panorama '" + name + "' stands in the table twice");
    WarnIfNoPosition(reference, warnings);
    references.push_back(std::move(reference));
  });
  return references;
}

std::vector<Reference> ReadPanoramaFolder(const std::filesystem::path& dir, const std::filesystem::path& site_dir,
                                          std::vector<std::string>* warnings) {
  std::vector<Reference> references;
  for (const std::filesystem::path& file : PicturesIn(dir)) {
    try {
      Reference reference =
          OneFile(ReferenceKind::kPanorama, file.lexically_relative(site_dir).string(), file.stem().string(), file);
      reference.geotag = GeoTagFromMetadata(ReadPhotoMetadata(file), file, warnings);
      WarnIfNoPosition(reference, warnings);
      references.push_back(std::move(reference));
    } catch (const InputError& e) {
      warnings->push_back(std::string(e.what()) + "; the panorama is skipped");
    }
  }
  return references;
}

std::vector<Reference> ReadPhotoTable(const std::filesystem::path& file, const std::filesystem::path& site_dir,
                                      std::vector<std::string>* warnings) {
  std::vector<Reference> references;
  std::set<std::string> names;
  std::map<std::filesystem::path, Camera> cameras;
  std::vector<std::string> optional = GeoTagColumns();
  optional.push_back("camera");
  const CsvTable table = CsvTable::Read(file, {"file"}, optional);
  warnings->insert(warnings->end(), table.warnings().begin(), table.warnings().end());
  table.ForEachUsable(warnings, [&](const CsvRow& row) {
    const std::string& name = row.Text("file");
    const std::filesystem::path path = ResolveInside(site_dir, site_dir, name, row.Where());
    CheckPresent(path, row.Where());
    Reference reference = OneFile(ReferenceKind::kPhoto, name, row.Text("station"), path);
    reference.mask = MaskOfRow(row, site_dir);
    if (row.Has("camera")) {
      const std::filesystem::path chain = ResolveInside(site_dir, site_dir, row.Text("camera"), row.Where("camera"));
      if (!cameras.contains(chain)) {
        try {
          cameras.emplace(chain, ReadCamchain(chain).front().camera);
        } catch (const InputError& e) {
          row.Fail(std::string("column camera: ") + e.what());
        }
      }
      reference.camera = cameras.at(chain);
    } else {
      reference.camera = CameraFromMetadata(ReadPhotoMetadata(path));
      if (!reference.camera) {
        row.Fail(
            "no camera is given and the photo's EXIF states no focal length; name a camchain file in column "
            "'camera'");
      }
    }
    reference.geotag = GeoTagOfRow(row, path, warnings);
    if (!names.insert(name).second) row.Fail("photo '" + name + "' stands in the table twice");
    WarnIfNoPosition(reference, warnings);
    references.push_back(std::move(reference));
  });
  return references;
}

std::vector<Reference> ReadPhotoSets(const std::filesystem::path& dir, std::vector<std::string>* warnings) {
  std::vector<Reference> references;
  if (!std::filesystem::is_directory(dir)) return references;
  std::vector<std::filesystem::path> folders;
  for (const auto& entry : std::filesystem::directory_iterator(dir)) {
    const bool hidden = entry.path().filename().string().starts_with('.');  // ".thumbnails"
    if (entry.is_directory() && !hidden) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  for (const std::filesystem::path& folder : folders) {
    Reference set;
    set.kind = ReferenceKind::kPhotoSet;
    set.name = set.station = folder.filename().string();
    GeodeticMean mean;  // of the geotags
    std::vector<PhotoMetadata> photos;
    for (const std::filesystem::path& file : PicturesIn(folder)) {
      try {
        const PhotoMetadata& metadata = photos.emplace_back(ReadPhotoMetadata(file));
        if (!set.camera) set.camera = CameraFromMetadata(metadata);
        if (metadata.position) {
          std::vector<std::string> ignored;
          const GeoTag tag = GeoTagFromMetadata(metadata, file, mean.count() == 0 ? warnings : &ignored);
          mean.Add(tag.position, tag.has_height);
          set.geotag.position = mean.Mean();
          set.geotag.has_position = true;
          set.geotag.has_height = mean.heights() == mean.count();
          set.geotag.sigma_h_m = tag.sigma_h_m;
        }
        set.files.push_back(file);
      } catch (const InputError& e) {
        warnings->push_back(std::string(e.what()) + "; the photo is left out of its set");
      }
    }
    if (set.files.size() < 2) {
      warnings->push_back(folder.string() + ": a hand-held set needs at least two photos, found " +
                          std::to_string(set.files.size()) + "; the set is skipped");
      continue;
    }
    if (const std::string why = WhyNotFromOneSpot(photos); !why.empty()) {
      warnings->push_back(folder.string() + ": " + why + "; the set is skipped: as a walk, make it a run (runs/" +
                          set.name + "/)");
      continue;
    }
    references.push_back(std::move(set));
  }
  return references;
}

}  // namespace trigpoint
