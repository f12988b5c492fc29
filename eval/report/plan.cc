#include "eval/report/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

namespace trigpoint {
namespace {

constexpr double kWidth = 760, kMost = 620, kLeft = 52, kRight = 12, kTop = 12, kBottom = 40;
// Okabe and Ito's colours that are dark enough for lines on a light picture.
constexpr const char* kRunColours[] = {"#0072b2", "#a8420a", "#00694d", "#8c3a6e", "#5a4a00", "#1d2329"};
constexpr const char* kVector = "#000000";
constexpr const char* kEllipse = "#6a1b9a";
constexpr const char* kInk = "#1d2329";
constexpr size_t kPathPoints = 400;

class PlanPainter {
 public:
  explicit PlanPainter(const SceneModel& scene) : scene_(scene) {}

  Plan Draw() {
    Frame();
    if (scene_.aerial) Aerial();
    Grid();
    Paths();
    Errors();
    Panoramas();
    Legend();
    std::string caption = "Plan, " + std::string(scene_.on_earth ? "north up; east and north in " : "x and y in ") +
                          scene_.frame + " (m).";
    if (!scene_.errors.empty()) {
      caption += fmt::format(
          " Arrows: from the reference to the answer, horizontally, {:g} times enlarged; dashed ellipses: 95 % of the "
          "difference at the same enlargement.",
          enlarged_);
    }
    return {std::move(drawing_), caption};
  }

 private:
  double X(double east) const { return kLeft + (east - low_.x()) * scale_; }
  double Y(double north) const { return kTop + (high_.y() - north) * scale_; }

  void Frame() {
    const auto [low, high] = scene_.Bounds();
    const double margin = std::max(2.0, 0.08 * (high - low).head<2>().maxCoeff());
    low_ = low.head<2>().array() - margin;
    high_ = high.head<2>().array() + margin;
    const double room = kWidth - kLeft - kRight;
    scale_ = std::min(room / (high_.x() - low_.x()), kMost / (high_.y() - low_.y()));
    const double wider = 0.5 * (room / scale_ - (high_.x() - low_.x()));  // the width is used in full
    low_.x() -= wider, high_.x() += wider;
    drawing_.width = kWidth;
    drawing_.height = kTop + scale_ * (high_.y() - low_.y()) + kBottom + 20;
    std::vector<double> lengths;
    for (const SceneError& e : scene_.errors) lengths.push_back(e.difference.head<2>().norm());
    if (lengths.empty()) return;
    std::sort(lengths.begin(), lengths.end());
    const double typical = std::max(1e-4, lengths[lengths.size() / 2]);
    enlarged_ = std::max(1.0, RoundDown(std::max(1.0, 34 / scale_ / typical)));
  }

  // Bright, so that lines and words stand out.
  void Aerial() {
    const SceneAerial& a = *scene_.aerial;
    const double w = X(high_.x()) - kLeft, h = Y(low_.y()) - kTop;
    constexpr double kDetail = 1.5;  // pixels a unit
    const auto at = [&](int r, int c) {
      const Eigen::Vector3d& p = a.vertices[static_cast<size_t>(r * a.columns + c)];
      return cv::Point2f(static_cast<float>(kDetail * (X(p.x()) - kLeft)),
                         static_cast<float>(kDetail * (Y(p.y()) - kTop)));
    };
    const auto cols = static_cast<float>(a.picture.cols), rows = static_cast<float>(a.picture.rows);
    const cv::Point2f from[] = {{0, 0}, {cols, 0}, {cols, rows}, {0, rows}};
    const cv::Point2f to[] = {at(0, 0), at(0, a.columns - 1), at(a.rows - 1, a.columns - 1), at(a.rows - 1, 0)};
    cv::Mat plan;
    cv::warpPerspective(a.picture, plan, cv::getPerspectiveTransform(from, to),
                        {static_cast<int>(kDetail * w), static_cast<int>(kDetail * h)}, cv::INTER_AREA,
                        cv::BORDER_CONSTANT, {255, 255, 255});
    plan.convertTo(plan, -1, 0.38, 0.62 * 255);
    std::vector<uchar> bytes;
    cv::imencode(".jpg", plan, bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
    drawing_.Photograph(kLeft, kTop, w, h, std::string(bytes.begin(), bytes.end()));
  }

  void Grid() {
    const double step = RoundDown((high_.x() - low_.x()) / 4);
    const double right = X(high_.x()), bottom = Y(low_.y());
    for (double e = std::ceil(low_.x() / step) * step; e < high_.x(); e += step) {
      drawing_.Line({{X(e), kTop}, {X(e), bottom}}, "#8a949d", 0.6);
      drawing_.Text(X(e), bottom + 16, fmt::format("{:g}", std::abs(e) < 1e-9 ? 0 : e), 0, 12, kInk);
    }
    for (double n = std::ceil(low_.y() / step) * step; n < high_.y(); n += step) {
      drawing_.Line({{kLeft, Y(n)}, {right, Y(n)}}, "#8a949d", 0.6);
      drawing_.Text(kLeft - 6, Y(n) + 4, fmt::format("{:g}", std::abs(n) < 1e-9 ? 0 : n), 1, 12, kInk);
    }
    drawing_.Line({{kLeft, kTop}, {right, kTop}, {right, bottom}, {kLeft, bottom}, {kLeft, kTop}}, kInk, 1);
    drawing_.Text(0.5 * (kLeft + right), bottom + 33, scene_.on_earth ? "east (m)" : "x (m)", 0, 12, kInk);
    drawing_.Text(14, 0.5 * (kTop + bottom), scene_.on_earth ? "north (m)" : "y (m)", 0, 12, kInk, false, true);
  }

  const char* ColourOf(const std::string& run) const {
    const auto it = std::find(scene_.runs.begin(), scene_.runs.end(), run);
    return kRunColours[static_cast<size_t>(it - scene_.runs.begin()) % std::size(kRunColours)];
  }

  void Paths() {
    for (const ScenePath& path : scene_.paths) {
      if (path.kind != ScenePath::Kind::kOptimised) continue;
      std::vector<std::pair<double, double>> line;
      const size_t step = path.poses.size() / kPathPoints + 1;
      for (size_t i = 0; i < path.poses.size(); i += step) {
        const Eigen::Vector3d& p = path.poses[i].target_from_body.translation;
        line.emplace_back(X(p.x()), Y(p.y()));
      }
      if (line.empty()) continue;
      drawing_.Line(line, "#ffffff", 5);
      drawing_.Line(line, ColourOf(path.run), 2.5);
      lines_.push_back(std::move(line));
    }
  }

  void Errors() {
    for (const SceneError& e : scene_.errors) {
      const double x = X(e.reference_position.x()), y = Y(e.reference_position.y());
      const double dx = scale_ * enlarged_ * e.difference.x(), dy = -scale_ * enlarged_ * e.difference.y();
      if (e.sigma_m) {
        std::vector<std::pair<double, double>> ellipse;
        for (int k = 0; k <= 40; ++k) {
          const double a = 2 * M_PI * k / 40, size = scale_ * enlarged_ * kSigmas95;
          ellipse.emplace_back(x + dx + size * e.sigma_m->x() * std::cos(a),
                               y + dy + size * e.sigma_m->y() * std::sin(a));
        }
        drawing_.Line(ellipse, "#ffffff", 3);
        drawing_.Line(ellipse, kEllipse, 1.4, true);
      }
      drawing_.Line({{x, y}, {x + dx, y + dy}}, "#ffffff", 4);
      drawing_.Line({{x, y}, {x + dx, y + dy}}, kVector, 1.8);
      lines_.push_back({{x, y}, {x + dx, y + dy}});
      const double length = std::hypot(dx, dy);
      if (length < 4) continue;
      const double ux = dx / length, uy = dy / length, head = std::min(8.0, 0.5 * length);
      const double bx = x + dx - head * ux, by = y + dy - head * uy;
      drawing_.Area({{x + dx, y + dy},
                     {bx - 0.4 * head * uy, by + 0.4 * head * ux},
                     {bx + 0.4 * head * uy, by - 0.4 * head * ux}},
                    kVector);
    }
  }

  void Panoramas() {
    std::map<std::string, std::pair<Eigen::Vector2d, int>> stations;
    std::set<std::string> alone;
    for (const ScenePanorama& p : scene_.panoramas) {
      auto& [sum, count] =
          stations.try_emplace(p.station.empty() ? p.panorama : p.station, Eigen::Vector2d::Zero(), 0).first->second;
      if (p.station.empty()) alone.insert(p.panorama);
      sum += p.world_from_pano.translation.head<2>();
      ++count;
    }
    std::vector<std::pair<double, double>> dots;
    for (const auto& [name, place] : stations) {
      const Eigen::Vector2d p = place.first / place.second;
      dots.emplace_back(X(p.x()), Y(p.y()));
      const bool station = alone.count(name) == 0;
      drawing_.spots.push_back({dots.back().first, dots.back().second, (station ? "station:" : "panorama:") + name});
      drawing_.Circle(dots.back().first, dots.back().second, 6, "#ffffff");
      drawing_.Circle(dots.back().first, dots.back().second, 4.2, kInk);
    }
    LabelPlaces places({kLeft, kTop, X(high_.x()) - kLeft, Y(low_.y()) - kTop});
    constexpr double kDot = 7, kSize = 12;
    std::vector<DrawnBox> marks;
    for (const auto& [x, y] : dots) marks.push_back({x - kDot, y - kDot, 2 * kDot, 2 * kDot});
    for (const DrawnBox& mark : marks) places.Take(mark);
    for (const auto& line : lines_) places.AvoidLine(line);
    size_t i = 0;
    for (const auto& [name, place] : stations) {
      const auto box = places.Place(marks[i++], TextWidth(name, kSize) + 6, kSize + 5);
      if (!box) continue;
      drawing_.Rectangle(box->x, box->y, box->width, box->height, "#ffffff", 0.88);
      drawing_.Text(box->x + box->width / 2, box->y + box->height - 4.5, name, 0, kSize, kInk, true);
    }
  }

  void Legend() {
    double x = kLeft;
    const double y = drawing_.height - 6;
    const auto entry = [&](const std::string& name, const char* colour, double width, bool dashed) {
      const double room = 30 + TextWidth(name, 12) + 14;
      if (x + room > kWidth) return;
      drawing_.Line({{x, y - 4}, {x + 24, y - 4}}, colour, width, dashed);
      drawing_.Text(x + 29, y, name, -1, 12, kInk);
      x += room;
    };
    for (const std::string& run : scene_.runs) entry(run, ColourOf(run), 3, false);
    if (scene_.errors.empty()) return;
    entry(fmt::format("difference x {:g}", enlarged_), kVector, 1.8, false);
    entry("95 % of it", kEllipse, 1.4, true);
  }

  const SceneModel& scene_;
  Drawing drawing_;
  std::vector<std::vector<std::pair<double, double>>> lines_;  // that names keep clear of
  Eigen::Vector2d low_, high_;
  double scale_ = 1, enlarged_ = 1;
};

}  // namespace

double RoundDown(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (double factor : {5.0, 2.0}) {
    if (factor * decade <= value) return factor * decade;
  }
  return decade;
}

Plan PlanOf(const SceneModel& scene) { return PlanPainter(scene).Draw(); }

}  // namespace trigpoint
