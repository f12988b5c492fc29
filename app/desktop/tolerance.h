// The tolerances that errors are sorted by, and their colours: one hue from light to dark, as in the report's matrix.
// Colour-blind readers see its order.
#pragma once

#include <QColor>
#include <algorithm>
#include <array>
#include <optional>

namespace trigpoint {

inline constexpr std::array<double, 4> kTolerances = {0.1, 0.25, 0.5, 1.0};  // m

struct ErrorColours {
  QColor background, text;
};

inline ErrorColours ColoursOfError(double error_m) {
  static constexpr std::array<const char*, 5> kSteps = {"#fff3e0", "#fdd0a2", "#fd9a4f", "#b83c00", "#6b1f00"};
  const auto step =
      static_cast<size_t>(std::lower_bound(kTolerances.begin(), kTolerances.end(), error_m) - kTolerances.begin());
  return {QColor(kSteps[step]), step < 3 ? QColor("#1d2329") : QColor(Qt::white)};
}

// The narrowest one that holds the error, m; none beyond the last.
inline std::optional<double> ToleranceOf(double error_m) {
  const auto* at = std::lower_bound(kTolerances.begin(), kTolerances.end(), error_m);
  return at == kTolerances.end() ? std::nullopt : std::optional<double>(*at);
}

}  // namespace trigpoint
