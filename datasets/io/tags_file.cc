#include "datasets/io/tags_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "calib/base/error.h"
#include "datasets/io/lines.h"
#include "datasets/io/tables.h"
#include "datasets/io/tag_families.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr double kSameSize_m = 1e-6;

std::string Metres(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof(buffer), "%.6g", value);
  return buffer;
}

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  for (std::string_view line : Lines(text)) {
    if (line.ends_with('\r')) line.remove_suffix(1);
    lines.emplace_back(line);
  }
  return lines;
}

std::string Joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

// Of the lines of a block its key begins one, and the end of what is indented below it.
struct Block {
  size_t begin = 0, end = 0;
  std::string indent = "  ";
};

bool FindBlock(const std::vector<std::string>& lines, const std::string& key, Block* block) {
  for (size_t i = 0; i < lines.size(); ++i) {
    if (!lines[i].starts_with(key + ":")) continue;
    block->begin = i;
    block->end = i + 1;
    for (size_t k = i + 1; k < lines.size(); ++k) {
      const size_t first = lines[k].find_first_not_of(' ');
      if (first == std::string::npos || lines[k][first] == '#') continue;
      if (first == 0) break;
      block->indent = std::string(first, ' ');
      block->end = k + 1;
    }
    return true;
  }
  return false;
}

// "{1: 0.2, 2: 0.3}  # why" of the key's line as lines of a block; the comment goes to the key.
void FlowToBlock(std::vector<std::string>* lines, Block* block, const std::map<int, std::string>& values) {
  std::string& line = (*lines)[block->begin];
  const size_t open = line.find('{'), close = line.rfind('}');
  if (open == std::string::npos || close == std::string::npos) return;
  line = line.substr(0, line.find(':') + 1) + line.substr(close + 1);
  std::vector<std::string> entries;
  for (const auto& [id, value] : values) entries.push_back("  " + std::to_string(id) + ": " + value);
  lines->insert(lines->begin() + static_cast<std::ptrdiff_t>(block->begin) + 1, entries.begin(), entries.end());
  block->end = block->begin + 1 + entries.size();
}

// Entries of a block that has `old` ones; it is made, with `comment`, if it is not there. Returns it.
Block AddToBlock(std::vector<std::string>* lines, const std::string& key, const std::string& comment,
                 const std::map<int, std::string>& old, const std::map<int, std::string>& add) {
  Block block;
  if (!FindBlock(*lines, key, &block)) {
    lines->push_back(key + ":  # " + comment);
    block.begin = lines->size() - 1;
    block.end = lines->size();
  } else {
    FlowToBlock(lines, &block, old);
  }
  std::vector<std::string> entries;
  for (const auto& [id, value] : add) entries.push_back(block.indent + std::to_string(id) + ": " + value);
  lines->insert(lines->begin() + static_cast<std::ptrdiff_t>(block.end), entries.begin(), entries.end());
  return block;
}

std::map<int, std::string> AsText(const std::map<int, double>& sizes_m) {
  std::map<int, std::string> text;
  for (const auto& [id, size] : sizes_m) text[id] = Metres(size);
  return text;
}

// Ids of `sizes_m` that the file must name as of `family`. Throws InputError where it lists one as of another.
std::map<int, std::string> FamiliesToAdd(const TagSizes& old, const std::string& family,
                                         const std::map<int, double>& sizes_m, const std::filesystem::path& file) {
  std::map<int, std::string> add;
  for (const auto& [id, size] : sizes_m) {
    const TagFamilies families(old.family);
    if (families.Of(id) == family) continue;
    if (old.sizes_m.contains(id) || families.others().contains(id)) {
      throw InputError(file.string() + ": tag " + std::to_string(id) + " is listed as of " + families.Of(id) +
                       ", not " + family + "; an id is one tag of a site: take another id");
    }
    add[id] = family;
  }
  return add;
}

// Replaces the number of "  12: 0.5  # why".
bool SetEntry(std::string* line, int id, double size) {
  const std::string key = std::to_string(id) + ":";
  const size_t first = line->find_first_not_of(' ');
  if (first == std::string::npos || line->compare(first, key.size(), key) != 0) return false;
  const size_t value = line->find_first_not_of(' ', first + key.size());
  if (value == std::string::npos) return false;
  const size_t end = std::min(line->find_first_of(" #", value), line->size());
  *line = line->substr(0, value) + Metres(size) + line->substr(end);
  return true;
}

// As another reader of YAML understands the text; empty where it cannot be read.
TagSizes Parsed(const std::string& text) {
  TagSizes sizes;
  try {
    const YAML::Node node = YAML::Load(text);
    std::map<int, std::string> others;
    sizes.size_m = node["size_m"].as<double>(0);
    for (const auto& entry : node["families"]) others[entry.first.as<int>()] = entry.second.as<std::string>();
    sizes.family = TagFamilies(node["family"].as<std::string>(sizes.family), others).Text();
    for (const auto& entry : node["sizes_m"]) sizes.sizes_m[entry.first.as<int>()] = entry.second.as<double>();
  } catch (const YAML::Exception&) {
    return {"", 0, {}};
  }
  return sizes;
}

bool Same(double a, double b) { return std::abs(a - b) < kSameSize_m; }

}  // namespace

TagsFileChange WithTagSizes(const std::string& old_text, const std::string& family,
                            const std::map<int, double>& sizes_m, const std::map<int, double>& expected_m,
                            const std::filesystem::path& file) {
  const bool there = !Trim(old_text).empty();
  const std::string text = there ? old_text : "family: " + family + "\n";
  const TagSizes old = there ? ReadTagSizes(file) : TagSizes{family, 0, {}};
  const std::map<int, std::string> families = FamiliesToAdd(old, family, sizes_m, file);
  TagsFileChange change;
  std::map<int, double> wanted = old.sizes_m, add;
  std::vector<std::pair<int, double>> set;
  for (const auto& [id, size] : sizes_m) {
    const auto entry = old.sizes_m.find(id);
    if (entry == old.sizes_m.end()) {
      add[id] = size;
    } else if (!Same(entry->second, size)) {
      const auto expected = expected_m.find(id);
      if (expected == expected_m.end() || !Same(expected->second, entry->second)) {
        throw InputError(file.string() + ": tag " + std::to_string(id) + " is listed with " + Metres(entry->second) +
                         " m, not " + Metres(size) + "; entries are not replaced: take another id, or edit the file");
      }
      set.emplace_back(id, size);
    }
    wanted[id] = size;
  }
  change.added = static_cast<int>(add.size());
  change.changed = static_cast<int>(set.size());
  std::vector<std::string> lines = LinesOf(text);
  if (!families.empty())
    AddToBlock(&lines, "families", "of tags of another family", TagFamilies(old.family).others(), families);
  const Block block = AddToBlock(&lines, "sizes_m", "edge of the black square", AsText(old.sizes_m), AsText(add));
  for (const auto& [id, size] : set) {
    for (size_t k = block.begin + 1; k < block.end; ++k) {
      if (SetEntry(&lines[k], id, size)) break;
    }
  }
  change.text = add.empty() && set.empty() ? old_text : Joined(lines);
  // Read back: YAML has more forms than are handled here.
  const TagSizes now = Parsed(change.text);
  std::map<int, std::string> others = TagFamilies(old.family).others();
  others.insert(families.begin(), families.end());
  bool same = now.sizes_m.size() == wanted.size() && now.size_m == old.size_m &&
              now.family == TagFamilies(TagFamilies(old.family).names().front(), others).Text();
  for (const auto& [id, size] : wanted) same = same && now.sizes_m.contains(id) && Same(now.sizes_m.at(id), size);
  if (!same) {
    throw InputError(file.string() + ": cannot be extended as it is written; write sizes_m as lines '  ID: SIZE'");
  }
  return change;
}

}  // namespace trigpoint
