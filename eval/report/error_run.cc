#include "eval/report/error_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "eval/report/plan.h"

namespace trigpoint {
namespace {

class ErrorPainter {
 public:
  ErrorPainter(const std::vector<ErrorAlong>& run, const std::string& unit, double metres)
      : run_(run), unit_(unit), metres_(metres) {
    drawing_.width = kWidth;
    drawing_.height = kTop + 3 * kPanel + 2 * kGap + kBottom;
    for (const ErrorAlong& e : run_) until_ = std::max(until_, e.time_s);
    std::vector<double> sizes;
    for (const ErrorAlong& e : run_) {
      if (e.error_m) sizes.push_back(e.error_m->cwiseAbs().maxCoeff());
      if (e.sigma_m) sizes.push_back(kSigmas * e.sigma_m->maxCoeff());
    }
    // One scale for all panels; single gross errors are cut off at the edge.
    std::sort(sizes.begin(), sizes.end());
    const double p99 = sizes[std::min(sizes.size() - 1, sizes.size() * 99 / 100)];
    most_ = 1.1 * std::max(1e-4, p99);
  }

  Drawing Draw() {
    static constexpr const char* kNames[] = {"east", "north", "up"};
    for (int k = 0; k < 3; ++k) {
      Band(k);
      Axes(k, kNames[k]);
      Lines(k);
    }
    const double bottom = Top(2) + kPanel;
    const double step = RoundDown(std::max(1e-3, until_ / 4));
    for (double t = 0; t <= until_ + 1e-9; t += step) {
      drawing_.Text(X(t), bottom + 15, fmt::format("{:g}", t), 0, 11, kInk);
    }
    drawing_.Text(0.5 * (kLeft + kWidth - kRight), bottom + 32, "time since the first image (s)", 0, 12, kInk);
    return std::move(drawing_);
  }

 private:
  static constexpr double kWidth = 720, kPanel = 118, kLeft = 64, kRight = 12, kTop = 12, kGap = 12, kBottom = 40;
  static constexpr double kSigmas = 2;
  static constexpr const char* kLine = "#0072b2";
  static constexpr const char* kInk = "#1d2329";

  double Top(int k) const { return kTop + k * (kPanel + kGap); }
  double X(double t) const { return kLeft + (kWidth - kLeft - kRight) * (until_ > 0 ? t / until_ : 0.5); }
  double Y(int k, double metres) const { return Top(k) + 0.5 * kPanel * (1 - std::clamp(metres / most_, -1.0, 1.0)); }

  // Runs of images for which `has` holds are drawn as one piece each.
  template <typename Has, typename Use>
  void Pieces(const Has& has, const Use& use) const {
    for (size_t begin = 0; begin < run_.size();) {
      size_t end = begin;
      while (end < run_.size() && has(run_[end])) ++end;
      if (end > begin) use(begin, end);
      begin = end + 1;
    }
  }

  void Band(int k) {
    Pieces([](const ErrorAlong& e) { return e.sigma_m.has_value(); },
           [&](size_t begin, size_t end) {
             std::vector<std::pair<double, double>> area;
             for (size_t i = begin; i < end; ++i)
               area.emplace_back(X(run_[i].time_s), Y(k, kSigmas * (*run_[i].sigma_m)[k]));
             for (size_t i = end; i-- > begin;)
               area.emplace_back(X(run_[i].time_s), Y(k, -kSigmas * (*run_[i].sigma_m)[k]));
             drawing_.Area(area, "#56b4e9", 0.3);
           });
  }

  void Axes(int k, const std::string& name) {
    const double right = kWidth - kRight, step = RoundDown(most_ / metres_ / 1.05) * metres_;
    for (const double m : {-step, 0.0, step}) {
      drawing_.Line({{kLeft, Y(k, m)}, {right, Y(k, m)}}, m == 0 ? "#8a949d" : "#d5dade", m == 0 ? 1 : 0.6);
      drawing_.Text(kLeft - 6, Y(k, m) + 4, fmt::format("{:g}", m / metres_), 1, 11, kInk);
    }
    drawing_.Line(
        {{kLeft, Top(k)}, {right, Top(k)}, {right, Top(k) + kPanel}, {kLeft, Top(k) + kPanel}, {kLeft, Top(k)}}, kInk,
        0.8);
    drawing_.Text(14, Top(k) + 0.5 * kPanel, name + " (" + unit_ + ")", 0, 12, kInk, false, true);
  }

  void Lines(int k) {
    Pieces([](const ErrorAlong& e) { return e.error_m.has_value(); },
           [&](size_t begin, size_t end) {
             std::vector<std::pair<double, double>> line;
             for (size_t i = begin; i < end; ++i) {
               const auto& [x, y] = line.emplace_back(X(run_[i].time_s), Y(k, (*run_[i].error_m)[k]));
               if (!run_[i].object.empty()) drawing_.spots.push_back({x, y, run_[i].object});
             }
             if (line.size() > 1) drawing_.Line(line, kLine, 1.4);
             if (line.size() == 1) drawing_.Circle(line[0].first, line[0].second, 1.5, kLine);
           });
  }

  const std::vector<ErrorAlong>& run_;
  const std::string& unit_;
  const double metres_;
  Drawing drawing_;
  double until_ = 0, most_ = 1;
};

}  // namespace

Drawing ErrorRunChart(const std::vector<ErrorAlong>& run, const std::string& unit, double metres_per_unit) {
  return ErrorPainter(run, unit, metres_per_unit).Draw();
}

}  // namespace trigpoint
