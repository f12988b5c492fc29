#include "eval/report/trajectory_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "eval/report/charts.h"
#include "eval/report/paint.h"

namespace trigpoint {
namespace {

constexpr std::array<const char*, 6> kLineColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"};
constexpr size_t kMostPoints = 2000;  // of a line; more cannot be seen
constexpr double kPngScale = 2;       // pixels of the picture a unit of the drawing

double RoundedStep(double range) {
  const double raw = range / 6, decade = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= raw) return factor * decade;
  }
  return 10 * decade;
}

// East to the right, north up, one scale for both.
class PlanFrame {
 public:
  PlanFrame(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double top, Drawing* drawing)
      : drawing_(*drawing), top_(top) {
    const Eigen::Vector2d extent = (high - low).cwiseMax(1e-6);
    const double margin = 0.04 * extent.maxCoeff();
    low_ = low.array() - margin;
    const Eigen::Vector2d whole = extent.array() + 2 * margin;
    const double width = drawing_.width - kLeft - kRight;
    scale_ = std::min(width / whole.x(), kTallest / whole.y());
    right_ = kLeft + scale_ * whole.x();
    bottom_ = top_ + scale_ * whole.y();
    high_ = low_ + whole;
    drawing_.height = bottom_ + 42;
  }
  std::pair<double, double> At(const Eigen::Vector2d& p) const {
    return {kLeft + scale_ * (p.x() - low_.x()), bottom_ - scale_ * (p.y() - low_.y())};
  }
  void Grid(const std::string& unit) {
    const double step = RoundedStep((high_ - low_).maxCoeff());
    for (double x = std::ceil(low_.x() / step) * step; x <= high_.x(); x += step) {
      const double at = At({x, low_.y()}).first;
      drawing_.Line({{at, top_}, {at, bottom_}}, "#e3e3e3");
      drawing_.Text(at, bottom_ + 16, fmt::format("{:g}", std::abs(x) < 1e-9 * step ? 0 : x));
    }
    for (double y = std::ceil(low_.y() / step) * step; y <= high_.y(); y += step) {
      const double at = At({low_.x(), y}).second;
      drawing_.Line({{kLeft, at}, {right_, at}}, "#e3e3e3");
      drawing_.Text(kLeft - 6, at + 4, fmt::format("{:g}", std::abs(y) < 1e-9 * step ? 0 : y), 1);
    }
    drawing_.Line({{kLeft, top_}, {kLeft, bottom_}, {right_, bottom_}}, "#333333");
    drawing_.Text(0.5 * (kLeft + right_), drawing_.height - 6, "x, " + unit);
    drawing_.Text(14, 0.5 * (top_ + bottom_), "y, " + unit, 0, 12, "#333333", false, true);
  }
  void Path(const std::vector<Eigen::Vector2d>& places, const std::string& colour, double width, bool dashed) {
    std::vector<std::pair<double, double>> line;
    const size_t step = places.size() / kMostPoints + 1;
    for (size_t i = 0; i < places.size(); i += step) line.push_back(At(places[i]));
    if (!places.empty()) line.push_back(At(places.back()));
    drawing_.Line(line, colour, width, dashed);
  }

 private:
  static constexpr double kLeft = 64, kRight = 24, kTallest = 640;
  Drawing& drawing_;
  Eigen::Vector2d low_, high_;
  double scale_ = 1, top_, right_ = 0, bottom_ = 0;
};

}  // namespace

Drawing TrajectoryPlan(const std::vector<Eigen::Vector2d>& reference, const std::vector<PlottedTrajectory>& estimates,
                       const std::string& unit) {
  Drawing drawing;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
  const auto extend = [&](const std::vector<Eigen::Vector2d>& places) {
    for (const Eigen::Vector2d& p : places) low = low.cwiseMin(p), high = high.cwiseMax(p);
  };
  extend(reference);
  for (const PlottedTrajectory& e : estimates) extend(e.places);
  if (low.x() > high.x()) low = high = Eigen::Vector2d::Zero();

  double y = 16;
  const auto legend = [&](const std::string& name, const std::string& colour, bool dashed) {
    drawing.Line({{64, y - 4}, {92, y - 4}}, colour, 2, dashed);
    drawing.Text(98, y, CleanText(name), -1);
    y += 16;
  };
  legend("reference", "#333333", true);
  for (size_t i = 0; i < estimates.size(); ++i)
    legend(estimates[i].name, kLineColours[i % kLineColours.size()], i >= kLineColours.size());
  PlanFrame frame(low, high, y, &drawing);
  frame.Grid(unit);
  for (size_t i = 0; i < estimates.size(); ++i)
    frame.Path(estimates[i].places, kLineColours[i % kLineColours.size()], 2, i >= kLineColours.size());
  frame.Path(reference, "#333333", 1.2, true);
  return drawing;
}

Drawing TrajectoryErrorChart(const std::vector<PlottedTrajectory>& estimates, const std::string& unit) {
  std::vector<Series> series;
  for (const PlottedTrajectory& e : estimates) {
    Series& s = series.emplace_back(Series{e.name, {}});
    const size_t step = e.along.size() / kMostPoints + 1;
    // Of points that fall together the worst one is shown.
    for (size_t i = 0; i < e.along.size(); i += step) {
      double worst = 0;
      for (size_t k = i; k < std::min(i + step, e.errors.size()); ++k) worst = std::max(worst, e.errors[k]);
      s.points.push_back({e.along[i], worst, {}, {}});
    }
  }
  return LineChart(series, "distance along the reference, " + unit, "absolute error, " + unit, false);
}

void WriteDrawing(const Drawing& drawing, const std::string& title, const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".svg") {
    std::string svg = SvgOf(drawing, title);
    // In a page its surroundings give it these.
    svg.replace(0, 4,
                fmt::format(R"(<svg xmlns="http://www.w3.org/2000/svg" width="{:.0f}" height="{:.0f}" )"
                            R"(font-family="DejaVu Sans, sans-serif")",
                            drawing.width, drawing.height));
    WriteFileAtomically(file, svg + "\n");
    return;
  }
  if (ending != ".png") throw OptionError(file.string() + ": expected a name that ends in .svg or .png");
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(kPngScale * drawing.width)),
                                 static_cast<int>(std::ceil(kPngScale * drawing.height))),
      cairo_surface_destroy);
  {
    const std::unique_ptr<cairo_t, void (*)(cairo_t*)> cairo(cairo_create(surface.get()), cairo_destroy);
    cairo_set_source_rgb(cairo.get(), 1, 1, 1);
    cairo_paint(cairo.get());
    cairo_scale(cairo.get(), kPngScale, kPngScale);
    Paint(cairo.get(), drawing);
  }
  std::string png;
  const auto append = [](void* to, const unsigned char* data, unsigned int size) {
    static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(data), size);
    return CAIRO_STATUS_SUCCESS;
  };
  if (cairo_surface_write_to_png_stream(surface.get(), append, &png) != CAIRO_STATUS_SUCCESS)
    throw IoError(file.string() + ": the picture cannot be encoded");
  WriteFileAtomically(file, png);
}

}  // namespace trigpoint
