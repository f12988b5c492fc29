#include "eval/print/text_fit.h"

#include <cairo.h>

#include <algorithm>
#include <memory>

#include "eval/report/drawing.h"
#include "eval/report/paint.h"

namespace trigpoint {
namespace {

// UTF-8: the longest beginning of `text` with at most `bytes` bytes that cuts no letter.
size_t WholeLetters(const std::string& text, size_t bytes) {
  while (bytes > 0 && bytes < text.size() && (static_cast<unsigned char>(text[bytes]) >> 6) == 2) --bytes;
  return bytes;
}

// The longest beginning that fits; at least one letter.
size_t FittingBytes(const std::string& text, double size_mm, double room_mm, bool bold) {
  size_t low = 1, high = text.size();
  while (low < high) {
    const size_t middle = (low + high + 1) / 2;
    if (PrintedWidth(text.substr(0, WholeLetters(text, middle)), size_mm, bold) <= room_mm) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  size_t bytes = WholeLetters(text, low);
  while (bytes < text.size() && (bytes == 0 || (static_cast<unsigned char>(text[bytes]) >> 6) == 2)) ++bytes;
  return bytes;
}

}  // namespace

double PrintedWidth(const std::string& text, double size_mm, bool bold) {
  if (text.empty()) return 0;
  constexpr double kUnits = 100;  // letters that are large against Pango's whole units
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_recording_surface_create(CAIRO_CONTENT_COLOR_ALPHA, nullptr), cairo_surface_destroy);
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo(cairo_create(surface.get()), cairo_destroy);
  Shape shape;
  shape.kind = Shape::Kind::kText;
  shape.points = {{0, 0}};
  shape.text = text;
  shape.size = kUnits;
  shape.anchor = -1;
  shape.bold = bold;
  shape.fill = "#000000";
  TextPainter(cairo.get()).DrawAt(shape);
  double x = 0, y = 0, width = 0, height = 0;
  cairo_recording_surface_ink_extents(surface.get(), &x, &y, &width, &height);
  return (x + width) * size_mm / kUnits;
}

double FittedSize(const std::string& text, double wanted_mm, double room_mm, bool bold) {
  const double width = PrintedWidth(text, wanted_mm, bold);
  return width > room_mm ? wanted_mm * std::max(0.0, room_mm) / width : wanted_mm;
}

std::vector<std::string> WrappedLines(const std::string& text, double size_mm, double room_mm, bool bold) {
  std::vector<std::string> lines;
  std::string rest = text;
  while (true) {
    rest.erase(0, std::min(rest.find_first_not_of(' '), rest.size()));
    if (rest.empty()) return lines;
    // As many whole words as fit, else as many letters.
    size_t line = 0;
    for (size_t end = 0; end < rest.size();) {
      end = std::min(rest.find(' ', rest.find_first_not_of(' ', end)), rest.size());
      if (PrintedWidth(rest.substr(0, end), size_mm, bold) > room_mm) break;
      line = end;
    }
    if (line == 0) line = FittingBytes(rest, size_mm, room_mm, bold);
    lines.push_back(rest.substr(0, line));
    while (!lines.back().empty() && lines.back().back() == ' ') lines.back().pop_back();
    rest.erase(0, line);
  }
}

std::string Shortened(const std::string& text, double size_mm, double room_mm, bool bold) {
  if (PrintedWidth(text, size_mm, bold) <= room_mm) return text;
  const std::string dots = "…";
  return text.substr(0, FittingBytes(text, size_mm, room_mm - PrintedWidth(dots, size_mm, bold), bold)) + dots;
}

}  // namespace trigpoint
