// A solution's covariances as tables for people and other programs (docs/file_formats.md).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/io/csv.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

// cameras_cov.csv and panoramas_cov.csv: 6 x 6 of every world_from_cam and world_from_pano of cameras.csv and
// panoramas.csv. Photos of a set that share a row: that of the first that is localized. Nothing without a georeference
// or covariances. Each throws IoError.
void WriteCameraCovariances(const Solution& solution, const std::filesystem::path& dir);
void WritePanoramaCovariances(const Solution& solution, const std::filesystem::path& dir);

// Of other tables: with the columns c00 to c55 of a 6 x 6 covariance behind these, and its cells.
std::vector<std::string> WithCovarianceColumns(std::vector<std::string> columns);
void PutCovariance(const Matrix6d& covariance, CsvWriter* csv);

}  // namespace trigpoint
