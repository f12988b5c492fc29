// Values of results that are JSON, whatever stands there: what is missing or of another type counts as not stated.
#pragma once

#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// The number at a path of keys.
std::optional<double> At(const nlohmann::json& json, std::initializer_list<const char*> path);
std::string TextAt(const nlohmann::json& json, const char* key);
bool FlagAt(const nlohmann::json& json, const char* key);
const nlohmann::json& ObjectAt(const nlohmann::json& json, const char* key);
const nlohmann::json& ListAt(const nlohmann::json& json, const char* key);

// An interval [low, high]. An infinite end is JSON's null: that side is open.
struct IntervalEnds {
  std::optional<double> low, high;
};
std::optional<IntervalEnds> EndsAt(const nlohmann::json& json, const char* key);
// The same with both ends, else nothing.
std::optional<Interval> IntervalAt(const nlohmann::json& json, const char* key);
// "0.1 to 0.3"; "from 0.1" and "up to 0.3" where the other end is open; "" where both are.
std::string EndsText(const std::string& low, const std::string& high);

// To JSON: null for what is not known.
template <typename T>
nlohmann::json OrNull(const std::optional<T>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}
inline nlohmann::json OrNull(const std::optional<Interval>& interval) {
  return interval ? nlohmann::json{interval->low, interval->high} : nlohmann::json();
}

}  // namespace trigpoint
