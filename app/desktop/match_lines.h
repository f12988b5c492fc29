// Lines from the features of one picture to those of another beside or below it.
#pragma once

#include <QColor>
#include <QPointF>
#include <QWidget>
#include <vector>

namespace trigpoint {

class PictureView;

struct MatchPair {
  QPointF first, second;  // px of either picture
  QColor colour;
};

// Lies over both views, whose common parent it has; takes no clicks.
class MatchLines : public QWidget {
  Q_OBJECT

 public:
  MatchLines(PictureView* first, PictureView* second, QWidget* parent);
  void SetPairs(std::vector<MatchPair> pairs);
  const std::vector<MatchPair>& pairs() const { return pairs_; }
  // How many have both ends in sight.
  int InSight() const;

 protected:
  void paintEvent(QPaintEvent* event) override;
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  // The ends of a pair, in this widget's pixels; false if one is out of sight.
  bool Ends(const MatchPair& pair, QPointF* first, QPointF* second) const;

  PictureView *first_, *second_;
  std::vector<MatchPair> pairs_;
};

}  // namespace trigpoint
