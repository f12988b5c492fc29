#include "app/desktop/icons.h"

#include <QApplication>
#include <QIconEngine>
#include <QMap>
#include <QPainter>
#include <QPalette>
#include <QStringList>

namespace trigpoint {

namespace {

// On 24 by 24 units: l line, a area, o circle (x y radius), d dot (x y radius); strokes are two units wide.
const QMap<QString, QString>& Drawings() {
  static const QMap<QString, QString> kDrawings = {
      {"overview",
       "l 3 3 10 3 10 10 3 10 3 3; l 14 3 21 3 21 10 14 10 14 3; l 3 14 10 14 10 21 3 21 3 14; "
       "l 14 14 21 14 21 21 14 21 14 14"},
      {"run", "a 6 3 20 12 6 21"},
      {"scene", "l 12 2 21 7 21 17 12 22 3 17 3 7 12 2; l 3 7 12 12 21 7; l 12 12 12 22"},
      {"images", "l 2 4 22 4 22 20 2 20 2 4; l 4 18 9 11 13 16 16 13 20 18; o 16 9 2"},
      {"tables", "l 2 4 22 4 22 20 2 20 2 4; l 2 9 22 9; l 2 15 22 15; l 9 4 9 20"},
      {"charts", "l 3 2 3 21 22 21; l 6 17 11 10 15 13 21 5; d 11 10 2; d 15 13 2"},
      {"compare", "l 2 5 10 5 10 19 2 19 2 5; l 14 5 22 5 22 19 14 19 14 5; l 10 12 14 12"},
      {"review", "l 3 4 14 4; l 3 10 11 10; l 3 16 9 16; l 11 16 15 20 22 10"},
      {"panoramas", "l 2 7 7 5 12 4 17 5 22 7 22 17 17 19 12 20 7 19 2 17 2 7; l 8 5 8 19; l 16 5 16 19"},
      {"calibration",
       "l 3 3 21 3 21 21 3 21 3 3; a 3 3 9 3 9 9 3 9; a 15 3 21 3 21 9 15 9; a 9 9 15 9 15 15 9 15; "
       "a 3 15 9 15 9 21 3 21; a 15 15 21 15 21 21 15 21"},
      {"check", "o 12 12 9; l 7 12 11 16 17 8"},
      {"open", "l 2 19 2 5 9 5 11 8 20 8 20 11; l 2 19 6 11 23 11 19 19 2 19"},
      {"reload", "l 20 8 17 5 12 3 7 5 4 9 4 14 7 19 12 21 17 19 20 15; a 22 3 22 10 15 10"},
      {"report", "l 5 2 15 2 20 7 20 22 5 22 5 2; l 15 2 15 7 20 7; l 9 12 16 12; l 9 17 16 17"},
      {"export", "l 12 17 12 6; a 7 8 17 8 12 2; l 3 15 3 21 21 21 21 15"},
      {"publish", "l 6 11 6 7 9 3 15 3 18 7 18 11; l 4 11 20 11 20 21 4 21 4 11; d 12 16 2"},
      {"undo", "l 8 9 16 9 20 12 20 16 16 20 9 20; a 9 3 9 15 2 9"},
      {"redo", "l 16 9 8 9 4 12 4 16 8 20 15 20; a 15 3 15 15 22 9"},
      {"cancel", "l 5 5 19 19; l 19 5 5 19"},
      {"print", "l 7 8 7 2 17 2 17 8; l 3 8 21 8 21 17 17 17; l 7 17 3 17 3 8; l 7 14 17 14 17 22 7 22 7 14"},
      {"plan", "l 3 5 9 3 15 5 21 3 21 19 15 21 9 19 3 21 3 5; l 9 3 9 19; l 15 5 15 21"},
      {"help", "o 12 12 9; l 9 10 9 8 11 7 13 7 15 8 15 10 12 12 12 14; d 12 17 1"}};
  return kDrawings;
}

class DrawnIcon : public QIconEngine {
 public:
  explicit DrawnIcon(QString drawing) : drawing_(std::move(drawing)) {}
  QIconEngine* clone() const override { return new DrawnIcon(drawing_); }
  QPixmap pixmap(const QSize& size, QIcon::Mode mode, QIcon::State state) override {
    QPixmap pixmap(size);
    pixmap.fill(Qt::transparent);
    QPainter painter(&pixmap);
    paint(&painter, QRect(QPoint(0, 0), size), mode, state);
    return pixmap;
  }
  void paint(QPainter* painter, const QRect& rect, QIcon::Mode mode, QIcon::State) override {
    const QColor ink = QApplication::palette().color(mode == QIcon::Disabled ? QPalette::Disabled : QPalette::Active,
                                                     QPalette::WindowText);
    const double side = std::min(rect.width(), rect.height());
    painter->save();
    painter->setRenderHint(QPainter::Antialiasing);
    painter->translate(rect.center() + QPointF(0.5, 0.5) - QPointF(side / 2, side / 2));
    painter->scale(side / 24, side / 24);
    for (const QString& part : drawing_.split(';')) Draw(painter, part.trimmed(), ink);
    painter->restore();
  }

 private:
  static void Draw(QPainter* painter, const QString& part, const QColor& ink) {
    QVector<double> numbers;
    const QStringList words = part.split(' ');
    for (int i = 1; i < words.size(); ++i) numbers << words[i].toDouble();
    const QChar kind = words.front()[0];
    const bool filled = kind == 'a' || kind == 'd';
    painter->setPen(filled ? QPen(Qt::NoPen) : QPen(ink, 2, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin));
    painter->setBrush(filled ? QBrush(ink) : QBrush(Qt::NoBrush));
    if (kind == 'o' || kind == 'd') {
      painter->drawEllipse(QPointF(numbers[0], numbers[1]), numbers[2], numbers[2]);
      return;
    }
    QPolygonF corners;
    for (int i = 0; i + 1 < numbers.size(); i += 2) corners << QPointF(numbers[i], numbers[i + 1]);
    filled ? painter->drawPolygon(corners) : painter->drawPolyline(corners);
  }

  QString drawing_;
};

}  // namespace

QIcon IconNamed(const QString& name) {
  const auto drawing = Drawings().find(name);
  return drawing == Drawings().end() ? QIcon() : QIcon(new DrawnIcon(*drawing));
}

}  // namespace trigpoint
