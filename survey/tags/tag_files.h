// The tables of detections and tags (docs/file_formats.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "survey/tags/detection.h"
#include "survey/tags/tag_poses.h"

namespace trigpoint {

// The detections of one picture of a run.
struct ImageDetections {
  int64_t stamp_ns = 0;
  std::string image;   // as in images.txt
  std::string camera;  // cam0, ...
  std::vector<TagDetection> detections;
};

// detections.csv: timestamp,image,camera,family,tag_id,hamming,margin,u0,v0,...,u3,v3,sigma_px; our pixels. Pictures
// without a tag have no row.
void WriteDetections(const std::filesystem::path& file, const std::vector<ImageDetections>& images);
// Grouped by picture, in the file's order. `hamming`, `margin`, `sigma_px` (then `default_sigma_px`), `image`,
// `camera` (then cam0) and `family` may be missing. Unusable rows are skipped and named in `warnings`.
std::vector<ImageDetections> ReadDetections(const std::filesystem::path& file, double default_sigma_px,
                                            std::vector<std::string>* warnings);

// Covariances between tags: the blocks (a, b) with a < b, rows of tag a.
using TagCrossCovariances = std::map<std::pair<int, int>, Matrix6d>;

// tags.csv and tags_cov.csv. `frame`: enu or the run's own; `datum`: what fixes it.
void WriteTags(const std::filesystem::path& file, const std::vector<TagEstimate>& tags, const std::string& frame,
               const std::string& datum);
void WriteTagCovariances(const std::filesystem::path& file, const std::vector<TagEstimate>& tags,
                         const TagCrossCovariances& cross, const std::string& frame, const std::string& datum);

}  // namespace trigpoint
