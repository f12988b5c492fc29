// What goes out to other programs as maps: named layers of points, lines and areas with attributes.
//
// Positions are WGS 84 with ellipsoidal heights here; writers bring them into the coordinate and height system asked
// for. Attributes with units say so in their names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "calib/geo/geodetic.h"

namespace trigpoint {

using LayerValue = std::variant<std::monostate, int64_t, double, std::string>;  // monostate: not known
enum class FieldType { kInteger, kReal, kText };
enum class LayerGeometry { kPoint, kLine, kPolygon };

struct LayerField {
  std::string name;
  FieldType type = FieldType::kReal;
  int decimals = 4;  // of a kReal
};

struct LayerFeature {
  std::string name;                // what a map shows beside it
  std::vector<Geodetic> geometry;  // one, a line's, or a ring's (not closed); empty: no known place
  std::vector<LayerValue> values;  // as Layer::fields
  std::vector<int64_t> times_ns;   // UTC of each vertex; empty: not known
};

struct Layer {
  std::string name;   // a table's name: tags, cameras, ...
  std::string title;  // for people
  LayerGeometry geometry = LayerGeometry::kPoint;
  std::string colour = "#d62728";  // of its symbols
  std::vector<LayerField> fields;
  std::vector<LayerFeature> features;
};

}  // namespace trigpoint
