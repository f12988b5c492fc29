#include "datasets/io/tag_families.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "calib/base/error.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

struct Known {
  const char* name;
  int ids;  // as the library has them
};
constexpr Known kKnown[] = {{"tag36h11", 587},
                            {"tag36h10", 2320},
                            {"tag25h9", 35},
                            {"tag16h5", 30},
                            {"tagCircle21h7", 38},
                            {"tagCircle49h12", 65535},
                            {"tagStandard41h12", 2115},
                            {"tagStandard52h13", 48714},
                            {"tagCustom48h12", 42211}};

}  // namespace

std::vector<std::string> KnownTagFamilies() {
  std::vector<std::string> names;
  for (const Known& family : kKnown) names.emplace_back(family.name);
  return names;
}

std::string TagIdProblem(const std::string& family, int id) {
  for (const Known& known : kKnown) {
    if (family != known.name || (id >= 0 && id < known.ids)) continue;
    return fmt::format("tag {} is not in {}, which has the ids 0 to {}", id, family, known.ids - 1);
  }
  return "";
}

TagFamilies::TagFamilies(const std::string& text) {
  for (const std::string_view entry : SplitAt(text, ',')) {
    const std::string name(entry.substr(0, entry.find(':')));
    if (std::find(names_.begin(), names_.end(), name) != names_.end()) {
      throw OptionError("family \"" + text + "\": " + name + " stands there twice");
    }
    if (name.empty() || names_.empty() != (name.size() == entry.size())) {
      throw OptionError("family \"" + text +
                        "\": expected the first family without ids and the others with theirs, as "
                        "tag36h11,tag16h5:3:12");
    }
    names_.push_back(name);
    for (size_t at = name.size(); at < entry.size();) {
      const size_t next = std::min(entry.find(':', at + 1), entry.size());
      const auto id = ParseInt(entry.substr(at + 1, next - at - 1));
      if (!id || *id < 0 || !of_id_.emplace(static_cast<int>(*id), name).second) {
        throw OptionError("family \"" + text + "\": expected ids of tags behind " + name + ", each once");
      }
      at = next;
    }
  }
}

const std::string& TagFamilies::Of(int id) const {
  const auto it = of_id_.find(id);
  return it == of_id_.end() ? names_.front() : it->second;
}

TagFamilies::TagFamilies(std::string first, std::map<int, std::string> others)
    : names_{std::move(first)}, of_id_(std::move(others)) {
  std::erase_if(of_id_, [&](const auto& entry) { return entry.second == names_.front(); });
  for (const auto& [id, name] : of_id_) {
    if (std::find(names_.begin(), names_.end(), name) == names_.end()) names_.push_back(name);
  }
}

std::string TagFamilies::Text() const {
  std::ostringstream text;
  text << names_.front();
  for (size_t k = 1; k < names_.size(); ++k) {
    text << ',' << names_[k];
    for (const auto& [id, name] : of_id_) {
      if (name == names_[k]) text << ':' << id;
    }
  }
  return text.str();
}

}  // namespace trigpoint
