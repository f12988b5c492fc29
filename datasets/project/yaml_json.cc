#include "datasets/project/yaml_json.h"

#include <yaml-cpp/yaml.h>

#include <cmath>

#include "datasets/io/text.h"

namespace trigpoint {
namespace {

nlohmann::json JsonFromScalar(const YAML::Node& node) {
  const std::string& text = node.Scalar();
  if (node.Tag() == "!") return text;  // quoted
  if (text.empty() || text == "~" || text == "null") return nullptr;
  if (text == "true" || text == "True") return true;
  if (text == "false" || text == "False") return false;
  if (const auto integer = ParseInt(text)) return *integer;
  // JSON has no nan and inf; as text they are named like any other wrong type.
  if (const auto number = ParseDouble(text); number && std::isfinite(*number)) return *number;
  return text;
}

}  // namespace

nlohmann::json JsonFromYaml(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Scalar: return JsonFromScalar(node);
    case YAML::NodeType::Sequence: {
      nlohmann::json list = nlohmann::json::array();
      for (const auto& item : node) list.push_back(JsonFromYaml(item));
      return list;
    }
    case YAML::NodeType::Map: {
      nlohmann::json object = nlohmann::json::object();
      for (const auto& item : node) object[item.first.Scalar()] = JsonFromYaml(item.second);
      return object;
    }
    default: return nullptr;
  }
}

nlohmann::json JsonFromYamlText(const std::string& text) {
  try {
    return JsonFromYaml(YAML::Load(text));
  } catch (const YAML::Exception&) {  // not YAML: plain text, such as a glob
    return text;
  }
}

}  // namespace trigpoint
