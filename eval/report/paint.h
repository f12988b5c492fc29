// Drawings and words on a Cairo surface.
#pragma once

#include <cairo.h>
#include <pango/pangocairo.h>

#include <memory>
#include <string>

#include "eval/report/drawing.h"

namespace trigpoint {

// "#rrggbb".
void SetColour(cairo_t* cairo, const std::string& colour, double opacity);

// Sets text with one layout that is used again and again.
class TextPainter {
 public:
  explicit TextPainter(cairo_t* cairo);
  ~TextPainter();
  TextPainter(const TextPainter&) = delete;
  TextPainter& operator=(const TextPainter&) = delete;

  // Of the text broken into lines of `width`; 0 for no text.
  double Height(const std::string& text, double size, bool bold, double width);
  // Its top left corner at x, y. anchor -1: to the left, 0: centred, 1: to the right of `width`. `lines` 1: cut off
  // with an ellipsis; 0: as many as it takes.
  void Draw(const std::string& text, double x, double y, double size, bool bold, const std::string& colour,
            double width, int anchor, int lines);
  // On one line; the point is on its baseline.
  void DrawAt(const Shape& text);

 private:
  void Set(const std::string& text, double size, bool bold, double width, int anchor, int lines);
  cairo_t* cairo_;
  PangoLayout* layout_;
  PangoFontDescription* font_;
};

void Paint(cairo_t* cairo, const Drawing& drawing);

// A PNG's or JPEG's pixels; nothing if it cannot be decoded.
std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> DecodedSurface(const std::string& bytes);
// Paints the image that is the source, from the origin.
void FillImage(cairo_t* cairo, cairo_surface_t* image);

}  // namespace trigpoint
