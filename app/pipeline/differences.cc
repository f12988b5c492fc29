#include "app/pipeline/differences.h"

#include <map>

#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

using nlohmann::json;

namespace {

constexpr size_t kHashDigits = 8;

void Flatten(const json& value, const std::string& name, std::map<std::string, std::string>& flat) {
  if (value.is_object()) {
    for (const auto& [key, inner] : value.items()) Flatten(inner, name.empty() ? key : name + "." + key, flat);
    return;
  }
  std::string text = DumpJson(value);
  if (name.starts_with("inputs.") && value.is_string()) text = value.get<std::string>().substr(0, kHashDigits);
  flat[name] = text;
}

std::map<std::string, std::string> Identity(const json& manifest) {
  std::map<std::string, std::string> flat;
  if (!manifest.is_object()) return flat;
  for (const char* key : {"version", "options", "values", "seed", "inputs"}) {
    if (manifest.contains(key)) Flatten(manifest.at(key), key, flat);
  }
  return flat;
}

}  // namespace

std::vector<Difference> DifferencesOf(const json& manifest_a, const json& manifest_b) {
  const auto a = Identity(manifest_a), b = Identity(manifest_b);
  std::map<std::string, Difference> all;
  for (const auto& [name, text] : a) all[name].a = text;
  for (const auto& [name, text] : b) all[name].b = text;
  std::vector<Difference> differences;
  for (auto& [name, difference] : all) {
    if (difference.a == difference.b) continue;
    difference.what = name;
    differences.push_back(difference);
  }
  return differences;
}

json ManifestIn(const std::filesystem::path& result) {
  const std::filesystem::path file = result / "manifest.json";
  if (!std::filesystem::exists(file)) return nullptr;
  json manifest = json::parse(ReadTextFile(file), nullptr, false);
  return manifest.is_discarded() ? json(nullptr) : manifest;
}

}  // namespace trigpoint
