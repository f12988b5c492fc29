#include "eval/text/json_values.h"

namespace trigpoint {
namespace {

const nlohmann::json* Find(const nlohmann::json& json, const char* key) {
  if (!json.is_object()) return nullptr;
  const auto it = json.find(key);
  return it == json.end() ? nullptr : &*it;
}

std::optional<double> NumberOf(const nlohmann::json& json) {
  return json.is_number() ? std::optional<double>(json.get<double>()) : std::nullopt;
}

}  // namespace

std::optional<double> At(const nlohmann::json& json, std::initializer_list<const char*> path) {
  const nlohmann::json* at = &json;
  for (const char* key : path) {
    at = Find(*at, key);
    if (at == nullptr) return std::nullopt;
  }
  return NumberOf(*at);
}

std::string TextAt(const nlohmann::json& json, const char* key) {
  const nlohmann::json* const value = Find(json, key);
  return value != nullptr && value->is_string() ? value->get<std::string>() : "";
}

bool FlagAt(const nlohmann::json& json, const char* key) {
  const nlohmann::json* const value = Find(json, key);
  return value != nullptr && value->is_boolean() && value->get<bool>();
}

const nlohmann::json& ObjectAt(const nlohmann::json& json, const char* key) {
  static const nlohmann::json kEmpty = nlohmann::json::object();
  const nlohmann::json* const value = Find(json, key);
  return value != nullptr && value->is_object() ? *value : kEmpty;
}

const nlohmann::json& ListAt(const nlohmann::json& json, const char* key) {
  static const nlohmann::json kEmpty = nlohmann::json::array();
  const nlohmann::json* const value = Find(json, key);
  return value != nullptr && value->is_array() ? *value : kEmpty;
}

std::optional<IntervalEnds> EndsAt(const nlohmann::json& json, const char* key) {
  const nlohmann::json& list = ListAt(json, key);
  if (list.size() != 2) return std::nullopt;
  return IntervalEnds{NumberOf(list[0]), NumberOf(list[1])};
}

std::optional<Interval> IntervalAt(const nlohmann::json& json, const char* key) {
  const std::optional<IntervalEnds> ends = EndsAt(json, key);
  if (!ends || !ends->low || !ends->high) return std::nullopt;
  return Interval{*ends->low, *ends->high};
}

std::string EndsText(const std::string& low, const std::string& high) {
  if (low.empty()) return high.empty() ? "" : "up to " + high;
  return high.empty() ? "from " + low : low + " to " + high;
}

}  // namespace trigpoint
