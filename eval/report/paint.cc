#include "eval/report/paint.h"

#include <array>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "eval/report/document.h"

namespace trigpoint {

void SetColour(cairo_t* cairo, const std::string& colour, double opacity) {
  const auto part = [&](size_t at) { return std::stoi(colour.substr(at, 2), nullptr, 16) / 255.0; };
  cairo_set_source_rgba(cairo, part(1), part(3), part(5), opacity);
}

TextPainter::TextPainter(cairo_t* cairo)
    : cairo_(cairo), layout_(pango_cairo_create_layout(cairo)), font_(pango_font_description_new()) {
  pango_font_description_set_family(font_, "DejaVu Sans, sans-serif");
  // Letters where they belong at any resolution, not where a screen's pixels are.
  cairo_font_options_t* options = cairo_font_options_create();
  cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_antialias(options, CAIRO_ANTIALIAS_GRAY);
  pango_cairo_context_set_font_options(pango_layout_get_context(layout_), options);
  cairo_font_options_destroy(options);
  pango_layout_set_wrap(layout_, PANGO_WRAP_WORD_CHAR);
}

TextPainter::~TextPainter() {
  pango_font_description_free(font_);
  g_object_unref(layout_);
}

void TextPainter::Set(const std::string& text, double size, bool bold, double width, int anchor, int lines) {
  pango_font_description_set_absolute_size(font_, size * PANGO_SCALE);
  pango_font_description_set_weight(font_, bold ? PANGO_WEIGHT_BOLD : PANGO_WEIGHT_NORMAL);
  pango_layout_set_font_description(layout_, font_);
  pango_layout_set_width(layout_, width > 0 ? static_cast<int>(width * PANGO_SCALE) : -1);
  pango_layout_set_alignment(layout_, anchor < 0    ? PANGO_ALIGN_LEFT
                                      : anchor == 0 ? PANGO_ALIGN_CENTER
                                                    : PANGO_ALIGN_RIGHT);
  pango_layout_set_ellipsize(layout_, lines == 1 ? PANGO_ELLIPSIZE_END : PANGO_ELLIPSIZE_NONE);
  const std::string clean = CleanText(text);
  pango_layout_set_text(layout_, clean.c_str(), static_cast<int>(clean.size()));
}

double TextPainter::Height(const std::string& text, double size, bool bold, double width) {
  if (text.empty()) return 0;
  Set(text, size, bold, width, -1, 0);
  int w = 0, h = 0;
  pango_layout_get_size(layout_, &w, &h);
  return static_cast<double>(h) / PANGO_SCALE;
}

void TextPainter::Draw(const std::string& text, double x, double y, double size, bool bold, const std::string& colour,
                       double width, int anchor, int lines) {
  if (text.empty()) return;
  Set(text, size, bold, width, anchor, lines);
  SetColour(cairo_, colour, 1);
  cairo_move_to(cairo_, x, y);
  pango_cairo_show_layout(cairo_, layout_);
}

void TextPainter::DrawAt(const Shape& text) {
  Set(text.text, text.size, text.bold, 0, -1, 0);
  int w = 0, h = 0;
  pango_layout_get_size(layout_, &w, &h);
  const double width = static_cast<double>(w) / PANGO_SCALE;
  const double ascent = static_cast<double>(pango_layout_get_baseline(layout_)) / PANGO_SCALE;
  SetColour(cairo_, text.fill, 1);
  cairo_save(cairo_);
  cairo_translate(cairo_, text.points[0].first, text.points[0].second);
  if (text.upwards) cairo_rotate(cairo_, -1.5707963267948966);
  cairo_move_to(cairo_, text.anchor < 0 ? 0 : text.anchor == 0 ? -0.5 * width : -width, -ascent);
  pango_cairo_show_layout(cairo_, layout_);
  cairo_restore(cairo_);
}

// Not cairo_paint: an image painted without bounds inside a tag ends a PDF's page as wrongly nested (cairo 1.16).
void FillImage(cairo_t* cairo, cairo_surface_t* image) {
  cairo_rectangle(cairo, 0, 0, cairo_image_surface_get_width(image), cairo_image_surface_get_height(image));
  cairo_fill(cairo);
}

namespace {

void PaintPicture(cairo_t* cairo, const Shape& shape) {
  const auto surface = DecodedSurface(*shape.picture);
  if (!surface) return;
  cairo_save(cairo);
  cairo_translate(cairo, shape.points[0].first, shape.points[0].second);
  cairo_scale(cairo, shape.extent.first / cairo_image_surface_get_width(surface.get()),
              shape.extent.second / cairo_image_surface_get_height(surface.get()));
  // On paper the file's own bytes go in.
  auto* bytes = new std::string(*shape.picture);
  cairo_surface_set_mime_data(
      surface.get(), CAIRO_MIME_TYPE_JPEG, reinterpret_cast<const unsigned char*>(bytes->data()), bytes->size(),
      [](void* data) { delete static_cast<std::string*>(data); }, bytes);
  cairo_set_source_surface(cairo, surface.get(), 0, 0);
  FillImage(cairo, surface.get());
  cairo_restore(cairo);
}

}  // namespace

void Paint(cairo_t* cairo, const Drawing& drawing) {
  TextPainter painter(cairo);
  for (const Shape& s : drawing.shapes) {
    if (s.points.empty()) continue;
    if (s.kind == Shape::Kind::kText) {
      painter.DrawAt(s);
      continue;
    }
    if (s.kind == Shape::Kind::kPicture) {
      PaintPicture(cairo, s);
      continue;
    }
    cairo_new_path(cairo);
    if (s.kind == Shape::Kind::kCircle) {
      cairo_arc(cairo, s.points[0].first, s.points[0].second, s.radius, 0, 6.283185307179586);
    } else {
      for (const auto& [x, y] : s.points) cairo_line_to(cairo, x, y);
      if (s.closed) cairo_close_path(cairo);
    }
    if (!s.fill.empty()) {
      SetColour(cairo, s.fill, s.opacity);
      cairo_fill_preserve(cairo);
    }
    if (!s.stroke.empty()) {
      const std::array<double, 2> dashes = {5, 4};
      cairo_set_dash(cairo, dashes.data(), s.dashed ? 2 : 0, 0);
      cairo_set_line_width(cairo, s.width);
      SetColour(cairo, s.stroke, 1);
      cairo_stroke_preserve(cairo);
    }
    cairo_new_path(cairo);
  }
}

std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> DecodedSurface(const std::string& bytes) {
  const cv::Mat coded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
  const cv::Mat picture = cv::imdecode(coded, cv::IMREAD_COLOR);
  std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(nullptr, cairo_surface_destroy);
  if (picture.empty()) return surface;
  surface.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, picture.cols, picture.rows));
  cv::Mat pixels(picture.rows, picture.cols, CV_8UC4, cairo_image_surface_get_data(surface.get()),
                 static_cast<size_t>(cairo_image_surface_get_stride(surface.get())));
  cv::cvtColor(picture, pixels, cv::COLOR_BGR2BGRA);
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

std::string PngOf(const Drawing& drawing, double scale) {
  std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(drawing.width * scale),
                                 static_cast<int>(drawing.height * scale)),
      cairo_surface_destroy);
  std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo(cairo_create(surface.get()), cairo_destroy);
  SetColour(cairo.get(), "#ffffff", 1);
  cairo_paint(cairo.get());
  cairo_scale(cairo.get(), scale, scale);
  Paint(cairo.get(), drawing);
  std::string png;
  cairo_surface_write_to_png_stream(
      surface.get(),
      [](void* out, const unsigned char* data, unsigned int length) {
        static_cast<std::string*>(out)->append(reinterpret_cast<const char*>(data), length);
        return CAIRO_STATUS_SUCCESS;
      },
      &png);
  return png;
}

}  // namespace trigpoint
