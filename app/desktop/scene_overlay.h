// What lies over the scene and stays when it moves: a cube that shows and sets the direction of view; in the plan the
// scale, north and a grid of coordinates.
#pragma once

#include <Eigen/Core>
#include <QRectF>
#include <QString>
#include <QWidget>
#include <array>
#include <vector>

namespace trigpoint {

class ViewCube : public QWidget {
  Q_OBJECT

 public:
  explicit ViewCube(QWidget* parent);
  // Axes of the viewer in the scene's frame: columns right, up, towards the viewer.
  void SetView(const Eigen::Matrix3d& scene_from_viewer);
  // East and north have names; else x and y.
  void SetOnEarth(bool on_earth);
  // Where a face's middle is drawn; outside the widget where the face is not seen. For tests.
  QPointF MiddleOf(const Eigen::Vector3d& face) const;

 signals:
  void Chosen(const Eigen::Vector3d& from);  // look from there: the outward normal of a face

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void leaveEvent(QEvent* event) override;

 private:
  QPolygonF Outline(const Eigen::Vector3d& face) const;
  QPointF At(const Eigen::Vector3d& corner) const;
  int FaceAt(const QPointF& at) const;  // -1: none
  QString NameOf(int face) const;

  Eigen::Matrix3d scene_from_viewer_ = Eigen::Matrix3d::Identity();
  bool on_earth_ = false;
  int hovered_ = -1;
};

// Coordinates of a plan: across and up in pixels of the widget.
struct PlanFrame {
  QString name;        // "EPSG:32632", "site"
  QString unit = "m";  // of the grid and the bar
  double bar_px = 0;   // pixels a unit of the bar
  // Grid coordinates of a pixel: origin + a * x + b * y.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero(), a = Eigen::Vector2d::UnitX(), b = Eigen::Vector2d::UnitY();
  double north_deg = 0;  // of the grid, on the screen, clockwise from up
  bool has_north = true;
  std::vector<QRectF> legend;  // the scene's, line by line: numbers of the grid keep away from it
  bool operator==(const PlanFrame&) const = default;
};

// Takes no clicks.
class PlanOverlay : public QWidget {
  Q_OBJECT

 public:
  explicit PlanOverlay(QWidget* parent);
  void SetFrame(const PlanFrame& frame);
  const PlanFrame& frame() const { return frame_; }

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  void PaintGrid(QPainter* painter) const;
  void PaintBar(QPainter* painter) const;
  double BarLength() const;  // in the frame's unit
  QString BarText() const;
  QRectF BarBox() const;  // with its text: numbers of the grid keep away from it

  PlanFrame frame_;
};

}  // namespace trigpoint
