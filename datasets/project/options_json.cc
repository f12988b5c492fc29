#include "datasets/project/options_json.h"

#include <limits>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

void ThrowIfAny(const std::vector<std::string>& problems) {
  std::string text;
  for (const std::string& problem : problems) text += (text.empty() ? "" : "; ") + problem;
  if (!text.empty()) throw OptionError(text);
}

namespace options_json {
namespace {

template <typename T>
bool ConvertInteger(const nlohmann::json& json, T& value) {
  if (!json.is_number_integer()) return false;
  if (json.is_number_unsigned()) {
    if (json.get<uint64_t>() > static_cast<uint64_t>(std::numeric_limits<T>::max())) return false;
  } else if (json.get<int64_t>() < static_cast<int64_t>(std::numeric_limits<T>::min()) ||
             (json.get<int64_t>() > 0 &&
              static_cast<uint64_t>(json.get<int64_t>()) > static_cast<uint64_t>(std::numeric_limits<T>::max()))) {
    return false;
  }
  value = json.get<T>();
  return true;
}

}  // namespace

bool Convert(const nlohmann::json& json, bool& value) {
  if (!json.is_boolean()) return false;
  value = json.get<bool>();
  return true;
}

bool Convert(const nlohmann::json& json, int& value) { return ConvertInteger(json, value); }
bool Convert(const nlohmann::json& json, int64_t& value) { return ConvertInteger(json, value); }
bool Convert(const nlohmann::json& json, uint64_t& value) { return ConvertInteger(json, value); }

bool Convert(const nlohmann::json& json, double& value) {
  if (!json.is_number()) return false;
  value = json.get<double>();
  return true;
}

bool Convert(const nlohmann::json& json, std::string& value) {
  if (!json.is_string()) return false;
  value = json.get<std::string>();
  return true;
}

std::string UnknownOption(const std::string& where, const std::string& name, const std::vector<std::string>& known) {
  return where + ": unknown option '" + name + "'" +
         NearestHint(name.substr(name.rfind('.') + 1), known, "nearest known one");
}

std::string WrongType(const std::string& where, const std::string& name, const char* expected,
                      const nlohmann::json& found) {
  return where + ": option '" + name + "': expected " + expected + ", found " + DumpJson(found);
}

}  // namespace options_json
}  // namespace trigpoint
