// Where a run went and what services have along it, by source and year.
#pragma once

#include <QWidget>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "datasets/import/panorama_provider.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

// A panorama that a service has.
struct FoundPanorama {
  std::string service;
  PanoramaRecord record;
  bool picked = false;
  // "2024", or "undated".
  std::string Year() const { return record.date.empty() ? "undated" : record.date.substr(0, 4); }
};

class ServicesMap : public QWidget {
  Q_OBJECT

 public:
  explicit ServicesMap(QWidget* parent = nullptr);
  // North is up; all is shown.
  void Show(const std::vector<Geodetic>& track, const std::vector<FoundPanorama>& found);
  // Those of the same order as shown; the view stays.
  void Mark(const std::vector<FoundPanorama>& found);
  // Of the scale bar.
  void SetUnit(const DisplayUnit& unit);
  // What the scale bar says: "20 m".
  QString ScaleText() const;
  // Where one is drawn, for tests.
  QPoint PlaceOf(int index) const;

 signals:
  void Clicked(int index);  // of the panoramas shown

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  bool event(QEvent* event) override;  // tool tips

 private:
  QPointF East(const Geodetic& position) const;  // east, north of the first point, m
  QPointF OnScreen(const QPointF& east_north) const;
  double Scale() const;               // pixels a metre
  double ScaleLength() const;         // of the scale bar, in the unit
  int At(const QPoint& place) const;  // the nearest within reach; -1: none
  void DrawLegend(QPainter* painter) const;
  QColor ColourOf(const std::string& year) const;

  std::vector<FoundPanorama> found_;
  std::vector<QPointF> track_, places_;
  std::map<std::string, int> years_;  // with how many there are, in order
  std::vector<std::string> services_;
  DisplayUnit unit_;
  Geodetic origin_;
  QRectF extent_;
  double zoom_ = 1;
  QPointF shift_, pressed_;  // px
  bool dragged_ = false;
};

}  // namespace trigpoint
