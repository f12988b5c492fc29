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

GateLimits DefaultLimits() {
  GateLimits limits;
  limits.localize.min_answered = 0.5;
  limits.localize.max_nees_per_dof = 2;
  limits.evaluate.max_median_m = 0.5;
  limits.survey.max_standardised_residual = 4;
  limits.stitch.max_closure_deg = 3;
  limits.calibration.max_rms_px = 0.5;
  return limits;
}

std::vector<GateLimit> AllGates() { return Listed({}, true); }

}  // namespace trigpoint
