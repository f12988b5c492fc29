#include "datasets/io/yaml.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "calib/base/error.h"
#include "datasets/io/lines.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

std::string Describe(const YAML::Node& node) {
  if (node.IsScalar()) return "'" + Excerpt(node.Scalar()) + "'";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  if (node.IsMap()) return "a map";
  return "nothing (the key is missing or empty)";
}

int LineOf(const YAML::Node& node) { return node.Mark().line + 1; }

}  // namespace

YAML::Node LoadYaml(const std::filesystem::path& file) {
  std::string text = ReadTextFile(file);
  int line = 0;
  for (const std::string_view content : Lines(text)) {
    ++line;
    const std::string_view indent = content.substr(0, std::min(content.find_first_not_of(" \t"), content.size()));
    if (indent.find('\t') != std::string_view::npos && !Trim(content).empty()) {
      throw InputError(FileLine(file, line) +
                       ": the line is indented with a tab, which YAML does not allow; use spaces");
    }
  }
  return ParseYaml(file, std::move(text));
}

YAML::Node ParseYaml(const std::filesystem::path& file, std::string text) {
  if (text.starts_with("%YAML")) text.replace(0, std::min(text.find('\n'), text.size()), "");
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw InputError(FileLine(file, e.mark.line + 1) + ": not valid YAML: " + e.msg);
  }
}

YamlMap::YamlMap(std::filesystem::path file, const YAML::Node& node, const std::vector<std::string>& known,
                 std::string path)
    : file_(std::move(file)), node_(node), path_(std::move(path)) {
  CheckMap();
  for (const auto& entry : node_) {
    const std::string key = entry.first.Scalar();
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      throw InputError(FileLine(file_, LineOf(entry.first)) + ": unknown key '" + Name(key) +
                       "'; nearest known key: '" + Name(NearestName(key, known)) + "'");
    }
  }
}

YamlMap YamlMap::AnyKeys(std::filesystem::path file, const YAML::Node& node, std::string path) {
  YamlMap map;
  map.file_ = std::move(file);
  map.node_ = node;
  map.path_ = std::move(path);
  map.CheckMap();
  return map;
}

void YamlMap::CheckMap() const {
  if (!node_.IsDefined() || node_.IsNull()) return;
  if (!node_.IsMap()) {
    throw InputError(FileLine(file_, LineOf(node_)) + ": " + (path_.empty() ? "" : "key '" + path_ + "': ") +
                     "expected 'key: value' lines, found " + Describe(node_));
  }
  std::map<std::string, int> seen;  // and its line
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) throw InputError(FileLine(file_, LineOf(entry.first)) + ": a key must be plain text");
    const auto [first, fresh] = seen.emplace(entry.first.Scalar(), LineOf(entry.first));
    if (!fresh) {
      throw InputError(FileLine(file_, LineOf(entry.first)) + ": key '" + Name(entry.first.Scalar()) +
                       "' stands twice, first on line " + std::to_string(first->second) + "; keep one");
    }
  }
}

std::string YamlMap::Name(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

YAML::Node YamlMap::Node(const std::string& key) const {
  if (!node_.IsDefined() || !node_.IsMap()) return YAML::Node(YAML::NodeType::Null);
  const YAML::Node value = node_[key];  // const: makes no entry
  return value.IsDefined() ? value : YAML::Node(YAML::NodeType::Null);
}

bool YamlMap::Has(const std::string& key) const { return !Node(key).IsNull(); }

std::vector<std::string> YamlMap::Keys() const {
  std::vector<std::string> keys;
  if (node_.IsDefined() && node_.IsMap()) {
    for (const auto& entry : node_) keys.push_back(entry.first.Scalar());
  }
  return keys;
}

std::string YamlMap::Where(const std::string& key) const {
  // A key that is missing is looked for where its map begins.
  const bool there = node_.IsDefined() && node_.IsMap() && std::as_const(node_)[key].IsDefined();
  const int line = there ? LineOf(Node(key)) : LineOf(node_);
  return FileLine(file_, std::max(1, line)) + ": key '" + Name(key) + "'";
}

void YamlMap::Fail(const std::string& key, const std::string& what) const {
  throw InputError(Where(key) + ": " + what);
}

void YamlMap::FailType(const std::string& key, const std::string& expected) const {
  Fail(key, "expected " + expected + ", found " + Describe(Node(key)));
}

std::string YamlMap::Text(const std::string& key, const std::string& missing) const {
  if (!Has(key)) return missing;
  if (!Node(key).IsScalar()) FailType(key, "text");
  return Node(key).Scalar();
}

double YamlMap::Number(const std::string& key, double missing) const {
  if (!Has(key)) return missing;
  const std::optional<double> value = Node(key).IsScalar() ? ParseDouble(Node(key).Scalar()) : std::nullopt;
  if (!value || !std::isfinite(*value)) FailType(key, "a number");
  return *value;
}

int YamlMap::Integer(const std::string& key, int missing) const {
  if (!Has(key)) return missing;
  const std::optional<int64_t> value = Node(key).IsScalar() ? ParseInt(Node(key).Scalar()) : std::nullopt;
  if (!value || *value != static_cast<int>(*value)) FailType(key, "a whole number");
  return static_cast<int>(*value);
}

bool YamlMap::Bool(const std::string& key, bool missing) const {
  if (!Has(key)) return missing;
  bool value = false;
  if (!Node(key).IsScalar() || !YAML::convert<bool>::decode(Node(key), value)) FailType(key, "true or false");
  return value;
}

std::vector<double> YamlMap::Numbers(const std::string& key) const {
  std::vector<double> numbers;
  if (!Has(key)) return numbers;
  const YAML::Node list = Node(key);
  if (!list.IsSequence()) FailType(key, "a list of numbers");
  for (const YAML::Node& item : list) {
    const std::optional<double> value = item.IsScalar() ? ParseDouble(item.Scalar()) : std::nullopt;
    if (!value || !std::isfinite(*value)) {
      throw InputError(FileLine(file_, LineOf(item)) + ": key '" + Name(key) + "': expected a number, found " +
                       Describe(item));
    }
    numbers.push_back(*value);
  }
  return numbers;
}

std::vector<double> YamlMap::Numbers(const std::string& key, size_t count) const {
  std::vector<double> numbers = Numbers(key);
  if (numbers.size() != count) FailType(key, "a list of " + std::to_string(count) + " numbers");
  return numbers;
}

YamlMap YamlMap::Map(const std::string& key, const std::vector<std::string>& known) const {
  return {file_, Node(key), known, Name(key)};
}

YamlMap YamlMap::MapOfAnyKeys(const std::string& key) const { return AnyKeys(file_, Node(key), Name(key)); }

std::string YamlNumber(double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof(buffer), "%.15g", value);
  return buffer;
}

std::string YamlList(const std::vector<double>& values) {
  std::string text = "[";
  for (size_t i = 0; i < values.size(); ++i) text += (i == 0 ? "" : ", ") + YamlNumber(values[i]);
  return text + "]";
}

}  // namespace trigpoint
