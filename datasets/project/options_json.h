// Options structs as JSON and back, by what their Visit (calib/base/option.h) says of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "calib/base/path_option.h"

namespace trigpoint {

// One option as `--help` and the forms of the desktop show it. `name` is dotted within groups: "tracks.ratio".
struct OptionDescription {
  std::string name;
  std::string type;  // "true or false", "a whole number", "a number", "text"
  std::string unit;
  nlohmann::json default_value;
  double min = 0, max = 0;  // infinite: no limit
  std::string help;
  PathKind path = PathKind::kNone;
};

// {name: value}, groups as objects.
template <typename Options>
nlohmann::json JsonFromOptions(const Options& options);

// Overwrites the options named in `values`. What is wrong is added to `problems`, one sentence each: unknown names
// (with the nearest known one) and wrong types. `where` begins each sentence: a file, or "--set".
template <typename Options>
void SetOptions(const nlohmann::json& values, const std::string& where, Options& options,
                std::vector<std::string>& problems, const std::string& prefix = "");

template <typename Options>
std::vector<OptionDescription> DescribeOptions(const std::string& prefix = "");

// Throws OptionError listing all problems, if there are any.
void ThrowIfAny(const std::vector<std::string>& problems);

namespace options_json {

template <typename T>
constexpr bool kIsValue = std::is_arithmetic_v<T> || std::is_same_v<T, std::string>;

template <typename... Visitors>
struct Overloaded : Visitors... {
  using Visitors::operator()...;
};
template <typename... Visitors>
Overloaded(Visitors...) -> Overloaded<Visitors...>;

template <typename T>
constexpr const char* TypeName() {
  if constexpr (std::is_same_v<T, bool>) return "true or false";
  if constexpr (std::is_integral_v<T>) return "a whole number";
  if constexpr (std::is_floating_point_v<T>) return "a number";
  return "text";
}

// False if the JSON value is of another type, or a whole number that doesn't fit.
bool Convert(const nlohmann::json& json, bool& value);
bool Convert(const nlohmann::json& json, int& value);
bool Convert(const nlohmann::json& json, int64_t& value);
bool Convert(const nlohmann::json& json, uint64_t& value);
bool Convert(const nlohmann::json& json, double& value);
bool Convert(const nlohmann::json& json, std::string& value);

std::string UnknownOption(const std::string& where, const std::string& name, const std::vector<std::string>& known);
std::string WrongType(const std::string& where, const std::string& name, const char* expected,
                      const nlohmann::json& found);

}  // namespace options_json

template <typename Options>
nlohmann::json JsonFromOptions(const Options& options) {
  nlohmann::json json = nlohmann::json::object();
  Options::Visit(options, [&](const auto& value, const OptionInfo& info) {
    if constexpr (options_json::kIsValue<std::decay_t<decltype(value)>>) {
      json[info.name] = value;
    } else {
      json[info.name] = JsonFromOptions(value);
    }
  });
  return json;
}

template <typename Options>
void SetOptions(const nlohmann::json& values, const std::string& where, Options& options,
                std::vector<std::string>& problems, const std::string& prefix) {
  if (!values.is_object()) {
    problems.push_back(options_json::WrongType(where, prefix, "a map of options", values));
    return;
  }
  std::vector<std::string> known;
  Options::Visit(options, [&](auto& value, const OptionInfo& info) {
    using T = std::decay_t<decltype(value)>;
    known.emplace_back(info.name);
    const auto it = values.find(info.name);
    if (it == values.end()) return;
    const std::string name = prefix.empty() ? info.name : prefix + "." + info.name;
    if constexpr (!options_json::kIsValue<T>) {
      SetOptions(*it, where, value, problems, name);
    } else if (!options_json::Convert(*it, value)) {
      problems.push_back(options_json::WrongType(where, name, options_json::TypeName<T>(), *it));
    }
  });
  for (const auto& [name, value] : values.items()) {
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      problems.push_back(options_json::UnknownOption(where, prefix.empty() ? name : prefix + "." + name, known));
    }
  }
}

template <typename Options>
std::vector<OptionDescription> DescribeOptions(const std::string& prefix) {
  std::vector<OptionDescription> all;
  const auto describe = [&](const auto& value, const OptionInfo& info) {
    using T = std::decay_t<decltype(value)>;
    const std::string name = prefix + info.name;
    if constexpr (options_json::kIsValue<T>) {
      all.push_back({name, options_json::TypeName<T>(), info.unit, value, info.min, info.max, info.help});
    } else {
      for (OptionDescription& inner : DescribeOptions<T>(name + ".")) all.push_back(std::move(inner));
    }
  };
  const Options defaults;
  Options::Visit(defaults, options_json::Overloaded{describe, [&](const std::string& value, const PathOption& info) {
                                                      describe(value, info);
                                                      all.back().path = info.kind;
                                                    }});
  return all;
}

}  // namespace trigpoint
