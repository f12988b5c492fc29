// The colours of errors: one hue from light to dark, as in the report's matrix. Colour-blind readers see its order.
#pragma once

#include <QColor>
#include <algorithm>
#include <array>

namespace trigpoint {

struct ErrorColours {
  QColor background, text;
};

inline ErrorColours ColoursOfError(double error_m) {
  static constexpr std::array<double, 4> kLimits = {0.1, 0.25, 0.5, 1.0};  // m
  static constexpr std::array<const char*, 5> kSteps = {"#fff3e0", "#fdd0a2", "#fd9a4f", "#b83c00", "#6b1f00"};
  const auto step = static_cast<size_t>(std::lower_bound(kLimits.begin(), kLimits.end(), error_m) - kLimits.begin());
  return {QColor(kSteps[step]), step < 3 ? QColor("#1d2329") : QColor(Qt::white)};
}

}  // namespace trigpoint
