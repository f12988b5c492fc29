#include "eval/report/charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

namespace trigpoint {
namespace {

constexpr std::array<const char*, 7> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                 "#e69f00", "#56b4e9", "#333333"};
constexpr const char* kGrid = "#e3e3e3";
constexpr const char* kInk = "#333333";

const char* ColourOf(size_t series) { return kColours[series % kColours.size()]; }

// 1, 2 or 5 times a power of ten, so that the range has at most `parts` of it.
double RoundStep(double range, int parts) {
  const double raw = range / parts, decade = std::pow(10.0, std::floor(std::log10(raw)));
  for (double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= raw) return factor * decade;
  }
  return 10 * decade;
}

struct Axis {
  double low = 0, high = 1;
  bool logarithmic = false;
  std::string title;
  bool percent = false;

  double At(double v) const {
    if (!logarithmic) return (v - low) / (high - low);
    return (std::log10(std::max(v, 1e-12)) - std::log10(low)) / (std::log10(high) - std::log10(low));
  }
  std::vector<double> Ticks() const {
    std::vector<double> ticks;
    if (logarithmic) {
      const bool dense = high / low < 150, denser = high / low <= 10;
      for (double d = std::pow(10.0, std::floor(std::log10(low) + 1e-9)); d <= high * 1.001; d *= 10) {
        for (double f : {1.0, 2.0, 3.0, 4.0, 5.0, 7.0}) {
          const bool round = f == 1 || f == 2 || f == 5;
          if ((f == 1 || (dense && round) || denser) && f * d >= low * 0.999 && f * d <= high * 1.001)
            ticks.push_back(f * d);
        }
      }
      return ticks;
    }
    const double step = RoundStep(high - low, 5);
    for (double t = std::ceil(low / step) * step; t <= high + 1e-9 * step; t += step) ticks.push_back(t);
    return ticks;
  }
  std::string Label(double t) const { return percent ? fmt::format("{:.0f} %", 100 * t) : fmt::format("{:g}", t); }
};

// A logarithmic range that begins and ends with 1, 2 or 5 times a power of ten.
Axis LogAxis(const std::vector<double>& values, const std::string& title) {
  double low = 0.1, high = 1;
  bool any = false;
  for (double v : values) {
    if (!(v > 0) || !std::isfinite(v)) continue;
    low = any ? std::min(low, v) : v, high = any ? std::max(high, v) : v;
    any = true;
  }
  low = std::max(low, high * 1e-5);
  const double below = std::pow(10.0, std::floor(std::log10(low)));
  const double above = std::pow(10.0, std::floor(std::log10(high)));
  low = low >= 5 * below ? 5 * below : low >= 2 * below ? 2 * below : below;
  high = high <= above ? above : high <= 2 * above ? 2 * above : high <= 5 * above ? 5 * above : 10 * above;
  return {low, high <= low ? 10 * low : high, true, title};
}

// Axes with their frame, and where values fall in it.
class Plot {
 public:
  // `bottom`: room for what stands below the frame.
  Plot(Axis x, Axis y, double frame_height, double bottom, const std::vector<std::string>& names,
       double width = Drawing().width)
      : x_(std::move(x)), y_(std::move(y)) {
    drawing_.width = width;
    right_ = drawing_.width - 24;  // half of the last tick's label stands beyond it
    Legend(names);
    bottom_ = top_ + frame_height;
    drawing_.height = bottom_ + bottom;
  }

  void Frame(bool x_ticks) {
    for (double t : y_.Ticks()) {
      drawing_.Line({{left_, Y(t)}, {right_, Y(t)}}, kGrid);
      drawing_.Text(left_ - 6, Y(t) + 4, y_.Label(t), 1);
    }
    for (double t : x_ticks ? x_.Ticks() : std::vector<double>()) {
      drawing_.Line({{X(t), top_}, {X(t), bottom_}}, kGrid);
      drawing_.Text(X(t), bottom_ + 16, x_.Label(t));
    }
    drawing_.Line({{left_, top_}, {left_, bottom_}, {right_, bottom_}}, kInk);
    drawing_.Text(0.5 * (left_ + right_), drawing_.height - 6, x_.title);
    drawing_.Text(14, 0.5 * (top_ + bottom_), y_.title, 0, 12, kInk, false, true);
  }

  // Circles, squares, triangles and diamonds in turn.
  void Mark(size_t series, double x, double y, double r) {
    const char* c = ColourOf(series);
    switch (series % 4) {
      case 0: drawing_.Circle(x, y, r, c, 0.85); break;
      case 1: drawing_.Rectangle(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r, c, 0.85); break;
      case 2: drawing_.Area({{x, y - 1.2 * r}, {x + 1.1 * r, y + 0.8 * r}, {x - 1.1 * r, y + 0.8 * r}}, c, 0.85); break;
      default: drawing_.Area({{x, y - 1.3 * r}, {x + 1.3 * r, y}, {x, y + 1.3 * r}, {x - 1.3 * r, y}}, c, 0.85);
    }
  }

  void AddSpot(double x, double y, const std::string& object) {
    if (!object.empty()) drawing_.spots.push_back({X(x), Y(y), object});
  }

  double X(double v) const { return left_ + Inside(x_.At(v)) * (right_ - left_); }
  double Y(double v) const { return bottom_ - Inside(y_.At(v)) * (bottom_ - top_); }
  Drawing& drawing() { return drawing_; }
  double left() const { return left_; }
  double right() const { return right_; }
  double bottom() const { return bottom_; }

 private:
  static double Inside(double share) { return std::isnan(share) ? 0 : std::clamp(share, 0.0, 1.0); }

  // Names above the frame, in as many lines as they need.
  void Legend(const std::vector<std::string>& names) {
    double x = left_, y = 14;
    for (size_t i = 0; i < names.size(); ++i) {
      const double w = 36 + TextWidth(names[i], 12);
      if (x + w > right_ + 8 && x > left_) x = left_, y += 18;
      drawing_.Line({{x, y - 4}, {x + 16, y - 4}}, ColourOf(i), 2.5, i >= kColours.size());
      Mark(i, x + 8, y - 4, 3.5);
      drawing_.Text(x + 21, y, names[i], -1);
      x += w;
    }
    top_ = names.empty() ? 14 : y + 12;
  }

  Axis x_, y_;
  Drawing drawing_;
  double left_ = 64, right_ = 0, top_ = 14, bottom_ = 0;
};

template <typename T>
std::vector<std::string> Names(const std::vector<T>& series) {
  std::vector<std::string> names;
  for (const T& s : series) names.push_back(CleanText(s.name));
  return names;
}

size_t BinOf(double value, size_t bins, double limit) {
  const auto count = static_cast<double>(bins);
  return static_cast<size_t>(std::clamp(value / limit * count, 0.0, count - 1.0));
}

// The values of samples with the objects they are of, the largest first.
std::vector<std::pair<double, const std::string*>> ValuesOfObjects(const std::vector<Sample>& samples) {
  std::vector<std::pair<double, const std::string*>> values;
  for (const Sample& sample : samples) {
    for (size_t k = 0; k < std::min(sample.values.size(), sample.objects.size()); ++k) {
      if (std::isnan(sample.values[k]) || sample.objects[k].empty()) continue;
      values.emplace_back(sample.values[k], &sample.objects[k]);
    }
  }
  std::sort(values.begin(), values.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : *a.second < *b.second;
  });
  return values;
}

// The objects of a bin are in its highest bar. Each of a few objects stands on the axis, too; more would overlap.
void AddBinSpots(const std::vector<Sample>& samples, const std::vector<std::vector<double>>& shares, double limit,
                 Plot* plot) {
  constexpr size_t kMostSpots = 200;
  const auto values = ValuesOfObjects(samples);
  std::map<size_t, std::vector<std::string>> of_bin;
  std::set<std::pair<size_t, std::string>> there;
  for (const auto& [value, object] : values) {
    if (values.size() <= kMostSpots) plot->AddSpot(value, 0, *object);
    const size_t bin = BinOf(value, shares.front().size(), limit);
    if (there.emplace(bin, *object).second) of_bin[bin].push_back(*object);
  }
  for (auto& [bin, objects] : of_bin) {
    double top = 0;
    for (const std::vector<double>& share : shares) top = std::max(top, share[bin]);
    const double width = limit / static_cast<double>(shares.front().size()), left = width * static_cast<double>(bin);
    plot->drawing().groups.push_back({plot->X(left), plot->Y(top), plot->X(left + width) - plot->X(left),
                                      plot->bottom() - plot->Y(top), std::move(objects)});
  }
}

}  // namespace

Drawing CumulativeChart(const std::vector<Series>& series, const std::string& x_axis, const std::string& y_axis,
                        double width) {
  std::vector<double> values;
  for (const Series& s : series) {
    for (const CurvePoint& p : s.points) values.push_back(p.x);
  }
  const Axis x = LogAxis(values, x_axis);
  Plot plot(x, {0, 1, false, y_axis, true}, 310, 42, Names(series), width);
  plot.Frame(true);
  for (size_t i = series.size(); i-- > 0;) {
    const std::vector<CurvePoint>& points = series[i].points;
    if (points.empty()) continue;
    std::vector<std::pair<double, double>> line = {{plot.X(x.low), plot.Y(0)}};
    std::vector<std::pair<double, double>> upper, lower;
    double before = 0;
    for (const CurvePoint& p : points) {
      line.emplace_back(plot.X(p.x), plot.Y(before));
      line.emplace_back(plot.X(p.x), plot.Y(p.y));
      before = p.y;
      if (!p.low || !p.high) continue;
      upper.emplace_back(plot.X(p.x), plot.Y(*p.high));
      lower.emplace_back(plot.X(p.x), plot.Y(*p.low));
    }
    line.emplace_back(plot.X(x.high), plot.Y(before));
    if (i == 0 && upper.size() > 1) {
      upper.insert(upper.end(), lower.rbegin(), lower.rend());
      plot.drawing().Area(upper, ColourOf(0), 0.14);
    }
    plot.drawing().Line(line, ColourOf(i), 2, i >= kColours.size());
    for (const CurvePoint& p : points) plot.AddSpot(p.x, p.y, p.object);
    if (points.size() > 60) continue;
    for (const CurvePoint& p : points) plot.Mark(i, plot.X(p.x), plot.Y(p.y), 3);
  }
  return plot.drawing();
}

Drawing LineChart(const std::vector<Series>& series, const std::string& x_axis, const std::string& y_axis,
                  bool diagonal, double width) {
  double right = 0, top = 0;
  for (const Series& s : series) {
    for (const CurvePoint& p : s.points) right = std::max(right, p.x), top = std::max(top, p.y);
  }
  if (diagonal) right = top = 1;
  Plot plot({0, right > 0 ? right : 1, false, x_axis, diagonal}, {0, top > 0 ? top : 1, false, y_axis, diagonal}, 300,
            42, Names(series), width);
  plot.Frame(true);
  if (diagonal) plot.drawing().Line({{plot.X(0), plot.Y(0)}, {plot.X(1), plot.Y(1)}}, kInk, 1, true);
  for (size_t i = 0; i < series.size(); ++i) {
    std::vector<std::pair<double, double>> line;
    for (const CurvePoint& p : series[i].points) line.emplace_back(plot.X(p.x), plot.Y(p.y));
    plot.drawing().Line(line, ColourOf(i), 2);
    for (const CurvePoint& p : series[i].points) plot.AddSpot(p.x, p.y, p.object);
    if (line.size() > 60) continue;
    for (const auto& [x, y] : line) plot.Mark(i, x, y, 3);
  }
  return plot.drawing();
}

Drawing DotChart(const std::vector<std::string>& categories, const std::vector<DotSeries>& series,
                 const std::string& y_axis, const std::string& kind) {
  std::vector<double> values;
  for (const DotSeries& s : series) {
    for (const auto& [category, value] : s.dots) values.push_back(value);
  }
  const bool crowded = categories.size() > 10;
  double longest = 0;
  for (const std::string& c : categories) longest = std::max(longest, TextWidth(c, 11));
  const double bottom = crowded ? std::min(130.0, longest + 34) : 42;
  const double columns = static_cast<double>(std::max<size_t>(1, categories.size()));
  Plot plot({0, columns, false, kind}, LogAxis(values, y_axis), 290, bottom, Names(series));
  plot.Frame(false);
  for (size_t k = 0; k < categories.size(); ++k) {
    const double x = plot.X(static_cast<double>(k) + 0.5), edge = plot.X(static_cast<double>(k));
    if (k > 0) plot.drawing().Line({{edge, plot.bottom()}, {edge, plot.bottom() + 5}}, kInk);
    if (crowded) {
      plot.drawing().Text(x + 4, plot.bottom() + 8, categories[k], 1, 11, kInk, false, true);
    } else {
      plot.drawing().Text(x, plot.bottom() + 16, categories[k], 0, 11);
    }
  }
  const double room = (plot.right() - plot.left()) / columns;
  for (size_t i = 0; i < series.size(); ++i) {
    const double shift = (static_cast<double>(i) - 0.5 * static_cast<double>(series.size() - 1)) *
                         std::min(14.0, 0.7 * room / static_cast<double>(series.size()));
    for (const auto& [category, value] : series[i].dots) {
      if (!(value > 0)) continue;
      const double x = plot.X(category + 0.5) + shift, y = plot.Y(value);
      plot.Mark(i, x, y, room < 14 ? 2.5 : 4);
      plot.drawing().spots.push_back({x, y, kind + ":" + categories[static_cast<size_t>(category)]});
    }
  }
  return plot.drawing();
}

Drawing HistogramChart(const std::vector<Sample>& samples, int bins, double limit, const std::string& x_axis,
                       const Series* expected, double width) {
  std::vector<std::vector<double>> shares;
  double top = 0;
  for (const Sample& sample : samples) {
    std::vector<double>& share = shares.emplace_back(static_cast<size_t>(bins), 0.0);
    size_t count = 0;
    for (double v : sample.values) {
      if (std::isnan(v)) continue;
      ++share[BinOf(v, share.size(), limit)];
      ++count;
    }
    for (double& s : share) top = std::max(top, s /= static_cast<double>(std::max<size_t>(1, count)));
  }
  std::vector<std::string> names = Names(samples);
  if (expected != nullptr) {
    names.push_back(expected->name);
    for (const CurvePoint& p : expected->points) top = std::max(top, p.y);
  }
  Plot plot({0, limit, false, x_axis}, {0, top > 0 ? 1.05 * top : 1, false, "share", true}, 260, 42, names, width);
  plot.Frame(true);
  for (size_t i = 0; i < samples.size(); ++i) {
    std::vector<std::pair<double, double>> outline = {{plot.X(0), plot.Y(0)}};
    for (int b = 0; b < bins; ++b) {
      const double y = plot.Y(shares[i][static_cast<size_t>(b)]);
      outline.emplace_back(plot.X(limit * b / bins), y);
      outline.emplace_back(plot.X(limit * (b + 1) / bins), y);
    }
    outline.emplace_back(plot.X(limit), plot.Y(0));
    if (samples.size() == 1) plot.drawing().Area(outline, ColourOf(i), 0.18);
    plot.drawing().Line(outline, ColourOf(i), 2);
  }
  if (expected != nullptr) {
    std::vector<std::pair<double, double>> line;
    for (const CurvePoint& p : expected->points) line.emplace_back(plot.X(p.x), plot.Y(p.y));
    plot.drawing().Line(line, ColourOf(samples.size()), 2, true);
  }
  AddBinSpots(samples, shares, limit, &plot);
  return plot.drawing();
}

Drawing MatrixChart(const std::vector<std::string>& rows, const std::vector<std::string>& columns,
                    const std::vector<std::vector<MatrixCell>>& cells, const std::vector<double>& limits,
                    const std::string& unit) {
  // One hue from light to dark: its order is seen by colour-blind readers and in print, too.
  constexpr std::array<const char*, 5> kSteps = {"#fff3e0", "#fdd0a2", "#fd9a4f", "#b83c00", "#6b1f00"};
  constexpr std::array<const char*, 5> kWords = {"#1d2329", "#1d2329", "#1d2329", "#ffffff", "#ffffff"};
  const auto step = [&](double v) {
    const auto at = static_cast<size_t>(std::lower_bound(limits.begin(), limits.end(), v) - limits.begin());
    return std::min(at, kSteps.size() - 1);
  };
  constexpr double kRow = 26, kTop = 22;
  double left = 40;
  constexpr double kBoldWider = 1.15;
  for (const std::string& row : rows) left = std::max(left, kBoldWider * TextWidth(row, 13) + 14);
  Drawing drawing;
  const double width =
      std::clamp((drawing.width - left) / static_cast<double>(std::max<size_t>(1, columns.size())), 34.0, 90.0);
  drawing.width = std::max(left + width * static_cast<double>(columns.size()), 420.0);
  drawing.height = kTop + kRow * static_cast<double>(rows.size()) + 30;
  const auto fits = [&](const std::string& text) {
    const auto letters = static_cast<size_t>(std::max(2.0, (width - 2) / 7));
    return text.size() > letters ? text.substr(0, letters - 1) + "." : text;
  };
  for (size_t c = 0; c < columns.size(); ++c)
    drawing.Text(left + width * (static_cast<double>(c) + 0.5), kTop - 7, fits(columns[c]), 0, 12, kInk, true);
  for (size_t r = 0; r < rows.size(); ++r) {
    const double y = kTop + kRow * static_cast<double>(r);
    drawing.Text(left - 8, y + 18, rows[r], 1, 13, kInk, true);
    for (size_t c = 0; c < columns.size(); ++c) {
      const MatrixCell& cell = cells[r][c];
      const double x = left + width * static_cast<double>(c);
      const size_t k = cell.value ? step(*cell.value) : 0;
      drawing.Rectangle(x + 1, y + 1, width - 2, kRow - 2, cell.value ? kSteps[k] : "#eef1f4");
      drawing.Text(x + width / 2, y + 18, cell.value ? fmt::format("{:.2f}", *cell.value) : cell.text, 0, 13,
                   cell.value ? kWords[k] : "#4a545d");
    }
  }
  double x = left;
  for (size_t k = 0; k <= limits.size() && k < kSteps.size(); ++k) {
    const std::string name = k < limits.size() ? fmt::format("to {:g}", limits[k]) : fmt::format("more ({})", unit);
    drawing.Rectangle(x, drawing.height - 18, 14, 14, kSteps[k]);
    drawing.Text(x + 18, drawing.height - 6, name, -1, 11, kInk);
    x += 30 + TextWidth(name, 11);
  }
  return drawing;
}

Drawing BarChart(const std::vector<std::pair<std::string, double>>& rows, const std::string& axis, int decimals) {
  Drawing drawing;
  const double row = 24;
  drawing.height = 34 + row * static_cast<double>(rows.size());
  double longest = 0, most = 0;
  for (const auto& [name, value] : rows) {
    longest = std::max(longest, TextWidth(name, 12));
    most = std::max(most, value);
  }
  const double left = std::min(300.0, longest + 16), right = drawing.width - 80;
  for (size_t i = 0; i < rows.size(); ++i) {
    const double y = 6 + row * static_cast<double>(i);
    const double w = most > 0 ? (right - left) * rows[i].second / most : 0;
    drawing.Text(left - 8, y + 15, rows[i].first, 1);
    drawing.Rectangle(left, y + 3, std::max(1.0, w), row - 8, ColourOf(0), 0.85);
    drawing.Text(left + w + 6, y + 15, fmt::format("{:.{}f}", rows[i].second, decimals), -1);
  }
  drawing.Text(0.5 * (left + right), drawing.height - 8, axis);
  return drawing;
}

}  // namespace trigpoint
