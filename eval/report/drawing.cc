#include "eval/report/drawing.h"

#include <fmt/format.h>

#include "eval/report/base64.h"

namespace trigpoint {
namespace {

// Length of the UTF-8 sequence that begins here, 0 if it is broken.
size_t SequenceLength(std::string_view s) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(s[i]); };
  const unsigned char first = byte(0);
  const size_t length = first < 0x80 ? 1 : first >> 5 == 6 ? 2 : first >> 4 == 14 ? 3 : first >> 3 == 30 ? 4 : 0;
  if (length == 0 || length > s.size()) return 0;
  for (size_t i = 1; i < length; ++i) {
    if (byte(i) >> 6 != 2) return 0;
  }
  // Overlong forms, surrogates, beyond U+10FFFF.
  if (length == 2 && first < 0xC2) return 0;
  if (length == 3 && ((first == 0xE0 && byte(1) < 0xA0) || (first == 0xED && byte(1) > 0x9F))) return 0;
  if (length == 4 && ((first == 0xF0 && byte(1) < 0x90) || first > 0xF4 || (first == 0xF4 && byte(1) > 0x8F))) return 0;
  return length;
}

std::string Corners(const Shape& shape) {
  std::string text;
  for (size_t i = 0; i < shape.points.size(); ++i) {
    text += fmt::format("{}{:.1f} {:.1f}", i == 0 ? "M" : "L", shape.points[i].first, shape.points[i].second);
  }
  return shape.closed ? text + "Z" : text;
}

}  // namespace

std::string CleanText(std::string_view text) {
  std::string clean;
  while (!text.empty()) {
    const size_t length = SequenceLength(text);
    const auto first = static_cast<unsigned char>(text.front());
    if (length == 0 || (length == 2 && first == 0xC2 && static_cast<unsigned char>(text[1]) < 0xA0)) {
      clean += "\xEF\xBF\xBD";
    } else if (first == '\n' || first == '\t' || first == '\r') {
      clean += ' ';
    } else if (first >= 0x20 && first != 0x7F) {
      clean += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return clean;
}

std::string Escape(std::string_view text) {
  std::string escaped;
  for (char c : CleanText(text)) {
    switch (c) {
      case '&': escaped += "&amp;"; break;
      case '<': escaped += "&lt;"; break;
      case '>': escaped += "&gt;"; break;
      case '"': escaped += "&quot;"; break;
      case '\'': escaped += "&#39;"; break;
      default: escaped += c;
    }
  }
  return escaped;
}

void Drawing::Line(std::vector<std::pair<double, double>> points, const std::string& colour, double width_px,
                   bool dashed) {
  Shape& s = shapes.emplace_back();
  s.points = std::move(points), s.stroke = colour, s.width = width_px, s.dashed = dashed;
}

void Drawing::Area(std::vector<std::pair<double, double>> points, const std::string& fill, double opacity) {
  Shape& s = shapes.emplace_back();
  s.points = std::move(points), s.closed = true, s.fill = fill, s.opacity = opacity;
}

void Drawing::Rectangle(double x, double y, double w, double h, const std::string& fill, double opacity) {
  Area({{x, y}, {x + w, y}, {x + w, y + h}, {x, y + h}}, fill, opacity);
}

void Drawing::Circle(double x, double y, double radius, const std::string& fill, double opacity) {
  Shape& s = shapes.emplace_back();
  s.kind = Shape::Kind::kCircle, s.points = {{x, y}}, s.radius = radius, s.fill = fill, s.opacity = opacity;
}

void Drawing::Photograph(double x, double y, double w, double h, std::string jpeg) {
  Shape& s = shapes.emplace_back();
  s.kind = Shape::Kind::kPicture, s.points = {{x, y}}, s.extent = {w, h};
  s.picture = std::make_shared<const std::string>(std::move(jpeg));
}

void Drawing::Text(double x, double y, const std::string& text, int anchor, double size, const std::string& colour,
                   bool bold, bool upwards) {
  Shape& s = shapes.emplace_back();
  s.kind = Shape::Kind::kText, s.points = {{x, y}}, s.text = CleanText(text), s.anchor = anchor, s.size = size;
  s.fill = colour, s.bold = bold, s.upwards = upwards;
}

double TextWidth(const std::string& text, double size) {
  size_t letters = 0;
  for (char c : text) letters += (static_cast<unsigned char>(c) >> 6) != 2;
  return 0.56 * size * static_cast<double>(letters);
}

std::string SvgOf(const Drawing& drawing, const std::string& title) {
  std::string svg = fmt::format("<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">", drawing.width,
                                drawing.height, Escape(title));
  for (const Shape& s : drawing.shapes) {
    const auto [x, y] = s.points.empty() ? std::pair<double, double>() : s.points.front();
    switch (s.kind) {
      case Shape::Kind::kPath:
        svg += fmt::format("<path d=\"{}\" fill=\"{}\"", Corners(s), s.fill.empty() ? "none" : s.fill);
        if (s.opacity < 1) svg += fmt::format(" fill-opacity=\"{:g}\"", s.opacity);
        if (!s.stroke.empty()) svg += fmt::format(" stroke=\"{}\" stroke-width=\"{:g}\"", s.stroke, s.width);
        if (s.dashed) svg += " stroke-dasharray=\"5 4\"";
        svg += "/>";
        break;
      case Shape::Kind::kCircle:
        svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:g}\" fill=\"{}\"", x, y, s.radius, s.fill);
        if (s.opacity < 1) svg += fmt::format(" fill-opacity=\"{:g}\"", s.opacity);
        svg += "/>";
        break;
      case Shape::Kind::kText:
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:g}\" fill=\"{}\" text-anchor=\"{}\"", x, y,
                           s.size, s.fill,
                           s.anchor < 0   ? "start"
                           : s.anchor > 0 ? "end"
                                          : "middle");
        if (s.bold) svg += " font-weight=\"600\"";
        if (s.upwards) svg += fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", x, y);
        svg += ">";
        svg += Escape(s.text);
        svg += "</text>";
        break;
      case Shape::Kind::kPicture:
        svg += fmt::format(
            "<image x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" preserveAspectRatio=\"none\" "
            "href=\"data:image/jpeg;base64,{}\"/>",
            x, y, s.extent.first, s.extent.second, Base64(*s.picture));
        break;
    }
  }
  return svg + "</svg>";
}

}  // namespace trigpoint
