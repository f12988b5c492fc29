#include "eval/report/survey_plan.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace trigpoint {
namespace {

class SurveyPainter {
 public:
  SurveyPainter(const std::vector<SurveyPlanPoint>& points, const std::vector<Eigen::Vector2d>& tags,
                const std::string& unit, double metres)
      : points_(points), tags_(tags), unit_(unit), metres_(metres) {}

  Plan Draw() {
    Frame();
    Grid();
    for (const Eigen::Vector2d& tag : tags_) drawing_.Circle(X(tag.x()), Y(tag.y()), 2.5, kFaint);
    for (size_t i = 0; i < points_.size(); ++i) {
      if (MostEnlarged(marks_[i], low_, high_) >= enlarged_) Ellipse(points_[i]);
    }
    for (const SurveyPlanPoint& p : points_) Arrow(p);
    for (const SurveyPlanPoint& p : points_) Mark(p);
    Legend();
    return {
        std::move(drawing_),
        fmt::format("Surveyed points from above, site coordinates in {}. Arrows: map minus stated, horizontally, {}; "
                    "dashed: the ellipse in which 95 % of such differences lie if all sigmas are "
                    "right, at the same scale. An arrow that leaves its ellipse is larger than stated sigmas "
                    "explain.",
                    unit_, EnlargedText(enlarged_))};
  }

 private:
  static constexpr double kWidth = 700, kMost = 560, kLeft = 58, kRight = 14, kTop = 14, kBottom = 64;
  static constexpr double kArrow = 46;  // px of a typical residual
  static constexpr const char* kControl = "#0072b2";
  static constexpr const char* kCheck = "#a8420a";
  static constexpr const char* kInk = "#1d2329";
  static constexpr const char* kFaint = "#8a949d";

  double X(double east) const { return kLeft + (east - low_.x()) * scale_; }
  double Y(double north) const { return kTop + (high_.y() - north) * scale_; }

  // The larger half axis of a point's ellipse, m.
  static double HalfAxis(const SurveyPlanPoint& p) {
    return kSigmas95 *
           std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(p.covariance_m2).eigenvalues()[1]));
  }

  void Frame() {
    low_ = high_ = points_.front().place_m;
    const auto take = [&](const Eigen::Vector2d& p) { low_ = low_.cwiseMin(p), high_ = high_.cwiseMax(p); };
    for (const SurveyPlanPoint& p : points_) take(p.place_m);
    for (const Eigen::Vector2d& tag : tags_) take(tag);
    const double margin = std::max(1.0, 0.12 * (high_ - low_).maxCoeff());
    low_.array() -= margin;
    high_.array() += margin;
    const double room = kWidth - kLeft - kRight;
    scale_ = std::min(room / (high_.x() - low_.x()), kMost / (high_.y() - low_.y()));
    const double wider = 0.5 * (room / scale_ - (high_.x() - low_.x()));  // the width is used in full
    low_.x() -= wider, high_.x() += wider;
    drawing_.width = kWidth;
    drawing_.height = kTop + scale_ * (high_.y() - low_.y()) + kBottom;
    for (const SurveyPlanPoint& p : points_) {
      // The ellipse lies around the point.
      const Eigen::Vector2d axes = kSigmas95 * p.covariance_m2.diagonal().cwiseMax(0).cwiseSqrt();
      marks_.push_back(
          {p.place_m, p.residual_m.cwiseMin(-axes), p.residual_m.cwiseMax(axes), p.residual_m.norm(), HalfAxis(p)});
    }
    enlarged_ = EnlargementOf(marks_, low_, high_, kArrow / scale_);
  }

  void Grid() {
    const double step = RoundDown((high_.x() - low_.x()) / metres_ / 4) * metres_;
    const double right = X(high_.x()), bottom = Y(low_.y());
    const auto text = [&](double v) { return fmt::format("{:g}", std::abs(v) < 1e-9 ? 0 : v / metres_); };
    for (double e = std::ceil(low_.x() / step) * step; e < high_.x(); e += step) {
      drawing_.Line({{X(e), kTop}, {X(e), bottom}}, "#d5dade", 0.6);
      drawing_.Text(X(e), bottom + 15, text(e), 0, 11, kInk);
    }
    for (double n = std::ceil(low_.y() / step) * step; n < high_.y(); n += step) {
      drawing_.Line({{kLeft, Y(n)}, {right, Y(n)}}, "#d5dade", 0.6);
      drawing_.Text(kLeft - 6, Y(n) + 4, text(n), 1, 11, kInk);
    }
    drawing_.Line({{kLeft, kTop}, {right, kTop}, {right, bottom}, {kLeft, bottom}, {kLeft, kTop}}, kInk, 1);
    drawing_.Text(0.5 * (kLeft + right), bottom + 31, "east (" + unit_ + ")", 0, 12, kInk);
    drawing_.Text(14, 0.5 * (kTop + bottom), "north (" + unit_ + ")", 0, 12, kInk, false, true);
  }

  void Ellipse(const SurveyPlanPoint& p) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(p.covariance_m2);
    const Eigen::Matrix2d axes = solver.eigenvectors() * solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
    std::vector<std::pair<double, double>> line;
    for (int k = 0; k <= 48; ++k) {
      const double a = 2 * M_PI * k / 48, size = scale_ * enlarged_ * kSigmas95;
      const Eigen::Vector2d v = size * axes * Eigen::Vector2d(std::cos(a), std::sin(a));
      line.emplace_back(X(p.place_m.x()) + v.x(), Y(p.place_m.y()) - v.y());
    }
    drawing_.Line(line, p.control ? kControl : kCheck, 1, true);
  }

  void Arrow(const SurveyPlanPoint& p) {
    const double x = X(p.place_m.x()), y = Y(p.place_m.y());
    // One that leaves the frame ends there, without a head.
    const Eigen::Vector2d d = p.residual_m;
    const double most = MostEnlarged({p.place_m, d.cwiseMin(0), d.cwiseMax(0), d.norm(), 0}, low_, high_);
    const double size = scale_ * std::min(enlarged_, most), dx = size * d.x(), dy = -size * d.y();
    const double length = std::hypot(dx, dy);
    drawing_.Line({{x, y}, {x + dx, y + dy}}, kInk, 1.8);
    if (length < 4 || most < enlarged_) return;
    const double ux = dx / length, uy = dy / length, head = std::min(8.0, 0.5 * length);
    const double bx = x + dx - head * ux, by = y + dy - head * uy;
    drawing_.Area(
        {{x + dx, y + dy}, {bx - 0.4 * head * uy, by + 0.4 * head * ux}, {bx + 0.4 * head * uy, by - 0.4 * head * ux}},
        kInk);
  }

  void Mark(const SurveyPlanPoint& p) {
    const double x = X(p.place_m.x()), y = Y(p.place_m.y());
    if (p.control) {
      drawing_.Area({{x, y - 6}, {x + 5.5, y + 4}, {x - 5.5, y + 4}}, kControl);
    } else {
      drawing_.Circle(x, y, 4.5, kCheck);
    }
    // On the side that the arrow leaves free.
    const bool below = p.residual_m.y() > 0;
    const double w = TextWidth(p.name, 11) + 4;
    drawing_.Rectangle(x - w / 2, below ? y + 7 : y - 21, w, 14, "#ffffff", 0.8);
    drawing_.Text(x, below ? y + 18 : y - 10, p.name, 0, 11, kInk, true);
  }

  void Legend() {
    const double y = drawing_.height - 10;
    double x = kLeft;
    const auto entry = [&](const std::string& name) {
      drawing_.Text(x + 12, y, name, -1, 12, kInk);
      x += TextWidth(name, 12) + 34;
    };
    drawing_.Area({{x, y - 10}, {x + 5.5, y}, {x - 5.5, y}}, kControl);
    entry("control");
    drawing_.Circle(x, y - 4, 4.5, kCheck);
    entry("check");
    if (!tags_.empty()) {
      drawing_.Circle(x, y - 4, 2.5, kFaint);
      entry("other tag");
    }
    // A bar of the enlarged scale.
    const double length = RoundDown(90 / (scale_ * enlarged_) / metres_) * metres_;
    drawing_.Line({{x, y - 4}, {x + scale_ * enlarged_ * length, y - 4}}, kInk, 2.5);
    drawing_.Text(x + scale_ * enlarged_ * length + 6, y, fmt::format("{:g} {} of a residual", length / metres_, unit_),
                  -1, 12, kInk);
  }

  const std::vector<SurveyPlanPoint>& points_;
  const std::vector<Eigen::Vector2d>& tags_;
  const std::string& unit_;
  const double metres_;
  Drawing drawing_;
  Eigen::Vector2d low_, high_;
  std::vector<EnlargedMark> marks_;  // of the points
  double scale_ = 1, enlarged_ = 1;
};

}  // namespace

Plan SurveyPlanOf(const std::vector<SurveyPlanPoint>& points, const std::vector<Eigen::Vector2d>& tags,
                  const std::string& unit, double metres_per_unit) {
  return SurveyPainter(points, tags, unit, metres_per_unit).Draw();
}

}  // namespace trigpoint
