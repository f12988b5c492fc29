// The report's charts. Colours are Okabe and Ito's, which colour-blind readers tell apart; series differ in mark too.
// Values are drawn as given: convert lengths to the wanted unit first and name it in the axis.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "eval/report/drawing.h"

namespace trigpoint {

constexpr double kHalfWidth = 470;  // of a chart that stands beside another one (Figure::half)

struct CurvePoint {
  double x = 0, y = 0;
  std::optional<double> low, high;  // of y
  std::string object;               // that it is of, see Spot; may be empty
};
struct Series {
  std::string name;
  std::vector<CurvePoint> points;
};

// Cumulative histograms: steps, x logarithmic, y a share (0 to 1). The first series' band is drawn.
Drawing CumulativeChart(const std::vector<Series>& series, const std::string& x_axis, const std::string& y_axis,
                        double width = Drawing().width);

// Lines through points, both axes linear from 0; `diagonal`: both are shares, and y = x is drawn.
Drawing LineChart(const std::vector<Series>& series, const std::string& x_axis, const std::string& y_axis,
                  bool diagonal, double width = Drawing().width);

// A column a category, a dot a value of each series in it; y logarithmic. Values that are not positive are left out.
struct DotSeries {
  std::string name;
  std::vector<std::pair<int, double>> dots;  // (category, value)
};
// A category is an object of a kind: "station" makes S57 the object station:S57.
Drawing DotChart(const std::vector<std::string>& categories, const std::vector<DotSeries>& series,
                 const std::string& y_axis, const std::string& kind = "station");

// Shares of values in equal bins from 0 to `limit`, an outline a series; larger values count in the last bin. A bin's
// objects are the group of its bar, the largest value first; where they are few each also has a spot on the axis.
struct Sample {
  std::string name;
  std::vector<double> values;
  std::vector<std::string> objects;  // that the values are of, see Spot; may be empty
};
Drawing HistogramChart(const std::vector<Sample>& samples, int bins, double limit, const std::string& x_axis,
                       const Series* expected = nullptr, double width = Drawing().width);

// A cell a row and column, its number on a colour of five steps; light is small. Cells without a number show their
// text.
struct MatrixCell {
  std::optional<double> value;
  std::string text;  // where there is no value
};
Drawing MatrixChart(const std::vector<std::string>& rows, const std::vector<std::string>& columns,
                    const std::vector<std::vector<MatrixCell>>& cells, const std::vector<double>& limits,
                    const std::string& unit);

// A horizontal bar a row, with its number behind it.
Drawing BarChart(const std::vector<std::pair<std::string, double>>& rows, const std::string& axis, int decimals);

}  // namespace trigpoint
