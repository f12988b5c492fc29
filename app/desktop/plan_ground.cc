#include "app/desktop/plan_ground.h"

#include <QPainter>
#include <algorithm>
#include <cmath>
#include <map>

#include "datasets/project/project.h"
#include "eval/report/plan.h"
#include "eval/scene/ground_picture.h"
#include "eval/scene/scene_model.h"

namespace trigpoint {

namespace {

constexpr double kLonger_px = 1600;    // of the ground's picture
constexpr double kLeastExtent_m = 20;  // of the ground
constexpr double kMargin = 0.15;       // around the sketch, share of its extent
constexpr int kAerial_px = 2048;       // as read
constexpr int kGridText_px = 40;
constexpr double kFacing_px = 70;       // stroke that shows where a tag faces
constexpr double kEllipseShare = 0.04;  // of the picture's longer side: the largest ellipse
const QColor kInk(29, 35, 41), kBlue(0, 90, 150), kGreen(0, 110, 80), kOrange(180, 70, 0), kGrey(95, 105, 115),
    kPurple(140, 60, 120);

QPointF Towards(double heading_rad, double length) {  // in a picture whose north is up
  return {length * std::sin(heading_rad), -length * std::cos(heading_rad)};
}

void DrawGrid(PlanGround* ground, double metres_per_unit) {
  QPainter painter(&ground->picture);
  QFont font = painter.font();
  font.setPixelSize(kGridText_px);
  painter.setFont(font);
  const Eigen::Vector2d low = ground->low_m / metres_per_unit, high = ground->high_m / metres_per_unit;
  const double step = RoundDown((high - low).maxCoeff() / 5);
  const auto label = [](double value) { return QString::number(std::abs(value) < 1e-9 ? 0 : value, 'g', 6); };
  for (int axis = 0; axis < 2; ++axis) {
    for (double v = std::ceil(low[axis] / step) * step; v < high[axis]; v += step) {
      Eigen::Vector2d from = ground->low_m, to = ground->high_m;
      from[axis] = to[axis] = v * metres_per_unit;
      const QPointF a = ground->PixelOf(from), b = ground->PixelOf(to);
      painter.setPen(QPen(QColor(95, 105, 115, 110), 1));
      painter.drawLine(a, b);
      painter.setPen(kInk);
      painter.drawText(a + QPointF(4, -6), label(v) + (axis == 0 ? " E" : " N"));
    }
  }
}

PictureMark ItemMark(const Sketch& sketch, size_t index, const QPointF& at) {
  const SketchItem& item = sketch.items()[index];
  PictureMark mark;
  mark.points << at;
  mark.object = "sketch:" + QString::number(index);
  mark.text = QString::fromStdString(item.name);
  mark.layer = QString::fromStdString(item.kind);
  mark.movable = item.local_m.has_value();
  mark.colour = item.kind == "tag" ? kInk : item.kind == "candidate" ? kGrey : item.kind == "path" ? kBlue : kGreen;
  if (item.kind == "station" || item.kind == "control" || item.kind == "check") {
    mark.kind = PictureMark::Kind::kCircle;
    mark.points << QPointF(item.kind == "station" ? 9 : 14, 0);
    if (item.kind == "check") mark.colour = kPurple;
    if (item.kind != "station") mark.text.clear();  // the tag's id stands there
  }
  if (item.kind == "path") mark.text.clear();
  return mark;
}

PictureMark Line(const QPointF& from, const QPointF& to, const QColor& colour) {
  PictureMark line;
  line.kind = PictureMark::Kind::kLine;
  line.points << from << to;
  line.colour = colour;
  return line;
}

}  // namespace

QPointF PlanGround::PixelOf(const Eigen::Vector2d& place) const {
  return {px_per_m * (place.x() - low_m.x()), px_per_m * (high_m.y() - place.y())};
}

Eigen::Vector2d PlanGround::PlaceOf(const QPointF& pixel) const {
  return {low_m.x() + pixel.x() / px_per_m, high_m.y() - pixel.y() / px_per_m};
}

bool PlanGround::Holds(const Eigen::Vector2d& place) const {
  return (place.array() >= low_m.array()).all() && (place.array() <= high_m.array()).all();
}

PlanGround MakePlanGround(const Project& project, const Sketch& sketch, double metres_per_unit, QString* problem) {
  PlanGround ground;
  std::optional<SceneAerial> aerial;
  const auto& file = project.site().aerial;
  if (!file.empty() && project.has_frame()) {
    try {
      aerial = ReadAerial(file, project.frame(), 0, kAerial_px);
    } catch (const std::exception& e) {
      *problem = QString::fromUtf8(e.what());
    }
  }
  bool any = false;
  const auto include = [&](const Eigen::Vector3d& p) {
    ground.low_m = any ? ground.low_m.cwiseMin(p.head<2>()).eval() : p.head<2>().eval();
    ground.high_m = any ? ground.high_m.cwiseMax(p.head<2>()).eval() : p.head<2>().eval();
    any = true;
  };
  for (size_t i = 0; i < sketch.items().size(); ++i) {
    if (const auto place = sketch.PlaceOf(i)) include(*place);
  }
  const Eigen::Vector2d extent = ground.high_m - ground.low_m;
  const double margin = std::max(kMargin * extent.maxCoeff(), (kLeastExtent_m - extent.maxCoeff()) / 2);
  ground.low_m.array() -= margin;
  ground.high_m.array() += margin;
  if (aerial) {
    for (const Eigen::Vector3d& p : aerial->vertices) include(p);
  }
  const Eigen::Vector2d size = ground.high_m - ground.low_m;
  ground.px_per_m = kLonger_px / size.maxCoeff();
  if (aerial) {
    const cv::Mat image = GroundImage(*aerial, ground.low_m, ground.high_m, ground.px_per_m);
    ground.picture =
        QImage(image.data, image.cols, image.rows, static_cast<int>(image.step), QImage::Format_BGR888).copy();
  } else {
    ground.picture = QImage(std::max(1, static_cast<int>(ground.px_per_m * size.x())),
                            std::max(1, static_cast<int>(ground.px_per_m * size.y())), QImage::Format_BGR888);
    ground.picture.fill(Qt::white);
  }
  DrawGrid(&ground, metres_per_unit);
  return ground;
}

double EllipseFactor(const std::vector<PlannedEllipse>& ellipses, const PlanGround& ground) {
  double largest = 0;
  for (const PlannedEllipse& e : ellipses) largest = std::max(largest, e.a_m);
  if (!(largest > 0)) return 1;
  return std::max(1.0, RoundDown(kEllipseShare * (ground.high_m - ground.low_m).maxCoeff() / largest));
}

std::vector<PictureMark> SketchMarks(const Sketch& sketch, const PlanGround& ground,
                                     const std::vector<PlannedEllipse>& ellipses, double enlarged,
                                     const std::vector<PlannedPlace>& places) {
  std::vector<PictureMark> marks, lines;
  std::map<std::string, QPointF> corners;  // the last one of each path
  for (size_t i = 0; i < sketch.items().size(); ++i) {
    const auto place = sketch.PlaceOf(i);
    if (!place) continue;
    const SketchItem& item = sketch.items()[i];
    const QPointF at = ground.PixelOf(place->head<2>());
    marks.push_back(ItemMark(sketch, i, at));
    if (item.heading_rad) lines.push_back(Line(at, at + Towards(*item.heading_rad, kFacing_px), marks.back().colour));
    if (item.kind != "path") continue;
    const auto last = corners.find(item.name);
    if (last != corners.end()) {
      lines.push_back(Line(last->second, at, kBlue));
      last->second = at;
    } else {
      corners[item.name] = at;
      marks.back().text = QString::fromStdString(item.name);
    }
  }
  for (const PlannedEllipse& e : ellipses) {
    PictureMark outline;
    outline.kind = PictureMark::Kind::kOutline;
    outline.colour = kOrange;
    const QPointF centre = ground.PixelOf(e.centre_m);
    constexpr int kCorners = 48;
    const double scale = enlarged * ground.px_per_m;
    for (int k = 0; k < kCorners; ++k) {
      const double t = 2 * M_PI * k / kCorners;
      outline.points << centre + Towards(e.bearing_rad, scale * e.a_m * std::cos(t)) +
                            Towards(e.bearing_rad + M_PI / 2, scale * e.b_m * std::sin(t));
    }
    lines.push_back(outline);
  }
  for (const PlannedPlace& p : places) {
    PictureMark mark;
    mark.kind = PictureMark::Kind::kCircle;
    mark.colour = kOrange;
    mark.points << ground.PixelOf(p.place_m) << QPointF(12, 0);
    mark.text = QObject::tr("proposed %1").arg(p.rank);
    lines.push_back(mark);
  }
  marks.insert(marks.begin(), lines.begin(), lines.end());  // items lie above
  return marks;
}

}  // namespace trigpoint
