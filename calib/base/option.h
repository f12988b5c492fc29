// How an options struct tells the command line, the project file and the desktop about itself.
//
//   struct TrackOptions {
//     double ratio = 0.8;  // ratio test: best / second-best descriptor distance, in (0, 1]
//     template <typename Self, typename Visitor>
//     static void Visit(Self& self, Visitor&& visit) {
//       visit(self.ratio, {"ratio", "", 0.01, 1.0, "ratio test: best / second-best descriptor distance"});
//     }
//     std::vector<std::string> Check() const { return CheckRanges(*this); }
//   };
//
// Fields may be bool, int, int64_t, double, std::string, or another struct with Visit (a group).
#pragma once

#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

namespace trigpoint {

struct OptionInfo {
  const char* name;  // snake_case, the key in trigpoint.yaml
  const char* unit;  // "m", "px", "deg", ... or ""
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  const char* help = "";
};

// Every violation of the ranges declared by Visit, one sentence each.
template <typename Options>
std::vector<std::string> CheckRanges(const Options& options) {
  std::vector<std::string> problems;
  Options::Visit(options, [&](const auto& value, const OptionInfo& info) {
    using T = std::decay_t<decltype(value)>;
    if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
      const double v = static_cast<double>(value);
      if (!(v >= info.min && v <= info.max)) {
        std::ostringstream text;
        text << "option " << info.name << " is " << v << ", expected " << info.min << " to " << info.max << " "
             << info.unit;
        problems.push_back(text.str());
      }
    } else if constexpr (requires { value.Check(); }) {
      for (const std::string& problem : value.Check()) problems.push_back(std::string(info.name) + ": " + problem);
    }
  });
  return problems;
}

}  // namespace trigpoint
