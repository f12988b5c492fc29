// How light a colour is to the eye.
#pragma once

#include <array>
#include <cmath>
#include <string>

namespace trigpoint {

// Relative luminance of WCAG 2.1 of red, green and blue in 0 to 1: 0 is black, 1 white.
inline double Luminance(const std::array<double, 3>& rgb) {
  const auto part = [](double c) { return c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); };
  return 0.2126 * part(rgb[0]) + 0.7152 * part(rgb[1]) + 0.0722 * part(rgb[2]);
}

// The same of "#rrggbb".
inline double Luminance(const std::string& colour) {
  const auto part = [&](size_t k) { return std::stoi(colour.substr(1 + 2 * k, 2), nullptr, 16) / 255.0; };
  return Luminance(std::array{part(0), part(1), part(2)});
}

}  // namespace trigpoint
