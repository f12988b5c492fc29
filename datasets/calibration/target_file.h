// Descriptions of calibration targets: Kalibr's target YAML, and one line of text.
#pragma once

#include <filesystem>
#include <string>

#include "calib/target/target.h"

namespace trigpoint {

// Kalibr's target YAML: target_type checkerboard (targetCols, targetRows: inner corners; rowSpacingMeters,
// colSpacingMeters), aprilgrid (tagCols, tagRows, tagSize, tagSpacing), circlegrid (targetCols, targetRows,
// spacingMeters, asymmetricGrid); and, in the same manner, charuco (squareCols, squareRows, squareSize, markerSize,
// dictionary, firstId). Metres. Throws InputError with file, line and key.
Target ReadTargetFile(const std::filesystem::path& file);

// The name of a file (relative to the working directory, else to `base`), or the target in one line:
//   checkerboard:9x6:0.025             inner corners, square (m); :0.025x0.03 where they aren't square
//   charuco:8x8:0.0254:0.019:DICT_4X4_50   squares, square (m), marker (m), dictionary
//   aprilgrid:6x6:0.088:0.3            tags, tag (m), gap / tag
//   asymmetric_circles:4x11:0.02       columns x rows, spacing (m); circles: square grid
// Throws InputError.
Target ReadTarget(const std::string& text, const std::filesystem::path& base);

// The file that ReadTarget reads for this text, or empty if the text describes the target itself.
std::filesystem::path TargetFileOf(const std::string& text, const std::filesystem::path& base);

}  // namespace trigpoint
