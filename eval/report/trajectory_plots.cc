#include "eval/report/trajectory_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "eval/report/charts.h"
#include "eval/report/paint.h"
#include "eval/report/plan.h"
#include "eval/statistics/statistics.h"

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

// The largest round step of which at least three multiples lie from `low` to `high`.
double TickStep(double low, double high) {
  constexpr double kLess = 0.6;  // 5, 2, 1: each at least 0.6 times the next larger one, rounded down
  double step = RoundDown(high - low);
  while (std::floor(high / step) - std::ceil(low / step) < 2) step = RoundDown(kLess * step);
  return step;
}

// With the decimals that tell neighbours apart.
std::string TickText(double value, double step) {
  return fmt::format("{:.{}f}", std::abs(value) < 1e-9 * step ? 0 : value,
                     static_cast<int>(std::max(0.0, -std::floor(std::log10(step) + 1e-9))));
}

const char* ColourOf(size_t estimate) { return kLineColours[estimate % kLineColours.size()]; }

// From blue, no error, to vermilion, the largest: colour-blind readers tell them apart.
std::string Shade(double share) {
  constexpr std::array<int, 3> kNone = {0x00, 0x72, 0xb2}, kMost = {0xd5, 0x5e, 0x00};
  std::string colour = "#";
  for (size_t k = 0; k < 3; ++k)
    colour += fmt::format("{:02x}", static_cast<int>(std::lround(kNone[k] + share * (kMost[k] - kNone[k]))));
  return colour;
}

const PlottedTrajectory* Longest(const std::vector<PlottedTrajectory>& estimates) {
  const auto it = std::max_element(estimates.begin(), estimates.end(), [](const auto& a, const auto& b) {
    return a.reference_places.size() < b.reference_places.size();
  });
  return it == estimates.end() ? nullptr : &*it;
}

// The names of the lines, one below the other. Returns where the drawing goes on.
double Legend(const std::vector<PlottedTrajectory>& estimates, Drawing* drawing) {
  double y = 16;
  const auto entry = [&](const std::string& name, const std::string& colour, bool dashed) {
    drawing->Line({{64, y - 4}, {92, y - 4}}, colour, 2, dashed);
    drawing->Text(98, y, CleanText(name), -1);
    y += 16;
  };
  entry("reference", "#333333", true);
  for (size_t i = 0; i < estimates.size(); ++i) entry(estimates[i].name, ColourOf(i), i >= kLineColours.size());
  return y;
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
  void Path(const std::vector<Eigen::Vector3d>& places, const std::string& colour, double width, bool dashed) {
    std::vector<std::pair<double, double>> line;
    const size_t step = places.size() / kMostPoints + 1;
    for (size_t i = 0; i < places.size(); i += step) line.push_back(At(places[i].head<2>()));
    if (!places.empty()) line.push_back(At(places.back().head<2>()));
    drawing_.Line(line, colour, width, dashed);
  }
  // Of the errors that fall onto one piece the largest one gives the colour.
  void ShadedPath(const PlottedTrajectory& e, double largest) {
    const size_t step = e.places.size() / kMostPoints + 1;
    for (size_t i = 0; i + 1 < e.places.size(); i += step) {
      const size_t end = std::min(i + step, e.places.size() - 1);
      const auto from = e.errors.begin() + static_cast<std::ptrdiff_t>(i),
                 to = e.errors.begin() + static_cast<std::ptrdiff_t>(end) + 1;
      drawing_.Line({At(e.places[i].head<2>()), At(e.places[end].head<2>())},
                    Shade(*std::max_element(from, to) / largest), 3);
    }
  }

 private:
  static constexpr double kLeft = 64, kRight = 24, kTallest = 640;
  Drawing& drawing_;
  Eigen::Vector2d low_, high_;
  double scale_ = 1, top_, right_ = 0, bottom_ = 0;
};

}  // namespace

Drawing TrajectoryPlan(const std::vector<PlottedTrajectory>& estimates, const std::string& unit) {
  Drawing drawing;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
  for (const PlottedTrajectory& e : estimates) {
    for (const auto* places : {&e.places, &e.reference_places}) {
      for (const Eigen::Vector3d& p : *places) low = low.cwiseMin(p.head<2>()), high = high.cwiseMax(p.head<2>());
    }
  }
  if (low.x() > high.x()) low = high = Eigen::Vector2d::Zero();
  double y = Legend(estimates, &drawing), largest = 0;
  if (estimates.size() == 1) {
    for (const double error : estimates[0].errors) largest = std::max(largest, error);
    constexpr int kSteps = 24;
    for (int k = 0; k < kSteps; ++k)
      drawing.Rectangle(64 + 5 * k, y - 10, 5, 10, Shade(static_cast<double>(k) / (kSteps - 1)));
    drawing.Text(64 + 5 * kSteps + 6, y - 1, fmt::format("absolute error, 0 to {:.3g} {}", largest, unit), -1);
    y += 16;
  }
  PlanFrame frame(low, high, y, &drawing);
  frame.Grid(unit);
  for (size_t i = 0; i < estimates.size(); ++i) {
    if (largest > 0) {
      frame.ShadedPath(estimates[i], largest);
    } else {
      frame.Path(estimates[i].places, ColourOf(i), 2, i >= kLineColours.size());
    }
  }
  if (const PlottedTrajectory* longest = Longest(estimates)) {
    frame.Path(longest->reference_places, "#333333", 1.2, true);
  }
  return drawing;
}

Drawing TrajectoryAxesChart(const std::vector<PlottedTrajectory>& estimates, const std::string& unit) {
  constexpr double kLeft = 64, kRight = 24, kPanel = 150, kGap = 14;
  Drawing drawing;
  double along = 1e-6;
  for (const PlottedTrajectory& e : estimates) along = std::max(along, e.along.empty() ? 0 : e.along.back());
  const double right = drawing.width - kRight;
  double top = Legend(estimates, &drawing);
  for (int axis = 0; axis < 3; ++axis, top += kPanel + kGap) {
    double low = 1e300, high = -1e300;
    for (const PlottedTrajectory& e : estimates) {
      for (const auto* places : {&e.places, &e.reference_places}) {
        for (const Eigen::Vector3d& p : *places) low = std::min(low, p[axis]), high = std::max(high, p[axis]);
      }
    }
    if (low > high) low = high = 0;
    const double pad = std::max(1e-3, 0.06 * (high - low));
    low -= pad, high += pad;
    const auto at = [&](double way, double value) {
      return std::pair(kLeft + (right - kLeft) * way / along, top + kPanel * (high - value) / (high - low));
    };
    const double step = TickStep(low, high);
    for (double k = std::ceil(low / step); k <= std::floor(high / step); ++k) {
      const double v = k * step;
      drawing.Line({at(0, v), at(along, v)}, "#e3e3e3");
      drawing.Text(kLeft - 6, at(0, v).second + 4, TickText(v, step), 1);
    }
    drawing.Line({at(0, high), at(0, low), at(along, low)}, "#333333");
    drawing.Text(14, top + 0.5 * kPanel, std::string(1, "xyz"[axis]) + ", " + unit, 0, 12, "#333333", false, true);
    const auto path = [&](const PlottedTrajectory& e, const std::vector<Eigen::Vector3d>& places, const char* colour,
                          double width, bool dashed) {
      std::vector<std::pair<double, double>> line;
      const size_t every = places.size() / kMostPoints + 1;
      for (size_t i = 0; i < places.size(); i += every) line.push_back(at(e.along[i], places[i][axis]));
      drawing.Line(line, colour, width, dashed);
    };
    for (size_t i = 0; i < estimates.size(); ++i)
      path(estimates[i], estimates[i].places, ColourOf(i), 2, i >= kLineColours.size());
    if (const PlottedTrajectory* longest = Longest(estimates))
      path(*longest, longest->reference_places, "#333333", 1.2, true);
  }
  const double step = RoundedStep(along);
  for (double x = 0; x <= along; x += step)
    drawing.Text(kLeft + (right - kLeft) * x / along, top + 2, fmt::format("{:g}", x));
  drawing.Text(0.5 * (kLeft + right), top + 20, "distance along the reference, " + unit);
  drawing.height = top + 28;
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
  if (estimates.size() == 1 && !estimates[0].errors.empty()) {
    std::vector<double> errors = estimates[0].errors;
    double squares = 0;
    for (const double error : errors) squares += error * error;
    const double rmse = std::sqrt(squares / static_cast<double>(errors.size())),
                 median = Quantile(std::move(errors), 0.5);
    for (const auto& [name, value] : {std::pair("RMSE", rmse), std::pair("median", median)}) {
      const double end = estimates[0].along.back();
      series.push_back({fmt::format("{} {:.3g} {}", name, value, unit), {{0, value, {}, {}}, {end, value, {}, {}}}});
    }
  }
  return LineChart(series, "distance along the reference, " + unit, "absolute error, " + unit, false);
}

void WriteDrawing(const Drawing& drawing, const std::string& title, const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".svg") {
    WriteFileAtomically(file, SvgFileOf(drawing, title));
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
