// YAML files that say where they are wrong: unknown keys (with the nearest known one), wrong types, tabs, doubled keys.
#pragma once

#include <yaml-cpp/yaml.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

// Parses a file. Throws InputError "file:line: ..." for bad syntax and for a tab in a line's indentation.
// An empty file is an empty map.
YAML::Node LoadYaml(const std::filesystem::path& file);
// Parses a file's text, tabs or not. OpenCV's first line "%YAML:1.0", which is no YAML, may stand there.
YAML::Node ParseYaml(const std::filesystem::path& file, std::string text);

// A number as it is written into a file, and a list of them on one line.
std::string YamlNumber(double value);
std::string YamlList(const std::vector<double>& values);

// A map of a YAML file. Every accessor throws InputError "file:line: key 'x': expected ..., found ...".
class YamlMap {
 public:
  // Throws unless `node` is a map (or null: an empty one) whose keys are all in `known` and stand once.
  // `path` names the map in messages ("gps"), "" for the file's top.
  YamlMap(std::filesystem::path file, const YAML::Node& node, const std::vector<std::string>& known,
          std::string path = "");
  // A map with any keys.
  static YamlMap AnyKeys(std::filesystem::path file, const YAML::Node& node, std::string path = "");

  bool Has(const std::string& key) const;  // present and not null
  std::vector<std::string> Keys() const;   // as in the file
  YAML::Node Node(const std::string& key) const;
  std::string Text(const std::string& key, const std::string& missing = "") const;
  double Number(const std::string& key, double missing) const;  // finite
  int Integer(const std::string& key, int missing) const;
  bool Bool(const std::string& key, bool missing) const;
  std::vector<double> Numbers(const std::string& key) const;                         // a list, empty if missing
  std::vector<double> Numbers(const std::string& key, size_t count) const;           // of exactly this length
  YamlMap Map(const std::string& key, const std::vector<std::string>& known) const;  // empty if missing
  YamlMap MapOfAnyKeys(const std::string& key) const;

  std::string Where(const std::string& key) const;  // "file:line: key 'path.key'"
  [[noreturn]] void Fail(const std::string& key, const std::string& what) const;

 private:
  YamlMap() = default;
  void CheckMap() const;
  std::string Name(const std::string& key) const;
  [[noreturn]] void FailType(const std::string& key, const std::string& expected) const;

  std::filesystem::path file_;
  YAML::Node node_;
  std::string path_;
};

}  // namespace trigpoint
