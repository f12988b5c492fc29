// The ground that a sketch is drawn on: the aerial image if there is one, a grid; and the sketch as marks.
#pragma once

#include <Eigen/Core>
#include <QImage>
#include <QPointF>
#include <optional>
#include <vector>

#include "app/desktop/picture_view.h"
#include "app/desktop/sketch.h"

namespace trigpoint {

class Project;

// A rectangle of the site's ground as a picture; site ENU (metres), north up.
struct PlanGround {
  QImage picture;
  Eigen::Vector2d low_m = Eigen::Vector2d::Zero(), high_m = Eigen::Vector2d::Zero();
  double px_per_m = 1;

  QPointF PixelOf(const Eigen::Vector2d& east_north_m) const;
  Eigen::Vector2d PlaceOf(const QPointF& pixel) const;
  bool Holds(const Eigen::Vector2d& east_north_m) const;
};

// Around the sketch and the project's aerial image, with a grid in units of so many metres. `problem`: why that image
// cannot be shown; empty otherwise.
PlanGround MakePlanGround(const Project& project, const Sketch& sketch, double metres_per_unit, QString* problem);

// A tag's place as `plan` predicts it: results/plan/tags.csv.
struct PlannedEllipse {
  int tag_id = -1;
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double a_m = 0, b_m = 0, bearing_rad = 0;  // half axes at 1 sigma; of the long one, clockwise from north
};
// A place that `plan` proposes.
struct PlannedPlace {
  int rank = 0;
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
};

// Items are objects "sketch:INDEX" that can be moved. `enlarged`: how many times ellipses are drawn larger.
std::vector<PictureMark> SketchMarks(const Sketch& sketch, const PlanGround& ground,
                                     const std::vector<PlannedEllipse>& ellipses, double enlarged,
                                     const std::vector<PlannedPlace>& places);
// A round factor at which the ellipses can be seen and do not hide the site; 1: there are none.
double EllipseFactor(const std::vector<PlannedEllipse>& ellipses, const PlanGround& ground);

}  // namespace trigpoint
