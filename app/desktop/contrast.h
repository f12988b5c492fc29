// Colours of texts that are read on light and on dark.
#pragma once

#include <QColor>
#include <algorithm>

#include "eval/text/luminance.h"

namespace trigpoint {

inline double Luminance(const QColor& colour) {
  return Luminance(std::array{colour.redF(), colour.greenF(), colour.blueF()});
}

// The ratio of two luminances as WCAG 2.1 has it, 1 to 21.
inline double ContrastOf(const QColor& a, const QColor& b) {
  const double high = std::max(Luminance(a), Luminance(b)), low = std::min(Luminance(a), Luminance(b));
  return (high + 0.05) / (low + 0.05);
}

// The hue of `colour`, darker or lighter as far as text of it needs on `ground` (4.5, WCAG 2.1 AA).
inline QColor ReadableOn(const QColor& ground, const QColor& colour) {
  constexpr double kLeast = 4.5;
  const QColor towards = Luminance(ground) > 0.18 ? Qt::black : Qt::white;
  for (double t = 0; t < 1; t += 0.05) {
    const QColor mixed =
        QColor::fromRgbF((1 - t) * colour.redF() + t * towards.redF(), (1 - t) * colour.greenF() + t * towards.greenF(),
                         (1 - t) * colour.blueF() + t * towards.blueF());
    if (ContrastOf(mixed, ground) >= kLeast) return mixed;
  }
  return towards;
}

}  // namespace trigpoint
