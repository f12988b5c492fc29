// The tables and small files at the top of a site's folder. Bad rows are skipped and named in `warnings`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

std::vector<Reference> ReadPanoramaTable(const std::filesystem::path& file, const std::filesystem::path& site_dir,
                                         std::vector<std::string>* warnings);
// Without a table: every picture of the folder, geotag from EXIF and GPano.
std::vector<Reference> ReadPanoramaFolder(const std::filesystem::path& dir, const std::filesystem::path& site_dir,
                                          std::vector<std::string>* warnings);
std::vector<Reference> ReadPhotoTable(const std::filesystem::path& file, const std::filesystem::path& site_dir,
                                      std::vector<std::string>* warnings);
// Every folder below `dir` with at least two pictures is a hand-held set.
std::vector<Reference> ReadPhotoSets(const std::filesystem::path& dir, std::vector<std::string>* warnings);
std::vector<Station> ReadStations(const std::filesystem::path& file, std::vector<std::string>* warnings);
std::vector<ControlPoint> ReadControlPoints(const std::filesystem::path& file, std::vector<std::string>* warnings);
// An epoch as a year with decimals: "2023.45", or a date "2023-06-15". Nothing for another text.
std::optional<double> YearOfEpoch(const std::string& epoch);
// Of a point that stands in several rows the one of the newest epoch.
std::vector<ControlPoint> AtNewestEpoch(const std::vector<ControlPoint>& points);
TagSizes ReadTagSizes(const std::filesystem::path& file);
Geodetic ReadOrigin(const std::filesystem::path& file);

// Throws InputError naming `where` unless the file exists and is not empty.
void CheckPresent(const std::filesystem::path& file, const std::string& where);

}  // namespace trigpoint
