// Colours of texts that are read on light and on dark.
#pragma once

#include <QColor>
#include <algorithm>
#include <cmath>

namespace trigpoint {

// Of WCAG 2.1: relative luminance, and the ratio of two, 1 to 21.
inline double Luminance(const QColor& colour) {
  const auto part = [](double c) { return c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); };
  return 0.2126 * part(colour.redF()) + 0.7152 * part(colour.greenF()) + 0.0722 * part(colour.blueF());
}
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
