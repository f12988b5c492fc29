#include "calib/target/plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "calib/base/grid.h"

namespace trigpoint {
namespace {

const cv::Scalar kWhite(255, 255, 255), kBlack(0, 0, 0), kGrey(150, 150, 150), kPale(225, 225, 225), kBlue(180, 90, 20),
    kRed(40, 40, 200);
constexpr int kMargin = 50;  // px around a plot

void Text(cv::Mat& picture, const std::string& text, cv::Point at, double size = 0.5,
          const cv::Scalar& colour = kBlack) {
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

// A drawing area with the picture's proportions, `width` px wide.
struct Canvas {
  cv::Mat picture;
  cv::Rect area;
  double scale = 1;
  Canvas(int width, int image_width, int image_height, const std::string& title, int right = kMargin) {
    scale = static_cast<double>(width) / image_width;
    area = {kMargin, kMargin, width, static_cast<int>(std::lround(image_height * scale))};
    picture = cv::Mat(area.height + 2 * kMargin, width + kMargin + right, CV_8UC3, kWhite);
    Text(picture, title, {kMargin, kMargin - 16}, 0.55);
    cv::rectangle(picture, area, kGrey);
  }
  cv::Point2d At(const Eigen::Vector2d& pixel) const {
    return {area.x + (pixel.x() + 0.5) * scale, area.y + (pixel.y() + 0.5) * scale};
  }
};

cv::Vec3b Colour(double share) {
  static const cv::Mat kMap = [] {
    cv::Mat ramp(256, 1, CV_8U), map;
    for (int i = 0; i < 256; ++i) ramp.at<uchar>(i) = static_cast<uchar>(i);
    cv::applyColorMap(ramp, map, cv::COLORMAP_VIRIDIS);
    return map;
  }();
  return kMap.at<cv::Vec3b>(std::clamp(static_cast<int>(std::lround(255 * share)), 0, 255));
}

void Arrow(cv::Mat& picture, cv::Point2d from, const Eigen::Vector2d& by, const cv::Scalar& colour) {
  const cv::Point2d to(from.x + by.x(), from.y + by.y());
  cv::arrowedLine(picture, from, to, colour, 1, cv::LINE_AA, 0, 0.25);
}

// A plot with axes from (0, low) to (right, high).
struct Axes {
  cv::Mat& picture;
  cv::Rect area;
  double left, right, low, high;
  cv::Point At(double x, double y) const {
    return {area.x + static_cast<int>(std::lround((x - left) / (right - left) * area.width)),
            area.y + area.height - static_cast<int>(std::lround((y - low) / (high - low) * area.height))};
  }
  void Draw(const std::string& title, const std::string& x_label) const {
    cv::rectangle(picture, area, kGrey);
    Text(picture, title, {area.x, area.y - 16}, 0.55);
    Text(picture, x_label, {area.x + area.width / 2 - 40, area.y + area.height + 38}, 0.45);
    for (int i = 0; i <= 4; ++i) {
      const double x = left + (right - left) * i / 4;
      Text(picture, fmt::format("{:.3g}", x), {At(x, low).x - 10, area.y + area.height + 18}, 0.4);
    }
  }
};

// How residuals are distributed, as shares of their sigma.
class ResidualHistogram {
 public:
  void Add(double sigmas) {
    const int bin = static_cast<int>(std::floor((sigmas + 5) / 10 * kBins));
    if (bin >= 0 && bin < kBins) counts_[static_cast<size_t>(bin)] += 1;
    all_ += 1;
  }
  void Draw(const Axes& axes) const {
    for (int bin = 0; bin < kBins && all_ > 0; ++bin) {
      const double density = counts_[static_cast<size_t>(bin)] / all_ * kBins / 10;
      const double x = -5 + 10.0 * bin / kBins;
      cv::rectangle(axes.picture, axes.At(x, 0), axes.At(x + 10.0 / kBins, std::min(density, 0.5)),
                    cv::Scalar(220, 180, 140), cv::FILLED);
    }
    for (double x = -5; x < 5; x += 0.1) {
      const auto normal = [](double v) { return std::exp(-0.5 * v * v) / std::sqrt(2 * std::numbers::pi); };
      cv::line(axes.picture, axes.At(x, normal(x)), axes.At(x + 0.1, normal(x + 0.1)), kRed, 1, cv::LINE_AA);
    }
    axes.Draw("one coordinate / sigma, against the normal distribution", "sigma");
  }

 private:
  static constexpr int kBins = 40;
  std::vector<double> counts_ = std::vector<double>(kBins, 0);
  double all_ = 0;
};

}  // namespace

cv::Mat DrawMap(const ImageGrid& grid, const std::vector<double>& values, const std::vector<bool>& covered, int width,
                int height, const std::string& title, const std::string& unit) {
  constexpr int kWidth = 900, kScale = 130;
  Canvas canvas(kWidth, width, height, title, kScale);
  // The scale ends at the largest value where the board was seen: beyond it the map is all bright.
  double most = 0, any = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    any = std::max(any, values[i]);
    if (covered[i]) most = std::max(most, values[i]);
  }
  most = std::max(most > 0 ? std::min(any, 2 * most) : any, 1e-9);
  const auto value = [&](double x, double y) {
    const double gx = std::clamp(x * (grid.cols - 1), 0.0, grid.cols - 1.001);
    const double gy = std::clamp(y * (grid.rows - 1), 0.0, grid.rows - 1.001);
    const auto c = static_cast<size_t>(gx), r = static_cast<size_t>(gy), w = static_cast<size_t>(grid.cols);
    const double fx = gx - static_cast<double>(c), fy = gy - static_cast<double>(r);
    return (1 - fy) * ((1 - fx) * values[r * w + c] + fx * values[r * w + c + 1]) +
           fy * ((1 - fx) * values[(r + 1) * w + c] + fx * values[(r + 1) * w + c + 1]);
  };
  for (int y = 0; y < canvas.area.height; ++y) {
    for (int x = 0; x < canvas.area.width; ++x) {
      const double v = value((x + 0.5) / canvas.area.width, (y + 0.5) / canvas.area.height);
      canvas.picture.at<cv::Vec3b>(canvas.area.y + y, canvas.area.x + x) =
          std::isfinite(v) ? Colour(v / most) : cv::Vec3b(128, 128, 128);
    }
  }
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      const double x = 0.08 + 0.42 * c, y = 0.08 + 0.42 * r, v = value(x, y);
      const std::string text = std::isfinite(v) ? fmt::format("{:.3g}", v) : "no ray";
      const cv::Point at(canvas.area.x + static_cast<int>(x * canvas.area.width) - 20,
                         canvas.area.y + static_cast<int>(y * canvas.area.height) + 6);
      Text(canvas.picture, text, at + cv::Point(1, 1), 0.55, kBlack);
      Text(canvas.picture, text, at, 0.55, kWhite);
    }
  }
  // Not seen: hatched.
  for (size_t i = 0; i < covered.size(); ++i) {
    if (covered[i]) continue;
    const cv::Point2d at = canvas.At(grid.pixels[i]);
    cv::line(canvas.picture, at + cv::Point2d(-4, 4), at + cv::Point2d(4, -4), kWhite, 1, cv::LINE_AA);
  }
  const int left = canvas.area.x + canvas.area.width + 20;
  for (int y = 0; y < canvas.area.height; ++y) {
    const cv::Vec3b colour = Colour(1 - static_cast<double>(y) / canvas.area.height);
    cv::line(canvas.picture, {left, canvas.area.y + y}, {left + 20, canvas.area.y + y}, cv::Scalar(colour));
  }
  for (int i = 0; i <= 4; ++i) {
    Text(canvas.picture, fmt::format("{:.3g} {}", most * i / 4, unit),
         {left + 26, canvas.area.y + canvas.area.height - canvas.area.height * i / 4 + 5}, 0.45);
  }
  Text(canvas.picture, "hatched: the board was not seen there", {kMargin, canvas.picture.rows - 18}, 0.45);
  return canvas.picture;
}

cv::Mat DrawCoverage(const CalibrationInput& input, const Calibration& calibration, const Coverage& coverage,
                     int camera) {
  const auto& size = input.cameras[static_cast<size_t>(camera)];
  constexpr int kWidth = 900;
  Canvas canvas(kWidth, size.width, size.height,
                fmt::format("{}: where the board was seen, {:.0f} % of the picture", size.name, 100 * coverage.share));
  for (int r = 0; r < coverage.rows; ++r) {
    for (int c = 0; c < coverage.cols; ++c) {
      const cv::Point2d from = canvas.At({static_cast<double>(c) * size.width / coverage.cols - 0.5,
                                          static_cast<double>(r) * size.height / coverage.rows - 0.5});
      const cv::Point2d to =
          canvas.At({(c + 1.0) * size.width / coverage.cols - 0.5, (r + 1.0) * size.height / coverage.rows - 0.5});
      const Eigen::Vector2d middle((c + 0.5) * size.width / coverage.cols - 0.5,
                                   (r + 0.5) * size.height / coverage.rows - 0.5);
      const bool seen = IsCovered(coverage, size.width, size.height, middle);
      cv::rectangle(canvas.picture, from, to, seen ? kWhite : cv::Scalar(200, 200, 255), cv::FILLED);
      cv::rectangle(canvas.picture, from, to, kPale);
      const int points = coverage.points[CellIndex(r, c, coverage.cols)];
      Text(canvas.picture, std::to_string(points), cv::Point(from) + cv::Point(4, 14), 0.4, kGrey);
    }
  }
  for (const PointResidual& residual : calibration.residuals) {
    if (input.views[static_cast<size_t>(residual.view)].camera != camera) continue;
    cv::circle(canvas.picture, canvas.At(residual.pixel), 2, residual.used ? kBlue : kRed, cv::FILLED, cv::LINE_AA);
  }
  Text(canvas.picture, "blue: used, red: left out; numbers: points in the cell; pink: empty",
       {kMargin, canvas.picture.rows - 18}, 0.45);
  return canvas.picture;
}

cv::Mat DrawResiduals(const CalibrationInput& input, const Calibration& calibration, const ResidualPattern& pattern,
                      int camera) {
  const auto& size = input.cameras[static_cast<size_t>(camera)];
  const CalibratedCamera& calibrated = calibration.cameras[static_cast<size_t>(camera)];
  constexpr int kWidth = 620;
  const double sigma = std::max(calibrated.sigma_px, 1e-6);
  const double stretch = 12 / sigma;  // drawn px per px
  Canvas arrows(kWidth, size.width, size.height,
                fmt::format("{}: residuals, arrows {:.0f} times (sigma {:.3f} px)", size.name,
                            stretch / (static_cast<double>(kWidth) / size.width), sigma));
  Canvas means(kWidth, size.width, size.height,
               fmt::format("mean over parts, arrows 4 times longer; systematic {:.3f} px", pattern.systematic_px));
  const int plot_height = 300;
  cv::Mat below(plot_height + 2 * kMargin, 2 * arrows.picture.cols, CV_8UC3, kWhite);
  const Eigen::Vector2d principal(calibrated.camera.params()[2], calibrated.camera.params()[3]);
  const double reach = std::hypot(size.width, size.height) * 0.55;
  Axes radial{below, {arrows.picture.cols + kMargin, kMargin, kWidth, plot_height}, 0, reach, -5 * sigma, 5 * sigma};
  cv::line(below, radial.At(0, 0), radial.At(reach, 0), kGrey);

  ResidualHistogram histogram;
  for (const PointResidual& r : calibration.residuals) {
    if (input.views[static_cast<size_t>(r.view)].camera != camera || !r.residual.allFinite()) continue;
    if (!r.used) {
      cv::circle(arrows.picture, arrows.At(r.pixel), 2, kRed, cv::FILLED, cv::LINE_AA);
      continue;
    }
    Arrow(arrows.picture, arrows.At(r.pixel), stretch * r.residual, kBlue);
    for (double d : {r.residual.x(), r.residual.y()}) histogram.Add(d / sigma);
    const Eigen::Vector2d out = r.pixel - principal;
    if (out.norm() > 1 && std::abs(out.normalized().dot(r.residual)) < 5 * sigma)
      cv::circle(below, radial.At(out.norm(), out.normalized().dot(r.residual)), 1, kBlue, cv::FILLED);
  }
  histogram.Draw({below, {kMargin, kMargin, kWidth, plot_height}, -5, 5, 0, 0.5});
  radial.Draw(fmt::format("radial part, from -{:.2g} to {:.2g} px", 5 * sigma, 5 * sigma),
              "distance from the principal point, px");
  for (size_t part = 0; part < pattern.mean_px.size(); ++part) {
    if (!pattern.mean_px[part].allFinite()) continue;
    const auto columns = static_cast<size_t>(pattern.cols);
    const size_t row = part / columns, col = part % columns;
    const Eigen::Vector2d middle((static_cast<double>(col) + 0.5) * size.width / pattern.cols - 0.5,
                                 (static_cast<double>(row) + 0.5) * size.height / pattern.rows - 0.5);
    Arrow(means.picture, means.At(middle), 4 * stretch * pattern.mean_px[part], kBlue);
  }
  cv::Mat above, whole;
  cv::hconcat(arrows.picture, means.picture, above);
  cv::vconcat(above, below, whole);
  return whole;
}

}  // namespace trigpoint
