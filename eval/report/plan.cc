#include "eval/report/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "eval/scene/ground_picture.h"

namespace trigpoint {
namespace {

constexpr double kWidth = 760, kMost = 620, kLeft = 52, kRight = 12, kTop = 12, kBottom = 40;
// All at least 4.5 : 1 on white, and at least 27 apart (CIE 1976) from each other with normal and with protanopic,
// deuteranopic and tritanopic sight (Machado, Oliveira, Fernandes 2009). Further runs are dashed.
constexpr const char* kRunColours[] = {"#0072b2", "#a8420a", "#786060", "#4800a8"};
constexpr const char* kVector = "#000000";
constexpr const char* kEllipse = "#600060";
constexpr const char* kInk = "#1d2329";
constexpr size_t kPathPoints = 400;
constexpr double kArrow = 34;  // units, of a typical difference

class PlanPainter {
 public:
  PlanPainter(const SceneModel& scene, const DisplayUnit& unit) : scene_(scene), unit_(unit) {}

  Plan Draw() {
    Frame();
    if (scene_.aerial) Aerial();
    Grid();
    Paths();
    Errors();
    Panoramas();
    Legend();
    std::string caption = "Plan, " + std::string(scene_.on_earth ? "north up; east and north in " : "x and y in ") +
                          scene_.frame + " (" + unit_.name + ").";
    if (!scene_.errors.empty()) {
      caption += fmt::format(
          " Arrows: from the reference to the answer, horizontally, {}{}; dashed ellipses: 95 % of the difference at "
          "the same scale.",
          scene_.comparison.empty() ? "" : scene_.comparison + ", ", EnlargedText(enlarged_));
      if (cut_ > 0) {
        caption += fmt::format(" Without ellipse or head: {} that {} too far for this enlargement.",
                               Counted(cut_, "difference"), cut_ == 1 ? "reaches" : "reach");
      }
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
    Enlarge();
  }

  void Enlarge() {
    std::vector<EnlargedMark> marks;
    for (const SceneError& e : scene_.errors) marks.push_back(MarkOf(e));
    if (marks.empty()) return;
    enlarged_ = EnlargementOf(marks, low_, high_, kArrow / scale_);
  }

  // The ellipse lies around the arrow's end.
  static EnlargedMark MarkOf(const SceneError& e) {
    const Eigen::Vector2d difference = e.difference.head<2>();
    const Eigen::Vector2d axes =
        e.sigma_m ? Eigen::Vector2d(kSigmas95 * e.sigma_m->head<2>()) : Eigen::Vector2d(Eigen::Vector2d::Zero());
    return {e.reference_position.head<2>(), (difference - axes).cwiseMin(0), (difference + axes).cwiseMax(0),
            difference.norm(), axes.maxCoeff()};
  }

  void Aerial() {
    constexpr double kDetail = 1.5;  // pixels a unit
    drawing_.Photograph(kLeft, kTop, X(high_.x()) - kLeft, Y(low_.y()) - kTop,
                        GroundPicture(*scene_.aerial, low_, high_, kDetail * scale_));
  }

  void Grid() {
    const Eigen::Vector2d low = low_ / unit_.metres, high = high_ / unit_.metres;
    const double step = RoundDown((high.x() - low.x()) / 4);
    const double right = X(high_.x()), bottom = Y(low_.y());
    for (double e = std::ceil(low.x() / step) * step; e < high.x(); e += step) {
      const double x = X(e * unit_.metres);
      drawing_.Line({{x, kTop}, {x, bottom}}, "#8a949d", 0.6);
      drawing_.Text(x, bottom + 16, fmt::format("{:g}", std::abs(e) < 1e-9 ? 0 : e), 0, 12, kInk);
    }
    for (double n = std::ceil(low.y() / step) * step; n < high.y(); n += step) {
      const double y = Y(n * unit_.metres);
      drawing_.Line({{kLeft, y}, {right, y}}, "#8a949d", 0.6);
      drawing_.Text(kLeft - 6, y + 4, fmt::format("{:g}", std::abs(n) < 1e-9 ? 0 : n), 1, 12, kInk);
    }
    drawing_.Line({{kLeft, kTop}, {right, kTop}, {right, bottom}, {kLeft, bottom}, {kLeft, kTop}}, kInk, 1);
    const std::string in = " (" + unit_.name + ")";
    drawing_.Text(0.5 * (kLeft + right), bottom + 33, (scene_.on_earth ? "east" : "x") + in, 0, 12, kInk);
    drawing_.Text(14, 0.5 * (kTop + bottom), (scene_.on_earth ? "north" : "y") + in, 0, 12, kInk, false, true);
  }

  size_t IndexOf(const std::string& run) const {
    return static_cast<size_t>(std::find(scene_.runs.begin(), scene_.runs.end(), run) - scene_.runs.begin());
  }
  const char* ColourOf(const std::string& run) const { return kRunColours[IndexOf(run) % std::size(kRunColours)]; }
  bool Dashed(const std::string& run) const { return IndexOf(run) / std::size(kRunColours) % 2 == 1; }

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
      drawing_.Line(line, ColourOf(path.run), 2.5, Dashed(path.run));
      lines_.push_back(std::move(line));
    }
  }

  void Errors() {
    for (const SceneError& e : scene_.errors) {
      const EnlargedMark mark = MarkOf(e);
      const bool whole = MostEnlarged(mark, low_, high_) >= enlarged_;
      if (whole && e.sigma_m) Ellipse(e);
      if (!whole) ++cut_;
      // One that leaves the frame ends there.
      const Eigen::Vector2d d = e.difference.head<2>();
      const double inside = MostEnlarged({mark.place_m, d.cwiseMin(0), d.cwiseMax(0), d.norm(), 0}, low_, high_);
      if (inside > 0) Arrow(e, std::min(enlarged_, inside), inside >= enlarged_);
    }
  }

  void Ellipse(const SceneError& e) {
    const double x = X(e.reference_position.x()), y = Y(e.reference_position.y()), size = scale_ * enlarged_;
    std::vector<std::pair<double, double>> ellipse;
    for (int k = 0; k <= 40; ++k) {
      const double a = 2 * M_PI * k / 40;
      ellipse.emplace_back(x + size * (e.difference.x() + kSigmas95 * e.sigma_m->x() * std::cos(a)),
                           y - size * (e.difference.y() + kSigmas95 * e.sigma_m->y() * std::sin(a)));
    }
    drawing_.Line(ellipse, "#ffffff", 3);
    drawing_.Line(ellipse, kEllipse, 1.4, true);
  }

  void Arrow(const SceneError& e, double enlarged, bool head_too) {
    const double x = X(e.reference_position.x()), y = Y(e.reference_position.y());
    const double dx = scale_ * enlarged * e.difference.x(), dy = -scale_ * enlarged * e.difference.y();
    drawing_.Line({{x, y}, {x + dx, y + dy}}, "#ffffff", 4);
    drawing_.Line({{x, y}, {x + dx, y + dy}}, kVector, 1.8);
    lines_.push_back({{x, y}, {x + dx, y + dy}});
    const double length = std::hypot(dx, dy);
    if (length < 4 || !head_too) return;
    const double ux = dx / length, uy = dy / length, head = std::min(8.0, 0.5 * length);
    const double bx = x + dx - head * ux, by = y + dy - head * uy;
    drawing_.Area(
        {{x + dx, y + dy}, {bx - 0.4 * head * uy, by + 0.4 * head * ux}, {bx + 0.4 * head * uy, by - 0.4 * head * ux}},
        kVector);
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
    if (!scene_.errors.empty()) {  // before the runs, of which there may be too many
      entry(fmt::format("difference x {:g}", enlarged_), kVector, 1.8, false);
      const bool ellipses =
          std::any_of(scene_.errors.begin(), scene_.errors.end(), [](const SceneError& e) { return e.sigma_m; });
      if (ellipses) entry(fmt::format("its 95 % ellipse x {:g}", enlarged_), kEllipse, 1.4, true);
    }
    for (const std::string& run : scene_.runs) entry(run, ColourOf(run), 3, Dashed(run));
  }

  const SceneModel& scene_;
  const DisplayUnit& unit_;
  Drawing drawing_;
  std::vector<std::vector<std::pair<double, double>>> lines_;  // that names keep clear of
  Eigen::Vector2d low_, high_;
  double scale_ = 1, enlarged_ = 1;
  int cut_ = 0;  // differences that leave the frame
};

}  // namespace

double RoundDown(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (double factor : {5.0, 2.0}) {
    if (factor * decade <= value) return factor * decade;
  }
  return decade;
}

double MostEnlarged(const EnlargedMark& mark, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                    double apart_m) {
  constexpr double kShare = 0.5, kNone = std::numeric_limits<double>::infinity();
  double most = mark.half_axis_m > 0 ? kShare * apart_m / mark.half_axis_m : kNone;
  for (int k = 0; k < 2; ++k) {
    const double right = high_m[k] - mark.place_m[k], left = mark.place_m[k] - low_m[k];
    if (right <= 0 || left <= 0) return 0;
    if (mark.high_m[k] > 0) most = std::min(most, right / mark.high_m[k]);
    if (mark.low_m[k] < 0) most = std::min(most, left / -mark.low_m[k]);
  }
  return most;
}

double ApartOf(const std::vector<EnlargedMark>& marks, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m) {
  const double same = 0.02 * (high_m - low_m).maxCoeff();
  std::vector<double> nearest;
  for (const EnlargedMark& a : marks) {
    double least = std::numeric_limits<double>::infinity();
    for (const EnlargedMark& b : marks) {
      const double d = (a.place_m - b.place_m).norm();
      if (d > same) least = std::min(least, d);
    }
    if (std::isfinite(least)) nearest.push_back(least);
  }
  return nearest.empty() ? (high_m - low_m).minCoeff() : Median(std::move(nearest));
}

double EnlargementOf(const std::vector<EnlargedMark>& marks, const Eigen::Vector2d& low_m,
                     const Eigen::Vector2d& high_m, double arrow_m) {
  constexpr double kGross = 0.2, kShortest = 1e-5;
  constexpr size_t kOneIn = 8;
  if (marks.empty()) return 1;
  const double apart = ApartOf(marks, low_m, high_m);
  std::vector<double> arrows, most;
  for (const EnlargedMark& mark : marks) {
    arrows.push_back(mark.arrow_m);
    most.push_back(MostEnlarged(mark, low_m, high_m, apart));
  }
  std::sort(most.begin(), most.end());
  const double gross = kGross * most[most.size() / 2];
  const double all = most[most.size() / kOneIn] < gross ? most.front() : std::max(most.front(), gross);
  return std::max(1.0, RoundDown(std::max(1.0, std::min(all, arrow_m / std::max(kShortest, Median(arrows))))));
}

std::string EnlargedText(double factor) {
  return factor == 1 ? "at true scale" : fmt::format("{:g} times enlarged", factor);
}

Plan PlanOf(const SceneModel& scene, const DisplayUnit& unit) { return PlanPainter(scene, unit).Draw(); }

}  // namespace trigpoint
