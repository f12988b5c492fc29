#include "eval/gates/limits.h"

#include <type_traits>

namespace trigpoint {
namespace {

std::vector<GateLimit> Listed(const GateLimits& limits, bool all) {
  std::vector<GateLimit> list;
  GateLimits::Visit(limits, [&](const auto& section, const OptionInfo& its) {
    using Section = std::decay_t<decltype(section)>;
    if constexpr (!std::is_arithmetic_v<Section>) {
      Section::Visit(section, [&](const double& limit, const OptionInfo& info) {
        const std::string name = info.name;
        if (all || limit > 0) list.push_back({its.name, name, info.unit, info.help, limit, name.starts_with("max_")});
      });
    }
  });
  return list;
}

}  // namespace

std::vector<GateLimit> SetLimits(const GateLimits& limits) { return Listed(limits, false); }

std::vector<GateLimit> AllGates() { return Listed({}, true); }

}  // namespace trigpoint
