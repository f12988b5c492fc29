// Writers of layers (datasets/export/layers.h). All write atomically and throw IoError naming the file.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/export/crs.h"
#include "datasets/export/layers.h"

namespace trigpoint {

struct LayerFrame {
  const Crs& crs;
  const HeightSystem& heights;
  std::string about;  // one sentence: what it is, from where
};

// One table per layer, with the system's definition, heights in z, and a style per layer that QGIS uses by itself.
void WriteGeoPackage(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame);

// RFC 7946: WGS 84 longitude, latitude, ellipsoidal height; each feature names its layer. Throws OptionError for
// another system.
void WriteGeoJson(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame);

// KML 2.2. Its altitudes are above the sea: with a geoid they are absolute; without one everything is clamped to the
// ground and the ellipsoidal height is an attribute.
void WriteKml(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame);

// GPX 1.1: points as waypoints, lines as tracks (with times where known); areas are left out. `ele` is the height in
// the system asked for, `geoidheight` the rest of the ellipsoidal one.
void WriteGpx(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame);

// <dir>/<layer>.csv: x, y, height in the systems, then the attributes; lines and areas have a row per vertex. Returns
// the files.
std::vector<std::filesystem::path> WriteLayerTables(const std::filesystem::path& dir, const std::vector<Layer>& layers,
                                                    const LayerFrame& frame);

}  // namespace trigpoint
