// One picture with what was found in it: zoom to the pixel, pan, all by mouse or keyboard. Pixels count from the centre
// of the first one, as everywhere.
#pragma once

#include <QColor>
#include <QImage>
#include <QPointF>
#include <QPolygonF>
#include <QRectF>
#include <QString>
#include <QWidget>
#include <optional>
#include <vector>

namespace trigpoint {

struct PictureMark {
  enum class Kind { kCross, kLine, kOutline, kCircle };
  Kind kind = Kind::kCross;
  QPolygonF points;  // cross: one; line: two; outline: closed; circle: centre, and (radius px, 0)
  QColor colour;
  QString text;          // drawn beside it where there is room
  QString layer;         // "detections", "tracks", ...
  QString object;        // what it is, as the review names objects; may be empty
  bool movable = false;  // by dragging its centre
  bool strong = false;   // drawn as the highlighted object is
};

class PictureView : public QWidget {
  Q_OBJECT

 public:
  explicit PictureView(QWidget* parent = nullptr);

  void SetPicture(const QImage& image, const QString& title);
  void SetMarks(std::vector<PictureMark> marks);
  void SetHighlight(const QString& object);
  const QImage& image() const { return image_; }
  const std::vector<PictureMark>& marks() const { return marks_; }

  void Fit();
  // `pixel` in the middle, `scale` screen pixels a picture pixel.
  void LookAt(const QPointF& pixel, double scale);
  // `part` of the picture in the middle, large enough to judge its corners with its surroundings as far as there is
  // room; so it stays when the view changes its size, until it is moved or zoomed.
  void LookAt(const QRectF& part);
  double scale() const { return scale_; }
  // At which the whole picture just fits.
  double FittedScale() const;
  QPointF PixelAt(const QPointF& widget) const;
  QPointF WidgetAt(const QPointF& pixel) const;

 signals:
  void Clicked(const QPointF& pixel, const QString& object);
  void Hovered(const QPointF& pixel);
  void ViewChanged();  // another part of the picture is seen
  void MarkMoved(const QString& object, const QPointF& pixel);
  void DoubleClicked(const QString& object);
  void MenuAsked(const QString& object, const QPoint& at);  // by a right click on a mark; `at` on the screen

 protected:
  bool event(QEvent* event) override;
  void paintEvent(QPaintEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;
  void contextMenuEvent(QContextMenuEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;

 private:
  void PaintMark(QPainter* painter, const PictureMark& mark, bool strong) const;
  void PaintNames(QPainter* painter);
  void Zoom(double factor, const QPointF& about);
  void Release();  // neither fitted nor kept on a part
  QString ObjectAt(const QPointF& pixel) const;
  int MovableAt(const QPointF& pixel) const;  // index of the mark, -1: none

  QImage image_;
  QString title_;
  std::vector<PictureMark> marks_;
  QString highlight_;
  double scale_ = 1;
  QPointF offset_;  // widget position of the picture's corner
  bool fitted_ = true;
  std::optional<QRectF> part_;  // looked at
  QPointF pressed_;
  bool dragged_ = false;
  int moved_ = -1;  // index of the mark that is dragged
};

}  // namespace trigpoint
