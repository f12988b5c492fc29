#include "eval/report/drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

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

bool DrawnBox::Overlaps(const DrawnBox& other) const {
  return x < other.x + other.width && other.x < x + width && y < other.y + other.height && other.y < y + height;
}

void LabelPlaces::Cover(const std::vector<std::pair<double, double>>& line, std::vector<DrawnBox>* boxes) {
  constexpr double kStep = 4;
  for (size_t i = 1; i < line.size(); ++i) {
    const auto [x0, y0] = line[i - 1];
    const double dx = line[i].first - x0, dy = line[i].second - y0;
    const int steps = std::max(1, static_cast<int>(std::hypot(dx, dy) / kStep));
    for (int k = 0; k <= steps; ++k) boxes->push_back({x0 + k * dx / steps - 0.5, y0 + k * dy / steps - 0.5, 1, 1});
  }
}

bool LabelPlaces::IsFree(const DrawnBox& box) const {
  const bool inside = box.x >= frame_.x && box.y >= frame_.y && box.x + box.width <= frame_.x + frame_.width &&
                      box.y + box.height <= frame_.y + frame_.height;
  return inside && std::none_of(taken_.begin(), taken_.end(), [&](const DrawnBox& b) { return b.Overlaps(box); });
}

std::optional<DrawnBox> LabelPlaces::Place(const DrawnBox& mark, double width, double height) {
  constexpr double kApart = 2;
  const double left = mark.x - kApart - width, right = mark.x + mark.width + kApart;
  const double above = mark.y - kApart - height, below = mark.y + mark.height + kApart;
  const double middle_x = mark.x + 0.5 * (mark.width - width), middle_y = mark.y + 0.5 * (mark.height - height);
  const std::array<std::pair<double, double>, 8> places = {{{right, middle_y},
                                                            {left, middle_y},
                                                            {middle_x, above},
                                                            {middle_x, below},
                                                            {right, above},
                                                            {left, above},
                                                            {right, below},
                                                            {left, below}}};
  for (const bool over_paths : {false, true}) {
    for (const auto& [x, y] : places) {
      const DrawnBox box{x, y, width, height};
      if (!IsFree(box)) continue;
      if (!over_paths &&
          std::any_of(avoided_.begin(), avoided_.end(), [&](const DrawnBox& b) { return b.Overlaps(box); })) {
        continue;
      }
      taken_.push_back(box);
      return box;
    }
  }
  return std::nullopt;
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

std::string SvgFileOf(const Drawing& drawing, const std::string& title) {
  return SvgOf(drawing, title)
             .replace(0, 4,
                      fmt::format(R"(<svg xmlns="http://www.w3.org/2000/svg" width="{:.0f}" height="{:.0f}" )"
                                  R"(font-family="DejaVu Sans, sans-serif")",
                                  drawing.width, drawing.height)) +
         "\n";
}

}  // namespace trigpoint
