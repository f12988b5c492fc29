#include "eval/exchange/crosscheck_figures.h"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "eval/report/plan.h"

namespace trigpoint {
namespace {

const cv::Scalar kColours[] = {{180, 119, 31}, {14, 127, 255}, {44, 160, 44}, {40, 39, 214}, {189, 103, 148}};
const cv::Scalar kGrey(150, 150, 150), kBlack(30, 30, 30);
constexpr int kWidth = 1200, kHeight = 800, kMargin = 80;

void Write(const cv::Mat& picture, const std::string& text, double x, double y, const cv::Scalar& colour = kBlack,
           double size = 0.5) {
  cv::putText(picture, text, {static_cast<int>(x), static_cast<int>(y)}, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1,
              cv::LINE_AA);
}

void Save(const std::filesystem::path& file, const cv::Mat& picture) {
  if (!cv::imwrite(file.string(), picture)) throw IoError(file.string() + ": cannot be written; is the disk full?");
}

void Legend(const cv::Mat& picture, const std::vector<CrossFigure>& figures) {
  for (size_t i = 0; i < figures.size(); ++i) {
    const double y = 30 + 20 * static_cast<double>(i);
    cv::line(picture, {kWidth - 260, static_cast<int>(y) - 5}, {kWidth - 230, static_cast<int>(y) - 5},
             kColours[i % std::size(kColours)], 2, cv::LINE_AA);
    Write(picture, figures[i].system, kWidth - 220, y);
  }
}

cv::Mat PlanOf(const std::string& run, const std::vector<CrossFigure>& figures) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(INFINITY), high = -low;
  double longest = 1e-9;
  for (const CrossFigure& figure : figures) {
    for (size_t i = 0; i < figure.places.size(); ++i) {
      low = low.cwiseMin(figure.places[i].head<2>());
      high = high.cwiseMax(figure.places[i].head<2>());
      longest = std::max(longest, figure.differences[i].head<2>().norm());
    }
  }
  const Eigen::Vector2d extent = (high - low).cwiseMax(1e-3);
  const double scale = std::min((kWidth - 2 * kMargin) / extent.x(), (kHeight - 2 * kMargin) / extent.y());
  const double larger = RoundDown(0.08 * extent.maxCoeff() / longest);
  const auto at = [&](const Eigen::Vector2d& p) {
    return cv::Point(static_cast<int>(std::lround(kMargin + scale * (p.x() - low.x()))),
                     static_cast<int>(std::lround(kHeight - kMargin - scale * (p.y() - low.y()))));
  };
  cv::Mat plan(kHeight, kWidth, CV_8UC3, cv::Scalar::all(255));
  for (size_t f = 0; f < figures.size(); ++f) {
    for (size_t i = 0; i < figures[f].places.size(); ++i) {
      const Eigen::Vector2d place = figures[f].places[i].head<2>();
      cv::circle(plan, at(place), 2, kGrey, cv::FILLED, cv::LINE_AA);
      cv::line(plan, at(place), at(place + larger * figures[f].differences[i].head<2>()),
               kColours[f % std::size(kColours)], 1, cv::LINE_AA);
    }
  }
  const double bar = RoundDown(0.2 * extent.maxCoeff());
  const int y = kHeight - 30, end = kMargin + static_cast<int>(std::lround(scale * bar));
  cv::line(plan, {kMargin, y}, {end, y}, kBlack, 2, cv::LINE_AA);
  Write(plan, fmt::format("{:g} m; differences drawn {:g} times larger (the bar: {:.3g} m)", bar, larger, bar / larger),
        end + 12, y + 5);
  Write(plan, "Cross-check of " + run + " from above: theirs minus ours after Sim3", kMargin, 30, kBlack, 0.6);
  Legend(plan, figures);
  return plan;
}

// Along the run.
cv::Mat NormalisedOf(const std::string& run, const std::vector<CrossFigure>& figures) {
  double highest = 4;
  size_t most = 2;
  for (const CrossFigure& figure : figures) {
    for (size_t i = 0; i < figure.places.size(); ++i) {
      if (std::isfinite(figure.normalised[i])) highest = std::max(highest, figure.normalised[i]);
    }
    most = std::max(most, figure.places.size());
  }
  cv::Mat chart(kHeight, kWidth, CV_8UC3, cv::Scalar::all(255));
  const double top = std::log10(highest * 1.2), bottom = -1.5;
  const auto point = [&](double x, double value) {
    const double share = (std::log10(std::max(value, 0.0317)) - bottom) / (top - bottom);
    return cv::Point(static_cast<int>(std::lround(kMargin + x * (kWidth - 2 * kMargin))),
                     static_cast<int>(std::lround(kHeight - kMargin - share * (kHeight - 2 * kMargin))));
  };
  for (double value = 0.1; value < highest * 1.2; value *= 10) {
    cv::line(chart, point(0, value), point(1, value), {225, 225, 225}, 1);
    Write(chart, fmt::format("{:g}", value), 30, point(0, value).y + 5);
  }
  const double limit = std::sqrt(11.345 / 3);
  cv::line(chart, point(0, limit), point(1, limit), kBlack, 1, cv::LINE_AA);
  Write(chart, "99 %", kWidth - kMargin + 8, point(1, limit).y + 5);
  for (size_t f = 0; f < figures.size(); ++f) {
    for (size_t i = 0; i < figures[f].places.size(); ++i) {
      if (!std::isfinite(figures[f].normalised[i])) continue;
      const double x = static_cast<double>(i) / static_cast<double>(most - 1);
      cv::circle(chart, point(x, figures[f].normalised[i]), 3, kColours[f % std::size(kColours)], 1, cv::LINE_AA);
    }
  }
  Write(chart, "Cross-check of " + run + ": differences after Sim3 in units of our own sigma", kMargin, 30, kBlack,
        0.6);
  Write(chart, "image, in the order of the run", kWidth / 2.0 - 120, kHeight - 30);
  Legend(chart, figures);
  return chart;
}

}  // namespace

void WriteCrossFigures(const std::filesystem::path& dir, const std::string& run,
                       const std::vector<CrossFigure>& figures) {
  Save(dir / (run + "_plan.png"), PlanOf(run, figures));
  Save(dir / (run + "_normalised.png"), NormalisedOf(run, figures));
}

}  // namespace trigpoint
