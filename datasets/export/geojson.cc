#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/base/error.h"
#include "datasets/export/layer_files.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

using nlohmann::ordered_json;

double Rounded(double value, int decimals) {
  const double unit = std::pow(10.0, decimals);
  return std::round(value * unit) / unit;
}

ordered_json Position(const Geodetic& g) {
  return {Rounded(g.longitude_deg, 9), Rounded(g.latitude_deg, 9), Rounded(g.height_m, 4)};
}

// Outer rings run counter-clockwise (RFC 7946, 3.1.6).
std::vector<Geodetic> Ring(std::vector<Geodetic> ring) {
  double area = 0;
  for (size_t i = 0; i < ring.size(); ++i) {
    const Geodetic &a = ring[i], &b = ring[(i + 1) % ring.size()];
    area += (a.longitude_deg - ring[0].longitude_deg) * (b.latitude_deg - ring[0].latitude_deg) -
            (b.longitude_deg - ring[0].longitude_deg) * (a.latitude_deg - ring[0].latitude_deg);
  }
  if (area < 0) std::reverse(ring.begin(), ring.end());
  ring.push_back(ring.front());
  return ring;
}

ordered_json Geometry(LayerGeometry kind, const std::vector<Geodetic>& vertices) {
  if (vertices.empty()) return nullptr;
  if (kind == LayerGeometry::kPoint) return {{"type", "Point"}, {"coordinates", Position(vertices[0])}};
  ordered_json list = ordered_json::array();
  for (const Geodetic& g : kind == LayerGeometry::kPolygon ? Ring(vertices) : vertices) list.push_back(Position(g));
  if (kind == LayerGeometry::kLine) return {{"type", "LineString"}, {"coordinates", list}};
  return {{"type", "Polygon"}, {"coordinates", ordered_json::array({list})}};
}

ordered_json Property(const LayerValue& value, const LayerField& field) {
  if (const auto* i = std::get_if<int64_t>(&value)) return *i;
  if (const auto* s = std::get_if<std::string>(&value)) return *s;
  if (const auto* d = std::get_if<double>(&value)) {
    if (std::isfinite(*d)) return Rounded(*d, field.decimals);
  }
  return nullptr;
}

}  // namespace

void WriteGeoJson(const std::filesystem::path& file, const std::vector<Layer>& layers, const LayerFrame& frame) {
  if (frame.crs.epsg() != 4326) {
    throw OptionError(
        fmt::format("GeoJSON is WGS 84 longitude and latitude by its definition (RFC 7946), not EPSG:{}; "
                    "use --to gpkg or csv for another system",
                    frame.crs.epsg()));
  }
  if (!frame.heights.ellipsoidal()) {
    throw OptionError("GeoJSON has ellipsoidal heights by its definition (RFC 7946); use --to gpkg or csv for others");
  }
  ordered_json features = ordered_json::array();
  for (const Layer& layer : layers) {
    for (const LayerFeature& feature : layer.features) {
      ordered_json properties = {{"layer", layer.name}, {"name", feature.name}};
      for (size_t i = 0; i < layer.fields.size(); ++i) {
        properties[layer.fields[i].name] = Property(feature.values[i], layer.fields[i]);
      }
      features.push_back({{"type", "Feature"},
                          {"geometry", Geometry(layer.geometry, feature.geometry)},
                          {"properties", std::move(properties)}});
    }
  }
  const ordered_json document = {
      {"type", "FeatureCollection"}, {"description", frame.about}, {"features", std::move(features)}};
  WriteFileAtomically(file, document.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace trigpoint
