// Small pictures in a list, read in the background for the rows in sight alone.
#pragma once

#include <QIcon>
#include <QImage>
#include <QListWidget>
#include <QObject>
#include <QTimer>
#include <functional>
#include <map>
#include <set>

namespace trigpoint {

class Thumbnails : public QObject {
  Q_OBJECT

 public:
  // `load` gives the picture of a row by its text; it runs on another thread and may throw.
  using Load = std::function<QImage(const QString& text)>;
  explicit Thumbnails(QListWidget* list);
  // Forgets all; from now on pictures come from `load`. Null: none.
  void SetSource(Load load);

 private:
  void Look();

  QListWidget* list_;
  Load load_;
  QIcon nothing_;  // where no picture is yet
  QTimer timer_;
  std::set<QString> asked_;
  int generation_ = 0;
};

}  // namespace trigpoint
