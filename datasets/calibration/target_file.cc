#include "datasets/calibration/target_file.h"

#include <algorithm>
#include <cstdio>
#include <tuple>

#include "calib/base/error.h"
#include "calib/target/dictionary.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kKinds = {"checkerboard", "charuco", "aprilgrid", "asymmetric_circles", "circles"};

// What a target's own check and its dictionary's name say.
void ThrowIfWrong(const Target& target, const std::string& where) {
  const std::vector<std::string> problems = target.Check();
  if (!problems.empty()) throw InputError(where + ": " + problems.front());
  if (target.kind == TargetKind::kCharuco && DictionaryNamed(target.dictionary) < 0) {
    throw InputError(where + ": unknown marker dictionary '" + target.dictionary +
                     "'; expected OpenCV's name, as DICT_4X4_50, DICT_6X6_250, DICT_APRILTAG_36h11");
  }
}

std::vector<std::string> Split(const std::string& text, char at) {
  std::vector<std::string> parts(1);
  for (char c : text) {
    if (c == at) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

// "9x6" or "0.025x0.03"; one number stands for both.
std::pair<double, double> Pair(const std::string& text, bool two, const std::string& where, const char* what) {
  const std::vector<std::string> parts = Split(text, 'x');
  const auto first = ParseDouble(parts[0]);
  const auto second = parts.size() > 1 ? ParseDouble(parts[1]) : first;
  if (parts.size() > 2 || (two && parts.size() != 2) || !first || !second) {
    throw OptionError(where + ": expected " + what + ", found '" + text + "'");
  }
  return {*first, *second};
}

Target ParseTarget(const std::string& text) {
  const std::string where = "target '" + text + "'";
  const std::vector<std::string> parts = Split(text, ':');
  const auto kind = std::find(kKinds.begin(), kKinds.end(), parts[0]);
  if (kind == kKinds.end()) {
    throw OptionError(where + ": there is no such file, and '" + parts[0] + "' is no kind of target; nearest: '" +
                      NearestName(parts[0], kKinds) + "', as checkerboard:9x6:0.025 (inner corners, square in metres)");
  }
  Target target;
  target.kind = static_cast<TargetKind>(kind - kKinds.begin());
  const size_t least = target.kind == TargetKind::kCharuco || target.kind == TargetKind::kAprilGrid ? 4 : 3;
  const size_t most = target.kind == TargetKind::kCharuco ? 5 : least;
  if (parts.size() < least || parts.size() > most) {
    static constexpr const char* kExamples[] = {"checkerboard:9x6:0.025", "charuco:8x8:0.0254:0.019:DICT_4X4_50",
                                                "aprilgrid:6x6:0.088:0.3", "asymmetric_circles:4x11:0.02",
                                                "circles:7x7:0.02"};
    throw OptionError(where + ": expected the form " + kExamples[kind - kKinds.begin()]);
  }
  const auto [cols, rows] = Pair(parts[1], true, where, "columns x rows, as 9x6");
  if (cols != static_cast<int>(cols) || rows != static_cast<int>(rows)) {
    throw OptionError(where + ": expected whole numbers of columns and rows, found '" + parts[1] + "'");
  }
  target.cols = static_cast<int>(cols);
  target.rows = static_cast<int>(rows);
  std::tie(target.spacing_x_m, target.spacing_y_m) = Pair(parts[2], false, where, "a size in metres, as 0.025");
  const auto number = [&](size_t i, const char* what) { return Pair(parts[i], false, where, what).first; };
  if (target.kind == TargetKind::kCharuco) {
    target.marker_size_m = number(3, "the marker's size in metres");
    if (parts.size() > 4) target.dictionary = parts[4];
  }
  if (target.kind == TargetKind::kAprilGrid) target.tag_spacing = number(3, "gap / tag size, as 0.3");
  if (target.kind != TargetKind::kCheckerboard && target.spacing_x_m != target.spacing_y_m) {
    throw OptionError(where + ": only a checkerboard may have two sizes, found '" + parts[2] + "'");
  }
  try {
    ThrowIfWrong(target, where);
  } catch (const InputError& e) {
    throw OptionError(e.what());  // it stands on the command line, or as an option
  }
  return target;
}

}  // namespace

Target ReadTargetFile(const fs::path& file) {
  const YAML::Node node = LoadYaml(file);
  const YamlMap any = YamlMap::AnyKeys(file, node);
  const std::vector<std::string> types = {"checkerboard", "aprilgrid", "circlegrid", "charuco"};
  const std::string type = any.Text("target_type");
  if (std::find(types.begin(), types.end(), type) == types.end()) {
    any.Fail("target_type", "expected checkerboard, aprilgrid, circlegrid or charuco, found '" + type + "'");
  }
  Target target;
  const auto read = [&](const std::vector<std::string>& keys, const char* cols, const char* rows) {
    const YamlMap map(file, node, keys);
    for (const char* key : {cols, rows}) {
      if (!map.Has(key)) throw InputError(file.string() + ": key '" + key + "' is missing; a " + type + " needs it");
    }
    target.cols = map.Integer(cols, 0);
    target.rows = map.Integer(rows, 0);
    return map;
  };
  if (type == "checkerboard") {
    const YamlMap map = read({"target_type", "targetCols", "targetRows", "rowSpacingMeters", "colSpacingMeters"},
                             "targetCols", "targetRows");
    target.kind = TargetKind::kCheckerboard;
    target.spacing_x_m = map.Number("colSpacingMeters", 0);
    target.spacing_y_m = map.Number("rowSpacingMeters", target.spacing_x_m);
    if (target.spacing_x_m == 0) target.spacing_x_m = target.spacing_y_m;
  } else if (type == "aprilgrid") {
    const YamlMap map = read({"target_type", "tagCols", "tagRows", "tagSize", "tagSpacing", "firstId", "codeOffset"},
                             "tagCols", "tagRows");
    target.kind = TargetKind::kAprilGrid;
    target.spacing_x_m = target.spacing_y_m = map.Number("tagSize", 0);
    target.tag_spacing = map.Number("tagSpacing", 0);
    target.first_id = map.Integer("firstId", map.Integer("codeOffset", 0));
  } else if (type == "circlegrid") {
    const YamlMap map = read({"target_type", "targetCols", "targetRows", "spacingMeters", "asymmetricGrid"},
                             "targetCols", "targetRows");
    target.kind = map.Bool("asymmetricGrid", false) ? TargetKind::kAsymmetricCircles : TargetKind::kCircles;
    target.spacing_x_m = target.spacing_y_m = map.Number("spacingMeters", 0);
  } else {
    const YamlMap map =
        read({"target_type", "squareCols", "squareRows", "squareSize", "markerSize", "dictionary", "firstId"},
             "squareCols", "squareRows");
    target.kind = TargetKind::kCharuco;
    target.spacing_x_m = target.spacing_y_m = map.Number("squareSize", 0);
    target.marker_size_m = map.Number("markerSize", 0);
    target.dictionary = map.Text("dictionary", target.dictionary);
    target.first_id = map.Integer("firstId", 0);
  }
  ThrowIfWrong(target, file.string());
  return target;
}

fs::path TargetFileOf(const std::string& text, const fs::path& base) {
  std::error_code ignored;
  if (const fs::path path = base / text; fs::is_regular_file(path, ignored)) return path;
  if (text.find(':') == std::string::npos && (text.ends_with(".yaml") || text.ends_with(".yml"))) {
    throw InputError(text + ": there is no such target file in " + base.string());
  }
  return {};
}

Target ReadTarget(const std::string& text, const fs::path& base) {
  const fs::path file = TargetFileOf(text, base);
  return file.empty() ? ParseTarget(text) : ReadTargetFile(file);
}

}  // namespace trigpoint
