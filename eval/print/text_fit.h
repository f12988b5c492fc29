// Words on paper: how wide they are, and lines that fit.
//
// Millimetres, in the font of the sheets.
#pragma once

#include <string>
#include <vector>

namespace trigpoint {

// From the point where the text begins to the right edge of its ink; `size_mm`: of the letters.
double PrintedWidth(const std::string& text, double size_mm, bool bold = false);

// The largest letters, at most `wanted_mm`, with which the text is no wider than `room_mm`.
double FittedSize(const std::string& text, double wanted_mm, double room_mm, bool bold = false);

// The text in lines no wider than `room_mm`: broken at spaces (not at U+00A0), a word that is wider between letters.
std::vector<std::string> WrappedLines(const std::string& text, double size_mm, double room_mm, bool bold = false);

// The text, its end replaced by an ellipsis where it is wider than `room_mm`.
std::string Shortened(const std::string& text, double size_mm, double room_mm, bool bold = false);

}  // namespace trigpoint
